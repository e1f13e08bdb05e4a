"""The candidate's time for each time of the golden log: by the logs' own events, then by all joints together.

The lag that both logs have in common is a late start: no fault. Each motion then gets a lag and a pace of its own,
which are judged: a motion that begins late or runs slowly is a difference. Nothing is warped: positions are compared
at the golden pace.
"""
from dataclasses import dataclass, field
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from ...messages.batch import Array
from ..runs.run import Call, LongTrack, Run, TimeWindow, arm_of
from .course import Decision
from .motion_fit import COMMON_MOTIONS, Motions, sampled, search, search_common
from .sequences import Entry, pair

_LONGEST_S = 600.0
"""A longer motion is cut into parts of this length."""
_BATCH_S, _BATCH_MOTIONS = 600.0, 200
"""Length, s, and number of motions of the part of a log that is fitted at once."""
_SPLIT_S = 0.3
"""Least length, s, of a part: in a shorter one the fit has too few samples, so a call there begins no part."""
_STREAM_SERVICES = ("servo_j", "servo_p")
_VOTES_A_KEY = 60
"""Most events of a kind that vote: each of ours votes with each of theirs, so the work grows with the square."""
_BIN_S = 0.25
"""Width, s, of a bin of lags: above the jitter of like events; in a wider one different lags mix."""
_FEWEST_SAMPLES, _MOST_SAMPLES, _ALL_SAMPLES = 48, 300, 30000
"""Samples of each motion that is fitted, and of all motions together: the work grows with them."""
_MARGIN_S = 0.05
"""Time, s, of rest on both sides of a motion that is fitted with it: its begin and end are what a lag is seen by."""
_REACH_S = 0.6
"""Largest distance, s, of a motion's lag from the common one; farther off it would be fitted to another motion."""
_PACE_SPAN_S = 0.4
"""Shortest motion, s, whose pace is fitted: in a shorter one lag and pace look alike."""
_PACE_TRAVEL_RAD = 0.02
"""Least way, rad, of a motion whose pace is fitted: noise must be small beside it."""
_ALIKE_RAD = 0.005
"""Residual, rad, up to which two motions are the same: above noise, stamps and following errors together."""
_ALIKE_SHARE = 0.03
"""The same as a share of the way: a long motion on another path is off by more than a short one."""
_GOOD_FIT_RAD = 0.002
"""Residual, rad, of a fit beside which no better one is looked for; with less the search takes longer."""


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
        rms: RMS of the residuals with lag and pace, rad.
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


class _Knots(NamedTuple):
    """The begins and ends of an arm's motions in golden time, s, and the candidate's times of them, never decreasing.

    ``first_lag`` is the lag, s, of the first motion.
    """

    episodes: Tuple[Episode, ...]
    golden: Array
    candidate: Array
    first_lag: float


@dataclass(frozen=True)
class Alignment:
    """The mapping of golden times to candidate times.

    Attributes:
        lag: Lag of the whole candidate: candidate time - golden time, s.
        method: Method by which the lag was found.
        episodes: Motions by arm, in the order of time.
    """

    lag: float
    method: str
    episodes: Dict[str, Tuple[Episode, ...]] = field(default_factory=dict)
    _known: Dict[str, "_Knots"] = field(default_factory=dict, repr=False, compare=False)

    def golden_time(self, arm: str, candidate_time: Array) -> Array:
        """Return golden times of candidate times, s, never decreasing.

        A motion has its own lag at the golden pace; the rest between two motions is as long as it needs to be.
        """
        if not self.episodes.get(arm):
            plain: Array = candidate_time - self.lag
            return plain
        _, golden, knots, first_lag = self._knots(arm)
        result: Array = np.interp(candidate_time, knots, golden)
        before, after = candidate_time < knots[0], candidate_time > knots[-1]
        result[before] = candidate_time[before] - first_lag
        result[after] = golden[-1] + (candidate_time[after] - knots[-1])
        return result

    def candidate_time(self, arm: str, golden_time: float) -> float:
        """Return the candidate's time of a golden time, s."""
        if not self.episodes.get(arm):
            return golden_time + self.lag
        _, golden, knots, first_lag = self._knots(arm)
        if golden_time < golden[0]:
            return golden_time + first_lag
        return float(np.interp(golden_time, golden, knots)) + max(golden_time - float(golden[-1]), 0.0)

    def motion_numbers(self, arm: str, golden_time: Array) -> Array:
        """Return how many of an arm's motions have begun at golden times, s, int64, of the same shape."""
        if not self.episodes.get(arm):
            return np.zeros(golden_time.shape, np.int64)
        begun: Array = np.searchsorted(self._knots(arm).golden[::2], golden_time, "right")
        return begun

    def _knots(self, arm: str) -> "_Knots":
        """Return the knots of an arm, which has motions; they are made again when motions were added."""
        episodes = self.episodes[arm]
        known = self._known.get(arm)
        if known is None or known.episodes is not episodes:
            golden = np.array([time for episode in episodes for time in (episode.start, episode.end)])
            lags = np.repeat([episode.lag for episode in episodes], 2)
            known = self._known[arm] = _Knots(episodes, golden, np.maximum.accumulate(golden + lags), float(lags[0]))
        return known


