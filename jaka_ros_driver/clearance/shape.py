"""The arm as capsules: a segment with a radius for each part, fixed to a DH frame.

Source of the sizes: the inertias in the URDF files of the maker's packages (jaka_robot and jaka_ros2, the folder
``jaka_description``). A link's centre of mass says how far upper arm and forearm lie beside the plane of axis 1; the
square root of twice its inertia over its mass is the radius of a solid cylinder that turns alike. The capsules have
about three quarters of that radius, so that they lie inside the real parts: a false refusal stops a cell that works.
This shape is for catching motions into the arm's own column, and no safety function.
"""
import math
from functools import lru_cache
from typing import Callable, Dict, List, NamedTuple, Sequence, Set, Tuple

from jaka_ros_driver import units
from jaka_ros_driver.kinematics.arm_models import (
    SPHERICAL_WRIST,
    THREE_PARALLEL,
    TWO_PARALLEL,
    ArmModel,
    load_model,
)
from jaka_ros_driver.kinematics.rotations import Vector3

FLANGE_FRAME = 6


class _Sizes(NamedTuple):
    """The outlines of an arm, mm.

    Attributes:
        upper_arm_beside: Distance of the upper arm from the plane of axis 1, towards axis 4.
        forearm_beside: Distance of the forearm from that plane, towards axis 4.
        column: Radius of base and shoulder.
        link: Radius of upper arm, elbow and forearm.
        wrist: Radius of the wrist's parts and of the flange.
    """

    upper_arm_beside: float
    forearm_beside: float
    column: float
    link: float
    wrist: float


_THREE_PARALLEL_SIZES = {
    "zu3": _Sizes(114.0, 8.0, 37.0, 33.0, 27.0),
    "zu7": _Sizes(143.0, 12.0, 48.0, 38.0, 32.0),
    "zu12": _Sizes(166.0, 24.0, 58.0, 38.0, 36.0),
    "zu18": _Sizes(180.0, 46.0, 58.0, 40.0, 36.0),
    "pro16": _Sizes(230.0, 27.0, 75.0, 52.0, 47.0),
    "zu20": _Sizes(230.0, 56.0, 75.0, 47.0, 41.0),
}
"""The sizes of the main family, one model for all that share its joints: d1, d4, d5 and d6 are those of the joints.

The radii of Zu12 and Zu18, whose files have masses of another density, are those of the A12, which has the same joints.
"""
_A12_SIZES = _Sizes(180.0, 0.0, 58.0, 38.0, 36.0)
"""The sizes of the A12; how far its forearm lies beside the plane, its DH table has (row 3: d)."""
_MINICOBO_COLUMN, _MINICOBO_LINK = 37.0, 29.0
"""Radii of the MiniCobo, mm: of its base, and of all other parts."""


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


def _scaled(sizes: _Sizes, scale: float) -> _Sizes:
    """Return the sizes in m, of an arm that is larger by a factor."""
    return _Sizes(*(scale * units.mm_to_m(size) for size in sizes))


def _three_parallel(model: ArmModel) -> List[Capsule]:
    """Return the parts of an arm whose axes 2, 3 and 4 are parallel.

    An arm of a user's own file has the sizes of the model with the nearest joints, scaled by d5.
    """
    d1, a2, a3, d4, d5, d6 = (model.dh[0].d, model.dh[1].a, model.dh[2].a, model.dh[3].d, model.dh[4].d,
                              model.dh[5].d)

    def unlike(name: str) -> float:
        return sum(abs(load_model(name).dh[row].d - model.dh[row].d) for row in (0, 3, 4, 5))
    nearest = min(_THREE_PARALLEL_SIZES, key=unlike)
    sizes = _scaled(_THREE_PARALLEL_SIZES[nearest], abs(d5) / load_model(nearest).dh[4].d)
    upper, fore = math.copysign(sizes.upper_arm_beside, d4), math.copysign(sizes.forearm_beside, d4)
    return [
        Capsule("the base", 0, (0.0, 0.0, sizes.column), (0.0, 0.0, d1), sizes.column),
        Capsule("the shoulder", 1, (0.0, 0.0, 0.0), (0.0, 0.0, upper), sizes.column),
        Capsule("the upper arm", 2, (-a2, 0.0, upper), (0.0, 0.0, upper), sizes.link),
        Capsule("the elbow", 2, (0.0, 0.0, upper), (0.0, 0.0, fore), sizes.link),
        Capsule("the forearm", 3, (-a3, 0.0, fore), (0.0, 0.0, fore), sizes.link),
        Capsule("the wrist (link 4)", 4, (0.0, fore - d4, 0.0), (0.0, 0.0, 0.0), sizes.wrist),
        Capsule("the wrist (link 5)", 5, (0.0, d5, 0.0), (0.0, 0.0, 0.0), sizes.wrist),
        Capsule("the flange", 6, (0.0, 0.0, -d6), (0.0, 0.0, -sizes.wrist), sizes.wrist)]


def _two_parallel(model: ArmModel) -> List[Capsule]:
    """Return the parts of the A12: its upper arm lies on the other side, and its axis 4 runs along the forearm."""
    d1, a2, d3, d4, d5, d6 = (model.dh[0].d, model.dh[1].a, model.dh[2].d, model.dh[3].d, model.dh[4].d,
                              model.dh[5].d)
    sizes = _scaled(_A12_SIZES, 1.0)
    upper = sizes.upper_arm_beside
    return [
        Capsule("the base", 0, (0.0, 0.0, sizes.column), (0.0, 0.0, d1), sizes.column),
        Capsule("the shoulder", 1, (0.0, 0.0, 0.0), (0.0, 0.0, upper), sizes.column),
        Capsule("the upper arm", 2, (-a2, 0.0, upper), (0.0, 0.0, upper), sizes.link),
        Capsule("the elbow", 2, (0.0, 0.0, upper), (0.0, 0.0, d3), sizes.link),
        Capsule("the forearm", 3, (0.0, 0.0, 0.0), (0.0, 0.0, d4), sizes.link),
        Capsule("the wrist (link 5)", 5, (0.0, -d5, 0.0), (0.0, 0.0, 0.0), sizes.wrist),
        Capsule("the flange", 6, (0.0, 0.0, -d6), (0.0, 0.0, -sizes.wrist), sizes.wrist)]


def _spherical_wrist(model: ArmModel) -> List[Capsule]:
    """Return the parts of the MiniCobo, whose links lie in one plane."""
    d1, a2, d2, d4, d6 = model.dh[0].d, model.dh[1].a, model.dh[1].d, model.dh[3].d, model.dh[5].d
    column, link = units.mm_to_m(_MINICOBO_COLUMN), units.mm_to_m(_MINICOBO_LINK)
    return [
        Capsule("the base", 0, (0.0, 0.0, column), (0.0, 0.0, d1), column),
        Capsule("the upper arm", 2, (-a2, 0.0, -d2), (0.0, 0.0, 0.0), link),
        Capsule("the forearm", 3, (0.0, 0.0, 0.0), (0.0, 0.0, d4), link),
        Capsule("the flange", 6, (0.0, 0.0, -d6), (0.0, 0.0, -link), link)]


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
