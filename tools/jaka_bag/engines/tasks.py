"""One task a log, done by an engine: a function of a ``LogTask`` that gives a ``LogResult``.

Nothing here knows Dask. A function of this shape gives the same result in this process, in processes of this
computer, and on the workers of a cluster.
"""
import time
from typing import Any, Callable, Dict, Iterable, List, NamedTuple

from .. import __version__
from ..errors import JakaBagError
from ..units import NS_PER_S

DONE, SKIPPED, FAILED = "done", "skipped", "failed"


class LogTask(NamedTuple):
    """The work on one log.

    Attributes:
        path: Path of the log, as the workers name it.
        settings: Further arguments of the function; they are pickled once for each task, so they are small.
    """

    path: str
    settings: Any = None


class LogResult(NamedTuple):
    """The result of a task.

    Attributes:
        path: Path of the task's log.
        status: ``DONE``, ``SKIPPED`` (there was nothing to do) or ``FAILED``.
        reason: The reason for a failure or skip; notes on a task that is done.
        size: Bytes of the log that were worked on.
        messages: Messages that were worked on.
        value: The function's result, picklable.
        seconds: Wall time on the worker, s. The only attribute that differs between two runs of the same task.
    """

    path: str
    status: str = DONE
    reason: str = ""
    size: int = 0
    messages: int = 0
    value: Any = None
    seconds: float = 0.0


LogFunction = Callable[[LogTask], LogResult]
"""Work on one log: a function of a module, so that it can be pickled. It may raise ``JakaBagError`` and ``OSError``.

It must bear to be called again with the same task, as after the death of a worker, also while the first call runs on.
"""
OnResult = Callable[[LogResult], None]


class BoundFunction(NamedTuple):
    """A function as it is sent to workers: failures become results; other versions of this package are refused.

    Attributes:
        function: The work.
        version: Version of this package where the task was made.
    """

    function: LogFunction
    version: str = __version__

    def __call__(self, task: LogTask) -> LogResult:
        """Do a task. What is a bug is a failure of this log, too: the other logs need not wait for its repair."""
        if self.version != __version__:
            return failure(task, "the worker has jaka_bag %s, this is %s" % (__version__, self.version))
        begin = time.monotonic_ns()
        try:
            result = self.function(task)
        except JakaBagError as error:
            result = failure(task, " ".join(str(error).split()))
        except OSError as error:
            result = failure(task, "%s: %s" % (error.filename or task.path, error.strerror or error))
        except Exception as error:
            result = failure(task, "%s: %s (%s)" % (type(error).__name__, " ".join(str(error).split()), _place(error)))
        return result._replace(seconds=(time.monotonic_ns() - begin) / NS_PER_S)


def _place(error: BaseException) -> str:
    """Return the file and line where an exception was raised."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return "?" if trace is None else "%s:%d" % (trace.tb_frame.f_code.co_filename, trace.tb_lineno)


def failure(task: LogTask, reason: str) -> LogResult:
    """Return the result of a task that failed, with a reason of one line."""
    return LogResult(task.path, FAILED, reason)


class Engine:
    """An executor of tasks."""

    def run(self, function: BoundFunction, tasks: Iterable[LogTask], on_result: OnResult) -> None:
        """See ``run_tasks``."""
        raise NotImplementedError


class Serial(Engine):
    """An engine in this process, with one task after the other."""

    def run(self, function: BoundFunction, tasks: Iterable[LogTask], on_result: OnResult) -> None:
        for task in tasks:
            on_result(function(task))


def run_tasks(function: LogFunction, tasks: Iterable[LogTask], engine: Engine, on_result: OnResult) -> None:
    """Do all tasks.

    Args:
        function: The work; see ``LogFunction``.
        tasks: They are taken as there is room for them, a bounded number before their turn.
        engine: Executor of the tasks.
        on_result: Called in this thread, once for each task, in the order in which they end.

    Raises:
        BagError: The engine cannot be reached. Earlier results were reported; later tasks are not done.
        MissingDependency: The engine's package is not installed.
        KeyboardInterrupt: The user ended it; tasks that wait are not begun.
    """
    engine.run(BoundFunction(function), tasks, on_result)


class Tally:
    """A count of results, with the failed ones.

    Attributes:
        total: Tasks that there are.
        counts: Results by status.
        failed: Results that failed, as they came.
        size: Bytes worked on.
        messages: Messages worked on.
    """

    def __init__(self, total: int) -> None:
        self.total = total
        self.counts: Dict[str, int] = {DONE: 0, SKIPPED: 0, FAILED: 0}
        self.failed: List[LogResult] = []
        self.size = 0
        self.messages = 0

    def add(self, result: LogResult) -> None:
        """Count one more result."""
        self.counts[result.status] += 1
        self.size += result.size
        self.messages += result.messages
        if result.status == FAILED:
            self.failed.append(result)

    @property
    def left(self) -> int:
        """Tasks without a result: they were not begun, or not ended."""
        return self.total - sum(self.counts.values())
