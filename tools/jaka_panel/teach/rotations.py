"""Rotation matrices, rotation vectors and poses; a pose is a position, m, (3,), and a rotation vector, rad, (3,)."""
import math
from typing import TYPE_CHECKING, Any, List, NamedTuple, Sequence

import numpy as np

if TYPE_CHECKING:
    Array = np.ndarray[Any, Any]
else:
    Array = np.ndarray


class FramePose(NamedTuple):
    """A frame in another one: position, m, (3,); rotation vector, rad, (3,)."""

    position: Sequence[float]
    rotation_vector: Sequence[float]


def compose(a: FramePose, b: FramePose) -> FramePose:
    """Return the frame that is ``b`` in ``a``."""
    turn = rotation_matrix(a.rotation_vector)
    return FramePose((turn @ np.asarray(b.position) + np.asarray(a.position)).tolist(),
                rotation_vector(turn @ rotation_matrix(b.rotation_vector)))


def invert(a: FramePose) -> FramePose:
    """Return the frame in which ``a`` is given, as it is seen from ``a``."""
    back = rotation_matrix(a.rotation_vector).T
    return FramePose((-(back @ np.asarray(a.position))).tolist(), rotation_vector(back))


def rotation_vector(matrix: Array) -> List[float]:
    """Return the rotation vector, rad, at most pi long, of a rotation matrix, (3, 3)."""
    m = matrix
    w = 1.0 + m[0, 0] + m[1, 1] + m[2, 2]
    candidates = np.array([  # four forms of the quaternion x y z w; the one with the largest part is the exact one
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], w],
        [1.0 + m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
        [m[0, 1] + m[1, 0], 1.0 - m[0, 0] + m[1, 1] - m[2, 2], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
        [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1.0 - m[0, 0] - m[1, 1] + m[2, 2], m[1, 0] - m[0, 1]]])
    best = candidates[int(np.argmax(np.linalg.norm(candidates, axis=1)))]
    best = best / np.linalg.norm(best) * (-1.0 if best[3] < 0.0 else 1.0)
    sine = float(np.linalg.norm(best[:3]))
    if sine < 1e-12:
        return [0.0, 0.0, 0.0]
    turned: List[float] = (2.0 * math.atan2(sine, float(best[3])) / sine * best[:3]).tolist()
    return turned


def rotation_matrix(vector: Sequence[float]) -> Array:
    """Return the rotation matrix, (3, 3), of a rotation vector, rad, (3,)."""
    v = np.asarray(vector, dtype=float)
    angle = float(np.linalg.norm(v))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = v / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: Array = np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * (k @ k)
    return turned
