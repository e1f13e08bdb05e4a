"""Timing and pace of each motion, and whether the candidate's recording holds all of them."""
from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from ...units import ms_to_s
from ..matching.alignment import Alignment, Episode
from ..matching.cut_motions import Cut
from ..runs.run import Run
from ..tolerances import TimingTolerance, Tolerances
from ..verdict import Aspect, Check, equal, judged, not_compared

_POOLED_S = 2.0
"""Total duration, s, from which all motions of an arm together are long enough to judge their pace as one."""
LATCHED_S = 1.0
"""Time, s, from the begin of a recording in which messages may be older: latched ones, the first state."""
_ENDS_S = 1.0
"""A recording in which nothing happens may end so much sooner, s: whoever records ends it by hand or by a clock."""
_CHANGING_SHARE = 0.3
"""A value that changes in a larger share of the messages changes all the time."""


def timing_checks(alignment: Alignment, cuts: Dict[str, List[Cut]], tolerances: Tolerances) -> List[Check]:
    """Check that each motion begins and lasts as it should."""
    limits = tolerances.timing
    checks: List[Check] = []
    for arm, episodes in alignment.episodes.items():
        alike = [episode for episode in episodes if episode.is_alike]
        if not alike:
            why = "nothing moves" if not episodes else "no motion is alike: see the joints"
            checks.append(not_compared(Aspect.TIMING, arm, "motions", why))
            continue
        late = max(alike, key=lambda episode: abs(episode.lag - alignment.lag))
        off = late.lag - alignment.lag
        checks.append(judged(Aspect.TIMING, arm, "motions", abs(off), limits.event_s, "s",
                             "%d motions; the one at %.2f s comes %.3f s %s than the others"
                             % (len(alike), late.start, abs(off), "later" if off > 0 else "sooner"), late.start))
        checks += wait_checks(arm, "waits", [(episode.start, episode.lag, "the motion") for episode in alike], limits)
        checks += _pace_checks(arm, alike, cuts.get(arm, []), tolerances)
    return checks


def wait_checks(topic: str, field: str, events: Sequence[Tuple[float, float, str]],
                limits: TimingTolerance) -> List[Check]:
    """Check the times from event to event.

    Args:
        topic: Topic or arm of the checks.
        field: Their field.
        events: Golden time and the candidate's lag, s, and name of each event, by golden time.
        limits: Tolerances.
    """
    if len(events) < 2:
        return []
    off, at, words = max(((after[1] - before[1], after[0], after[2]) for before, after in zip(events, events[1:])),
                         key=lambda entry: abs(entry[0]))
    return [judged(Aspect.TIMING, topic, field, abs(off), limits.wait_s, "s", "%s at %.2f s comes %.3f s %s after the "
                   "one before than in the golden log" % (words, at, abs(off), "later" if off > 0 else "sooner"), at)]


def allowed_pace(span: float, limits: TimingTolerance) -> float:
    """Return the allowed deviation, %, of the duration of motions that last ``span``, s."""
    return max(100.0 * ms_to_s(limits.pace_floor_ms) / span, limits.pace_percent)


def _worst_paces(paces: Sequence[Tuple[float, float]]) -> Tuple[Tuple[float, float], ...]:
    """Return the (deviation in %, duration in s) of motions that no other exceeds in both the share and the time."""
    worst: List[Tuple[float, float]] = []
    longest = -1.0
    for percent, span in sorted(paces, key=lambda pace: (-pace[0], -pace[1])):
        if percent * span > longest:
            worst.append((percent, span))
            longest = percent * span
    return tuple(worst)


