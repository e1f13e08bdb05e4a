"""Joints, positions, orientations and further fields, sample by sample, a window of both logs at a time."""
from typing import Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np

from ...messages.batch import Array, largest, row_products
from ...operations.thinning import MinMax
from ...units import m_to_mm, mm_to_m, s_to_ms
from ..matching.curve_distance import interpolated, lengths
from ..runs.contents import QUATERNION
from ..runs.publishers import base_of
from ..runs.run import LongTrack, Run, are_numbers, arm_of
from ..tolerances import Envelope, FieldTolerance
from ..verdict import Aspect, Check, Outcome, Residual, ResidualKey, equal, judged, limits_at, not_compared
from .aligned_samples import AlignedSamples, Convert, Frame, Samples, as_they_are
from .content_checks import NumberLimits, is_of_any_speed, number_limits, unit_of
from .not_numbers import NotNumbers, columns_of, has_not_numbers, without_columns
from .rotation_angles import continuous, quaternions

RESOLUTION = 0.3
"""A sample farther off than this share of its limit is looked for within the jitter of its stamp."""
_SHARES_AT = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0)
"""Multiples of a limit for each of which the samples outside are counted."""
_CLOSE_UP_S = 1.0
"""Time, s, on both sides of the worst sample that the report draws."""
_EVERY, _SLOPE_S, _LEAST_SPEED = 2, 0.012, 0.005
"""The share of samples taken for lateness is one of so many; half the span of speeds, s; least speed, m/s or rad/s."""
_FEWEST_MOVING = 20
"""Fewest samples in motion of which lateness is told; with fewer noise decides."""
_EXPLAINED = 0.4
"""Share of the squared deviations that a delay must explain: of values of which each second one is late it is half."""
ONE_MOTION = 2.0
"""Multiple of the limit by which the values may be late in a single motion."""
_POINTS = 1100
"""Points of a curve in the report: about one for each pixel of its width."""


def _least(envelope: Envelope, limit: float, factor: float = 1.0) -> float:
    """Return an envelope's least limit, divided by ``factor``; without an envelope ``limit``."""
    return min(value for _, value in envelope) / factor if envelope else limit


def _with_quaternions(value: Array, before: Optional[Array]) -> Array:
    """Convert orientations to quaternions that interpolate; with the positions: shape (n, 6) to (n, 7)."""
    orientation = continuous(quaternions(value[:, 3:]), None if before is None else before[3:])
    return np.hstack([value[:, :3], orientation])


