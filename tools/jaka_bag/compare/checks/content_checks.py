"""Contents of messages: discrete fields, texts and arrays as sequences; topics on change by order and content."""
import math
import re
from dataclasses import replace
from functools import partial
from typing import Callable, Dict, FrozenSet, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from ...messages.batch import Array
from ...units import mm_to_m, ms_to_s
from ..matching.alignment import Alignment
from ..matching.course import Course
from ..matching.curve_distance import distances
from ..matching.state_pairing import StateRun
from ..runs.contents import AGE, QUATERNION
from ..runs.publishers import base_of
from ..runs.run import Contents, LongTrack, Run, Stream, Track
from ..tolerances import ContentTolerance, StateTolerance, Tolerances
from ..verdict import Aspect, Check, equal, judged
from .state_checks import field_checks, in_common, note_lengths, state_runs
from .timing_checks import LATCHED_S

_PLACES = re.compile(r"(.*[. ])?(position|translation)(\.[xyz])?")
_JOINTS = re.compile(r"(.*\.)?positions|position \(of .*\)")
_GOAL_STATUSES = re.compile(r"(.*\.)?status_list\.status")
_PENDING = re.compile(r"\b0\b")
_FEWEST_PERIODIC = 10
"""Fewest messages of which a rate is told; with fewer chance decides."""
_FAST_HZ = 20.0
"""Rate, Hz, above which a topic is taken as steady: nothing that happens now and then comes so often."""
_STEADY_SHARE = 0.6
"""Share of the steps that are near the usual one in a steady topic: gaps and doubles may spoil the others."""
_COUNTER_SHARE, _FEWEST_COUNTED = 0.3, 20
_SHARE_OFF, _SHARE_SPREADS = 0.25, 4.0
"""Limits for the share of messages in which a counter changes: of that share, and in spreads of chance."""
_MOST_NOISE = 0.5
"""Largest share of a field's span that its noise may add to the limit: of a field that is all noise something must
show."""
_NO_NUMBER = -1
_NEW_LEVEL = 1 << 32
"""First key of a level that the golden log does not have: above the number of any that it has."""
_SPARSE = 4.0
"""Messages that repeat each other have times to compare where they are so many limits apart, on average."""
_NO_MESSAGE, _NO_MESSAGE_NAME = -1 << 80, "no message yet"
"""A value beyond 64 bits, which no field has, and no alarm."""


class Counts(NamedTuple):
    """The numbers of messages of a topic in both logs between two golden times, s."""

    golden: int
    candidate: int
    begin: float
    end: float


