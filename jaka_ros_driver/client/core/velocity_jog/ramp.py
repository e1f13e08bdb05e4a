"""The ramp from wanted velocities to one joint position a cycle: within speed, acceleration and joint limits.

Velocities of the tool go through the Jacobian to the joints, too: so every joint keeps its limits, and the arm passes
by singularities with the speed that its joints have (a controller is free to stop there when it is sent poses).
"""
import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.forward import forward, jacobian
from jaka_ros_driver.kinematics.limits import (
    FLOAT32_SLACK,
    JOINT_ACCELERATION_CEILING,
    SERVO_PERIOD_S,
    TCP_ACCELERATION_CEILING,
    joint_speed_limit,
    tcp_speed_limit,
    top_joint_speeds,
)
from jaka_ros_driver.kinematics.rotations import IDENTITY, Transform, compose
from jaka_ros_driver.state import Vector

FASTEST_JOINT = 1.0
"""Highest speed, rad/s, of a joint: it brakes to rest within 0.08 s, on which the dead-man's time depends."""
_LEVER = 0.3
"""Distance, m, from the tool's centre of the point whose way a turn of the tool counts as."""
_NEAR_SINGULAR = 0.05
_DAMPING = 0.025
"""Smallest singular value of the Jacobian, m/rad, below which it is damped, and the largest damping."""
_NOTHING = (0.0,) * JOINT_COUNT
_STEP_CHANGE = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S
"""Largest change, rad/s, of a joint's speed in one cycle."""
_LONGEST_BRAKE = FASTEST_JOINT / _STEP_CHANGE
"""Longest braking, cycles, to spare the tool: the joints never need longer."""
_ROUNDING = 1e-9


class Wish(NamedTuple):
    """A velocity that is asked for.

    Attributes:
        frame: JOINT, or the frame along whose axes the tool moves.
        velocity: rad/s of the joints, shape (6,); or of the tool's centre m/s (3,) and its turning rad/s (3,).
        flange_t_tool: The tool that is moved; without meaning for joints.
    """

    frame: JogFrame
    velocity: Vector
    flange_t_tool: Transform = IDENTITY

    @property
    def is_zero(self) -> bool:
        """True where it asks for rest."""
        return not any(self.velocity)


class JogSpeeds(NamedTuple):
    """The highest speeds of a jog; a faster wish is slowed down along its way.

    Attributes:
        joint: Of each joint, rad/s.
        linear: Of the tool's centre, m/s.
        angular: Of the tool's turning, rad/s.
    """

    joint: float
    linear: float
    angular: float


def require_possible(wish: Wish, model: ArmModel) -> None:
    """Check that the arm has this velocity at all.

    Raises:
        InvalidCommand: It is no finite number, or beyond the model's limits: its unit is probably a wrong one.
    """
    if len(wish.velocity) != JOINT_COUNT or not all(map(math.isfinite, wish.velocity)):
        raise InvalidCommand("the velocity is %s; it must be six finite numbers" % (wish.velocity,))
    if wish.frame is JogFrame.JOINT:
        for joint, (speed, top) in enumerate(zip(wish.velocity, top_joint_speeds(model)), 1):
            _require("joint %d" % joint, abs(speed), top, "rad/s")
        return
    _require("the tool", math.hypot(*wish.velocity[:3]), tcp_speed_limit(model), "m/s")
    _require("the tool", math.hypot(*wish.velocity[3:]), joint_speed_limit(model), "rad/s")


def _require(what: str, speed: float, limit: float, unit: str) -> None:
    if speed > limit * (1.0 + FLOAT32_SLACK):
        raise InvalidCommand("%s is asked for %.4g %s; the arm has at most %.4g %s" % (what, speed, unit, limit, unit))


