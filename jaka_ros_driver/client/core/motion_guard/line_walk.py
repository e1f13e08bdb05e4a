"""A line or an arc, walked by inverse kinematics in the branch of its start before it is sent.

The joints follow the tool continuously, or the walk ends with the reason: out of reach, a joint's limit, another branch
(shoulder, elbow or wrist would flip), or a singularity, where joints cannot keep a tenth of the tool's speed.
"""
import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Union

from jaka_ros_driver.clearance.guard import Looks
from jaka_ros_driver.client.core.motion_guard.tool_frames import ToolFrames
from jaka_ros_driver.commands import ArcMove, LinearMove
from jaka_ros_driver.errors import UnreachablePose
from jaka_ros_driver.kinematics.arm_models import SPHERICAL_WRIST, THREE_PARALLEL, TWO_PARALLEL, ArmModel
from jaka_ros_driver.kinematics.forward import link_transforms, signed_measures
from jaka_ros_driver.kinematics.inverse import inverse, inverse_all
from jaka_ros_driver.kinematics.limits import top_joint_speeds
from jaka_ros_driver.kinematics.rotations import (
    Transform,
    compose,
    matrix_from_rotation_vector,
    transform,
    transform_from_pose,
    turn_between,
)
from jaka_ros_driver.state import Vector
from jaka_ros_driver.trajectory.segments import ARC_TURN_SPEED, circle_through

_STEP_M, _STEP_TURN = 0.01, 0.05
"""Longest step along the way, m, and of the tool's turn, rad."""
_JUMP = 0.1
"""Largest step of a joint, rad, that is taken; a longer one is halved, and at last is no way from here to there."""
_ROUNDING = 0.01
"""Step of a joint, rad, up to which a place is not singular: on a way of no length rounding alone turns joints."""
_SHORTEST_M = 1e-4
"""Length, m, of a step that is not halved any more."""
_METRES_PER_RAD = 0.3
"""The length, m, as which a turn of 1 rad counts."""
_SLOWED_TO = 0.1
"""Share of the speed below which a place counts as singular: there the controller stops by itself."""
_MOST_PLACES = 10_000
"""Most places of a way that are looked for: no way within reach needs a third of it."""
_WORK: Dict[str, int] = {THREE_PARALLEL: 50, SPHERICAL_WRIST: 100, TWO_PARALLEL: 300}
"""The work of one place by the arm's family, in that of a distance of the motion guard (``Looks``)."""
_REFERENCE_SPEED = 0.25
"""Speed, m/s, to which that refers where the programmed one is higher."""
_TANGENT = 1e-3
"""Share of a way over which its direction at a corner is measured."""
SHARP_M = 1e-3
"""Distance, m, from a corner up to which a way that passes it counts as sharp."""
BETWEEN_CORNERS_M = 0.02
"""Largest distance, m, of one rounded corner that is looked at from the next: less than the radius of any part."""


class WalkEnd(NamedTuple):
    """The early end of a walk: at this share of the way, 0 to 1, for this reason."""

    share: float
    reason: str


