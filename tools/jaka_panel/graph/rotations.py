"""Rotation vectors, roll pitch yaw about fixed axes (R = Rz Ry Rx) and quaternions x y z w; rad."""
import math
from typing import List, Sequence

_TINY = 1e-12
"""Sine below which an axis is not known, and a rotation counts as none: rounding of floats."""


def vector_from_quaternion(x: float, y: float, z: float, w: float) -> List[float]:
    """Return the rotation vector, at most pi long, of a quaternion of any length but 0."""
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * math.atan2(sine, w) / sine if sine > _TINY else 2.0
    return [scale * x, scale * y, scale * z]


def quaternion_from_vector(vector: Sequence[float]) -> List[float]:
    """Return the unit quaternion x y z w of a rotation vector."""
    angle = math.sqrt(sum(value * value for value in vector))
    scale = math.sin(0.5 * angle) / angle if angle > _TINY else 0.5
    return [scale * value for value in vector] + [math.cos(0.5 * angle)]


def vector_from_rpy(rpy: Sequence[float]) -> List[float]:
    """Return the rotation vector of roll, pitch and yaw."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(0.5 * angle), math.cos(0.5 * angle)) for angle in rpy)
    return vector_from_quaternion(sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                                  cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)


def rpy_from_vector(vector: Sequence[float]) -> List[float]:
    """Return roll, pitch and yaw of a rotation vector; where pitch is +-90 deg, roll is 0."""
    x, y, z, w = quaternion_from_vector(vector)
    sine = max(-1.0, min(1.0, 2.0 * (w * y - x * z)))
    if abs(sine) > 1.0 - _TINY:
        return [0.0, math.copysign(0.5 * math.pi, sine), 2.0 * math.atan2(z, w)]
    return [math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)), math.asin(sine),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))]
