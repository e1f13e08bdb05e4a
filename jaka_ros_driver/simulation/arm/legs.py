"""The geometry of Cartesian paths: straight lines, arcs, and the rounding of the corner between two lines.

The parameter of a leg is its length in metre-equivalents: the larger of its translation, m, and its rotation, rad,
times speed over rotation speed. At ``speed`` along it neither translation nor rotation is faster than asked for.
"""
import math
from typing import NamedTuple, Optional, Sequence

from jaka_ros_driver.kinematics.rotations import Transform, Vector3, rotation_angle_between
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.frames import rotation_between, turned

_TINY = 1e-9
"""Shortest way, m, and smallest angle, rad, that are more than rounding."""
_MOST_TURNS = 100
"""Most turns of an arc.

All of its way is scanned before it is accepted, about 1 ms a turn, while nobody else is served.
"""


class LegPace(NamedTuple):
    """The speeds and accelerations of a leg, m/s, m/s2, rad/s, rad/s2.

    Braking is the tool's deceleration in a stop, m/s2.
    """

    speed: float
    acceleration: float
    rotation_speed: float
    rotation_acceleration: float
    braking: float


class Leg:
    """One programmed piece of a Cartesian path, parameter 0 to ``length``.

    Attributes:
        start: ``base_t_tool`` at its start.
        end: ``base_t_tool`` at its end.
        way: Translation along it, m.
        angle: Rotation along it, rad.
        length: Of the parameter, m.
        max_speed: Highest rate of the parameter, m/s.
        max_acceleration: Of the parameter, m/s2.
        max_braking: Of the parameter in a stop, as far as the tool is concerned, m/s2.
        line_id: ``executing_line_id``.
        tolerance: How far the rounded corner at its end may leave the two lines, m.
    """

    def __init__(self, start: Transform, end: Transform, way: float, angle: float, pace: LegPace,
                 line_id: int, tolerance: float) -> None:
        self.start, self.end, self.way, self.angle = start, end, way, angle
        self.pace, self.line_id, self.tolerance = pace, line_id, tolerance
        self.length = max(way, angle * pace.speed / pace.rotation_speed)
        self.max_speed = pace.speed
        self.max_acceleration = math.inf
        self.max_braking = math.inf
        if angle > _TINY:
            self.max_acceleration = pace.rotation_acceleration * self.length / angle
        if way > _TINY:
            self.max_acceleration = min(self.max_acceleration, pace.acceleration * self.length / way)
            self.max_braking = pace.braking * self.length / way

    def at(self, parameter: float) -> Transform:
        """Return ``base_t_tool`` at this parameter."""
        raise NotImplementedError


class LineLeg(Leg):
    """A straight line; the rotation turns about one fixed axis.

    Attributes:
        position_rate: Change of position per parameter, shape (3,).
        rotation_rate: Rotation vector per parameter about the axes of the base, rad/m, shape (3,).
    """

    def __init__(self, start: Transform, end: Transform, pace: LegPace, line_id: int = 0, tolerance: float = 0.0,
                 rotation_vector: Optional[Vector3] = None) -> None:
        """Set start, end and pace.

        rotation_vector: The rotation from start to end, rad (3,); None for the shortest one.
        """
        shift = difference(end[9:], start[9:])
        turn = rotation_between(start, end) if rotation_vector is None else rotation_vector
        super().__init__(start, end, norm(shift), norm(turn), pace, line_id, tolerance)
        scale = 1.0 / self.length if self.length > 0.0 else 0.0
        self.position_rate = scaled(shift, scale)
        self.rotation_rate = scaled(turn, scale)

    def at(self, parameter: float) -> Transform:
        if parameter >= self.length:
            return self.end
        position = along(self.start[9:], self.position_rate, parameter)
        if self.angle < 1e-12:
            return self.start[:9] + position
        return turned(self.start, scaled(self.rotation_rate, parameter), position)


class Arc(Leg):
    """A piece of a circle. The tangential and the radial acceleration together stay within the pace's acceleration."""

    def __init__(self, start: Transform, end: Transform, centre: Vector3, normal: Vector3, sweep: float,
                 turn: Vector3, pace: LegPace, line_id: int = 0) -> None:
        """Set geometry and pace.

        sweep: angle about ``normal``, rad. turn: the tool's rotation vector from start to end, rad (3,).
        """
        arm = difference(start[9:], centre)
        radius = norm(arm)
        # Tangential and radial acceleration are at right angles: a / sqrt(2) each makes a.
        acceleration = pace.acceleration * math.sqrt(0.5)
        super().__init__(start, end, radius * sweep, norm(turn), pace._replace(acceleration=acceleration), line_id, 0.0)
        self.max_speed = min(pace.speed, math.sqrt(acceleration * radius) * self.length / self.way)
        self._centre, self._sweep, self._turn = centre, sweep, turn
        self._arm, self._across = arm, cross(normal, arm)

    def at(self, parameter: float) -> Transform:
        if parameter >= self.length:
            return self.end
        share = parameter / self.length
        c, s = math.cos(share * self._sweep), math.sin(share * self._sweep)
        position = along(along(self._centre, self._arm, c), self._across, s)
        return turned(self.start, scaled(self._turn, share), position)


