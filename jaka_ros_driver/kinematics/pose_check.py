"""The comparison of the controller's pose of the tool with a model's, from the same joints."""
from typing import NamedTuple, Optional

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import (
    Transform,
    compose,
    distance_between,
    rotation_angle_between,
    transform_from_pose,
)
from jaka_ros_driver.state import RobotState

POSITION_TOLERANCE = 0.0003
"""Largest difference of position, m, that rounding explains.

Joints and pose of a frame are rounded to 6 digits and may be of two cycles, so they are compared at rest only.
"""
ANGLE_TOLERANCE = 0.001
"""Largest difference of orientation, rad, that rounding explains."""


class Deviation(NamedTuple):
    """Difference of the controller's pose and ours: distance, m, and angle, rad."""

    distance: float
    angle: float

    @property
    def is_wrong(self) -> bool:
        """True where the difference is larger than rounding explains."""
        return self.distance > POSITION_TOLERANCE or self.angle > ANGLE_TOLERANCE


def deviation(model: ArmModel, state: RobotState, flange_t_tool: Optional[Transform],
              base_t_user: Optional[Transform]) -> Optional[Deviation]:
    """Return how far the controller's pose of the tool is from the model's; None where it is not known.

    It means something for an arm at rest alone, which the caller has seen.

    Args:
        model: The arm.
        state: A state with joints and, in the active user frame, the pose of the active tool.
        flange_t_tool: The active tool in the flange, m; None where it is not known.
        base_t_user: The active user frame in the base, m; None where it is not known.
    """
    if state.tcp_position is None or state.tcp_rpy is None or flange_t_tool is None or base_t_user is None:
        return None
    ours = compose(forward(model, state.joint_position), flange_t_tool)
    theirs = compose(base_t_user, transform_from_pose(Pose(state.tcp_position, state.tcp_rpy)))
    return Deviation(distance_between(ours, theirs), rotation_angle_between(ours, theirs))
