"""Waiting in tests: for conditions, for calls in threads of their own, and for a free port. No ROS, no controller."""
import asyncio
import contextlib
import random
import socket
import threading
import time
from typing import Any, Callable, Iterator, List, Optional, Tuple, Union

WAIT = 60.0
"""Longest wait for something that must come, on a busy host, s; never a measure of speed."""
_PORT_DRAW = random.SystemRandom()
_LOOK_S = 0.005
_STALL_S = 0.05


def eventually(condition: Callable[[], Any], timeout: float = WAIT) -> Any:
    """Wait until the condition holds; return its last value, which is false after the time-out."""
    deadline = time.monotonic() + timeout
    while True:
        value = condition()
        if value or time.monotonic() > deadline:
            return value
        time.sleep(_LOOK_S)


def wait_until(condition: Callable[[], Any], what: Union[str, Callable[[], str]], timeout: float = WAIT) -> Any:
    """Wait until the condition holds; return its value, or fail with ``what``, a text or a function that makes it."""
    value = eventually(condition, timeout)
    assert value, "waited %g s in vain: %s" % (timeout, what if isinstance(what, str) else what())
    return value


async def happens(condition: Callable[[], Any], what: str, timeout: float = WAIT) -> None:
    """Wait in an event loop until the condition holds, while its other tasks run; fail with ``what``."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, "waited %g s in vain: %s" % (timeout, what)
        await asyncio.sleep(_LOOK_S)


class StallWatch:
    """The stalls of the host while a test measures a time: a bound on what the product takes must not count them.

    Enter it before the first reading of ``time.monotonic`` that is compared.
    """

    def __init__(self) -> None:
        self._stalls: List[Tuple[float, float]] = []
        self._last = time.monotonic()
        self._is_over = False
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def _watch(self) -> None:
        while not self._is_over:
            time.sleep(_LOOK_S)
            now = time.monotonic()
            if now - self._last > _STALL_S:
                self._stalls.append((self._last + _LOOK_S, now))
            self._last = now

    def __enter__(self) -> "StallWatch":
        self._last = time.monotonic()
        self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self._is_over = True
        self._thread.join()

    def between(self, begin: float, end: Optional[float] = None) -> float:
        """Return the seconds from one reading to another, or to now, less those in which the host stood still."""
        until = time.monotonic() if end is None else end
        while self._last < until and self._thread.is_alive():  # a stall that ends just now is not written down yet
            time.sleep(_LOOK_S)
        return until - begin - sum(max(0.0, min(to, until) - max(since, begin)) for since, to in list(self._stalls))


class InBackground:
    """A call in a thread of its own, and how it ended."""

    def __init__(self, function: Callable[..., Any], *args: Any, **kwargs: Any) -> None:
        self.result: Any = None
        self.error: Any = None
        self.ended_at: Any = None
        self._thread = threading.Thread(target=self._run, args=(function, args, kwargs), daemon=True)
        self._thread.start()

    def _run(self, function: Callable[..., Any], args: Any, kwargs: Any) -> None:
        try:
            self.result = function(*args, **kwargs)
        except Exception as error:
            self.error = error
        self.ended_at = time.monotonic()

    @property
    def is_over(self) -> bool:
        return not self._thread.is_alive()

    def wait(self, timeout: float = WAIT) -> None:
        self._thread.join(timeout)
        assert self.is_over, "the call did not return"

    def failure(self) -> Any:
        """Return what the call raised; None where it returned."""
        self.wait()
        return self.error

    def join(self, timeout: float = WAIT) -> Any:
        """Return what the call returned, or raise what it raised."""
        self.wait(timeout)
        if self.error is not None:
            raise self.error
        return self.result


@contextlib.contextmanager
def repeating(step: Callable[[], Any], pause: float = 0.0) -> Iterator[None]:
    """Repeat a call in a thread of its own until the block ends, with a pause, s, before each; raise what it raises."""
    ends = threading.Event()

    def run() -> None:
        while not ends.wait(pause):
            step()
    running = InBackground(run)
    try:
        yield
    finally:
        ends.set()
        running.join()


def free_ports(count: int) -> List[int]:
    """Return different ports that were free a moment ago, for executables that cannot be asked to take any.

    They lie below those that Linux gives to outgoing connections: a server that is started again finds its port free.
    """
    found: List[int] = []
    with contextlib.ExitStack() as probes:
        while len(found) < count:
            probe = probes.enter_context(contextlib.closing(socket.socket()))
            with contextlib.suppress(OSError):
                probe.bind(("", _PORT_DRAW.randrange(20000, 32768)))
                found.append(int(probe.getsockname()[1]))
    return found


def free_port() -> int:
    """Return one such port."""
    return free_ports(1)[0]
