"""Finds the candidate's time for each time of the golden log: by the logs' own events, then by all joints together.

The lag that both logs have in common is a late start: no fault. Each motion then gets a lag and a pace of its own,
which are judged: a motion that begins late or runs slowly is a difference. Nothing is warped: positions are compared
at the golden pace.
"""
from dataclasses import dataclass, field
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..messages.batch import Array
from .motion_fit import Curve, Motions, sampled, search, search_common
from .run import Call, Run, Track, arm_of
from .sequences import Entry, pair

MOVING_RAD_S = 0.005
"""A joint faster than this moves, rad/s."""
_MERGE_S = 0.1
_LEAST_TRAVEL_RAD = 0.003
_SPLIT_S = 0.3
_STREAM_SERVICES = ("servo_j", "servo_p")
_VOTES_A_KEY = 60
_BIN_S = 0.25
_FEWEST_SAMPLES, _MOST_SAMPLES, _ALL_SAMPLES = 48, 300, 30000
_MARGIN_S = 0.05
_REACH_S = 0.6
_PACE_SPAN_S = 0.4
_PACE_TRAVEL_RAD = 0.02
_ALIKE_RAD = 0.005
_ALIKE_SHARE = 0.03


@dataclass(frozen=True)
class Episode:
    """One motion of the golden log, from rest to rest or from call to call.

    Attributes:
        arm: Namespace of the arm.
        start: Golden time, s.
        end: Golden time, s.
        lag: Candidate time - golden time, s.
        pace: Candidate duration / golden duration; None where the motion is too short to tell.
        span: Golden duration that the pace was measured on, s.
        rms: What remains with both, rad.
        is_alike: The candidate makes this motion too, be it late or slow; else lag is that of the last call.
    """

    arm: str
    start: float
    end: float
    lag: float
    pace: Optional[float]
    span: float
    rms: float
    is_alike: bool


@dataclass(frozen=True)
class Alignment:
    """Golden times to candidate times.

    Attributes:
        lag: What both logs have in common: candidate time - golden time, s.
        method: What it was found by.
        episodes: By arm, in the order of time.
    """

    lag: float
    method: str
    episodes: Dict[str, Tuple[Episode, ...]] = field(default_factory=dict)

    def golden_time(self, arm: str, candidate_time: Array) -> Array:
        """Golden times of candidate times, s, never stepping back.

        A motion has its own lag at the golden pace; the rest between two motions is as long as it needs to be.
        """
        episodes = self.episodes.get(arm, ())
        if not episodes:
            plain: Array = candidate_time - self.lag
            return plain
        golden = np.array([time for episode in episodes for time in (episode.start, episode.end)])
        lags = np.repeat([episode.lag for episode in episodes], 2)
        knots = np.maximum.accumulate(golden + lags)
        result: Array = np.interp(candidate_time, knots, golden)
        before, after = candidate_time < knots[0], candidate_time > knots[-1]
        result[before] = candidate_time[before] - lags[0]
        result[after] = golden[-1] + (candidate_time[after] - knots[-1])
        return result


Spans = Sequence[Tuple[float, float]]


def moving_spans(curve: Curve, calls: Sequence[Call]) -> List[Tuple[float, float]]:
    """The motions of a golden arm, (start, end) in s: from rest to rest, and cut where a further call begins one."""
    if len(curve.time) < 3:
        return []
    moving = np.abs(curve.speed).max(axis=1) > MOVING_RAD_S
    edges = np.flatnonzero(np.diff(moving, prepend=False, append=False))
    begins, ends = curve.time[edges[::2]], curve.time[edges[1::2] - 1]
    apart = begins[1:] - ends[:-1] >= _MERGE_S
    begins, ends = np.append(begins[:1], begins[1:][apart]), np.append(ends[:-1][apart], ends[-1:])
    starts = np.array([call.start for call in calls if call.short_name not in _STREAM_SERVICES])
    result: List[Tuple[float, float]] = []
    for start_time, end_time in zip(begins.tolist(), ends.tolist()):
        inside = curve.value[np.searchsorted(curve.time, start_time):np.searchsorted(curve.time, end_time, "right")]
        if float((inside.max(axis=0) - inside.min(axis=0)).max()) < _LEAST_TRAVEL_RAD:
            continue
        cuts = [start_time]
        for cut in starts[(starts > start_time + _SPLIT_S) & (starts < end_time - _SPLIT_S)].tolist():
            if cut - cuts[-1] >= _SPLIT_S:
                cuts.append(cut)
        result += list(zip(cuts, cuts[1:] + [end_time]))
    return result


