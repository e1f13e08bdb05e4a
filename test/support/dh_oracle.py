"""Kinematics written a second time, by other means than the package: 4x4 matrices and iteration from many starts."""
import math

import numpy as np


def matrices(model, joint_position):
    """Return frames 0..6 of the standard DH table as products of the four elementary motions, shape (7, 4, 4)."""
    frames = [np.eye(4)]
    for row, angle in zip(model.dh, joint_position):
        theta = angle + row.theta_offset
        turn = np.array([[math.cos(theta), -math.sin(theta), 0, 0], [math.sin(theta), math.cos(theta), 0, 0],
                         [0, 0, 1, 0], [0, 0, 0, 1]])
        twist = np.array([[1, 0, 0, 0], [0, math.cos(row.alpha), -math.sin(row.alpha), 0],
                          [0, math.sin(row.alpha), math.cos(row.alpha), 0], [0, 0, 0, 1]])
        shift = np.eye(4)
        shift[0, 3], shift[2, 3] = row.a, row.d
        frames.append(frames[-1] @ turn @ shift @ twist)
    return frames


def flange(model, joint_position):
    return matrices(model, joint_position)[-1]


def as_matrix(transform):
    """Convert a package Transform to a 4x4 matrix."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.array(transform[:9]).reshape(3, 3)
    matrix[:3, 3] = transform[9:]
    return matrix


def error(reached, target):
    """Return the largest difference of the two 4x4 matrices (m and direction cosines together)."""
    return float(np.max(np.abs(reached - target)))


def distance(a, b):
    """Return the largest difference of two joint positions, whole turns not counted, rad."""
    return max(abs(math.remainder(x - y, math.tau)) for x, y in zip(a, b))


def solutions(model, target, random, starts):
    """Return branches that reach the 4x4 target, found by damped Newton with a difference quotient from random
    starts."""
    found = []
    for _ in range(starts):
        angles = np.array([random.uniform(-math.pi, math.pi) for _ in range(6)])
        for _ in range(60):
            now = flange(model, angles)
            residual = (target - now)[:3].ravel()
            if np.max(np.abs(residual)) < 1e-11:
                if not any(distance(angles, other) < 1e-4 for other in found):
                    found.append(angles)
                break
            step = 1e-7
            slopes = np.array([(flange(model, angles + step * unit) - now)[:3].ravel() / step for unit in np.eye(6)])
            move = np.linalg.lstsq(slopes.T, residual, rcond=None)[0]
            angles = angles + move * min(1.0, 0.4 / np.max(np.abs(move)))
    return found


def random_joints(model, random):
    """Draw joint angles within the limits, at most half a turn either way."""
    return tuple(random.uniform(max(low, -math.pi), min(high, math.pi)) for low, high in model.joint_limits)
