"""Timing and pace of each motion; then joints, positions, orientations and further fields, sample by sample."""
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..messages.batch import Array
from ..units import m_to_mm, mm_to_m, ms_to_s
from .alignment import Alignment, Episode
from .curve_distance import distances, interpolated, lateness, lengths
from .cut_motions import Cut, allowances
from .rotation_angles import continuous, quaternions
from .run import PoseTrack, Run, Track, arm_of
from .tolerances import FieldTolerance, Tolerances
from .verdict import Aspect, Check, Outcome, Residual, ResidualKey, equal, judged, not_compared

_LOOK_CLOSER = 0.3
"""A sample farther off than this share of its limit is looked for within the jitter of its stamp."""
_POOLED_S = 2.0
"""All motions of an arm together must last so long before their pace is judged as one."""


def timing_checks(alignment: Alignment, cuts: Dict[str, List[Cut]], tolerances: Tolerances) -> List[Check]:
    """Does each motion begin when it should, and last as long as it should?"""
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
        checks += _pace_checks(arm, alike, cuts.get(arm, []), tolerances)
    return checks


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
    allowed = max(100.0 * floor / episode.span, limits.pace_percent)
    checks = [judged(Aspect.PACE, arm, "one motion", 100.0 * abs(pace - 1.0), allowed, "%",
                     "the motion at %.2f s lasts %+.2f %% of its golden %.2f s"
                     % (episode.start, 100.0 * (pace - 1.0), episode.span), episode.start,
                     "%.3f s" % episode.span, "%.3f s" % (episode.span * pace))]
    total = sum(episode.span for episode, _ in fitted)
    if total >= _POOLED_S:
        pooled = sum((pace - 1.0) * episode.span for episode, pace in fitted) / total
        allowed = max(100.0 * floor / total, limits.pace_percent)
        checks.append(judged(Aspect.PACE, arm, "all motions", 100.0 * abs(pooled), allowed, "%",
                             "all motions together last %+.2f %% of their golden %.1f s" % (100.0 * pooled, total),
                             episode.start, "%.3f s" % total, "%.3f s" % (total * (1.0 + pooled))))
    return checks


class _Frame(NamedTuple):
    """What the checks of one comparison have in common."""

    alignment: Alignment
    tolerances: Tolerances
    arms: List[str]
    cuts: Dict[str, List[Cut]]
    jitter_s: float
    residuals: Dict[ResidualKey, Residual]

    def cut_s(self) -> float:
        return ms_to_s(self.tolerances.timing.cut_ms)


def motion_checks(golden: Run, candidate: Run, alignment: Alignment, cuts: Dict[str, List[Cut]],
                  tolerances: Tolerances) -> Tuple[List[Check], Dict[ResidualKey, Residual]]:
    """Joints, tool poses and further fields of topics that both logs have, with the same types."""
    frame = _Frame(alignment, tolerances, golden.arms, cuts, ms_to_s(tolerances.timing.jitter_ms), {})
    checks: List[Check] = []
    for topic, joints in golden.joints.items():
        if topic in candidate.streams:
            checks += _joint_checks(joints, candidate.joints.get(topic), frame)
    for topic, pose in golden.poses.items():
        if topic in candidate.streams:
            checks += _pose_checks(pose, candidate.poses.get(topic), frame)
    for topic, rules in golden.fields.items():
        for name, ours in rules.items():
            theirs = candidate.fields.get(topic, {}).get(name)
            if topic in candidate.streams:
                checks += _field_checks(ours, theirs, name, tolerances.fields[topic][name], frame)
    return checks, frame.residuals


class _Samples(NamedTuple):
    """Samples of the candidate at golden times, but for those where the golden log has none, or that are no numbers.

    ``jitter`` is how far the stamp of each may be off, s.
    """

    time: Array
    value: Array
    jitter: Array
    golden_time: Array
    golden_value: Array
    golden_here: Array

    def columns(self, some: slice) -> "_Samples":
        """The same samples with some of their columns."""
        return self._replace(value=self.value[:, some], golden_value=self.golden_value[:, some],
                             golden_here=self.golden_here[:, some])


