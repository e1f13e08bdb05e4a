"""Sequences of states: the same ones in the same order, each change in time; brief ones may be missed."""
import bisect
import re
from collections import Counter
from functools import partial
from typing import Callable, List, Sequence, Tuple

import numpy as np

from ...driver_interface import MotionState
from ...units import s_to_ms
from ..matching.alignment import Alignment
from ..matching.course import Course
from ..matching.state_pairing import StateRun, are_in_step, pair_states
from ..runs.run import Run, Track, arm_of
from ..tolerances import StateTolerance, Tolerances
from ..verdict import Aspect, Check, equal, judged

_SHOWN = 12
"""Most states that a line of the report lists."""
_FEWEST_BEGINS = 2
"""Fewest motions of which the delay of a state is told: of one alone it may be chance."""
_NEAR_S = 0.3
"""Time within which a state belongs to the begin of a motion, s."""
_ALARM_NAMES = re.compile(r"alarm|collision|emergency|e_?stop|(^|_)err(or)?(s|_|$)|fault", re.IGNORECASE)


def state_runs(track: Track, column: int, until: float) -> List[StateRun]:
    """Return the run-length form of one column; the last run ends at ``until``."""
    value = track.value[:, column]
    if not len(value):
        return []
    begins = np.concatenate([[0], np.flatnonzero(value[1:] != value[:-1]) + 1])
    times = track.time[begins].tolist() + [max(until, float(track.time[-1]))]
    return [StateRun(int(value[i]), begin, end) for i, begin, end in zip(begins.tolist(), times, times[1:])]


def is_alarm(field: str, value: int) -> bool:
    """Return whether a state tells of a fault: it is never excused where the golden log does not have it."""
    name = field.rsplit(".", 1)[0] if field.endswith(".val") else field
    name = name.rsplit(".", 1)[-1]
    if name == "motion_state":
        return value in (MotionState.EMERGENCY_STOP, MotionState.ERROR)
    if name in ("power_state", "drives_powered"):
        return value == 0
    return _ALARM_NAMES.search(name) is not None and value > 0


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
            runs = in_common(state_runs(ours, column, golden.duration),
                             state_runs(theirs, column, candidate.duration), alignment.lag)
            note_lengths(runs, course)
            checks += field_checks(Aspect.STATES, topic, name, *runs, alignment.lag, tolerances.states,
                                   partial(state_name, name))
            if name == "motion_state":
                checks += _beside_motions(topic, arm_of(topic, golden.arms), runs, alignment, tolerances)
    return checks


def note_lengths(runs: Tuple[List[StateRun], List[StateRun]], course: Course) -> None:
    """Take down in ``course`` which lengths decide whether a run may be missed."""
    course.brief_state.within(np.array([run.length for part in runs for run in part]))
    course.edge_state.within(np.array([run.length for part in runs for run in part[:1] + part[-1:]]))


def in_common(ours: List[StateRun], theirs: List[StateRun], lag: float) -> Tuple[List[StateRun], List[StateRun]]:
    """Return the runs of both logs in the time that both cover.

    Both logs say nothing about the time before they begin and after they end.
    """
    if not ours or not theirs:
        return [], []
    begin = max(ours[0].start, theirs[0].start - lag)
    end = min(ours[-1].end, theirs[-1].end - lag)
    return _overlap(ours, begin, end), _overlap(theirs, begin + lag, end + lag)


def _overlap(runs: List[StateRun], begin: float, end: float) -> List[StateRun]:
    """Return the parts of runs between two times, s, without parts of zero length."""
    return [StateRun(run.value, max(run.start, begin), min(run.end, end)) for run in runs
            if run.end > begin and run.start < end]


