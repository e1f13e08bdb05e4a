"""The active tool and user frame, as the status feed and the controller's tables show them.

Joints and tool pose of one frame of the feed give the product of the two. So where one of them is the identity (id 0)
the other one follows; where both are set, the tool comes from the controller's table.
"""
import math
from typing import NamedTuple, Optional, Sequence

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    Transform,
    compose,
    invert,
    rotation_angle_between,
    transform_from_pose,
)
from jaka_ros_driver.state import RobotState, Vector

_FARTHEST_TOOL = 1.0
"""Longest tool, m: what seems to be longer is an arm that the model does not fit."""
_SAME_PLACE_M, _SAME_TURN = 0.01, 0.05
"""Largest distance, m, and turn, rad, between model and controller, of an arm without tool and user frame: calibrated
arms differ by some mm from their model.
"""


class ToolFrames(NamedTuple):
    """The frames in which a controller takes the poses of moves.

    Attributes:
        base_t_user: The active user frame.
        flange_t_tool: The active tool.
    """

    base_t_user: Transform
    flange_t_tool: Transform

    def flange_at(self, pose: Pose) -> Transform:
        """Return ``base_t_flange`` where the tool is at this pose in the user frame."""
        return self.flange_of(transform_from_pose(pose))

    def flange_of(self, user_t_tool: Transform) -> Transform:
        """Return ``base_t_flange`` where the tool is there in the user frame."""
        return compose(compose(self.base_t_user, user_t_tool), invert(self.flange_t_tool))

    def tool_at(self, model: ArmModel, joints: Vector) -> Transform:
        """Return ``user_t_tool`` at these joints, rad (6,)."""
        return compose(invert(self.base_t_user), compose(forward(model, joints), self.flange_t_tool))


def tool_frames(model: ArmModel, state: RobotState, tools: Optional[Sequence[Transform]]) -> Optional[ToolFrames]:
    """Return the active frames of an arm at rest; None where they are not known.

    Args:
        model: The arm.
        state: At rest, so that joints and pose belong together.
        tools: ``flange_t_tool`` by tool id; None where the controller's table was not read.
    """
    if state.tcp_position is None or state.tcp_rpy is None or state.tool_id is None or state.user_frame_id is None:
        return None
    base_t_flange = forward(model, state.joint_position)
    user_t_tool = transform_from_pose(Pose(state.tcp_position, state.tcp_rpy))
    if state.user_frame_id == 0 and state.tool_id != 0:
        flange_t_tool = compose(invert(base_t_flange), user_t_tool)
        return ToolFrames(IDENTITY, flange_t_tool) if math.hypot(*flange_t_tool[9:]) <= _FARTHEST_TOOL else None
    if state.tool_id == 0:
        flange_t_tool = IDENTITY
    elif tools is not None and 0 < state.tool_id < len(tools):
        flange_t_tool = tools[state.tool_id]
    else:
        return None
    base_t_user = compose(compose(base_t_flange, flange_t_tool), invert(user_t_tool))
    if state.user_frame_id == 0 and (math.hypot(*base_t_user[9:]) > _SAME_PLACE_M
                                     or rotation_angle_between(base_t_user, IDENTITY) > _SAME_TURN):
        return None
    return ToolFrames(base_t_user, flange_t_tool)