class _Judge:
    """A judge of distances, in ``unit`` / ``factor``, that may exceed the limit by what stops allow.

    With an envelope, in ``unit``, the limit is its least value, and more is allowed where the envelope is wider.
    """

    def __init__(self, aspect: Aspect, topic: str, field: str, limit: float, unit: str, outside_percent: float,
                 names: Sequence[str], floor: float, factor: float = 1.0, envelope: Envelope = ()) -> None:
        self._aspect, self._topic, self._field, self._names = aspect, topic, field, names
        self._limit, self._unit, self._factor, self._outside_percent = limit, unit, factor, outside_percent
        self._envelope = envelope
        self._floor = floor
        self._curve = MinMax(_POINTS)
        self._count = self._outside = 0
        self._rungs = np.array([share * limit for share in _SHARES_AT if share * limit >= floor])
        self._beyond = np.zeros(len(self._rungs), np.int64)
        self._worst, self._wider = -1.0, 0.0
        self._worst_at = self._worst_allowed = 0.0
        self._shown: Tuple[Array, Array] = (np.zeros(0), np.zeros(0))
        self._tail = np.zeros((0, 2))
        self._close_up = np.zeros((0, 2))

    def take(self, off: Array, allowed: Array, samples: Samples) -> None:
        """Add further samples."""
        excess = beyond = np.maximum(off - allowed, 0.0)
        wider = None
        if self._envelope:
            wider = limits_at(self._envelope, samples.time) / self._factor - self._limit
            excess = np.maximum(beyond - wider, 0.0)
        self._count += len(off)
        self._outside += int(np.count_nonzero(excess > self._limit))
        if excess.max() > self._floor:
            self._beyond += np.count_nonzero(excess > self._rungs[:, None], axis=1)
        shown = beyond * self._factor
        self._curve.add(samples.time, shown)
        worst = int(np.argmax(excess))
        if excess[worst] > self._worst:
            self._worst, self._worst_at = float(excess[worst]), float(samples.time[worst])
            self._wider = 0.0 if wider is None else float(wider[worst])
            self._worst_allowed = float(allowed[worst])
            self._shown = (samples.golden_here[worst].copy(), samples.value[worst].copy())
            self._close_up = self._tail[np.abs(self._tail[:, 0] - self._worst_at) <= _CLOSE_UP_S]
        near = np.flatnonzero(np.abs(samples.time - self._worst_at) <= _CLOSE_UP_S)
        if len(near):
            self._close_up = np.concatenate([self._close_up, np.stack([samples.time[near], shown[near]], axis=1)])
        last = np.flatnonzero(samples.time >= samples.time[-1] - _CLOSE_UP_S)
        self._tail = np.stack([samples.time[last], shown[last]], axis=1)

    def check(self, residuals: Dict[ResidualKey, Residual]) -> Check:
        """Return the outcome, after all samples; add their deviations to ``residuals``."""
        topic, field, unit, factor = self._topic, self._field, self._unit, self._factor
        if not self._count:
            return _nothing_common(self._aspect, topic)
        worst, limit = (factor * (amount + self._wider) for amount in (self._worst, self._limit))
        residuals[self._aspect, topic, field] = Residual(
            *self._curve.points(), self._envelope or ((0.0, limit),), unit, self._close_up[:, 0], self._close_up[:, 1])
        outside = 100.0 * self._outside / self._count
        golden, candidate = (", ".join("%s %.6g" % (name, value) for name, value in zip(self._names, row))
                             for row in self._shown)
        detail = "at most %s off, at %.3f s" % (("%.4g %s" % (worst, unit)).rstrip(), self._worst_at)
        if self._worst_allowed > 0:
            detail += ", beyond %.4g %s that a stop may have moved" % (self._worst_allowed * factor, unit)
        if outside:
            detail += "; %.3g %% of %d samples outside" % (outside, self._count)
        shares = zip((self._rungs * factor).tolist(), (100.0 * self._beyond / self._count).tolist())
        evidence = () if self._envelope else (
            (worst, self._floor * factor), *[rung for rung in shares if rung[1] > 0])
        check = judged(self._aspect, topic, field, worst, limit, unit, detail, self._worst_at, golden, candidate,
                       evidence)
        if check.outcome is Outcome.DIFFERENT and outside <= self._outside_percent:
            return judged(self._aspect, topic, field, outside, self._outside_percent, "% of the samples outside",
                          detail, self._worst_at, golden, candidate, evidence)
        return check


