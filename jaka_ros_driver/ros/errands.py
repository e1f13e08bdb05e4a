"""One thread for what waits for nothing and for which nobody waits.

It publishes what others hand over, so that the arm's thread and those of the services go on, and does at intervals what
is told at intervals. Nothing that waits for a disk, a terminal, the master, the controller or a client belongs here.
"""
import contextlib
import logging
import threading
import time
from queue import Empty, SimpleQueue
from typing import Callable, List, Optional

_LOG = logging.getLogger(__name__)

_LONGEST_WAIT_S = 60.0
"""Longest wait, s, for the next call where nothing is done at intervals."""


class _Regular:
    """A task with its period, s, and the moment at which it is due, monotonic time, s."""

    def __init__(self, period: float, task: Callable[[], None]) -> None:
        self.period = period
        self.task = task
        self.due = time.monotonic() + period


class Errands:
    """The thread and what it has to do; it starts with the first call."""

    def __init__(self) -> None:
        self._calls: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._regular: List[_Regular] = []
        """Changed in the thread alone."""
        self._lock = threading.Lock()
        self._thread: Optional[threading.Thread] = None

    @property
    def waiting(self) -> int:
        """The number of calls that wait."""
        return self._calls.qsize()

    def soon(self, call: Callable[[], None]) -> None:
        """Call once, after all that was handed over before; return at once."""
        self._calls.put(call)
        if self._thread is None:
            with self._lock:
                if self._thread is None:
                    self._thread = threading.Thread(target=self._run, name="errands", daemon=True)
                    self._thread.start()

    def every(self, period: float, task: Callable[[], None]) -> Callable[[], None]:
        """Do a task at intervals; one that raises is logged, and done no more.

        Args:
            period: Between two turns, s.
            task: Waits for nothing.

        Returns:
            A function that ends this, and waits for a turn that is under way.
        """
        regular = _Regular(period, task)
        self.soon(lambda: self._regular.append(regular))

        def end() -> None:
            self.soon(lambda: self._forget(regular))
            self.drain()
        return end

    def drain(self, timeout: Optional[float] = None) -> bool:
        """Wait at most ``timeout`` s until all that was handed over is done; return False where some is left."""
        done = threading.Event()
        self.soon(done.set)
        return done.wait(timeout)

    # ---- in the thread ----

    def _run(self) -> None:
        while True:
            now = time.monotonic()
            due = min((regular.due for regular in self._regular), default=now + _LONGEST_WAIT_S)
            with contextlib.suppress(Empty):
                self._do(self._calls.get(timeout=max(0.0, due - now)))
            for regular in list(self._regular):
                now = time.monotonic()
                if now >= regular.due:
                    regular.due = max(regular.due, now - regular.period) + regular.period
                    if not self._do(regular.task):
                        self._forget(regular)

    @staticmethod
    def _do(task: Callable[[], None]) -> bool:
        """Do a task; return False where it raised."""
        try:
            task()
            return True
        except Exception:  # a defect of one is none of the others
            _LOG.exception("a defect of %.200s", task)
            return False

    def _forget(self, regular: _Regular) -> None:
        with contextlib.suppress(ValueError):  # it has raised
            self._regular.remove(regular)


ERRANDS = Errands()
"""The errands of this process."""
