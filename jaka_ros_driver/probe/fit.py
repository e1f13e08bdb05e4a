"""The acceleration of a move from the frames of a feed: which S-curve from rest to rest passes through them.

The S-curve is a trapezoid of speed, smoothed over the time in which acceleration builds up; it is what the simulated
arm does with ruckig, and without that time what it does without.
"""
import functools
import math
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

SampledCurve = List[Tuple[float, float]]
"""Points of a curve: s, deg."""

SHARES = (0.15, 5.2)
JERK_TIMES = (0.0, 0.26)
"""The ends of what is looked for: acceleration as a share of the asked-for one, and s in which it builds up.

They lie beyond those of the dimensions, so that an arm at the end of one is settled, too.
"""
LEAST_FRAMES = 8
"""Frames of the motion that a fit needs."""
_LEAST_OF_OTHERS = 3
"""Frames of a motion that adds to others."""
WORST_MISFIT = 0.02
"""Largest mean distance of the frames from the curve, as a share of the way: beyond it the arm moves otherwise."""
_WIDEST_SHARE, _WIDEST_JERK_S = 1.15, 0.04
"""Largest distances, as a ratio and in s, of values that fit as well: beyond them a value is not settled."""
_LIKELY, _ALIKE = 5.0, 0.002
"""Limits of what fits as well: the logarithm of the frames' error grows by the first over the number of those that
move at most, the error by the second.
"""
_AGE_S, _ROUNDING_DEG = 0.004, 0.001
"""Mean age, s, of what a frame shows, half a cycle of the controller, and error, deg, of a frame at rest: where the arm
is slow a frame tells more of its place than where it is fast.
"""
_AT_REST = 2
"""Frames before and after a motion that count, too: they tell when it had not begun yet, and when it was over."""
_FINE, _STRIDES, _JERK_STEP_S = 1.0001, (1024, 512, 256, 128, 64, 32, 16, 8, 4, 2, 1), 0.01
"""Factor from share to share; numbers of such steps in the search, one after the other; step of the other search, s."""
_PLACES = int(math.log(SHARES[1] / SHARES[0]) / math.log(_FINE)) + 1
"""Number of shares that can be found."""
_MOVED = 0.005
"""Share of the way that counts as the beginning and as the end of the motion."""
_TABLE = 100
"""Points of a curve's table, between which it is interpolated: the fit asks for many times, a curve is dear."""


class SCurve(NamedTuple):
    """A motion from rest to rest: way in deg, speed in deg/s, acceleration in deg/s2, jerk_time in s."""

    way: float
    speed: float
    acceleration: float
    jerk_time: float

    @classmethod
    def of(cls, way: float, speed: float, acceleration: float, jerk_time: float) -> "SCurve":
        """Return the motion with these limits; where the speed is reached before the acceleration is, with a lower one.

        Acceleration grows at ``acceleration / jerk_time`` all the same.
        """
        if speed < acceleration * jerk_time:
            jerk_time = math.sqrt(speed * jerk_time / acceleration)
            acceleration = speed / jerk_time
        return cls(way, speed, acceleration, jerk_time)

    @property
    def peak(self) -> float:
        """The speed that is reached, deg/s."""
        across = self.jerk_time + self.speed / self.acceleration
        if across * self.speed <= self.way:
            return self.speed
        half = 0.5 * self.jerk_time * self.acceleration
        return math.sqrt(half * half + self.way * self.acceleration) - half

    @property
    def duration(self) -> float:
        """The time from rest to rest, s."""
        return self.way / self.peak + self.peak / self.acceleration + self.jerk_time

    def at(self, seconds: float) -> float:
        """Return the way that is covered so long after the beginning, deg."""
        peak, jerk = self.peak, self.jerk_time
        if jerk < 1e-6:
            return self._plain(seconds, peak)
        return (self._sum(seconds, peak) - self._sum(seconds - jerk, peak)) / jerk

    def rate(self, seconds: float) -> float:
        """Return the speed so long after the beginning, deg/s."""
        peak, span = self.peak, max(self.jerk_time, 1e-6)
        return (self._plain(seconds, peak) - self._plain(seconds - span, peak)) / span

    def _plain(self, seconds: float, peak: float) -> float:
        """Return the way of the trapezoid alone, deg."""
        rise, total = peak / self.acceleration, self.way / peak + peak / self.acceleration
        if seconds <= 0.0:
            return 0.0
        if seconds >= total:
            return self.way
        left = total - seconds
        if seconds < rise:
            return 0.5 * self.acceleration * seconds * seconds
        if left < rise:
            return self.way - 0.5 * self.acceleration * left * left
        return peak * (seconds - 0.5 * rise)

    def _sum(self, seconds: float, peak: float) -> float:
        """Return the integral of ``_plain``, deg s."""
        rise, total = peak / self.acceleration, self.way / peak + peak / self.acceleration
        if seconds <= 0.0:
            return 0.0
        first = min(seconds, rise)
        found = self.acceleration * first ** 3 / 6.0
        if seconds > rise:
            flat = min(seconds, total - rise) - rise
            found += 0.5 * peak * rise * flat + 0.5 * peak * flat * flat
        if seconds > total - rise:
            last = min(seconds, total) - (total - rise)
            before = self.way - 0.5 * peak * rise
            found += before * last + 0.5 * peak * last * last - self.acceleration * last ** 3 / 6.0
        return found + (self.way * (seconds - total) if seconds > total else 0.0)


