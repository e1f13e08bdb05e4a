"""Paths of joint motions, lines and arcs that the controller runs: their audit, and the arm's progress on one."""
import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.commands import ArcMove, JointMove, LinearMove, PathCommand, Pose
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.rotations import Matrix, matrix_from_rpy, rotation_angle_between
from jaka_ros_driver.state import RobotState, Vector

MAX_SEGMENTS = 200
"""Most segments of a path: each is a command that the controller has to have in its queue."""
ARC_TURN_SPEED = math.pi
"""Angular speed, rad/s, of the tool on an arc for which the controller is given none (docs/sdk-client.md section 8)."""
_NOWHERE = 1e-6
"""Length, m or rad, below which a segment leads nowhere, and is not sent."""
_PURE_TURN = 1e-3
"""Length, m, below which the progress on a line is judged by its rotation."""
_JOINT_LEVER = 0.5
_TURN_LEVER = 0.1
"""Levers, m, that make an angle comparable with a distance: of a joint, and of the tool's rotation."""
_SLACK_S = 0.05
"""Advance, s, beside ``_FASTEST`` that is possible between two frames, because stamps are late by some ms."""
_FASTEST = 1.2
"""Largest factor by which an arm progresses faster than time between two frames, beside the slack."""
_BESIDE = 0.003
"""Largest distance, m, of an arm from its path where no corner is rounded."""
_ASIDE_SHARE = 0.3
_FAR_ASIDE = 0.02
"""The largest distance from a place at which it counts as reached: a share of the remaining way, and a bound, m.

An arm that passes by farther away is moved by something else.
"""
_AT_CORNER = 0.002
"""Largest distance, m, beside its blend radius, of an arm that has been at a corner."""
_BEFORE_CORNER_S = 1e-6
"""Time, s, before a corner at which an arm that has not reached it can be at most."""
_ROUNDS = 5
"""Number of rounds of the search for the nearest place; each halves the stretch, the last one has steps of 1/64."""
_BEHIND_CORNER = 1e-3
"""Advantage, m, by which an arm must be nearer to the next segment to be behind a corner: two segments may lie close.
"""


class PathPlace(NamedTuple):
    """The begin or end of a segment: joints, rad (6,), and the tool in the user frame, m and rpy rad."""

    joints: Vector
    tool: Pose


class Circle(NamedTuple):
    """The circle of an arc: centre, two vectors of its plane as long as its radius, m (3,); its sweep, rad."""

    centre: Vector
    arm: Vector
    across: Vector
    sweep: float

    @property
    def radius(self) -> float:
        """The radius, m."""
        return math.hypot(*self.arm)

    def at(self, share: float) -> Vector:
        """Return the point at this share of the arc, m (3,)."""
        c, s = math.cos(share * self.sweep), math.sin(share * self.sweep)
        return tuple([o + c * a + s * b for o, a, b in zip(self.centre, self.arm, self.across)])


class Segment:
    """One segment, between two places.

    Attributes:
        command: The command that the controller is sent.
        end: Where it ends.
        length: Of the tool's way, m; of a joint motion at least that.
        duration: At its programmed speed, without acceleration and braking, s.
    """

    def __init__(self, command: PathCommand, start: PathPlace, end: PathPlace) -> None:
        """Compute length and duration; raise InvalidCommand where there is no such arc."""
        self.command = command
        self.start, self.end = start, end
        self._turned = matrix_from_rpy(end.tool.rpy)
        self._turn = rotation_angle_between(matrix_from_rpy(start.tool.rpy), self._turned)
        self._circle: Optional[Circle] = None
        self.length = math.dist(start.tool.position, end.tool.position)
        if isinstance(command, JointMove):
            way = max([abs(a - b) for a, b in zip(start.joints, end.joints)])
            self.duration = way / command.speed
            self.is_nowhere = way < _NOWHERE
            return
        turn_speed = ARC_TURN_SPEED
        if isinstance(command, LinearMove):
            turn_speed = command.turn_speed
        else:
            self._circle = circle_through(start.tool.position, command.via.position, end.tool.position)
            self.length = self._circle.radius * self._circle.sweep
        self.duration = max(self.length / command.speed, self._turn / turn_speed)
        self.is_nowhere = self.length < _NOWHERE and self._turn < _NOWHERE

    @property
    def rate(self) -> float:
        """The change of ``distance`` with time at the programmed speed, m/s."""
        if isinstance(self.command, JointMove):
            return _JOINT_LEVER * self.command.speed
        return 0.0 if self.duration <= 0.0 else (self.length + _TURN_LEVER * self._turn) / self.duration

    @property
    def kind(self) -> str:
        """The segment's name in messages."""
        return {JointMove: "joint", LinearMove: "line", ArcMove: "arc"}[type(self.command)]

    def distance(self, share: float, state: RobotState, turned: Optional[Matrix]) -> float:
        """Return the distance of the arm from this share of the segment, m, angles converted to m.

        turned: The tool's rotation, if known.
        """
        if isinstance(self.command, JointMove):
            return _JOINT_LEVER * max([abs(a + share * (b - a) - q) for a, b, q in zip(
                self.start.joints, self.end.joints, state.joint_position)])
        if state.tcp_position is None:
            return math.inf
        if self._circle is not None:
            return math.dist(self._circle.at(share), state.tcp_position)
        away = math.dist([a + share * (b - a) for a, b in zip(self.start.tool.position, self.end.tool.position)],
                         state.tcp_position)
        if self.length < _PURE_TURN and turned is not None:
            away += _TURN_LEVER * abs(rotation_angle_between(turned, self._turned) - (1.0 - share) * self._turn)
        return away


