"""The scan of a Cartesian path by inverse kinematics before it is run.

It finds where the path ends early, and the highest speed on each stretch.
"""
from typing import Callable, List, NamedTuple, Optional, Sequence

from jaka_ros_driver.kinematics.rotations import Transform
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent
from jaka_ros_driver.simulation.arm.frames import ArmFrames
from jaka_ros_driver.state import Vector

JointsOfPose = Callable[[Transform, Sequence[float]], Optional[Vector]]

SINGULAR_SHARE = 0.1
"""Share of the speed, allowed by joint limits, below which a place counts as singular."""
SINGULAR_REFERENCE_SPEED = 0.25
"""Speed, m/s, to which ``SINGULAR_SHARE`` refers where the programmed one is higher."""

_BEND = 0.01  # rad; a stretch is split where a joint, in its middle, is farther than this from the chord
_CHORD = 0.25  # rad; or where a joint moves farther than this over it
# The next four are lengths along the path, m, or the equivalent for a rotation:
_SHORTEST = 2e-4  # stretches are not split below this
_LIMIT_EDGE = 1e-7  # accuracy of the place where a joint reaches its limit
_REACH_EDGE = 4e-5  # accuracy of the edge of the reach
_REACH_MARGIN = 2e-4  # paths end this far before it, because joints turn infinitely fast right at it
_METRES_PER_RAD = 0.3
"""Way, m, that takes as much of a path as one rad of rotation does."""
_SPEED_SHARE = 0.95  # share of the joint speed limits that is used along a path
_BUDGET = 0.5  # share of the joint acceleration limits for speed changes; the rest is for the path's bends
_BEND_MARGIN = 1.4  # bends within a stretch may be sharper than their mean


class PathStretch(NamedTuple):
    """A piece of a path with constant limits, all in units of the path's parameter.

    Attributes:
        way: Its length.
        speed: Limit.
        acceleration: Limit as programmed, or what the joints can do.
        braking: Deceleration of a stop: what the arm can do, independent of the programmed acceleration.
    """

    way: float
    speed: float
    acceleration: float
    braking: float


class Break(NamedTuple):
    """The early end of a path: ``way``, the parameter of the last good place, and the cause."""

    way: float
    cause: PlantEvent


class PathScan:
    """A walk along a path by inverse kinematics.

    Attributes:
        stretches: From the start to the end, or to the break.
        joints: At the end, or at the break.
        broken: Where and why the path ends early; None where it can be followed to its end.
    """

    def __init__(self, frames: ArmFrames, joints_of: JointsOfPose, at: Callable[[float], Transform],
                 start_joints: Vector, limits: PathStretch, way: float, angle: float, pieces: int) -> None:
        """Walk the path.

        Args:
            frames: The arm.
            joints_of: Pose and reference joints to the nearest joints, rad (6,), limits not checked; None if out of
                reach.
            at: Parameter to pose.
            start_joints: Where the path begins.
            limits: Limits of the whole path where the joints do not lower them; ``way`` is the path's length in the
                parameter.
            way: Translation along the path, m.
            angle: Rotation along the path, rad.
            pieces: How many stretches to begin with.
        """
        length = limits.way
        self._unit = length / (way + _METRES_PER_RAD * angle)
        self.stretches: List[PathStretch] = []
        self._starts: List[Vector] = []  # joints at the start of each stretch
        self.joints = start_joints
        self.broken: Optional[Break] = None
        self._frames, self._joints_of, self._at = frames, joints_of, at
        self._limits = limits
        self._slowest = SINGULAR_SHARE * min(limits.speed, SINGULAR_REFERENCE_SPEED * self._unit)
        for n in range(pieces):
            if not self._walk(length * n / pieces, length * (n + 1) / pieces):
                break
        self.stretches = merged(self.stretches, _SHORTEST * self._unit)

    def _walk(self, begin: float, end: float) -> bool:
        """Scan one stretch and split it where needed; return False where the path breaks off in it."""
        start, width = self.joints, end - begin
        middle = self._joints_of(self._at(begin + 0.5 * width), start)
        last = self._joints_of(self._at(end), middle) if middle is not None else None
        if middle is None or last is None:
            problem: Optional[PlantEvent] = events.TARGET_UNREACHABLE
        else:
            problem = self._outside(middle) or self._outside(last)
        if problem is not None:
            if width < (_REACH_EDGE if problem.joint is None else _LIMIT_EDGE) * self._unit:
                self._break_off(begin, problem)
                return False
            return self._walk(begin, begin + 0.5 * width) and self._walk(begin + 0.5 * width, end)
        assert middle is not None and last is not None
        bend = max(abs(a - 2.0 * m + b) for a, m, b in zip(start, middle, last))
        chord = max(abs(b - a) for a, b in zip(start, last))
        if (bend > _BEND or chord > _CHORD) and width > _SHORTEST * self._unit:
            return self._walk(begin, begin + 0.5 * width) and self._walk(begin + 0.5 * width, end)
        stretch = self._limited(start, middle, last, width)
        if stretch.speed < self._slowest:
            self.broken = Break(begin, events.SINGULARITY)
            return False
        self.stretches.append(stretch)
        self._starts.append(start)
        self.joints = last
        return True

    def _break_off(self, way: float, cause: PlantEvent) -> None:
        edge = way
        while cause.joint is None and self.stretches and edge - way < _REACH_MARGIN * self._unit:
            way -= self.stretches.pop().way
            self.joints = self._starts.pop()
        self.broken = Break(way, cause)

    def _outside(self, joints: Vector) -> Optional[PlantEvent]:
        outside = self._frames.joint_outside(joints)
        return None if outside is None else events.on_soft_limit(*outside)

    def _limited(self, start: Vector, middle: Vector, last: Vector, width: float) -> PathStretch:
        model = self._frames.model
        half = 0.5 * width
        _, speed, acceleration, braking = self._limits
        for a, m, b, top, strongest in zip(start, middle, last, model.joint_max_speed, model.joint_max_acceleration):
            bend = abs(a - 2.0 * m + b) / (half * half)
            rate = max(abs(m - a), abs(b - m)) / half + 0.5 * half * bend
            if rate > 0.0:
                speed = min(speed, _SPEED_SHARE * top / rate)
                braking = min(braking, _BUDGET * strongest / rate)
            if bend > 0.0:
                speed = min(speed, ((1.0 - _BUDGET) * strongest / (_BEND_MARGIN * bend)) ** 0.5)
        return PathStretch(width, speed, min(acceleration, braking), braking)


def merged(stretches: Sequence[PathStretch], shortest: float = 0.0) -> List[PathStretch]:
    """Join stretches to their neighbours where the limits are nearly the same or one is shorter than ``shortest``.

    The lower limits of the two then hold.
    """
    result: List[PathStretch] = []
    for stretch in stretches:
        last = result[-1] if result else None
        if last is not None and (min(last.way, stretch.way) < shortest or _nearly_same(last, stretch)):
            result[-1] = PathStretch(last.way + stretch.way, min(last.speed, stretch.speed),
                                     min(last.acceleration, stretch.acceleration), min(last.braking, stretch.braking))
        else:
            result.append(stretch)
    return result


def _nearly_same(a: PathStretch, b: PathStretch) -> bool:
    return all(abs(x - y) <= 0.02 * min(x, y) for x, y in zip(a[1:3], b[1:3]))