class Corner:
    """A parabola that replaces the corner between two lines and is tangent to both; its parameter continues theirs.

    No point of it is farther from the two lines, or from the corner where it passes it, than the first line's
    tolerance.

    Attributes:
        half: Length of each line that it replaces, in their parameter, m.
        max_speed: Of the parameter, m/s.
    """

    def __init__(self, before: LineLeg, after: LineLeg, half: float) -> None:
        self.half = half
        self._before, self._after = before, after
        bend = difference(after.position_rate, before.position_rate)
        twist = difference(after.rotation_rate, before.rotation_rate)
        acceleration = min(before.pace.acceleration, after.pace.acceleration)
        rotation_acceleration = min(before.pace.rotation_acceleration, after.pace.rotation_acceleration)
        square = math.inf
        if norm(bend) > _TINY:
            square = 0.5 * acceleration * 2.0 * half / norm(bend)
        if norm(twist) > _TINY:
            square = min(square, 0.5 * rotation_acceleration * 2.0 * half / norm(twist))
        self.max_speed = min(before.max_speed, after.max_speed, math.sqrt(square))

    def at(self, offset: float) -> Transform:
        """Return ``base_t_tool`` at offset -half..half from the corner."""
        share = 0.5 * (offset / self.half + 1.0)
        back = self.half * (1.0 - share) * (1.0 - share)
        ahead = self.half * share * share
        before, after = self._before, self._after
        position = along(along(before.end[9:], before.position_rate, -back), after.position_rate, ahead)
        entry = turned(before.end, scaled(before.rotation_rate, -back), position)
        return turned(entry, scaled(after.rotation_rate, ahead), position)


def corner_half(before: Leg, after: Leg) -> float:
    """Return the length of each line that a corner within ``before.tolerance`` replaces, in their parameter, m.

    It is 0 for no corner.
    """
    if not isinstance(before, LineLeg) or not isinstance(after, LineLeg) or before.tolerance <= 0.0:
        return 0.0
    if before.way < _TINY or after.way < _TINY:
        return 0.0
    longest = 0.5 * min(before.length, after.length)
    bend = norm(difference(after.position_rate, before.position_rate))
    return min(longest, 4.0 * before.tolerance / bend) if bend > _TINY else longest


def arc_through(start: Transform, via: Transform, end: Transform, turns: int, circle_mode: int, pace: LegPace,
                line_id: int) -> Arc:
    """Return the arc from start through via to end, preceded by full turns.

    Args:
        start: ``base_t_tool``, as via and end.
        via: Its position lies on the arc.
        end: Where the arc ends.
        turns: ``circle_cnt``: number of full circles before the arc, at most 100; the motion still ends at ``end``.
        circle_mode: How the tool turns: 0 by the shortest rotation from start to end; 1 the other way round the same
            axis; 2 by whichever of the two passes nearer to the orientation at via; 3 with the circle, whatever the
            orientation at end. The numbers are the SDK's, their meaning is inferred.
        pace: Speeds and accelerations.
        line_id: ``executing_line_id``.

    Raises:
        TargetRejected: The three points lie on a line, two of them coincide, or there are too many turns,
            or the mode is unknown.
    """
    a, b, c = start[9:], via[9:], end[9:]
    ab, ac = difference(b, a), difference(c, a)
    plane = cross(ab, ac)
    area = norm(plane)
    if area < 1e-6 * norm(ab) * norm(ac) or min(norm(ab), norm(ac), norm(difference(c, b))) < 1e-6:
        raise TargetRejected(events.TARGET_UNREACHABLE, "no circle through these three points")
    if not 0 <= turns <= _MOST_TURNS or circle_mode not in (0, 1, 2, 3):
        raise TargetRejected(events.TARGET_OUTSIDE_LIMITS, "circle_cnt %d, circle_mode %d" % (turns, circle_mode))
    normal = scaled(plane, 1.0 / area)
    to_centre = cross(difference(scaled(ac, dot(ab, ab)), scaled(ab, dot(ac, ac))), plane)
    centre = along(a, to_centre, 0.5 / (area * area))
    arm = difference(a, centre)
    sweep = _angle_from(arm, difference(c, centre), normal) + math.tau * turns
    turn = scaled(normal, sweep) if circle_mode == 3 else rotation_between(start, end)
    if norm(turn) > _TINY and circle_mode in (1, 2):
        long_way = scaled(turn, 1.0 - math.tau / norm(turn))
        share = _angle_from(arm, difference(b, centre), normal) / sweep
        if circle_mode == 1 or (rotation_angle_between(turned(start, scaled(long_way, share), b), via)
                                < rotation_angle_between(turned(start, scaled(turn, share), b), via)):
            turn = long_way
    return Arc(start, turned(start, turn, c) if circle_mode == 3 else end, centre, normal, sweep, turn, pace, line_id)


def _angle_from(arm: Vector3, other: Vector3, normal: Vector3) -> float:
    """Return the angle from arm to other about normal, rad, within 0 to 2 pi."""
    return math.atan2(dot(cross(arm, other), normal), dot(arm, other)) % math.tau


def norm(v: Sequence[float]) -> float:
    """Return the Euclidean length."""
    return math.hypot(*v)


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence[float], b: Sequence[float]) -> Vector3:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def difference(a: Sequence[float], b: Sequence[float]) -> Vector3:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(v: Sequence[float], factor: float) -> Vector3:
    """Return v times factor."""
    return v[0] * factor, v[1] * factor, v[2] * factor


def along(start: Sequence[float], direction: Sequence[float], way: float) -> Vector3:
    """Return start plus way times direction."""
    return start[0] + way * direction[0], start[1] + way * direction[1], start[2] + way * direction[2]
