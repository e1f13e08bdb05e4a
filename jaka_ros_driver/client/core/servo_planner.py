"""The planner that turns servo targets, as they come, into one frame a cycle that breaks no speed limit.

The controller ignores a step that needs more than 180 deg/s on a joint (docs/controller-protocol.md section 5.6.5), and
continues or halts as it likes when frames stop; so the steps are limited here, and a hold frame fills every cycle
without a target.
"""
import math
from typing import Callable, Optional, Sequence, Tuple

from jaka_ros_driver.client.core.motion_guard.frame_guard import Look, brake_end
from jaka_ros_driver.commands import Pose, ServoJoint, ServoPose
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.limits import (
    JOINT_ACCELERATION_CEILING,
    JOINT_SPEED_CEILING,
    TCP_ACCELERATION_CEILING,
    accepted_limits,
    are_inside,
    braked_steps,
    led_inside,
    stoppable_speed,
    stream_limits,
    top_joint_speeds,
)
from jaka_ros_driver.kinematics.rotations import (
    Transform,
    compose,
    matrix_from_rotation_vector,
    matrix_from_rpy,
    rpy_from_matrix,
    transform,
    turn_between,
)
from jaka_ros_driver.state import RobotState, Vector

Room = Tuple[float, float]
"""The distances from here to the limits below and above, rad."""
PoseLook = Callable[[Pose, Optional[Pose]], str]
_NO_LIMITS: Room = (math.inf, math.inf)
_ORIGIN = (0.0, 0.0, 0.0)
_LEVER = 0.3
"""Distance, m, from the tool's centre at which a turn is measured."""
_WIRE_ROUNDING = 1e-6
"""Excess, rad or m, over a limit that is allowed, because targets come as float32."""
_ARRIVED = 1e-7
"""Distance, rad or m, within which a target is reached."""


class _Follower:
    """The follower that brings a point to its target: a new one at once where speed and acceleration allow it.

    So a smooth stream is passed on as it is, and the last target is reached without passing it, where its client did
    not stop in the middle of fast motion. A limit is not passed then either: with ``room``, the distances to the limits
    below and above, a target is taken at once only where braking afterwards ends within them.

    Attributes:
        last_step: Longest step behind which it stands at once, rad or m.
    """

    def __init__(self, max_speed: float, acceleration: float, period: float) -> None:
        self._max_speed = max_speed
        self._max_change = acceleration * period
        self._acceleration = acceleration
        self._period = period
        self.last_step = acceleration * period * period
        self._velocity: Tuple[float, ...] = ()

    def step(self, away: Sequence[float], is_new: bool, room: Room = _NO_LIMITS) -> Vector:
        """Return the step of this cycle towards a target that is ``away`` from here.

        is_new: The target came since the last step.
        """
        if not self._velocity:
            self._velocity = (0.0,) * len(away)
        wanted: Tuple[float, ...] = tuple([a / self._period for a in away])
        if not (is_new and self._takes_at_once(wanted, room)):
            wanted = self._limited(away)
        self._velocity = wanted
        return tuple(w * self._period for w in wanted)

    def _takes_at_once(self, wanted: Tuple[float, ...], room: Room) -> bool:
        velocity, speed = self._velocity or (0.0,) * len(wanted), math.hypot(*wanted)
        way = speed * self._period + 0.5 * speed * speed / self._acceleration
        return (speed <= self._max_speed and math.dist(wanted, velocity) <= self._max_change
                and way <= room[wanted[0] > 0.0] + _WIRE_ROUNDING)

    def passes(self, away: Sequence[float], room: Room = _NO_LIMITS) -> bool:
        """Return whether a new target that is ``away`` from here is reached at once, and too fast to stand there."""
        return math.hypot(*away) > self.last_step and self._takes_at_once(tuple([a / self._period for a in away]), room)

    def brake_way(self, away: Sequence[float]) -> Vector:
        """Return the way of the brake behind a new target that is ``away`` from here; none where it can stand there."""
        if not self.passes(away):
            return (0.0,) * len(away)
        steps = braked_steps(math.hypot(*away) / self.last_step)
        return tuple([steps * a for a in away])

    @property
    def is_still(self) -> bool:
        """True where the last step was none."""
        return not self._velocity or math.hypot(*self._velocity) * self._period <= _ARRIVED

    def arrives_within(self, away: Sequence[float], cycles: int, room: Room = _NO_LIMITS) -> bool:
        """Return whether it would reach a new target that is ``away`` from here within so many cycles."""
        if self._takes_at_once(tuple([a / self._period for a in away]), room):
            return True
        twin = _Follower(self._max_speed, self._max_change / self._period, self._period)
        twin._velocity = self._velocity
        for cycle in range(cycles):
            away = tuple(a - s for a, s in zip(away, twin.step(away, cycle == 0, room)))
            if math.hypot(*away) <= _ARRIVED:
                return True
        return False

    def _limited(self, away: Sequence[float]) -> Vector:
        """Return the velocity towards the target, no faster than allows a stop there in whole cycles."""
        distance = math.hypot(*away)
        speed = min(self._max_speed, stoppable_speed(distance, self._acceleration, self._period))
        wanted = tuple(a * speed / distance if distance > 0.0 else 0.0 for a in away)
        change = math.dist(wanted, self._velocity)
        if change <= self._max_change:
            return wanted
        part = self._max_change / change
        return tuple(v + part * (w - v) for v, w in zip(self._velocity, wanted))


