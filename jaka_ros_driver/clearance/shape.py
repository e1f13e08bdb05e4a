"""The arm as capsules: a segment with a radius for each part, fixed to a DH frame, made of the model's DH table.

No source gives the outlines of these arms, and the maker's meshes are not read. So each capsule is slim: it lies inside
the real part, by rules of thumb from the DH table (see ``_three_parallel``). What the capsules miss, they miss: this
shape is for catching motions into the arm's own base, and no safety function.
"""
from functools import lru_cache
from typing import Callable, Dict, List, NamedTuple, Sequence, Set, Tuple

from jaka_ros_driver.kinematics.arm_models import SPHERICAL_WRIST, THREE_PARALLEL, TWO_PARALLEL, ArmModel
from jaka_ros_driver.kinematics.rotations import Vector3

FLANGE_FRAME = 6

_COLUMN_OF_HEIGHT = 0.4
"""Largest radius of base and shoulder as a share of d1, the height of the shoulder: 48 mm of 120 mm on the Zu7."""
_COLUMN_OF_WRIST = 0.45
"""Largest radius of base and shoulder as a share of d5, the offset of the wrist: 51 mm of 113.5 mm on the Zu7."""
_LINK_OF_WRIST = 0.36
"""Largest radius of upper arm, elbow and forearm as a share of d5: 41 mm of 113.5 mm on the Zu7."""
_LINK_OF_FOREARM = 0.15
"""Largest radius of upper arm, elbow and forearm as a share of the forearm: 34 mm of 228 mm on the Zu3."""
_WRIST = 0.3
"""Radius of the wrist's parts and of the flange as a share of d5: 34 mm of 113.5 mm on the Zu7.

The wrist's bodies on axes 4 and 6 are d5 apart and do not touch, so none is thicker than half of it.
"""
_MINI = 0.15
"""Radius of all parts of the MiniCobo as a share of its forearm: 32 mm of 210.5 mm."""


class Capsule(NamedTuple):
    """One part of the arm: all points within ``radius`` of a segment.

    Attributes:
        name: As people call the part: "the forearm".
        frame: The DH frame that carries it: 0 the base, 6 the flange.
        start: One end of the segment, m, in that frame.
        end: The other end, m; may equal ``start``: a ball.
        radius: m.
    """

    name: str
    frame: int
    start: Vector3
    end: Vector3
    radius: float


class ArmShape(NamedTuple):
    """The arm as capsules.

    Attributes:
        capsules: The parts from the base to the flange, then those of the tool.
        pairs: Indices of the capsules that can meet, lower one first; neighbours are not among them.
    """

    capsules: Tuple[Capsule, ...]
    pairs: Tuple[Tuple[int, int], ...]


def arm_shape(model: ArmModel, tool: Sequence[Capsule] = ()) -> ArmShape:
    """Return the capsules of the arm, and of a tool, which are in the flange's frame (6)."""
    bare = _bare_shape(model)
    if not tool:
        return bare
    capsules = bare.capsules + tuple(tool)
    pairs = bare.pairs + tuple((n, m) for n, part in enumerate(bare.capsules) if part.frame <= FLANGE_FRAME - 2
                               for m in range(len(bare.capsules), len(capsules)))
    return ArmShape(capsules, pairs)


@lru_cache(maxsize=64)
def _bare_shape(model: ArmModel) -> ArmShape:
    make, neighbours = _FAMILIES[model.family]
    capsules = tuple(make(model))
    pairs = tuple((n, m) for m, second in enumerate(capsules) for n, first in enumerate(capsules[:m])
                  if second.frame - first.frame >= 2 and (first.name, second.name) not in neighbours)
    return ArmShape(capsules, pairs)


def _column_radius(model: ArmModel) -> float:
    return min(_COLUMN_OF_HEIGHT * model.dh[0].d, _COLUMN_OF_WRIST * model.dh[4].d)


