"""Checks the numbers of a move, fills in defaults, and lowers speeds and accelerations to what the arm can do."""
import math
from typing import Optional

from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import Transform, distance_between, rotation_angle_between
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.arm_frames import SAME_ANGLE, ArmFrames
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.legs import Pace
from jaka_ros_driver.state import Vector

SLOWEST = 1e-9
"""m/s, rad/s, m/s2, rad/s2; smaller values count as 0."""
FASTEST = 100.0
"""m/s, rad/s; Cartesian speeds above this are lowered to it. The arm's own limits are far below."""
STRONGEST = 1e4
"""rad/s2; the same for rotation accelerations."""
DEFAULT_JOINT_ACCELERATION = math.pi
"""rad/s2, where a joint move names none (docs/controller-protocol.md section 2). No vendor value exists."""
DEFAULT_TCP_ACCELERATION = 0.5
"""m/s2, where a linear move names none. No vendor value exists."""
DEFAULT_ROTATION_SPEED = 3.14
"""rad/s: what the SDK sends where its caller names none (docs/sdk-client.md section 8)."""
DEFAULT_ROTATION_ACCELERATION = 12.56
"""rad/s2: as DEFAULT_ROTATION_SPEED."""

SAME_PLACE = 1e-6
"""m; a target closer than this to the end of the queue counts as the same place."""

_TOOL_RATE_PIECE = 0.1  # rad; step of the joint with the longest way between two samples
_TOOL_RATE_MARGIN = 1.02  # between two samples the tool can be slightly faster than their distance tells


def positive(what: str, value: Optional[float], default: float) -> float:
    """The value, or the default for None; raises TargetRejected unless it is finite and at least SLOWEST (0x0F0010)."""
    if value is None:
        return default
    if not math.isfinite(value) or value < SLOWEST:
        raise TargetRejected(events.BAD_SPEED, "%s must be finite and above 0" % what)
    return value


def tool_pace(model: ArmModel, speed: float, acceleration: Optional[float], rotation_speed: Optional[float],
              rotation_acceleration: Optional[float]) -> Pace:
    """A move's pace, cut to what the model's tool can do; m/s, m/s2, rad/s, rad/s2; raises as ``positive``."""
    top = FASTEST if model.tcp_max_speed is None else model.tcp_max_speed
    strongest = model.tcp_max_acceleration
    return Pace(
        min(positive("speed", speed, 0.0), top),
        min(positive("acceleration", acceleration, DEFAULT_TCP_ACCELERATION), strongest),
        min(positive("rotation speed", rotation_speed, DEFAULT_ROTATION_SPEED), FASTEST),
        min(positive("rotation acceleration", rotation_acceleration, DEFAULT_ROTATION_ACCELERATION), STRONGEST),
        strongest)


def same_pose(a: Transform, b: Transform) -> bool:
    """True where two poses count as the same target."""
    return distance_between(a, b) < SAME_PLACE and rotation_angle_between(a, b) < SAME_ANGLE


def tool_rate(frames: ArmFrames, start: Vector, end: Vector) -> float:
    """The longest way of the tool centre point while the joint with the longest way turns by 1 rad, m/rad."""
    length = max(abs(b - a) for a, b in zip(start, end))
    pieces = math.ceil(length / _TOOL_RATE_PIECE)
    fastest, last = 0.0, frames.tool_at(start)
    for n in range(1, pieces + 1):
        tool = frames.tool_at([a + (b - a) * n / pieces for a, b in zip(start, end)])
        fastest, last = max(fastest, distance_between(last, tool)), tool
    return _TOOL_RATE_MARGIN * fastest * pieces / length
