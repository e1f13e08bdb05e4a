"""The acceleration of a move from the frames of a feed: which S-curve from rest to rest passes through them.

The S-curve is a trapezoid of speed, smoothed over the time in which acceleration builds up; it is what the simulated
arm does with ruckig, and without that time what it does without.
"""
import math
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

SampledCurve = List[Tuple[float, float]]
"""Points of a curve: s, deg."""

SHARES = (0.2, 4.0)
JERK_TIMES = (0.0, 0.2)
"""The ends of what is looked for: acceleration as a share of the asked-for one, and s in which it builds up."""
LEAST_FRAMES = 8
"""Frames of the motion that a fit needs."""
WORST_MISFIT = 0.02
"""Largest mean distance of the frames from the curve, as a share of the way: beyond it the arm moves otherwise."""
_WIDEST_SHARE, _WIDEST_JERK_S = 1.4, 0.06
"""Widest ranges, as a ratio and in s, of values that fit as well: beyond them a value is not settled."""
_LIKELY, _ROUNDING = 8.0, 0.0001
"""Limits of what fits as well: the misfit's logarithm grows by the first over the number of frames at most, the
misfit by the second.
"""
_STEP, _JERK_STEP_S, _HALVINGS = 1.12, 0.01, 6
"""Factor from share to share, and step, s, of the coarse search; halvings of that factor, down to 0.2 %."""
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
        return high <= _WIDEST_SHARE * low and SHARES[0] * 1.02 < low and high < SHARES[1] / 1.02

    @property
    def has_jerk_time(self) -> bool:
        """True where the time in which acceleration builds up is settled."""
        low, high = self.jerk_times
        return self.has_share and high - low <= _WIDEST_JERK_S and high < JERK_TIMES[1] - 0.005


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


def fitted(motions: Sequence[SeenMotion]) -> Optional[Fit]:
    """Return the S-curve that fits frames of motions from rest to rest; None where they are too few, or none fits.

    A slow acceleration shows its share, a fast one the time in which it builds up; each motion begins when it likes.
    """
    prepared: List[Tuple[float, SeenMotion, SampledCurve]] = []
    for motion in motions:
        whole = progress(motion.curve) if len(motion.curve) > 2 else [(0.0, 0.0)]
        points = sorted(moving(whole), key=lambda point: point[1])
        if len(points) < LEAST_FRAMES:
            return None
        prepared.append((whole[-1][1], motion, points))

    def tried(share: float, jerk_time: float) -> float:
        """Return the mean distance of the frames from the best S-curves of these, as a share of the way."""
        found = 0.0
        for way, motion, points in prepared:
            one = SCurve.of(way, motion.speed, share * motion.acceleration, jerk_time)
            passed = times_of(one.at, one.duration, way, [place for _, place in points])
            delay = _delay(points, passed)
            found += sum(abs(place - one.at(at - delay)) for at, place in points) / (len(points) * way)
        return found / len(prepared)

    shares = [SHARES[0] * _STEP ** n for n in range(int(math.log(SHARES[1] / SHARES[0]) / math.log(_STEP)) + 1)]
    jerks = [_JERK_STEP_S * n for n in range(int(round(JERK_TIMES[1] / _JERK_STEP_S)) + 1)]
    rows: List[Tuple[float, float, float]] = []
    for jerk in jerks:  # along the valley: a longer jerk time and a higher share are nearly the same
        low_cost, middle = min((tried(share, jerk), share) for share in shares)
        rows.append((low_cost, middle, jerk))
        ratio = _STEP
        for _ in range(_HALVINGS):
            ratio = ratio ** 0.5
            around = [(tried(middle * change, jerk), middle * change, jerk) for change in (1.0 / ratio, ratio)]
            rows += around
            middle = min(rows[-1], rows[-2], (low_cost, middle, jerk))[1]
            low_cost = min(low_cost, rows[-1][0], rows[-2][0])
    misfit, share, jerk = min(rows)
    if misfit > WORST_MISFIT:
        return None
    worst = misfit * math.exp(_LIKELY / sum(len(points) for _, _, points in prepared)) + _ROUNDING
    near = [row for row in rows if row[0] <= worst]
    return Fit(share, jerk, misfit, (min(row[1] for row in near), max(row[1] for row in near)),
               (min(row[2] for row in near), max(row[2] for row in near)))


def delay_of(motion: SeenMotion, fit: Fit) -> float:
    """Return when a motion began, on its curve's clock, s."""
    whole = progress(motion.curve)
    way = whole[-1][1]
    points = sorted(moving(whole), key=lambda point: point[1])
    one = SCurve.of(way, motion.speed, fit.share * motion.acceleration, fit.jerk_time)
    return _delay(points, times_of(one.at, one.duration, way, [place for _, place in points]))


def _delay(points: Sequence[Tuple[float, float]], passed: Sequence[Tuple[float, float]]) -> float:
    return weighted_median([(at - when, rate) for (at, _), (when, rate) in zip(points, passed)])


def weighted_median(rows: Sequence[Tuple[float, float]]) -> float:
    """Return the value that half of the weights lie below; rows are (value, weight)."""
    ordered = sorted(rows)
    half, seen = 0.5 * sum(weight for _, weight in ordered), 0.0
    for value, weight in ordered:
        seen += weight
        if seen >= half:
            return value
    return ordered[-1][0]
