"""Ctrl-C and SIGTERM as one exception, and no second one while its cleaning up goes on."""
import contextlib
import queue
import signal
import threading
from typing import Any, Iterator, List

NUMBERS = (signal.SIGINT, signal.SIGTERM)


def raise_at_first_signal() -> None:
    """Raise KeyboardInterrupt at the first SIGINT or SIGTERM, and ignore further ones.

    A second one would interrupt the cleaning up: half files would stay, or processes that nobody ends. SIGKILL ends a
    process that hangs there. For the main thread alone: another one raises ValueError.
    """
    for number in NUMBERS:
        signal.signal(number, _raise_once)


def _raise_once(number: int, frame: Any) -> None:
    for each in NUMBERS:
        signal.signal(each, ignored)  # not SIG_IGN, which a process begun from here on would inherit
    raise KeyboardInterrupt


def ignored(number: int, frame: Any) -> None:
    """Do nothing: the handler of a signal that is to have no effect here, and its usual one in processes begun here."""


class Flag:
    """A flag that a signal handler may set, as it may not with a ``threading.Event``.

    That has a lock: a handler that comes while its own thread holds it, in ``set`` or ``wait``, waits for ever.
    """

    def __init__(self) -> None:
        self._is_set = False
        self._woken: queue.SimpleQueue[None] = queue.SimpleQueue()  # its ``put`` may interrupt any of its methods

    def is_set(self) -> bool:
        """Return whether it is set."""
        return self._is_set

    def set(self) -> None:
        """Set it, and wake all that wait."""
        self._is_set = True
        self._woken.put(None)

    def wait(self, timeout: float) -> bool:
        """Wait until it is set, or for ``timeout``, s; return whether it is set."""
        if not self._is_set:
            with contextlib.suppress(queue.Empty):
                self._woken.get(timeout=timeout)
                self._woken.put(None)  # for the next that waits
        return self._is_set


@contextlib.contextmanager
def held_back() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back for a while, here and in processes that begin meanwhile.

    To block them is not enough here: another thread would take them (OpenBLAS begins some), and Python would raise
    their exception in this one all the same.
    """
    with put_off():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, NUMBERS)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def put_off() -> Iterator[None]:
    """Have Ctrl-C and SIGTERM wait for the end of the block; a process that begins in it takes them as ever."""
    came: List[int] = []
    before = {}
    if threading.current_thread() is threading.main_thread():  # Python calls handlers there alone
        before = {number: signal.signal(number, lambda number, frame: came.append(number)) for number in NUMBERS
                  if callable(signal.getsignal(number))}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])