def _events(run: Run) -> Dict[object, List[float]]:
    """Times of the log's own events by what they are: calls with their requests, changes of state."""
    events: Dict[object, List[float]] = {}
    for call in run.calls:
        events.setdefault((call.service, call.request), []).append(call.start)
    for topic, track in run.states.items():
        for column, name in enumerate(track.names):
            value = track.value[:, column]
            for i in (np.flatnonzero(value[1:] != value[:-1]) + 1).tolist():
                events.setdefault((topic, name, int(value[i])), []).append(float(track.time[i]))
    return events


def event_lag(golden: Run, candidate: Run) -> Optional[float]:
    """The lag that most pairs of like events agree on, s; None where the logs have no event in common."""
    ours, theirs = _events(golden), _events(candidate)
    votes: List[Array] = []
    for key in ours:
        if key in theirs:
            a, b = np.array(ours[key][:_VOTES_A_KEY]), np.array(theirs[key][:_VOTES_A_KEY])
            votes.append((b[None, :] - a[:, None]).ravel())
    if not votes:
        return None
    lags = np.concatenate(votes)
    bins = np.floor((lags - lags.min()) / _BIN_S).astype(int)
    number, counts = np.unique(bins, return_counts=True)
    lookup = dict(zip(number.tolist(), counts.tolist()))
    sums = np.array([lookup.get(n - 1, 0) + lookup.get(n, 0) + lookup.get(n + 1, 0) for n in number.tolist()])
    centres = lags.min() + (number + 0.5) * _BIN_S
    first = min(min(t) for k, t in theirs.items() if k in ours) - min(min(t) for k, t in ours.items() if k in theirs)
    best = np.flatnonzero(sums == sums.max())
    centre = float(centres[best[int(np.argmin(np.abs(centres[best] - first)))]])
    return float(np.median(lags[np.abs(lags - centre) <= 1.5 * _BIN_S]))


