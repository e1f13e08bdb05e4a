"""Trajectories to the driver's action, and whether the arm is where one begins."""
import threading
from typing import Optional, Sequence

import numpy as np

from jaka_bag.driver_interface import JOINTS
from jaka_bag.errors import JakaBagError
from jaka_bag.messages.batch import Array
from jaka_regression.trajectory_client import TrajectoryClient

from ..plans.point_plan import Plan
from .requests import CallResult

START_TOLERANCE_RAD = 0.01
"""Largest distance, rad, of the arm from a plan's start: the driver's own default, beyond which it refuses."""
_CONNECT_S = 5.0
"""Longest wait, s, for the driver's action server."""


def away_from_start(plan: Plan, joints: Optional[Sequence[float]]) -> Optional[str]:
    """Return why a plan cannot begin where the arm is, with the distance; None if it can."""
    if joints is None:
        return "the arm's joints are not known"
    if not plan.begins_here:
        return None
    distance, number = max((abs(a - b), n) for n, (a, b) in enumerate(zip(plan.position[0], joints), 1))
    if distance <= START_TOLERANCE_RAD:
        return None
    return "joint %d is %.4f rad from where the plan begins: move there first" % (number, distance)


def run(action: str, plan: Plan, cancelled: threading.Event) -> CallResult:
    """Have the arm go along a plan, and wait for its rest; when cancelled, it brakes on its path."""
    try:
        client = TrajectoryClient(action, _CONNECT_S)
    except JakaBagError as error:
        return CallResult(False, str(error))
    try:
        end = client.follow(JOINTS, np.array(plan.time), np.array(plan.position), _rows(plan.velocity),
                            _rows(plan.acceleration), cancelled)
    finally:
        client.close()
    return CallResult(end.succeeded, end.text)


def _rows(values: Sequence[Sequence[float]]) -> Array:
    return np.array(values) if values and values[0] else np.zeros((len(values), 0))
