"""A line or an arc, walked by inverse kinematics in the branch of its start before it is sent.

The joints follow the tool continuously, or the walk ends with the reason: out of reach, a joint's limit, another branch
(shoulder, elbow or wrist would flip), or a singularity, where joints cannot keep a tenth of the tool's speed.
"""
import math
from typing import Callable, List, NamedTuple, Optional, Sequence, Union

from jaka_ros_driver.client.core.motion_guard.tool_frames import ToolFrames
from jaka_ros_driver.commands import ArcMove, LinearMove
from jaka_ros_driver.errors import UnreachablePose
from jaka_ros_driver.kinematics.arm_models import SPHERICAL_WRIST, THREE_PARALLEL, ArmModel
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
_REFERENCE_SPEED = 0.25
"""Speed, m/s, to which that refers where the programmed one is higher."""


class WalkEnd(NamedTuple):
    """The early end of a walk: at this share of the way, 0 to 1, for this reason."""

    share: float
    reason: str


class LineWalk:
    """The joints along a line or an arc.

    Attributes:
        joints: Of the places along the way, its start first, rad (6,) each.
        shares: Of these places, 0 to 1.
        length: Of the tool's way, m.
        early_end: Where and why the way cannot be followed to its end; None where it can.
    """

    def __init__(self, model: ArmModel, frames: ToolFrames, start: Vector, tool: Callable[[float], Transform],
                 length: float, duration: float, turn: float) -> None:
        """Walk.

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
        self._model, self._frames, self._tool = model, frames, tool
        self._way = max(length + _METRES_PER_RAD * turn, _SHORTEST_M)
        self._duration = max(duration, length / _REFERENCE_SPEED)
        self._tops = top_joint_speeds(model)
        pieces = max(1, math.ceil(max(length / _STEP_M, turn / _STEP_TURN)))
        for piece in range(pieces):
            if not self._step((piece + 1) / pieces):
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

    def _step(self, to: float) -> bool:
        """Walk on to this share of the way, in smaller steps where joints move far; return False at the early end."""
        before, since = self.joints[-1], self.shares[-1]
        pose = self._frames.flange_of(self._tool(to))
        after: Optional[Vector] = None
        try:
            after, reason = inverse(self._model, pose, before), ""
        except UnreachablePose as error:
            reason = str(error)
        if after is None or _largest_step(before, after) > _JUMP:
            if (to - since) * self._way > _SHORTEST_M:
                return self._step(since + 0.5 * (to - since)) and self._step(to)
            self.early_end = WalkEnd(since, self._obstacle(pose, before, after, reason))
            return False
        slowed, joint = max([(abs(b - a) / top, number) for number, (a, b, top) in enumerate(
            zip(before, after, self._tops), 1)])
        if slowed * _SLOWED_TO > (to - since) * self._duration and _largest_step(before, after) > _ROUNDING:
            self.early_end = WalkEnd(
                since, "singular: joint %d cannot turn as fast as a tenth of the speed needs" % joint)
            return False
        self.joints.append(after)
        self.shares.append(to)
        return True

    def _obstacle(self, pose: Transform, before: Vector, after: Optional[Vector], reason: str) -> str:
        """Return why no joints near those before reach the next place."""
        for branch in inverse_all(self._model, pose, before):
            near = [angle + math.tau * round((at - angle) / math.tau) for angle, at in zip(branch, before)]
            if _largest_step(before, near) <= _JUMP:
                for joint, (angle, (low, high)) in enumerate(zip(near, self._model.joint_limits), 1):
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
        if self._model.family not in (THREE_PARALLEL, SPHERICAL_WRIST):
            return []
        was, becomes = (signed_measures(self._model, joints, link_transforms(self._model, joints))
                        for joints in (before, after))
        return [name for name in ("shoulder", "elbow", "wrist") if getattr(was, name) * getattr(becomes, name) < 0.0]


def walk(model: ArmModel, frames: ToolFrames, start: Vector, command: Union[LinearMove, ArcMove]) -> LineWalk:
    """Walk the line or arc of a command from these joints, rad (6,), on.

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
    return LineWalk(model, frames, start, tool, length, duration, turn)


def _largest_step(a: Vector, b: Sequence[float]) -> float:
    return max([abs(p - q) for p, q in zip(a, b)])
