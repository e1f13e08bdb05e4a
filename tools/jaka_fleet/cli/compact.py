"""``jaka_bag dataset compact``: the command line that puts the rows of ``runs`` into one file."""
import argparse

from jaka_bag.cli.options import Report, add_report

from ..dataset.runs import check_version, compact, is_in
from ..dataset.store import open_store

EPILOG = """\
dataset add does so by itself in a folder; an object store has no locks, so there one process at a time may do it.

examples:
  jaka_bag dataset compact fleet
  jaka_bag dataset compact s3://plant/fleet
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag dataset compact``."""
    parser.add_argument("dataset", metavar="DATASET", help="a folder or URL that dataset add made")
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Merge the rows of a data set into one file; return the exit code."""
    report = Report(args)
    store = open_store(args.dataset)
    check_version(store)
    removed = store.tidy_up(lambda name: is_in(store, name))
    rows = compact(store)
    notes = ["%d files of a run that was cut off are removed" % len(removed)] if removed else []
    return report.only("%s: %d runs in one file" % (args.dataset, rows), {"dataset": args.dataset, "runs": rows}, notes)
