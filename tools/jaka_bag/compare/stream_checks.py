"""What must hold of every topic, whatever it carries: type, count, rate, jitter, gaps, lost messages, stamps."""
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..messages.batch import Array
from ..units import s_to_ms
from .alignment import Alignment
from .run import Run, Stream
from .tolerances import StreamTolerance, Tolerances
from .verdict import Aspect, Check, equal, judged, not_compared

_PERIODIC_COUNT = 10
_PERIODIC_S = 2.0


def is_periodic(stream: Stream) -> bool:
    """True where a topic is published again and again, so that it has a rate."""
    return len(stream) >= _PERIODIC_COUNT and float(np.median(np.diff(stream.log_time))) < _PERIODIC_S


def type_checks(golden: Run, candidate: Run, tolerances: Tolerances) -> List[Check]:
    """Each topic is in both logs, with the same type."""
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
    """Messages of one topic in the time that both logs cover: golden and candidate."""

    golden: Stream
    candidate: Stream


def _cut(stream: Stream, begin: float, end: float) -> Stream:
    first, last = np.searchsorted(stream.log_time, (begin, end))
    part = slice(int(first), int(last))
    return Stream(stream.topic, stream.types, stream.log_time[part],
                  None if stream.stamp is None else stream.stamp[part], stream.lost)


def common_time(golden: Run, candidate: Run, alignment: Alignment) -> Tuple[float, float]:
    """Golden times between which both logs have messages, s."""
    return max(0.0, -alignment.lag), min(golden.duration, candidate.duration - alignment.lag)


def stream_checks(golden: Run, candidate: Run, alignment: Alignment, tolerances: Tolerances,
                  topics: Sequence[str], time_scale: float) -> List[Check]:
    """Counts, rates, jitter, gaps, lost messages and stamps of topics that both logs have."""
    begin, end = common_time(golden, candidate, alignment)
    limits = tolerances.streams
    checks: List[Check] = []
    for topic in topics:
        whole = _Common(golden.streams[topic], candidate.streams[topic])
        if not is_periodic(whole.golden):
            checks.append(_count_check(whole, limits))
            continue
        if time_scale != 1.0:
            checks.append(not_compared(Aspect.RATES, topic, "", "rates do not scale: the candidate ran %g times faster"
                                       % time_scale))
            continue
        common = _Common(_cut(whole.golden, begin, end),
                         _cut(whole.candidate, begin + alignment.lag, end + alignment.lag))
        if min(len(common.golden), len(common.candidate)) < _PERIODIC_COUNT:
            checks.append(equal(Aspect.COUNTS, topic, "", False, "hardly any message while the other log runs",
                                golden="%d messages" % len(common.golden),
                                candidate="%d messages" % len(common.candidate)))
            continue
        checks += _rate_checks(common, limits, alignment.lag)
        checks += _lost_checks(whole, limits)
        checks += _stamp_checks(common, limits, alignment.lag)
    return checks


def _count_check(both: _Common, limits: StreamTolerance) -> Check:
    ours, theirs = len(both.golden), len(both.candidate)
    off = 100.0 * abs(theirs - ours) / max(ours, 1)
    return judged(Aspect.COUNTS, both.golden.topic, "", off, limits.count_percent, "%",
                  "%d messages, %d in the golden log" % (theirs, ours), golden=str(ours), candidate=str(theirs))


def _gaps(time: Array, longest: float) -> List[Tuple[float, float]]:
    """Silences, (start, length) in s."""
    steps = np.diff(time)
    return [(float(time[i]), float(steps[i])) for i in np.flatnonzero(steps > longest).tolist()]


def _rate_and_jitter(time: Array, longest_gap: float) -> Tuple[float, float]:
    """Mean rate, Hz, and 99th percentile of |interval - mean|, s; gaps left out."""
    steps = np.diff(time)
    steps = steps[steps <= longest_gap]
    if not len(steps) or not steps.sum() > 0:
        return 0.0, 0.0
    mean = float(steps.mean())
    off = np.abs(steps - mean)
    at = min(len(off) - 1, int(0.99 * len(off)))
    return 1.0 / mean, float(np.partition(off, at)[at])


