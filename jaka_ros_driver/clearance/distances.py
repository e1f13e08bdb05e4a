"""Distances between segments, and of a segment from a convex solid, in plain Python.

A point is a tuple of three floats, m. A signed distance is negative inside. Source of the distance between segments:
Ericson, Real-Time Collision Detection (2005), section 5.1.9.
"""
import math
from typing import Callable

from jaka_ros_driver.kinematics.rotations import Transform, Vector3

SignedDistance = Callable[[float, float, float], float]
"""The signed distance of a point, m, from a convex solid: convex along each line, as that of every convex solid is."""

_PARALLEL = 1e-12
"""Bound of sin2 of the angle between segments, below which they count as parallel."""
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_STEPS = 32
"""Steps of the search along a segment: its last interval is 2e-7 of the segment."""


def point_in_base(frame: Transform, point: Vector3) -> Vector3:
    """Return in the base frame a point, m, that is given in ``frame``."""
    x, y, z = point
    return (frame[0] * x + frame[1] * y + frame[2] * z + frame[9],
            frame[3] * x + frame[4] * y + frame[5] * z + frame[10],
            frame[6] * x + frame[7] * y + frame[8] * z + frame[11])


def segment_distance(p1: Vector3, q1: Vector3, p2: Vector3, q2: Vector3) -> float:
    """Return the distance, m, between the segments p1 q1 and p2 q2; either may be a point."""
    ux, uy, uz = q1[0] - p1[0], q1[1] - p1[1], q1[2] - p1[2]
    vx, vy, vz = q2[0] - p2[0], q2[1] - p2[1], q2[2] - p2[2]
    wx, wy, wz = p1[0] - p2[0], p1[1] - p2[1], p1[2] - p2[2]
    a = ux * ux + uy * uy + uz * uz
    e = vx * vx + vy * vy + vz * vz
    f = vx * wx + vy * wy + vz * wz
    if a == 0.0:
        s = 0.0
        t = min(1.0, max(0.0, f / e)) if e > 0.0 else 0.0
    else:
        c = ux * wx + uy * wy + uz * wz
        if e == 0.0:
            t = 0.0
            s = min(1.0, max(0.0, -c / a))
        else:
            b = ux * vx + uy * vy + uz * vz
            denominator = a * e - b * b
            s = min(1.0, max(0.0, (b * f - c * e) / denominator)) if denominator > _PARALLEL * a * e else 0.0
            t = (b * s + f) / e
            if t < 0.0:
                t = 0.0
                s = min(1.0, max(0.0, -c / a))
            elif t > 1.0:
                t = 1.0
                s = min(1.0, max(0.0, (b - c) / a))
    dx, dy, dz = wx + s * ux - t * vx, wy + s * uy - t * vy, wz + s * uz - t * vz
    return math.sqrt(dx * dx + dy * dy + dz * dz)


def lowest_on_segment(signed: SignedDistance, p: Vector3, q: Vector3, enough: float = math.inf) -> float:
    """Return the lowest signed distance, m, of the points of the segment p q, by golden-section search.

    enough: m; a lower bound that is above it is returned as soon as it is known.
    """
    px, py, pz = p
    ux, uy, uz = q[0] - px, q[1] - py, q[2] - pz
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    low, high = 0.0, 1.0
    s, t = 1.0 - _GOLDEN, _GOLDEN
    at_s = signed(px + s * ux, py + s * uy, pz + s * uz)
    at_t = signed(px + t * ux, py + t * uy, pz + t * uz)
    for _ in range(_STEPS):
        bound = min(at_s, at_t) - (high - low) * length  # no signed distance changes faster than its point moves
        if bound > enough:
            return bound
        if at_s < at_t:
            high, t, at_t = t, s, at_s
            s = high - _GOLDEN * (high - low)
            at_s = signed(px + s * ux, py + s * uy, pz + s * uz)
        else:
            low, s, at_s = s, t, at_t
            t = low + _GOLDEN * (high - low)
            at_t = signed(px + t * ux, py + t * uy, pz + t * uz)
    return min(at_s, at_t, signed(*p), signed(*q))