class JogRamp:
    """The ramp that takes the velocity of the joints to the wanted one, and their position along.

    Attributes:
        position: Of the last step, rad (6,).
        velocity: Of the last step, rad/s (6,).
    """

    def __init__(self, joint_position: Vector, model: ArmModel, speeds: JogSpeeds) -> None:
        """Begin at rest.

        Args:
            joint_position: The arm's position, rad (6,).
            model: The arm model with the limits.
            speeds: The highest; no joint gets more than FASTEST_JOINT.
        """
        self.position = joint_position
        self.velocity: Vector = _NOTHING
        self._model = model
        self._speeds = speeds
        self._tops = [min(top, FASTEST_JOINT) for top in model.joint_max_speed]
        self._twist: Vector = _NOTHING
        self._flange_t_tool = IDENTITY
        self._brake: Optional[Vector] = None

    @property
    def is_still(self) -> bool:
        """True where the last step was none, and the next one is none unless more is asked for."""
        return not any(self.velocity) and not any(self._twist)

    def step(self, wish: Optional[Wish], scale: float = 1.0) -> Vector:
        """Advance one cycle, and return the joints, rad (6,).

        wish: None to brake. scale: Share of its speed, 0 to 1.
        """
        bounds = [self._bounds(joint) for joint in range(JOINT_COUNT)]
        if wish is None:
            wanted = self._braked()
        elif wish.frame is JogFrame.JOINT:
            self._twist, self._brake = _NOTHING, None
            wanted = _shortened(wish.velocity, scale, [(joint, self._speeds.joint) for joint in wish.velocity])
        else:
            self._brake = None
            wanted = self._of_tool(wish, scale, bounds)
        moved, velocity = [], []
        for joint, (aim, (low, high)) in enumerate(zip(wanted, bounds)):
            before = self.velocity[joint]
            speed = min(max(min(max(aim, low), high), before - _STEP_CHANGE), before + _STEP_CHANGE)
            moved.append(self._within_limits(joint, self.position[joint] + speed * SERVO_PERIOD_S))
            velocity.append(speed)
        self.position, self.velocity = tuple(moved), tuple(velocity)
        return self.position

    def _bounds(self, joint: int) -> Tuple[float, float]:
        """Return the lowest and the highest speed of the next cycle from which a joint stops within its limits."""
        (low, high), position, top = self._model.joint_limits[joint], self.position[joint], self._tops[joint]
        return -min(top, speed_to_stop_within(position - low)), min(top, speed_to_stop_within(high - position))

    def _within_limits(self, joint: int, position: float) -> float:
        """Clamp a joint to its limits; one that began beyond a limit is not pushed back, the rest is rounding."""
        (low, high), before = self._model.joint_limits[joint], self.position[joint]
        return min(max(position, min(low, before)), max(high, before))

    def _braked(self) -> Vector:
        """Return velocities that slow all joints alike, so that they come to rest together.

        Nothing ahead changes that, a singularity included.
        """
        if self._brake is None:
            cycles = max(map(abs, self.velocity)) / _STEP_CHANGE
            if any(self._twist):
                matrix = jacobian(self._model, self.position, self._flange_t_tool)
                speed = math.hypot(*(matrix[:3] @ np.array(self.velocity)).tolist())
                cycles = max(cycles, min(_LONGEST_BRAKE, speed / (TCP_ACCELERATION_CEILING * SERVO_PERIOD_S)))
            self._brake = tuple([speed / max(1, math.ceil(cycles - _ROUNDING)) for speed in self.velocity])
            self._twist = _NOTHING
        return tuple([0.0 if abs(speed) <= abs(less) * (1.0 + _ROUNDING) else speed - less
                      for speed, less in zip(self.velocity, self._brake)])

    def _of_tool(self, wish: Wish, scale: float, bounds: Sequence[Tuple[float, float]]) -> Vector:
        """Return the joint velocities that move the tool as asked, all slowed alike where one joint has less."""
        self._flange_t_tool = wish.flange_t_tool
        aim = _shortened(wish.velocity, scale, ((math.hypot(*wish.velocity[:3]), self._speeds.linear),
                                                (math.hypot(*wish.velocity[3:]), self._speeds.angular)))
        if wish.frame is JogFrame.TOOL:
            base_t_tool = compose(forward(self._model, self.position), wish.flange_t_tool)
            aim = _turned(base_t_tool, aim[:3]) + _turned(base_t_tool, aim[3:])
        self._twist = _towards(self._twist, aim)
        if not any(self._twist):
            return _NOTHING
        velocity = joint_velocity(jacobian(self._model, self.position, self._flange_t_tool), self._twist)
        share = 1.0
        for speed, (low, high) in zip(velocity, bounds):
            bound = high if speed > 0.0 else -low
            if abs(speed) > bound:
                share = min(share, bound / abs(speed))
        return tuple([share * speed for speed in velocity])


def speed_to_stop_within(room: float) -> float:
    """Return the highest speed of the next cycle, rad/s, from which a joint stops within ``room``, rad, in whole
    cycles.
    """
    if room <= 0.0:
        return 0.0
    steps = room / (_STEP_CHANGE * SERVO_PERIOD_S)
    whole = int(0.5 * (math.sqrt(1.0 + 8.0 * steps) - 1.0))
    part = (steps - 0.5 * whole * (whole + 1)) / (whole + 1)
    return (whole + part) * _STEP_CHANGE


def joint_velocity(matrix: "np.ndarray[Tuple[int, int], np.dtype[np.float64]]", twist: Sequence[float]) -> Vector:
    """Return the joint velocities, rad/s (6,), that give the tool this velocity, m/s (3,) and rad/s (3,).

    Near a singularity the part that the joints could do only at great speed is left out.
    """
    weights = np.array((1.0, 1.0, 1.0, _LEVER, _LEVER, _LEVER))
    left, values, right = np.linalg.svd(matrix * weights[:, None])
    damping = (_DAMPING * max(0.0, 1.0 - values[-1] / _NEAR_SINGULAR)) ** 2
    gains = values / np.maximum(values * values + damping, 1e-12)
    return tuple((right.T @ (gains * (left.T @ (weights * np.array(twist))))).tolist())


def _shortened(velocity: Vector, scale: float, bounded: Sequence[Tuple[float, float]]) -> Vector:
    """Return the velocity slowed until it keeps every (speed, limit) of ``bounded``, times ``scale``."""
    share = min([scale] + [scale * top / abs(speed) for speed, top in bounded if abs(speed) > top])
    return tuple([share * value for value in velocity])


def _towards(twist: Vector, aim: Vector) -> Vector:
    """Return a twist one cycle nearer to the aim, on a straight line."""
    change: List[float] = [a - t for a, t in zip(aim, twist)]
    share = 1.0
    for size, ceiling in ((math.hypot(*change[:3]), TCP_ACCELERATION_CEILING),
                          (math.hypot(*change[3:]), JOINT_ACCELERATION_CEILING)):
        if size > ceiling * SERVO_PERIOD_S:
            share = min(share, ceiling * SERVO_PERIOD_S / size)
    return aim if share == 1.0 else tuple([t + share * c for t, c in zip(twist, change)])


def _turned(a: Transform, v: Sequence[float]) -> Vector:
    return tuple([a[row] * v[0] + a[row + 1] * v[1] + a[row + 2] * v[2] for row in (0, 3, 6)])
