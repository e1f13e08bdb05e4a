"""The guard of motions: how near the arm is to itself and to its zones, and where a path first comes too near.

A path is followed by conservative advancement: each pair's distance, divided by the fastest that its two capsules can
approach each other, says how far the path is clear without a look.
"""
import math
from dataclasses import dataclass, replace
from typing import Any, Callable, Generator, Iterable, List, NamedTuple, Optional, Sequence, Tuple, TypeVar, Union

import numpy as np

from jaka_ros_driver import units
from jaka_ros_driver.clearance.distances import (
    SignedDistance,
    lowest_on_segment,
    point_in_base,
    segment_distance,
)
from jaka_ros_driver.clearance.shape import FLANGE_FRAME, Capsule, arm_shape
from jaka_ros_driver.clearance.workspace import NO_ZONES, Workspace
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.forward import link_transforms
from jaka_ros_driver.kinematics.rotations import Vector3
from jaka_ros_driver.state import Vector

DEFAULT_MARGIN = 0.01
"""Distance, m, that is kept between surfaces."""
FINEST_STEP = 0.005
"""Smallest step along a path, m of the motion of the capsules of a pair relative to each other."""

_FARTHEST = 0.15
"""Distance beyond the margin, m, above which a path is followed by lower bounds, which cost less than distances."""
_SAME = 1e-7
"""Difference, m, of distances that count as equal, so that rounding makes nothing worse."""
_FIRST_ZONED_FRAME = 2
"""First frame whose capsules zones concern: base and shoulder stand where they are bolted."""

MOST_WORK = 1_000_000
"""Largest work of one path: some seconds. A joint move over the whole range of a large arm needs a hundredth of it."""
_LOOK_WORK = 10
"""The work of one look beside its distances: the places of all capsules."""
_SEGMENTS_AT_ONCE = 64
"""Segments of a path of which those pairs are left out together that stay far from each other on all of them."""
_TOO_MUCH = ("the motion guard ends its look, which would be too long: it has taken %d distances of parts that are "
             "near all the way; send it in parts, or keep fewer zones")

T = TypeVar("T")
Looks = Generator[int, None, T]
"""A look in steps, so that a caller need not wait for all of it at once: it yields the work of each step."""

_Ends = Sequence[Tuple[Vector3, Vector3]]
_Gap = Callable[[_Ends, float], float]
"""The distance between surfaces, m, of the capsules' ends in the base frame; above the second argument a lower bound of
the distance is enough."""


class Nearest(NamedTuple):
    """The pair that is nearest: the distance of its surfaces, m, negative inside, and the names of both."""

    distance: float
    first: str
    second: str


@dataclass(frozen=True)
class PathTrouble:
    """The first place of a path that is in trouble.

    Attributes:
        index: The segment: from point ``index`` to the next.
        share: The place on the segment, 0 to 1.
        joints: The joint position there, rad, shape (6,).
        reason: The text for people.
    """

    index: int
    share: float
    joints: Vector
    reason: str


class _Check(NamedTuple):
    """One pair: its names, its distance, and the most, m, by which 1 rad of each joint changes it, shape (6,)."""

    first: str
    second: str
    gap: _Gap
    reach: Vector


def to_the_end(looks: Looks[T], check: Callable[[], None] = lambda: None) -> T:
    """Return the result of a look; what ``check`` raises, which is called after each step, ends it."""
    while True:
        try:
            next(looks)
        except StopIteration as end:
            result: T = end.value
            return result
        check()


