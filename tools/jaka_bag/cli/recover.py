"""``jaka_bag recover``: the command line that saves what can be read of a damaged log."""
import argparse
from pathlib import Path

from ..operations.recover import default_target, recover
from .options import Report, add_compression, add_report, human_bytes

_EPILOG = """\
Keeps everything that can be read of a log that was cut off (.bag.active, .mcap.active, a crash, a full disk), has no
index, or is damaged. What is lost is said, with the bytes concerned. The input is not changed.
Exit code: 0 nothing is known to be lost, 1 the result is partial or there is none, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag recover``."""
    parser.epilog = _EPILOG
    parser.add_argument("source", metavar="SRC", help=".bag, .bag.active, .mcap, .mcap.active")
    parser.add_argument("target", metavar="DST", nargs="?",
                        help=".bag or .mcap; default: SRC without .active, or NAME.recovered.bag")
    parser.add_argument("-o", "--output", metavar="DST", help="the same as DST")
    parser.add_argument("--force", action="store_true", help="overwrite the output")
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Recover; the exit code.

    Raises:
        BagError: Nothing can be read, or the output cannot be written.
    """
    report = Report(args)
    source = Path(args.source)
    target = args.output or args.target or default_target(source)
    with report.progress(source.stat().st_size if source.is_file() else 0, source.name) as progress:
        result = recover(source, target, args.compression, args.level, args.force, progress)
    for loss in result.losses:
        report.lost(loss.describe())
    told = "" if result.expected is None else " of %d" % max(result.expected, result.messages)
    report.done("%s: %d%s messages, %s%s" % (result.target, result.messages, told, human_bytes(result.bytes_written),
                                            "" if result.is_whole else " (PARTIAL)"), result.document())
    report.finish()
    return 0 if result.is_whole else 1
