"""Tasks on the workers of a Dask cluster.

Few tasks are with the scheduler at a time, so its memory and this process's stay the same however many there are.
Dask itself gives the task of a worker that died to another, and gives up one that three workers died of. A scheduler
that is gone has forgotten its tasks: those without a result are handed to the one that comes after it.
"""
import contextlib
import importlib
import itertools
import logging
import queue
import time
import uuid
import warnings
from collections import deque
from typing import Any, Deque, Dict, Iterable, Iterator, Optional, Tuple

from ..errors import BagError, MissingDependency
from .tasks import BoundFunction, Engine, LogResult, LogTask, OnResult, failure

CONNECT_S = 20.0
"""Time limit, s, for a scheduler's answer at the start."""
RETURN_S = 120.0
"""Time limit, s, for the absence of the scheduler, or of all workers, in the middle of the work."""
_LOOK_S = 2.0
"""Longest wait, s, before the next look at scheduler and workers: the delay with which a loss is seen."""
_IN_FLIGHT = 1024
"""Tasks with the scheduler at a time: many workers stay busy, and a fleet of any size takes no more of its memory."""
_TOGETHER = 32
"""Number of tasks in one message: a message for each would cost the scheduler 6 ms of its processor time."""
_TRIES = 5
"""Number of schedulers that may be lost one after the other without a result in between."""


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Suppress Dask's own lines about lost connections, which results and errors report as far as they matter.

    Its warning of large messages is suppressed, too: tasks that carry a golden log and a driver cause it.
    """
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sending large graph")
            yield
    finally:
        logger.setLevel(before)


class Dask(Engine):
    """An engine on Dask workers, which see the same files under the same names and have this package.

    Args:
        address: Address of a scheduler, as ``tcp://host:8786``.
        return_s: Time limit for the absence of the scheduler, or of all workers, s.
    """

    def __init__(self, address: str, return_s: float = RETURN_S) -> None:
        self._address = address
        self._return_s = return_s

    def run(self, function: BoundFunction, tasks: Iterable[LogTask], on_result: OnResult) -> None:
        try:
            distributed = importlib.import_module("distributed")
        except ImportError:
            raise MissingDependency("--dask needs the Python package distributed") from None
        with _quiet():
            _Run(distributed, self._address, self._return_s, function, tasks, on_result).run()


class _Run:
    """The tasks of one call."""

    def __init__(self, distributed: Any, address: str, return_s: float, function: BoundFunction,
                 tasks: Iterable[LogTask], on_result: OnResult) -> None:
        self._distributed = distributed
        self._address = address
        self._return_s = return_s
        self._function = function
        self._waiting = iter(tasks)
        self._on_result = on_result
        self._lost: Deque[LogTask] = deque()
        self._result_count = 0

    def run(self) -> None:
        """Do them, with as many schedulers one after the other as it takes."""
        client = self._connect(CONNECT_S)
        tries = 0
        while True:
            before = self._result_count
            try:
                self._work(client)
            finally:
                client.close()
            if not self._lost:
                return
            tries = tries + 1 if self._result_count == before else 1
            if tries > _TRIES:
                raise BagError("the Dask scheduler %s was lost %d times" % (self._address, tries))
            client = self._connect_again()

    def _connect(self, timeout_s: float) -> Any:
        try:
            return self._distributed.Client(self._address, timeout=timeout_s, set_as_default=False)
        except (OSError, ValueError) as error:
            raise BagError("cannot reach the Dask scheduler %s: %s" % (self._address, error)) from error

    def _connect_again(self) -> Any:
        """Return a client of the scheduler that replaces a lost one."""
        end = time.monotonic() + self._return_s
        while True:
            try:
                return self._connect(min(_LOOK_S, self._return_s))
            except BagError:
                if time.monotonic() > end:
                    raise

    def _work(self, client: Any) -> None:
        """Do tasks until all are done, or the scheduler is lost and with it the tasks that it had."""
        ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        running: Dict[str, Tuple[Any, LogTask]] = {}
        is_lost = False
        workers_seen = time.monotonic()
        again, self._lost = self._lost, deque()
        source = itertools.chain(_drained(again), self._waiting)
        try:
            while True:
                while not is_lost and _IN_FLIGHT - len(running) >= min(_TOGETHER, _IN_FLIGHT):
                    more = list(itertools.islice(source, min(_TOGETHER, _IN_FLIGHT)))
                    if not more:
                        break
                    if client.status == "closed":  # it gave up while a result was taken
                        is_lost = True
                        self._lost.extend(more)
                        break
                    keys = ["log-" + uuid.uuid4().hex for _ in more]
                    for future, task in zip(client.map(self._function, more, key=keys, pure=False), more):
                        running[future.key] = (future, task)
                        future.add_done_callback(ended.put)
                if not running:
                    return
                try:
                    future = ended.get(timeout=_LOOK_S)
                except queue.Empty:
                    workers_seen = self._look_for_workers(client, workers_seen)
                    continue
                workers_seen = time.monotonic()
                _, task = running.pop(future.key)
                result = self._fetch(future, task)
                if result is None:
                    is_lost = True
                    self._lost.append(task)
                    continue
                self._result_count += 1
                self._on_result(result)
        except BaseException:
            with contextlib.suppress(Exception):  # the scheduler may be the one that is gone
                client.cancel([future for future, _ in running.values()], force=True)
            raise
        finally:
            self._lost.extend(again)

    def _fetch(self, future: Any, task: LogTask) -> Optional[LogResult]:
        """Return the result of a task that has ended; None where the scheduler and the result are lost."""
        wait_s = _LOOK_S
        while not future.cancelled():
            try:
                result: LogResult = future.result(timeout=wait_s)
                return result
            except Exception as error:
                if future.status == "error":
                    return failure(task, "%s: %s" % (task.path, " ".join(str(error).split())))
                if isinstance(error, self._distributed.TimeoutError):
                    wait_s *= 2.0  # a large result, or one that is made again because the worker that had it died
                elif isinstance(error, (self._distributed.CancelledError, OSError)):
                    return None
                else:
                    raise
        return None

    def _look_for_workers(self, client: Any, seen: float) -> float:
        """Return the last time a worker was seen: now, or ``seen``.

        Raises:
            BagError: That is too long ago.
        """
        with contextlib.suppress(Exception):  # a scheduler that is gone shows by its tasks
            if client.scheduler_info()["workers"]:
                return time.monotonic()
        if time.monotonic() - seen > self._return_s:
            raise BagError("the Dask scheduler %s has no workers" % self._address)
        return seen


def _drained(tasks: Deque[LogTask]) -> Iterator[LogTask]:
    while tasks:
        yield tasks.popleft()