def _rate_checks(both: _Common, limits: StreamTolerance, lag: float) -> List[Check]:
    topic = both.golden.topic
    rate_g, jitter_g = _rate_and_jitter(both.golden.log_time, limits.gap_s)
    rate_c, jitter_c = _rate_and_jitter(both.candidate.log_time, limits.gap_s)
    off = 100.0 * abs(rate_c - rate_g) / max(rate_g, 1e-9)
    checks = [
        judged(Aspect.RATES, topic, "", off, limits.rate_percent, "%", "%.2f Hz, %.2f Hz in the golden log"
               % (rate_c, rate_g), golden="%.2f Hz" % rate_g, candidate="%.2f Hz" % rate_c),
        judged(Aspect.JITTER, topic, "", s_to_ms(max(jitter_c - jitter_g, 0.0)), limits.jitter_ms, "ms",
               "99 %% of the intervals are within %.1f ms of their mean, %.1f ms in the golden log"
               % (s_to_ms(jitter_c), s_to_ms(jitter_g)),
               golden="%.1f ms" % s_to_ms(jitter_g), candidate="%.1f ms" % s_to_ms(jitter_c))]
    # a gap just below the limit in one log and just above in the other is the same gap
    gaps_g, gaps_c = (_gaps(stream.log_time, limits.gap_s) for stream in both)
    near_g, near_c = (_gaps(stream.log_time, 0.5 * limits.gap_s) for stream in both)
    unmatched = [(start, length, "the candidate has no such gap") for start, length in gaps_g
                 if not _has_gap(near_c, start + lag, length, limits)]
    unmatched += [(start - lag, length, "the golden log has no such gap") for start, length in gaps_c
                  if not _has_gap(near_g, start - lag, length, limits)]
    if unmatched:
        at, length, words = max(unmatched, key=lambda gap: gap[1])
        checks.append(equal(Aspect.GAPS, topic, "", False, "silent for %.2f s: %s" % (length, words), at,
                            "%d gaps" % len(gaps_g), "%d gaps" % len(gaps_c)))
    else:
        checks.append(equal(Aspect.GAPS, topic, "", True, "%d gaps longer than %g s" % (len(gaps_c), limits.gap_s)))
    return checks


def _has_gap(gaps: Sequence[Tuple[float, float]], start: float, length: float, limits: StreamTolerance) -> bool:
    return any(abs(other - start) <= limits.gap_length_s and abs(size - length) <= limits.gap_length_s
               for other, size in gaps)


def _lost_checks(both: _Common, limits: StreamTolerance) -> List[Check]:
    if both.golden.lost is None or both.candidate.lost is None:
        return []
    share_g, share_c = (100.0 * (stream.lost or 0) / len(stream) for stream in both)
    return [judged(Aspect.LOST, both.golden.topic, "", max(share_c - share_g, 0.0), limits.lost_percent, "%",
                   "header.seq shows %d of %d messages missing" % (both.candidate.lost, len(both.candidate)),
                   golden="%d" % both.golden.lost, candidate="%d" % both.candidate.lost)]


def _stamp_checks(both: _Common, limits: StreamTolerance, lag: float) -> List[Check]:
    topic = both.golden.topic
    if both.golden.stamp is None:
        return []
    if both.candidate.stamp is None:
        return [equal(Aspect.STAMPS, topic, "header.stamp", False, "the candidate's messages are not stamped")]
    stamps = (both.golden.stamp, both.candidate.stamp)
    latency_g, latency_c = both.golden.log_time - stamps[0], both.candidate.log_time - stamps[1]
    median_g, median_c = float(np.median(latency_g)), float(np.median(latency_c))
    worst = int(np.argmax(latency_c))
    checks = [judged(Aspect.STAMPS, topic, "latency", s_to_ms(abs(median_c - median_g)), limits.latency_ms, "ms",
                     "median of log time - header.stamp is %.1f ms, %.1f ms in the golden log"
                     % (s_to_ms(median_c), s_to_ms(median_g)), float(both.candidate.log_time[worst]) - lag,
                     "%.1f ms" % s_to_ms(median_g), "%.1f ms" % s_to_ms(median_c))]
    repeated_g, repeated_c = (100.0 * float((np.diff(stamp) == 0).mean()) for stamp in stamps)
    checks.append(judged(Aspect.STAMPS, topic, "repeated", max(repeated_c - repeated_g, 0.0), limits.repeated_percent,
                         "%", "%.1f %% of the messages repeat the stamp before, %.1f %% in the golden log"
                         % (repeated_c, repeated_g), golden="%.1f %%" % repeated_g, candidate="%.1f %%" % repeated_c))
    backwards_g, backwards_c = (int((np.diff(stamp) < 0).sum()) for stamp in stamps)
    at = None
    if backwards_c:
        at = float(both.candidate.log_time[int(np.argmin(np.diff(both.candidate.stamp))) + 1]) - lag
    checks.append(equal(Aspect.STAMPS, topic, "order", backwards_c <= backwards_g,
                        "%d stamps are older than the one before" % backwards_c, at,
                        str(backwards_g), str(backwards_c)))
    return checks
