"""The joints that lead the tool along the line of a velocity jog, and stand where they cannot.

Every frame is the inverse of a place on the line, so that nothing sideways is ever sent. Each cycle looks for the
wanted speed, or a lower one, from which the arm also comes to rest on the line, with every joint within its limits,
speed and acceleration, and without crossing a singularity. The frames of that braking are kept: where no such speed is
found, and when the dead-man is released, they are sent.
"""
import contextlib
import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_ros_driver.client.core.velocity_jog.line import JogLine, line_along, turned
from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, SPHERICAL_WRIST, THREE_PARALLEL, ArmModel
from jaka_ros_driver.kinematics.forward import (
    SingularityMeasures,
    forward,
    jacobian_of_links,
    link_transforms,
    signed_measures,
)
from jaka_ros_driver.kinematics.limits import (
    JOINT_ACCELERATION_CEILING,
    SERVO_PERIOD_S,
    TCP_ACCELERATION_CEILING,
    stream_limits,
)
from jaka_ros_driver.kinematics.rotations import Transform, compose, invert, turn_between
from jaka_ros_driver.state import Vector

STEP_CHANGE = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S
"""Largest change, rad/s, of a joint's speed in one cycle."""
_MARGINS = SingularityMeasures(wrist=0.005, elbow=0.005, shoulder=0.002)
_MARGINS_OF_ONE = SingularityMeasures(wrist=0.001, elbow=0.0, shoulder=0.0)
"""Singularity measures (dimensionless; shoulder in m) that a jog does not go below; those of models with one measure.

An arm that begins nearer to a singularity gets as near as it was.
"""
_EXACT = 1e-7
"""Largest error, m and rad, of the tool's place on the line."""
_CORRECTIONS = 4
"""Most corrections by the Jacobian; where the last is not exact, a lower speed is tried."""
_LARGEST_CORRECTION = 0.1
"""Largest step, rad, of a joint from the place where it was expected; a larger one leads to another branch."""
_SHARE = 0.98
"""Share of a joint's speed and acceleration for which a speed is computed; the rest is for the bend of the way."""
_ROUNDING = 1e-9
"""Allowance for rounding."""
_SINGULAR = 1e-4
"""Singularity measure below which the Jacobian has no inverse: only what the joints can do there is asked of them."""
_TRIES = 3
"""Most tries of a step, with smaller and smaller changes: where three fail, one more gives a standing arm as well."""
_SLOW, _SLOWEST = 0.01, 1e-6
"""Rates of the way, 1/s, at which a step is too short to tell of the next one, and below which it is none."""
_LESS, _MORE, _LEAST = 0.3, 2.0, 0.1
"""Factors of the share of the wanted change that is tried, after one that failed and one that did not; its lowest."""
_NOTHING = (0.0,) * JOINT_COUNT


class LineStep(NamedTuple):
    """A step along the line in one cycle.

    Attributes:
        joint_position: At its end, rad (6,).
        joint_velocity: Within it, rad/s (6,).
        way: On the line, at its end.
        speed: Of the way within it, 1/s.
        measures: At its end, with their signs.
    """

    joint_position: Vector
    joint_velocity: Vector
    way: float
    speed: float
    measures: SingularityMeasures


