"""Rules about the frames of a trajectory: on the path that was asked for, and smooth, whatever happens to its speed."""
import math
from typing import List, Optional, Tuple

import numpy as np
from driver_process import Call
from verdict import RuleBroken

from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING
from jaka_ros_driver.trajectory.path import Path

SERVO_CYCLE = 0.008
ACCELERATION_SLACK = 1.1
"""Factor over the ceiling: 2 % that the driver's audit allows (build.ACCELERATION_SLACK), and more between its
samples."""
ON_PATH = 2e-3
"""Distance of a frame from the path, rad, at most: a joint at pi rad/s goes 1.6e-3 rad in ``_LOOK``, the time between
two samples of the path; with rounding, 2e-3."""
_LOOK = 5e-4
_AROUND = np.arange(-0.02, 0.1, _LOOK)
"""Times around the last place, s: where a path rests, its place in time is not known."""


class TrajectoryRules:
    """The judge of each stream of frames, along the path of its goal."""

    def __init__(self) -> None:
        self._frames: List[Tuple[float, ...]] = []
        self._paths: List[Tuple[Path, float]] = []
        self._goal: Optional[Call] = None

    def begin(self) -> None:
        """Forget the frames before: servo mode is entered."""
        self._frames, self._paths, self._goal = [], [], None

    def sends(self, joints: Tuple[float, ...], goal: Optional[Call], now: float) -> None:
        """Judge a frame that goes out; ``goal``: the newest trajectory that is not answered."""
        if goal is not None and goal is not self._goal:
            self._goal = goal
            joined = [known for known in self._paths if known[0] is goal.start.path]
            self._paths = joined + [(goal.path, goal.path.begin)]
        if not self._paths or len(joints) != 6:
            return
        self._is_smooth(joints, now)
        self._is_on_path(joints, now)

    def _is_smooth(self, joints: Tuple[float, ...], now: float) -> None:
        self._frames = self._frames[-2:] + [joints]
        if len(self._frames) < 3:
            return
        for index, (a, b, c) in enumerate(zip(*self._frames)):
            acceleration = abs(c - 2.0 * b + a) / SERVO_CYCLE ** 2
            if acceleration > JOINT_ACCELERATION_CEILING * ACCELERATION_SLACK:
                raise RuleBroken("t", now, "a trajectory's frames ask %.2f rad/s2 of joint %d" % (
                    acceleration, index + 1))

    def _is_on_path(self, joints: Tuple[float, ...], now: float) -> None:
        """Judge that a frame is on the newest path, or still on the one before it, a little beyond the last frame."""
        best = math.inf
        for number in reversed(range(len(self._paths))):
            path, since = self._paths[number]
            times = np.clip(since + _AROUND, path.breaks[0], path.end)
            distances = np.abs(path.samples(times)[0] - np.array(joints)).max(axis=1)
            nearest = int(distances.argmin())
            away = float(distances[nearest])
            if away <= ON_PATH:
                self._paths[number] = path, float(times[nearest])
                return
            best = min(best, away)
        raise RuleBroken("t", now, "a frame is %.4f rad beside the path that was asked for" % best)
