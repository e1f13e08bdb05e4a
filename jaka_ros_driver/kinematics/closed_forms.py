"""Closed-form inverse kinematics of the two families that have one, in DH angles: theta_offset is still included.

Both families share their outer halves: the wrist point fixes q1 (two ways) and, with a planar two-link arm, q2 and q3
(two ways); axes 5 and 6 are solved against a direction r that axis 4's predecessors fix (axis z1 in the main family, z3
with a spherical wrist). Facts used, with x6, y6, z6 the axes of the target:

    r . z6 = cos q5,   r . x6 = sin q5 cos q6,   r . y6 = -sin q5 sin q6,   z4 = -(sin q6 x6 + cos q6 y6)

so that z4, and from it the angle before the wrist, stays right to rounding even where sin q5 is tiny. Angles come from
atan2 of both their sine and cosine throughout: nothing is lost near a singularity.
"""
import math
from typing import List, NamedTuple, Sequence, Tuple

from jaka_ros_driver.kinematics.arm_models import DhRow
from jaka_ros_driver.kinematics.rotations import Transform

WRIST_TOLERANCE = 1e-6
"""Bound of |sin q5| below which q6 is free and taken from the caller.

It is above the rounding of a pose that was sent as float32 (about 2e-7 rad), and so small that the pose is wrong by at
most 1e-6 rad.
"""
CLAMP_TOLERANCE = 1e-6
"""Distance, m, beyond the arm's reach up to which a target is answered with the stretched arm."""

Angles = Tuple[float, float, float, float, float, float]
_InPlane = Tuple[float, float]


class Branches(NamedTuple):
    """The solutions for one target.

    Attributes:
        angles: DH angles (theta_offset included), rad, not wrapped.
        is_clamped: True where a value was rounded to a singularity; each solution must then be checked.
        obstacle: Why there is no solution, in words; empty where there is one.
    """

    angles: List[Angles]
    is_clamped: bool
    obstacle: str


def three_parallel(dh: Sequence[DhRow], base_t_flange: Transform, free_q6: float) -> Branches:
    """Return up to 8 branches of the main family.

    Args:
        dh: The table, with exactly the family's structure.
        base_t_flange: The target.
        free_q6: DH angle 6 to use where sin q5 = 0, rad; the nearest one where the arm does not reach with it.
    """
    xx, yx, zx, xy, yy, zy, xz, yz, zz, px, py, pz = base_t_flange
    _, row2, row3, row4, row5, row6 = dh
    upper, fore, d5, d6 = row2.a, row3.a, row5.d, row6.d
    wx, wy = px - d6 * zx, py - d6 * zy
    height = pz - d6 * zz - dh[0].d
    found: List[Angles] = []
    obstacle = ""
    offset = row2.d + row3.d + row4.d
    shoulders, is_clamped = _shoulder_angles(wx, wy, offset)
    if not shoulders:
        return Branches([], False, _too_near_the_axis(wx, wy, offset))
    for q1 in shoulders:
        c1, s1 = math.cos(q1), math.sin(q1)
        u, v = s1 * xx - c1 * xy, s1 * yx - c1 * yy
        sin_q5 = math.sqrt(u * u + v * v)
        cos_q5 = s1 * zx - c1 * zy
        along = c1 * wx + s1 * wy
        if sin_q5 < WRIST_TOLERANCE:
            is_clamped = True
            q6 = _reached_q6(free_q6, (c1 * xx + s1 * xy, xz), (c1 * yx + s1 * yy, yz), (along, height), d5,
                             (abs(upper - fore), upper + fore))
            wrists = [(0.0 if cos_q5 > 0.0 else math.pi, q6)]
        else:
            wrists = [(math.atan2(sin_q5, cos_q5), math.atan2(-v, u)), (math.atan2(-sin_q5, cos_q5), math.atan2(v, -u))]
        for q5, q6 in wrists:
            c6, s6 = math.cos(q6), math.sin(q6)
            z4z = -(s6 * xz + c6 * yz)
            z4_along = -(c1 * (s6 * xx + c6 * yx) + s1 * (s6 * xy + c6 * yy))
            q234 = math.atan2(z4_along, -z4z)
            elbows, at_limit, miss = _two_link(along - d5 * z4_along, height - d5 * z4z, upper, fore)
            is_clamped = is_clamped or at_limit
            obstacle = obstacle or miss
            for q2, q3 in elbows:
                found.append((q1, q2, q3, q234 - q2 - q3, q5, q6))
    return Branches(found, is_clamped, "" if found else obstacle)


