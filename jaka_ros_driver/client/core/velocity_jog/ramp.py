"""The ramp from wanted velocities to one joint position a cycle: within speed, acceleration and joint limits.

Velocities of the tool become joints here, too (``line_follower``): so every joint keeps its limits (a controller is
free to do something else near a singularity when it is sent poses).
"""
import math
from typing import NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.client.core.velocity_jog.line_follower import STEP_CHANGE, LineFollower
from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.limits import (
    FLOAT32_SLACK,
    SERVO_PERIOD_S,
    joint_speed_limit,
    stream_limits,
    tcp_speed_limit,
    top_joint_speeds,
)
from jaka_ros_driver.kinematics.rotations import IDENTITY, Transform
from jaka_ros_driver.state import Vector

FASTEST_JOINT = 1.0
"""Highest speed, rad/s, of a joint: it brakes to rest within 0.08 s, on which the dead-man's time depends."""
_NOTHING = (0.0,) * JOINT_COUNT
_LONGEST_BRAKE = math.ceil(FASTEST_JOINT / STEP_CHANGE)
"""Cycles in which every joint comes to rest."""
_ROUNDING = 1e-9
"""Allowance for rounding."""


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
        self._limits = stream_limits(model)
        self._tops = [min(top, FASTEST_JOINT) for top in model.joint_max_speed]
        self._follower: Optional[LineFollower] = None
        self._brake: Optional[Vector] = None

    @property
    def is_still(self) -> bool:
        """True where the last step was none, and the next one is none unless more is asked for."""
        return not any(self.velocity) and (self._follower is None or self._follower.is_still)

    @property
    def obstacle(self) -> str:
        """The reason why the tool stands, though it is asked to move; "" where it does not."""
        return "" if self._follower is None else self._follower.obstacle

    def step(self, wish: Optional[Wish], scale: float = 1.0) -> Vector:
        """Advance one cycle, and return the joints, rad (6,).

        wish: None to brake. scale: Share of its speed, 0 to 1.
        """
        if wish is not None and wish.frame is JogFrame.JOINT:
            self._follower = self._brake = None
            return self._joint_step(_shortened(wish.velocity, scale, [
                (joint, self._speeds.joint) for joint in wish.velocity]))
        follower = self._follower
        if wish is not None and (follower is None or follower.flange_t_tool != wish.flange_t_tool) and self.is_still:
            follower = self._follower = LineFollower(self.position, wish.flange_t_tool, self._model, self._tops,
                                                     _LONGEST_BRAKE)
        if follower is None:
            return self._joint_step(self._braked())
        if wish is None or follower.flange_t_tool != wish.flange_t_tool:
            follower.brake()
        else:
            follower.step(_shortened(wish.velocity, scale, (
                (math.hypot(*wish.velocity[:3]), self._speeds.linear),
                (math.hypot(*wish.velocity[3:]), self._speeds.angular))), wish.frame)
        self._brake = None
        self.position, self.velocity = follower.now.joint_position, follower.now.joint_velocity
        return self.position

    def _joint_step(self, wanted: Vector) -> Vector:
        """Take the joints one cycle nearer to the wanted velocities, rad/s (6,), each within its limits."""
        bounds = [self._bounds(joint) for joint in range(JOINT_COUNT)]
        moved, velocity = [], []
        for joint, (aim, (low, high)) in enumerate(zip(wanted, bounds)):
            before = self.velocity[joint]
            speed = min(max(min(max(aim, low), high), before - STEP_CHANGE), before + STEP_CHANGE)
            moved.append(self._within_limits(joint, self.position[joint] + speed * SERVO_PERIOD_S))
            velocity.append(speed)
        self.position, self.velocity = tuple(moved), tuple(velocity)
        return self.position

    def _bounds(self, joint: int) -> Tuple[float, float]:
        """Return the lowest and the highest speed of the next cycle from which a joint stops within its limits."""
        (low, high), position, top = self._limits[joint], self.position[joint], self._tops[joint]
        return -min(top, speed_to_stop_within(position - low)), min(top, speed_to_stop_within(high - position))

    def _within_limits(self, joint: int, position: float) -> float:
        """Clamp a joint to its limits; one that began beyond a limit is not pushed back, the rest is rounding."""
        (low, high), before = self._limits[joint], self.position[joint]
        return min(max(position, min(low, before)), max(high, before))

    def _braked(self) -> Vector:
        """Return velocities that slow all joints alike, so that they come to rest together."""
        if self._brake is None:
            cycles = math.ceil(max(map(abs, self.velocity)) / STEP_CHANGE - _ROUNDING)
            self._brake = tuple([speed / max(1, cycles) for speed in self.velocity])
        return tuple([0.0 if abs(speed) <= abs(less) * (1.0 + _ROUNDING) else speed - less
                      for speed, less in zip(self.velocity, self._brake)])


def speed_to_stop_within(room: float) -> float:
    """Return the highest speed of the next cycle, rad/s, from which a joint stops within ``room``, rad, in whole
    cycles.
    """
    if room <= 0.0:
        return 0.0
    steps = room / (STEP_CHANGE * SERVO_PERIOD_S)
    whole = int(0.5 * (math.sqrt(1.0 + 8.0 * steps) - 1.0))
    part = (steps - 0.5 * whole * (whole + 1)) / (whole + 1)
    return (whole + part) * STEP_CHANGE


def _shortened(velocity: Vector, scale: float, bounded: Sequence[Tuple[float, float]]) -> Vector:
    """Return the velocity slowed until it keeps every (speed, limit) of ``bounded``, times ``scale``."""
    share = min([scale] + [scale * top / abs(speed) for speed, top in bounded if abs(speed) > top])
    return tuple([share * value for value in velocity])