class _Staleness:
    """The time by which a topic's values are older, or newer, than their arm's joints at the same stamps.

    A value that is late by a time d differs from the golden one by d times the golden speed, with the sign of that
    speed: along the path it is right. The least squares over all samples that move give d.
    """

    def __init__(self, arm: str, frame: Frame) -> None:
        self._arm, self._frame = arm, frame
        self._products: Dict[int, Array] = {}

    def take(self, samples: Samples) -> None:
        """Add further samples."""
        few = np.flatnonzero((samples.time * 1e6).astype(np.int64) % _EVERY == 0)  # whatever the windows are
        if not len(few):
            return
        if samples.allowed.any():
            few = few[largest(samples.allowed.take(few, axis=0)) <= 0]
        ahead, behind = (interpolated(samples.golden_time, samples.golden_value, samples.time[few] + step)
                         for step in (_SLOPE_S, -_SLOPE_S))
        speed = (ahead - behind) / (2.0 * _SLOPE_S)
        moving = np.flatnonzero(lengths(speed) > _LEAST_SPEED)
        if not len(moving):
            return
        few, speed = few[moving], speed.take(moving, axis=0)
        off = samples.value.take(few, axis=0) - samples.golden_here.take(few, axis=0)
        motion = self._frame.alignment.motion_numbers(self._arm, samples.time[few])
        parts = np.stack([-row_products(off, speed), row_products(speed, speed), np.ones(len(speed)),
                          row_products(off, off)], axis=1)
        if (motion[1:] < motion[:-1]).any():
            order = np.argsort(motion, kind="stable")
            motion, parts = motion[order], parts[order]
        numbers, begins = np.unique(motion, return_index=True)
        for number, some in zip(numbers.tolist(), np.split(parts, begins[1:])):
            self._products[number] = self._products.get(number, np.zeros(4)) + some.sum(axis=0)

    def checks(self, topic: str, field: str) -> List[Check]:
        """Return the outcome, after all samples; nothing where too little moves."""
        limit = self._frame.tolerances.timing.stale_ms
        total = sum(self._products.values(), np.zeros(4))
        if total[2] < _FEWEST_MOVING:
            return []
        off = _late_ms(total)
        found = [judged(Aspect.LATENESS, topic, field, abs(off), limit, "ms",
                        "values are %.1f ms %s than the joints" % (abs(off), "later" if off > 0 else "sooner"))]
        single = [(_late_ms(some), number) for number, some in self._products.items()
                  if some[2] >= _FEWEST_MOVING]
        if len(single) > 1:
            off, number = max(single, key=lambda one: abs(one[0]))
            episodes = self._frame.alignment.episodes.get(self._arm, ())
            at = episodes[max(number - 1, 0)].start if episodes else None
            found.append(judged(Aspect.LATENESS, topic, " ".join(filter(None, (field, "one motion"))), abs(off),
                                ONE_MOTION * limit, "ms", "values are %.1f ms %s than the joints in one motion"
                                % (abs(off), "later" if off > 0 else "sooner"), at))
        return found


def _late_ms(products: Array) -> float:
    """Return a delay, ms, from sums of off * speed, speed^2, 1 and off^2; 0 where no delay explains what is off."""
    along, power, _, off = products.tolist()
    return s_to_ms(along / power) if along * along >= _EXPLAINED * power * off else 0.0


class MotionWatch:
    """A comparison of one track of the candidate, taken in by windows, with the golden one."""

    def __init__(self, aspect: Aspect, ours: LongTrack, theirs: LongTrack, frame: Frame,
                 convert: Convert = as_they_are) -> None:
        self._aspect, self._ours, self._theirs, self._frame = aspect, ours, theirs, frame
        self._aligned = AlignedSamples(ours, theirs, frame, convert)
        self._staleness: Optional[_Staleness] = None
        self._stale_name = ""
        self._bad = NotNumbers()
        self._is_part = False
        self.before: List[Check] = []

    def take(self, begin: float, end: float) -> None:
        """Read a window of the candidate, which follows the one before."""
        block = self._theirs.between(begin, end)
        good = are_numbers(block.value)
        self._bad.note(block.time)
        if not good.all():
            self._bad.add(block.time[~good], block.value[~good])
        self._take(self._aligned.samples(block, good))

    def _take(self, samples: Optional[Samples]) -> None:
        if samples is not None:
            if self._staleness is not None:
                self._staleness.take(samples)
            self._judge(samples)

    def as_part(self) -> "MotionWatch":
        """Leave to another watch what is about whole samples: when they are there, how late, and what is no number."""
        self._is_part = True
        self._staleness = None
        self.before = []
        return self

    def _watch_lateness(self, field: str = "") -> None:
        self._staleness = _Staleness(arm_of(self._ours.topic, self._frame.arms), self._frame)
        self._stale_name = field

    def _judge(self, samples: Samples) -> None:
        raise NotImplementedError

    def _outcomes(self, residuals: Dict[ResidualKey, Residual]) -> List[Check]:
        raise NotImplementedError

    def checks(self, residuals: Dict[ResidualKey, Residual]) -> List[Check]:
        """Return the outcomes, after all windows."""
        self._take(self._aligned.rest())
        late = [] if self._staleness is None else self._staleness.checks(self._ours.topic, self._stale_name)
        return self.before + self._nan_checks() + _one_if_nothing_common(self._outcomes(residuals)) + late \
            + self._reach_checks()

    def _reach_checks(self) -> List[Check]:
        """Return the check that both tracks have samples at the same times, where they do not."""
        frame, (begin, end) = self._frame, self._frame.common
        if self._is_part:
            return []
        self._aligned.finish()
        slack = frame.tolerances.timing.event_s
        name = self._ours.names[0] if self._aspect is Aspect.FIELDS else self._aspect.value
        near_s = frame.tolerances.streams.gap_s * max(frame.time_scale, 1.0) + frame.jitter_s
        return self._aligned.reach.checks(self._ours.topic, name, (begin + slack, end - slack), frame.duration, near_s)

    def _nan_checks(self) -> List[Check]:
        """Return the checks that the policy for values that are not finite demands."""
        ours, theirs, frame = self._ours, self._theirs, self._frame
        policy = frame.tolerances.nan
        if policy == "ignore" or self._is_part or not has_not_numbers(ours, theirs):
            return []
        bad = NotNumbers()
        for block in ours.blocks():
            good = are_numbers(block.value)
            bad.note(block.time)
            bad.add(block.time[~good], block.value[~good])

        def golden_time(times: Array) -> Array:
            return frame.alignment.golden_time(arm_of(ours.topic, frame.arms), times)

        if policy == "fail":
            wrong, words = golden_time(self._bad.all_times()), "%d samples are not numbers"
        else:
            wrong = bad.beside(self._bad, golden_time, frame.jitter_s + 0.01)
            words = "%d samples are not numbers, or not alike, in one of the logs only"
        return [equal(self._aspect, ours.topic, "NaN", not len(wrong), words % len(wrong),
                      float(wrong.min()) if len(wrong) else None, str(bad.count), str(self._bad.count))]


