"""``jaka_bag merge``: the command line that makes one log of several."""
import argparse
import os

from ..errors import UsageError
from ..operations.merge import merge
from .main import human_bytes
from .options import Report, add_compression, add_output, add_report

EPILOG = """\
examples:
  jaka_bag merge run_*.bag -o run.bag
  jaka_bag merge arm.bag camera.mcap -o cell.mcap -c lz4
  jaka_bag merge arm.bag camera.mcap cell.mcap    the last one is the output: there is no such file yet
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag merge`` to a parser."""
    parser.add_argument("sources", nargs="+", metavar="SRC",
                        help=".bag, .mcap, .mcap.active and .db3 files, rosbag2 folders, in any order")
    add_output(parser, "its suffix, .bag or .mcap, decides about the format; default: the last name, where there is no "
               "such file yet", False)
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Merge the logs into one; return the exit code."""
    report = Report(args)
    sources, output = args.sources, args.output
    if output is None:
        if len(sources) < 2 or os.path.lexists(sources[-1]):
            raise UsageError("an output is needed: -o DST, or a last name that no file has yet")
        *sources, output = sources
    with report.progress(*sources) as progress:
        result = merge(sources, output, args.compression, args.level, args.force, progress)
    line = "%s: %d messages of %d files, %s" % (output, result.messages, len(sources),
                                               human_bytes(result.bytes_written))
    return report.only(line, result.document(), result.notes, result.left_out > 0)
