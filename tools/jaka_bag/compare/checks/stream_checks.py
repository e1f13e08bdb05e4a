"""The checks of every topic, whatever it carries: type, count, rate, jitter, gaps, lost messages, stamps."""
import bisect
import itertools
import math
from typing import Dict, FrozenSet, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ...messages.batch import Array
from ...operations.quantiles import Quantiles
from ...units import s_to_ms
from ..matching.alignment import Alignment
from ..runs.run import Arrivals, Run, Stream
from ..tolerances import StreamTolerance, Tolerances
from ..verdict import Aspect, Check, equal, judged, not_compared
from .timing_checks import LATCHED_S

_FEWEST = 2
"""Fewest messages of a topic that has a rate: one has no interval."""
_LAST = np.array([-1])
_RESTARTS = 0.05
"""Steps back of header.seq, as a share of the messages, beyond which they are not all restarts."""
_OTHER_GAP_S = 10.0
"""Distance, s, of a gap from which on it is another one: jitter and lag between two runs are far less."""
_SLOW_HZ = 20.0
"""Rate, Hz, below which a topic may also be published at once when something changes, so its jitter may be a period
more."""
_ROUNDING_S = 1e-6
"""Rounding, s, of times as floats."""
_AHEAD_S = 1.0
"""Stamps farther ahead of the golden ones than this, s, are those of a clock that jumped."""


class StreamWatch:
    """Statistics of one topic's messages, taken in by windows in the order of recording.

    Args:
        stream: The topic.
        begin: First log time, s, of the span that both logs cover.
        end: Last log time, s, of that span.
        gap_s: A silence longer than this is a gap.
    """

    def __init__(self, stream: Stream, begin: float, end: float, gap_s: float) -> None:
        self.stream = stream
        self._begin, self._end, self._gap_s = begin, end, gap_s
        self._last_common: Optional[Arrivals] = None
        self._last_sequence: Optional[int] = None
        self._is_counted = False
        self._lost = self._back = 0
        self._first = 0.0
        self.count = 0
        self.intervals = Quantiles()
        self.gaps: List[Tuple[float, float]] = []
        self.near_gaps: List[Tuple[float, float]] = []
        self.latency = Quantiles()
        self.latest: Tuple[float, float] = (-np.inf, 0.0)
        self.soonest: Tuple[float, float] = (np.inf, 0.0)
        self.repeated = self.backwards = 0
        self.farthest_back: Tuple[float, float] = (0.0, 0.0)

    def take(self, begin: float, end: float) -> None:
        """Read the messages of a window, which follows the one before."""
        arrivals = self.stream.between(begin, end)
        if not len(arrivals.log_time):
            return
        if arrivals.sequence is not None:
            self._count_lost(arrivals.sequence)
        part = slice(int(np.searchsorted(arrivals.log_time, self._begin - _ROUNDING_S)),
                     int(np.searchsorted(arrivals.log_time, self._end + _ROUNDING_S, "right")))
        common = arrivals.some(part)
        if len(common.log_time):
            self._take_common(common)
            self._last_common = common.some(_LAST)

    def _count_lost(self, sequence: Array) -> None:
        steps = np.diff(sequence) if self._last_sequence is None else np.diff(sequence, prepend=self._last_sequence)
        self._is_counted = self._is_counted or bool(steps.any())
        self._lost += int((steps[steps > 1] - 1).sum())
        self._back += int((steps < 0).sum())
        self._last_sequence = int(sequence[-1])

    def _take_common(self, common: Arrivals) -> None:
        if not self.count:
            self._first = float(common.log_time[0])
        self.count += len(common.log_time)
        before = self._last_common
        time = common.log_time if before is None else np.append(before.log_time, common.log_time)
        steps = np.diff(time)
        self.intervals.add(steps[steps <= self._gap_s])
        for longest, gaps in ((self._gap_s, self.gaps), (0.5 * self._gap_s, self.near_gaps)):
            gaps += [(float(time[i]), float(steps[i])) for i in np.flatnonzero(steps > longest).tolist()]
        if common.stamp is None:
            return
        latency = common.log_time - common.stamp
        self.latency.add(latency)
        worst = int(np.argmax(latency))
        if latency[worst] > self.latest[0]:
            self.latest = (float(latency[worst]), float(common.log_time[worst]))
        if common.log_time[0] <= LATCHED_S:  # how old a latched message is tells when its publisher was started
            latency = np.where((common.log_time <= LATCHED_S) & (latency > 0.0), np.inf, latency)
        best = int(np.argmin(latency))
        if latency[best] < self.soonest[0]:
            self.soonest = (float(latency[best]), float(common.log_time[best]))
        stamp = common.stamp if before is None or before.stamp is None else np.append(before.stamp, common.stamp)
        steps = np.diff(stamp)
        self.repeated += int((steps == 0).sum())
        self.backwards += int((steps < 0).sum())
        if len(steps) and steps.min() < self.farthest_back[0]:
            at = int(np.argmin(steps))
            self.farthest_back = (float(steps[at]), float(time[at + 1]))

    def finish(self) -> None:
        """Add the silences at both ends of the span; call it once, after the last message."""
        if self._last_common is None:
            return
        last = float(self._last_common.log_time[0])
        for longest, gaps in ((self._gap_s, self.gaps), (0.5 * self._gap_s, self.near_gaps)):
            if self._first - self._begin > longest:
                gaps.insert(0, (self._begin, self._first - self._begin))
            if self._end - last > longest:
                gaps.append((last, self._end - last))

    @property
    def lost(self) -> Optional[int]:
        """The number of messages that header.seq skips; None where it does not count.

        Steps back are restarts of the publisher and lose nothing.
        """
        return self._lost if self._is_counted else None

    @property
    def has_several(self) -> bool:
        """The messages of several publishers: header.seq goes back often."""
        return self._back > _RESTARTS * len(self.stream)


