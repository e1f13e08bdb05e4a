"""The log tools' constants of JAKA drivers: types and numbers in their topics, and ceilings for joints."""
import enum
import math
import struct
from typing import Dict, Tuple

STATE_TYPE = "jaka_msgs/RobotMsg"
CALL_TYPE = "jaka_msgs/ServiceCall"
DIAGNOSTICS_TYPE = "diagnostic_msgs/DiagnosticArray"
PARAMETERS_NAME = "rosparam.yaml"
"""Name of the attachment with the parameters that a recorder found; of several, the last counts."""

_TRAJECTORY = "trajectory_msgs/JointTrajectory"
_TRAJECTORY_GOAL = "control_msgs/FollowJointTrajectoryActionGoal"
_GOALS = {"follow_joint_trajectory": _TRAJECTORY_GOAL, "joint_trajectory_action": _TRAJECTORY_GOAL,
          "gripper_cmd": "control_msgs/GripperCommandActionGoal",
          "move_path": "jaka_msgs/MovePathActionGoal", "recover": "jaka_msgs/RecoverActionGoal"}
INPUT_TOPICS = {
    "jog_joints": "sensor_msgs/JointState", "jog_twist": "geometry_msgs/TwistStamped",
    "servo_j_command": "sensor_msgs/JointState", "servo_p_command": "geometry_msgs/PoseStamped",
    "command": _TRAJECTORY, "joint_path_command": _TRAJECTORY,
    **{action + "/goal": kind for action, kind in _GOALS.items()},
    **{action + "/cancel": "actionlib_msgs/GoalID" for action in _GOALS}}
"""The ends of the names of the topics that a driver listens to, with their types (docs/ros-interface.md)."""


_FRAME = ("mm", "mm", "mm", "rad", "rad", "rad")
_JOINT_ANGLES = ("rad",) * 6
REQUEST_UNITS: Dict[str, Dict[str, Tuple[str, ...]]] = {
    "joint_move": {"pose": _JOINT_ANGLES, "mvvelo": ("rad/s",), "mvacc": ("rad/s2",), "mvradii": ("mm",)},
    "linear_move": {"pose": _FRAME, "mvvelo": ("mm/s",), "mvacc": ("mm/s2",), "mvradii": ("mm",)},
    "servo_j": {"pose": _JOINT_ANGLES}, "set_toolframe": {"pose": _FRAME}, "set_userframe": {"pose": _FRAME},
    "set_payload": {"mass": ("kg",), "xc": ("mm",), "yc": ("mm",), "zc": ("mm",)}}
"""Units of the fields of requests, by the last part of the service's name; of arrays one for each element.

Those that depend on the driver's parameters or on other fields (``servo_p``, ``jog``) are left out.
"""

_SERVO_MOVE_MD5 = "7dad889723cef7fc192c47c7bdf495f2"
_SERVO_MOVE_WITH_SPEED_MD5 = "ea058e08a9ca2790743a486fd4bfb151"


def plain_request(md5sum: str, request: bytes) -> Tuple[str, bytes]:
    """Return md5 and bytes of a request, those of a ServoMove as the definition without ``speed`` has them.

    Clients are built with either definition (docs/interface.md section 5). A ``speed`` that is not empty stays in the
    bytes.
    """
    if md5sum != _SERVO_MOVE_WITH_SPEED_MD5:
        return md5sum, request
    count = struct.unpack_from("<I", request)[0] if len(request) >= 8 else 0
    is_empty = len(request) == 8 + 4 * count and request.endswith(bytes(4))
    return _SERVO_MOVE_MD5, request[:-4] if is_empty else request


class MotionState(enum.IntEnum):
    """``motion_state`` of ``jaka_msgs/RobotMsg`` (docs/interface.md)."""

    STOPPED = 0
    PAUSED = 1
    EMERGENCY_STOP = 2
    RUNNING = 3
    ERROR = 4


JOINTS = tuple("joint_%d" % number for number in range(1, 7))
"""Names of an arm's joints, the base's first (docs/interface.md); some topics have a prefix before them."""
JOINT_SPEED_CEILING = math.pi
"""Joint speed, rad/s, that the driver lets no joint of any model exceed (docs/controller-protocol.md sections 5.2 and
5.6.5)."""
JOINT_ACCELERATION_CEILING = 4.0 * math.pi
"""Joint acceleration, rad/s2, that the driver lets no joint of any model exceed (docs/controller-protocol.md section
5.2)."""