def _three_parallel(model: ArmModel) -> List[Capsule]:
    """Return the parts of an arm whose axes 2, 3 and 4 are parallel.

    Axis 4 lies |d4| beside the plane of axis 1. The upper arm stands beside that plane on the same side, the elbow
    leads back, and the forearm lies in the plane, as on all arms of this build; how far beside, no source gives: |d4|.
    """
    d1, a2, a3, d4, d5, d6 = (model.dh[0].d, model.dh[1].a, model.dh[2].a, model.dh[3].d, model.dh[4].d,
                              model.dh[5].d)
    column, wrist = _column_radius(model), _WRIST * d5
    link = min(_LINK_OF_WRIST * d5, _LINK_OF_FOREARM * a3)
    return [
        Capsule("the base", 0, (0.0, 0.0, column), (0.0, 0.0, d1), column),
        Capsule("the shoulder", 1, (0.0, 0.0, 0.0), (0.0, 0.0, d4), column),
        Capsule("the upper arm", 2, (-a2, 0.0, d4), (0.0, 0.0, d4), link),
        Capsule("the elbow", 2, (0.0, 0.0, d4), (0.0, 0.0, 0.0), link),
        Capsule("the forearm", 3, (-a3, 0.0, 0.0), (0.0, 0.0, 0.0), link),
        Capsule("the wrist (link 4)", 4, (0.0, -d4, 0.0), (0.0, 0.0, 0.0), wrist),
        Capsule("the wrist (link 5)", 5, (0.0, d5, 0.0), (0.0, 0.0, 0.0), wrist),
        Capsule("the flange", 6, (0.0, 0.0, -d6), (0.0, 0.0, -wrist), wrist)]


def _two_parallel(model: ArmModel) -> List[Capsule]:
    """Return the parts of the A12: axis 4 runs along the forearm, whose place beside the base's plane the table has.

    The upper arm stands beside that plane by d5, which is about |d4| of its sister models; no source gives it.
    """
    d1, a2, d3, d4, d5, d6 = (model.dh[0].d, model.dh[1].a, model.dh[2].d, model.dh[3].d, model.dh[4].d,
                              model.dh[5].d)
    column, link, wrist = _column_radius(model), _LINK_OF_WRIST * d5, _WRIST * d5
    return [
        Capsule("the base", 0, (0.0, 0.0, column), (0.0, 0.0, d1), column),
        Capsule("the shoulder", 1, (0.0, 0.0, 0.0), (0.0, 0.0, -d5), column),
        Capsule("the upper arm", 2, (-a2, 0.0, -d5), (0.0, 0.0, -d5), link),
        Capsule("the elbow", 2, (0.0, 0.0, -d5), (0.0, 0.0, d3), link),
        Capsule("the forearm", 3, (0.0, 0.0, 0.0), (0.0, 0.0, d4), link),
        Capsule("the wrist (link 5)", 5, (0.0, -d5, 0.0), (0.0, 0.0, 0.0), wrist),
        Capsule("the flange", 6, (0.0, 0.0, -d6), (0.0, 0.0, -wrist), wrist)]


def _spherical_wrist(model: ArmModel) -> List[Capsule]:
    """Return the parts of the MiniCobo, whose links lie in one plane as far as the table says."""
    d1, a2, d2, d4, d6 = model.dh[0].d, model.dh[1].a, model.dh[1].d, model.dh[3].d, model.dh[5].d
    radius = _MINI * d4
    return [
        Capsule("the base", 0, (0.0, 0.0, radius), (0.0, 0.0, d1), radius),
        Capsule("the upper arm", 2, (-a2, 0.0, -d2), (0.0, 0.0, 0.0), radius),
        Capsule("the forearm", 3, (0.0, 0.0, 0.0), (0.0, 0.0, d4), radius),
        Capsule("the flange", 6, (0.0, 0.0, -d6), (0.0, 0.0, -radius), radius)]


_COMMON_NEIGHBOURS = {("the base", "the upper arm"), ("the shoulder", "the elbow"),
                      ("the forearm", "the wrist (link 5)"), ("the wrist (link 4)", "the flange")}
_FAMILIES: Dict[str, Tuple[Callable[[ArmModel], List[Capsule]], Set[Tuple[str, str]]]] = {
    THREE_PARALLEL: (_three_parallel, _COMMON_NEIGHBOURS),
    TWO_PARALLEL: (_two_parallel, _COMMON_NEIGHBOURS | {("the forearm", "the flange")}),
    SPHERICAL_WRIST: (_spherical_wrist, _COMMON_NEIGHBOURS | {("the forearm", "the flange")})}
"""The parts of each family, and the pairs that are two DH frames apart and cannot meet, or share a joint.

The wrist's bodies keep their distances d4 and d5 from those before them whatever the joints are; the shoulder and the
elbow are at the two ends of the upper arm.
"""
