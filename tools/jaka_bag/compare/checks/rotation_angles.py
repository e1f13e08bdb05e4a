"""Angles between orientations given as rotation vectors, for whole arrays."""
import numpy as np

from ...messages.batch import Array


def quaternions(rotation_vector: Array) -> Array:
    """Return unit quaternions (w, x, y, z) of rotation vectors, rad, shape (n, 3) to (n, 4)."""
    half = 0.5 * np.sqrt((rotation_vector * rotation_vector).sum(axis=1))
    result = np.empty((len(rotation_vector), 4))
    result[:, 0] = np.cos(half)
    result[:, 1:] = rotation_vector * (0.5 * np.sinc(half / np.pi))[:, None]
    return result


def continuous(quaternion: Array) -> Array:
    """Return the rotations with the sign of each quaternion next to the one before, so that they interpolate."""
    if len(quaternion) < 2:
        return quaternion
    flips = (quaternion[1:] * quaternion[:-1]).sum(axis=1) < 0
    if not flips.any():
        return quaternion
    sign = np.ones(len(quaternion))
    sign[1:] = np.where(np.cumsum(flips) % 2, -1.0, 1.0)
    signed: Array = quaternion * sign[:, None]
    return signed