class MotionGuard:
    """The judge of joint positions and paths of one arm in one workspace.

    Attributes:
        workspace: The zones, and the tool.
        reach: The most, m, by which 1 rad of each joint changes the distance of any pair, shape (6,).

    Every method raises InvalidCommand for joint angles that are not finite.
    """

    def __init__(self, model: ArmModel, workspace: Workspace = NO_ZONES, margin: float = DEFAULT_MARGIN) -> None:
        shape = arm_shape(model, workspace.tool)
        self.workspace = workspace
        self._model = model
        self._margin = margin
        self._capsules = shape.capsules
        self._checks = [_self_check(model, shape.capsules, n, m) for n, m in shape.pairs]
        for n, capsule in enumerate(shape.capsules):
            if capsule.frame >= _FIRST_ZONED_FRAME:
                self._checks += _zone_checks(model, workspace, n, capsule)
        self._reach = np.array([check.reach for check in self._checks]).T
        self.reach: Vector = tuple(self._reach.max(axis=1).tolist())

    def nearest(self, joints: Vector) -> Nearest:
        """Return the pair that is nearest at these joint angles, rad, shape (6,)."""
        ends = self._ends(joints)
        distance, found = float("inf"), self._checks[0]
        for check in self._checks:
            gap = check.gap(ends, distance)
            if gap < distance:
                distance, found = gap, check
        return Nearest(distance, found.first, found.second)

    def distance_from_tool(self, point: Vector3) -> float:
        """Return the distance, m, of a point in the flange's frame, m, from flange and tool; below 0 inside of them."""
        return min([segment_distance(point, point, capsule.start, capsule.end) - capsule.radius
                    for capsule in self._capsules if capsule.frame == FLANGE_FRAME])

    def trouble(self, joints: Vector) -> str:
        """Return what comes nearer than the margin at these joint angles, rad, shape (6,), as a text; else ""."""
        gaps = self._gaps(joints, self._margin)
        lowest = min(gaps)
        if lowest >= self._margin:
            return ""
        return self._reason(lowest, self._checks[gaps.index(lowest)])

    def first_trouble(self, joints: Sequence[Vector], most: int = MOST_WORK) -> Optional[PathTrouble]:
        """Return the first trouble on a path that is straight in joint space between its points; None if it is clear.

        Args:
            joints: The points of the path, rad, each of shape (6,).
            most: The largest work; a path that needs more is in trouble where that was done.
        """
        return to_the_end(self.looks([np.array(joints, dtype=float)] if joints else [], most))

    def looks(self, pieces: Iterable["np.ndarray[Any, Any]"], most: int = MOST_WORK) -> Looks[Optional[PathTrouble]]:
        """Look along a path; return its first trouble.

        Of a pair that begins nearer than the margin, only what comes nearer still is trouble. Between two looks no two
        capsules come closer to each other by more than what both leave free, or by ``FINEST_STEP``.

        Args:
            pieces: The points of the path, rad, arrays of shape (n, 6); each piece begins where the one before ends.
            most: As of ``first_trouble``.

        Yields:
            The work of each step; a distance is 1.
        """
        floors, slacks, before, work = np.empty(0), np.empty(0), 0, 0
        for points in pieces:
            if not np.isfinite(points).all():
                raise InvalidCommand("the path has joint angles that are not finite")
            for first in range(0, max(1, len(points) - 1), _SEGMENTS_AT_ONCE):
                part = points[first:first + _SEGMENTS_AT_ONCE + 1]
                ways = np.abs(np.diff(part, axis=0))
                approach = ways.sum(axis=0) @ self._reach
                far = self._margin + (_FARTHEST if first or len(points) > len(part)
                                      else min(_FARTHEST, float(approach.max())))
                if not floors.size:
                    gaps = np.array(self._gaps(tuple(part[0].tolist()), far))
                    floors = np.minimum(self._margin, gaps - _SAME)
                    slacks = gaps - floors
                    work += len(self._checks)
                    yield len(self._checks)
                near = np.flatnonzero(slacks < approach).tolist()
                if near:
                    found = yield from self._looks_at(near, part.tolist(), ways, (floors, slacks), far, most - work)
                    if isinstance(found, PathTrouble):
                        return replace(found, index=before + found.index, reason=found.reason or _TOO_MUCH % most)
                    work += found
                far_ones = np.ones(len(slacks), dtype=bool)
                far_ones[near] = False
                slacks[far_ones] -= approach[far_ones]
                before += len(part) - 1
                yield 1
        return None

    def _looks_at(self, near: List[int], points: List[List[float]], ways: "np.ndarray[Any, Any]",
                  bounds: Tuple["np.ndarray[Any, Any]", "np.ndarray[Any, Any]"], far: float,
                  most: int) -> Looks[Union[PathTrouble, int]]:
        """Look at those pairs that can come near on a part of a path; return the first trouble, else the work.

        Where the work would be more than ``most``, the trouble has no reason.
        """
        checks, work = [self._checks[n] for n in near], 0
        floors, slacks = bounds[0][near].tolist(), bounds[1][near].tolist()
        for index, approach in enumerate((ways @ self._reach[:, near]).tolist()):
            share, fastest = 0.0, max(approach)
            while True:
                rest = 1.0 - share
                if all(slack >= rest * speed for slack, speed in zip(slacks, approach)):
                    slacks = [slack - rest * speed for slack, speed in zip(slacks, approach)]
                    break
                step = max(min([slack / speed for slack, speed in zip(slacks, approach) if speed > 0.0]),
                           FINEST_STEP / fastest)
                share = min(1.0, share + step)
                here = tuple([a + share * (b - a) for a, b in zip(points[index], points[index + 1])])
                ends = self._ends(here)
                gaps = [check.gap(ends, far) for check in checks]
                slacks = [gap - floor for gap, floor in zip(gaps, floors)]
                worst = min(slacks)
                if worst < 0.0:
                    found = slacks.index(worst)
                    return PathTrouble(index, share, here, self._reason(gaps[found], checks[found]))
                floors = [max(floor, min(self._margin, gap - _SAME)) for floor, gap in zip(floors, gaps)]
                slacks = [gap - floor for gap, floor in zip(gaps, floors)]
                work += _LOOK_WORK + len(near)
                if work > most:
                    return PathTrouble(index, share, here, "")
                yield _LOOK_WORK + len(near)
                if share >= 1.0:
                    break
        bounds[0][near], bounds[1][near] = floors, slacks
        return work

    def _ends(self, joints: Vector) -> _Ends:
        if not math.isfinite(sum(joints)):
            raise InvalidCommand("joint angles %s are not finite" % (tuple(joints),))
        frames = link_transforms(self._model, joints)
        return [(point_in_base(frames[capsule.frame], capsule.start), point_in_base(frames[capsule.frame], capsule.end))
                for capsule in self._capsules]

    def _gaps(self, joints: Vector, enough: float) -> List[float]:
        """Return each pair's distance, m, or a lower bound of it that is above ``enough``."""
        ends = self._ends(joints)
        return [check.gap(ends, enough) for check in self._checks]

    def _reason(self, distance: float, check: _Check) -> str:
        if distance < 0.0:
            return "%s runs %d mm into %s" % (check.first, math.ceil(units.m_to_mm(-distance)), check.second)
        # rounded down: "10 mm, at least 10 mm" explains nothing
        return "%s is %d mm from %s; at least %.0f mm are kept" % (
            check.first, units.m_to_mm(distance), check.second, units.m_to_mm(self._margin))


