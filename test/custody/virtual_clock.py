"""Virtual time: what is due next. Nothing here looks at the host's clock, so that a seed runs the same everywhere."""
import heapq
from typing import Any, Callable, List, Tuple


class Clock:
    """Time, and actions put down for later.

    Attributes:
        now: s, as the driver's monotonic clock shows it.
    """

    def __init__(self, now: float) -> None:
        self.now = now
        self._due: List[Tuple[float, int, Callable[[], Any]]] = []
        self._count = 0

    def at(self, moment: float, action: Callable[[], Any]) -> None:
        """Do it then; what is due at the same moment keeps its order."""
        self._count += 1
        heapq.heappush(self._due, (moment if moment > self.now else self.now, self._count, action))

    def after(self, delay: float, action: Callable[[], Any]) -> None:
        """Do it so many seconds from now."""
        self.at(self.now + delay, action)

    def next_due(self) -> float:
        """When the next action is due; infinite for none."""
        return self._due[0][0] if self._due else float("inf")

    def do_next(self) -> None:
        """Do the next action; ``now`` is its time already."""
        heapq.heappop(self._due)[2]()
