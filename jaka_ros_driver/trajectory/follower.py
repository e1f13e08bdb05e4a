"""The follower of a stream of points that come one at a time, each a little ahead: MoveIt Servo and joysticks send so.

Points come with the jitter of their sender and of the network. Each gets a place in time that runs on with the mean
period of the stream, and lies two periods ahead at least, so that a point may be late by one. The joints follow the
line through these places with the speed and the acceleration that they have, and never faster than they can stop at the
last point: a stream that ends is held there, and not passed.
"""
import math
from collections import deque
from typing import Deque, List, NamedTuple, Optional, Tuple

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.limits import (
    JOINT_ACCELERATION_CEILING,
    SERVO_PERIOD_S,
    led_inside,
    stoppable_speed,
    stream_limits,
    top_joint_speeds,
)
from jaka_ros_driver.state import Vector
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import InvalidTrajectory

LONGEST_AHEAD_S = 0.35
"""Time, s, up to which a single point belongs to a stream: three periods at 10 Hz, and some jitter."""
HOLD_S = 0.5
"""Time, s, without a point after which a stream has ended."""
_SHORTEST_PERIOD_S, _LONGEST_PERIOD_S = 0.002, 0.1
"""Shortest and longest period, s, of a stream: 500 Hz, of which the controller takes one in four, and 10 Hz."""
_PERIODS_AHEAD = 2.0
"""Periods by which a point without a time of its own lies ahead: one that comes a period late is no standstill."""
_TOO_FAST = 1.25
"""Factor over a joint's speed from which a point is refused: that is a jump, and no stream."""
_PULL = 0.2
"""Share by which a point's place follows its own time, and not the mean period."""
_MEAN_OVER_S, _FEW = 1.0, 4
"""Time, s, over which the mean period is taken, and the number of points from which on it is believed as it is."""
_MOST_PERIODS_AHEAD = 3.0
"""Periods that a stream's own times may lie ahead at most, for the mean: with less its points would be dropped."""
_GAIN = 0.25 / SERVO_PERIOD_S
"""Share of the distance to its line that a joint makes up for in a second: a quarter in each cycle; 1 would overshoot.
"""
_CHANGE = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S
_BRAKE = 0.9 * JOINT_ACCELERATION_CEILING
"""Deceleration, rad/s2, that is planned with; the rest is left for points that lie elsewhere than the line led on."""
_STILL = 1e-9
"""Speed, rad/s, that is rounding of floats."""
_ARRIVED = 1e-7
"""Distance, rad, at which the arm is at the last point: below the controller's own resolution."""
_WIRE_ROUNDING = 1e-6
"""Excess, rad, over a limit that is allowed, because points come as float32 from some clients."""


class _Place(NamedTuple):
    time: float
    position: Vector


