"""Turns servo targets, as they come, into one frame a cycle that no speed limit is broken by.

The controller ignores a step that needs more than 180 deg/s on a joint (controller protocol 5.6.5), and continues or
halts as it likes when frames stop; so the steps are limited here, and a hold frame fills every cycle without a target.
"""
import math
from typing import Optional, Sequence, Tuple

from jaka_ros_driver.commands import Pose, ServoJoint, ServoPose
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.rotations import (
    Transform,
    Vector3,
    compose,
    invert,
    matrix_from_rotation_vector,
    matrix_from_rpy,
    rotation_vector_from_matrix,
    rpy_from_matrix,
    transform,
)
from jaka_ros_driver.state import RobotState, Vector

MAX_JOINT_SPEED = math.pi
"""rad/s, the controller's own ceiling for a servo step."""
_JOINT_ACCELERATION = 4.0 * math.pi
_LINEAR_ACCELERATION = 8.0
_ANGULAR_ACCELERATION = 4.0 * math.pi
_ORIGIN = (0.0, 0.0, 0.0)
_LEVER = 0.3
"""m; how far from the tool's centre a turn is looked at."""
_WIRE_ROUNDING = 1e-6
"""rad or m: targets come as float32, and one at the very limit is still allowed."""


class _Follower:
    """Brings a point to its target: at once where speed and acceleration allow it, else as fast as they do."""

    def __init__(self, max_speed: float, acceleration: float, period: float) -> None:
        self._max_speed = max_speed
        self._max_change = acceleration * period
        self._acceleration = acceleration
        self._period = period
        self._velocity: Tuple[float, ...] = ()

    def step(self, away: Sequence[float]) -> Vector:
        """The step of this cycle towards a target that is ``away`` from here."""
        if not self._velocity:
            self._velocity = (0.0,) * len(away)
        wanted = tuple(a / self._period for a in away)
        if not (_norm(wanted) <= self._max_speed and _distance(wanted, self._velocity) <= self._max_change):
            wanted = self._limited(away)
        self._velocity = wanted
        return tuple(w * self._period for w in wanted)

    def _limited(self, away: Sequence[float]) -> Vector:
        distance = _norm(away)
        speed = min(self._max_speed, math.sqrt(2.0 * self._acceleration * distance), distance / self._period)
        wanted = tuple(a * speed / distance if distance > 0.0 else 0.0 for a in away)
        change = _distance(wanted, self._velocity)
        if change <= self._max_change:
            return wanted
        part = self._max_change / change
        return tuple(v + part * (w - v) for v, w in zip(self._velocity, wanted))


def _norm(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values))


def _distance(a: Sequence[float], b: Sequence[float]) -> float:
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b)))


class JointServo:
    """A stream of joint targets."""

    def __init__(self, joint_position: Vector, max_speed: Sequence[float], max_jump: float, period: float) -> None:
        """Begin at rest.

        Args:
            joint_position: Where the arm is, rad (6,).
            max_speed: Of each joint, rad/s; the controller's ceiling holds besides.
            max_jump: Largest distance of a target from the last one, rad.
            period: Of a cycle, s.
        """
        self._followers = [_Follower(min(speed, MAX_JOINT_SPEED), _JOINT_ACCELERATION, period) for speed in max_speed]
        self._max_jump = max_jump
        self._target = self._position = joint_position

    def set_target(self, target: Vector, is_relative: bool) -> None:
        """Go there, rad (6,); a relative one counts from the last target.

        Raises:
            InvalidCommand: It is too far from the last target; nothing changes.
        """
        goal = tuple(t + s for t, s in zip(self._target, target)) if is_relative else target
        jumps = [abs(g - t) for g, t in zip(goal, self._target)]
        farthest = max(jumps)
        if farthest > self._max_jump + _WIRE_ROUNDING:
            raise InvalidCommand(
                "refused: joint %d of the servo target is %.4f rad from the last one, more than the allowed %.4f rad"
                % (jumps.index(farthest) + 1, farthest, self._max_jump))
        self._target = goal

    @property
    def point(self) -> Tuple[float, ...]:
        """What the last frame told, as ``measured_point`` has it."""
        return self._position

    @staticmethod
    def measured_point(state: RobotState) -> Optional[Tuple[float, ...]]:
        """Where the arm is, in coordinates that a distance means something in; None where it is not told."""
        return state.joint_position

    def next_frame(self) -> ServoJoint:
        """The frame of this cycle."""
        self._position = tuple(
            p + follower.step((t - p,))[0] for p, t, follower in zip(self._position, self._target, self._followers))
        return ServoJoint(self._position)