class JointServo:
    """A stream of joint targets."""

    def __init__(self, joint_position: Vector, model: ArmModel, max_jump: float, ahead: float, period: float,
                 look: Look = lambda way: "") -> None:
        """Begin at rest.

        Args:
            joint_position: The arm's position, rad (6,).
            model: Its joint limits and speeds; the controller's ceiling for a speed holds besides.
            max_jump: Largest distance of a target from the frame that was sent last, rad.
            ahead: Longest time in which a target must be reachable from that frame, s.
            period: Of a cycle, s.
            look: Says for which reason the arm must not go the way to a target.
        """
        self._look = look
        self._followers = [_Follower(speed, JOINT_ACCELERATION_CEILING, period) for speed in top_joint_speeds(model)]
        self._model = model
        self._limits = stream_limits(model)
        self._max_jump = max_jump
        self._ahead = ahead
        self._cycles = _cycles(ahead, period)
        self._is_new = False
        self._target = self._position = joint_position

    def set_target(self, target: Vector, is_relative: bool) -> str:
        """Set the target, rad (6,); a relative one counts from the last target.

        Distances are measured from the frame that was sent last, not from the last target: targets that come faster
        than the arm can follow do not add up. A target nearer to a limit than streams go is led to where they end.

        Returns:
            Which joint is led elsewhere, in words; "" for none.

        Raises:
            InvalidCommand: It is outside the joint limits, too far away, or the way to it is not clear; nothing
                changes.
        """
        goal = tuple(t + s for t, s in zip(self._target, target)) if is_relative else target
        goal, led = (goal, "") if are_inside(goal, self._limits) else self._led(goal)
        is_fast = False
        for index, (value, position, follower) in enumerate(zip(goal, self._position, self._followers)):
            jump = abs(value - position)
            is_fast = is_fast or jump > follower.last_step
            if jump > self._max_jump + _WIRE_ROUNDING:
                raise InvalidCommand("refused: joint %d of the servo target is %.4f rad away, more than the allowed "
                                     "%.4f rad" % (index + 1, jump, self._max_jump))
            if not follower.arrives_within((value - position,), self._cycles, self._room(index)):
                raise InvalidCommand("refused: joint %d of the servo target is %.4f rad away; the arm would not be "
                                     "there within %.3g s (servo_ahead); send smaller steps"
                                     % (index + 1, jump, self._ahead))
        passes = is_fast and any(follower.passes((value - position,), self._room(index)) for index, (
            value, position, follower) in enumerate(zip(goal, self._position, self._followers)))
        end = (brake_end(self._position, goal),) if passes else ()
        _require_no(self._look((self._position, goal, *end)), passes)
        self._target, self._is_new = goal, True
        return led

    def _led(self, goal: Vector) -> Tuple[Vector, str]:
        """Return the goal led to where streams end, and in words which joint that moved."""
        for index, (value, (low, high)) in enumerate(zip(goal, accepted_limits(self._model, self._position))):
            if not low - _WIRE_ROUNDING <= value <= high + _WIRE_ROUNDING:
                raise InvalidCommand("refused: joint %d of the servo target is %.6f rad; valid: %.6f to %.6f rad"
                                     % (index + 1, value, low, high))
        return led_inside(goal, stream_limits(self._model, self._position))

    @property
    def is_at_rest(self) -> bool:
        """True where the last two frames were at the target."""
        return all(f.is_still for f in self._followers) and math.dist(self._position, self._target) <= _ARRIVED

    @property
    def point(self) -> Tuple[float, ...]:
        """The point of the last frame, comparable with ``measured_point``."""
        return self._position

    @staticmethod
    def measured_point(state: RobotState) -> Optional[Tuple[float, ...]]:
        """Return the arm's measured place in coordinates in which a distance has a meaning; None where the feed lacks
        it.
        """
        return state.joint_position

    def next_frame(self) -> ServoJoint:
        is_new, self._is_new = self._is_new, False
        moved = [p + follower.step((t - p,), is_new, self._room(index))[0] for index, (p, t, follower) in enumerate(
            zip(self._position, self._target, self._followers))]
        # sums of steps round; an arm that began beyond a limit is not pushed back
        self._position = tuple(min(max(m, min(low, p)), max(high, p))
                               for m, p, (low, high) in zip(moved, self._position, self._limits))
        return ServoJoint(self._position)

    def _room(self, index: int) -> Room:
        low, high = self._limits[index]
        return self._position[index] - low, high - self._position[index]


