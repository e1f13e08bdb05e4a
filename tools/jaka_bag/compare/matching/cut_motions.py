"""Motions that ended where something stopped them, not at a target, and the arm's allowed deviation afterwards.

A stop that arrives a moment later finds the arm farther along, by the speed at that moment times the time
allowed; it stays until a motion to an absolute target has been completed.
"""
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ...driver_interface import MotionState
from ...messages.batch import Array
from ..runs.run import Call, LongTrack, Run, arm_of
from .alignment import Arm
from .motion_fit import speeds

_BEFORE_S = 0.3
"""Time, s, before a cut at which speeds are read: the stop's own ramp comes after it, its report may come late."""
_AFTER_S = 0.1
"""Time, s, behind a cut up to which speeds are read; a longer one would see the brake."""
_JOG_TAIL_S = 0.5
"""Time, s, before the end of a jog at which it counts as cut: a person let go there, never twice at the same moment."""
_STOP_SERVICES = ("stop_move",)
_JOG_SERVICES = ("jog",)
_ABSOLUTE_SERVICES = ("joint_move", "linear_move", "servo_j", "servo_p")
_STOP_STATES = (MotionState.PAUSED, MotionState.EMERGENCY_STOP, MotionState.ERROR)


class Cut(NamedTuple):
    """A motion that was cut off; golden times in s: of the cut, of the motion's start, of the end of its effect."""

    at: float
    span_start: float
    until: float


def _stops(run: Run, arm: str, arms: List[str], calls: Sequence[Call]) -> List[float]:
    """Return golden times of all events that end motions."""
    times = [call.start for call in calls if call.short_name in _STOP_SERVICES]
    for topic, track in run.states.items():
        if arm_of(topic, arms) != arm:
            continue
        for column, name in enumerate(track.names):
            value = track.value[:, column]
            changed = np.flatnonzero(value[1:] != value[:-1]) + 1
            if name == "motion_state":
                times += track.time[changed[np.isin(value[changed], _STOP_STATES)]].tolist()
            elif name in ("power_state", "servo_state"):
                times += track.time[changed[value[changed] == 0]].tolist()
    return sorted(times)


def cut_motions(run: Run, name: str, arm: Arm) -> List[Cut]:
    """Return the cut motions of one arm of a golden log, in the order of time."""
    calls, spans = arm.calls, arm.spans
    stops = np.array(_stops(run, name, run.arms, calls))
    motion_calls = [call for call in calls if call.short_name in _JOG_SERVICES + _ABSOLUTE_SERVICES]
    call_starts = np.array([call.start for call in motion_calls])
    at: List[float] = []
    is_absolute: List[bool] = []
    starts = np.array([start for start, _ in spans])
    calls_before = (np.searchsorted(call_starts, starts + 0.05) - 1).tolist()
    next_stops = np.append(stops, np.inf)[np.searchsorted(stops, starts, "right")].tolist()
    for (start, end), before, stop in zip(spans, calls_before, next_stops):
        by_jog = before >= 0 and motion_calls[before].short_name in _JOG_SERVICES
        at.append(stop if stop < end + 0.05 else max(start, end - _JOG_TAIL_S) if by_jog else np.inf)
        is_absolute.append(not calls or (before >= 0 and not by_jog))
    cuts: List[Cut] = []
    until = np.inf  # end of the next motion to an absolute target that is not cut itself
    for number in reversed(range(len(spans))):
        if np.isfinite(at[number]):
            cuts.append(Cut(at[number], spans[number][0], until))
        elif is_absolute[number]:
            until = spans[number][1]
    return cuts[::-1]


def fit_ends(cuts: Sequence[Cut]) -> List[Tuple[float, float]]:
    """Return each cut motion's start, and the time from which it shows nothing about lag and pace, s."""
    return [(cut.span_start, cut.at - 0.1) for cut in cuts]


class Allowances:
    """The allowed deviation of each column of a track because of cuts, in the column's unit.

    Args:
        cuts: Cuts of the golden log.
        track: The golden track.
        cut_s: Largest shift of a cut in time, s.
        values: The values, of the track's number of rows, that are compared.
    """

    def __init__(self, cuts: Sequence[Cut], track: LongTrack, cut_s: float,
                 values: Callable[[Array], Array] = np.asarray) -> None:
        self._waiting = sorted(cuts, key=lambda cut: cut.at)[::-1]
        self._track = track
        self._cut_s = cut_s
        self._values = values
        self._active: List[Tuple[Cut, Array]] = []

    def at(self, times: Array, columns: int) -> Array:
        """Return allowed deviations, (len(times), columns), at golden times, s, ascending from call to call."""
        result = np.zeros((len(times), columns))
        if not len(times):
            return result
        first, last = float(times[0]), float(times[-1])
        while self._waiting and self._waiting[-1].at - self._cut_s <= last:
            cut = self._waiting.pop()
            allowed = self._allowed(cut)
            if allowed is not None:
                self._active.append((cut, allowed))
        self._active = [(cut, allowed) for cut, allowed in self._active if cut.until + self._cut_s >= first]
        for cut, allowed in self._active:
            result[(times >= cut.at - self._cut_s) & (times <= cut.until + self._cut_s)] += allowed
        return result

    def _allowed(self, cut: Cut) -> Optional[Array]:
        reach = self._track.facts.reach
        part = self._track.around(cut.at - _BEFORE_S, cut.at + _AFTER_S, reach)
        begin, end = np.searchsorted(part.time, (cut.at - _BEFORE_S, cut.at + _AFTER_S))
        if begin == end:
            return None
        speed = np.abs(speeds(part.time, self._values(part.value), reach))
        allowed: Array = speed[begin:end].max(axis=0) * self._cut_s
        return allowed