class SegmentPath:
    """Segments one after the other, audited as a whole.

    Attributes:
        segments: In their order.
        start: Where the first one begins.
        ends: When each ends at its programmed speed, s from the begin.
    """

    def __init__(self, commands: Sequence[PathCommand], places: Sequence[PathPlace]) -> None:
        """Join the segments.

        Args:
            commands: Each of which keeps the limits of the arm.
            places: One more than the commands: the begin of the first segment, and the end of each.

        Raises:
            InvalidCommand: A segment cannot be run, or a blend radius is larger than its neighbours allow.
        """
        self.start = places[0]
        self.segments: List[Segment] = []
        self.ends: List[float] = []
        total = 0.0
        for number, (command, start, end) in enumerate(zip(commands, places, places[1:])):
            with_name = "segment %d: " % number
            try:
                segment = Segment(command, start, end)
            except InvalidCommand as error:
                raise InvalidCommand(with_name + str(error)) from error
            total += segment.duration
            self.segments.append(segment)
            self.ends.append(total)
        self._check_blends()

    @property
    def duration(self) -> float:
        """The duration at the programmed speeds, s."""
        return self.ends[-1]

    def completed(self, time: float) -> int:
        """Return the number of segments that have ended at this time, s."""
        return sum(1 for end in self.ends if end <= time + 1e-9)

    def distance(self, time: float, state: RobotState, turned: Optional[Matrix]) -> float:
        """Return the distance of the arm from the place of this time, m; a corner is the begin of what follows it."""
        return self.distance_within(min(self.completed(time), len(self.segments) - 1), time, state, turned)

    def distance_within(self, number: int, time: float, state: RobotState, turned: Optional[Matrix]) -> float:
        """Return the distance of the arm from the place of a time within this segment, its end included, m.

        A joint motion measures it in joints and the others by the tool: at a corner between two the numbers differ.
        """
        segment = self.segments[number]
        begin = self.ends[number] - segment.duration
        share = 1.0 if segment.duration <= 0.0 else min(1.0, (time - begin) / segment.duration)
        return segment.distance(share, state, turned)

    def _check_blends(self) -> None:
        last = len(self.segments) - 1
        for number, segment in enumerate(self.segments):
            radius = segment.command.tolerance
            if number == last:
                if radius > 0.0:
                    raise InvalidCommand("segment %d: blend_radius is %.9g m; the last one has no corner behind it: 0"
                                         % (number, radius))
                continue
            longest = 0.5 * min(segment.length, self.segments[number + 1].length)
            if radius > longest * (1.0 + 1e-6):
                raise InvalidCommand("segment %d: blend_radius is %.6g m; valid: at most half of the shorter segment "
                                     "beside the corner, %.6g m" % (number, radius, longest))