Spans = Sequence[Tuple[float, float]]


def motions_by_calls(motions: Sequence[TimeWindow], calls: Sequence[Call]) -> List[TimeWindow]:
    """Split a golden arm's motions, (start, end) in s, where a further call begins one, and long ones."""
    starts = np.array([call.start for call in calls if call.short_name not in _STREAM_SERVICES])
    result: List[TimeWindow] = []
    inside = np.searchsorted(starts, np.array(motions).reshape(-1, 2) + (_SPLIT_S, -_SPLIT_S), "right").tolist()
    for (start_time, end_time), (first, last) in zip(motions, inside):
        cuts = [start_time]
        for cut in starts[first:last].tolist():
            if cut - cuts[-1] >= _SPLIT_S:
                cuts.append(cut)
        for begin, end in zip(cuts, cuts[1:] + [end_time]):
            edges = [begin, end] if end - begin < _LONGEST_S else np.linspace(
                begin, end, int((end - begin) // _LONGEST_S) + 2).tolist()
            result += zip(edges, edges[1:])
    return result


def _events(run: Run) -> Dict[object, List[float]]:
    """Return times of the log's own events by their meaning: calls with their requests, changes of state."""
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
    """Return the lag, s, that most pairs of like events agree on; None where the logs have no event in common."""
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


def motion_lag(golden: Sequence[LongTrack], candidate: Sequence[LongTrack]) -> Optional[float]:
    """Return the lag, s, at which the speeds of all joints of all arms agree best; None where nothing moves."""
    step = 0.05
    end = max(track.facts.last for track in list(golden) + list(candidate))
    grid = np.arange(0.0, end + step, step)
    size = 1 << int(np.ceil(np.log2(2 * len(grid))))
    total = np.zeros(size)
    for ours, theirs in zip(golden, candidate):
        here, there = ours.at(grid), theirs.at(grid)
        for column in range(here.shape[1]):
            a, b = np.gradient(here[:, column], step), np.gradient(there[:, column], step)
            total += np.fft.irfft(np.fft.rfft(b, size) * np.conj(np.fft.rfft(a, size)), size)
    if not total.max() > 1e-6:
        return None
    at = int(np.argmax(total))
    return step * (at if at < size // 2 else at - size)


def _call_lags(golden: Sequence[Call], candidate: Sequence[Call], lag: float) -> Tuple[Array, Array]:
    """Return golden times of the calls that both logs have, and the lag of each, s."""
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

    golden: LongTrack
    candidate: LongTrack
    spans: List[TimeWindow]
    calls: List[Call]


def calls_of(run: Run, arm: str, arms: List[str]) -> List[Call]:
    """Return the calls that one of several arms served."""
    return [call for call in run.calls if arm_of(call.service, arms) == arm]


def arms_of(golden: Run, candidate: Run) -> Dict[str, Arm]:
    """Return the arms that both logs can be aligned by, each with the first topic of joints that both have."""
    arms = golden.arms
    result: Dict[str, Arm] = {}
    for topic in sorted(golden.joints, key=lambda name: (not name.endswith("/joint_position"), name)):
        ours, theirs = golden.joints[topic], candidate.joints.get(topic)
        arm = arm_of(topic, arms)
        if arm in result or theirs is None or len(ours.names) != len(theirs.names):
            continue
        if min(ours.facts.finite_count, theirs.facts.finite_count) >= 3:
            calls = calls_of(golden, arm, arms)
            result[arm] = Arm(ours, theirs, motions_by_calls(ours.facts.motions, calls), calls)
    return result


class Aligner:
    """The search for the candidate's time of each golden motion, as far as it is asked for.

    Args:
        golden: The golden log.
        candidate: The candidate.
        arms: Arms that are in both.
        fit_ends: By arm, (start of a motion, time from which it is no longer fitted), s: motions cut off end where
            the stop found them, not where their target was.
        good_fit: Decides whether a fit's residual, rad, is too small to search further; None: at most 2 mrad.

    Attributes:
        alignment: The result so far; ``fit_until`` adds motions to it.
    """

    def __init__(self, golden: Run, candidate: Run, arms: Dict[str, Arm],
                 fit_ends: Optional[Dict[str, Spans]] = None, good_fit: Optional[Decision] = None) -> None:
        self._arms = arms
        self._good_fit = good_fit or Decision(_GOOD_FIT_RAD)
        self._edges: Dict[str, List[TimeWindow]] = {}
        self._around: Dict[str, Array] = {}
        self._waiting: Dict[str, List[slice]] = {}
        self._samples = 0
        coarse = event_lag(golden, candidate)
        method = "events"
        if coarse is None and arms:
            coarse = motion_lag([arm.golden for arm in arms.values()], [arm.candidate for arm in arms.values()])
            method = "speed of the joints"
        if coarse is None:
            self.alignment = Alignment(0.0, "first messages")
            return
        moving = sum(len(arm.spans) for arm in arms.values())
        if not moving:
            self.alignment = Alignment(coarse, method, dict.fromkeys(arms, ()))
            return
        self._samples = max(_FEWEST_SAMPLES, min(_MOST_SAMPLES, _ALL_SAMPLES // moving))
        ends = fit_ends or {}
        self._edges = {name: _fitted(arm.spans, dict(ends.get(name, ()))) for name, arm in arms.items() if arm.spans}
        lag = search_common([self._sampled(name, slice(None, None, 1 + len(edges) // COMMON_MOTIONS), coarse)
                             for name, edges in self._edges.items()], coarse, _REACH_S, self._good_fit)
        for name in self._edges:
            arm = arms[name]
            call_times, call_lags = _call_lags(arm.calls, calls_of(candidate, name, golden.arms), coarse)
            self._around[name] = _lags_near(arm.spans, call_times, call_lags, lag)
            self._waiting[name] = list(_batches(arm.spans))[::-1]
        self.alignment = Alignment(lag, method + ", then all joints", dict.fromkeys(arms, ()))

    def _sampled(self, name: str, which: slice, around: Union[float, Array]) -> Motions:
        arm, edges = self._arms[name], self._edges[name][which]
        return sampled(arm.golden, arm.candidate, edges, self._samples, np.broadcast_to(around, len(edges)), _REACH_S)

    def fit_until(self, candidate_time: float) -> None:
        """Fit all motions that it takes to know the golden times of candidate times up to this one, s."""
        for name, waiting in self._waiting.items():
            while waiting and self._known_until(name) <= candidate_time:
                which = waiting.pop()
                around = self._around[name][which]
                self.alignment.episodes[name] += _episodes(name, self._arms[name].spans[which],
                                                           self._sampled(name, which, around), around, self._good_fit)

    def _known_until(self, name: str) -> float:
        return max((episode.end + episode.lag for episode in self.alignment.episodes[name][-_BATCH_MOTIONS:]),
                   default=-np.inf)


def align(golden: Run, candidate: Run, arms: Dict[str, Arm], fit_ends: Optional[Dict[str, Spans]] = None) -> Alignment:
    """Align two logs, all of them; see ``Aligner``."""
    aligner = Aligner(golden, candidate, arms, fit_ends)
    aligner.fit_until(np.inf)
    return aligner.alignment


def _fitted(spans: Spans, ends: Dict[float, float]) -> List[TimeWindow]:
    """Return the part of each motion that is fitted, golden times in s."""
    return [(start - _MARGIN_S, max(min(end + _MARGIN_S, ends.get(start, end)), start + 0.1)) for start, end in spans]


def _batches(spans: Spans) -> Iterator[slice]:
    """Yield slices of motions that are fitted at once."""
    first = 0
    for number in range(1, len(spans) + 1):
        if number == len(spans) or number - first >= _BATCH_MOTIONS or spans[number][1] - spans[first][0] > _BATCH_S:
            yield slice(first, number)
            first = number


def _lags_near(spans: Spans, call_times: Array, call_lags: Array, lag: float) -> Array:
    """Return the lags of the last calls before motions began, where they are about these; else the common lag."""
    starts = np.array([start for start, _ in spans])
    before = np.searchsorted(call_times, starts + 0.02)
    times, lags = np.append(-np.inf, call_times), np.append(lag, call_lags)
    return np.where(starts - times[before] < 1.0, lags[before], lag)


def _episodes(arm: str, spans: Spans, motions: Motions, around: Array,
              good_fit: Decision) -> Tuple[Episode, ...]:
    length = motions.times[:, -1] - motions.times[:, 0]
    travel = (motions.values.max(axis=1) - motions.values.min(axis=1)).max(axis=1)
    with_pace = (length >= _PACE_SPAN_S) & (travel >= _PACE_TRAVEL_RAD)
    plain = search(motions, around, np.zeros(len(around), bool), _REACH_S, good_fit)
    paced = search(motions, plain.lag, with_pace, _REACH_S, good_fit)
    is_alike = paced.rms <= np.maximum(_ALIKE_RAD, _ALIKE_SHARE * travel)
    return tuple(Episode(arm, spans[i][0], spans[i][1], float(plain.lag[i] if is_alike[i] else around[i]),
                         float(paced.pace[i]) if with_pace[i] and is_alike[i] else None, float(length[i]),
                         float(paced.rms[i]), bool(is_alike[i])) for i in range(len(spans)))
