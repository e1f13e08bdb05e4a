"""Fewer points that show the same curve, of samples that come piece by piece."""
from typing import List, Tuple

import numpy as np

from ..messages.batch import Array


class MinMax:
    """Smallest and largest value of each stretch of samples: no spike is lost, however many samples come.

    All stretches are equally long; when there are too many, two and two become one. What is kept depends on the
    samples alone, not on the pieces in which they came.

    Args:
        limit: Approximate number of points at most, at least 8; up to this many samples are kept as they are.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit // 4 * 4
        self._size = 1
        self._low: List[Array] = []
        self._high: List[Array] = []
        self._stretches = 0
        self._tail = np.zeros(0), np.zeros(0)
        self._ends = np.zeros((0, 3))
        self.count = 0

    def add(self, time: Array, values: Array) -> None:
        """Add further samples; s or any unit, shape (n,) each. A value may be NaN."""
        if not len(time):
            return
        time, values = np.asarray(time, float), np.asarray(values, float)
        ends = np.array([(self.count + at, time[at], values[at]) for at in (0, len(time) - 1)])
        self._ends = np.concatenate([self._ends[:1], ends])[[0, -1]]
        first = self.count - len(self._tail[0])
        self.count += len(time)
        if len(self._tail[0]):
            time, values = (np.concatenate(both) for both in zip(self._tail, (time, values)))
        while True:
            most = self._limit if self._size == 1 else self._limit // 2
            taken = self._size * min(len(time) // self._size, most - self._stretches)
            if taken:
                self._take(first, time[:taken], values[:taken])
                first, time, values = first + taken, time[taken:], values[taken:]
            if self._stretches < most or not len(time):
                break
            self._halve()
        self._tail = time.copy(), values.copy()

    def _take(self, first: int, time: Array, values: Array) -> None:
        """Take whole stretches of samples, of which the first has this number."""
        begins = np.arange(0, len(time), self._size)
        self._stretches += len(begins)
        for kept, within in zip((self._low, self._high), _places(values.reshape(-1, self._size))):
            at = begins + within
            kept.append(np.stack([(first + at).astype(float), time[at], values[at]], axis=1))

    def _halve(self) -> None:
        low, high = (np.concatenate(parts).reshape(-1, 2, 3) for parts in (self._low, self._high))
        self._low, self._high = [_extremes(low)[0]], [_extremes(high)[1]]
        self._stretches //= 2
        self._size *= 2

    def points(self) -> Tuple[Array, Array]:
        """Time and value of the points, in the order in which they came."""
        parts = self._low + self._high + [self._ends]
        if len(self._tail[0]):
            time, values = self._tail
            number = np.arange(self.count - len(time), self.count, dtype=float)
            parts += list(_extremes(np.stack([number, time, values], axis=1)[None]))
        rows = np.concatenate(parts)
        rows = rows[np.unique(rows[:, 0], return_index=True)[1]]
        return rows[:, 1], rows[:, 2]


def _extremes(stretches: Array) -> Tuple[Array, Array]:
    """Return the samples of each stretch's smallest and largest value, shape (stretches, samples, 3) to (., 3)."""
    number = np.arange(len(stretches))
    low, high = _places(stretches[:, :, 2])
    return stretches[number, low], stretches[number, high]


def _places(values: Array) -> Tuple[Array, Array]:
    """Return the places of each row's smallest and largest value, shape (rows, samples) to (rows,) each."""
    if values.shape[1] == 1:
        none = np.zeros(len(values), np.int64)
        return none, none
    unknown = np.isnan(values)
    low, high = (np.where(unknown, np.inf, values), np.where(unknown, -np.inf, values)) if unknown.any() \
        else (values, values)
    return low.argmin(axis=1), high.argmax(axis=1)


class EveryNth:
    """Rows evenly out of all that come, at most ``limit`` of them, and the last one.

    Args:
        limit: Number of rows at most, at least 2.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._step = 1
        self._kept: List[Array] = []
        self._number = 0
        self._count = 0
        self._last: List[Array] = []

    def add(self, rows: Array) -> None:
        """Add further rows, shape (n, columns)."""
        if not len(rows):
            return
        part = rows[-self._count % self._step::self._step].copy()
        self._count += len(rows)
        self._last = [rows[-1:].copy()]
        self._kept.append(part)
        self._number += len(part)
        while self._number > self._limit:
            self._kept = [np.concatenate(self._kept)[::2]]
            self._number = len(self._kept[0])
            self._step *= 2

    def rows(self) -> Array:
        """Return the rows that were kept, shape (m, columns); at least one must have been added."""
        is_last_kept = (self._count - 1) % self._step == 0
        return np.concatenate(self._kept + ([] if is_last_kept else self._last))


class Changes:
    """First and last sample of each run of equal values; beyond ``limit`` points as ``MinMax``."""

    def __init__(self, limit: int) -> None:
        self._kept = MinMax(limit)
        self._last = np.zeros((0, 2))
        self._is_last_kept = False

    def add(self, time: Array, values: Array) -> None:
        """Add further samples, shape (n,) each."""
        if not len(time):
            return
        rows = np.concatenate([self._last, np.stack([time, values.astype(float)], axis=1)])
        differs = np.flatnonzero(np.diff(rows[:, 1]))
        keep = np.union1d(differs, differs + 1)
        if not self._kept.count:
            keep = np.union1d(keep, [0])
        if self._is_last_kept:
            keep = keep[keep > 0]
        self._kept.add(rows[keep, 0], rows[keep, 1])
        self._is_last_kept = bool(np.isin(len(rows) - 1, keep))
        self._last = rows[-1:]

    def points(self) -> Tuple[Array, Array]:
        """Time and value of the points."""
        time, values = self._kept.points()
        if self._is_last_kept:
            return time, values
        return np.append(time, self._last[:, 0]), np.append(values, self._last[:, 1])
