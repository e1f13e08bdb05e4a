"""The times at which one log has samples and the other has none: nothing there is compared, so that it is told."""
from typing import List, Tuple

import numpy as np

from ...messages.batch import Array
from ..verdict import Aspect, Check, equal

_CELL_S = 0.05
"""Step, s, of the record of when there are samples."""
_FEWEST_CELLS = 2
"""Fewest cells with samples of a topic that has a step: one message has none."""


class _Cells:
    """The cells of time that hold samples; times ascend from call to call but for some jitter."""

    def __init__(self) -> None:
        self._parts: List[Array] = []

    def add(self, time: Array) -> None:
        """Add the times, s, of further samples."""
        if len(time):
            cells = np.floor(time * (1.0 / _CELL_S))
            self._parts.append(cells[np.concatenate([[True], cells[1:] != cells[:-1]])])

    def times(self) -> Array:
        """Return the middle of each cell, s, ascending."""
        cells = np.unique(np.concatenate([np.zeros(0), *self._parts]))
        times: Array = (cells + 0.5) * _CELL_S
        return times


class Reach:
    """A record of when a golden track and the candidate's have samples, in golden time."""

    def __init__(self) -> None:
        self.golden, self.candidate = _Cells(), _Cells()

    def checks(self, topic: str, field: str, common: Tuple[float, float], duration: float,
               near_s: float) -> List[Check]:
        """Return the check that each log has samples wherever the other has some; nothing where it is so.

        Args:
            topic: Topic of the track.
            field: Its field, for the report.
            common: Golden times, s, between which samples are expected in both logs.
            duration: Length of the golden log, s.
            near_s: A sample this far from one of the other log has it as its counterpart, but for the golden step.
        """
        ours, theirs = self.golden.times(), self.candidate.times()
        begin, end = common
        if len(ours) and not -duration <= ours[0] <= 2.0 * duration:  # stamps of another clock
            begin, end = begin + ours[0], end + ours[0]
        reach = near_s + 2.0 * _CELL_S + _usual_step(ours)
        alone = [("the candidate", _alone(ours, theirs, reach)), ("the golden log", _alone(theirs, ours, reach))]
        found = [(whose, some[(some >= begin) & (some <= end)]) for whose, some in alone]
        if max(len(ours), len(theirs)) < _FEWEST_CELLS or not any(len(some) for _, some in found):
            return []
        whose, some = max(found, key=lambda one: len(one[1]))
        words = "%s has no sample near %.2f s to %.2f s where the other has some" % (whose, some[0], some[-1])
        return [equal(Aspect.GAPS, topic, field, False, words, float(some[0]))]


def _usual_step(times: Array) -> float:
    """Return the step, s, such that half of the time lies in steps that are no longer; 0 for a single time."""
    steps = np.sort(np.diff(times))
    if not len(steps):
        return 0.0
    passed = np.cumsum(steps)
    return float(steps[int(np.searchsorted(passed, 0.5 * passed[-1]))])


def _alone(times: Array, others: Array, reach: float) -> Array:
    """Return the times, s, that are farther than ``reach`` from all of ``others``, ascending."""
    if not len(others):
        return times
    place = np.searchsorted(others, times)
    near = np.minimum(np.abs(times - others[np.maximum(place - 1, 0)]),
                      np.abs(times - others[np.minimum(place, len(others) - 1)]))
    alone: Array = times[near > reach]
    return alone