def _samples(ours_time: Array, ours: Array, theirs_time: Array, theirs: Array, topic: str,
             frame: _Frame) -> Optional[_Samples]:
    good = np.isfinite(ours).all(axis=1)
    if not good.all():
        ours_time, ours = ours_time[good], ours[good]
    good = np.isfinite(theirs).all(axis=1)
    if not good.all():
        theirs_time, theirs = theirs_time[good], theirs[good]
    if len(ours_time) < 2 or not len(theirs_time):
        return None
    at = frame.alignment.golden_time(arm_of(topic, frame.arms), theirs_time)
    steps = np.diff(ours_time)
    inside = (at >= ours_time[0]) & (at <= ours_time[-1])
    gap = frame.tolerances.streams.gap_s
    jitter = frame.jitter_s + lateness(theirs_time, gap) + np.interp(at, ours_time, lateness(ours_time, gap))
    for i in np.flatnonzero(steps > gap).tolist():
        inside &= (at < ours_time[i] + frame.jitter_s) | (at > ours_time[i + 1] - frame.jitter_s)
    if not inside.any():
        return None
    if not inside.all():
        at, theirs, jitter = at[inside], theirs[inside], jitter[inside]
    return _Samples(at, theirs, jitter, ours_time, ours, interpolated(ours_time, ours, at))


def _verdict(aspect: Aspect, topic: str, field: str, off: Array, allowed: Array, limit: float, unit: str,
             outside_percent: float, samples: _Samples, names: Sequence[str], frame: _Frame,
             factor: float = 1.0) -> Check:
    """Judge distances, in ``unit`` / ``factor``, that may be larger than the limit by ``allowed``."""
    beyond = np.maximum(off - allowed, 0.0)
    frame.residuals[aspect, topic, field] = Residual(samples.time, beyond * factor, limit * factor, unit)
    worst = int(np.argmax(beyond))
    outside = 100.0 * float((beyond > limit).mean())
    at = float(samples.time[worst])
    shown = [", ".join("%s %.6g" % (name, value) for name, value in zip(names, row))
             for row in (samples.golden_here[worst], samples.value[worst])]
    detail = "at most %.4g %s off, at %.3f s" % (float(beyond[worst]) * factor, unit, at)
    if allowed[worst] > 0:
        detail += ", beyond %.4g %s that a stop may have moved" % (float(allowed[worst]) * factor, unit)
    if outside:
        detail += "; %.3g %% of %d samples outside" % (outside, len(off))
    check = judged(aspect, topic, field, float(beyond[worst]) * factor, limit * factor, unit, detail, at, *shown)
    if check.outcome is Outcome.DIFFERENT and outside <= outside_percent:
        return judged(aspect, topic, field, outside, outside_percent, "% of the samples outside", detail, at, *shown)
    return check


def _nan_checks(aspect: Aspect, topic: str, ours: Tuple[Array, Array], theirs: Tuple[Array, Array],
                frame: _Frame) -> List[Check]:
    """The policy for values that are not finite; (time, value) each."""
    policy = frame.tolerances.nan
    bad_g = ours[0][~np.isfinite(ours[1]).all(axis=1)]
    bad_c = theirs[0][~np.isfinite(theirs[1]).all(axis=1)]
    if policy == "ignore" or not (len(bad_g) or len(bad_c)):
        return []
    at = frame.alignment.golden_time(arm_of(topic, frame.arms), bad_c)
    if policy == "fail":
        return [equal(aspect, topic, "NaN", not len(at), "%d samples are not numbers" % len(at),
                      float(at[0]) if len(at) else None, str(len(bad_g)), str(len(bad_c)))]
    reach = frame.jitter_s + 0.01
    alone = np.concatenate([at[~_near(at, bad_g, reach)], bad_g[~_near(bad_g, at, reach)]])
    return [equal(aspect, topic, "NaN", not len(alone),
                  "%d samples are not numbers in one of the logs only" % len(alone),
                  float(alone.min()) if len(alone) else None, str(len(bad_g)), str(len(bad_c)))]