def _one_if_nothing_common(checks: List[Check]) -> List[Check]:
    """Return only the first check where none of several fields has a sample in common."""
    return checks[:1] if all(check.measured is None for check in checks) else checks


class _NotNumbersWatch(MotionWatch):
    """A watch of what is no number in a track and of how late its samples are; others are about its columns."""

    def __init__(self, aspect: Aspect, ours: LongTrack, theirs: LongTrack, frame: Frame,
                 late: Optional[str] = None, convert: Convert = as_they_are) -> None:
        super().__init__(aspect, ours, theirs, frame, convert)
        if late is not None:
            self._watch_lateness(late)

    def with_checks(self, before: List[Check]) -> "MotionWatch":
        """Take over the checks that were made before all windows."""
        self.before = before
        return self

    def _judge(self, samples: Samples) -> None:
        pass

    def _outcomes(self, residuals: Dict[ResidualKey, Residual]) -> List[Check]:
        return []


class _JointWatch(MotionWatch):
    def __init__(self, ours: LongTrack, theirs: LongTrack, frame: Frame) -> None:
        super().__init__(Aspect.JOINTS, ours, theirs, frame)
        limits = frame.tolerances.joints
        envelopes = [frame.envelope(ours.topic, name) for name in ours.names]
        self._limits = [_least(envelope, limits.per_joint.get(name, limits.position_rad))
                        for name, envelope in zip(ours.names, envelopes)]
        self._judges = [_Judge(Aspect.JOINTS, ours.topic, name, limit, "rad", limits.outside_percent, [name],
                              frame.resolution * limit, 1.0, envelope)
                        for name, limit, envelope in zip(ours.names, self._limits, envelopes)]
        self._watch_lateness()

    def _judge(self, samples: Samples) -> None:
        for column, (judge, limit) in enumerate(zip(self._judges, self._limits)):
            part = samples.columns(slice(column, column + 1))
            judge.take(part.distances(self._frame.resolution * limit), part.allowed[:, 0], part)

    def _outcomes(self, residuals: Dict[ResidualKey, Residual]) -> List[Check]:
        return [judge.check(residuals) for judge in self._judges]