def _self_check(model: ArmModel, capsules: Sequence[Capsule], n: int, m: int) -> _Check:
    radii = capsules[n].radius + capsules[m].radius
    around = 0.5 * (math.dist(capsules[n].start, capsules[n].end)
                    + math.dist(capsules[m].start, capsules[m].end)) + radii

    def gap(ends: _Ends, enough: float) -> float:
        (px, py, pz), (qx, qy, qz) = p1, q1 = ends[n]
        (rx, ry, rz), (sx, sy, sz) = p2, q2 = ends[m]
        x, y, z = px + qx - rx - sx, py + qy - ry - sy, pz + qz - rz - sz
        bound = enough + around
        if bound > 0.0 and x * x + y * y + z * z > 4.0 * bound * bound:  # x, y, z are twice the way between centres
            return 0.5 * math.sqrt(x * x + y * y + z * z) - around
        return segment_distance(p1, q1, p2, q2) - radii
    return _Check(capsules[m].name, capsules[n].name, gap, _reach(model, capsules[m], capsules[n].frame))


def _zone_checks(model: ArmModel, workspace: Workspace, n: int, capsule: Capsule) -> List[_Check]:
    radius, half = capsule.radius, 0.5 * math.dist(capsule.start, capsule.end)

    def outside(signed: SignedDistance) -> _Gap:
        def gap(ends: _Ends, enough: float) -> float:
            p, q = ends[n]
            bound = signed(0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.5 * (p[2] + q[2])) - half - radius
            return bound if bound > enough else lowest_on_segment(signed, p, q, enough + radius) - radius
        return gap

    def inside(signed: SignedDistance) -> _Gap:
        def gap(ends: _Ends, enough: float) -> float:
            p, q = ends[n]
            return -max(signed(*p), signed(*q)) - radius  # the highest value of a convex function is at an end
        return gap

    def above(floor: float) -> _Gap:
        def gap(ends: _Ends, enough: float) -> float:
            p, q = ends[n]
            return min(p[2], q[2]) - floor - radius
        return gap
    zones = [("the keep-out box %r" % box.name, outside(box.signed_distance())) for box in workspace.keep_out]
    zones += [("the cylinder %r" % zone.name, outside(zone.signed_distance())) for zone in workspace.cylinders]
    zones += [("the wall of the keep-in box %r" % box.name, inside(box.signed_distance()))
              for box in workspace.keep_in]
    if workspace.floor is not None:
        zones.append(("the floor", above(workspace.floor)))
    reach = _reach(model, capsule, 0)
    return [_Check(capsule.name, name, gap, reach) for name, gap in zones]


def _reach(model: ArmModel, capsule: Capsule, fixed: int) -> Vector:
    """Return the most, m, that 1 rad of each joint moves a point of the capsule's segment in the frame ``fixed``."""
    reach = [0.0] * JOINT_COUNT
    for x, y, z in (capsule.start, capsule.end):
        a, d, ca, sa, _ = model.link_terms[capsule.frame - 1]
        turned = math.hypot(x + a, ca * y - sa * z)  # from the axis of the joint that carries the capsule
        far = math.hypot(turned, d + sa * y + ca * z)
        for joint in reversed(range(fixed, capsule.frame)):
            if joint < capsule.frame - 1:
                a, d = model.link_terms[joint][:2]
                turned = abs(a) + far
                far = math.hypot(a, d) + far
            reach[joint] = max(reach[joint], turned)
    return tuple(reach)
