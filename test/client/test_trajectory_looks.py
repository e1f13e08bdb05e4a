"""The look along a trajectory: between the places that are looked at, no part comes nearer than 5 mm."""
import types

import numpy as np
import pytest

from jaka_ros_driver.clearance.guard import MotionGuard
from jaka_ros_driver.clearance.workspace import workspace_of
from jaka_ros_driver.client.core.motion_guard import motion_check
from jaka_ros_driver.client.core.motion_guard.motion_check import MotionCheck
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.trajectory.build import BuildOptions, PathStart, build_path
from jaka_ros_driver.trajectory.path import JointState, Path
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint

REST = (0.0,) * 6
LEVEL = (0.0, 0.15, -0.1, 0.0, 1.5708, 0.0)
"""A stretched arm, nearly level."""


def dip(model, acceleration, turn=0.2):
    """Return the path of a stretched arm that swings down and up again, three joints at this acceleration, rad/s2."""
    down = np.array([0.0, -1.0, -1.0, -1.0, 0.0, 0.0])
    speed, lead = acceleration * turn / 2.0, 0.3
    begin = tuple(LEVEL - down * speed * lead / 2.0)
    points = (TrajectoryPoint(0.0, begin, REST, REST),
              TrajectoryPoint(lead, LEVEL, tuple(down * speed), tuple(-down * acceleration)),
              TrajectoryPoint(lead + turn, LEVEL, tuple(-down * speed), tuple(-down * acceleration)),
              TrajectoryPoint(2.0 * lead + turn, begin, REST, REST))
    return build_path(PathStart(JointState(begin, REST, REST), True), JointTrajectory(points), 0.0, model,
                      BuildOptions(0.01, slows=True))


def trouble(model, path, floor, tool):
    settings = types.SimpleNamespace(guard_motion="stop", workspace=workspace_of({"floor": floor, "tool": tool}))
    return MotionCheck(model, settings, None).trajectory_trouble(path)


@pytest.mark.parametrize("acceleration", [12.5, 15.5])
@pytest.mark.parametrize("length", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("name", ["zu7", "zu20", "pro16"])
def test_five_millimetres_are_certain_for_every_reach(name, length, acceleration):
    model = load_model(name)
    along = np.array(forward(model, LEVEL)[:9]).reshape(3, 3).T @ (1.0, 0.0, 0.0)
    tool = [{"name": "tool", "start": [0, 0, 0], "end": (length * along).tolist(), "radius": 0.02}] if length else []
    path = dip(model, acceleration)
    guard = MotionGuard(model, workspace_of({"floor": -9.0, "tool": tool}))
    checks = [check for check in guard._checks if check.second == "the floor"]
    lowest = min(check.gap(guard._ends(tuple(joints)), 1e9) for check in checks
                 for joints in path.samples(np.linspace(0.3, 0.5, 801))[0].tolist()) - 9.0
    assert "from the floor" in trouble(model, path, lowest - 0.0049, tool)
    assert trouble(model, path, lowest - 0.0125, tool) == ""


def test_a_calm_trajectory_is_looked_at_every_40_ms():
    piece = np.zeros((1, 6, 6))
    piece[0, 1] = 0.1
    times = motion_check._times_of(Path([0.0, 4.0], piece), (2.0,) * 6)
    assert len(times) == 101 and times[-1] == 4.0