def type_checks(golden: Run, candidate: Run, tolerances: Tolerances) -> List[Check]:
    """Check that each topic is in both logs, with the same type."""
    checks = []
    for topic in sorted(set(golden.streams) | set(candidate.streams)):
        ours, theirs = golden.streams.get(topic), candidate.streams.get(topic)
        if ours is None or theirs is None:
            where = "only in the candidate" if ours is None else "not in the candidate"
            if tolerances.is_optional(topic):
                checks.append(not_compared(Aspect.TYPES, topic, "", where + "; optional"))
            else:
                checks.append(equal(Aspect.TYPES, topic, "", False, where, golden=_types(ours),
                                    candidate=_types(theirs)))
            continue
        same = ours.types == theirs.types and len(ours.types) == 1
        checks.append(equal(Aspect.TYPES, topic, "", same, _types(ours) if same else "different types",
                            golden=_types(ours), candidate=_types(theirs)))
    return checks


def _types(stream: Optional[Stream]) -> str:
    return "none" if stream is None else ", ".join("%s (md5 %s)" % kind for kind in stream.types)


class _Common(NamedTuple):
    """One topic in both logs: golden and candidate."""

    golden: StreamWatch
    candidate: StreamWatch


def common_time(golden: Run, candidate: Run, alignment: Alignment) -> Tuple[float, float]:
    """Return the golden times between which both logs have messages, s."""
    return max(0.0, -alignment.lag), min(golden.duration, candidate.duration - alignment.lag)


def stream_watches(golden: Run, candidate: Run, alignment: Alignment, tolerances: Tolerances,
                   topics: Sequence[str], time_scale: float) -> Tuple[Dict[str, StreamWatch], Dict[str, StreamWatch]]:
    """Return the watches that take in the messages of the golden log and of the candidate, by topic.

    Topics that are published by the host's clock come as much more rarely as the candidate ran faster.
    """
    begin, end = common_time(golden, candidate, alignment)
    gap_s = tolerances.streams.gap_s * max(time_scale, 1.0)
    return ({topic: StreamWatch(golden.streams[topic], begin, end, gap_s) for topic in topics},
            {topic: StreamWatch(candidate.streams[topic], begin + alignment.lag, end + alignment.lag, gap_s)
             for topic in topics})


