"""The rounded corners at joint moves, as parabolas in joint space beside the corner.

No source says whether and how a controller rounds them (docs/controller-protocol.md section 5.2): as in ``line_walk``
the sharp corner is looked at, and the widest parabola that its tolerance allows, with others between them.
"""
import math
from bisect import bisect_right
from typing import List, NamedTuple, Sequence, Tuple, Union

from jaka_ros_driver.client.core.motion_guard.line_walk import BETWEEN_CORNERS_M, SHARP_M, LineWalk
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import Transform, compose
from jaka_ros_driver.state import Vector

_ROUNDS = 20
"""Bisections for the widest parabola: a millionth of the longest one is left."""
_CHORD = 1e-3
"""Largest distance, rad, of a joint on a parabola from the straight lines by which it is looked at."""


class JointWay(NamedTuple):
    """The way of a joint move.

    Attributes:
        start, end: Joints, rad (6,).
        duration: At its programmed speed, s.
        tolerance: How far the tool may pass its end on the way to the next one, m.
    """

    start: Vector
    end: Vector
    duration: float
    tolerance: float

    def at(self, share: float) -> Vector:
        """Return the joints at this share of the way, rad (6,)."""
        return _between(self.start, self.end, share)


Way = Union[JointWay, LineWalk]


def joint_corners(model: ArmModel, flange_t_tool: Transform, before: Way, after: Way) -> List[List[Vector]]:
    """Return the rounded corners that may lie between two ways, of which one at least is that of a joint move.

    Each leaves the first way as long before the corner as it joins the second one behind it, at most half of the
    shorter; its middle passes the corner within the tolerance of the first.

    Returns:
        Joints, rad (6,), along each corner; none where it is sharp.
    """
    longest = 0.5 * min(before.duration, after.duration)
    if before.tolerance <= 0.0 or longest <= 0.0:
        return []
    corner = before.end
    tool = compose(forward(model, corner), flange_t_tool)[9:]

    def parabola(time: float) -> Tuple[Vector, Vector]:
        return _at(before, 1.0 - time / before.duration), _at(after, time / after.duration)

    def beside(time: float) -> float:
        middle = _on_parabola(*parabola(time), corner, 0.5)
        return math.dist(compose(forward(model, middle), flange_t_tool)[9:], tool)

    widest = longest
    if beside(longest) > before.tolerance:
        low, widest = 0.0, longest
        for _ in range(_ROUNDS):
            middle = 0.5 * (low + widest)
            low, widest = (middle, widest) if beside(middle) <= before.tolerance else (low, middle)
    passed = beside(widest)
    if passed < SHARP_M:
        return []
    count = math.ceil(passed / BETWEEN_CORNERS_M)
    return [_sampled(*parabola(widest * (number + 1) / count), corner) for number in range(count)]


def _at(way: Way, share: float) -> Vector:
    """Return the joints at this share of a way, rad (6,)."""
    if isinstance(way, JointWay):
        return way.at(share)
    index = min(max(bisect_right(way.shares, share), 1), len(way.shares) - 1)
    begin, end = way.shares[index - 1], way.shares[index]
    return _between(way.joints[index - 1], way.joints[index], (share - begin) / (end - begin))


def _between(a: Sequence[float], b: Sequence[float], share: float) -> Vector:
    return tuple([p + share * (q - p) for p, q in zip(a, b)])


def _on_parabola(first: Vector, last: Vector, corner: Vector, share: float) -> Vector:
    return _between(_between(first, corner, share), _between(corner, last, share), share)


def _sampled(first: Vector, last: Vector, corner: Vector) -> List[Vector]:
    """Return places on a parabola, rad (6,), whose straight lines between them are near enough to it."""
    bend = max([abs(p - 2.0 * c + q) for p, c, q in zip(first, corner, last)])
    count = max(2, math.ceil(math.sqrt(0.25 * bend / _CHORD)))
    return [_on_parabola(first, last, corner, k / count) for k in range(count + 1)]
