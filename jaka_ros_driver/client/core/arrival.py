"""Evidence that a planned motion has arrived: the arm's distance from the target, and ``inpos`` as far as it is
reliable.

A controller may set ``inpos`` while the arm still moves, late, or never (docs/controller-protocol.md section 6.2).
Within the tolerance of a target an arm may be held, too, by a pause that the feed does not show, and go on later.
"""
from typing import Optional

from jaka_ros_driver.client.core.stillness import MOVEMENT
from jaka_ros_driver.state import RobotState, Vector

SETTLE_TIME_S = 0.3
"""Stillness, s, beyond the time of rest, after which an arm on its target has arrived, whatever ``inpos`` says.

An arm that rests so long away from its target has been stopped by somebody else.
"""
NO_DISTANCE = 0.03
"""Share of a tolerance within which an arm counts as at its target, moved or not: no way is left to be seen."""
_FALSE_S = 0.15
"""Time, s, for which ``inpos`` must be false while the arm moves to show that it follows the motion, not its
acceptance.
"""


class InPosition:
    """The history of ``inpos`` over one motion that has begun, from frame to frame."""

    def __init__(self) -> None:
        self._false_since: Optional[float] = None
        self._false_until = 0.0
        self._true_at: Optional[Vector] = None
        self._is_early = False

    def observe(self, state: RobotState) -> None:
        """Take a fresh state of the begun motion into account."""
        if not state.is_in_position:
            self._true_at = None
            self._false_until = state.received_at
            if self._false_since is None:
                self._false_since = state.received_at
        elif self._true_at is None:
            self._true_at = state.joint_position
        elif max([abs(a - b) for a, b in zip(self._true_at, state.joint_position)]) > MOVEMENT:
            self._is_early = True

    def shows_the_end(self, state: RobotState) -> bool:
        """Return whether ``inpos`` is true now, was false while the arm moved, and never true while it moved on."""
        return (state.is_in_position and not self._is_early and self._false_since is not None
                and self._false_until - self._false_since >= _FALSE_S)


def has_settled(distance: float, resting: float, rest_time: float, state: RobotState) -> bool:
    """Return whether an arm that has been seen at rest has no way left to go.

    Args:
        distance: How far it is from its target, 1.0 at the tolerance.
        resting: s since it was last seen to move.
        rest_time: s of stillness that show rest.
        state: The newest one.
    """
    return distance <= NO_DISTANCE and (state.is_in_position or resting >= rest_time + SETTLE_TIME_S)
