"""The watch over a motion that the controller plans: one braking distance ahead, by the status feed."""
from collections import deque
from typing import Deque, Sequence, Tuple

from jaka_ros_driver.client.core.motion_guard.frame_guard import Look
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, JOINT_SPEED_CEILING
from jaka_ros_driver.state import RobotState, Vector

_OVER_S = 0.03
"""Time, s, over which the joints' speeds are measured: some frames of the feed, whose intervals differ."""
_REACTION_S = 0.1
"""Time, s, from a place of the arm until a stop that answers it brakes: feed, wire, and the controller's cycles."""
_BRAKE = 0.5 * JOINT_ACCELERATION_CEILING
"""Deceleration, rad/s2, of a stop: no source gives that of a controller; half of what a joint may be asked for."""


class FeedWatch:
    """The watch over one motion."""

    def __init__(self, look: Look) -> None:
        self._look = look
        self._seen: Deque[Tuple[float, Vector]] = deque()

    def trouble(self, state: RobotState) -> str:
        """Return why the arm must be stopped now, in words; "" where it need not."""
        joints, at = state.joint_position, state.received_at
        self._seen.append((at, joints))
        while len(self._seen) > 2 and at - self._seen[1][0] >= _OVER_S:
            self._seen.popleft()
        since, before = self._seen[0]
        if at <= since:
            return ""
        return self._look(way_ahead(joints, [(new - old) / (at - since) for new, old in zip(joints, before)]))


def way_ahead(joints: Vector, speeds: Sequence[float]) -> Tuple[Vector, Vector]:
    """Return the way on which joints, rad (6,), of these speeds, rad/s (6,), come to a stand where they are stopped."""
    # No joint is faster; a feed whose joints jump would have the way of seconds looked at, which takes seconds.
    bounded = [min(max(speed, -JOINT_SPEED_CEILING), JOINT_SPEED_CEILING) for speed in speeds]
    ahead = _REACTION_S + 0.5 * max(map(abs, bounded)) / _BRAKE
    return joints, tuple([q + ahead * speed for q, speed in zip(joints, bounded)])
