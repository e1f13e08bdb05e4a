"""The checks of a move's numbers, their defaults, and the limits of speed and acceleration that the arm sets."""
import math
from typing import Optional

from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import Transform, distance_between, rotation_angle_between
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.frames import SAME_ANGLE, ArmFrames
from jaka_ros_driver.simulation.arm.legs import LegPace
from jaka_ros_driver.state import Vector

SLOWEST = 1e-9
"""Smallest speed or acceleration, m/s, rad/s, m/s2, rad/s2; smaller values count as 0."""
FASTEST = 100.0
"""Highest Cartesian speed, m/s, rad/s; higher ones are lowered to it. The arm's own limits are far below."""
STRONGEST = 1e4
"""Highest rotation acceleration, rad/s2; higher ones are lowered to it."""
DEFAULT_JOINT_ACCELERATION = math.pi
"""Acceleration, rad/s2, of a joint move without one (docs/controller-protocol.md section 2). No vendor value exists."""
DEFAULT_TCP_ACCELERATION = 0.5
"""Acceleration, m/s2, of a linear move without one. No vendor value exists."""
DEFAULT_ROTATION_SPEED = 3.14
"""Rotation speed, rad/s, that the SDK sends where its caller names none (docs/sdk-client.md section 8)."""
DEFAULT_ROTATION_ACCELERATION = 12.56
"""Rotation acceleration, rad/s2, from the same source."""

SAME_PLACE = 1e-6
"""Distance, m, from the end of the queue below which a target counts as the same place."""

_LEAST_BRAKING = 0.01
"""Smallest deceleration of a stop, as a share of what the model allows."""
_TOOL_RATE_PIECE = 0.1  # rad; step of the joint with the longest way between two samples
_TOOL_RATE_MARGIN = 1.02  # between two samples the tool can be slightly faster than their distance shows


def braking_share(model: ArmModel, deceleration: Optional[float]) -> float:
    """Return a deceleration of joint 6, rad/s2, as a share of what the model allows; 1 for None and for more."""
    if deceleration is None:
        return 1.0
    return min(1.0, max(_LEAST_BRAKING, deceleration / model.joint_max_acceleration[-1]))


def positive(what: str, value: Optional[float], default: float) -> float:
    """Return the value, or the default for None; raise TargetRejected unless it is finite and at least SLOWEST.

    The event is 0x0F0010.
    """
    if value is None:
        return default
    if not math.isfinite(value) or value < SLOWEST:
        raise TargetRejected(events.BAD_SPEED, "%s must be finite and above 0" % what)
    return value


def tool_pace(model: ArmModel, speed: float, acceleration: Optional[float], rotation_speed: Optional[float],
              rotation_acceleration: Optional[float], share: float = 1.0) -> LegPace:
    """Return a move's pace, limited to what the model's tool can do; m/s, m/s2, rad/s, rad/s2.

    Accelerations are this share of those asked for. It raises as ``positive`` does.
    """
    top = FASTEST if model.tcp_max_speed is None else model.tcp_max_speed
    strongest = model.tcp_max_acceleration
    return LegPace(
        min(positive("speed", speed, 0.0), top),
        min(share * positive("acceleration", acceleration, DEFAULT_TCP_ACCELERATION), strongest),
        min(positive("rotation speed", rotation_speed, DEFAULT_ROTATION_SPEED), FASTEST),
        min(share * positive("rotation acceleration", rotation_acceleration, DEFAULT_ROTATION_ACCELERATION), STRONGEST),
        strongest)


def same_pose(a: Transform, b: Transform) -> bool:
    """Return whether two poses count as the same target."""
    return distance_between(a, b) < SAME_PLACE and rotation_angle_between(a, b) < SAME_ANGLE


def tool_rate(frames: ArmFrames, start: Vector, end: Vector) -> float:
    """Return the longest way of the tool centre point, m/rad.

    It is that while the joint with the longest way turns by 1 rad.
    """
    length = max(abs(b - a) for a, b in zip(start, end))
    pieces = math.ceil(length / _TOOL_RATE_PIECE)
    fastest, last = 0.0, frames.tool_at(start)
    for n in range(1, pieces + 1):
        tool = frames.tool_at([a + (b - a) * n / pieces for a, b in zip(start, end)])
        fastest, last = max(fastest, distance_between(last, tool)), tool
    return _TOOL_RATE_MARGIN * fastest * pieces / length
