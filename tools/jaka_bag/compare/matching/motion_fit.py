"""Lag and pace of motions by Gauss-Newton, over all joints at once and for many motions in one pass."""
from dataclasses import dataclass
from typing import List, NamedTuple, Sequence, Tuple, Union

import numpy as np

from ...messages.batch import Array, end_to_end, row_products
from ..runs.run import LongTrack, TimeWindow
from .course import Decision
from .curve_distance import interpolated

_ROUNDS = 10
"""Most steps of the fit, which converges in a few; those that do not are searched for."""
_STEP_S = 0.05
"""Step, s, between the lags of a search: the fit converges from either side of it."""
_LEAST_POWER = 1e-9
"""Sum of squared speeds below which nothing moves, and no lag can be told."""
_KNEE_RAD = 2e-4
"""Least residual, rad, beyond which a sample counts less: that of rounding and noise."""
COMMON_MOTIONS = 60
"""Number of motions of each arm that suffice to find their common lag."""
_LATE_ONE_BY_ONE = 10.0
"""Factor by which the common residual may be larger than that of one motion."""
_MOST_STEP_S = 0.2
"""Largest change, s, of a lag in one step: a longer one leaps over to another motion."""
_FARTHEST_S = _ROUNDS * _MOST_STEP_S + 0.5
"""Largest distance, s, from its first lag that a fit gets to, and some margin: so much of the candidate is kept."""
_NEAR_S = 1.0
"""Distance, s, of two windows below which they are read as one: reading twice costs more than the samples between."""


def speeds(time: Array, value: Array, reach: int) -> Array:
    """Return the rate of change of each column over ``reach`` samples to either side, unit/s; 0 near the ends."""
    result = np.zeros(value.shape)
    if len(time) > 2 * reach:
        span = np.maximum(time[2 * reach:] - time[:-2 * reach], 1e-6)
        result[reach:-reach] = (value[2 * reach:] - value[:-2 * reach]) / span[:, None]
    return result


class Curve:
    """Joint positions, and their speeds, as functions of time, interpolated; samples that are no numbers are left out.

    Args:
        track: Track with the samples.
        windows: Times between which it will be asked for; elsewhere what it gives has no meaning, but that it is held
            at the ends of the track.
        with_speeds: ``at`` is going to be called.
    """

    def __init__(self, track: LongTrack, windows: Sequence[TimeWindow], with_speeds: bool = True) -> None:
        reach = track.facts.reach
        times: List[Array] = []
        pieces: List[Array] = []
        for begin, end in _joined(windows):
            part = track.around(begin, end, reach + 2)
            both = np.hstack([part.value, speeds(part.time, part.value, reach)]) if with_speeds else part.value
            fresh = int(np.searchsorted(part.time, times[-1][-1], "right")) if times and len(times[-1]) else 0
            times.append(part.time[fresh:])
            pieces.append(both[fresh:])
        self.time, self._both = end_to_end(times), end_to_end(pieces)
        self._joints = len(track.names)

    def values_at(self, times: Array) -> Array:
        """Return values alone; see ``at``."""
        joints = self._joints
        values = interpolated(self.time, self._both[:, :joints], times.ravel())
        return values.reshape((*times.shape, joints))

    def at(self, times: Array) -> Tuple[Array, Array]:
        """Return values and speeds, the shape of ``times`` and a last axis for the joints; held at the ends."""
        joints = self._joints
        both = interpolated(self.time, self._both, times.ravel()).reshape(times.shape + (2 * joints,))
        return both[..., :joints], both[..., joints:]


def _joined(windows: Sequence[TimeWindow]) -> List[TimeWindow]:
    """Return the windows in the order of time, with those near each other joined."""
    result: List[TimeWindow] = []
    for begin, end in sorted(windows):
        if result and begin <= result[-1][1] + _NEAR_S:
            result[-1] = (result[-1][0], max(end, result[-1][1]))
        else:
            result.append((begin, end))
    return result


