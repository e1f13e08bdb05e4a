"""Polynomials through points with velocities, or with velocities and accelerations."""
from typing import Sequence, Tuple

import numpy as np

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT
from jaka_ros_driver.trajectory.path import TERMS, Array, cubic, quintic
from jaka_ros_driver.trajectory.points import TrajectoryPoint

_NOTHING = (0.0,) * JOINT_COUNT


def spline(points: Sequence[TrajectoryPoint]) -> Tuple[Array, Array]:
    """Return the breaks (n,) and coefficients (n - 1, 6, 6) of a ``Path`` through two or more points.

    Between two points with accelerations quintic, with velocities cubic, else straight, as ros_controllers'
    JointTrajectoryController does.
    """
    times = np.array([point.time for point in points])
    positions = np.array([point.position for point in points])
    velocities = np.array([point.velocity or _NOTHING for point in points])
    accelerations = np.array([point.acceleration or _NOTHING for point in points])
    has_velocity = np.array([point.velocity is not None for point in points])
    has_acceleration = np.array([point.acceleration is not None for point in points])
    durations = np.diff(times)
    coefficients = np.zeros((len(durations), TERMS, JOINT_COUNT))
    coefficients[:, 0], coefficients[:, 1] = positions[:-1], np.diff(positions, axis=0) / durations[:, None]
    fifth = has_acceleration[:-1] & has_acceleration[1:]
    third = has_velocity[:-1] & has_velocity[1:] & ~fifth
    ends = positions, velocities, accelerations
    if fifth.any():
        coefficients[fifth] = quintic(durations[fifth], tuple(e[:-1][fifth] for e in ends),
                                      tuple(e[1:][fifth] for e in ends))
    if third.any():
        coefficients[third] = cubic(durations[third], tuple(e[:-1][third] for e in ends[:2]),
                                    tuple(e[1:][third] for e in ends[:2]))
    return times, coefficients


def with_brake(breaks: Array, coefficients: Array, velocity: Sequence[float],
               acceleration: float) -> Tuple[Array, Array]:
    """Return the path with one more piece, in which joints of this velocity, rad/s (6,), are braked together."""
    duration = max(map(abs, velocity)) / acceleration
    u = breaks[-1] - breaks[-2]
    piece = np.zeros((1, TERMS, JOINT_COUNT))
    piece[0, 0] = u ** np.arange(TERMS) @ coefficients[-1]
    piece[0, 1] = velocity
    piece[0, 2] = -0.5 * np.asarray(velocity) / duration
    return np.append(breaks, breaks[-1] + duration), np.concatenate((coefficients, piece))