class LineWalk:
    """The joints along a line or an arc, once ``looks`` has come to its end.

    Attributes:
        joints: Of the places along the way, its start first, rad (6,) each.
        shares: Of these places, 0 to 1.
        length: Of the tool's way, m.
        early_end: Where and why the way cannot be followed to its end; None where it can.
        tool: ``user_t_tool`` by the share of the way.
        tolerance: How far the tool may pass its end on the way to the next one, m.
    """

    def __init__(self, model: ArmModel, frames: ToolFrames, start: Vector, tool: Callable[[float], Transform],
                 length: float, duration: float, turn: float) -> None:
        """Set up at the start.

        Args:
            model: The arm.
            frames: The active tool and user frame.
            start: Joints, rad (6,).
            tool: ``user_t_tool`` by the share of the way.
            length: Of the way, m.
            duration: At the programmed speed and acceleration, but for the joints' limits, s.
            turn: Of the tool, rad.
        """
        self.joints, self.shares, self.length = [start], [0.0], length
        self.early_end: Optional[WalkEnd] = None
        self.model, self.frames, self.tool, self.tolerance = model, frames, tool, 0.0
        self.duration = max(duration, length / _REFERENCE_SPEED)
        self._way = max(length + _METRES_PER_RAD * turn, _SHORTEST_M)
        self._tops = top_joint_speeds(model)
        self._pieces = max(1, math.ceil(max(length / _STEP_M, turn / _STEP_TURN)))
        self._places = 0

    def looks(self) -> Looks[None]:
        """Walk to the end of the way, or to its early end."""
        for piece in range(self._pieces):
            if not (yield from self._step((piece + 1) / self._pieces)):
                break

    @property
    def end(self) -> Vector:
        """The joints at the end of what was walked, rad (6,)."""
        return self.joints[-1]

    def share_at(self, index: int, share: float) -> float:
        """Return the share of the whole way for a share of the step behind the place ``index``."""
        begin, end = self.shares[index], self.shares[min(index + 1, len(self.shares) - 1)]
        return begin + share * (end - begin)

    # ---- inside ----

    def _step(self, to: float) -> Looks[bool]:
        """Walk on to this share of the way, in smaller steps where joints move far; return False at the early end."""
        before, since = self.joints[-1], self.shares[-1]
        pose = self.frames.flange_of(self.tool(to))
        after: Optional[Vector] = None
        self._places += 1
        if self._places > _MOST_PLACES:
            self.early_end = WalkEnd(since, "the motion guard looks at no more than %d places" % _MOST_PLACES)
            return False
        yield _WORK[self.model.family]
        try:
            after, reason = inverse(self.model, pose, before), ""
        except UnreachablePose as error:
            reason = str(error)
        if after is None or _largest_step(before, after) > _JUMP:
            if (to - since) * self._way > _SHORTEST_M:
                return (yield from self._step(since + 0.5 * (to - since))) and (yield from self._step(to))
            self.early_end = WalkEnd(since, self._obstacle(pose, before, after, reason))
            return False
        slowed, joint = max([(abs(b - a) / top, number) for number, (a, b, top) in enumerate(
            zip(before, after, self._tops), 1)])
        if slowed * _SLOWED_TO > (to - since) * self.duration and _largest_step(before, after) > _ROUNDING:
            self.early_end = WalkEnd(
                since, "singular: joint %d cannot turn as fast as a tenth of the speed needs" % joint)
            return False
        self.joints.append(after)
        self.shares.append(to)
        return True

    def _obstacle(self, pose: Transform, before: Vector, after: Optional[Vector], reason: str) -> str:
        """Return why no joints near those before reach the next place."""
        for branch in inverse_all(self.model, pose, before):
            near = [angle + math.tau * round((at - angle) / math.tau) for angle, at in zip(branch, before)]
            if _largest_step(before, near) <= _JUMP:
                for joint, (angle, (low, high)) in enumerate(zip(near, self.model.joint_limits), 1):
                    if not low <= angle <= high:
                        return "joint %d would pass its limit; valid: %.6g to %.6g rad" % (joint, low, high)
        if after is None:
            return reason
        flips = self._flips(before, after)
        if flips:
            return "another branch: the %s would have to flip" % " and the ".join(flips)
        joint = max(range(len(before)), key=lambda number: abs(after[number] - before[number]))
        return "singular: joint %d would have to turn by %.3g rad at once" % (
            joint + 1, abs(after[joint] - before[joint]))

    def _flips(self, before: Vector, after: Vector) -> List[str]:
        """Return which of shoulder, elbow and wrist would change sides; none where one measure is all."""
        if self.model.family not in (THREE_PARALLEL, SPHERICAL_WRIST):
            return []
        was, becomes = (signed_measures(self.model, joints, link_transforms(self.model, joints))
                        for joints in (before, after))
        return [name for name in ("shoulder", "elbow", "wrist") if getattr(was, name) * getattr(becomes, name) < 0.0]