@dataclass(frozen=True)
class Motions:
    """Motions of one arm, sampled evenly.

    Attributes:
        times: Golden times, s, shape (motions, samples).
        values: Golden joints there, rad, shape (motions, samples, joints).
        candidate: The other log's joints.
    """

    times: Array
    values: Array
    candidate: Curve

    @property
    def centre(self) -> Array:
        """Golden time half way, s, shape (motions,)."""
        middle: Array = 0.5 * (self.times[:, 0] + self.times[:, -1])
        return middle

    def some(self, which: Union[Array, slice]) -> "Motions":
        """Return the motions that ``which``, a mask, indices or a slice, picks."""
        return Motions(self.times[which], self.values[which], self.candidate)


class Fits(NamedTuple):
    """The fits of motions, one a row.

    Attributes:
        lag: Candidate time - golden time at the centre, s.
        pace: Candidate duration / golden duration.
        rms: RMS of the residuals, rad.
    """

    lag: Array
    pace: Array
    rms: Array


def sampled(golden: LongTrack, candidate: LongTrack, spans: Sequence[TimeWindow], samples: int, around: Array,
            reach_s: float) -> Motions:
    """Sample motions between golden times (start, end), s; seek the candidate's near the lags ``around``, s."""
    part = np.linspace(0.0, 1.0, samples)
    edges = np.array(spans, float).reshape(-1, 2)
    times = edges[:, :1] + part * (edges[:, 1:] - edges[:, :1])
    # pace and lag change step by step, and no farther than this
    middle, reach = edges.mean(axis=1) + around, (edges[:, 1] - edges[:, 0]) + _FARTHEST_S + reach_s
    there = list(zip((middle - reach).tolist(), (middle + reach).tolist()))
    return Motions(times, Curve(golden, spans, False).values_at(times), Curve(candidate, there))


def _normals(motions: Motions, lag: Array, pace: Array) -> Tuple[Array, Array, Array, Array, Array, Array]:
    """Compute each motion's normal equations of lag and pace, and its mean squared residual, rad^2, shape (n,) each.

    The matrix is [[power, cross], [cross, spread]], the right side [push, twist].
    """
    offset = motions.times - motions.centre[:, None]
    seen, slope = motions.candidate.at((motions.centre + lag)[:, None] + pace[:, None] * offset)
    residual = motions.values - seen
    size = np.sqrt(row_products(residual, residual))
    # Huber: what is far beyond the median counts less
    knee = np.maximum(_KNEE_RAD, 3.0 * np.median(size, axis=1))
    weight = np.minimum(1.0, knee[:, None] / np.maximum(size, 1e-12))
    power = row_products(slope, slope) * weight
    push = row_products(slope, residual) * weight
    return (power.sum(axis=1), (power * offset).sum(axis=1), (power * offset * offset).sum(axis=1), push.sum(axis=1),
            (push * offset).sum(axis=1), (weight * size * size).mean(axis=1) / motions.values.shape[2])


def fit(motions: Motions, lag: Array, with_pace: Array) -> Fits:
    """Fit each motion on its own: the lag, and the pace where asked for; from the given lags, s."""
    lag, pace = lag.astype(float).copy(), np.ones(len(lag))
    square = np.zeros(len(lag))
    active = np.arange(len(lag))
    for _ in range(_ROUNDS):
        power, cross, spread, push, twist, square[active] = _normals(motions.some(active), lag[active], pace[active])
        determinant: Array = power * spread - cross * cross
        both = with_pace[active] & (determinant > 1e-6 * power * spread) & (power > _LEAST_POWER)
        alone = np.where(power > _LEAST_POWER, push / np.maximum(power, _LEAST_POWER), 0.0)
        safe = np.where(both, determinant, 1.0)
        step = np.where(both, (push * spread - twist * cross) / safe, alone)
        turn = np.where(both, (twist * power - push * cross) / safe, 0.0)
        lag[active] += np.clip(step, -_MOST_STEP_S, _MOST_STEP_S)
        pace[active] = np.clip(pace[active] + np.clip(turn, -0.1, 0.1), 0.5, 2.0)
        active = active[(np.abs(step) > 1e-5) | (np.abs(turn) > 1e-5)]
        if not len(active):
            break
    return Fits(lag, pace, np.sqrt(square))


