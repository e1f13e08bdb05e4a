"""``jaka_bag merge``: the command line that makes one log of several."""
import argparse

from ..operations.merge import merge
from .options import Report, add_compression, add_report, human_bytes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag merge``."""
    parser.add_argument("sources", nargs="+", metavar="SRC", help=".bag and .mcap files, in any order")
    parser.add_argument("-o", "--output", metavar="DST", required=True,
                        help="its suffix, .bag or .mcap, decides about the format")
    parser.add_argument("--force", action="store_true", help="overwrite the output")
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Merge; the exit code.

    Raises:
        BagError: A source cannot be read, or the target cannot be written or hold it.
    """
    report = Report(args)
    with report.progress(0, args.output) as progress:
        result = merge(args.sources, args.output, args.compression, args.level, args.force, progress)
    report.done("%s: %d messages of %d files, %s" % (args.output, result.messages, len(args.sources),
                                                    human_bytes(result.bytes_written)), result.document())
    for note in result.notes:
        report.note(note)
    report.finish()
    return 0