class PoseServo:
    """A stream of Cartesian targets in the active user frame."""

    def __init__(self, pose: Pose, max_linear_speed: float, max_linear_jump: float, max_angular_jump: float,
                 ahead: float, period: float, look: PoseLook = lambda pose, end: "") -> None:
        """Begin at rest at ``pose``; speeds m/s, jumps m and rad, ahead and period s, as for joints.

        look: Says for which reason the arm must not go from the last frame to a target, and behind it to the end of
            its brake; None where it can stand at the target itself.
        """
        self._look = look
        self._linear = _Follower(max_linear_speed, TCP_ACCELERATION_CEILING, period)
        self._angular = _Follower(JOINT_SPEED_CEILING, JOINT_ACCELERATION_CEILING, period)
        self._max_linear_jump = max_linear_jump
        self._max_angular_jump = max_angular_jump
        self._ahead = ahead
        self._cycles = _cycles(ahead, period)
        self._is_new = False
        self._position = self._target_position = pose.position
        self._rotation = self._target_rotation = _rotation(pose.rpy)

    def set_target(self, target: Pose, is_relative: bool) -> None:
        """Set the target; a relative position adds along the user frame's axes, a relative rpy to the last rpy.

        Raises:
            InvalidCommand: It is too far away, measured from the frame that was sent last, or the way to it is not
                clear; nothing changes.
        """
        position, rpy = target.position, target.rpy
        if is_relative:
            position = tuple(t + s for t, s in zip(self._target_position, position))
            rpy = tuple(t + s for t, s in zip(rpy_from_matrix(self._target_rotation), rpy))
        rotation = _rotation(rpy)
        away = [t - p for t, p in zip(position, self._position)]
        turn = turn_between(self._rotation, rotation)
        distance, angle = math.hypot(*away), math.hypot(*turn)
        if distance > self._max_linear_jump + _WIRE_ROUNDING or angle > self._max_angular_jump + _WIRE_ROUNDING:
            raise InvalidCommand(
                "refused: the servo target is %.4f m and %.4f rad away, more than the allowed %.4f m or %.4f rad"
                % (distance, angle, self._max_linear_jump, self._max_angular_jump))
        if not (self._linear.arrives_within(away, self._cycles) and self._angular.arrives_within(turn, self._cycles)):
            raise InvalidCommand(
                "refused: the servo target is %.4f m and %.4f rad away; the arm would not be there within %.3g s "
                "(servo_ahead); send smaller steps" % (distance, angle, self._ahead))
        end = self._pose_behind(position, away, rotation, turn)
        _require_no(self._look(Pose(position, rpy), end), end is not None)
        self._target_position, self._target_rotation = position, rotation
        self._is_new = True

    def _pose_behind(self, position: Vector, away: Sequence[float], rotation: Transform,
                     turn: Sequence[float]) -> Optional[Pose]:
        """Return where the brake behind a new target ends, ``away`` and ``turn`` from here; None for no brake."""
        if not (self._linear.passes(away) or self._angular.passes(turn)):
            return None
        turned = compose(transform(matrix_from_rotation_vector(self._angular.brake_way(turn)), _ORIGIN), rotation)
        return Pose(tuple([p + b for p, b in zip(position, self._linear.brake_way(away))]), rpy_from_matrix(turned))

    @property
    def is_at_rest(self) -> bool:
        """True where the last two frames were at the target."""
        return (self._linear.is_still and self._angular.is_still
                and math.dist(self._position, self._target_position) <= _ARRIVED
                and math.hypot(*turn_between(self._rotation, self._target_rotation)) <= 1e-6)

    @property
    def point(self) -> Tuple[float, ...]:
        """The point of the last frame, comparable with ``measured_point``."""
        return _points_of(transform(self._rotation[:9], self._position))

    @staticmethod
    def point_at(pose: Pose) -> Tuple[float, ...]:
        """Return the point of a pose, comparable with ``measured_point``."""
        return _points_of(transform(matrix_from_rpy(pose.rpy), pose.position))

    @staticmethod
    def measured_point(state: RobotState) -> Optional[Tuple[float, ...]]:
        """Return the tool's place, m (9,): its centre, and two points beside it that turn with it."""
        if state.tcp_position is None or state.tcp_rpy is None:
            return None
        return PoseServo.point_at(Pose(state.tcp_position, state.tcp_rpy))

    def next_frame(self) -> ServoPose:
        is_new, self._is_new = self._is_new, False
        step = self._linear.step([t - p for t, p in zip(self._target_position, self._position)], is_new)
        self._position = tuple(p + s for p, s in zip(self._position, step))
        turn = self._angular.step(turn_between(self._rotation, self._target_rotation), is_new)
        self._rotation = compose(transform(matrix_from_rotation_vector(turn), _ORIGIN), self._rotation)
        return ServoPose(Pose(self._position, rpy_from_matrix(self._rotation)))


def _require_no(trouble: str, passes: bool) -> None:
    if trouble:
        raise InvalidCommand("refused: on the way to the servo target%s %s" % (
            ", or in braking behind it," if passes else "", trouble))


def _cycles(ahead: float, period: float) -> int:
    return max(1, int(ahead / period + 1e-6))


def _points_of(base_t_tool: Transform) -> Tuple[float, ...]:
    position = base_t_tool[9:]
    return tuple(position) + tuple(position[row] + _LEVER * base_t_tool[3 * row + column]
                                   for column in (0, 2) for row in range(3))


def _rotation(rpy: Sequence[float]) -> Transform:
    return transform(matrix_from_rpy(rpy), _ORIGIN)
