"""The check of the configured model: the controller's pose is compared with the model's, from the same joints."""
import logging
from typing import NamedTuple, Optional

from jaka_ros_driver.client.arm_client import ArmClient
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
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.state import RobotState

_LOG = logging.getLogger(__name__)

POSITION_TOLERANCE = 0.0003
"""Largest difference of position, m, that rounding explains.

Joints and pose of a frame are rounded to 6 digits and may be of two cycles, so they are compared at rest only.
"""
ANGLE_TOLERANCE = 0.001
"""Largest difference of orientation, rad, that rounding explains."""
_CONFIRMATIONS = 2


class Deviation(NamedTuple):
    """Difference of the controller's pose and ours: distance, m, and angle, rad."""

    distance: float
    angle: float

    @property
    def is_wrong(self) -> bool:
        """True where the difference is larger than rounding explains."""
        return self.distance > POSITION_TOLERANCE or self.angle > ANGLE_TOLERANCE


class ModelCheck:
    """The comparison of poses for each state of an arm at rest. A deviation counts when it is seen twice in a row."""

    def __init__(self, arm: ArmClient, frames: FrameReader) -> None:
        self._arm = arm
        self._frames = frames
        self._seen = 0
        self._has_warned = False

    def check(self, state: RobotState) -> Optional[Deviation]:
        """Return the deviation; None where it is not known (motion, frames, pose). Log it once when it counts."""
        found = self._deviation(state)
        if found is None:
            return None
        self._seen = self._seen + 1 if found.is_wrong else 0
        if self._seen < _CONFIRMATIONS:
            return found if not found.is_wrong else None
        if not self._has_warned:
            self._has_warned = True
            _LOG.error("the controller's pose differs from model %s by %.4f m and %.4f rad: is ~model right?",
                       self._arm.model.name, found.distance, found.angle)
        return found

    def _deviation(self, state: RobotState) -> Optional[Deviation]:
        return deviation(self._arm.model, state, self._frames.flange_t_tool(state), self._frames.base_t_user(state))


def deviation(model: ArmModel, state: RobotState, flange_t_tool: Optional[Transform],
              base_t_user: Optional[Transform]) -> Optional[Deviation]:
    """Return how far the controller's pose of the tool is from the model's; None where it is not known, or in motion.

    Args:
        model: The arm.
        state: A state with joints and, in the active user frame, the pose of the active tool.
        flange_t_tool: The active tool in the flange, m; None where it is not known.
        base_t_user: The active user frame in the base, m; None where it is not known.
    """
    if (not state.is_in_position or state.tcp_position is None or state.tcp_rpy is None or flange_t_tool is None
            or base_t_user is None):
        return None
    ours = compose(forward(model, state.joint_position), flange_t_tool)
    theirs = compose(base_t_user, transform_from_pose(Pose(state.tcp_position, state.tcp_rpy)))
    return Deviation(distance_between(ours, theirs), rotation_angle_between(ours, theirs))
