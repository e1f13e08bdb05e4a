"""The log tools' constants of JAKA drivers: types and numbers in their topics, and ceilings for joints."""
import enum
import math

STATE_TYPE = "jaka_msgs/RobotMsg"
CALL_TYPE = "jaka_msgs/ServiceCall"
DIAGNOSTICS_TYPE = "diagnostic_msgs/DiagnosticArray"
PARAMETERS_NAME = "rosparam.yaml"
"""Name of the attachment with the parameters that a recorder found; of several, the last counts."""

_TRAJECTORY = "trajectory_msgs/JointTrajectory"
_TRAJECTORY_GOAL = "control_msgs/FollowJointTrajectoryActionGoal"
_GOALS = {"follow_joint_trajectory": _TRAJECTORY_GOAL, "joint_trajectory_action": _TRAJECTORY_GOAL,
          "move_path": "jaka_msgs/MovePathActionGoal", "recover": "jaka_msgs/RecoverActionGoal"}
INPUT_TOPICS = {
    "jog_joints": "sensor_msgs/JointState", "jog_twist": "geometry_msgs/TwistStamped",
    "servo_j_command": "sensor_msgs/JointState", "servo_p_command": "geometry_msgs/PoseStamped",
    "command": _TRAJECTORY, "joint_path_command": _TRAJECTORY,
    **{action + "/goal": kind for action, kind in _GOALS.items()},
    **{action + "/cancel": "actionlib_msgs/GoalID" for action in _GOALS}}
"""The ends of the names of the topics that a driver listens to, with their types (docs/ros-interface.md)."""


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
