"""Timing and pace of each motion; then joints, positions, orientations and further fields, sample by sample."""
import dataclasses
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..messages.batch import Array
from ..units import m_to_mm, mm_to_m, ms_to_s
from .alignment import Alignment, Episode
from .curve_distance import distances, interpolated, lateness, lengths
from .cut_motions import Cut, allowances
from .rotation_angles import continuous, quaternions
from .run import Run, Track, arm_of
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


def motion_checks(golden: Run, candidate: Run, alignment: Alignment, cuts: Dict[str, List[Cut]],
                  tolerances: Tolerances) -> Tuple[List[Check], Dict[ResidualKey, Residual]]:
    """Joints, tool poses and further fields; both runs hold only topics that the other has with the same types."""
    frame = _Frame(alignment, tolerances, golden.arms, cuts, ms_to_s(tolerances.timing.jitter_ms), {})
    checks: List[Check] = []
    for topic, joints in golden.joints.items():
        checks += _joint_checks(joints, candidate.joints.get(topic), frame)
    for topic, pose in golden.poses.items():
        checks += _pose_checks(pose, candidate.poses.get(topic), frame)
    for topic, fields in golden.fields.items():
        for name, ours in fields.items():
            checks += _field_checks(ours, candidate.fields[topic][name], name, tolerances.fields[topic][name], frame)
    return checks, frame.residuals


class _Samples(NamedTuple):
    """Samples of the candidate at golden times, but for those where the golden log has none, or that are no numbers.

    ``jitter`` is how far the stamp of each may be off, s; ``allowed`` how far each value may be, because of stops.
    """

    time: Array
    value: Array
    jitter: Array
    allowed: Array
    golden_time: Array
    golden_value: Array
    golden_here: Array

    def columns(self, some: slice) -> "_Samples":
        """The same samples with some of their columns."""
        return self._replace(value=self.value[:, some], allowed=self.allowed[:, some],
                             golden_value=self.golden_value[:, some], golden_here=self.golden_here[:, some])

    def distances(self, limit: float) -> Array:
        """Of each sample to the golden curve, Euclidean over the columns; exact where near ``limit`` or beyond it."""
        return distances(self.golden_time, self.golden_value, self.time, self.value,
                         lengths(self.value - self.golden_here), self.jitter, _LOOK_CLOSER * limit)


def _samples(ours: Track, theirs: Track, frame: _Frame) -> Optional[_Samples]:
    ours, theirs = ours.finite(), theirs.finite()
    if len(ours.time) < 2 or not len(theirs.time):
        return None
    arm = arm_of(ours.topic, frame.arms)
    at = frame.alignment.golden_time(arm, theirs.time)
    inside = (at >= ours.time[0]) & (at <= ours.time[-1])
    gap = frame.tolerances.streams.gap_s
    for i in np.flatnonzero(np.diff(ours.time) > gap).tolist():
        inside &= (at < ours.time[i] + frame.jitter_s) | (at > ours.time[i + 1] - frame.jitter_s)
    if not inside.any():
        return None
    jitter = frame.jitter_s + lateness(theirs.time, gap) + np.interp(at, ours.time, lateness(ours.time, gap))
    at = at[inside]
    allowed = allowances(frame.cuts.get(arm, []), ours.time, ours.value, at, ms_to_s(frame.tolerances.timing.cut_ms))
    return _Samples(at, theirs.value[inside], jitter[inside], allowed, ours.time, ours.value,
                    interpolated(ours.time, ours.value, at))


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


def _nan_checks(aspect: Aspect, ours: Track, theirs: Track, frame: _Frame) -> List[Check]:
    """The policy for values that are not finite."""
    policy = frame.tolerances.nan
    bad_g, bad_c = (track.time[~np.isfinite(track.value).all(axis=1)] for track in (ours, theirs))
    if policy == "ignore" or not (len(bad_g) or len(bad_c)):
        return []
    at = frame.alignment.golden_time(arm_of(ours.topic, frame.arms), bad_c)
    if policy == "fail":
        wrong, words = at, "%d samples are not numbers"
    else:
        reach = frame.jitter_s + 0.01
        wrong = np.concatenate([at[~_near(at, bad_g, reach)], bad_g[~_near(bad_g, at, reach)]])
        words = "%d samples are not numbers in one of the logs only"
    return [equal(aspect, ours.topic, "NaN", not len(wrong), words % len(wrong),
                  float(wrong.min()) if len(wrong) else None, str(len(bad_g)), str(len(bad_c)))]


