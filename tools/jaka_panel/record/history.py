"""Curves of an arm's joints over the last minutes; shortened ones keep every minimum and maximum."""
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

KINDS = ("q", "dq", "e")
"""Positions, rad, speeds, rad/s, following errors, rad."""
SECONDS = 600.0
"""Length, s, of the record: with ten minutes each arm takes 6 MB, from the first sample on."""
_RATE = 125
"""Rate, Hz: that of the driver's joints."""
_JOINTS = 6
MOST_BUCKETS = 4000
"""Most columns that a page may ask for: pixels across the widest screen."""
GAP_S = 0.3
"""Time between two samples, s, above which there is a gap between them: they are never joined."""


class History:
    """A ring of samples; each has a time, monotonic, s, and for each of ``KINDS`` six numbers, NaN where unknown."""

    def __init__(self) -> None:
        size = int(SECONDS * _RATE)
        self._time = np.full(size, -np.inf)
        self._values = np.full((size, len(KINDS), _JOINTS), np.nan, np.float32)
        self._next = 0

    def add(self, time: float, values: Sequence[Optional[Sequence[float]]]) -> None:
        """Add a sample, later than all before: for each of ``KINDS`` six numbers, or None."""
        at = self._next
        self._time[at] = time
        row = self._values[at]
        for n, six in enumerate(values):
            row[n] = np.nan if six is None else six
        self._next = (at + 1) % len(self._time)

    def shortened(self, kind: str, begin: float, end: float, buckets: int) -> Dict[str, Any]:
        """Return minimum and maximum of each joint in so many equal parts of a time, as JSON has it.

        Args:
            kind: One of ``KINDS``.
            begin: Monotonic time, s.
            end: Monotonic time, s, later than ``begin``.
            buckets: 1 to ``MOST_BUCKETS``.

        Returns:
            For each part that has samples ``s`` and ``last``, the times of its first and last one, and ``min`` and
            ``max``, for each joint one number a part, None where it has none. A part with a gap in it is divided there.
        """
        order = np.concatenate((np.arange(self._next, len(self._time)), np.arange(self._next)))
        time = self._time[order]
        first, last = np.searchsorted(time, (begin, end))
        chosen, time = order[first:last], time[first:last]
        if not len(time):
            return {"s": [], "last": [], "min": [[] for _ in range(_JOINTS)], "max": [[] for _ in range(_JOINTS)]}
        part = ((time - begin) * (buckets / (end - begin))).astype(int).clip(0, buckets - 1)
        is_begin = np.append(True, (np.diff(part) > 0) | (np.diff(time) > GAP_S))
        starts = np.flatnonzero(is_begin)
        ends = np.append(starts[1:], len(time)) - 1
        values = self._values[chosen, KINDS.index(kind)]
        # fmin and fmax pass over NaN; a part of NaN alone stays NaN
        low, high = (_columns(reduce.reduceat(values, starts)) for reduce in (np.fmin, np.fmax))
        begins, lasts = ([round(value, 4) for value in time[at].tolist()] for at in (starts, ends))
        return {"s": begins, "last": lasts, "min": low, "max": high}


def _columns(rows: Any) -> List[List[Optional[float]]]:
    return [[None if value != value else round(value, 6) for value in column] for column in rows.T.tolist()]


class Differences:
    """Joint speeds, rad/s, from positions, where the controller reports none: over the last samples."""

    _SPAN = 4
    """Number of samples over which a speed is taken: with fewer it is noise, with more it comes late."""

    def __init__(self) -> None:
        self._samples: List[Tuple[float, Sequence[float]]] = []

    def of(self, time: float, position: Sequence[float]) -> Optional[List[float]]:
        """Return the speeds at a new sample; None for the first one and after a pause."""
        samples = self._samples
        if samples and not 0.0 < time - samples[-1][0] < 0.5:
            samples.clear()
        samples.append((time, position))
        if len(samples) > self._SPAN:
            del samples[0]
        if len(samples) < 2:
            return None
        begin = samples[0]
        return [(b - a) / (time - begin[0]) for a, b in zip(begin[1], position)]
