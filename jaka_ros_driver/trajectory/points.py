"""The trajectory that a client asks for: points, and how near the arm must keep to them."""
import math
from dataclasses import dataclass, replace
from typing import Optional, Tuple

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT
from jaka_ros_driver.state import Vector

MAX_POINTS = 100_000
"""Most points of a plan, 800 s with a point each cycle; a longer plan is sent in parts."""
MAX_DURATION_S = 24.0 * 3600.0
"""Longest trajectory, s: a day; a time beyond it is in other units."""
REST_VELOCITY = 1e-3
"""Highest velocity, rad/s, of a last point that still means rest."""


class InvalidTrajectory(InvalidCommand):
    """The trajectory is malformed, or the arm cannot follow it; nothing was sent."""


class TrajectoryOfThePast(InvalidTrajectory):
    """The trajectory whose points were all to be reached before now."""


@dataclass(frozen=True)
class TrajectoryPoint:
    """One point of a trajectory; joint 1 (base) first.

    Attributes:
        time: From the trajectory's start, s.
        position: rad (6,).
        velocity: rad/s (6,), or None.
        acceleration: rad/s2 (6,), or None.
    """

    time: float
    position: Vector
    velocity: Optional[Vector] = None
    acceleration: Optional[Vector] = None


@dataclass(frozen=True)
class JointTrajectory:
    """Points in the order of time.

    Attributes:
        points: At least one.
        starts_at: When it is to start, monotonic time, s; None: as soon as it is taken.
        may_end_moving: A last point with a velocity is taken; the arm brakes behind it. Else it is refused.
        held: Indices of joints that the points do not name: they stay where they are when the trajectory begins.
    """

    points: Tuple[TrajectoryPoint, ...]
    starts_at: Optional[float] = None
    may_end_moving: bool = False
    held: Tuple[int, ...] = ()

    def holding(self, position: Vector) -> "JointTrajectory":
        """Return the trajectory with the joints that it does not name held at ``position``, rad (6,)."""
        if not self.held:
            return self

        def filled(values: Optional[Vector], held: Vector) -> Optional[Vector]:
            return None if values is None else tuple([
                held[joint] if joint in self.held else value for joint, value in enumerate(values)])

        still = (0.0,) * JOINT_COUNT
        return replace(self, points=tuple([TrajectoryPoint(
            point.time, filled(point.position, position) or (), filled(point.velocity, still),
            filled(point.acceleration, still)) for point in self.points]))


@dataclass(frozen=True)
class TrajectoryTolerances:
    """The deviations that are allowed from a trajectory; None: the joint is not watched.

    Attributes:
        path: On the way, rad (6,).
        goal: At the end, rad (6,).
        goal_time: Longest time, s, after its end at which the arm must rest there; None: however long it takes.
    """

    path: Tuple[Optional[float], ...]
    goal: Tuple[Optional[float], ...]
    goal_time: Optional[float]


def check_points(trajectory: JointTrajectory) -> None:
    """Check that the points are six finite numbers each, at rising times, and that the arm is to rest at the end.

    Raises:
        InvalidTrajectory: The message names the point, its value, and what is valid.
    """
    points = trajectory.points
    if not 1 <= len(points) <= MAX_POINTS:
        raise InvalidTrajectory("the trajectory has %d points; valid: 1 to %d" % (len(points), MAX_POINTS))
    before = -math.inf
    for number, point in enumerate(points, 1):
        _check_vector(number, "position", point.position, "rad")
        if point.velocity is not None:
            _check_vector(number, "velocity", point.velocity, "rad/s")
        if point.acceleration is not None:
            _check_vector(number, "acceleration", point.acceleration, "rad/s2")
            if point.velocity is None:
                raise InvalidTrajectory("point %d has accelerations, and no velocities" % number)
        if not 0.0 <= point.time <= MAX_DURATION_S:
            raise InvalidTrajectory("point %d has the time %.9g s; valid: 0 to %g s" % (
                number, point.time, MAX_DURATION_S))
        if point.time <= before:
            raise InvalidTrajectory("point %d has the time %.9g s, and the point before it %.9g s; times must rise" % (
                number, point.time, before))
        before = point.time
    last = points[-1].velocity
    if last is not None and not trajectory.may_end_moving and max(map(abs, last)) > REST_VELOCITY:
        raise InvalidTrajectory("the last point has a velocity of %.4g rad/s; the arm must rest there" % max(
            last, key=abs))


def _check_vector(number: int, name: str, values: Vector, unit: str) -> None:
    if len(values) != JOINT_COUNT:
        raise InvalidTrajectory("point %d has %d numbers as its %s; it must be %d, in %s" % (
            number, len(values), name, JOINT_COUNT, unit))
    for joint, value in enumerate(values, 1):
        if not math.isfinite(value):
            raise InvalidTrajectory("point %d: the %s of joint %d is %r; it must be a finite number in %s" % (
                number, name, joint, value, unit))
