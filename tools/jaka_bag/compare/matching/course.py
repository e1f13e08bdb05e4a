"""The decisions by which tolerances steer a comparison's course, and the limits for which it would be the same.

Most tolerances are limits: the amounts that were measured are judged again against other ones. A few decide what is
measured: whether a fit is searched further, which states are brief. Of these a comparison records the values between
which it would have gone the same way.
"""
from typing import Dict, List, Tuple

import numpy as np

from ...messages.batch import Array
from ..tolerances import Tolerances

_LEAST_FIT_RAD = 1e-4
"""Least residual, rad, that is asked of a fit: the noise of positions, which no search removes."""
_CHANGED_BY = {"good_fit": "joints.position_rad", "brief_state": "states.brief_s", "edge_state": "states.timing_s",
               "outer_call": "calls.timing_s"}


def course_limits(tolerances: Tolerances) -> Dict[str, float]:
    """Return the limit of each decision: rad of ``good_fit``, else s."""
    return {"good_fit": max(tolerances.joints.position_rad, _LEAST_FIT_RAD),
            "brief_state": tolerances.states.brief_s,
            "edge_state": max(tolerances.states.brief_s, tolerances.states.timing_s),
            "outer_call": tolerances.calls.timing_s}


class Decision:
    """A repeated decision whether amounts are within a limit.

    Attributes:
        limit: The limit.
        low: The largest amount that was within the limit.
        high: The smallest amount that was not: with every limit from ``low`` up to but without ``high`` all answers are
            the same.
    """

    def __init__(self, limit: float) -> None:
        self.limit = limit
        self.low, self.high = -np.inf, np.inf

    def within(self, amounts: Array) -> Array:
        """Return a mask, bool, of the amounts that are not beyond the limit, of the same shape; NaN is not beyond."""
        beyond: Array = amounts > self.limit
        if beyond.any():
            self.high = min(self.high, float(amounts[beyond].min()))
        if not beyond.all():
            self.low = max(self.low, float(np.nanmax(amounts[~beyond], initial=-np.inf)))
        return ~beyond


class Course:
    """The decisions of one comparison, by name."""

    def __init__(self, tolerances: Tolerances) -> None:
        limits = course_limits(tolerances)
        self.good_fit, self.brief_state, self.edge_state, self.outer_call = (
            Decision(limits[name]) for name in _CHANGED_BY)

    def ranges(self) -> Dict[str, Tuple[float, float]]:
        """Return (from, up to but without) of each decision's limit with which the course is the same."""
        return {name: (decision.low, decision.high) for name, decision in vars(self).items()}


def left_by(ranges: Dict[str, Tuple[float, float]], tolerances: Tolerances) -> List[str]:
    """Return the tolerances, as ``states.brief_s``, that would change the course of a comparison with ``ranges``."""
    return [_CHANGED_BY[name] for name, limit in course_limits(tolerances).items()
            if not ranges[name][0] <= limit < ranges[name][1]]
