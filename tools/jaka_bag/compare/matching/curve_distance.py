"""The distances of the candidate's samples from the golden curve, for stamps with small errors."""
from typing import Optional, Tuple

import numpy as np

from ...messages.batch import Array

_MOST_SEGMENTS = 2000
"""Most segments to either side in which a sample's counterpart is looked for: wrong jitter costs bounded time."""
_SHORT_SLICE = 16
"""Rows of a slice up to which its range is sought row by row: beyond it a table for the whole curve costs less."""
_SLOWEST_RHYTHM = 1.1
"""A rhythm this much slower than the usual one is still steady."""


def interpolated(time: Array, value: Array, at: Array) -> Array:
    """Interpolate the curve at some times, shape (len(at), columns); hold it at its ends."""
    right = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    left = right - 1
    begin = time[left]
    part = (at - begin) / np.maximum(time[right] - begin, 1e-9)
    part = np.minimum(np.maximum(part, 0.0), 1.0)[:, None]
    first = value.take(left, axis=0)  # which gathers rows several times as fast as an index does
    result: Array = value.take(right, axis=0)
    result -= first
    result *= part
    result += first
    return result


def lengths(vectors: Array) -> Array:
    """Return the Euclidean length of each row."""
    one = vectors.shape[1] == 1  # whose length takes a third of the time
    result: Array = np.abs(vectors[:, 0]) if one else np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return result


class Lateness:
    """The delays of stamps whose reader was held up.

    A reader that was held up finds all that came meanwhile at once: after a silence stamps lie close together until it
    has caught up. A stamp's delay may be as much as it lies behind a steady rhythm.

    Args:
        rhythm: The usual time from stamp to stamp, s; 0 where it is not known: nothing is late.
        longest_s: A longer silence is one of the sender.
    """

    def __init__(self, rhythm: float, longest_s: float) -> None:
        self._period = _SLOWEST_RHYTHM * rhythm
        self._longest_s = longest_s
        self._last: Optional[float] = None
        self._late = 0.0

    def of(self, time: Array) -> Array:
        """Return the largest delay, s, of each further stamp, s, shape (n,); stamps ascend from call to call."""
        if not len(time) or self._period <= 0:
            return np.zeros(len(time))
        steps = np.diff(time, prepend=time[0] if self._last is None else self._last)
        behind = np.where(steps > self._longest_s, self._period, steps) - self._period
        if self._last is None:
            behind[0] = 0.0
        behind[0] += self._late
        behind = np.cumsum(behind)
        late: Array = behind - np.minimum(np.minimum.accumulate(behind), 0.0)
        self._last, self._late = float(time[-1]), float(late[-1])
        return late


def lateness(time: Array, longest_s: float) -> Array:
    """Return the ``Lateness`` of all stamps of a short log, s, shape (n,)."""
    if len(time) < 3:
        return np.zeros(len(time))
    return Lateness(float(np.median(np.diff(time))), longest_s).of(time)


def distances(time: Array, value: Array, at: Array, seen: Array, direct: Array, jitter_s: Array,
              enough: float) -> Array:
    """Return each sample's distance to the piece of the golden curve that is within the jitter of its stamp.

    Args:
        time: Golden times, s, shape (n,), ascending; at least two.
        value: Golden values, shape (n, columns): the distance is Euclidean over the columns.
        at: Golden times of the samples, s, shape (m,).
        seen: The samples, shape (m, columns).
        direct: Distance of each sample to the golden curve at its own time, shape (m,).
        jitter_s: Largest error of each sample's stamp, s, shape (m,).
        enough: A sample whose distance at its own time is within this is not looked at further.
    """
    result: Array = direct.copy()
    which = np.flatnonzero(direct > enough)
    if not len(which) or not jitter_s.any():
        return result
    first = np.clip(np.searchsorted(time, at[which] - jitter_s[which], "right") - 1, 0, len(time) - 2)
    last = np.clip(np.searchsorted(time, at[which] + jitter_s[which]) - 1, 0, len(time) - 2)
    middle = np.clip(np.searchsorted(time, at[which]) - 1, 0, len(time) - 2)
    reach = min(int(np.maximum(middle - first, last - middle).max()), _MOST_SEGMENTS)
    point = seen[which]
    best = direct[which]
    active = np.arange(len(which))
    # from the middle outwards: most stamps are off by little, and are done after a few steps
    for offset in sorted(range(-reach, reach + 1), key=abs):
        active = active[best[active] > enough]
        if not len(active):
            break
        segment = middle[active] + offset
        inside = (segment >= first[active]) & (segment <= last[active])
        some, segment = (active, segment) if inside.all() else (active[inside], segment[inside])
        start, along = value[segment], value[segment + 1] - value[segment]
        off = point[some] - start
        length = np.einsum("ij,ij->i", along, along)
        part = np.einsum("ij,ij->i", off, along) / np.maximum(length, 1e-300)
        best[some] = np.minimum(best[some], lengths(off - np.minimum(np.maximum(part, 0.0), 1.0)[:, None] * along))
    result[which] = best
    return result


def box_distances(time: Array, value: Array, at: Array, sought: Array, jitter_s: Array) -> Array:
    """Return how far sought values lie outside of the range that a curve passes through around their times.

    Of one column it is the distance to the curve; of several at most that. Where the curve is not known within the
    jitter to both sides, it is 0.

    Args:
        time: Times of the curve, s, shape (n,), ascending.
        value: Its values, shape (n, columns).
        at: Times of the sought values, s, shape (m,), ascending; at least one.
        sought: The sought values, shape (m, columns).
        jitter_s: Largest error of each time, s, shape (m,).
    """
    result = np.zeros(len(at))
    first = np.searchsorted(time, at - jitter_s, "right") - 1
    last = np.searchsorted(time, at + jitter_s)
    known = np.flatnonzero((first >= 0) & (last < len(time)))
    if not len(known):
        return result
    first, last = first[known], last[known]
    begin = int(first.min())
    value = value[begin:int(last.max()) + 1]
    low, high = _ranges(value, first - begin, last - begin + 1)
    sought = sought[known]
    result[known] = lengths(np.maximum(np.maximum(low - sought, sought - high), 0.0))
    return result


def _ranges(value: Array, begin: Array, end: Array) -> Tuple[Array, Array]:
    """Return the least and the largest values of slices, each of at least one row, by column."""
    value = np.ascontiguousarray(value)
    longest = int((end - begin).max())
    if longest <= _SHORT_SLICE:
        last = end - 1
        low = high = value.take(begin, axis=0)
        for offset in range(1, longest):
            there = value.take(np.minimum(begin + offset, last), axis=0)
            low, high = np.minimum(low, there), np.maximum(high, there)
        return low, high
    low, high = np.empty((len(begin), value.shape[1])), np.empty((len(begin), value.shape[1]))
    least = most = value
    size = 1
    level = np.frexp(end - begin)[1]  # a slice is covered by two of the largest power of two within its length
    for power in range(1, int(level.max()) + 1):
        which = np.flatnonzero(level == power)
        if len(which):
            left, right = begin[which], end[which] - size
            low[which] = np.minimum(least[left], least[right])
            high[which] = np.maximum(most[left], most[right])
        if 2 * size <= len(value):
            least, most = np.minimum(least[:-size], least[size:]), np.maximum(most[:-size], most[size:])
        size *= 2
    return low, high
