"""``jaka_bag attach``: files and facts added to a log."""
import argparse
from typing import Dict, List, Sequence, Tuple

from ..errors import UsageError
from ..operations.extras import attach, attachment_of
from .main import human_bytes
from .options import Report, add_output, add_report

EPILOG = """\
The log is written again, with the same messages; SRC is not changed. Only an .mcap has a place for attachments.

examples:
  jaka_bag attach run.mcap calibration.yaml -o with.mcap
  jaka_bag attach run.mcap -o with.mcap --metadata cell operator=Li order=4711
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag attach`` to a parser."""
    parser.add_argument("source", metavar="SRC", help=".bag, .mcap, .mcap.active, .db3 or a rosbag2 folder")
    parser.add_argument("files", nargs="*", metavar="FILE", help="files to attach")
    add_output(parser, "the new .mcap")
    parser.add_argument("--name", metavar="NAME", help="name of the attachment (default: that of the file)")
    parser.add_argument("--media-type", metavar="TYPE", help="as text/plain (default: by the file's name)")
    parser.add_argument("--metadata", nargs="+", action="append", default=[], metavar=("NAME", "KEY=VALUE"),
                        help="a metadata record; may be repeated")
    add_report(parser)


def _metadata(words: Sequence[str]) -> Tuple[str, Dict[str, str]]:
    name, *pairs = words
    values: Dict[str, str] = {}
    for pair in pairs:
        key, separator, value = pair.partition("=")
        if not separator:
            raise UsageError("--metadata %s: %r is not KEY=VALUE" % (name, pair))
        values[key] = value
    if not values:
        raise UsageError("--metadata %s: give KEY=VALUE" % name)
    return name, values


def run(args: argparse.Namespace) -> int:
    """Attach the files to the log; return the exit code."""
    report = Report(args)
    metadata: List[Tuple[str, Dict[str, str]]] = [_metadata(words) for words in args.metadata]
    if not (args.files or metadata):
        raise UsageError("nothing to attach: give FILE or --metadata")
    if args.name and len(args.files) != 1:
        raise UsageError("--name is for one FILE")
    files = [attachment_of(path, args.name, args.media_type) for path in args.files]
    with report.progress(args.source) as progress:
        result = attach(args.source, args.output, files, metadata, args.force, progress)
    return report.only("%s: %d messages, %d attachments and %d metadata records more, %s" % (
        result.target, result.messages, len(files), len(metadata), human_bytes(result.bytes_written)),
        result.document(), result.notes)