class PointFollower:
    """The place of the arm behind a stream of points; it has what a motion uses of a ``PathClock``.

    Attributes:
        position: The last position sent, rad (6,).
        velocity: Of the last cycle, rad/s (6,).
        now: Monotonic time of the next cycle, s; set by the motion.
        rate: 0 while it holds the arm because it was told to, else 1: a stream has no clock of its own.
    """

    def __init__(self, position: Vector, model: ArmModel, now: float) -> None:
        """Begin at rest at ``position``, rad (6,)."""
        self.position: Vector = position
        self.velocity: Vector = (0.0,) * JOINT_COUNT
        self.now = self._begun_at = now
        self._model = model
        self._top = top_joint_speeds(model)
        self._acceleration: Vector = (0.0,) * JOINT_COUNT
        self._places: Deque[_Place] = deque([_Place(now, position)])
        self._came: Deque[float] = deque()
        self.rate = 1.0

    @property
    def time(self) -> float:
        """Time since the stream began, s."""
        return self.now - self._begun_at

    @property
    def is_still(self) -> bool:
        """True where the last cycle moved nothing."""
        return max(map(abs, self.velocity)) <= _STILL

    @property
    def is_at_end(self) -> bool:
        """True where the arm is at the last point, and none has come for ``HOLD_S``."""
        if len(self._places) > 1 or self.now - (self._came[-1] if self._came else self._begun_at) < HOLD_S:
            return False
        return max([abs(a - b) for a, b in zip(self.position, self._places[0].position)]) <= _ARRIVED

    def state(self) -> JointState:
        """Return position, velocity and acceleration of the last cycle."""
        return JointState(self.position, self.velocity, self._acceleration)

    def add(self, position: Vector, due: float, now: float) -> str:
        """Take the next point; one that is nearer to a limit than streams go is led to where they end.

        Args:
            position: rad (6,), within the limits.
            due: When the arm is to be there, monotonic time, s.
            now: Monotonic time, s.

        Returns:
            Which joint is led elsewhere, in words; "" for none.

        Raises:
            InvalidTrajectory: A joint would have to run faster than it can; the points before are kept.
        """
        position, led = led_inside(position, stream_limits(self._model, self.position))
        last, ahead = self._places[-1], max(due - now, 0.0)
        period = self._period_with(now, ahead)
        is_on = bool(self._came) and now - self._came[-1] < 3.0 * period and last.time + 2.0 * period > now
        time = max(due, now + _PERIODS_AHEAD * period if self._came else now + SERVO_PERIOD_S)
        if is_on:
            time = max(last.time + period + _PULL * (time - last.time - period), last.time + 0.25 * period)
        span = max(time - (last.time if is_on else now), period)
        for joint, (new, old, top) in enumerate(zip(position, last.position, self._top), 1):
            if abs(new - old) > _TOO_FAST * top * span:
                raise InvalidTrajectory("joint %d would have to run at %.3f rad/s to the point %.3f s ahead; valid: at "
                                        "most %.4f rad/s" % (joint, abs(new - old) / span, span, top))
        if not is_on:
            self._places = deque([_Place(now, self._reference(now)[0])])
        self._came.append(now)
        while now - self._came[0] > _MEAN_OVER_S:
            self._came.popleft()
        self._places.append(_Place(time, position))
        return led

    def step(self, wanted: float) -> Vector:
        """Advance one cycle; return the position, rad (6,).

        wanted: Share of the joints' speeds that may be used, 0 to 1; 0 brakes, and holds.
        """
        target, speed = self._reference(self.now)
        velocity = (self._last_step() if wanted > 0.0 else None) or self._towards(target, speed, wanted)
        self._acceleration = tuple([(v - b) / SERVO_PERIOD_S for v, b in zip(velocity, self.velocity)])
        self.position = tuple([p + v * SERVO_PERIOD_S for p, v in zip(self.position, velocity)])
        self.velocity = tuple(velocity)
        self.rate = 0.0 if wanted == 0.0 and self.is_still else 1.0
        return self.position

    # ---- inside ----

    def _period_with(self, now: float, ahead: float) -> float:
        """Return the mean period of the points, s, with the one that comes now and is due ``ahead`` s from now.

        The first ones tell little: several that a stall has held up come at once.
        """
        count = len(self._came)
        mean = (now - self._came[0]) / count if count else ahead
        if count < _FEW:
            mean = max(mean, ahead / _MOST_PERIODS_AHEAD)
        return min(max(mean, _SHORTEST_PERIOD_S), _LONGEST_PERIOD_S)

    def _towards(self, target: Vector, speed: Vector, wanted: float) -> List[float]:
        """Return the velocity of this cycle, rad/s (6,), towards a target, rad (6,), that moves at ``speed``."""
        if wanted <= 0.0:
            return [_changed(before, 0.0) for before in self.velocity]
        ahead = [place.position for place in self._places]
        bounds = [(min(values), max(values)) for values in zip(*(ahead[1:] or ahead))]
        velocity = []
        for here, before, to, running, top, (low, high) in zip(
                self.position, self.velocity, target, speed, self._top, bounds):
            away = to - here
            new = running + math.copysign(min(_GAIN * abs(away), _stoppable(abs(away))), away)
            room = high - here if new > 0.0 else here - low
            highest = min(top * min(wanted, 1.0), _stoppable(max(room, 0.0)))
            velocity.append(_changed(before, math.copysign(min(abs(new), highest), new)))
        return velocity

    def _last_step(self) -> Optional[List[float]]:
        """Return the velocity, rad/s, that leads to the last point itself, where a cycle can take it up and end it."""
        if len(self._places) > 1:
            return None
        last = [(end - here) / SERVO_PERIOD_S for end, here in zip(self._places[0].position, self.position)]
        fits = all(abs(new) <= 0.5 * _CHANGE and abs(new - before) <= _CHANGE
                   for new, before in zip(last, self.velocity))
        return last if fits else None

    def _reference(self, time: float) -> Tuple[Vector, Vector]:
        """Return where the line through the places is at this time, rad (6,), and its speed, rad/s (6,)."""
        while len(self._places) > 1 and self._places[1].time <= time:
            self._places.popleft()
        first = self._places[0]
        if len(self._places) == 1:
            return first.position, (0.0,) * JOINT_COUNT
        second = self._places[1]
        span = second.time - first.time
        share = min(max((time - first.time) / span, 0.0), 1.0)
        return (tuple([a + share * (b - a) for a, b in zip(first.position, second.position)]),
                tuple([(b - a) / span for a, b in zip(first.position, second.position)]))


def require_within(position: Vector, model: ArmModel) -> None:
    """Check that a point is six finite numbers within the joints' limits.

    Raises:
        InvalidTrajectory: It is not; the message names the joint, the value and the limits.
    """
    for joint, (value, (low, high)) in enumerate(zip(position, model.joint_limits), 1):
        if not low - _WIRE_ROUNDING <= value <= high + _WIRE_ROUNDING:
            raise InvalidTrajectory("joint %d would be at %.6f rad; valid: %.6f to %.6f rad" % (
                joint, value, low, high))


def _stoppable(distance: float) -> float:
    return stoppable_speed(distance, _BRAKE, SERVO_PERIOD_S)


def _changed(before: float, wanted: float) -> float:
    """Return the speed nearest to the wanted one that a cycle can change to, rad/s."""
    return min(max(wanted, before - _CHANGE), before + _CHANGE)
