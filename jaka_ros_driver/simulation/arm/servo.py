"""The servo stream: points of 8 ms and multiples, interpolated, filtered (docs/controller-protocol.md section 5.6)."""
import enum
import math
from collections import deque
from typing import Deque, List, NamedTuple, Optional

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.coasting import Coast
from jaka_ros_driver.simulation.arm.events import PlantEvent, TargetRejected
from jaka_ros_driver.simulation.arm.frames import ArmFrames, finite_six
from jaka_ros_driver.simulation.arm.legs import LegPace, LineLeg
from jaka_ros_driver.simulation.arm.profiles import CYCLE_TIME_S
from jaka_ros_driver.simulation.arm.servo_filters import Filter
from jaka_ros_driver.state import Vector

MAX_STEP_SPEED = math.pi
"""Highest joint speed, rad/s (180 deg/s), of a point.

One that needs more is ignored, docs/controller-protocol.md section 5.6.5.
"""
MAX_WAITING = 49
"""Largest number of points behind the one for the next cycle; further ones are ignored. No vendor value exists."""
STARVED_S = 0.1
"""Time, s, without a point after which a stream fails, with ``Starvation.FAULT``. No vendor value exists."""
MAX_CYCLES = 1000
"""Largest ``stepNum``. No vendor value exists."""

_UNIT_PACE = LegPace(1.0, 1.0, 1.0, 1.0, 1.0)


_MISSING_S = 0.04
"""Time, s, for which a stream without points is not idle: a few cycles, less than any client's pause."""


class Starvation(enum.Enum):
    """The reactions of the arm to a servo stream without more points.

    Hold the last target, repeat the last increment, slow down from its last speed, or fail after ``STARVED_S``.
    """

    HOLD = "hold"
    REPEAT = "repeat"
    COAST = "coast"
    FAULT = "fault"


class _Point(NamedTuple):
    start: Vector
    end: Vector
    line: Optional[LineLeg]
    duration: float


class ServoStream:
    """The points of a servo stream, from entering servo mode until it is left.

    Attributes:
        joints: Commanded, rad (6,).
        has_failed: True where it ran dry and that is a fault.
    """

    def __init__(self, frames: ArmFrames, joints: Vector, servo_filter: Filter, starvation: Starvation,
                 max_waiting: int = MAX_WAITING) -> None:
        self.joints = joints
        self._max_waiting = max_waiting
        self._starvation = starvation
        self._frames, self._filter = frames, servo_filter
        self._points: Deque[_Point] = deque()
        self._target = joints  # interpolated, before the filter
        self._end = joints  # of the last point taken
        self._elapsed = 0.0
        self._increment: Vector = (0.0,) * 6
        self._coast: Optional[Coast] = None
        self._dry_for: Optional[float] = None
        self.has_failed = False
        self._clamped = frames.joint_on_limit(joints)  # where the stream begins it has not driven the arm

    @property
    def is_idle(self) -> bool:
        """True when no point is left that leads elsewhere, and none has been missing for a moment only.

        Whether a cycle meets a client's point of the same cycle is chance: neither one that holds the arm nor a cycle
        without one in the middle of a stream may make the arm appear to begin or to end a motion.
        """
        if any(point.end != self._target for point in self._points):
            return False
        return self._dry_for is None or self._dry_for >= _MISSING_S or not any(self._increment)

    @property
    def has_points(self) -> bool:
        """True while a point waits."""
        return bool(self._points)

    def add_joints(self, target: Vector, relative: bool, cycles: int) -> bool:
        """Append a joint point, rad (6,), to be reached in ``cycles`` cycles; return False where it is ignored.

        Raises:
            TargetRejected: Bad numbers, a point beyond a soft limit, ``cycles`` out of range.
        """
        finite_six("servo point", target)
        end = tuple(a + b for a, b in zip(self._end, target)) if relative else tuple(target)
        return self._add(end, None, cycles)

    def add_pose(self, target: Pose, relative: bool, cycles: int) -> bool:
        """Append a pose in the active user frame, as ``add_joints`` does; one out of reach is rejected, too."""
        start = self._frames.tool_at(self._end)
        goal = self._frames.displaced(start, target) if relative else self._frames.in_base(target)
        end = self._frames.nearest_joints(goal, self._end)
        if end is None:
            raise TargetRejected(events.INVERSE_KINEMATICS_FAILED, "servo point out of reach")
        return self._add(end, LineLeg(start, goal, _UNIT_PACE), cycles)

    def _add(self, end: Vector, line: Optional[LineLeg], cycles: int) -> bool:
        if not 1 <= cycles <= MAX_CYCLES:
            raise TargetRejected(events.TARGET_OUTSIDE_LIMITS, "stepNum must be 1 to %d" % MAX_CYCLES)
        outside = self._frames.joint_outside(end)
        if outside is not None:
            cause = events.on_soft_limit(*outside)
            raise TargetRejected(cause, "servo point: " + cause.text)
        duration = cycles * CYCLE_TIME_S
        longest = max(abs(b - a) for a, b in zip(self._end, end))
        if longest > MAX_STEP_SPEED * duration * (1.0 + 1e-9) or len(self._points) > self._max_waiting:
            return False
        self._points.append(_Point(self._end, end, line, duration))
        self._end = end
        return True

    def step(self, dt: float) -> List[PlantEvent]:
        """Run one cycle of ``dt`` s; ``joints`` then holds the new command. Return the events of this cycle."""
        if self._points:
            before = self._target
            self._interpolate(dt)
            self._increment = tuple(b - a for a, b in zip(before, self._target))
            self._dry_for, self._coast = 0.0, None
        elif self._dry_for is not None:
            self._starve(dt)
        filtered = self._filter.step(self._target, dt)
        self.joints = self._within_limits(filtered)
        return self._limit_events()

    def _interpolate(self, dt: float) -> None:
        point = self._points[0]
        self._elapsed += dt
        share = self._elapsed / point.duration
        if share >= 1.0 - 1e-6:
            self._points.popleft()
            self._elapsed = 0.0
            self._target = point.end
            return
        joints: Optional[Vector] = None
        if point.line is not None:
            joints = self._frames.nearest_joints(point.line.at(share * point.line.length), self._target)
        self._target = joints or tuple(a + share * (b - a) for a, b in zip(point.start, point.end))

    def _starve(self, dt: float) -> None:
        """Run one cycle for which there is no point; the first points of a stream have come before."""
        self._dry_for = (self._dry_for or 0.0) + dt
        if self._starvation is Starvation.REPEAT:
            self._repeat()
        elif self._starvation is Starvation.COAST:
            if self._coast is None:
                self._coast = Coast(self._frames.model, self._target, [q / dt for q in self._increment])
            self._end = self._target = self._coast.step(dt)
        elif self._starvation is Starvation.FAULT:
            self.has_failed = self._dry_for > STARVED_S

    def _repeat(self) -> None:
        target = tuple(a + b for a, b in zip(self._target, self._increment))
        self._end = self._target = self._within_limits(target)
        if self._target != target:
            self._increment = (0.0,) * 6

    def _within_limits(self, joints: Vector) -> Vector:
        return tuple(min(max(q, low), high) for q, (low, high) in zip(joints, self._frames.model.joint_limits))

    def _limit_events(self) -> List[PlantEvent]:
        reached = self._frames.joint_on_limit(self.joints)
        if reached == self._clamped:
            return []
        self._clamped = reached
        return [] if reached is None else [events.on_soft_limit(*reached)]
