"""The adaptation of the feed's rate to the wanted one: when to repeat the newest sample, which ones to leave out."""
from collections import deque
from typing import Deque, Optional

_WINDOW = 33
"""Arrivals whose median interval counts: a quarter of a second at 125 Hz."""
_ENOUGH = 3
"""Fewest intervals that have a median worth the name: two agree against one."""
_SLOW = 1.05
"""Factor of the period above which intervals are long: more than clocks differ by (``feed``)."""


class StateRepeater:
    """The rate keeper of a slow feed, which determines when the newest sample is repeated. It has no clock.

    A feed counts as slow when both mean and median of its last intervals are more than 5 % above the period: jitter
    changes the median, a single stall the mean, only a slow feed both. Samples of a feed at the full rate are never
    repeated.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._arrivals: Deque[float] = deque(maxlen=_WINDOW)
        self._credit = 0.0
        self._counted_at = 0.0
        self._is_slow = False

    def arrived(self, now: float) -> None:
        """Count a new sample that has been published."""
        self._arrivals.append(now)
        was_slow, self._is_slow = self._is_slow, self._intervals_are_long()
        if not was_slow:
            self._credit, self._counted_at = 1.0, now
        self._count(now)
        self._credit -= 1.0

    def repeated(self, now: float) -> None:
        """Count a repetition of the newest sample."""
        self._count(now)
        self._credit -= 1.0

    def next_repeat(self) -> Optional[float]:
        """Return when the newest sample is to be published again, s of the caller's clock.

        None while the feed is fast.
        """
        if not self._is_slow:
            return None
        return self._counted_at + (1.0 - self._credit) * self._period

    def forget(self) -> None:
        """Forget the rate, because the feed has ended."""
        self._arrivals.clear()
        self._is_slow = False

    def _intervals_are_long(self) -> bool:
        arrivals, longest = list(self._arrivals), _SLOW * self._period
        count = len(arrivals) - 1
        if count < _ENOUGH or arrivals[-1] - arrivals[0] <= longest * count:  # the mean costs less to compute
            return False
        return sorted([b - a for a, b in zip(arrivals, arrivals[1:])])[count // 2] > longest

    def _count(self, now: float) -> None:
        self._credit = min(1.0, self._credit + (now - self._counted_at) / self._period)
        self._counted_at = now


class StateThinner:
    """The rate limiter of a fast feed, which determines which samples to leave out. It has no clock.

    This concerns what is published only; the driver itself uses every sample of the feed.
    """

    def __init__(self, period: float, feed_period: float) -> None:
        """Set up the limiter.

        period: Wanted, s. feed_period: Of the feed, s.
        """
        self._period = period
        self._takes_all = period <= _SLOW * feed_period
        self._due = float("-inf")

    def takes(self, now: float) -> bool:
        """Return whether to publish the sample that arrives now. Jitter of a quarter of a period has no effect."""
        if self._takes_all:
            return True
        if now < self._due - 0.25 * self._period:
            return False
        late = now - self._due
        self._due = now + self._period if late > self._period else self._due + self._period
        return True
