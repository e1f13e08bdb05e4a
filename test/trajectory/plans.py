"""Points, starts and paths of a Zu 7 for the tests of this folder. Ways are rad from home, joint 1 first."""
import math

import numpy as np

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.trajectory.build import BuildOptions, PathStart, build_path
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint

MODEL = load_model("zu7")
HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
REST = (0.0,) * 6
PERIOD = 0.008
ACCELERATION = 4.0 * math.pi
"""Ceiling of every joint's acceleration, rad/s2."""
TOP = math.pi
"""Ceiling of every joint's speed, rad/s."""
START_TOLERANCE = 0.01


def six(*values):
    """Return these, and 0 for the joints that are left."""
    return tuple(map(float, values + REST[len(values):]))


def joints(*ways):
    return tuple(h + w for h, w in zip(HOME, six(*ways)))


def at(time, ways, velocity=None, acceleration=None):
    """Return a point; each of the three is a tuple of the first joints' values, or None."""
    return TrajectoryPoint(time, joints(*ways), None if velocity is None else six(*velocity),
                           None if acceleration is None else six(*acceleration))


def resting(*ways):
    return PathStart(JointState(joints(*ways), REST, REST), True)


def moving(ways, velocity, acceleration=()):
    return PathStart(JointState(joints(*ways), six(*velocity), six(*acceleration)), False)


def build(points, start=None, elapsed=0.0, late=0.0, slows=False, **settings):
    return build_path(start or resting(), JointTrajectory(tuple(points), **settings), elapsed, MODEL,
                      BuildOptions(START_TOLERANCE, late, slows))


def wave(spacing, has_acceleration=False, duration=4.0, size=0.6, first=True):
    """Return points of a smooth curve that begins and ends at rest at home; each joint swings its own way."""
    count = int(round(duration / spacing))
    times = np.linspace(0.0, duration, count + 1)
    turns = np.array([1, 2, 3, 1, 2, 3]) * np.pi / duration
    sizes = size * np.array([1.0, 0.5, -0.3, -0.8, 0.4, 0.3])
    phase = turns * times[:, None]
    positions = np.array(HOME) + sizes * np.sin(phase) ** 2
    velocities = sizes * turns * np.sin(2.0 * phase)
    accelerations = 2.0 * sizes * turns ** 2 * np.cos(2.0 * phase)
    velocities[[0, -1]] = 0.0
    points = [TrajectoryPoint(float(t), tuple(p), tuple(v), tuple(a) if has_acceleration else None)
              for t, p, v, a in zip(times.tolist(), positions.tolist(), velocities.tolist(), accelerations.tolist())]
    return points if first else points[1:]


def samples(path, step=0.0005):
    """Return times of the whole path, and the three arrays of ``Path.at`` there."""
    times = np.arange(path.begin, path.end + step, step)
    states = [path.at(t) for t in times.tolist()]
    return (times, *(np.array([getattr(state, name) for state in states])
                     for name in ("position", "velocity", "acceleration")))
