"""The facts found in a track's samples in one pass, in the order of time: steps, motions, changes of state."""
from typing import List, Optional, Tuple

import numpy as np

from ...messages.batch import Array, largest
from ...operations.quantiles import Quantiles
from .run import TimeWindow, TrackFacts, are_numbers

MOVING_RAD_S = 0.005
"""A joint faster than this moves, rad/s."""
_MERGE_S = 0.1
"""Rest, s, between two motions below which they are one: speeds pass zero where an arm turns back."""
_LEAST_TRAVEL_RAD = 0.003
"""Least way, rad, of a motion: noise and settling are less."""
_SPEED_S = 0.024
"""Time, s, to either side over which speeds are taken."""
_LEAST_STEP_S = 1e-4
"""Least step, s, that counts for the usual one: messages that were held up come in a burst."""


def reach_of(step: float) -> int:
    """Return how many samples to either side speeds are taken over, for samples ``step`` s apart (0: unknown)."""
    return max(1, int(round(_SPEED_S / step))) if step > 0 else 1


class SpanFinder:
    """The motions of an arm, from rest to rest.

    Args:
        reach: Number of samples to either side over which speeds are taken.
    """

    def __init__(self, reach: int) -> None:
        self._reach = reach
        self._time = np.zeros(0)
        self._value = np.zeros((0, 0))
        self._found: List[TimeWindow] = []
        self._start: Optional[float] = None
        self._end = 0.0
        self._low = self._high = self._gap_low = self._gap_high = np.zeros(0)
        self._is_moving = False

    def add(self, time: Array, value: Array) -> None:
        """Add further samples, all of them numbers; s, shape (n,); rad, shape (n, joints)."""
        if len(self._time):
            time, value = np.concatenate([self._time, time]), np.concatenate([self._value, value])
        both = 2 * self._reach
        if len(time) > both:
            span = np.maximum(time[both:] - time[:-both], 1e-6)
            joints = np.ascontiguousarray(value.T)  # extremes of rows take a tenth of the time
            way = joints[:, both:] - joints[:, :-both]
            moving = np.abs(way, out=way).max(axis=0) / span > MOVING_RAD_S
            self._judge(time[self._reach:-self._reach], joints[:, self._reach:-self._reach], moving)
        self._time, self._value = time[-both:].copy(), value[-both:].copy()

    def _judge(self, time: Array, joints: Array, moving: Array) -> None:
        edges = np.flatnonzero(np.diff(moving, prepend=False, append=False)).tolist()
        done = 0
        for begin, end in zip(edges[::2], edges[1::2]):
            goes_on = begin == 0 and self._is_moving
            if self._start is not None and (goes_on or time[begin] - self._end < _MERGE_S):
                part = joints[:, done:end]
                self._low = np.minimum(np.minimum(self._low, self._gap_low), part.min(axis=1))
                self._high = np.maximum(np.maximum(self._high, self._gap_high), part.max(axis=1))
            else:
                self._close()
                self._start = float(time[begin])
                self._low, self._high = joints[:, begin:end].min(axis=1), joints[:, begin:end].max(axis=1)
            self._end = float(time[end - 1])
            self._gap_low, self._gap_high = self._low, self._high
            done = end
        if self._start is not None and done < len(moving):  # part of the motion, if it soon goes on
            self._gap_low = np.minimum(self._gap_low, joints[:, done:].min(axis=1))
            self._gap_high = np.maximum(self._gap_high, joints[:, done:].max(axis=1))
        self._is_moving = bool(moving[-1])

    def _close(self) -> None:
        if self._start is not None and float((self._high - self._low).max()) >= _LEAST_TRAVEL_RAD:
            self._found.append((self._start, self._end))
        self._start = None

    def motions(self) -> Tuple[TimeWindow, ...]:
        """Return (start, end) of each motion, s; call it once, after the last sample."""
        self._close()
        return tuple(self._found)


class FactsBuilder:
    """A collector of a track's facts.

    Args:
        is_arm: The columns are joints: motions are looked for.
        reach: Samples to either side for speeds of motions; None to take it from the first samples.
    """

    def __init__(self, is_arm: bool, reach: Optional[int] = None) -> None:
        self._is_arm = is_arm
        self.used_reach = reach
        self._spans: Optional[SpanFinder] = None
        self._steps, self._all_steps = Quantiles(), Quantiles()
        self._count = self._finite_count = 0
        self._first, self._last = np.inf, -np.inf

    def add(self, time: Array, value: Array) -> None:
        """Add further samples, s, shape (n,), ascending, and their values, shape (n, columns)."""
        self._count += len(time)
        good = are_numbers(value)
        if not good.all():
            time, value = time[good], value[good]
        if not len(time):
            return
        self._finite_count += len(time)
        steps = np.diff(time, prepend=self._last) if np.isfinite(self._last) else np.diff(time)
        self._first, self._last = min(self._first, float(time[0])), float(time[-1])
        self._all_steps.add(steps)
        self._steps.add(steps[steps > _LEAST_STEP_S])
        if not self._is_arm or not value.shape[1]:  # a JointState of velocities or efforts alone
            return
        if self._spans is None:
            if self.used_reach is None:
                self.used_reach = reach_of(self._steps.median() if self._steps.count else 0.0)
            self._spans = SpanFinder(self.used_reach)
        self._spans.add(time, value)

    def facts(self) -> TrackFacts:
        """Return all facts; call it once, after the last sample."""
        step = self._steps.median() if self._steps.count else 0.0
        motions = self._spans.motions() if self._spans is not None and self._finite_count >= 3 else ()
        return TrackFacts(self._count, self._first, self._last, self._finite_count, step,
                          self._all_steps.median() if self._all_steps.count else 0.0, reach_of(step), motions)


class StateChanges:
    """A collector of the samples at which a state changes, with the first and the last."""

    def __init__(self) -> None:
        self._times: List[Array] = []
        self._values: List[Array] = []
        self._last: Optional[Tuple[Array, Array]] = None

    def add(self, time: Array, value: Array) -> None:
        """Add further samples, s, shape (n,), ascending, and their values, shape (n, states)."""
        if not len(time):
            return
        before = value[:1] - 1 if self._last is None else self._last[1]
        changed = largest(np.concatenate([before, value[:-1]]) != value)
        self._times.append(time[changed])
        self._values.append(value[changed])
        self._last = (time[-1:].copy(), value[-1:].copy())

    def samples(self) -> Tuple[Array, Array]:
        """Return times, s, and values of the samples kept, at least one."""
        assert self._last is not None
        return np.concatenate([*self._times, self._last[0]]), np.concatenate([*self._values, self._last[1]])