def spherical_wrist(dh: Sequence[DhRow], base_t_flange: Transform, free_q6: float) -> Branches:
    """Return up to 8 branches of the family with a common wrist point (Pieper). Arguments as for ``three_parallel``."""
    xx, yx, zx, xy, yy, zy, xz, yz, zz, px, py, pz = base_t_flange
    row1, row2, row3, row4, _, row6 = dh
    wx, wy = px - row6.d * zx, py - row6.d * zy
    height = pz - row6.d * zz - row1.d
    found: List[Angles] = []
    obstacle = ""
    offset = row2.d + row3.d
    shoulders, is_clamped = _shoulder_angles(wx, wy, offset)
    if not shoulders:
        return Branches([], False, _too_near_the_axis(wx, wy, offset))
    for q1 in shoulders:
        c1, s1 = math.cos(q1), math.sin(q1)
        elbows, at_limit, miss = _two_link(c1 * wx + s1 * wy, height, row2.a, row4.d)
        is_clamped = is_clamped or at_limit
        obstacle = obstacle or miss
        for q2, elbow in elbows:
            q3 = elbow - 0.5 * math.pi
            c23, s23 = math.cos(q2 + q3), math.sin(q2 + q3)
            x3x, x3y, x3z = c1 * c23, s1 * c23, s23
            rx, ry, rz = -c1 * s23, -s1 * s23, c23
            u, v = rx * xx + ry * xy + rz * xz, rx * yx + ry * yy + rz * yz
            sin_q5 = math.sqrt(u * u + v * v)
            cos_q5 = rx * zx + ry * zy + rz * zz
            if sin_q5 < WRIST_TOLERANCE:
                is_clamped = True
                wrists = [(0.0 if cos_q5 > 0.0 else math.pi, free_q6)]
            else:
                wrists = [(math.atan2(sin_q5, cos_q5), math.atan2(-v, u)),
                          (math.atan2(-sin_q5, cos_q5), math.atan2(v, -u))]
            for q5, q6 in wrists:
                c6, s6 = math.cos(q6), math.sin(q6)
                z4x, z4y, z4z = -(s6 * xx + c6 * yx), -(s6 * xy + c6 * yy), -(s6 * xz + c6 * yz)
                q4 = math.atan2(z4x * x3x + z4y * x3y + z4z * x3z, z4x * s1 - z4y * c1)
                found.append((q1, q2, q3, q4, q5, q6))
    return Branches(found, is_clamped, "" if found else obstacle)


def _shoulder_angles(x: float, y: float, offset: float) -> Tuple[List[float], bool]:
    """Return the q1 that put (x, y) at ``offset`` along z1 = (sin q1, -cos q1), and whether one was rounded to the
    limit.
    """
    radius = math.hypot(x, y)
    direction = math.atan2(y, x)
    beyond = abs(offset) - radius
    if beyond >= 0.0:
        if beyond > CLAMP_TOLERANCE:
            return [], False
        return [direction + math.copysign(0.5 * math.pi, offset)], True
    along = math.sqrt((radius - offset) * (radius + offset))
    return [direction + math.atan2(offset, along), direction + math.atan2(offset, -along)], False


def _too_near_the_axis(x: float, y: float, offset: float) -> str:
    return ("out of reach: the wrist point is %.6g m from the axis of joint 1 and cannot come nearer than %.6g m"
            % (math.hypot(x, y), abs(offset)))


def _reached_q6(q6: float, x6: _InPlane, y6: _InPlane, wrist: _InPlane, d5: float, reach: _InPlane) -> float:
    """Return the angle nearest to q6, rad, for which the two links reach, where axes 2 to 4 and 6 are parallel.

    z4 turns with q6 in the plane of the arm, so that the tip of the links goes round the wrist on a circle of radius
    d5: the square of its distance to the shoulder is a constant plus a cosine.

    Args:
        q6: DH angle 6, rad.
        x6: Axis of the target in the plane of the arm.
        y6: The other one.
        wrist: The centre of the circle there, m.
        d5: Its radius and side, m.
        reach: Smallest and largest distance of the tip, m.
    """
    c6, s6 = math.cos(q6), math.sin(q6)
    tip = (d5 * (s6 * x6[0] + c6 * y6[0]), d5 * (s6 * x6[1] + c6 * y6[1]))  # from the wrist: -d5 z4
    turn = (d5 * (c6 * x6[0] - s6 * y6[0]), d5 * (c6 * x6[1] - s6 * y6[1]))  # its derivative by q6
    distance = math.hypot(wrist[0] + tip[0], wrist[1] + tip[1])
    allowed = min(max(distance, reach[0]), reach[1])
    twice = 2.0 * abs(d5) * math.hypot(*wrist)
    if abs(distance - allowed) <= CLAMP_TOLERANCE or twice == 0.0:
        return q6
    cosine = (allowed ** 2 - wrist[0] ** 2 - wrist[1] ** 2 - d5 ** 2) / twice
    here = math.atan2(wrist[0] * tip[1] - wrist[1] * tip[0], wrist[0] * tip[0] + wrist[1] * tip[1])
    there = math.copysign(math.acos(min(max(cosine, -1.0), 1.0)), here)
    return q6 + math.copysign(there - here, (there - here) * (tip[0] * turn[1] - tip[1] * turn[0]))


def _two_link(x: float, y: float, upper: float, fore: float) -> Tuple[List[Tuple[float, float]], bool, str]:
    """Solve a planar arm of two links whose tip is at x, y.

    Returns:
        The pairs (first angle, elbow angle); True where one was rounded to the limit; why there is none, in words.
    """
    squared = x * x + y * y
    cosine = (squared - upper * upper - fore * fore) / (2.0 * upper * fore)
    if -1.0 < cosine < 1.0:
        sine = math.sqrt((1.0 - cosine) * (1.0 + cosine))
        direction = math.atan2(y, x)
        elbow = math.atan2(sine, cosine)
        inner = math.atan2(fore * sine, upper + fore * cosine)
        return [(direction - inner, elbow), (direction + inner, -elbow)], False, ""
    distance = math.sqrt(squared)
    if distance >= upper + fore:
        if distance > upper + fore + CLAMP_TOLERANCE:
            return [], False, ("out of reach: shoulder to wrist would be %.6g m, the stretched arm has %.6g m"
                               % (distance, upper + fore))
        return [(math.atan2(y, x), 0.0)], True, ""
    if distance < abs(upper - fore) - CLAMP_TOLERANCE:
        return [], False, ("out of reach: shoulder to wrist would be %.6g m, the folded arm has %.6g m"
                           % (distance, abs(upper - fore)))
    return [(math.atan2(y, x) + (math.pi if fore > upper else 0.0), math.pi)], True, ""