def walk(model: ArmModel, frames: ToolFrames, start: Vector, command: Union[LinearMove, ArcMove]) -> LineWalk:
    """Return the walk along the line or arc of a command from these joints, rad (6,), on, before its first step.

    Raises:
        InvalidCommand: There is no such arc.
    """
    begin, end = frames.tool_at(model, start), transform_from_pose(command.target)
    vector = turn_between(begin, end)
    turn = math.hypot(*vector)
    if isinstance(command, ArcMove):
        circle = circle_through(begin[9:], command.via.position, command.target.position)
        length, turn_speed, position = circle.radius * circle.sweep, ARC_TURN_SPEED, circle.at
    else:
        length, turn_speed = math.dist(begin[9:], end[9:]), command.turn_speed

        def position(share: float) -> Vector:
            return tuple([a + share * (b - a) for a, b in zip(begin[9:], end[9:])])

    def tool(share: float) -> Transform:
        turned = compose(transform(matrix_from_rotation_vector([share * part for part in vector]), (0.0,) * 3), begin)
        return transform(turned[:9], position(share))

    duration = max(length / command.speed, 2.0 * math.sqrt(length / command.acceleration), turn / turn_speed)
    way = LineWalk(model, frames, start, tool, length, duration, turn)
    way.tolerance = command.tolerance
    return way


def corner_walks(before: LineWalk, after: LineWalk) -> List[LineWalk]:
    """Return the walks along the rounded corners that may lie between two walks, by the tolerance of the first one.

    Each is a parabola that touches both. The last one passes the corner at the tolerance, or replaces half of the
    shorter way; the others lie between it and the corner, as no source says which of them a controller takes. There is
    none where the corner is sharp.

    Raises:
        UnreachablePose: One begins out of reach.
    """
    longest = 0.5 * min(before.length, after.length)
    if before.tolerance <= 0.0 or longest < _SHORTEST_M:
        return []
    corner = before.tool(1.0)[9:]
    bend = math.dist(_direction(before.tool(1.0 - _TANGENT)[9:], corner), _direction(corner, after.tool(_TANGENT)[9:]))
    half = min(longest, 4.0 * before.tolerance / max(bend, _TANGENT))
    beside = 0.25 * half * bend
    if beside < SHARP_M:
        return []
    count = math.ceil(beside / BETWEEN_CORNERS_M)
    return [_corner_walk(before, after, corner, half * (number + 1) / count) for number in range(count)]


def _corner_walk(before: LineWalk, after: LineWalk, corner: Vector, half: float) -> LineWalk:
    """Return the walk along the parabola that replaces a length ``half``, m, before and behind a corner."""
    leaves, joins = 1.0 - half / before.length, half / after.length
    first, last = before.tool(leaves), after.tool(joins)
    vector = turn_between(first, last)

    def tool(share: float) -> Transform:
        turned = compose(transform(matrix_from_rotation_vector([share * part for part in vector]), (0.0,) * 3), first)
        rest = 1.0 - share
        return transform(turned[:9], tuple([rest * rest * a + 2.0 * rest * share * b + share * share * c
                                            for a, b, c in zip(first[9:], corner, last[9:])]))

    near = max([joints for joints in zip(before.shares, before.joints) if joints[0] <= leaves])[1]
    start = inverse(before.model, before.frames.flange_of(first), near)
    duration = (1.0 - leaves) * before.duration + joins * after.duration
    return LineWalk(before.model, before.frames, start, tool, 2.0 * half, duration, math.hypot(*vector))


def _direction(a: Sequence[float], b: Sequence[float]) -> Vector:
    """Return the unit vector from a to b, points that differ."""
    distance = math.dist(a, b)
    return tuple([(q - p) / distance for p, q in zip(a, b)])


def _largest_step(a: Vector, b: Sequence[float]) -> float:
    return max([abs(p - q) for p, q in zip(a, b)])