class PoseServo:
    """A stream of Cartesian targets in the active user frame."""

    def __init__(self, pose: Pose, max_linear_speed: float, max_linear_jump: float, max_angular_jump: float,
                 period: float) -> None:
        """Begin at rest at ``pose``; speeds m/s, jumps m and rad, period s."""
        self._linear = _Follower(max_linear_speed, _LINEAR_ACCELERATION, period)
        self._angular = _Follower(MAX_JOINT_SPEED, _ANGULAR_ACCELERATION, period)
        self._max_linear_jump = max_linear_jump
        self._max_angular_jump = max_angular_jump
        self._position = self._target_position = pose.position
        self._rotation = self._target_rotation = _rotation(pose.rpy)

    def set_target(self, target: Pose, is_relative: bool) -> None:
        """Go there; of a relative one, position adds along the user frame's axes and rpy adds to the last rpy.

        Raises:
            InvalidCommand: It is too far from the last target; nothing changes.
        """
        position, rpy = target.position, target.rpy
        if is_relative:
            position = tuple(t + s for t, s in zip(self._target_position, position))
            rpy = tuple(t + s for t, s in zip(rpy_from_matrix(self._target_rotation), rpy))
        rotation = _rotation(rpy)
        jump = _distance(position, self._target_position)
        turn = _norm(_turn_between(self._target_rotation, rotation))
        if jump > self._max_linear_jump + _WIRE_ROUNDING or turn > self._max_angular_jump + _WIRE_ROUNDING:
            raise InvalidCommand(
                "refused: the servo target is %.4f m and %.4f rad from the last one, more than the allowed %.4f m or "
                "%.4f rad" % (jump, turn, self._max_linear_jump, self._max_angular_jump))
        self._target_position, self._target_rotation = position, rotation

    @property
    def point(self) -> Tuple[float, ...]:
        """What the last frame told, as ``measured_point`` has it."""
        return _points_of(transform(self._rotation[:9], self._position))

    @staticmethod
    def measured_point(state: RobotState) -> Optional[Tuple[float, ...]]:
        """Where the tool is, m (9,): its centre, and two points beside it that turn with it."""
        if state.tcp_position is None or state.tcp_rpy is None:
            return None
        return _points_of(transform(matrix_from_rpy(state.tcp_rpy), state.tcp_position))

    def next_frame(self) -> ServoPose:
        """The frame of this cycle."""
        step = self._linear.step([t - p for t, p in zip(self._target_position, self._position)])
        self._position = tuple(p + s for p, s in zip(self._position, step))
        turn = self._angular.step(_turn_between(self._rotation, self._target_rotation))
        self._rotation = compose(transform(matrix_from_rotation_vector(turn), _ORIGIN), self._rotation)
        return ServoPose(Pose(self._position, rpy_from_matrix(self._rotation)))


def _points_of(base_t_tool: Transform) -> Tuple[float, ...]:
    position = base_t_tool[9:]
    return tuple(position) + tuple(position[row] + _LEVER * base_t_tool[3 * row + column]
                                   for column in (0, 2) for row in range(3))


def _rotation(rpy: Sequence[float]) -> Transform:
    return transform(matrix_from_rpy(rpy), _ORIGIN)


def _turn_between(start: Transform, end: Transform) -> Vector3:
    """The rotation vector, in the common frame, that turns start into end, rad."""
    return rotation_vector_from_matrix(compose(end, invert(start)))
