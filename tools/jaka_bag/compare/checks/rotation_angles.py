"""Angles between orientations given as rotation vectors, for whole arrays."""
from typing import Optional

import numpy as np

from ...messages.batch import Array, row_products


def quaternions(rotation_vector: Array) -> Array:
    """Return unit quaternions (w, x, y, z) of rotation vectors, rad, shape (n, 3) to (n, 4)."""
    half = 0.5 * np.sqrt(row_products(rotation_vector, rotation_vector))
    share = 0.5 * np.sinc(half / np.pi)
    return np.stack([np.cos(half), *(column * share for column in rotation_vector.T)], axis=1)


def continuous(quaternion: Array, before: Optional[Array] = None) -> Array:
    """Return the rotations with the sign of each quaternion next to the one before, so that they interpolate.

    Args:
        quaternion: The rotations, shape (n, 4).
        before: The rotation before the first, shape (4,); None where there is none.
    """
    flips = np.zeros(len(quaternion), bool)
    flips[1:] = row_products(quaternion[1:], quaternion[:-1]) < 0
    if before is not None:
        flips[:1] = row_products(quaternion[:1], before) < 0
    if not flips.any():
        return quaternion
    signed: Array = quaternion * np.where(np.cumsum(flips) % 2, -1.0, 1.0)[:, None]
    return signed
