"""The check of the configured model: the controller's pose is compared with the model's, from the same joints."""
import logging
from typing import Optional

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.kinematics.pose_check import Deviation, deviation
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.state import RobotState

_LOG = logging.getLogger(__name__)

_CONFIRMATIONS = 2
"""Number of states in a row that must deviate: what one alone shows may be damage."""


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
        if not state.is_in_position:
            return None
        return deviation(self._arm.model, state, self._frames.flange_t_tool(state), self._frames.base_t_user(state))