def _near(times: Array, others: Array, reach: float) -> Array:
    """Whether one of ``others``, ascending, is within ``reach`` of each time."""
    near: Array = np.searchsorted(others, times - reach) < np.searchsorted(others, times + reach, "right")
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
    checks = _nan_checks(Aspect.JOINTS, ours, theirs, frame)
    samples = _samples(ours, theirs, frame)
    if samples is None:
        return checks + [_nothing_common(Aspect.JOINTS, ours.topic)]
    for column, name in enumerate(ours.names):
        limit = limits.per_joint.get(name, limits.position_rad)
        part = samples.columns(slice(column, column + 1))
        checks.append(_verdict(Aspect.JOINTS, ours.topic, name, part.distances(limit), part.allowed[:, 0], limit,
                               "rad", limits.outside_percent, part, [name], frame))
    return checks


def _with_quaternions(pose: Track) -> Track:
    """Positions, and orientations as quaternions that interpolate: shape (n, 7)."""
    orientation = continuous(quaternions(pose.value[:, 3:]))
    return dataclasses.replace(pose, value=np.hstack([pose.value[:, :3], orientation]))


def _pose_checks(ours: Track, theirs: Optional[Track], frame: _Frame) -> List[Check]:
    limits = frame.tolerances.tcp
    if theirs is None:
        return [_nothing_common(Aspect.POSITION, ours.topic)]
    checks = []
    if ours.frames or theirs.frames:
        checks.append(equal(Aspect.POSITION, ours.topic, "frame_id", ours.frames == theirs.frames,
                            "frame %s" % ", ".join(theirs.frames), None, ", ".join(ours.frames),
                            ", ".join(theirs.frames)))
    checks += _nan_checks(Aspect.POSITION, ours, theirs, frame)
    both = _samples(_with_quaternions(ours), _with_quaternions(theirs), frame)
    if both is None:
        return checks + [_nothing_common(Aspect.POSITION, ours.topic)]
    placed, turned = both.columns(slice(0, 3)), both.columns(slice(3, 7))
    limit = mm_to_m(limits.position_mm)
    checks.append(_verdict(Aspect.POSITION, ours.topic, "position", placed.distances(limit), lengths(placed.allowed),
                           limit, "mm", limits.outside_percent, placed, ("x", "y", "z"), frame, m_to_mm(1.0)))
    opposite = np.einsum("ij,ij->i", turned.golden_here, turned.value) < 0
    turned = turned._replace(value=np.where(opposite[:, None], -turned.value, turned.value))
    # unit quaternions that are an angle a apart are 2 sin(a/4) apart as points
    chord = turned.distances(0.5 * limits.orientation_rad)
    angle = 4.0 * np.arcsin(np.minimum(0.5 * chord, np.sin(np.pi / 4.0)))
    checks.append(_verdict(Aspect.ORIENTATION, ours.topic, "orientation", angle, 2.0 * lengths(turned.allowed),
                           limits.orientation_rad, "rad", limits.outside_percent, turned, ("qw", "qx", "qy", "qz"),
                           frame))
    return checks


def _field_checks(ours: Track, theirs: Track, name: str, rule: FieldTolerance, frame: _Frame) -> List[Check]:
    if ours.value.shape[1] != theirs.value.shape[1]:
        return [equal(Aspect.FIELDS, ours.topic, name, False, "the candidate has another number of values")]
    checks = _nan_checks(Aspect.FIELDS, ours, theirs, frame)
    samples = _samples(ours, theirs, frame)
    if samples is None:
        return checks + [_nothing_common(Aspect.FIELDS, ours.topic)]
    near = samples.golden_here
    unwound = samples
    if rule.wraps:
        unwound = samples._replace(value=near + np.mod(samples.value - near + np.pi, 2.0 * np.pi) - np.pi)
    off = np.zeros(len(near))
    for column in range(near.shape[1]):
        distance = unwound.columns(slice(column, column + 1)).distances(rule.absolute)
        off = np.maximum(off, distance - rule.relative * np.abs(near[:, column]))
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
