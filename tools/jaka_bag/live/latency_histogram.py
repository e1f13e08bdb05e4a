"""The distribution of messages' lateness in logarithmic bins, so that hours of playing need no memory."""
import math
from typing import List

_BINS_PER_OCTAVE = 8
"""Bins for each doubling: a quantile is exact to 9 %."""
_BINS = 40 * _BINS_PER_OCTAVE


class LatencyHistogram:
    """Distribution of durations from 1 us up; quantiles are right within 10 %.

    Attributes:
        count: Values taken.
        max_s: The largest, s.
    """

    def __init__(self) -> None:
        self._bins: List[int] = [0] * _BINS
        self.count = 0
        self.max_s = 0.0

    def add(self, value_s: float) -> None:
        """Take one value, s; a negative one counts as 0."""
        self.count += 1
        if value_s > self.max_s:
            self.max_s = value_s
        micro = value_s * 1e6
        self._bins[int(math.log2(micro + 1.0) * _BINS_PER_OCTAVE) if micro > 0 else 0] += 1

    def merge(self, other: "LatencyHistogram") -> None:
        """Take all values of another."""
        self._bins = [a + b for a, b in zip(self._bins, other._bins)]
        self.count += other.count
        self.max_s = max(self.max_s, other.max_s)

    def quantile(self, fraction: float) -> float:
        """Return the value, s, that ``fraction`` (0 to 1) of all values do not exceed; 0 where there are none."""
        left = fraction * self.count
        for number, count in enumerate(self._bins):
            left -= count
            if count and left <= 0:
                return min((math.pow(2.0, (number + 1) / _BINS_PER_OCTAVE) - 1.0) * 1e-6, self.max_s)
        return self.max_s
