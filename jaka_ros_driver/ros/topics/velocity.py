"""The joint velocity computed from joint positions, for controllers that do not report it."""
from collections import deque
from typing import Deque, List, Optional, Tuple

from jaka_ros_driver.state import RobotState, Vector

_WINDOW = 8
"""Samples whose slope is the velocity, 64 ms at 125 Hz: with more it is smoother, and later."""
_TIMING_WINDOW = 32
"""Arrivals whose mean interval is the time of a sample: single ones jitter."""
_GAP_S = 0.1
"""Gap, s, between samples after which the estimate begins anew."""


class VelocityEstimate:
    """The slope of the least-squares line through the last 8 samples: a filtered difference, about 30 ms late at 125
    Hz.

    Samples are assumed to be equidistant, with the mean interval of the last 32: arrival times jitter, the controller's
    cycle does not.
    """

    def __init__(self) -> None:
        self._positions: Deque[Vector] = deque(maxlen=_WINDOW)
        self._arrivals: Deque[float] = deque(maxlen=_TIMING_WINDOW)

    def add(self, state: RobotState) -> None:
        """Add the next sample."""
        if self._arrivals and state.received_at - self._arrivals[-1] > _GAP_S:
            self._positions.clear()
            self._arrivals.clear()
        self._positions.append(state.joint_position)
        self._arrivals.append(state.received_at)

    def value(self) -> Optional[Vector]:
        """Return the velocity at the newest sample, rad/s, shape (6,); None until there are enough samples."""
        if len(self._positions) < _WINDOW:
            return None
        interval = (self._arrivals[-1] - self._arrivals[0]) / (len(self._arrivals) - 1)
        return tuple(_slope(values) / interval for values in zip(*self._positions))


def _slope(values: Tuple[float, ...]) -> float:
    return sum(weight * (value - values[0]) for weight, value in zip(_WEIGHTS, values))


def _weights() -> List[float]:
    offsets = [n - (_WINDOW - 1) / 2.0 for n in range(_WINDOW)]
    return [offset / sum(o * o for o in offsets) for offset in offsets]


_WEIGHTS = _weights()
