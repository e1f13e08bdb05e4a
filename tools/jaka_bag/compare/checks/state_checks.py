"""Sequences of states: the same ones in the same order, each change in time; brief ones may be missed."""
from typing import List, NamedTuple, Tuple

import numpy as np

from ...driver_interface import MotionState
from ..matching.alignment import Alignment
from ..matching.course import Course
from ..matching.sequences import Entry, pair
from ..runs.run import Run, Track
from ..tolerances import StateTolerance, Tolerances
from ..verdict import Aspect, Check, equal, judged

_SHOWN = 12


class StateRun(NamedTuple):
    """A state that lasted from ``start`` to ``end``, s."""

    value: int
    start: float
    end: float

    @property
    def length(self) -> float:
        return self.end - self.start


def state_runs(track: Track, column: int, until: float) -> List[StateRun]:
    """Return the run-length form of one column; the last run ends at ``until``."""
    value = track.value[:, column]
    if not len(value):
        return []
    begins = np.concatenate([[0], np.flatnonzero(value[1:] != value[:-1]) + 1])
    times = track.time[begins].tolist() + [max(until, float(track.time[-1]))]
    return [StateRun(int(value[i]), begin, end) for i, begin, end in zip(begins.tolist(), times, times[1:])]


def without_brief(runs: List[StateRun], brief_s: float) -> List[StateRun]:
    """Return the runs longer than ``brief_s``, with equal neighbours joined."""
    result: List[StateRun] = []
    for run in runs:
        if run.length <= brief_s:
            continue
        if result and result[-1].value == run.value:
            result[-1] = StateRun(run.value, result[-1].start, run.end)
        else:
            result.append(run)
    return result


def state_name(field: str, value: int) -> str:
    """Return the name of a state for reports."""
    if field == "motion_state" and value in MotionState.__members__.values():
        return MotionState(value).name.lower().replace("_", " ")
    if field in ("power_state", "servo_state", "collision_state"):
        return {0: "off", 1: "on"}.get(value, str(value))
    return str(value)


def state_checks(golden: Run, candidate: Run, alignment: Alignment, tolerances: Tolerances,
                 course: Course) -> List[Check]:
    """Check each state field of topics that both logs have; record in ``course`` decisions about states' lengths."""
    checks: List[Check] = []
    for topic, ours in golden.states.items():
        theirs = candidate.states.get(topic)
        if not len(ours.time):
            continue
        if theirs is None or not len(theirs.time) or ours.names != theirs.names:
            checks.append(equal(Aspect.STATES, topic, "", False, "the candidate has no such states", None,
                                " ".join(ours.names), " ".join(theirs.names) if theirs else ""))
            continue
        for column, name in enumerate(ours.names):
            checks += _field_checks(topic, name, state_runs(ours, column, golden.duration),
                                    state_runs(theirs, column, candidate.duration), alignment.lag, tolerances.states,
                                    course)
    return checks


def _overlap(runs: List[StateRun], begin: float, end: float) -> List[StateRun]:
    """Return the parts of runs between two times, s, without parts of zero length."""
    return [StateRun(run.value, max(run.start, begin), min(run.end, end)) for run in runs
            if run.end > begin and run.start < end]


def _field_checks(topic: str, name: str, ours: List[StateRun], theirs: List[StateRun], lag: float,
                  limits: StateTolerance, course: Course) -> List[Check]:
    # Both logs say nothing about the time before they begin and after they end.
    begin = max(ours[0].start, theirs[0].start - lag)
    end = min(ours[-1].end, theirs[-1].end - lag)
    ours, theirs = _overlap(ours, begin, end), _overlap(theirs, begin + lag, end + lag)
    if not ours or not theirs:
        return [equal(Aspect.STATES, topic, name, False, "the logs have no time in common")]
    course.brief_state.within(np.array([run.length for run in ours + theirs]))
    long_g, long_c = without_brief(ours, limits.brief_s), without_brief(theirs, limits.brief_s)
    if [run.value for run in long_g] == [run.value for run in long_c]:
        ours, theirs = long_g, long_c
    course.edge_state.within(np.array([run.length for runs in (ours, theirs) for run in runs[:1] + runs[-1:]]))
    alone: List[Tuple[StateRun, float, str]] = []
    late: List[Tuple[float, StateRun]] = []
    for i, j in pair(_entries(ours, limits), _entries(theirs, limits), lag):
        if i is not None and j is not None:
            if i > 0 and j > 0:
                late.append((theirs[j].start - lag - ours[i].start, ours[i]))
        elif i is not None and not _may_miss(ours, i, limits):
            alone.append((ours[i], ours[i].start, "is missing"))
        elif j is not None and not _may_miss(theirs, j, limits):
            alone.append((theirs[j], theirs[j].start - lag, "is new"))
    if alone:
        run, at, words = alone[0]
        checks = [equal(Aspect.STATES, topic, name, False, "%s for %.2f s %s" % (
            state_name(name, run.value), run.length, words), at, _words(name, ours), _words(name, theirs))]
    else:
        checks = [equal(Aspect.STATES, topic, name, True, "%d changes: %s" % (len(theirs) - 1, _words(name, theirs)))]
    if late:
        off, changed = max(late, key=lambda entry: abs(entry[0]))
        checks.append(judged(Aspect.STATES, topic, name + " timing", abs(off), limits.timing_s, "s",
                             "the change to %s comes %.3f s %s" % (state_name(name, changed.value), abs(off),
                                                                   "later" if off > 0 else "sooner"), changed.start))
    return checks


def _weight(runs: List[StateRun], i: int, limits: StateTolerance) -> float:
    """Return the cost of leaving a run alone: little for one that may be missed.

    At the edges a run may be cut short: whether it is there at all then depends on when the recording began.
    """
    may_last = max(limits.brief_s, limits.timing_s) if i in (0, len(runs) - 1) else limits.brief_s
    return 0.01 if runs[i].length <= may_last else 1.0


def _entries(runs: List[StateRun], limits: StateTolerance) -> List[Entry]:
    return [Entry(run.value, run.start, _weight(runs, i, limits)) for i, run in enumerate(runs)]


def _may_miss(runs: List[StateRun], i: int, limits: StateTolerance) -> bool:
    """Return whether the other log may lack a run: one brief, short at an edge, or next to a brief one."""
    if _weight(runs, i, limits) < 1.0:
        return True
    # the other log missed the brief run between two equal ones: one of the two then has no partner
    return any(0 <= k < len(runs) and 0 <= 2 * k - i < len(runs) and runs[2 * k - i].value == runs[i].value
               and runs[k].length <= limits.brief_s for k in (i - 1, i + 1))


def _words(name: str, runs: List[StateRun]) -> str:
    return ", ".join(state_name(name, run.value) for run in runs[:_SHOWN]) + (", ..." if len(runs) > _SHOWN else "")