def stream_checks(golden: Dict[str, StreamWatch], candidate: Dict[str, StreamWatch], alignment: Alignment,
                  tolerances: Tolerances, time_scale: float, on_change: Mapping[str, int],
                  own: FrozenSet[str]) -> List[Check]:
    """Check rates, jitter, gaps, lost messages and stamps of topics that both logs have, after all messages.

    Topics in ``on_change``, with the number of messages by which each may differ, have no rate: their order and
    contents are compared elsewhere, but for those in ``own``, whose messages are counted.
    """
    limits = tolerances.streams
    checks: List[Check] = []
    for topic, ours in golden.items():
        both = _Common(ours, candidate[topic])
        if topic in on_change:
            if topic in own:
                checks.append(_count_check(both, limits, on_change[topic]))
            if both.golden.stream.is_stamped and both.candidate.stream.is_stamped:
                checks += _order_checks(both, alignment.lag)
            continue
        for watch in both:
            watch.finish()
        if min(both.golden.count, both.candidate.count) < _FEWEST:
            checks.append(equal(Aspect.COUNTS, topic, "", False, "hardly any message while the other log runs",
                                golden="%d messages" % both.golden.count,
                                candidate="%d messages" % both.candidate.count))
            continue
        if time_scale != 1.0:
            checks.append(not_compared(Aspect.RATES, topic, "", "rates do not scale: the candidate ran %g times faster"
                                       % time_scale))
            checks.append(_gap_check(both, limits, alignment.lag, limits.gap_s * max(time_scale, 1.0)))
            continue
        checks += _rate_checks(both, limits, alignment.lag)
        checks += _lost_checks(both, limits)
        checks += _stamp_checks(both, limits, alignment.lag)
    return checks


def _count_check(both: _Common, limits: StreamTolerance, slack: int) -> Check:
    ours, theirs = len(both.golden.stream), len(both.candidate.stream)
    off = 100.0 * max(abs(theirs - ours) - slack, 0) / max(ours, 1)
    return judged(Aspect.COUNTS, both.golden.stream.topic, "", off, limits.count_percent, "%",
                  "%d messages, %d in the golden log" % (theirs, ours), golden=str(ours), candidate=str(theirs))


def _rate_and_jitter(intervals: Quantiles) -> Tuple[float, float]:
    """Return the mean rate, Hz, and the 99th percentile of |interval - mean|, s."""
    if not intervals.total > 0:
        return 0.0, 0.0
    mean = intervals.total / intervals.count
    return 1.0 / mean, intervals.distance(mean, 0.99)


def _rate_checks(both: _Common, limits: StreamTolerance, lag: float) -> List[Check]:
    topic = both.golden.stream.topic
    rate_g, jitter_g = _rate_and_jitter(both.golden.intervals)
    rate_c, jitter_c = _rate_and_jitter(both.candidate.intervals)
    # a slow topic is also published at once when something changes: the interval before that has any length
    allowed = limits.jitter_ms + (s_to_ms(1.0 / rate_g) if 0.0 < rate_g < _SLOW_HZ else 0.0)
    off = 100.0 * abs(rate_c - rate_g) / max(rate_g, 1e-9)
    checks = [
        judged(Aspect.RATES, topic, "", off, limits.rate_percent, "%", "%.2f Hz, %.2f Hz in the golden log"
               % (rate_c, rate_g), golden="%.2f Hz" % rate_g, candidate="%.2f Hz" % rate_c),
        judged(Aspect.JITTER, topic, "", s_to_ms(max(jitter_c - jitter_g, 0.0)), allowed, "ms",
               "99 %% of the intervals are within %.1f ms of their mean, %.1f ms in the golden log"
               % (s_to_ms(jitter_c), s_to_ms(jitter_g)),
               golden="%.1f ms" % s_to_ms(jitter_g), candidate="%.1f ms" % s_to_ms(jitter_c))]
    return checks + [_gap_check(both, limits, lag, limits.gap_s)]


def _gap_check(both: _Common, limits: StreamTolerance, lag: float, gap_s: float) -> Check:
    """Check that both logs have the same silences longer than ``gap_s``."""
    topic = both.golden.stream.topic
    # a gap just below the limit in one log and just above in the other is the same gap
    gaps_g, gaps_c = (watch.gaps for watch in both)
    near_g, near_c = (watch.near_gaps for watch in both)
    gaps = [(_gap_off(near_c, start + lag, length), start, length, "the candidate has no such gap")
            for start, length in gaps_g]
    gaps += [(_gap_off(near_g, start - lag, length), start - lag, length, "the golden log has no such gap")
             for start, length in gaps_c]
    worst = max((gap[0] for gap in gaps), default=0.0)
    unmatched = [gap for gap in gaps if gap[0] > limits.gap_length_s]
    if unmatched:
        _, at, length, words = max(unmatched, key=lambda gap: gap[2])
        detail, golden, candidate = ("silent for %.2f s: %s" % (length, words), "%d gaps" % len(gaps_g),
                                     "%d gaps" % len(gaps_c))
        if math.isinf(worst):
            return equal(Aspect.GAPS, topic, "", False, detail, at, golden, candidate)
        return judged(Aspect.GAPS, topic, "", worst, limits.gap_length_s, "s", detail, at, golden, candidate)
    return judged(Aspect.GAPS, topic, "", worst, limits.gap_length_s, "s",
                  "%d gaps longer than %g s" % (len(gaps_c), gap_s))