class SeenMotion(NamedTuple):
    """One motion from rest to rest as a feed showed it, all frames from before to after it, and what was asked for.

    Attributes:
        curve: s, deg.
        speed: deg/s.
        acceleration: deg/s2.
    """

    curve: Sequence[Tuple[float, float]]
    speed: float
    acceleration: float


class Fit(NamedTuple):
    """The S-curve that is nearest to frames, and those that are about as near.

    Attributes:
        share: Acceleration, as a share of the asked-for one.
        jerk_time: s.
        misfit: Mean distance of the frames from it, as a share of the way.
        shares: Least and greatest share of those that fit as well.
        jerk_times: The same for the time in which it builds up.
    """

    share: float
    jerk_time: float
    misfit: float
    shares: Tuple[float, float]
    jerk_times: Tuple[float, float]

    @property
    def has_share(self) -> bool:
        """True where the share is settled."""
        low, high = self.shares
        return (max(high / self.share, self.share / low) <= _WIDEST_SHARE
                and SHARES[0] * 1.02 < low and high < SHARES[1] / 1.02)

    @property
    def has_jerk_time(self) -> bool:
        """True where the time in which acceleration builds up is settled."""
        low, high = self.jerk_times
        return (self.has_share and max(high - self.jerk_time, self.jerk_time - low) <= _WIDEST_JERK_S
                and high < JERK_TIMES[1] - 0.005)


class _Tried(NamedTuple):
    """The distance of frames from the best S-curves of one share and jerk time: in errors of a frame, and in ways."""

    error: float
    share: float
    jerk_time: float
    misfit: float


def progress(curve: Sequence[Tuple[float, float]]) -> SampledCurve:
    """Return a curve as the distance from its first place, deg, which only grows."""
    first, last = curve[0][1], curve[-1][1]
    sign = 1.0 if last >= first else -1.0
    return [(at, sign * (place - first)) for at, place in curve]


def moving(curve: Sequence[Tuple[float, float]]) -> SampledCurve:
    """Return the points of a progress that lie between its rests."""
    way = curve[-1][1]
    return [(at, place) for at, place in curve if _MOVED * way < place < (1.0 - _MOVED) * way]


def times_of(at: Callable[[float], float], duration: float, way: float,
             places: Sequence[float]) -> List[Tuple[float, float]]:
    """Return when a motion passes each place, and how fast it is there: s, deg/s.

    Args:
        at: The motion's place by its time; it only grows.
        duration: s.
        way: Its length, deg.
        places: deg.
    """
    step = duration / _TABLE
    table = [at(n * step) for n in range(_TABLE + 1)]
    found, n = [], 0
    for place in sorted(places):
        place = min(max(place, 0.0), way)
        while n < _TABLE - 1 and table[n + 1] < place:
            n += 1
        rate = (table[n + 1] - table[n]) / step
        found.append((n * step + ((place - table[n]) / rate if rate > 0.0 else 0.0), rate))
    return found