def _angles(chords: Array) -> Array:
    """Return angles, rad, between orientations from the distances of their unit quaternions: 2 sin(angle/4)."""
    angles: Array = 4.0 * np.arcsin(np.minimum(0.5 * chords, np.sin(np.pi / 4.0)))
    return angles


def _turned_alike(samples: Samples) -> Samples:
    """Return quaternions with the sign that is nearer to the golden one: both signs are the same rotation."""
    opposite = np.einsum("ij,ij->i", samples.golden_here, samples.value) < 0
    if not opposite.any():
        return samples
    return samples._replace(value=np.where(opposite[:, None], -samples.value, samples.value),
                            sought=np.where(opposite[:, None], -samples.sought, samples.sought))


class _PoseWatch(MotionWatch):
    def __init__(self, ours: LongTrack, theirs: LongTrack, frame: Frame, halves: slice = slice(None)) -> None:
        super().__init__(Aspect.POSITION, ours, theirs, frame, _with_quaternions)
        self._halves = halves
        limits = frame.tolerances.tcp
        place, turn = frame.envelope(ours.topic, "position"), frame.envelope(ours.topic, "orientation")
        self._limits = (_least(place, mm_to_m(limits.position_mm), m_to_mm(1.0)),
                        _least(turn, limits.orientation_rad))
        self._enough_chord = 0.5 * frame.resolution * self._limits[1]
        self._placed = _Judge(Aspect.POSITION, ours.topic, "position", self._limits[0], "mm", limits.outside_percent,
                              ("x", "y", "z"), frame.resolution * self._limits[0], m_to_mm(1.0), place)
        self._turned = _Judge(Aspect.ORIENTATION, ours.topic, "orientation", self._limits[1], "rad",
                              limits.outside_percent, ("qw", "qx", "qy", "qz"),
                              float(_angles(np.array(self._enough_chord))), 1.0, turn)
        self._watch_lateness()
        if ours.frames or theirs.frames:
            self.before.append(equal(Aspect.POSITION, ours.topic, "frame_id", ours.frames == theirs.frames,
                                     "frame %s" % ", ".join(theirs.frames), None, ", ".join(ours.frames),
                                     ", ".join(theirs.frames)))

    def _judge(self, samples: Samples) -> None:
        placed, turned = samples.columns(slice(0, 3)), samples.columns(slice(3, 7))
        self._placed.take(placed.distances(self._frame.resolution * self._limits[0]), lengths(placed.allowed), placed)
        turned = _turned_alike(turned)
        chord = turned.distances(self._enough_chord)
        self._turned.take(_angles(chord), 2.0 * lengths(turned.allowed), turned)

    def _outcomes(self, residuals: Dict[ResidualKey, Residual]) -> List[Check]:
        judges = [self._placed, self._turned][self._halves]
        return [judge.check(residuals) for judge in judges]


class _FieldWatch(MotionWatch):
    def __init__(self, ours: LongTrack, theirs: LongTrack, name: str, rule: FieldTolerance, frame: Frame) -> None:
        super().__init__(Aspect.FIELDS, ours, theirs, frame)
        self._rule = rule
        envelope = frame.envelope(ours.topic, name) or frame.envelope(ours.topic, name.partition("[")[0])
        self._limit = _least(envelope, rule.absolute)
        self._only = _Judge(Aspect.FIELDS, ours.topic, name, self._limit, "", 0.0, ours.names,
                            frame.resolution * self._limit, 1.0, envelope)

    def _judge(self, samples: Samples) -> None:
        near, rule = samples.golden_here, self._rule
        unwound = samples
        if rule.wraps:
            value = near + np.mod(samples.value - near + np.pi, 2.0 * np.pi) - np.pi
            curve = np.unwrap(samples.curve_value, axis=0)
            unwound = samples._replace(value=value, curve_value=curve, sought=curve[samples.own] + near - value)
        off = np.zeros(len(near))
        for column in range(near.shape[1]):
            distance = unwound.columns(slice(column, column + 1)).distances(
                self._frame.resolution * self._limit)
            off = np.maximum(off, distance - rule.relative * np.abs(near[:, column]))
        self._only.take(off, np.zeros(len(off)), samples)

    def _outcomes(self, residuals: Dict[ResidualKey, Residual]) -> List[Check]:
        return [self._only.check(residuals)]