def _gap_off(gaps: Sequence[Tuple[float, float]], start: float, length: float) -> float:
    """Return the deviation, s, of a gap from the nearest of ``gaps``: the larger of those in begin and in length.

    Infinite where there is none within ten seconds.
    """
    middle = bisect.bisect_left(gaps, (start, -np.inf))
    nearest = _OTHER_GAP_S
    for some in (itertools.islice(gaps, middle, None), (gaps[i] for i in range(middle - 1, -1, -1))):
        for other, size in some:
            if abs(other - start) >= nearest:
                break
            nearest = min(nearest, max(abs(other - start), abs(size - length)))
    return nearest if nearest < _OTHER_GAP_S else math.inf


def _lost_checks(both: _Common, limits: StreamTolerance) -> List[Check]:
    if both.golden.has_several and both.candidate.has_several:
        return [not_compared(Aspect.LOST, both.golden.stream.topic, "", "header.seq is of several publishers")]
    if both.golden.lost is None or both.candidate.lost is None:
        return []
    share_g, share_c = (100.0 * (watch.lost or 0) / len(watch.stream) for watch in both)
    return [judged(Aspect.LOST, both.golden.stream.topic, "", max(share_c - share_g, 0.0), limits.lost_percent, "%",
                   "header.seq shows %d of %d messages missing" % (both.candidate.lost, len(both.candidate.stream)),
                   golden="%d" % both.golden.lost, candidate="%d" % both.candidate.lost)]


def _stamp_checks(both: _Common, limits: StreamTolerance, lag: float) -> List[Check]:
    topic = both.golden.stream.topic
    if not (both.golden.stream.is_stamped or both.candidate.stream.is_stamped):
        return []
    if not (both.golden.stream.is_stamped and both.candidate.stream.is_stamped):
        which = "candidate's" if both.golden.stream.is_stamped else "golden log's"
        return [equal(Aspect.STAMPS, topic, "header.stamp", False, "the %s messages are not stamped" % which)]
    median_g, median_c = (watch.latency.median() for watch in both)
    checks = [judged(Aspect.STAMPS, topic, "latency", s_to_ms(abs(median_c - median_g)), limits.latency_ms, "ms",
                     "median of log time - header.stamp is %.1f ms, %.1f ms in the golden log"
                     % (s_to_ms(median_c), s_to_ms(median_g)), both.candidate.latest[1] - lag,
                     "%.1f ms" % s_to_ms(median_g), "%.1f ms" % s_to_ms(median_c))]
    repeated_g, repeated_c = (100.0 * (watch.repeated / (watch.count - 1)) for watch in both)
    checks.append(judged(Aspect.STAMPS, topic, "repeated", max(repeated_c - repeated_g, 0.0), limits.repeated_percent,
                         "%", "%.1f %% of the messages repeat the stamp before, %.1f %% in the golden log"
                         % (repeated_c, repeated_g), golden="%.1f %%" % repeated_g, candidate="%.1f %%" % repeated_c))
    return checks + _order_checks(both, lag)


def _order_checks(both: _Common, lag: float) -> List[Check]:
    topic = both.golden.stream.topic
    backwards_g, backwards_c = (watch.backwards for watch in both)
    at = both.candidate.farthest_back[1] - lag if backwards_c else None
    checks = [equal(Aspect.STAMPS, topic, "order", backwards_c <= backwards_g,
                    "%d stamps are older than the one before" % backwards_c, at, str(backwards_g), str(backwards_c))]
    ahead_g, ahead_c = (-watch.soonest[0] for watch in both)
    if _AHEAD_S < abs(ahead_c - ahead_g) < math.inf:  # infinite, or no number, where one had no message that counts
        checks.append(equal(Aspect.STAMPS, topic, "ahead", False,
                            "stamps are up to %.1f s ahead of their recording, %.1f s in the golden log"
                            % (ahead_c, ahead_g), both.candidate.soonest[1] - lag))
    return checks
