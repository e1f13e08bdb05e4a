"""Tasks in processes of this computer, by the standard library alone."""
import multiprocessing
import os
import signal
from typing import Any, Iterable, Optional

from ..interrupts import held_back
from ..output_file import abort_all
from .tasks import BoundFunction, Engine, LogResult, LogTask, OnResult, failure


class _Worker:
    """The signal handling of a worker process: the parent gets Ctrl-C and ends its workers by SIGTERM."""

    is_at_work = is_ending = False

    @classmethod
    def prepare(cls) -> None:
        """Run in each worker when it starts."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, cls._on_end)

    @classmethod
    def _on_end(cls, number: int, frame: Any) -> None:
        cls.is_ending = True
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # the pool sends another one when it sees that a worker is gone
        if cls.is_at_work:
            raise KeyboardInterrupt  # the half output is removed on the way
        os._exit(1)

    @classmethod
    def work(cls, function: BoundFunction, task: LogTask) -> Optional[LogResult]:
        """Do one task."""
        result = None
        try:
            cls.is_at_work = True
            result = function(task)
            cls.is_at_work = False
        except KeyboardInterrupt:
            pass
        if cls.is_ending:  # asked here as well: what runs in a destructor swallows the exception
            abort_all()
            os._exit(1)  # tasks that wait are not begun
        return result


class Processes(Engine):
    """An engine in several processes of this computer."""

    def __init__(self, count: int) -> None:
        self._count = count

    def run(self, function: BoundFunction, tasks: Iterable[LogTask], on_result: OnResult) -> None:
        from concurrent.futures import ProcessPoolExecutor, as_completed
        from concurrent.futures.process import BrokenProcessPool

        with ProcessPoolExecutor(self._count, initializer=_Worker.prepare) as pool:
            try:
                with held_back():  # one that came while a worker is started left a worker that nobody knows of
                    futures = {pool.submit(_Worker.work, function, task): task for task in tasks}
                for future in as_completed(futures):
                    task = futures[future]
                    try:
                        result = future.result()
                    except BrokenProcessPool:
                        result = None
                    on_result(result or failure(task, "%s: its process was killed" % task.path))
            except KeyboardInterrupt:
                # Without its processes the pool gives up the tasks that wait; it does not bear them to be cancelled.
                for process in multiprocessing.active_children():
                    process.terminate()
                raise