def _near(times: Array, others: Array, reach: float) -> Array:
    if not len(others):
        return np.zeros(len(times), bool)
    right = np.clip(np.searchsorted(others, times), 0, len(others) - 1)
    left = np.maximum(right - 1, 0)
    near: Array = np.minimum(np.abs(others[right] - times), np.abs(others[left] - times)) <= reach
    return near


def _nothing_common(aspect: Aspect, topic: str) -> Check:
    return equal(aspect, topic, "", False, "no samples in common: the candidate has none while the golden log has")


def _joint_checks(ours: Track, theirs: Optional[Track], frame: _Frame) -> List[Check]:
    limits = frame.tolerances.joints
    if theirs is None:
        return [_nothing_common(Aspect.JOINTS, ours.topic)]
    if ours.names != theirs.names:
        return [equal(Aspect.JOINTS, ours.topic, "names", False, "the joints are not the same", None,
                      " ".join(ours.names), " ".join(theirs.names))]
    checks = _nan_checks(Aspect.JOINTS, ours.topic, (ours.time, ours.value), (theirs.time, theirs.value), frame)
    samples = _samples(ours.time, ours.value, theirs.time, theirs.value, ours.topic, frame)
    if samples is None:
        return checks + [_nothing_common(Aspect.JOINTS, ours.topic)]
    allowed = allowances(frame.cuts.get(arm_of(ours.topic, frame.arms), []), samples.golden_time,
                         samples.golden_value, samples.time, frame.cut_s())
    direct = np.abs(samples.value - samples.golden_here)
    for column, name in enumerate(ours.names):
        limit = limits.per_joint.get(name, limits.position_rad)
        part = samples.columns(slice(column, column + 1))
        off = distances(part.golden_time, part.golden_value, part.time, part.value, direct[:, column],
                        part.jitter, _LOOK_CLOSER * limit)
        checks.append(_verdict(Aspect.JOINTS, ours.topic, name, off, allowed[:, column], limit, "rad",
                               limits.outside_percent, part, [name], frame))
    return checks


def _pose_checks(ours: PoseTrack, theirs: Optional[PoseTrack], frame: _Frame) -> List[Check]:
    limits = frame.tolerances.tcp
    if theirs is None:
        return [_nothing_common(Aspect.POSITION, ours.topic)]
    checks = []
    if ours.frames or theirs.frames:
        checks.append(equal(Aspect.POSITION, ours.topic, "frame_id", ours.frames == theirs.frames,
                            "frame %s" % ", ".join(theirs.frames), None, ", ".join(ours.frames),
                            ", ".join(theirs.frames)))
    checks += _nan_checks(Aspect.POSITION, ours.topic, (ours.time, np.hstack([ours.position, ours.rotation_vector])),
                          (theirs.time, np.hstack([theirs.position, theirs.rotation_vector])), frame)
    cuts = frame.cuts.get(arm_of(ours.topic, frame.arms), [])
    golden, candidate = (np.hstack([track.position, continuous(quaternions(track.rotation_vector))])
                         for track in (ours, theirs))
    both = _samples(ours.time, golden, theirs.time, candidate, ours.topic, frame)
    if both is None:
        return checks + [_nothing_common(Aspect.POSITION, ours.topic)]
    samples, turned = both.columns(slice(0, 3)), both.columns(slice(3, 7))
    limit = mm_to_m(limits.position_mm)
    off = distances(samples.golden_time, samples.golden_value, samples.time, samples.value,
                    lengths(samples.value - samples.golden_here), samples.jitter, _LOOK_CLOSER * limit)
    allowed = allowances(cuts, samples.golden_time, samples.golden_value, samples.time, frame.cut_s())
    checks.append(_verdict(Aspect.POSITION, ours.topic, "position", off, np.sqrt((allowed * allowed).sum(axis=1)),
                           limit, "mm", limits.outside_percent, samples, ("x", "y", "z"), frame, m_to_mm(1.0)))
    opposite = np.einsum("ij,ij->i", turned.golden_here, turned.value) < 0
    if opposite.any():
        turned = turned._replace(value=np.where(opposite[:, None], -turned.value, turned.value))
    chord = distances(turned.golden_time, turned.golden_value, turned.time, turned.value,
                      lengths(turned.value - turned.golden_here), turned.jitter,
                      0.5 * _LOOK_CLOSER * limits.orientation_rad)
    # unit quaternions that are an angle a apart are 2 sin(a/4) apart as points
    angle = 4.0 * np.arcsin(np.minimum(0.5 * chord, np.sin(np.pi / 4.0)))
    allowed = allowances(cuts, turned.golden_time, turned.golden_value, turned.time, frame.cut_s())
    checks.append(_verdict(Aspect.ORIENTATION, ours.topic, "orientation", angle,
                           2.0 * np.sqrt((allowed * allowed).sum(axis=1)), limits.orientation_rad, "rad",
                           limits.outside_percent, turned, ("qw", "qx", "qy", "qz"), frame))
    return checks


