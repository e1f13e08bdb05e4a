"""Tasks in processes of this computer, by the standard library alone.

Each process has a connection of its own and one task at a time, so that it is known which task a process died of.
``ProcessPoolExecutor`` gives up all tasks with one process, and before Python 3.12 it then waits for ever where one of
them is larger than a pipe (https://github.com/python/cpython/issues/94777).
"""
import contextlib
import multiprocessing
import multiprocessing.connection
import multiprocessing.resource_tracker
import os
import signal
import threading
from collections import deque
from multiprocessing.connection import Connection
from typing import Any, Deque, Dict, Iterable, List, NamedTuple, Optional, Tuple

from ..allocator import keep_freed_memory
from ..interrupts import NUMBERS, held_back, ignored, put_off
from ..output_file import abort_all
from .tasks import BoundFunction, Engine, LogResult, LogTask, OnResult, failure

_TRIES = 2
"""Number of processes that a task may lose; then it has failed."""


class _Worker:
    """A worker process: the parent gets Ctrl-C and ends its workers by SIGTERM."""

    is_at_work = is_ending = False

    @classmethod
    def serve(cls, connection: Connection, function: BoundFunction) -> None:
        """Do tasks until None comes in place of one."""
        signal.signal(signal.SIGINT, ignored)  # not SIG_IGN, which processes that a task starts would inherit
        signal.signal(signal.SIGTERM, cls._on_end)
        keep_freed_memory()
        # A signal that another thread receives does not end a wait of this one.
        signal.pthread_sigmask(signal.SIG_BLOCK, NUMBERS)
        threading.Thread(target=cls._end_with_parent, daemon=True).start()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, NUMBERS)
        while True:
            task = connection.recv()
            if task is None:
                return
            connection.send(cls._work(function, task))

    @staticmethod
    def _end_with_parent() -> None:
        parent = multiprocessing.parent_process()
        assert parent is not None
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)

    @classmethod
    def _on_end(cls, number: int, frame: Any) -> None:
        cls.is_ending = True
        signal.signal(signal.SIGTERM, ignored)
        if cls.is_at_work:
            raise KeyboardInterrupt  # the half output is removed on the way
        os._exit(1)

    @classmethod
    def _work(cls, function: BoundFunction, task: LogTask) -> Optional[LogResult]:
        result = None
        try:
            cls.is_at_work = True
            result = function(task)
            cls.is_at_work = False
        except KeyboardInterrupt:
            pass
        if cls.is_ending:  # asked here as well: what runs in a destructor swallows the exception
            abort_all()
            os._exit(1)
        return result


class _Process(NamedTuple):
    """A worker as its parent has it."""

    process: multiprocessing.process.BaseProcess
    connection: Connection

    def give(self, task: Optional[LogTask]) -> None:
        """Send a task, None for the end; where the worker has died, its answer is missing."""
        with contextlib.suppress(OSError):
            self.connection.send(task)

    def answer(self) -> Optional[LogResult]:
        """Return the result that is there; None where the worker has died."""
        try:
            result: LogResult = self.connection.recv()
            return result
        except (EOFError, OSError):
            self.connection.close()
            self.process.join()
            return None


class _Given(NamedTuple):
    """A task, and the number of workers that it was given to."""

    task: LogTask
    tries: int

    @classmethod
    def first(cls, task: Optional[LogTask]) -> "Optional[_Given]":
        return None if task is None else cls(task, 1)


class Processes(Engine):
    """An engine in several processes of this computer.

    The task of a process that is killed is done again in another one; when this one is killed, too, it has failed.

    Args:
        count: Number of processes.
        method: How they are started, as ``multiprocessing`` calls it; None for its default. A fork is begun soonest,
            and does not bear libraries that keep threads, as pyarrow and duckdb do.
    """

    def __init__(self, count: int, method: Optional[str] = None) -> None:
        self._count = count
        self._context: Any = multiprocessing.get_context(method)

    def run(self, function: BoundFunction, tasks: Iterable[LogTask], on_result: OnResult) -> None:
        waiting = iter(tasks)
        again: Deque[_Given] = deque()
        workers: List[_Process] = []
        idle: List[_Process] = []
        busy: Dict[Any, Tuple[_Process, _Given]] = {}
        try:
            while True:
                while len(busy) < self._count:
                    given = again.popleft() if again else _Given.first(next(waiting, None))
                    if given is None:
                        break
                    worker = idle.pop() if idle else self._started(function, workers)
                    busy[worker.connection] = worker, given
                    worker.give(given.task)
                if not busy:
                    break
                for connection in multiprocessing.connection.wait(list(busy)):
                    worker, given = busy[connection]
                    result = worker.answer()
                    del busy[connection]
                    if result is not None:
                        idle.append(worker)
                        on_result(result)
                    elif given.tries < _TRIES:
                        again.append(given._replace(tries=given.tries + 1))
                    else:
                        on_result(failure(given.task, "%s: its process was killed" % given.task.path))
            for worker in idle:
                worker.give(None)
        except BaseException:
            with put_off():
                for worker in workers:
                    worker.process.terminate()
            raise
        finally:
            with put_off():
                for worker in workers:
                    worker.connection.close()
                    worker.process.join()

    def _started(self, function: BoundFunction, workers: List[_Process]) -> _Process:
        """Start a worker and add it to these, in one piece: nobody would end one that a signal kept out of them."""
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_Worker.serve, args=(theirs, function))
        worker = _Process(process, ours)
        if self._context.get_start_method() != "fork":
            multiprocessing.resource_tracker.ensure_running()  # begun below, it would let signals through
        with held_back():  # also from the worker, until it takes them as its parent wants it
            process.start()
            workers.append(worker)
        theirs.close()  # so that the connection ends with the worker
        return worker