class LineFollower:
    """The tool on its line: place, speed, and the frames by which it comes to rest.

    Attributes:
        now: The last step.
        obstacle: Why the arm stands, though it is asked to move; "" where it does not.
    """

    def __init__(self, joint_position: Vector, flange_t_tool: Transform, model: ArmModel, tops: Sequence[float],
                 longest_brake: int) -> None:
        """Begin at rest.

        Args:
            joint_position: rad (6,).
            flange_t_tool: The tool that is led.
            model: The arm model with the joint limits.
            tops: Highest speed of each joint, rad/s.
            longest_brake: Cycles from any speed to rest.
        """
        self.now = LineStep(joint_position, _NOTHING, 0.0, 0.0, signed_measures(
            model, joint_position, link_transforms(model, joint_position)))
        self.flange_t_tool = flange_t_tool
        self.obstacle = ""
        self._tool_t_flange = invert(flange_t_tool)
        self._model, self._tops, self._longest_brake = model, tops, longest_brake
        self._limits = stream_limits(model)
        margins = _MARGINS if model.family in (THREE_PARALLEL, SPHERICAL_WRIST) else _MARGINS_OF_ONE
        self._margins = [min(margin, abs(measure)) for margin, measure in zip(margins, self.now.measures)]
        self._line: Optional[JogLine] = None
        self._before: Optional[LineStep] = None
        self._brake: List[LineStep] = []
        self._share = 1.0
        self._trouble = ""

    @property
    def is_still(self) -> bool:
        """True where the last step was none, and the next one is none unless more is asked for."""
        return not any(self.now.joint_velocity) and not self._brake

    def brake(self) -> Vector:
        """Take the next step of the braking; return the joints, rad (6,)."""
        self.obstacle = ""
        self._take(self._line, self._brake)
        return self.now.joint_position

    def step(self, aim: Vector, frame: JogFrame) -> Vector:
        """Take one step towards a twist, m/s (3,) and rad/s (3,) along the axes of BASE or TOOL; return the joints."""
        if not any(aim) and self.now.speed == 0.0:
            return self.brake()
        twist = self._twist(frame)
        change = _towards(twist, aim)
        slower = self._brake[0].speed if self._brake else 0.0
        led, speed = self._led(twist, change, frame)
        possible = 1.0 if led is self._line or not any(twist) else self._possible_share(change, frame)
        self._trouble = ""
        for share in (self._share, max(_LEAST, _LESS * self._share)):
            line, tried = led, slower + share * (speed - slower)
            if led is not self._line and share * possible < 1.0:
                line, tried = self._led(twist, tuple([share * possible * c for c in change]), frame)
            steps = self._steps(line, tried)
            if steps:
                self._share = min(1.0, _MORE * share)
                self.obstacle = ""
                self._take(line, steps)
                return self.now.joint_position
        is_stuck, self._share = self._share == _LEAST and self.now.speed == 0.0, max(_LEAST, _LESS * self._share)
        self._take(self._line, self._brake)
        self.obstacle = self._trouble if is_stuck else ""
        return self.now.joint_position

    # ---- the line ----

    def _twist(self, frame: JogFrame) -> Vector:
        """Return the tool's present twist along the axes of BASE or TOOL."""
        line, speed = self._line, self.now.speed
        if line is None or speed == 0.0:
            return _NOTHING
        twist = tuple([speed * value for value in line.direction])
        if line.frame is frame:
            return twist
        tool = line.at(self.now.way)
        return turned(tool if frame is JogFrame.BASE else invert(tool), twist)

    def _led(self, twist: Vector, change: Vector, frame: JogFrame) -> Tuple[JogLine, float]:
        """Return the line, and the rate on it, of the changed twist: the present line, or one that begins here."""
        wanted = tuple([a + b for a, b in zip(twist, change)])
        if self._line is not None:
            if not any(wanted):
                return self._line, 0.0
            speed = self._line.speed_of(wanted) if self._line.frame is frame else math.nan
            if not math.isnan(speed):
                return self._line, speed
        here = compose(forward(self._model, self.now.joint_position), self.flange_t_tool)
        return line_along(here if self._line is None else self._line.at(self.now.way), wanted, frame)

    def _possible_share(self, change: Vector, frame: JogFrame) -> float:
        """Return the share of a change of the twist for which the joints have the acceleration."""
        frames = link_transforms(self._model, self.now.joint_position)
        tool = compose(frames[-1], self.flange_t_tool)
        joints = _solved(jacobian_of_links(frames, tool), turned(tool, change) if frame is JogFrame.TOOL else change,
                         self.now.measures)
        return min(1.0, _SHARE * STEP_CHANGE / max(_ROUNDING, *map(abs, joints)))

    def _take(self, line: Optional[JogLine], steps: List[LineStep]) -> None:
        self._before = self.now if line is self._line else None
        self._line = line
        self.now = steps[0] if steps else self.now._replace(joint_velocity=_NOTHING, speed=0.0)
        self._brake = steps[1:]

    # ---- speeds ----

    def _steps(self, line: JogLine, speed: float) -> List[LineStep]:
        """Return the step at this speed, or near it, and the steps that then bring the arm to rest; [] without one."""
        is_same = line is self._line
        now = self.now if is_same else self.now._replace(way=0.0, speed=speed if any(self.now.joint_velocity) else 0.0)
        linear, angular = math.hypot(*line.direction[:3]), math.hypot(*line.direction[3:])
        change = SERVO_PERIOD_S * min(TCP_ACCELERATION_CEILING / max(linear, _ROUNDING),
                                      JOINT_ACCELERATION_CEILING / max(angular, _ROUNDING))
        is_bend = not is_same and now.speed != 0.0
        is_known = is_same and abs(now.speed) > _SLOW
        rates = _expected(self._before, now) if is_known else self._rates(line, now)
        step = self._step(line, now, speed, 0.0 if is_bend else change, rates)
        if step is None:
            return []
        steps = [step]
        while steps[-1].speed != 0.0:
            if len(steps) > self._longest_brake:
                self._trouble = self._trouble or self._singularity(self.now)
                return []
            before, last = (steps[-2] if len(steps) > 1 else now if is_same else None), steps[-1]
            slower = math.copysign(max(0.0, abs(last.speed) - change), last.speed)
            braked = self._step(line, last, slower, change, _expected(before, last))
            if braked is None:
                return []
            steps.append(braked)
        return steps

    def _rates(self, line: JogLine, now: LineStep) -> List[float]:
        """Return the joint velocities, rad, for each unit of way at the present place."""
        frames = link_transforms(self._model, now.joint_position)
        tool = compose(frames[-1], self.flange_t_tool)
        twist = turned(tool, line.direction) if line.frame is JogFrame.TOOL else line.direction
        return _solved(jacobian_of_links(frames, tool), twist, now.measures)

    def _step(self, line: JogLine, now: LineStep, wanted: float, change: float, rates: Sequence[float]
              ) -> Optional[LineStep]:
        """Return one step whose rate is as near to the wanted one as the joints allow; None where there is none.

        change: Largest difference of its rate from the present one. rates: Expected joint velocities for each unit.
        """
        for _ in range(_TRIES):
            low, high = now.speed - change, now.speed + change
            for rate, before, top in zip(rates, now.joint_velocity, self._tops):
                if abs(rate) > _ROUNDING:
                    ends = (max(-_SHARE * top, before - _SHARE * STEP_CHANGE) / rate,
                            min(_SHARE * top, before + _SHARE * STEP_CHANGE) / rate)
                    low, high = max(low, min(ends)), min(high, max(ends))
            speed = min(max(wanted, low), high)
            if abs(speed) < _SLOWEST:
                speed = 0.0
            if low > high or (speed == 0.0 and wanted != 0.0):
                break
            step = self._tried(line, now, speed, rates)
            if step is None or self._is_slow_enough(now, step):
                return step
            if speed == 0.0:
                break
            rates = [v / speed for v in step.joint_velocity]
        self._trouble = self._trouble or self._singularity(now)
        return None

    def _is_slow_enough(self, now: LineStep, step: LineStep) -> bool:
        return all(abs(v) <= top + _ROUNDING and abs(v - before) <= STEP_CHANGE + _ROUNDING
                   for v, before, top in zip(step.joint_velocity, now.joint_velocity, self._tops))

    # ---- places ----

    def _tried(self, line: JogLine, now: LineStep, speed: float, rates: Sequence[float]) -> Optional[LineStep]:
        """Return the step of this rate; None, with the trouble noted, where the arm cannot be at its end."""
        if speed == 0.0:
            return now._replace(joint_velocity=_NOTHING, speed=0.0)
        way = now.way + speed * SERVO_PERIOD_S
        target = compose(line.at(way), self._tool_t_flange)
        begun = now.joint_position
        joints: Vector = tuple([q + rate * speed * SERVO_PERIOD_S for q, rate in zip(begun, rates)])
        for _ in range(_CORRECTIONS):
            frames = link_transforms(self._model, joints)
            reached = frames[-1]
            error = (target[9] - reached[9], target[10] - reached[10], target[11] - reached[11],
                     *turn_between(reached, target))
            if max(map(abs, error)) <= _EXACT:
                velocity = tuple([(b - a) / SERVO_PERIOD_S for a, b in zip(begun, joints)])
                return self._checked(now, LineStep(joints, velocity, way, speed, signed_measures(
                    self._model, joints, frames)))
            correction = _solved(jacobian_of_links(frames, reached), error, now.measures)
            if max(map(abs, correction)) > _LARGEST_CORRECTION:
                break
            joints = tuple([q + c for q, c in zip(joints, correction)])
        self._trouble = self._singularity(now)
        return None

    def _checked(self, now: LineStep, step: LineStep) -> Optional[LineStep]:
        """Return the step; None, with the trouble noted, where a joint leaves its limits or a singularity is near."""
        for joint, (before, angle, (low, high)) in enumerate(zip(now.joint_position, step.joint_position,
                                                                 self._limits), 1):
            if not min(low, before) <= angle <= max(high, before):
                self._trouble = "joint %d is at its limit" % joint
                return None
        for index, (was, is_, margin) in enumerate(zip(now.measures, step.measures, self._margins)):
            if math.copysign(1.0, was) * is_ < margin - _ROUNDING:
                self._trouble = self._named(index, now.joint_position)
                return None
        return step

    def _singularity(self, now: LineStep) -> str:
        """Return which singularity is the nearest, in words."""
        shares = [abs(measure) / margin for measure, margin in zip(now.measures, _MARGINS)]
        return self._named(shares.index(min(shares)), now.joint_position)

    def _named(self, index: int, joint_position: Vector) -> str:
        if self._model.family not in (THREE_PARALLEL, SPHERICAL_WRIST):
            return "singularity: jog by joints"
        if index == 0:
            return "wrist singularity: jog joint 5"
        if index == 2:
            return "shoulder singularity, the wrist is above joint 1: jog joint 2"
        elbow = joint_position[2] + self._model.dh[2].theta_offset
        is_stretched = -math.sin(elbow) if self._model.family == SPHERICAL_WRIST else math.cos(elbow)
        return "the arm is %s: jog joint 3" % ("stretched" if is_stretched > 0.0 else "folded")