def _field_checks(ours: Track, theirs: Optional[Track], name: str, rule: FieldTolerance,
                  frame: _Frame) -> List[Check]:
    if theirs is None or ours.value.shape[1] != theirs.value.shape[1]:
        return [equal(Aspect.FIELDS, ours.topic, name, False, "the candidate has another number of values")]
    checks = _nan_checks(Aspect.FIELDS, ours.topic, (ours.time, ours.value), (theirs.time, theirs.value), frame)
    samples = _samples(ours.time, ours.value, theirs.time, theirs.value, ours.topic, frame)
    if samples is None:
        return checks + [_nothing_common(Aspect.FIELDS, ours.topic)]
    near, seen = samples.golden_here, samples.value
    if rule.wraps:
        seen = near + np.mod(seen - near + np.pi, 2.0 * np.pi) - np.pi
    columns = []
    for column in range(seen.shape[1]):
        one = slice(column, column + 1)
        off = distances(samples.golden_time, samples.golden_value[:, one], samples.time, seen[:, one],
                        np.abs(seen - near)[:, column], samples.jitter, _LOOK_CLOSER * rule.absolute)
        columns.append(np.maximum(off - rule.relative * np.abs(near[:, column]), 0.0))
    off = np.max(columns, axis=0) if columns else np.zeros(len(seen))
    checks.append(_verdict(Aspect.FIELDS, ours.topic, name, off, np.zeros(len(off)), rule.absolute, "", 0.0,
                           samples, ours.names, frame))
    return checks


def coverage_check(golden: Run, candidate: Run, has_arms: bool, alignment: Alignment,
                   tolerances: Tolerances) -> Check:
    """Does the candidate's recording hold everything that happens in the golden log?"""
    times = [call.start for call in golden.calls] + [call.end for call in golden.calls]
    for episodes in alignment.episodes.values():
        times += [time for episode in episodes for time in (episode.start, episode.end)]
    words = "lag %.3f s, found by %s" % (alignment.lag, alignment.method)
    if golden.joints and not has_arms:
        return equal(Aspect.ALIGNMENT, "", "", False, "the joints of the logs cannot be aligned; " + words)
    if times:
        slack = tolerances.timing.event_s
        if min(times) + alignment.lag < -slack:
            return equal(Aspect.ALIGNMENT, "", "", False, "the candidate begins %.2f s after the first event; %s"
                         % (-min(times) - alignment.lag, words), min(times))
        if max(times) + alignment.lag > candidate.duration + slack:
            return equal(Aspect.ALIGNMENT, "", "", False, "the candidate ends %.2f s before the last event; %s"
                         % (max(times) + alignment.lag - candidate.duration, words), candidate.duration - alignment.lag)
    return equal(Aspect.ALIGNMENT, "", "", True, words)
