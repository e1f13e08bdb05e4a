"""The space around the last look at an arm: motions within it need no look of their own."""
import math
from typing import List, Sequence, Tuple

from jaka_ros_driver.clearance.guard import MotionGuard
from jaka_ros_driver.clearance.shape import arm_shape
from jaka_ros_driver.clearance.workspace import Workspace
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.state import Vector


class ClearSpace:
    """The joints around a place that are known to be clear: nothing of the arm moves farther than is clear there.

    A joint that turns by 1 rad moves no point of the arm farther than ``joint_reaches`` says.
    """

    def __init__(self, guard: MotionGuard, reaches: Vector, margin: float) -> None:
        """Set up without a place.

        Args:
            guard: Looks.
            reaches: Of each joint, m/rad (6,).
            margin: Distance that is kept, m.
        """
        self._guard, self._reaches, self._margin = guard, reaches, margin
        self._place: Vector = ()
        self._room = 0.0

    def trouble(self, way: Sequence[Vector]) -> str:
        """Return what a way of straight lines in joint space comes too near to, in words; "" where it is clear.

        way: Joints, rad (6,) each; the first ones are where the arm is. Where it is in trouble there, only what gets
            nearer counts.
        """
        if self._holds(way):
            return ""
        self._place, self._room = way[0], self._guard.nearest(way[0]).distance - self._margin
        if self._holds(way):
            return ""
        found = self._guard.first_trouble(way)
        return "" if found is None else found.reason

    def _holds(self, way: Sequence[Vector]) -> bool:
        return self._room > 0.0 and all(self._is_near(joints) for joints in way)

    def _is_near(self, joints: Vector) -> bool:
        moved = 0.0
        for reach, here, there in zip(self._reaches, self._place, joints):
            moved += reach * abs(there - here)
        return moved < self._room


def joint_reaches(model: ArmModel, workspace: Workspace) -> Vector:
    """Return how far each joint moves any point of arm, tool and payload at most, m/rad (6,)."""
    links = [math.hypot(row.a, row.d) for row in model.dh]
    ends: List[Tuple[int, float]] = [
        (capsule.frame, max(math.hypot(*capsule.start), math.hypot(*capsule.end)) + capsule.radius)
        for capsule in arm_shape(model, workspace.tool).capsules]
    return tuple([max([sum(links[joint:frame]) + beyond for frame, beyond in ends if frame > joint], default=0.0)
                  for joint in range(JOINT_COUNT)])
