"""Reports joints that come near to a soft limit."""
import math
from typing import List, Sequence, Tuple

from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent

NEAR_LIMIT = math.radians(2.0)
"""rad; a joint closer than this to a soft limit is reported as about to hit it. No vendor value exists."""


class LimitWatch:
    """Reports each joint once as it comes near to a soft limit."""

    def __init__(self, model: ArmModel, joints: Sequence[float]) -> None:
        """joints: where the arm stands at first, rad (6,)."""
        self._limits = model.joint_limits
        self._was_near = self.near(joints)

    def near(self, joints: Sequence[float]) -> Tuple[Tuple[int, bool], ...]:
        """Joints near a limit, each with True for the upper one."""
        result = []
        for joint, (q, (low, high)) in enumerate(zip(joints, self._limits)):
            if q > high - NEAR_LIMIT:
                result.append((joint, True))
            elif q < low + NEAR_LIMIT:
                result.append((joint, False))
        return tuple(result)

    def look(self, joints: Sequence[float]) -> List[PlantEvent]:
        """One event for each joint that has come near to a limit since the last call."""
        near = self.near(joints)
        if near == self._was_near:
            return []
        fresh = [events.near_soft_limit(*entry) for entry in near if entry not in self._was_near]
        self._was_near = near
        return fresh
