"""The names and limits that the driver has for an arm, against which a configuration is read."""
import math
import re
from dataclasses import dataclass
from typing import List, Optional, Sequence, Tuple

from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, JOINT_SPEED_CEILING

ACTION = "follow_joint_trajectory"
"""The action's name below the controller's (docs/trajectories.md)."""
LIMIT_SLACK_RAD = 0.01
"""Excess of a position limit that is worth a word only: rounded values such as 4.628 for 265 deg."""
SLACK = 1.001
"""Share by which a speed or an acceleration, such as 3.142 for 180 deg/s, may exceed the limit by its rounding."""
_MODEL = re.compile(r"(?i)(?<![a-z])jaka[ _-]?((?:zu|pro|c|s|a|minicobo)[ _-]?\d{0,2})(?![a-z0-9])")


@dataclass(frozen=True)
class Expected:
    """The names and limits that the driver expects.

    Attributes:
        model: The arm's model.
        controller: The action's namespace, ``~trajectory_controller`` of the driver.
        prefix: ``~frame_prefix`` of the driver.
    """

    model: ArmModel
    controller: str
    prefix: str = ""

    @property
    def joints(self) -> Tuple[str, ...]:
        """The driver's joint names, joint 1 first."""
        return tuple(self.prefix + joint for joint in JOINTS)

    def top_speed(self, index: int) -> float:
        """Return the highest speed, rad/s, that a trajectory may have for the joint of this index, from 0."""
        return min(self.model.joint_max_speed[index], JOINT_SPEED_CEILING)

    @property
    def top_acceleration(self) -> float:
        """The highest acceleration, rad/s2, that a trajectory may have."""
        return JOINT_ACCELERATION_CEILING

    def position_excess(self, index: int, low: float, high: float) -> float:
        """Return how far, rad, a joint's range exceeds the model's; 0 or less where it does not."""
        lowest, highest = self.model.joint_limits[index]
        return max(lowest - low, high - highest)

    def unlike(self, name: str) -> Optional[str]:
        """Return the driver's joint that another name is meant for, as ``joint_2`` for ``Joint2``; None for others."""
        if name in self.joints:
            return None
        found = re.fullmatch(r"(?i)(?:(?:arm|robot|jaka)_?)?(?:joint|j)[ _-]?([1-6])", name)
        return self.joints[int(found.group(1)) - 1] if found else None


def default_controller(model: ArmModel) -> str:
    """Return the driver's ``~trajectory_controller`` where it is not set."""
    return "jaka_%s_controller" % re.sub(r"[^A-Za-z0-9_]", "_", model.name)


def common_prefix(names: Sequence[str]) -> Optional[str]:
    """Return the text before ``joint_1`` .. ``joint_6`` where these six names have one and the same; else None."""
    prefix = min(names, default="")[:-len(JOINTS[0])]
    return prefix if sorted(names) == [prefix + joint for joint in JOINTS] else None


def models_in(text: str) -> List[str]:
    """Return the models that a name speaks of, as ``zu7`` for ``jaka_zu7_moveit_config``."""
    return [re.sub(r"[ _-]", "", found).lower() for found in _MODEL.findall(text)]


def degrees(angle: float) -> str:
    """Return an angle, or its rate, rad, in degrees for people."""
    return "%.4g" % math.degrees(angle)
