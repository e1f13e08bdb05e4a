"""``jaka_bag filter``: the command line that takes a part of a log."""
import argparse
from pathlib import Path

from ..operations.convert import Job, convert_file
from .options import (
    Report,
    add_compression,
    add_report,
    add_selection,
    human_bytes,
    selection_of,
    span_of,
    usage_error,
)

_EPILOG = """\
examples:
  jaka_bag filter run.bag -o joints.bag -t /jaka_driver/joint_position
  jaka_bag filter run.mcap -o accident.mcap -s 1700000512 -d 10 --keep-latched
  jaka_bag filter run.bag -o small.bag -x '/camera/.*'
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag filter``."""
    parser.epilog = _EPILOG
    parser.add_argument("source", metavar="SRC", help=".bag or .mcap")
    parser.add_argument("-o", "--output", metavar="DST", required=True,
                        help="its suffix, .bag or .mcap, decides about the format")
    parser.add_argument("--keep-latched", action="store_true",
                        help="also the newest message before --start of each latched publisher, with its own time")
    parser.add_argument("--force", action="store_true", help="overwrite the output")
    add_selection(parser)
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Filter; the exit code.

    Raises:
        BagError: The source cannot be read, or the target cannot be written or hold it.
    """
    if args.end is not None and args.duration is not None:
        return usage_error("--end and --duration do not go together")
    report = Report(args)
    source = Path(args.source)
    job = Job(str(source), args.output, selection_of(args), span_of(args), args.compression, args.level,
              overwrite=args.force, keep_latched=args.keep_latched)
    with report.progress(source.stat().st_size if source.is_file() else 0, source.name) as progress:
        result = convert_file(job, progress)
    report.done("%s: %d messages, %s" % (result.target, result.messages, human_bytes(result.bytes_written)),
                result.document())
    for note in result.notes:
        report.note(note)
    report.finish()
    return 0
