"""The measurement of how long the stops of callers take."""
import contextlib
import time
from typing import Callable, Iterator, List

StopListener = Callable[[float, bool], None]


class StopTimer:
    """The stop watch of one client's stops, which tells its listeners each time, and delays nothing."""

    def __init__(self) -> None:
        self._listeners: List[StopListener] = []

    def add_listener(self, listener: StopListener) -> None:
        """Call ``listener(latency, is_accepted)`` after each stop, in its caller's thread; it must not block.

        ``latency`` is the time from the call to its answer, s.
        """
        self._listeners.append(listener)

    @contextlib.contextmanager
    def measured(self) -> Iterator[None]:
        """Measure one stop; one that ends with an error was not accepted."""
        asked, is_accepted = time.monotonic(), False
        try:
            yield
            is_accepted = True
        finally:
            for listener in self._listeners:
                listener(time.monotonic() - asked, is_accepted)