def _expected(before: Optional[LineStep], last: LineStep) -> List[float]:
    """Return the joint velocities, rad, for each unit of way that are to be expected after two steps."""
    rates = [v / last.speed for v in last.joint_velocity]
    if before is None or before.speed == 0.0:
        return rates
    return [a + (a - v / before.speed) * last.speed / before.speed for a, v in zip(rates, before.joint_velocity)]


def _solved(matrix: "np.ndarray[Tuple[int, int], np.dtype[np.float64]]", twist: Sequence[float],
            measures: SingularityMeasures) -> List[float]:
    """Return the joint velocities, rad/s (6,), of a twist, m/s (3,) and rad/s (3,); at a singularity the smallest."""
    if min(map(abs, measures)) >= _SINGULAR:
        with contextlib.suppress(np.linalg.LinAlgError):
            solved: List[float] = np.linalg.solve(matrix, np.array(twist)).tolist()
            return solved
    smallest: List[float] = np.linalg.lstsq(matrix, np.array(twist), rcond=_SINGULAR)[0].tolist()
    return smallest


def _towards(twist: Vector, aim: Vector) -> Vector:
    """Return the change of a twist in one cycle, on a straight line to the aim."""
    change = tuple([a - t for a, t in zip(aim, twist)])
    share = 1.0
    for size, ceiling in ((math.hypot(*change[:3]), TCP_ACCELERATION_CEILING),
                          (math.hypot(*change[3:]), JOINT_ACCELERATION_CEILING)):
        if size > ceiling * SERVO_PERIOD_S:
            share = min(share, ceiling * SERVO_PERIOD_S / size)
    return tuple([share * c for c in change])