def motion_lag(golden: Sequence[Track], candidate: Sequence[Track]) -> Optional[float]:
    """The lag at which the speeds of all joints of all arms agree best, s; None where nothing moves."""
    step = 0.05
    end = max(float(track.time[-1]) for track in list(golden) + list(candidate))
    grid = np.arange(0.0, end + step, step)
    size = 1 << int(np.ceil(np.log2(2 * len(grid))))
    total = np.zeros(size)
    for ours, theirs in zip(golden, candidate):
        for column in range(ours.value.shape[1]):
            a = np.gradient(np.interp(grid, ours.time, ours.value[:, column]), step)
            b = np.gradient(np.interp(grid, theirs.time, theirs.value[:, column]), step)
            total += np.fft.irfft(np.fft.rfft(b, size) * np.conj(np.fft.rfft(a, size)), size)
    if not total.max() > 1e-6:
        return None
    at = int(np.argmax(total))
    return step * (at if at < size // 2 else at - size)


def _call_lags(golden: Sequence[Call], candidate: Sequence[Call], lag: float) -> Tuple[Array, Array]:
    """Golden times of the calls that both logs have, and the lag of each, s."""
    times: List[float] = []
    lags: List[float] = []
    services = {call.service for call in golden if call.short_name not in _STREAM_SERVICES}
    for service in services:
        ours = [call for call in golden if call.service == service]
        theirs = [call for call in candidate if call.service == service]
        for i, j in pair([Entry(c.request, c.start) for c in ours], [Entry(c.request, c.start) for c in theirs], lag):
            if i is not None and j is not None:
                times.append(ours[i].start)
                lags.append(theirs[j].start - ours[i].start)
    order = np.argsort(times)
    return np.array(times)[order], np.array(lags)[order]


class Arm(NamedTuple):
    """One arm in both logs; its joints, and its motions and calls in the golden log."""

    golden: Track
    candidate: Track
    curves: Tuple[Curve, Curve]
    spans: List[Tuple[float, float]]
    calls: List[Call]


def calls_of(run: Run, arm: str, arms: List[str]) -> List[Call]:
    """The calls that one of several arms served."""
    return [call for call in run.calls if arm_of(call.service, arms) == arm]


def arms_of(golden: Run, candidate: Run) -> Dict[str, Arm]:
    """The arms that both logs can be aligned by; of each the first topic of joints that both have."""
    arms = golden.arms
    result: Dict[str, Arm] = {}
    for topic in sorted(golden.joints, key=lambda name: (not name.endswith("/joint_position"), name)):
        ours, theirs = golden.joints[topic], candidate.joints.get(topic)
        arm = arm_of(topic, arms)
        if arm in result or theirs is None or ours.value.shape[1] != theirs.value.shape[1]:
            continue
        curves = Curve(ours), Curve(theirs)
        if min(len(curve.time) for curve in curves) >= 3:
            calls = calls_of(golden, arm, arms)
            result[arm] = Arm(ours, theirs, curves, moving_spans(curves[0], calls), calls)
    return result


def align(golden: Run, candidate: Run, arms: Dict[str, Arm], fit_ends: Optional[Dict[str, Spans]] = None,
          good_rms: float = 0.002) -> Alignment:
    """Align two logs.

    Args:
        golden: The golden log.
        candidate: The candidate.
        arms: Of both.
        fit_ends: By arm, (start of a motion, time from which it is no longer fitted), s: motions cut off end where
            the stop found them, not where their target was.
        good_rms: A fit that leaves no more, rad, is not searched further.
    """
    coarse = event_lag(golden, candidate)
    method = "events"
    if coarse is None and arms:
        coarse = motion_lag([arm.golden for arm in arms.values()], [arm.candidate for arm in arms.values()])
        method = "speed of the joints"
    if coarse is None:
        return Alignment(0.0, "first messages")
    moving = sum(len(arm.spans) for arm in arms.values())
    if not moving:
        return Alignment(coarse, method, dict.fromkeys(arms, ()))
    samples = max(_FEWEST_SAMPLES, min(_MOST_SAMPLES, _ALL_SAMPLES // moving))
    motions = {}
    for name, arm in arms.items():
        if arm.spans:
            ends = dict((fit_ends or {}).get(name, ()))
            edges = [(start - _MARGIN_S, max(min(end + _MARGIN_S, ends.get(start, end)), start + 0.1))
                     for start, end in arm.spans]
            motions[name] = sampled(*arm.curves, edges, samples)
    lag = search_common(list(motions.values()), coarse, _REACH_S, good_rms)
    episodes: Dict[str, Tuple[Episode, ...]] = dict.fromkeys(arms, ())
    for name, some in motions.items():
        arm = arms[name]
        call_times, call_lags = _call_lags(arm.calls, calls_of(candidate, name, golden.arms), coarse)
        around = np.array([_lag_near(span, call_times, call_lags, lag) for span in arm.spans])
        episodes[name] = _episodes(name, arm.spans, some, around, good_rms)
    return Alignment(lag, method + ", then all joints", episodes)


def _lag_near(span: Tuple[float, float], call_times: Array, call_lags: Array, lag: float) -> float:
    """The lag of the last call before a motion began, where it is about this motion; else the common one."""
    before = int(np.searchsorted(call_times, span[0] + 0.02)) - 1
    if before >= 0 and span[0] - call_times[before] < 1.0:
        return float(call_lags[before])
    return lag


def _episodes(arm: str, spans: Spans, motions: Motions, around: Array,
              good_rms: float) -> Tuple[Episode, ...]:
    length = motions.times[:, -1] - motions.times[:, 0]
    travel = (motions.values.max(axis=1) - motions.values.min(axis=1)).max(axis=1)
    with_pace = (length >= _PACE_SPAN_S) & (travel >= _PACE_TRAVEL_RAD)
    plain = search(motions, around, np.zeros(len(around), bool), _REACH_S, good_rms)
    paced = search(motions, plain.lag, with_pace, _REACH_S, good_rms)
    is_alike = paced.rms <= np.maximum(_ALIKE_RAD, _ALIKE_SHARE * travel)
    return tuple(Episode(arm, spans[i][0], spans[i][1], float(plain.lag[i] if is_alike[i] else around[i]),
                         float(paced.pace[i]) if with_pace[i] and is_alike[i] else None, float(length[i]),
                         float(paced.rms[i]), bool(is_alike[i])) for i in range(len(spans)))