def _pace_checks(arm: str, episodes: Sequence[Episode], cuts: Sequence[Cut], tolerances: Tolerances) -> List[Check]:
    limits = tolerances.timing
    displaced = [(cut.at, cut.until) for cut in cuts]
    fitted = [(episode, episode.pace) for episode in episodes if episode.pace is not None
              and not any(begin < episode.start <= until for begin, until in displaced)]
    if not fitted:
        return [not_compared(Aspect.PACE, arm, "motions",
                             "no motion is long enough, or all begin where a stop left the arm")]
    floor = ms_to_s(limits.pace_floor_ms)

    def excess(entry: Tuple[Episode, float]) -> float:
        episode, pace = entry
        return abs(pace - 1.0) * episode.span / max(0.01 * limits.pace_percent * episode.span, floor, 1e-9)

    episode, pace = max(fitted, key=excess)
    allowed = allowed_pace(episode.span, limits)
    checks = [judged(Aspect.PACE, arm, "one motion", 100.0 * abs(pace - 1.0), allowed, "%",
                     "the motion at %.2f s lasts %+.2f %% of its golden %.2f s"
                     % (episode.start, 100.0 * (pace - 1.0), episode.span), episode.start,
                     "%.3f s" % episode.span, "%.3f s" % (episode.span * pace),
                     _worst_paces([(100.0 * abs(pace - 1.0), episode.span) for episode, pace in fitted]))]
    total = sum(episode.span for episode, _ in fitted)
    if total >= _POOLED_S:
        pooled = sum((pace - 1.0) * episode.span for episode, pace in fitted) / total
        allowed = allowed_pace(total, limits)
        checks.append(judged(Aspect.PACE, arm, "all motions", 100.0 * abs(pooled), allowed, "%",
                             "all motions together last %+.2f %% of their golden %.1f s" % (100.0 * pooled, total),
                             episode.start, "%.3f s" % total, "%.3f s" % (total * (1.0 + pooled)),
                             ((100.0 * abs(pooled), total),)))
    return checks


def coverage_check(golden: Run, candidate: Run, has_arms: bool, alignment: Alignment,
                   tolerances: Tolerances, on_change: Mapping[str, int]) -> Check:
    """Check that the candidate's recording holds everything that happens in the golden log.

    Args:
        golden: The golden log.
        candidate: The candidate, with the same topics.
        has_arms: The joints of both logs can be aligned.
        alignment: Alignment of both logs.
        tolerances: Limits for deviations.
        on_change: Topics without a rate, and by how many messages each may differ.
    """
    times = [call.start for call in golden.calls] + [call.end for call in golden.calls]
    for episodes in alignment.episodes.values():
        times += [time for episode in episodes for time in (episode.start, episode.end)]
    words = "lag %.3f s, found by %s" % (alignment.lag, alignment.method)
    if golden.joints and not has_arms:
        return equal(Aspect.ALIGNMENT, "", "", False, "the joints of the logs cannot be aligned; " + words)
    slack = tolerances.timing.event_s
    changes = times + _last_changes(golden, tolerances, on_change)
    last = max(changes, default=golden.duration - _ENDS_S)
    before = -min(times, default=np.inf) - alignment.lag
    behind = min(last, golden.duration) + alignment.lag - candidate.duration
    missing, at = max(before, behind, 0.0), None
    if before > slack:
        words, at = "the candidate begins %.2f s after the first event; %s" % (before, words), min(times)
    elif behind > slack:
        words = ("the candidate ends %.2f s before the last event; %s" % (behind, words) if changes else
                 "the candidate ends %.2f s before the golden log, in which nothing happens; %s" % (
                     behind + _ENDS_S, words))
        at = candidate.duration - alignment.lag
    return judged(Aspect.ALIGNMENT, "", "", missing, slack, "s", words, at)


def _last_changes(golden: Run, tolerances: Tolerances, on_change: Mapping[str, int]) -> List[float]:
    """Return the time, s, of the last change of each state and content, and of the last message of topics on change.

    What changes all the time, or is published with a period, has no last one.
    """
    tracks = [(topic, track) for topic, track in golden.states.items()]
    tracks += [(topic, contents.track(topic)) for topic, contents in golden.contents.items()]
    times: List[float] = []
    for topic, track in tracks:
        for column, name in enumerate(track.names):
            changed = np.flatnonzero(np.diff(track.value[:, column]))
            if len(changed) and len(changed) <= _CHANGING_SHARE * len(golden.streams[topic]) \
                    and not tolerances.ignores_field(topic, name):
                times.append(float(track.time[changed[-1] + 1]))
    for topic, slack in on_change.items():
        if not slack:
            times.append(float(golden.streams[topic].between(-np.inf, np.inf).log_time[-1]))
    return [time for time in times if time > LATCHED_S]
