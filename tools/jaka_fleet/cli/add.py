"""``jaka_bag dataset add``: the command line that puts logs into a data set."""
import argparse
import re
from typing import List

from jaka_bag.cli.main import human_bytes
from jaka_bag.cli.options import Report, add_report
from jaka_bag.engines.tasks import DONE, SKIPPED, LogResult, LogTask
from jaka_bag.errors import UsageError
from jaka_bag.operations.parquet import load_pyarrow

from ..dataset.adding import AddSettings, add_log, find_logs
from ..dataset.runs import (
    COMPACT_ABOVE,
    LEFT_OUT,
    RECOVERED,
    UNREADABLE,
    RunRow,
    check_version,
    compact,
    is_in,
    loose_count,
)
from ..dataset.store import FolderStore, open_store
from .engine import add_engine, choose_engine, for_workers, work_through

EPILOG = """\
Each topic becomes topic=NAME/date=YYYY-MM-DD/CELL-RUN.parquet, each log a row of the table runs. A log that is in, by
its content, is left alone; a damaged one is recovered, or listed in runs with the reason; nothing stops the rest. Ended
at any moment it leaves no log half in: call it again. With --dask the workers see logs and data set under the same
names, and have the same version of this package.

examples:
  jaka_bag dataset add logs --to fleet                        where there is much to do, on all processors
  jaka_bag dataset add logs --to fleet --cell-from 'logs/(\\w+)/'    the folder below logs is the cell
  jaka_bag dataset add logs --to s3://plant/fleet --cell press_4 --dask tcp://head:8786
"""

_WORTH_BYTES = 120_000_000
"""Work, bytes, that one process does in 1.6 s: then a few have started, and done it (``bench_fleet --start``)."""


def pattern(text: str) -> str:
    """Check that a text is a regular expression; return it."""
    try:
        re.compile(text)
    except re.error as error:
        raise argparse.ArgumentTypeError("%r is not a regular expression: %s" % (text, error)) from None
    return text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag dataset add``."""
    parser.add_argument("sources", metavar="SRC", nargs="+",
                        help="logs, .bag, .mcap or .db3, rosbag2 folders, and folders of such")
    parser.add_argument("--to", metavar="DATASET", required=True,
                        help="the data set: a folder, which is made where it is missing, or a URL as s3://")
    group = parser.add_argument_group("the cell of a log (default: the key 'cell' of the log's metadata)")
    group.add_argument("--cell", metavar="NAME", default="", help="this one")
    group.add_argument("--cell-from", metavar="REGEX", default="", type=pattern,
                       help="what this finds in the log's path; its first group, where it has one")
    parser.add_argument("--again", action="store_true", help="also the logs that are listed as unreadable")
    add_engine(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Add the logs to the data set; return the exit code."""
    load_pyarrow()
    report = Report(args)
    if args.cell and args.cell_from:
        raise UsageError("--cell and --cell-from do not go together")
    settings = AddSettings(for_workers(args, args.to), args.cell, args.cell_from, args.again)
    tasks = [LogTask(path, settings) for path in find_logs([for_workers(args, one) for one in args.sources])]
    choice = choose_engine(args, tasks, _WORTH_BYTES)
    store = open_store(args.to)
    check_version(store, is_to_be_made=True)
    rows: List[RunRow] = []
    skipped: List[LogResult] = []
    known = set()

    def take(result: LogResult) -> None:
        if result.status == SKIPPED:
            skipped.append(result)
        if result.status != DONE:
            return
        row: RunRow = result.value
        if row.hash not in known:
            rows.append(row)
            known.add(row.hash)
        if row.status in (RECOVERED, UNREADABLE):
            report.tell("lost", ["%s: %s: %s" % (row.path, row.status, row.reason)])
        elif row.reason:
            report.tell("note", ["%s: %s" % (row.path, row.reason)])

    def tidy_up() -> None:
        removed = store.tidy_up(lambda name: is_in(store, name))
        if removed:
            report.tell("note", ["%d files of a run that was cut off are removed" % len(removed)])

    tidy_up()
    try:
        tally = work_through(add_log, tasks, choice, report, take)
    finally:
        tidy_up()
    if loose_count(store) > COMPACT_ABOVE and isinstance(store, FolderStore):
        compact(store)
    failed = tally.failed
    damaged = sum(row.status == UNREADABLE for row in rows)
    report.done("%s: %d logs added (%s, %d messages), %d left alone, %d unreadable, %d failed" % (
        args.to, len(rows) - damaged, human_bytes(tally.size), tally.messages, len(tasks) - len(rows) - len(failed),
        damaged, len(failed)))
    report.finish({
        "dataset": args.to, "messages": tally.messages,
        "added": [{"path": row.path, "hash": row.hash, "run": row.run, "cell": row.cell, "status": row.status,
                   "reason": row.reason, "messages": row.messages} for row in rows],
        "skipped": [{"path": result.path, "reason": result.reason} for result in skipped],
        "failed": [{"path": result.path, "reason": result.reason} for result in failed]})
    return 1 if failed or damaged or any(LEFT_OUT in row.reason for row in rows) else 0
