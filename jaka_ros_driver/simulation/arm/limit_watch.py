"""The watch over joints that come near to a soft limit."""
import math
from typing import List, Sequence, Tuple

from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent
from jaka_ros_driver.simulation.arm.frames import ArmFrames

NEAR_LIMIT = math.radians(2.0)
"""Distance, rad, from a soft limit below which a joint is reported as about to hit it. No vendor value exists."""


class LimitWatch:
    """The watch that reports each joint once as it comes near to a soft limit."""

    def __init__(self, frames: ArmFrames, joints: Sequence[float]) -> None:
        """Set up the watch for an arm that stands at these joints, rad (6,)."""
        self._frames = frames
        self._was_near = self.near(joints)

    def near(self, joints: Sequence[float]) -> List[Tuple[int, bool]]:
        """Return the joints near a limit, each with True for the upper one."""
        return self._frames.joints_outside(joints, -NEAR_LIMIT)

    def look(self, joints: Sequence[float]) -> List[PlantEvent]:
        """Return one event for each joint that has come near to a limit since the last call."""
        before, self._was_near = self._was_near, self.near(joints)
        return [events.near_soft_limit(*entry) for entry in self._was_near if entry not in before]
