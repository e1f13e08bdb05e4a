"""``jaka_bag filter``: the command line that takes a part of a log."""
import argparse
import re

from ..errors import UsageError
from ..operations.convert import Job, convert_file
from .main import human_bytes
from .options import (
    Report,
    add_compression,
    add_report,
    add_selection,
    add_source,
    required_output_of,
    selection_of,
    span_of,
)

EPILOG = """\
examples:
  jaka_bag filter run.bag joints.bag -t /jaka_driver/joint_position
  jaka_bag filter run.mcap accident.mcap -s 1700000512 --duration 10s --keep-latched
  jaka_bag filter run.bag small.bag -x '/camera/.*'

What is not in the log is no empty output: a topic, a type or a time that it does not have ends with exit code 2 and the
nearest name, or the log's true range.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag filter`` to a parser."""
    add_source(parser, "its suffix, .bag or .mcap, decides about the format")
    parser.add_argument("expression", nargs="?", help=argparse.SUPPRESS)
    parser.add_argument("--keep-latched", action="store_true",
                        help="also the newest message before --start of each latched publisher, with its own time")
    add_selection(parser)
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Write the log that the filter leaves; return the exit code."""
    report = Report(args)
    if args.expression is not None:
        topics = re.findall(r"""topic\s*==\s*['"]([^'"]+)['"]""", args.expression)
        raise UsageError("there are no expressions as rosbag's; topics are chosen by -t, -e and -x, types by --types, "
                         "times by --start and --until%s" % (", here: -t %s" % " ".join(topics) if topics else ""))
    job = Job(args.source, required_output_of(args), selection_of(args), span_of(args), args.compression, args.level,
              overwrite=args.force, keep_latched=args.keep_latched)
    with report.progress(args.source) as progress:
        result = convert_file(job, progress)
    return report.only("%s: %d messages, %s" % (result.target, result.messages, human_bytes(result.bytes_written)),
                       result.document(), result.notes, result.left_out > 0)
