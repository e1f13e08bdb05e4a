"""The times on a path at which its clock stood: for the question where the arm was wanted at an earlier moment.

The clock's rate changes with pauses, the speed override and late cycles. Moments between which it was the same are kept
once, so that hours at one speed take no memory.
"""
from collections import deque
from typing import Deque, NamedTuple, Optional

_KEPT = 4096
"""Changes of the rate that are kept: each cycle of a ramp is one, so that this is half a minute of nothing else."""
_SAME_S = 1e-6
"""Largest distance, s, from a line on which a moment still lies."""


class _Moment(NamedTuple):
    at: float
    time: float


class PathMoment(NamedTuple):
    """The clock at a moment: its time on the path, s, and its rate, seconds of the path for each second."""

    time: float
    rate: float


class ClockTrace:
    """The moments of one path's clock; it has no clock of its own."""

    def __init__(self, at: float, time: float) -> None:
        """Begin the trace: at the moment ``at``, s, the clock stands at ``time`` on the path, s."""
        self._moments: Deque[_Moment] = deque([_Moment(at, time)], _KEPT)

    @property
    def since(self) -> float:
        """The earliest moment that is known, s."""
        return self._moments[0].at

    def note(self, at: float, time: float) -> None:
        """Add a moment, later than those before."""
        moments = self._moments
        if len(moments) > 1 and abs(_between(moments[-2], moments[-1], at).time - time) <= _SAME_S:
            moments.pop()
        moments.append(_Moment(at, time))

    def at(self, at: float, rate: float) -> Optional[PathMoment]:
        """Return where the clock stood at this moment, s, or will stand if it goes on at ``rate``; None before the
        first.
        """
        later = self._moments[-1]
        if at >= later.at:
            return PathMoment(later.time + (at - later.at) * rate, rate)
        for earlier in reversed(self._moments):
            if earlier.at <= at:
                return _between(earlier, later, at)
            later = earlier
        return None


def _between(earlier: _Moment, later: _Moment, at: float) -> PathMoment:
    rate = (later.time - earlier.time) / (later.at - earlier.at)
    return PathMoment(earlier.time + (at - earlier.at) * rate, rate)
