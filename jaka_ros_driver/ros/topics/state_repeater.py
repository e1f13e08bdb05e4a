"""From the rate of the status feed to the wanted one: when to repeat the newest sample, which samples to leave out."""
from collections import deque
from typing import Deque, Optional

_WINDOW = 33
_ENOUGH = 3
_SLOW = 1.05


class StateRepeater:
    """Counts publications against the wanted rate; pure, it is told the time.

    A feed counts as slow when both mean and median of its last intervals are more than 5 % above the period: jitter
    moves the median, a single stall the mean, only a slow feed both. A feed at the full rate is never filled.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._arrivals: Deque[float] = deque(maxlen=_WINDOW)
        self._credit = 0.0
        self._counted_at = 0.0
        self._is_slow = False

    def arrived(self, now: float) -> None:
        """A new sample has been published."""
        self._arrivals.append(now)
        intervals = sorted(b - a for a, b in zip(self._arrivals, list(self._arrivals)[1:]))
        was_slow = self._is_slow
        self._is_slow = len(intervals) >= _ENOUGH and (
            intervals[len(intervals) // 2] > _SLOW * self._period
            and (self._arrivals[-1] - self._arrivals[0]) / len(intervals) > _SLOW * self._period)
        if not was_slow:
            self._credit, self._counted_at = 1.0, now
        self._count(now)
        self._credit -= 1.0

    def repeated(self, now: float) -> None:
        """The newest sample has been published once more."""
        self._count(now)
        self._credit -= 1.0

    def next_repeat(self) -> Optional[float]:
        """When the newest sample is to be published once more; None while the feed is fast enough."""
        if not self._is_slow:
            return None
        return self._counted_at + (1.0 - self._credit) * self._period

    def forget(self) -> None:
        """The feed has ended; nothing is known of the next one."""
        self._arrivals.clear()
        self._is_slow = False

    def _count(self, now: float) -> None:
        self._credit = min(1.0, self._credit + (now - self._counted_at) / self._period)
        self._counted_at = now


class StateThinner:
    """Leaves samples out where fewer are wanted than come; pure, it is told the time.

    The driver itself always looks at the whole feed: custody of a moving arm does not depend on what is published.
    """

    def __init__(self, period: float, feed_period: float) -> None:
        """Periods of what is published and of the feed, s."""
        self._period = period
        self._takes_all = period <= _SLOW * feed_period
        self._due = float("-inf")

    def takes(self, now: float) -> bool:
        """Whether the sample that arrives now is published. Jitter of a quarter of a period changes nothing."""
        if self._takes_all:
            return True
        if now < self._due - 0.25 * self._period:
            return False
        late = now - self._due
        self._due = now + self._period if late > self._period else self._due + self._period
        return True
