"""Virtual time and its queue of due actions. Nothing here reads the host's clock: a seed runs the same everywhere."""
import heapq
from typing import Any, Callable, List, Tuple


class Clock:
    """A clock that stands until it is moved on, and the actions scheduled on it.

    Attributes:
        now: s, as the driver's monotonic clock shows it.
    """

    def __init__(self, now: float) -> None:
        self.now = now
        self._due: List[Tuple[float, int, Callable[[], Any]]] = []
        self._count = 0

    def at(self, moment: float, action: Callable[[], Any]) -> None:
        """Schedule an action; actions due at the same moment run in the order in which they were scheduled."""
        self._count += 1
        heapq.heappush(self._due, (moment if moment > self.now else self.now, self._count, action))

    def after(self, delay: float, action: Callable[[], Any]) -> None:
        """Schedule an action for so many seconds from now."""
        self.at(self.now + delay, action)

    def next_due(self) -> float:
        """Return when the next action is due; infinite for none."""
        return self._due[0][0] if self._due else float("inf")

    def do_next(self) -> None:
        """Run the next action; the caller has set ``now`` to its time already."""
        heapq.heappop(self._due)[2]()