def field_checks(aspect: Aspect, topic: str, name: str, ours: List[StateRun], theirs: List[StateRun], lag: float,
                 limits: StateTolerance, name_of: Callable[[int], str]) -> List[Check]:
    """Check the sequence of one field's values, and when it changes.

    Args:
        aspect: Aspect of the checks.
        topic: Topic of the field.
        name: The field.
        ours: The golden log's runs.
        theirs: The candidate's runs.
        lag: Delay of the candidate's times, s.
        limits: Tolerances.
        name_of: Returns a value's name for reports.
    """
    if not ours or not theirs:
        return [equal(aspect, topic, name, False, "the logs have no time in common")]
    alone: List[Tuple[StateRun, float, str]] = []
    if are_in_step(ours, theirs, lag, limits.timing_s):
        pairs = [(i, i) for i in range(len(ours))]
    else:
        known = {run.value for run in ours}
        may_miss = [_is_brief(ours, i, limits) for i in range(len(ours))]
        may_be_new = [_is_brief(theirs, j, limits) and run.value in known and not is_alarm(name, run.value)
                      for j, run in enumerate(theirs)]
        found = pair_states(ours, theirs, lag, may_miss, may_be_new, limits.timing_s)
        pairs = found.pairs
        alone = [(ours[i], ours[i].start, "is missing") for i in found.missing]
        alone += [(theirs[j], theirs[j].start - lag, "is new") for j in found.new]
        alone += [(run, run.start - lag, "comes again") for run in _further_alarms(name, ours, theirs)]
    late = [(theirs[j].start - lag - ours[i].start, ours[i]) for i, j in pairs if i > 0 and j > 0]
    if alone:
        run, at, words = min(alone, key=lambda entry: entry[1])
        checks = [equal(aspect, topic, name, False, "%s for %.2f s %s" % (name_of(run.value), run.length, words), at,
                        _words(name_of, ours), _words(name_of, theirs))]
    else:
        checks = [equal(aspect, topic, name, True, "%d changes: %s" % (len(theirs) - 1, _words(name_of, theirs)))]
    if late:
        off, changed = max(late, key=lambda entry: abs(entry[0]))
        checks.append(judged(aspect, topic, name + " timing", abs(off), limits.timing_s, "s",
                             "the change to %s comes %.3f s %s" % (name_of(changed.value), abs(off),
                                                                   "later" if off > 0 else "sooner"), changed.start))
    return checks


def _further_alarms(name: str, ours: List[StateRun], theirs: List[StateRun]) -> List[StateRun]:
    """Return the last run of each alarm that begins more often than in the golden log.

    The pairing joins an alarm with the same one before it, where what came between is excused as brief.
    """
    began = Counter(run.value for run in ours)
    last = {run.value: run for run in theirs if is_alarm(name, run.value)}
    return [last[value] for value, count in Counter(run.value for run in theirs).items()
            if value in last and count > began[value]]


def _beside_motions(topic: str, arm: str, runs: Tuple[List[StateRun], List[StateRun]], alignment: Alignment,
                    tolerances: Tolerances) -> List[Check]:
    """Check that the begin of each motion is as near to the state that tells of it as in the golden log."""
    brief_s = tolerances.states.brief_s
    begins = [sorted(run.start for run in some[1:] if run.value == MotionState.RUNNING and run.length > brief_s)
              for some in runs]
    found: List[Tuple[float, float]] = []
    for episode in alignment.episodes.get(arm, ()):
        near = [_nearest(starts, at) for starts, at in zip(begins, (episode.start, episode.start + episode.lag))]
        if episode.is_alike and max(near)[0] <= _NEAR_S:
            found.append((near[1][1] - near[0][1], episode.start))
    if len(found) < _FEWEST_BEGINS:
        return []
    off = float(np.median([entry[0] for entry in found]))
    return [judged(Aspect.LATENESS, topic, "motion_state", s_to_ms(abs(off)), tolerances.timing.stale_ms, "ms",
                   "the state of %d motions comes %.1f ms %s beside the joints" % (
                       len(found), s_to_ms(abs(off)), "later" if off > 0 else "sooner"), found[0][1])]


def _nearest(starts: Sequence[float], at: float) -> Tuple[float, float]:
    """Return the distance, s, from a time to the nearest of ascending ones, and again with its sign; else infinite."""
    place = bisect.bisect_left(starts, at)
    return min(((abs(start - at), start - at) for start in starts[max(place - 1, 0):place + 1]),
               default=(np.inf, np.inf))


def _is_brief(runs: List[StateRun], i: int, limits: StateTolerance) -> bool:
    """Return whether a run may be missed.

    At the edges a run may be cut short: whether it is there at all then depends on when the recording began.
    """
    may_last = max(limits.brief_s, limits.timing_s) if i in (0, len(runs) - 1) else limits.brief_s
    return runs[i].length <= may_last


def _words(name_of: Callable[[int], str], runs: List[StateRun]) -> str:
    return ", ".join(name_of(run.value) for run in runs[:_SHOWN]) + (", ..." if len(runs) > _SHOWN else "")
