"""``jaka_bag merge``: the command line that makes one log of several."""
import argparse

from ..operations.merge import merge
from .main import human_bytes
from .options import Report, add_compression, add_output, add_report

EPILOG = """\
examples:
  jaka_bag merge run_*.bag -o run.bag
  jaka_bag merge arm.bag camera.mcap -o cell.mcap -c lz4
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag merge`` to a parser."""
    parser.add_argument("sources", nargs="+", metavar="SRC", help=".bag, .mcap and .mcap.active files, in any order")
    add_output(parser, "its suffix, .bag or .mcap, decides about the format")
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Merge; the exit code."""
    report = Report(args)
    with report.progress(*args.sources) as progress:
        result = merge(args.sources, args.output, args.compression, args.level, args.force, progress)
    line = "%s: %d messages of %d files, %s" % (args.output, result.messages, len(args.sources),
                                               human_bytes(result.bytes_written))
    return report.only(line, result.document(), result.notes)