class PathTracker:
    """The arm's progress on a path: the nearest place that it can have reached since the last frame.

    It goes beyond a corner only when the arm has been there, within 2 mm and its blend radius: a controller that drops
    a segment from its queue goes on to the next one's end by another way, which may lie close.

    Attributes:
        time: The place, as a time of the path, s; it does not fall.
    """

    def __init__(self, path: SegmentPath, now: float) -> None:
        self._path = path
        self._seen_at = now
        self._rounded = max([segment.command.tolerance for segment in path.segments])
        self._reached = 0
        self._last_at = now
        self.time = 0.0

    def observe(self, state: RobotState) -> None:
        """Advance to the place of a fresh state; an arm beside its path makes no progress."""
        elapsed = max(0.0, state.received_at - self._seen_at)
        turned = None if state.tcp_rpy is None else matrix_from_rpy(state.tcp_rpy)
        self._look_at_corners(state, turned)
        low = self.time
        high = min(self._farthest, low + _FASTEST * elapsed + _SLACK_S)
        nearest, best = math.inf, low
        for end in [end for end in self._path.ends if low < end < high] + [high]:
            time, away = self._nearest(low, end, state, turned)
            if away < nearest - _BEHIND_CORNER:
                nearest, best = away, time
            low = end
        way = self._path.distance(self.time, state, turned)
        if nearest <= self._rounded + max(_BESIDE, min(_FAR_ASIDE, _ASIDE_SHARE * way)):
            self.time, self._seen_at = best, state.received_at

    @property
    def _farthest(self) -> float:
        """The time of the farthest place that the arm can be at, s: before the next corner that it has not reached."""
        end = self._path.ends[self._reached]
        return end if self._reached == len(self._path.ends) - 1 else max(self.time, end - _BEFORE_CORNER_S)

    def _look_at_corners(self, state: RobotState, turned: Optional[Matrix]) -> None:
        """Note which of the next corners the arm has reached; between two frames it may have been there and back."""
        last, self._last_at = self._last_at, state.received_at
        half_gap = 0.5 * _FASTEST * max(0.0, state.received_at - last)
        segments = self._path.segments
        while self._reached < len(segments) - 1:
            ending, following = segments[self._reached:self._reached + 2]
            away = self._path.distance_within(self._reached, self._path.ends[self._reached], state, turned)
            unseen = half_gap * max(ending.rate, following.rate)
            if away > ending.command.tolerance + _AT_CORNER + unseen:
                break
            self._reached += 1

    def _nearest(self, low: float, high: float, state: RobotState, turned: Optional[Matrix]) -> Tuple[float, float]:
        """Return the nearest place between these times of one segment, as a time, and its distance, m."""
        first, last, found = low, high, (low, math.inf)
        number = min(self._path.completed(low), len(self._path.segments) - 1)
        for _ in range(_ROUNDS):
            step = 0.25 * (last - first)
            for time in [first + n * step for n in range(4)] + [last]:
                away = self._path.distance_within(number, min(time, high), state, turned)
                if away < found[1]:
                    found = min(time, high), away
            first, last = max(low, found[0] - step), min(high, found[0] + step)
        return found

    @property
    def completed(self) -> int:
        """The number of segments that have ended."""
        return self._path.completed(self.time)

    @property
    def fraction(self) -> float:
        """The share of the whole path's duration at the programmed speeds, 0 to 1."""
        return 1.0 if self._path.duration <= 0.0 else min(1.0, self.time / self._path.duration)


def circle_through(start: Sequence[float], via: Sequence[float], end: Sequence[float]) -> Circle:
    """Return the arc from start by via to end, m (3,) each.

    Raises InvalidCommand where they lie on a line, or coincide.
    """
    ab, ac = _minus(via, start), _minus(end, start)
    plane = _cross(ab, ac)
    area = math.hypot(*plane)
    if area < 1e-6 * math.hypot(*ab) * math.hypot(*ac) or min(
            math.hypot(*ab), math.hypot(*ac), math.dist(via, end)) < _NOWHERE:
        raise InvalidCommand("no circle leads through its start, via and target: they lie on a line, or two coincide")
    normal = tuple([value / area for value in plane])
    to_centre = _cross([_dot(ab, ab) * c - _dot(ac, ac) * b for b, c in zip(ab, ac)], plane)
    centre = tuple([a + 0.5 * value / (area * area) for a, value in zip(start, to_centre)])
    arm = _minus(start, centre)
    across = _cross(normal, arm)
    to_end = _minus(end, centre)
    sweep = math.atan2(_dot(to_end, across), _dot(to_end, arm)) % math.tau
    return Circle(centre, arm, across, sweep)


def _minus(a: Sequence[float], b: Sequence[float]) -> Vector:
    return tuple([p - q for p, q in zip(a, b)])


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return sum([p * q for p, q in zip(a, b)])


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
