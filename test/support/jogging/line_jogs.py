"""Velocity jogs of a tool out and back, with how far it leaves its line, beside the way that the service ``jog`` has.

The service's way is that of the simulated controller, which walks the line by exact inverse kinematics.
"""
import math
from typing import NamedTuple

from jaka_ros_driver.client.core.velocity_jog.ramp import FASTEST_JOINT, JogRamp, JogSpeeds, Wish
from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.kinematics.forward import forward, link_transforms, signed_measures
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, SERVO_PERIOD_S
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    compose,
    invert,
    matrix_from_rpy,
    rotation_vector_from_matrix,
    transform,
)
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.frames import ArmFrames
from jaka_ros_driver.simulation.arm.jog import JogMode, jog_route

SPEEDS = JogSpeeds(0.5, 0.25, 0.5)
SPEED = 0.1
"""Speed, m/s, of a jog along an axis."""
TURN_SPEED = 0.3
"""Speed, rad/s, of a jog about an axis."""
WAY, TURN = 0.05, 0.15
"""Way out, m and rad."""
LONGEST_S = 6.0
STANDING = 5
"""Cycles without motion after which the tool counts as standing."""


class JogCase(NamedTuple):
    """A jog along or about an axis: ``space`` is base, tool or user; axis 0 to 5; sign 1 or -1."""

    model: object
    start: tuple
    flange_t_tool: tuple
    base_t_user: tuple
    space: str
    axis: int
    sign: int

    @property
    def is_turn(self):
        return self.axis >= 3

    @property
    def speed(self):
        return TURN_SPEED if self.is_turn else SPEED

    @property
    def wanted(self):
        return TURN if self.is_turn else WAY

    def wish(self, speed):
        """Return the wish of this speed, as the driver makes it of a message."""
        unit = [self.sign * speed if n == self.axis else 0.0 for n in range(6)]
        if self.space == "tool":
            return Wish(JogFrame.TOOL, tuple(unit), self.flange_t_tool)
        frame = self.base_t_user if self.space == "user" else IDENTITY
        return Wish(JogFrame.BASE, tuple(_rotated(frame, unit[:3]) + _rotated(frame, unit[3:])), self.flange_t_tool)

    def service_way(self):
        """Return the way, m or rad, that the service ``jog`` has from here; 0 where it cannot begin."""
        frames = ArmFrames(self.model)
        frames.set_tool(self.flange_t_tool)
        frames.set_user_frame(self.base_t_user if self.space == "user" else IDENTITY)
        frame = JogFrame.TOOL if self.space == "tool" else JogFrame.BASE
        try:
            return jog_route(frames, self.start, JogMode.CONTINUOUS, frame, self.axis, self.sign * self.speed,
                             None).length
        except TargetRejected:
            return 0.0


class JogVerdict(NamedTuple):
    """The worst of a jog out and back.

    Attributes:
        way: How far it got, m or rad.
        sideways: From the line, or from the centre, m.
        turn: From the orientation, or from the axis, rad.
        back: From where it began, after the way back: m and rad; None where it did not come back.
        is_crossed: A singularity was crossed.
        is_within: Every joint kept limits, speed and acceleration.
        obstacle: The reason that was said while it stood.
    """

    way: float
    sideways: float
    turn: float
    back: object
    is_crossed: bool
    is_within: bool
    obstacle: str


class JogMeter:
    """The measures of each frame of a jog against the line from its start."""

    def __init__(self, case):
        self.case = case
        self.begun = compose(forward(case.model, case.start), case.flange_t_tool)
        wish = case.wish(1.0).velocity
        if case.space == "tool":
            wish = _rotated(self.begun, wish[:3]) + _rotated(self.begun, wish[3:])
        self._axis = wish[3:] if case.is_turn else wish[:3]
        self._measures = signed_measures(case.model, case.start, link_transforms(case.model, case.start))
        self._last = (case.start, (0.0,) * 6)
        self.sideways = self.turn = 0.0
        self.is_crossed, self.is_within = False, True

    def take(self, joints):
        """Take a frame; return its place along the line, and its deviation sideways and in turn."""
        tool = compose(forward(self.case.model, joints), self.case.flange_t_tool)
        shift = [b - a for a, b in zip(self.begun[9:], tool[9:])]
        turn = list(rotation_vector_from_matrix(compose(tool, invert(self.begun))))
        led = turn if self.case.is_turn else shift
        along = sum(a * b for a, b in zip(led, self._axis))
        across = math.hypot(*[a - along * b for a, b in zip(led, self._axis)])
        sideways, turned = (math.hypot(*shift), across) if self.case.is_turn else (across, math.hypot(*turn))
        self.sideways, self.turn = max(self.sideways, sideways), max(self.turn, turned)
        self._judge(joints)
        return along, math.hypot(*shift), math.hypot(*turn)

    def _judge(self, joints):
        model = self.case.model
        measures = signed_measures(model, joints, link_transforms(model, joints))
        self.is_crossed = self.is_crossed or any(a * b < 0.0 for a, b in zip(self._measures, measures))
        before, speeds = self._last
        after = tuple([(b - a) / SERVO_PERIOD_S for a, b in zip(before, joints)])
        for q, v, u, top, (low, high) in zip(joints, after, speeds, model.joint_max_speed, model.joint_limits):
            self.is_within = (self.is_within and low - 1e-9 <= q <= high + 1e-9
                              and abs(v) <= min(top, FASTEST_JOINT) + 1e-6
                              and abs(v - u) <= JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S + 1e-6)
        self._last = joints, after


def jogged(case):
    """Jog out until the wanted way or a stand, brake, and jog back; return the verdict."""
    ramp, meter = JogRamp(case.start, case.model, SPEEDS), JogMeter(case)
    along, obstacle, longest = 0.0, "", int(LONGEST_S / SERVO_PERIOD_S)
    standing = 0
    for _ in range(longest):
        along = meter.take(ramp.step(case.wish(case.speed)))[0]
        standing = standing + 1 if ramp.is_still else 0
        if along >= case.wanted or standing >= STANDING:
            break
    obstacle = getattr(ramp, "obstacle", "")
    while not ramp.is_still:
        meter.take(ramp.step(None))
    way, back, nearest, standing = along, None, math.inf, 0
    for _ in range(longest):
        along, shift, turn = meter.take(ramp.step(case.wish(-case.speed)))
        if abs(along) < nearest:
            nearest, back = abs(along), (shift, turn)
        standing = standing + 1 if ramp.is_still else 0
        if along <= 0.0 or standing >= STANDING:
            break
    return JogVerdict(way, meter.sideways, meter.turn, back if nearest < 2e-3 else None,
                      meter.is_crossed, meter.is_within, obstacle)


def drawn_case(model, rng):
    """Return a case drawn by a ``random.Random``."""
    start = tuple([rng.uniform(low, high) for low, high in model.joint_limits])
    return JogCase(model, start, drawn_frame(rng, 0.15), drawn_frame(rng, 1.0), rng.choice(("base", "tool", "user")),
                   rng.randrange(6), rng.choice((1, -1)))


def drawn_frame(rng, size):
    """Return a frame with any orientation, and coordinates up to ``size``, m."""
    return transform(matrix_from_rpy([rng.uniform(-math.pi, math.pi) for _ in range(3)]),
                     [rng.uniform(-size, size) for _ in range(3)])


def _rotated(frame, vector):
    return [frame[row] * vector[0] + frame[row + 1] * vector[1] + frame[row + 2] * vector[2] for row in (0, 3, 6)]