class _NumbersWatch(MotionWatch):
    """Numbers without a limit of their own: each column has one that follows from its golden values."""

    def __init__(self, ours: LongTrack, theirs: LongTrack, name: str, limits: NumberLimits, frame: Frame) -> None:
        super().__init__(Aspect.FIELDS, ours, theirs, frame, continuous if limits.is_quaternion else as_they_are)
        self._is_quaternion = limits.is_quaternion
        names = [name] if len(limits.limits) == 1 else [
            "%s[%d]" % (name, column) for column in range(len(limits.limits))]
        envelopes = [frame.envelope(ours.topic, part) for part in names]
        self._limits = [_least(envelope, float(limit)) for envelope, limit in zip(envelopes, limits.limits)]
        self._judges = [_Judge(Aspect.FIELDS, ours.topic, part, limit, unit_of(name), 0.0, ours.names,
                               frame.resolution * limit, 1.0, envelope)
                        for part, limit, envelope in zip(names, self._limits, envelopes)]
        if _is_watched_for_lateness(name):
            self._watch_lateness(name)

    def _judge(self, samples: Samples) -> None:
        whole = len(samples.value[0])
        if self._is_quaternion:
            samples = _turned_alike(samples)
        width = whole if self._is_quaternion else 1
        for column, (judge, limit) in enumerate(zip(self._judges, self._limits)):
            part = samples.columns(slice(column, column + width))
            judge.take(part.distances(self._frame.resolution * limit), np.zeros(len(part.time)), part)

    def _outcomes(self, residuals: Dict[ResidualKey, Residual]) -> List[Check]:
        return [judge.check(residuals) for judge in self._judges]


def _is_watched_for_lateness(name: str) -> bool:
    """Return whether numbers move with an arm: not those of a second publisher of joints, such as a gripper."""
    base = base_of(name)
    return is_of_any_speed(base) and (base != "position" or base == name)


def _part(name: str, number: Optional[int], track: LongTrack) -> str:
    """Return the name of one column of a field; without a number that of all."""
    return name if number is None or len(track.names) == 1 else "%s[%d]" % (name, number)


def _watches(aspect: Aspect, ours: LongTrack, theirs: LongTrack, frame: Frame, late: Optional[str],
             watch: Callable[[LongTrack, LongTrack, Optional[int]], MotionWatch]) -> List[MotionWatch]:
    """Return the watch of a track; where some values are no numbers one for each column, and one for the whole.

    Args:
        aspect: Kind of the checks.
        ours: The golden track.
        theirs: The candidate's.
        frame: The context.
        late: Name for the lateness of the whole; None where it is not watched.
        watch: Returns the watch of two tracks, which are all columns or the one of a number.
    """
    if not has_not_numbers(ours, theirs):
        return [watch(ours, theirs, None)]
    found: List[MotionWatch] = [_NotNumbersWatch(aspect, ours, theirs, frame, late)]
    for number, (one, other) in enumerate(zip(columns_of(ours), columns_of(theirs))):
        if min(one.facts.finite_count, other.facts.finite_count) > 0:
            found.append(watch(one, other, number).as_part())
    return found


def _pose_watches(ours: LongTrack, theirs: LongTrack, frame: Frame) -> List[MotionWatch]:
    """Return the watch of a pose; where some values are no numbers those of position, its axes and orientation."""
    whole = _PoseWatch(ours, theirs, frame)
    if not has_not_numbers(ours, theirs):
        return [whole]
    found: List[MotionWatch] = []
    for half, other in enumerate((slice(3, 6), slice(0, 3))):
        one, two = without_columns(ours, other), without_columns(theirs, other)
        if min(one.facts.finite_count, two.facts.finite_count) > 0:
            found.append(_PoseWatch(one, two, frame, slice(half, half + 1)).as_part())
    limit = frame.tolerances.tcp.position_mm
    for axis, one, two in zip("xyz", columns_of(ours), columns_of(theirs)):
        if min(one.facts.finite_count, two.facts.finite_count) > 0:
            found.append(_NumbersWatch(one, two, "position." + axis, NumberLimits(np.array([mm_to_m(limit)]), False),
                                       frame).as_part())
    numbers = _NotNumbersWatch(Aspect.POSITION, ours, theirs, frame, "", _with_quaternions)
    return [numbers.with_checks(whole.before), *found]


