"""The route of a jog of one axis (docs/controller-protocol.md section 5.5)."""
import enum
import math
from typing import Optional, Tuple

from jaka_ros_driver.commands import JogFrame, Pose
from jaka_ros_driver.kinematics.rotations import Transform, Vector3, compose, pose_from_transform
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.frames import ArmFrames, rotated, rotation_between, turned
from jaka_ros_driver.simulation.arm.legs import LegPace, LineLeg, along, norm
from jaka_ros_driver.simulation.arm.moves import FASTEST, SLOWEST
from jaka_ros_driver.simulation.arm.routes import CartesianRoute, JointRoute, Route
from jaka_ros_driver.state import Vector

JOINT_ACCELERATION = math.pi
"""Acceleration, rad/s2, of a joint jog and of a rotation. No vendor value exists."""
TCP_ACCELERATION = 0.5
"""Acceleration, m/s2, of a Cartesian jog. No vendor value exists."""

_ALREADY_THERE = 1e-9
"""Largest way, rad or m, that is rounding and no jog."""
_TURNS = 4.0 * math.pi  # rad; a jog about a Cartesian axis ends after two turns at the latest


class JogMode(enum.IntEnum):
    """The end of a jog, by the numbers of the wire (docs/controller-protocol.md section 5.5), where 0 is stop."""

    CONTINUOUS = 1
    STEP = 2
    ABSOLUTE = 3


def jog_route(frames: ArmFrames, start: Vector, mode: JogMode, frame: JogFrame, axis: int, velocity: float,
              position: Optional[float]) -> Optional[Route]:
    """Return the route of a jog from these joints; None where the joint or tool is at the target already.

    Continuous: until a soft limit, the edge of the reach or a singularity. Step: by ``position``. Absolute: until the
    joint, or the coordinate of the tool in the active user frame, has the value ``position``. In the tool frame, which
    moves with the tool, absolute is the same as step.

    Raises:
        TargetRejected: A number is not finite or out of range; or the arm cannot reach the target (step, absolute) or
            cannot begin to move (continuous).
    """
    if not 0 <= axis <= 5:
        raise TargetRejected(events.TARGET_OUTSIDE_LIMITS, "jog axis %d is not within 0 to 5" % axis)
    if not math.isfinite(velocity) or abs(velocity) < SLOWEST:
        raise TargetRejected(events.BAD_SPEED, "jog velocity must be finite and not 0")
    if mode != JogMode.CONTINUOUS and (position is None or not math.isfinite(position)):
        raise TargetRejected(events.TARGET_OUTSIDE_LIMITS, "jog needs a finite position")
    if frame == JogFrame.JOINT:
        return _joint_route(frames, start, mode, axis, velocity, position or 0.0)
    return _cartesian_route(frames, start, mode, frame, axis, velocity, position or 0.0)


def _joint_route(frames: ArmFrames, start: Vector, mode: JogMode, axis: int, velocity: float, position: float
                 ) -> Optional[Route]:
    low, high = frames.model.joint_limits[axis]
    if mode == JogMode.CONTINUOUS:
        target = high if velocity > 0.0 else low
    else:
        target = position + (start[axis] if mode == JogMode.STEP else 0.0)
    way = target - start[axis]
    upwards = velocity > 0.0 if mode == JogMode.CONTINUOUS else way > 0.0
    if not low - _ALREADY_THERE <= target <= high + _ALREADY_THERE or (
            mode == JogMode.CONTINUOUS and abs(way) < _ALREADY_THERE):
        raise TargetRejected(events.jog_beyond_limit(axis, upwards))
    if abs(way) < _ALREADY_THERE:
        return None
    end = start[:axis] + (target,) + start[axis + 1:]
    route = JointRoute(frames.model, start, end, abs(velocity), JOINT_ACCELERATION)
    if mode == JogMode.CONTINUOUS:
        route.break_event = events.on_soft_limit(axis, upwards)
    return route


def _cartesian_route(frames: ArmFrames, start: Vector, mode: JogMode, frame: JogFrame, axis: int, velocity: float,
                     position: float) -> Optional[Route]:
    tool = frames.tool_at(start)
    if mode == JogMode.CONTINUOUS:
        extent = math.copysign(_TURNS if axis >= 3 else _twice_reach(frames), velocity)
        shift, turn = _displacement(frames, tool, frame, axis, extent)
    elif mode == JogMode.ABSOLUTE and frame == JogFrame.BASE:
        shift, turn = _to_coordinate(frames, tool, axis, position)
    else:
        shift, turn = _displacement(frames, tool, frame, axis, position)
    if norm(shift) > 1.01 * _twice_reach(frames) or norm(turn) > 1.01 * _TURNS:
        raise TargetRejected(events.TARGET_UNREACHABLE, "jog leads out of the reach")
    if norm(shift) < _ALREADY_THERE and norm(turn) < _ALREADY_THERE:
        return None
    top = frames.model.tcp_max_speed
    speed = min(abs(velocity), FASTEST if axis >= 3 or top is None else top)
    acceleration = TCP_ACCELERATION if axis < 3 else JOINT_ACCELERATION
    pace = LegPace(speed, acceleration, speed, acceleration, frames.model.tcp_max_acceleration)
    end = turned(tool, turn, along(tool[9:], shift, 1.0))
    route = CartesianRoute(frames, LineLeg(tool, end, pace, rotation_vector=turn), start)
    cause = route.break_event
    if cause is not None and (mode != JogMode.CONTINUOUS or route.length < 1e-6):
        raise TargetRejected(events.of_jog(cause))
    return route


def _displacement(frames: ArmFrames, tool: Transform, frame: JogFrame, axis: int, extent: float
                  ) -> Tuple[Vector3, Vector3]:
    """Return the shift, m (3,), and the rotation vector, rad (3,), in base axes, of an extent.

    It is along or about an axis of the frame.
    """
    unit = [0.0, 0.0, 0.0]
    unit[axis % 3] = extent
    way = rotated(tool if frame == JogFrame.TOOL else frames.base_t_user, unit)
    return (way, (0.0, 0.0, 0.0)) if axis < 3 else ((0.0, 0.0, 0.0), way)


def _to_coordinate(frames: ArmFrames, tool: Transform, axis: int, value: float) -> Tuple[Vector3, Vector3]:
    """Return the shift, m (3,), and the rotation vector, rad (3,), in base axes, to a user frame coordinate.

    They bring the tool's coordinate of this axis to the value.
    """
    pose = pose_from_transform(compose(frames.user_t_base, tool))
    if axis < 3:
        return _displacement(frames, tool, JogFrame.BASE, axis, value - pose.position[axis])
    rpy = list(pose.rpy)
    rpy[axis - 3] = value
    target = frames.in_base(Pose(pose.position, tuple(rpy)))
    return (0.0, 0.0, 0.0), rotation_between(tool, target)


def _twice_reach(frames: ArmFrames) -> float:
    """Return twice the arm's reach, m: a path of this length leaves the reach wherever it begins."""
    return 2.0 * (sum(math.hypot(row.a, row.d) for row in frames.model.dh) + norm(frames.flange_t_tool[9:]))