def messages_more_or_less(stream: Stream, duration: float, gap_s: float) -> Optional[int]:
    """Return by how many messages a topic may differ that has no rate; None where it has one.

    A topic has no rate where it is published when something changes, or so slowly that its steps are gaps.

    Args:
        stream: The golden topic.
        duration: Length of its log, s.
        gap_s: A longer silence is a gap.
    """
    if len(stream) > _FAST_HZ * duration and len(stream) >= _FEWEST_PERIODIC:
        return None
    steps = np.diff(stream.between(-np.inf, np.inf).log_time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    is_steady = len(steps) > 1 and float(((steps > 0.5 * usual) & (steps < 1.5 * usual)).mean()) >= _STEADY_SHARE
    if not is_steady:
        return 0
    return 1 if len(stream) < _FEWEST_PERIODIC or usual > 0.5 * gap_s else None


def repeats_more_or_less(repeats: int, longer: float) -> int:
    """Return by how many repeated messages a topic may differ in a log of another length.

    A message that is repeated with a period may fall in or out at both ends of either log.

    Args:
        repeats: Their number in the golden log.
        longer: How much longer or shorter the other log is, as a share of the golden one's length.
    """
    of_length = longer * (repeats + 2)
    return math.ceil(of_length) + (1 if of_length >= 1.0 else 0)


def is_of_any_speed(name: str) -> bool:
    """Return whether a number does not depend on the speed at which a simulated arm ran."""
    base = base_of(name)
    return base.endswith(QUATERNION) or any(one.fullmatch(part) for one, part in (
        (_PLACES, base), (_JOINTS, base), (_JOINTS, name)))


class NumberLimits(NamedTuple):
    """The limits of one field's numbers: one a column, or one for the distance of quaternions."""

    limits: Array
    is_quaternion: bool


def fixed_limit(name: str, tolerances: Tolerances) -> Optional[float]:
    """Return the limit of a field that does not depend on its golden values; None where it does."""
    base = base_of(name)
    if base.endswith(QUATERNION):
        return 0.5 * tolerances.tcp.orientation_rad
    if base.endswith(AGE):
        return ms_to_s(tolerances.timing.jitter_ms)
    if _JOINTS.fullmatch(name) or _JOINTS.fullmatch(base):
        return tolerances.joints.position_rad
    return mm_to_m(tolerances.tcp.position_mm) if _PLACES.fullmatch(base) else None


def unit_of(name: str) -> str:
    """Return the unit of a field's numbers; empty where its name does not tell."""
    base = base_of(name)
    if _JOINTS.fullmatch(name) or _JOINTS.fullmatch(base):
        return "rad"
    return "m" if _PLACES.fullmatch(base) else ""


def number_limits(name: str, track: LongTrack, tolerances: Tolerances, is_sequence: bool) -> NumberLimits:
    """Return the limits of a field.

    Args:
        name: The field.
        track: Its golden values.
        tolerances: Limits for deviations.
        is_sequence: Each value is a step of its own, so that steps are no noise.
    """
    columns = len(track.names)
    fixed = fixed_limit(name, tolerances)
    if fixed is not None:
        is_quaternion = name.endswith(QUATERNION)
        return NumberLimits(np.full(1 if is_quaternion else columns, fixed), is_quaternion)
    low, high, noise = np.full(columns, np.inf), np.full(columns, -np.inf), np.zeros(columns)
    for block in track.blocks():
        value = block.finite().value
        if len(value):
            low, high = np.minimum(low, value.min(axis=0)), np.maximum(high, value.max(axis=0))
        if len(value) > 1:
            noise = np.maximum(noise, np.median(np.abs(np.diff(value, axis=0)), axis=0))
    span = np.where(high >= low, high - low, 0.0)
    largest = np.where(high >= low, np.maximum(np.abs(low), np.abs(high)), 0.0)
    limits = tolerances.contents
    steps = np.zeros(columns) if is_sequence else np.minimum(limits.noise * noise, _MOST_NOISE * span)
    return NumberLimits(np.maximum(steps, _share_of(span, largest, limits)), False)


def _share_of(span: Array, largest: Array, limits: ContentTolerance) -> Array:
    """Return the limits of numbers by their golden range and largest amount."""
    shares: Array = np.maximum.reduce([0.01 * limits.range_percent * span, 0.01 * limits.value_percent * largest,
                                       np.full(np.shape(span), limits.absolute)])
    return shares


def content_checks(golden: Run, candidate: Run, alignment: Alignment, tolerances: Tolerances,
                   on_change: Mapping[str, int], own: FrozenSet[str], course: Course,
                   counts: Mapping[str, Counts]) -> List[Check]:
    """Check all fields that are sequences of values, and all of the topics that are published on change.

    Args:
        golden: The golden log.
        candidate: The candidate, with the same topics and types.
        alignment: Alignment of both logs.
        tolerances: Limits for deviations.
        on_change: Topics without a rate, and by how many messages each may differ.
        own: Topics of joints, poses and states.
        course: Takes down decisions about the lengths of values.
        counts: Messages of topics while both logs run; empty where their number depends on the time scale.
    """
    checks: List[Check] = []
    for topic, ours in golden.contents.items():
        theirs = candidate.contents.get(topic)
        if theirs is None:
            continue
        limits = tolerances.states
        if topic in on_change:
            limits = replace(limits, brief_s=ms_to_s(tolerances.contents.brief_ms))
            if topic not in own:
                longer = abs(candidate.duration - golden.duration) / max(golden.duration, 1e-9)
                slack = on_change[topic] + repeats_more_or_less(ours.repeats, longer)
                checks.append(_repeat_check(topic, ours, theirs, len(golden.streams[topic]), slack, tolerances))
        spans = (golden.duration, candidate.duration)
        for name in dict.fromkeys(ours.names + theirs.names):
            if tolerances.ignores_field(topic, name):
                continue
            if name not in ours.names or name not in theirs.names:
                if len(ours.time) and len(theirs.time):
                    checks.append(equal(Aspect.CONTENTS, topic, name, False, "only one of the logs has such a field"))
                continue
            checks += _sequence_checks(topic, name, ours, theirs, alignment.lag, spans, limits, tolerances,
                                       len(golden.streams[topic]), course, counts.get(topic), on_change.get(topic) == 0)
    for topic, slack in on_change.items():
        checks += _number_sequences(golden, candidate, topic, alignment, tolerances, slack == 0)
        if slack == 0:
            checks += _arrival_checks(golden, candidate, topic, alignment.lag, tolerances.states.timing_s)
    return checks


def _arrival_checks(golden: Run, candidate: Run, topic: str, lag: float, limit: float) -> List[Check]:
    """Check when the few messages of a topic without a period come, where both logs have as many at the same time."""
    begin, end = max(0.0, -lag) - limit, min(golden.duration, candidate.duration - lag) + limit
    times, others = (run.streams[topic].between(-np.inf, np.inf).log_time - shift
                     for run, shift in ((golden, 0.0), (candidate, lag)))
    times, others = (some[(some >= begin) & (some <= end)] for some in (times, others))
    if len(times) != len(others) or len(times) * _SPARSE * limit > end - begin:
        return []
    latched = int((times <= LATCHED_S).sum())
    if latched == int((others + lag <= LATCHED_S).sum()):
        times, others = times[latched:], others[latched:]
    if not len(times):
        return []
    off, at = max((float(np.abs(others - time).min()), float(time)) for time in times)
    new, late = max((float(np.abs(times - time).min()), float(time)) for time in others)
    words = "no message comes within %.3f s of the one at %.2f s" % (off, at) if off >= new else \
        "the message at %.2f s is %.3f s from all golden ones" % (late, new)
    return [judged(Aspect.CONTENTS, topic, "message timing", max(off, new), limit, "s",
                   "%d messages; %s" % (len(times), words), at if off >= new else late)]


def _with_begin(ours: List[StateRun], theirs: List[StateRun], lag: float,
                limit: float) -> Tuple[List[StateRun], List[StateRun]]:
    """Return runs that begin with "no message yet", where the first message tells when something happened.

    Messages at the begin of a recording may be latched; those before it the other recording does not have.
    """
    if not ours or not theirs:
        return ours, theirs
    begin = max(0.0, -lag)
    after = ours[0].start - begin, theirs[0].start - lag - begin
    if max(after) <= LATCHED_S or min(after) < -limit:
        return ours, theirs
    some, others = ([StateRun(_NO_MESSAGE, start, runs[0].start), *runs] if runs[0].start > start else runs
                    for runs, start in ((ours, begin), (theirs, begin + lag)))
    return some, others


def _repeat_check(topic: str, ours: Contents, theirs: Contents, count: int, slack: int,
                  tolerances: Tolerances) -> Check:
    """Check that messages on change repeat the one before them as often, but for ``slack`` where they do so."""
    off = 100.0 * max(abs(theirs.repeats - ours.repeats) - (slack if ours.repeats else 0), 0) / max(count, 1)
    return judged(Aspect.COUNTS, topic, "repeated", off, tolerances.streams.count_percent, "%",
                  "%d messages repeat the one before, %d in the golden log" % (theirs.repeats, ours.repeats),
                  golden=str(ours.repeats), candidate=str(theirs.repeats))


def _name_of(ours: Dict[int, str], theirs: Dict[int, str], value: int) -> str:
    if value == _NO_MESSAGE:
        return _NO_MESSAGE_NAME
    return ours.get(value) or theirs.get(value) or str(value)


def _sequence_checks(topic: str, name: str, ours: Contents, theirs: Contents, lag: float, spans: Tuple[float, float],
                     limits: StateTolerance, tolerances: Tolerances, count: int, course: Course,
                     common: Optional[Counts], has_begin: bool) -> List[Check]:
    tracks = [some.track(topic) for some in (ours, theirs)]
    columns = [some.names.index(name) for some in (ours, theirs)]
    changes = int((np.diff(tracks[0].value[:, columns[0]]) != 0).sum())
    if changes > max(_COUNTER_SHARE * count, _FEWEST_COUNTED) and name not in ours.labels:
        return _counter_checks(topic, name, tracks, columns, lag, tolerances, common)
    golden, candidate = (state_runs(track, column, until) for track, column, until in zip(tracks, columns, spans))
    if _GOAL_STATUSES.fullmatch(name):
        golden, candidate = (_without_brief_pending(runs, some.labels.get(name, {}), limits.brief_s)
                             for runs, some in zip((golden, candidate), (ours, theirs)))
    if has_begin:
        golden, candidate = _with_begin(golden, candidate, lag, limits.timing_s)
    runs = in_common(golden, candidate, lag)
    note_lengths(runs, course)
    return field_checks(Aspect.CONTENTS, topic, name, *runs, lag, limits,
                        partial(_name_of, ours.labels.get(name, {}), theirs.labels.get(name, {})))


def _without_brief_pending(runs: List[StateRun], labels: Mapping[int, str], brief_s: float) -> List[StateRun]:
    """Return runs of goal statuses without the moments in which a goal was pending.

    An action server accepts a goal a moment after it has listed it; whether its timer publishes between is chance.
    """
    kept: List[StateRun] = []
    for run in runs:
        is_passing = run.length <= brief_s and _PENDING.search(labels.get(run.value, "")) is not None
        if is_passing and run is not runs[-1]:
            continue
        if kept and kept[-1].value == run.value:
            run = StateRun(run.value, kept.pop().start, run.end)
        kept.append(run)
    return kept


def _counter_checks(topic: str, name: str, tracks: List[Track], columns: List[int], lag: float,
                    tolerances: Tolerances, common: Optional[Counts]) -> List[Check]:
    """Check whole numbers that change all the time as a curve, and how often they change."""
    (time, value), (at, seen) = [(track.time, track.value[:, [column]].astype(float))
                                 for track, column in zip(tracks, columns)]
    at = at - lag
    inside, reverse = (at >= time[0]) & (at <= time[-1]), (time >= at[0]) & (time <= at[-1])
    if not inside.any() or not reverse.any():
        return [equal(Aspect.CONTENTS, topic, name, False, "the logs have no time in common")]
    allowed = float(_share_of(np.ptp(value), np.abs(value).max(), tolerances.contents))
    jitter_s = ms_to_s(tolerances.timing.jitter_ms)
    worst = max(_farthest(time, value, at[inside], seen[inside], jitter_s),
                _farthest(at, seen, time[reverse], value[reverse], jitter_s))
    checks = [judged(Aspect.CONTENTS, topic, name, worst[0], allowed, "", "at most %.4g off" % worst[0], worst[1],
                     "%.6g" % np.interp(worst[1], time, value[:, 0]), "%.6g" % np.interp(worst[1], at, seen[:, 0]))]
    steps = np.abs(np.diff(value[:, 0]))
    if common is not None and min(common[:2]) >= _FEWEST_COUNTED and np.median(steps[steps > 0]) > allowed:
        checks += _share_checks(topic, name, (time, value), (at, seen), common)
    return checks


def _share_checks(topic: str, name: str, ours: Tuple[Array, Array], theirs: Tuple[Array, Array],
                  common: Counts) -> List[Check]:
    """Return the check that a value changes from as many messages to the next, where it does not.

    Within the jitter of its stamp a value that goes to and fro has all of its values.
    """
    shares = []
    for (time, value), count in zip((ours, theirs), common[:2]):
        value = value[(time >= common.begin) & (time <= common.end), 0]
        shares.append(float((np.diff(value) != 0).sum()) / count)
    allowed = max(_SHARE_OFF * shares[0], _SHARE_SPREADS * math.sqrt(shares[0] / common.golden))
    if abs(shares[1] - shares[0]) <= allowed:
        return []
    return [equal(Aspect.CONTENTS, topic, name + " changes", False, "changes in %.0f %% of the messages, in %.0f %% in "
                  "the golden log" % (100.0 * shares[1], 100.0 * shares[0]), None, "%.0f %%" % (100.0 * shares[0]),
                  "%.0f %%" % (100.0 * shares[1]))]


def _farthest(time: Array, value: Array, at: Array, seen: Array, jitter_s: float) -> Tuple[float, float]:
    """Return the largest distance of some samples to a curve, and its time, s."""
    if len(time) < 2:
        time, value = np.repeat(time, 2), np.repeat(value, 2, axis=0)
    direct = np.abs(seen[:, 0] - np.interp(at, time, value[:, 0]))
    off = distances(time, value, at, seen, direct, np.full(len(at), jitter_s), 0.0)
    worst = int(np.argmax(off))
    return float(off[worst]), float(at[worst])


def _number_sequences(golden: Run, candidate: Run, topic: str, alignment: Alignment,
                      tolerances: Tolerances, has_begin: bool) -> List[Check]:
    """Check the numbers of a topic on change as sequences of values that are the same within their limits."""
    checks: List[Check] = []
    limits = replace(tolerances.states, brief_s=ms_to_s(tolerances.contents.brief_ms))
    fields = golden.fields.get(topic, {}), candidate.fields.get(topic, {})
    for name, ours in fields[0].items():
        theirs = fields[1].get(name)
        if not is_number_sequence(topic, name, tolerances) or theirs is None or len(ours.names) != len(theirs.names):
            continue  # what is in one log only is told by ``motion_watches``
        tracks = [_whole(track, name) for track in (ours, theirs)]
        allowed = number_limits(name, ours, tolerances, True).limits
        for column in range(len(ours.names)):
            limit = float(allowed[min(column, len(allowed) - 1)])
            keys, name_of = _levels(tracks[0].value[:, column], tracks[1].value[:, column], limit)
            some, others = (state_runs(replace(track, value=key[:, None]), 0, until) for track, key, until in zip(
                tracks, keys, (golden.duration, candidate.duration)))
            if has_begin:
                some, others = _with_begin(some, others, alignment.lag, limits.timing_s)
            runs = in_common(some, others, alignment.lag)
            part = name if len(ours.names) == 1 else "%s[%d]" % (name, column)
            checks += field_checks(Aspect.CONTENTS, topic, part, *runs, alignment.lag, limits, name_of)
    return checks


def is_number_sequence(topic: str, name: str, tolerances: Tolerances) -> bool:
    """Return whether a number of a topic on change is compared as a sequence."""
    base = base_of(name)
    return (not base.endswith(AGE) and base not in tolerances.fields.get(topic, ())
            and not tolerances.ignores_field(topic, name) and not tolerances.ignores_field(topic, base))


def _whole(track: LongTrack, name: str) -> Track:
    blocks = list(track.blocks())
    time = np.concatenate([np.zeros(0)] + [block.time for block in blocks])
    value = np.concatenate([np.zeros((0, len(track.names)))] + [block.value for block in blocks])
    if name.endswith(QUATERNION):
        value = np.where(value[:, 3:4] < 0, -value, value)
    return Track(track.topic, track.names, time, value)


def _levels(ours: Array, theirs: Array, limit: float) -> Tuple[Tuple[Array, Array], Callable[[int], str]]:
    """Return both sequences as numbers of levels: golden values within the limit of each other are one level.

    The candidate's values beyond the limit of every golden level are levels of their own.
    """
    finite = np.unique(ours[np.isfinite(ours)])
    levels: List[float] = []
    for value in finite.tolist():
        if not levels or value - levels[-1] > limit:
            levels.append(value)
    known = np.array(levels)
    own = np.unique(theirs[np.isfinite(theirs)])
    names: Dict[int, str] = {_NO_MESSAGE: _NO_MESSAGE_NAME}

    def keyed(values: Array) -> Array:
        keys = np.full(len(values), _NO_NUMBER, np.int64)
        for i, value in enumerate(values.tolist()):
            if not np.isfinite(value):
                keys[i] = _NO_NUMBER - int(np.isposinf(value)) - 2 * int(np.isneginf(value))
                names.setdefault(int(keys[i]), str(value))
                continue
            below = int(np.searchsorted(known, value, "right")) - 1
            if below >= 0 and value - known[below] <= limit:
                keys[i] = below
            elif below + 1 < len(known) and known[below + 1] - value <= limit:
                keys[i] = below + 1
            elif below >= 0 and value - known[below] <= 2.0 * limit:
                keys[i] = below
            else:
                keys[i] = _NEW_LEVEL + int(np.searchsorted(own, value))
            names.setdefault(int(keys[i]), "%.6g" % value)
        return keys

    return (keyed(ours), keyed(theirs)), lambda key: names.get(key, str(key))