def fit_common(arms: Sequence[Motions], lag: float) -> Tuple[float, float]:
    """Fit one lag for all motions of all arms, from a given one; return it, s, and the RMS of the residuals, rad."""
    square = 0.0
    for _ in range(_ROUNDS):
        power, push = 0.0, 0.0
        squares: List[Array] = []
        for motions in arms:
            count = len(motions.times)
            powers, _, _, pushes, _, remains = _normals(motions, np.full(count, lag), np.ones(count))
            power += float(powers.sum())
            push += float(pushes.sum())
            squares.append(remains)
        square = float(np.concatenate(squares).mean())
        if power < _LEAST_POWER:
            break
        step = min(max(push / power, -_MOST_STEP_S), _MOST_STEP_S)
        lag += step
        if abs(step) < 1e-6:
            break
    return lag, float(np.sqrt(square))


def _costs(motions: Motions, lag: Array) -> Array:
    residual = motions.values - motions.candidate.values_at(motions.times + lag[:, None])
    cost: Array = np.sqrt(row_products(residual, residual)).mean(axis=1)
    return cost


def _best_around(cost_of_lags: Array, lags: Array) -> Array:
    """Return the lag of the least cost in each column, the middle one of equals."""
    biased = cost_of_lags + 1e-9 * np.abs(lags)[:, None]
    best: Array = lags[np.argmin(biased, axis=0)]
    return best


def search(motions: Motions, around: Array, with_pace: Array, reach_s: float, good_fit: Decision) -> Fits:
    """Fit as ``fit`` does; restart a fit worse than ``good_fit``, rad, from the best lag within ``reach_s``."""
    first = fit(motions, around, with_pace)
    is_good = np.abs(first.lag - around) <= reach_s
    is_good[is_good] = good_fit.within(first.rms[is_good])
    poor = np.flatnonzero(~is_good)
    if not len(poor):
        return first
    some = motions.some(poor)
    lags = np.arange(-reach_s, reach_s + 0.5 * _STEP_S, _STEP_S)
    start = around[poor] + _best_around(np.stack([_costs(some, around[poor] + lag) for lag in lags]), lags)
    again = fit(some, start, with_pace[poor])
    outside = np.abs(again.lag - around[poor]) > reach_s + _STEP_S
    again.lag[outside], again.pace[outside] = start[outside], 1.0
    better = (again.rms < first.rms[poor]) | (np.abs(first.lag[poor] - around[poor]) > reach_s)
    for kept, found in zip(first, again):
        kept[poor[better]] = found[better]
    return first


def search_common(arms: Sequence[Motions], around: float, reach_s: float, good_fit: Decision) -> float:
    """Fit as ``fit_common`` does; where the residual is large, restart from the best lag within ``reach_s``.

    Motions may be late one by one, so the residual of each may exceed ``good_fit``, rad.
    """
    lag, rms = fit_common(arms, around)
    if abs(lag - around) <= reach_s and good_fit.within(np.array([rms / _LATE_ONE_BY_ONE])).all():
        return lag
    lags = np.arange(-reach_s, reach_s + 0.5 * _STEP_S, _STEP_S)
    costs = [[sum(float(_costs(m, np.full(len(m.times), around + offset)).sum()) for m in arms)] for offset in lags]
    start = around + float(_best_around(np.array(costs), lags)[0])
    again, again_rms = fit_common(arms, start)
    if abs(again - around) > reach_s + _STEP_S:
        again = start
    return again if again_rms < rms or abs(lag - around) > reach_s else lag
