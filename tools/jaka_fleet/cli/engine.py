"""Options that choose where the tasks of many logs are done, and how far they are."""
import argparse
import os
from typing import Sequence

from jaka_bag.cli.options import Report
from jaka_bag.cli.quantities import count, given
from jaka_bag.engines.tasks import FAILED, Engine, LogFunction, LogResult, LogTask, OnResult, Serial, Tally, run_tasks
from jaka_bag.errors import UsageError


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Add ``--jobs`` and ``--dask``."""
    group = parser.add_argument_group("where the work is done (default: a Dask cluster of this computer)")
    group.add_argument("--jobs", type=count, metavar="N",
                       help="logs at a time on this computer (default: its processors); 1 needs no Dask")
    group.add_argument("--dask", type=given, metavar="ADDRESS", help="hand the logs to the Dask scheduler there")


def engine_of(args: argparse.Namespace, task_count: int) -> Engine:
    """Return the engine that the options choose for so many tasks.

    Raises:
        UsageError: They choose two.
    """
    if args.dask is not None and args.jobs is not None:
        raise UsageError("--jobs is for this computer, not for a cluster elsewhere")
    jobs = max(1, min(args.jobs or os.cpu_count() or 1, task_count))
    if args.dask is None and jobs == 1:
        return Serial()
    from jaka_bag.engines.dask_engine import Dask
    return Dask(args.dask, jobs)


def for_workers(args: argparse.Namespace, location: str) -> str:
    """Return the name of a file or folder as workers of a cluster understand it, whose current folder is another."""
    return location if args.dask is None or "://" in location else os.path.abspath(location)


def work_through(function: LogFunction, tasks: Sequence[LogTask], engine: Engine, report: Report,
                 on_result: OnResult) -> Tally:
    """Do all tasks with a progress bar (rate, time left); failed ones are reported at once, the tally at the end.

    Args:
        function: See ``run_tasks``.
        tasks: The size of those whose path is a file here makes the bar's length.
        engine: Engine that does them.
        report: Output for people and programs.
        on_result: Is given each result.

    Raises:
        BagError: The engine cannot be reached, or was lost; what is left is reported before.
        KeyboardInterrupt: Likewise.
    """
    tally = Tally(len(tasks))
    try:
        total = sum(os.path.getsize(task.path) for task in tasks if os.path.isfile(task.path))
        with report.progress_over(total, "%d logs" % len(tasks)) as progress:
            def take(result: LogResult) -> None:
                tally.add(result)
                on_result(result)
                if result.status == FAILED:
                    progress.close()
                    report.tell("error", ["%s: %s" % (result.path, result.reason.replace(result.path + ": ", "", 1))])
                progress(result.size, result.messages)

            run_tasks(function, tasks, engine, take)
    finally:
        if tally.left:
            report.tell("note", ["%d of %d logs are left: call it again" % (tally.left, tally.total)])
    return tally
