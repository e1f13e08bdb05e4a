"""Options that choose where the tasks of many logs are done, and how far they are."""
import argparse
import os
from typing import NamedTuple, Sequence

from jaka_bag.cli.main import human_bytes
from jaka_bag.cli.options import Report
from jaka_bag.cli.quantities import count, given
from jaka_bag.engines.tasks import FAILED, Engine, LogFunction, LogResult, LogTask, OnResult, Serial, Tally, run_tasks
from jaka_bag.errors import UsageError

_LOG_BYTES = 700_000
"""Bytes whose reading takes as long as all that is done once for each log (``bench_fleet --start``)."""


class EngineChoice(NamedTuple):
    """The engine that does the work.

    Attributes:
        engine: The engine.
        words: The work, and where it is done: a line for people.
    """

    engine: Engine
    words: str


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Add ``--jobs`` and ``--dask``."""
    group = parser.add_argument_group("where the work is done (default: little work in this process, more in a process "
                                      "for each processor)")
    group.add_argument("--jobs", type=count, metavar="N",
                       help="logs at a time on this computer (default: its processors, 1 where there is little to do)")
    group.add_argument("--dask", type=given, metavar="ADDRESS", help="hand the logs to the Dask scheduler there")


def size_of(tasks: Sequence[LogTask]) -> int:
    """Return the bytes of the logs that are files here."""
    return sum(os.path.getsize(task.path) for task in tasks if os.path.isfile(task.path))


def choose_engine(args: argparse.Namespace, tasks: Sequence[LogTask], worth_bytes: int) -> EngineChoice:
    """Choose the engine for some tasks: by the options, else by the size of the work.

    Args:
        args: Options of ``add_engine``.
        tasks: All tasks.
        worth_bytes: Work from which on workers are done sooner than this process alone, their start included: the
            bytes of all logs, and 0.7 MB for each.

    Raises:
        UsageError: The options choose two.
    """
    if args.dask is not None and args.jobs is not None:
        raise UsageError("--jobs is for this computer, not for a cluster elsewhere")
    size = size_of(tasks)
    work = "%d %s, %s" % (len(tasks), "log" if len(tasks) == 1 else "logs", human_bytes(size))
    jobs = max(1, min(args.jobs or os.cpu_count() or 1, len(tasks)))
    is_little = size + _LOG_BYTES * len(tasks) < worth_bytes
    if args.dask is None and (jobs == 1 or args.jobs is None and is_little):
        return EngineChoice(Serial(), "%s: one at a time, in this process" % work)
    if args.dask is None:
        from jaka_bag.engines.processes import Processes
        return EngineChoice(Processes(jobs, "spawn"), "%s: %d at a time, in processes of this computer" % (work, jobs))
    from jaka_bag.engines.dask_engine import Dask
    return EngineChoice(Dask(args.dask), "%s: on the Dask scheduler %s" % (work, args.dask))


def for_workers(args: argparse.Namespace, location: str) -> str:
    """Return the name of a file or folder as workers of a cluster understand it, whose current folder is another."""
    return location if args.dask is None or "://" in location else os.path.abspath(location)


def work_through(function: LogFunction, tasks: Sequence[LogTask], choice: EngineChoice, report: Report,
                 on_result: OnResult) -> Tally:
    """Do all tasks with a progress bar (rate, time left); failed ones are reported at once, the tally at the end.

    Where they are done is the first line.

    Args:
        function: See ``run_tasks``.
        tasks: The size of those whose path is a file here makes the bar's length.
        choice: Engine that does them.
        report: Output for people and scripts.
        on_result: Is given each result.

    Raises:
        BagError: The engine cannot be reached, or was lost; what is left is reported before.
        KeyboardInterrupt: Likewise.
    """
    tally = Tally(len(tasks))
    try:
        report.done(choice.words)
        with report.progress_over(size_of(tasks), "%d logs" % len(tasks)) as progress:
            def take(result: LogResult) -> None:
                tally.add(result)
                on_result(result)
                if result.status == FAILED:
                    progress.close()
                    report.tell("error", ["%s: %s" % (result.path, result.reason.replace(result.path + ": ", "", 1))])
                progress(result.size, result.messages)

            run_tasks(function, tasks, choice.engine, take)
    finally:
        if tally.left:
            report.tell("note", ["%d of %d logs are left: call it again" % (tally.left, tally.total)])
    return tally
