"""Trends of amounts from run to run: a robust slope with its uncertainty, and the run from which on they change."""
import math
from typing import NamedTuple, Optional

import numpy as np

from jaka_bag.messages.batch import Array

_MOST_POINTS = 600
"""More points are taken together in medians: slopes are made of all pairs."""
_Z_95 = 1.959964
"""Quantile of the normal distribution for a two-sided confidence of 95 %."""
_MAD_TO_SIGMA = 1.4826
"""Standard deviation / median absolute deviation of a normal distribution."""
_FEWEST = 8
"""Fewest runs in which a change is looked for: ``_END`` behind it, and some more before, to know the noise."""
_REACH = 4
"""An outlier is seen among so many neighbours to either side."""
_OUTLIER_SIGMA = 4.0
"""Standard deviations beyond which a value is an outlier: of good ones 1 of 16,000 is."""
_SURE = 10.0
"""Margin by which the Bayesian information criterion must be better for a change than for none."""
_CHANGE_SIGMA = 4.0
"""Least change, in standard deviations of the noise, that is worth telling; a smaller one may be sure, and means
nothing."""
_ROUNDING = 1e-9
"""Change, as a share of the mean, that is rounding of floats."""
_END = 3
"""Number of runs up to which a change cannot be distinguished from outliers."""


class Slope(NamedTuple):
    """A slope by Theil and Sen: the median of the slopes of all pairs of points.

    Attributes:
        value: Change of y for a change of x by 1.
        low: Lower end of the interval that holds it with 95 % confidence, by the distribution of Kendall's statistic,
        high: and its upper end. Both hold for points whose errors are independent.
    """

    value: float
    low: float
    high: float

    @property
    def is_sure(self) -> bool:
        """True if 0 is outside of the interval."""
        return self.low > 0 or self.high < 0


def theil_sen(x: Array, y: Array) -> Optional[Slope]:
    """Estimate the slope of points, shape (n,), as Theil and Sen do; None for less than four."""
    if len(x) < 4:
        return None
    if len(x) > _MOST_POINTS:
        size = len(x) // _MOST_POINTS // 2 * 2 + 3  # odd: the median of two values is their mean
        groups = np.array_split(np.arange(len(x)), len(x) // size)
        x, y = (np.array([np.median(values[group]) for group in groups]) for values in (x, y))
    one, other = np.triu_indices(len(x), 1)
    run = x[other] - x[one]
    slopes = np.sort(((y[other] - y[one])[run != 0]) / run[run != 0])
    if not len(slopes):
        return None
    n, count = len(x), len(slopes)
    spread = _Z_95 * math.sqrt(n * (n - 1) * (2 * n + 5) / 18.0)
    low, high = int((count - spread) / 2.0), int(math.ceil((count + spread) / 2.0))
    return Slope(float(np.median(slopes)), float(slopes[max(low, 0)]), float(slopes[min(high, count - 1)]))


class ChangePoint(NamedTuple):
    """A change of level: from one point on values are other than before.

    Attributes:
        first: Number of the point, from 0.
        is_gradual: They grow or fall from there on; else they jump and stay.
        before: The level before.
        size: Height of the last value above it, as fitted.
        noise: Standard deviation from point to point, robust.
    """

    first: int
    is_gradual: bool
    before: float
    size: float
    noise: float


def without_outliers(values: Array) -> Array:
    """Replace single values far from their neighbours by the neighbours' median (Hampel)."""
    if len(values) <= 2 * _REACH:
        return values
    around = np.arange(_REACH, len(values) - _REACH)[:, None] + np.arange(-_REACH, _REACH + 1)
    ends = [values[max(i - _REACH, 0):i + _REACH + 1] for i in range(len(values))
            if not _REACH <= i < len(values) - _REACH]
    near = values[around]
    medians = np.median(near, axis=1)
    spreads = np.median(np.abs(near - medians[:, None]), axis=1)
    end_medians = np.array([np.median(end) for end in ends])
    end_spreads = np.array([np.median(np.abs(end - middle)) for end, middle in zip(ends, end_medians)])
    medians = np.concatenate([end_medians[:_REACH], medians, end_medians[_REACH:]])
    spreads = np.concatenate([end_spreads[:_REACH], spreads, end_spreads[_REACH:]])
    is_outlier = np.abs(values - medians) > _OUTLIER_SIGMA * _MAD_TO_SIGMA * spreads
    result: Array = np.where(is_outlier, medians, values)
    return result


def noise_of(values: Array) -> float:
    """Estimate the standard deviation of values that may drift slowly, from the steps between neighbours, robust."""
    steps = np.diff(values)
    spread = _MAD_TO_SIGMA * float(np.median(np.abs(steps - np.median(steps))))
    return (spread or float(np.std(steps))) / math.sqrt(2.0)


def find_change(values: Array, least: float = 0.0) -> Optional[ChangePoint]:
    """Find the point from which on values change, as a ramp or a jump, whichever fits better; None if none is sure.

    Args:
        values: Finite, in the order of time, shape (n,).
        least: A smaller change is none.
    """
    n = len(values)
    if n < _FEWEST:
        return None
    y = without_outliers(values)
    noise = noise_of(y)
    number = np.arange(n)
    mean = float(y.mean())
    flat = float(((y - mean) ** 2).sum())
    from_k = np.cumsum((y - mean)[::-1])[::-1]
    weighted_from_k = np.cumsum((number * (y - mean))[::-1])[::-1]
    first = np.arange(1, n - _END + 1)
    length = (n - first).astype(float)
    # least squares of y = level + size * shape; shape is 0 before the point, and behind it 1, or 1, 2, 3 and so on
    ramp_sum, ramp_square = length * (length + 1) / 2, length * (length + 1) * (2 * length + 1) / 6
    fits = []
    for is_gradual, total, square, product in (
            (False, length, length, from_k[first]),
            (True, ramp_sum, ramp_square, weighted_from_k[first] - (first - 1) * from_k[first])):
        power = square - total * total / n
        gain = product * product / power
        best = int(np.argmax(gain))
        size = float(product[best] / power[best])
        fits.append((float(gain[best]), is_gradual, int(first[best]), mean - size * float(total[best]) / n,
                     size * (float(length[best]) if is_gradual else 1.0)))
    gain, is_gradual, begin, before, size = max(fits)
    rest = max(flat - gain, 1e-6 * flat, 1e-300)
    is_sure = n * math.log(max(flat, 1e-300) / rest) > 2.0 * math.log(n) + _SURE
    if not is_sure or abs(size) <= max(_CHANGE_SIGMA * noise, least, _ROUNDING * abs(mean)):
        return None
    return ChangePoint(begin, is_gradual, before, size, noise)
