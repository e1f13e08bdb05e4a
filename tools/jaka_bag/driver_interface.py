"""The log tools' constants of JAKA drivers: types and numbers in their topics, and ceilings for joints."""
import enum
import math

STATE_TYPE = "jaka_msgs/RobotMsg"
CALL_TYPE = "jaka_msgs/ServiceCall"
DIAGNOSTICS_TYPE = "diagnostic_msgs/DiagnosticArray"


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
