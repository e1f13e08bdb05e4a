"""``jaka_bag recover``: the command line that saves the readable parts of a damaged log."""
import argparse

from ..operations.recover import default_target, recover
from .main import human_bytes
from .options import Report, add_compression, add_output, add_report

EPILOG = """\
Keeps everything that can be read of a log that was cut off (.bag.active, .mcap.active, a crash, a full disk), has no
index, or is damaged. What is lost is said, with the bytes concerned. The input is not changed. Of a rosbag2 folder
(MCAP or sqlite3, with metadata.yaml or not) the files are read in order; they become a folder with new metadata.yaml.

examples:
  jaka_bag recover run.bag.active
  jaka_bag recover damaged.mcap saved.mcap
  jaka_bag recover run_of_ros2/

Exit code: 0 nothing is known to be lost, 1 the result is partial or there is none, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag recover`` to a parser."""
    parser.add_argument("source", metavar="SRC", help=".bag, .bag.active, .mcap, .mcap.active, .db3, a rosbag2 folder")
    parser.add_argument("target", metavar="DST", nargs="?",
                        help=".bag or .mcap, or a folder of a folder; default: SRC without .active, "
                        "NAME.recovered.bag, or NAME_recovered")
    add_output(parser, "the same as DST", False)
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Recover the logs as the options say; return the exit code."""
    report = Report(args)
    target = args.output or args.target or default_target(args.source)
    with report.progress(args.source) as progress:
        result = recover(args.source, target, args.compression, args.level, args.force, progress)
    report.tell("lost", (loss.describe() for loss in result.losses))
    told = "" if result.expected is None else " of %d" % max(result.expected, result.messages)
    report.only("%s: %d%s messages, %s%s" % (result.target, result.messages, told, human_bytes(result.bytes_written),
                                            "" if result.is_whole else " (PARTIAL)"), result.document(), result.notes)
    return 0 if result.is_whole else 1
