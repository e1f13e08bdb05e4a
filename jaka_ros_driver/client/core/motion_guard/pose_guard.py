"""The guard of a stream of poses: the driver's own inverse kinematics gives the joints of each target and frame."""
import math
from typing import Callable, Optional, Tuple

from jaka_ros_driver.client.core.motion_guard.frame_guard import FrameGuard, Look, brake_end
from jaka_ros_driver.client.core.motion_guard.tool_frames import ToolFrames
from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import UnreachablePose
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.inverse import inverse
from jaka_ros_driver.kinematics.rotations import pose_from_transform
from jaka_ros_driver.state import Vector

_SAME = 1e-9
"""Distance, m and rad together, up to which two poses are one: rounding."""


class PoseGuard:
    """The guard of one stream of poses, in the branch of the joints in which it begins.

    Attributes:
        frames: The guard of its frames' joints.
    """

    def __init__(self, model: ArmModel, tool_frames: ToolFrames, frames: FrameGuard, look: Look,
                 act: Callable[[Callable[[], str]], str]) -> None:
        """Begin at rest.

        Args:
            model: The arm.
            tool_frames: The active tool and user frame.
            frames: The guard of the frames; it has the joints of the last one.
            look: Looks at a way in joint space.
            act: Returns the trouble that it finds where motions are refused for it; "" where that is only logged.
        """
        self._model, self._tool_frames, self.frames, self._look, self._act = model, tool_frames, frames, look, act
        self._solved: Tuple[Vector, Vector] = ((math.inf,) * JOINT_COUNT, frames.joints)
        """Place, m and rad (6,), and joints, rad (6,), of the last target."""

    def target_trouble(self, pose: Pose, end: Optional[Pose]) -> str:
        """Return in words why the arm must not go from the last frame to this target; "" where it may.

        end: Where the stream would stand behind it if no other target came; None where it can stand at the target.
        """
        here = self.frames.joints
        joints, trouble = self._solve(pose)
        if joints is None:
            return trouble
        self._solved = (*pose.position, *pose.rpy), joints
        if end is None:
            return self._look((here, joints))
        stand, trouble = self._solve(end)
        if stand is None:
            return trouble
        return self._look((here, joints, stand)) or self._look((here, joints, brake_end(here, joints)))

    def joints_of(self, pose: Pose) -> Tuple[Optional[Vector], str]:
        """Return the joints of a frame, rad (6,), None where it is out of reach, and why that ends the stream."""
        if math.dist((*pose.position, *pose.rpy), self._solved[0]) <= _SAME:  # that takes the target up at once
            return self._solved[1], ""
        return self._solve(pose)

    def pose_at(self, joints: Vector) -> Pose:
        """Return the pose of the tool in the user frame at these joints, rad (6,)."""
        return pose_from_transform(self._tool_frames.tool_at(self._model, joints))

    def _solve(self, pose: Pose) -> Tuple[Optional[Vector], str]:
        try:
            return inverse(self._model, self._tool_frames.flange_at(pose), self.frames.joints), ""
        except UnreachablePose as error:
            text = str(error)
            return None, self._act(lambda: text)