def fitted(motions: Sequence[SeenMotion], others: Sequence[SeenMotion] = ()) -> Optional[Fit]:
    """Return the S-curve that fits frames of motions from rest to rest; None where they are too few, or none fits.

    A slow acceleration shows its share, a fast one the time in which it builds up; each motion begins when it likes.
    Others count where enough frames show them.
    """
    seen = [_Frames.of(motion) for motion in (*motions, *others)]
    if any(len(one.points) < LEAST_FRAMES for one in seen[:len(motions)]):
        return None
    seen = [one for one in seen if len(one.points) >= _LEAST_OF_OTHERS]
    total = sum(len(one.frames) for one in seen)
    telling = sum(len(one.points) - 1 for one in seen)  # one is spent on when a motion began

    @functools.lru_cache(maxsize=None)
    def tried(place: int, jerk_time: float) -> _Tried:
        share, errors, ways = SHARES[0] * _FINE ** place, 0.0, 0.0
        for one in seen:
            curve = one.curve(share, jerk_time)
            delay = one.delay(curve)
            for at, there in one.frames:
                distance = abs(there - curve.at(at - delay))
                errors += distance / _error(curve.rate(at - delay))
                ways += distance / curve.way
        return _Tried(errors / total, share, jerk_time, ways / total)

    best = 0
    rows: List[_Tried] = []
    for jerk in [_JERK_STEP_S * n for n in range(int(round(JERK_TIMES[1] / _JERK_STEP_S)) + 1)]:
        if not rows:
            best = min(range(0, _PLACES, _STRIDES[0]), key=lambda place: tried(place, jerk))
        for stride in _STRIDES:  # along the valley: a longer jerk time and a higher share are nearly the same
            while True:
                around = [place for place in (best, best - stride, best + stride) if 0 <= place < _PLACES]
                rows += [tried(place, jerk) for place in around]
                nearest = min(around, key=lambda place: tried(place, jerk))
                if nearest == best:
                    break
                best = nearest
    found = min(rows)
    if found.misfit > WORST_MISFIT:
        return None
    near = [row for row in rows if row.error <= found.error * math.exp(_LIKELY / telling) + _ALIKE]
    shares, jerk_times = [row.share for row in near], [row.jerk_time for row in near]
    return Fit(found.share, found.jerk_time, found.misfit, (min(shares), max(shares)),
               (min(jerk_times), max(jerk_times)))


def delay_of(motion: SeenMotion, fit: Fit) -> float:
    """Return when a motion began, on its curve's clock, s."""
    one = _Frames.of(motion)
    return one.delay(one.curve(fit.share, fit.jerk_time))


class _Frames(NamedTuple):
    """The frames of one motion: those that move by their place, and with those around them by their time."""

    motion: SeenMotion
    way: float
    points: SampledCurve
    frames: SampledCurve

    @classmethod
    def of(cls, motion: SeenMotion) -> "_Frames":
        whole = progress(motion.curve) if len(motion.curve) > 2 else [(0.0, 0.0)]
        points = moving(whole)
        first, last = (whole.index(points[0]), whole.index(points[-1])) if points else (0, 0)
        return cls(motion, whole[-1][1], sorted(points, key=lambda point: point[1]),
                   whole[max(0, first - _AT_REST):last + 1 + _AT_REST])

    def curve(self, share: float, jerk_time: float) -> SCurve:
        return SCurve.of(self.way, self.motion.speed, share * self.motion.acceleration, jerk_time)

    def delay(self, curve: SCurve) -> float:
        """Return when the motion began if this is its curve, s."""
        passed = times_of(curve.at, curve.duration, self.way, [place for _, place in self.points])
        return weighted_median([(at - when, rate / _error(rate))
                                for (at, _), (when, rate) in zip(self.points, passed)])


def _error(rate: float) -> float:
    """Return the error, deg, of a frame that shows an arm of this speed, deg/s."""
    return rate * _AGE_S + _ROUNDING_DEG


def weighted_median(rows: Sequence[Tuple[float, float]]) -> float:
    """Return the value that half of the weights lie below; rows are (value, weight)."""
    ordered = sorted(rows)
    half, seen = 0.5 * sum(weight for _, weight in ordered), 0.0
    for value, weight in ordered:
        seen += weight
        if seen >= half:
            return value
    return ordered[-1][0]