def motion_watches(golden: Run, candidate: Run, frame: Frame) -> Tuple[List[Check], List[MotionWatch]]:
    """Return the watches for joints, tool poses and further fields, and the checks of those that cannot be compared.

    Both runs hold only topics that the other has with the same types.
    """
    checks: List[Check] = []
    watches: List[MotionWatch] = []
    for topic, ours in golden.joints.items():
        theirs = candidate.joints.get(topic)
        if theirs is None:
            checks.append(_nothing_common(Aspect.JOINTS, topic))
        elif ours.names != theirs.names:
            checks.append(equal(Aspect.JOINTS, topic, "names", False, "the joints are not the same", None,
                                " ".join(ours.names), " ".join(theirs.names)))
        else:
            watches += _watches(Aspect.JOINTS, ours, theirs, frame, "", lambda one, other, number: _JointWatch(
                one, other, frame))
    for topic, ours in golden.poses.items():
        theirs = candidate.poses.get(topic)
        if theirs is None:
            checks.append(_nothing_common(Aspect.POSITION, topic))
        else:
            watches += _pose_watches(ours, theirs, frame)
    for topic in golden.streams:
        for name in sorted({*golden.fields.get(topic, ()), *candidate.fields.get(topic, ())}):
            _add_field(topic, name, golden, candidate, frame, checks, watches)
    return checks, watches


def _add_field(topic: str, name: str, golden: Run, candidate: Run, frame: Frame, checks: List[Check],
               watches: List[MotionWatch]) -> None:
    """Add the watch of one field of numbers, or the check that it cannot be compared."""
    tolerances = frame.tolerances
    base = base_of(name)
    rule = tolerances.fields.get(topic, {}).get(base)
    if rule is None and (tolerances.ignores_field(topic, name) or tolerances.ignores_field(topic, base)):
        return
    ours, theirs = golden.fields.get(topic, {}).get(name), candidate.fields.get(topic, {}).get(name)
    if ours is None or theirs is None:
        checks.append(equal(Aspect.FIELDS, topic, name, False, "only in the %s" % (
            "candidate" if ours is None else "golden log")))
    elif len(ours.names) != len(theirs.names):
        checks.append(equal(Aspect.FIELDS, topic, name, False, "the candidate has another number of values"))
    elif rule is not None:
        with_rule = rule
        watches += _watches(Aspect.FIELDS, ours, theirs, frame, None, lambda one, other, number: _FieldWatch(
            one, other, _part(name, number, ours), with_rule, frame))
    elif topic in frame.on_change:
        pass  # compared as a sequence
    elif frame.time_scale != 1.0 and not is_of_any_speed(name):
        checks.append(not_compared(Aspect.FIELDS, topic, name, "numbers may change with speed: the candidate ran %g "
                                                               "times faster" % frame.time_scale))
    else:
        whole = number_limits(name, ours, tolerances, False) if not has_not_numbers(ours, theirs) \
            or name.endswith(QUATERNION) else None
        if whole is not None and whole.is_quaternion and max(ours.facts.finite_count, theirs.facts.finite_count) > 0:
            watches.append(_NumbersWatch(ours, theirs, name, whole, frame))
        else:
            late = name if _is_watched_for_lateness(name) else None
            watches += _watches(Aspect.FIELDS, ours, theirs, frame, late, lambda one, other, number: _NumbersWatch(
                one, other, _part(name, number, ours), number_limits(name, one, tolerances, False)
                if whole is None else whole, frame))


def _nothing_common(aspect: Aspect, topic: str) -> Check:
    return equal(aspect, topic, "", False, "no samples in common: the candidate has none while the golden log has")
