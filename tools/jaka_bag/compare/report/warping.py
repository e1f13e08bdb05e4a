"""Dynamic time warping, for pictures only: one run's lead over the other, moment by moment. Never a verdict."""
from typing import Optional, Tuple

import numpy as np

from ...messages.batch import Array
from ..runs.run import LongTrack

_SAMPLES = 500
"""Moments of the picture: half as many as pixels, as the work grows with them times the band."""
_BAND = 40
"""Number of moments by which one run may lead."""
_STRAY = 0.002
"""Cost of each step off the straight way, in the unit of the values, so that noise at rest draws no curve."""


def warping(golden: LongTrack, candidate: LongTrack, lag: float) -> Optional[Tuple[Array, Array]]:
    """Return golden times and how much later, s, the candidate is at the same place, by warping; None where too short.

    Args:
        golden: The golden track, with as many columns as the candidate.
        candidate: The same joints.
        lag: Delay of the candidate as a whole, s.
    """
    ours, theirs = golden.facts, candidate.facts
    if min(ours.finite_count, theirs.finite_count) < 3:
        return None
    start, end = max(ours.first, theirs.first - lag), min(ours.last, theirs.last - lag)
    if not end > start:
        return None
    grid = np.linspace(start, end, _SAMPLES)
    a, b = golden.at(grid), candidate.at(grid + lag)
    width = 2 * _BAND + 1
    cost = np.full((_SAMPLES, width), np.inf)
    padded = np.full((_SAMPLES + 2 * _BAND, a.shape[1]), np.inf)
    padded[_BAND:_BAND + _SAMPLES] = b
    for i in range(_SAMPLES):
        away = padded[i:i + width] - a[i]
        cost[i] = np.sqrt((away * away).sum(axis=1))
    total = np.full((_SAMPLES, width), np.inf)
    total[0, _BAND:] = np.cumsum(cost[0, _BAND:])
    for i in range(1, _SAMPLES):
        # column k stands for candidate sample i + k - band: the same sample was one column on in the row before
        before = np.minimum(total[i - 1], np.append(total[i - 1, 1:], np.inf) + _STRAY).tolist()
        left, here = np.inf, []
        for reached, price in zip(before, cost[i].tolist()):
            left = min(reached, left + _STRAY) + price
            here.append(left)
        total[i] = here
    late = np.zeros(_SAMPLES)
    i, k = _SAMPLES - 1, _BAND
    while i > 0:
        late[i] = k - _BAND
        choices = [(total[i - 1, k], i - 1, k)]
        if k + 1 < width:
            choices.append((total[i - 1, k + 1] + _STRAY, i - 1, k + 1))
        if k > 0:
            choices.append((total[i, k - 1] + _STRAY, i, k - 1))
        _, i, k = min(choices, key=lambda choice: choice[0])
    return grid, late * (end - start) / (_SAMPLES - 1)
