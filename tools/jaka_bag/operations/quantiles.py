"""Quantiles of any number of values in a bounded amount of memory."""
from typing import List, Optional, Sequence, Tuple

import numpy as np

from ..messages.batch import Array

_EXACT = 1 << 18
"""Number of values up to which they are kept as they are."""
_SHIFT = 38
"""Beyond it values count as equal that differ only in the last 38 bits: by 1/16384 of themselves."""
_DENSE = 1 << 17
"""Neighbouring classes, eight powers of two, that are counted in a table: sorting takes ten times as long."""


class Quantiles:
    """Values, most of them as classes 0.006 % wide once there are many.

    Attributes:
        count: Number of values.
        total: Their sum.
    """

    def __init__(self, exact: Optional[int] = None) -> None:
        self._exact = _EXACT if exact is None else exact
        self._kept: List[Array] = []
        self._kept_count = 0
        self._classes = np.zeros(0, np.int64)
        self._counts = np.zeros(0, np.int64)
        self.count = 0
        self.total = 0.0

    def add(self, values: Array) -> None:
        """Add further values, float64; none is NaN."""
        if not len(values):
            return
        self.count += len(values)
        self.total += float(values.sum())
        self._kept.append(values)
        self._kept_count += len(values)
        if self._kept_count > self._exact:
            self._merge()

    def _merge(self) -> None:
        if not self._kept:
            return
        values = np.concatenate(self._kept)
        self._kept, self._kept_count, self._exact = [], 0, _EXACT // 2
        number = _classes_of(values)
        first, last = int(number.min()), int(number.max())
        if last - first >= _DENSE:
            first = int(number[len(number) // 2]) - _DENSE // 2
            last = first + _DENSE - 1
            inside = (number >= first) & (number <= last)
            self._add_classes(*np.unique(number[~inside], return_counts=True))
            number = number[inside]
        table = np.bincount(number - first, minlength=last - first + 1)
        begin, end = np.searchsorted(self._classes, (first, last + 1))
        table[self._classes[begin:end] - first] += self._counts[begin:end]
        which = np.flatnonzero(table)
        self._classes = np.concatenate([self._classes[:begin], which + first, self._classes[end:]])
        self._counts = np.concatenate([self._counts[:begin], table[which], self._counts[end:]])

    def _add_classes(self, number: Array, counts: Array) -> None:
        classes, place = np.unique(np.concatenate([self._classes, number]), return_inverse=True)
        self._counts = np.bincount(place, np.concatenate([self._counts, counts])).astype(np.int64)
        self._classes = classes
        self.count = max(self.count, int(self._counts.sum()))

    def _levels(self) -> Array:
        """Return the middle of each class."""
        number = np.where(self._classes < 0, -1 - self._classes, self._classes)
        size: Array = ((number << _SHIFT) + (1 << (_SHIFT - 1))).view(float)
        return np.where(self._classes < 0, -size, size)

    def median(self) -> float:
        """Return the median of at least one value."""
        if not len(self._classes):
            return float(np.median(np.concatenate(self._kept)))
        self._merge()
        return self._ranked(self._levels(), self.count // 2)

    def percentiles(self, shares: Sequence[float]) -> List[float]:
        """Return percentiles as ``numpy.percentile`` does, of at least one value."""
        if not len(self._classes):
            return [float(value) for value in np.percentile(np.concatenate(self._kept), shares)]
        self._merge()
        levels = self._levels()
        return [self._ranked(levels, int(round(0.01 * share * (self.count - 1)))) for share in shares]

    def distances(self, centre: float) -> "Quantiles":
        """Return the distances of all values from ``centre``."""
        if not len(self._classes):
            result = Quantiles()
            result.add(np.abs(np.concatenate(self._kept or [np.zeros(0)]) - centre))
            return result
        self._merge()
        result = Quantiles(0)
        result._add_classes(_classes_of(np.abs(self._levels() - centre)), self._counts)
        return result

    def above(self, limit: float) -> Tuple[Array, Array]:
        """Return values above ``limit``, or the middle of their classes, and the count of each."""
        if not len(self._classes):
            values = np.concatenate(self._kept or [np.zeros(0)])
            values = values[values > limit]
            return values, np.ones(len(values), np.int64)
        self._merge()
        levels = self._levels()
        which = levels > limit
        return levels[which], self._counts[which]

    def distance(self, centre: float, share: float) -> float:
        """Return the distance from ``centre`` that this share of the values, at least one, stays below."""
        at = min(self.count - 1, int(share * self.count))
        if not len(self._classes):
            off = np.abs(np.concatenate(self._kept) - centre)
            return float(np.partition(off, at)[at])
        self._merge()
        return self._ranked(np.abs(self._levels() - centre), at)

    def _ranked(self, levels: Array, at: int) -> float:
        order = np.argsort(levels, kind="stable")
        return float(levels[order][np.searchsorted(np.cumsum(self._counts[order]), at, side="right")])


def _classes_of(values: Array) -> Array:
    """Return the number of each value's class; they rise with the values."""
    bits = np.ascontiguousarray(values, float).view(np.int64)
    number: Array = bits >> _SHIFT
    negative = np.flatnonzero(bits < 0)
    # the sign is the highest bit: negative values are ordered by what follows it, backwards
    number[negative] = -1 - (number[negative] & (2 ** (63 - _SHIFT) - 1))
    return number
