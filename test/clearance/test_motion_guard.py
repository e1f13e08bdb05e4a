"""The judgement of the guard on joint positions and paths."""
import math
import random

import dh_oracle
import pytest

from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, MotionGuard
from jaka_ros_driver.clearance.workspace import workspace_of
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model, model_names

IN_THE_COLUMN = (1.781, -0.866, -2.694, 0.38, 0.163, -3.141)
"""A pose of the Zu7 that puts the flange 24 mm beside the axis of the base."""
STANDING = (0.0, 0.5 * math.pi, 0.0, 0.5 * math.pi, 0.0, 0.0)
WORKING = (0.0, 0.5 * math.pi, -0.5 * math.pi, 0.5 * math.pi, 0.5 * math.pi, 0.0)


@pytest.fixture
def guard():
    return MotionGuard(load_model("zu7"))


def test_a_flange_in_the_column_is_refused(guard):
    assert guard.trouble(IN_THE_COLUMN)
    assert guard.nearest(IN_THE_COLUMN).distance < 0.0
    found = guard.first_trouble([WORKING, IN_THE_COLUMN])
    assert found.index == 0 and 0.0 < found.share < 1.0 and found.reason


@pytest.mark.parametrize("name", model_names())
def test_home_and_work_poses_are_clear(name):
    guard = MotionGuard(load_model(name))
    poses = [(0.0,) * 6, STANDING, WORKING] if name != "minicobo" else [(0.0,) * 6, (0.0, 0.3, 1.2, 0.0, 1.2, 0.0)]
    for pose in poses:
        assert guard.trouble(pose) == "", pose
    assert guard.first_trouble(poses) is None


def test_between_samples_of_a_path_nothing_is_missed(guard):
    model, rng = load_model("zu7"), random.Random(3)
    for _ in range(100):
        ends = dh_oracle.random_joints(model, rng), dh_oracle.random_joints(model, rng)
        if guard.trouble(ends[0]):
            continue
        samples = [tuple(a + k / 400.0 * (b - a) for a, b in zip(*ends)) for k in range(401)]
        lowest = [guard.nearest(sample).distance for sample in samples]
        first = next((k for k, distance in enumerate(lowest) if distance < DEFAULT_MARGIN - 0.005), None)
        found = guard.first_trouble(list(ends))
        if first is not None:
            assert found is not None and found.share <= first / 400.0 + 1e-9
        elif found is not None:
            assert guard.nearest(found.joints).distance < DEFAULT_MARGIN


def test_an_arm_in_trouble_may_move_out_and_not_deeper(guard):
    assert guard.first_trouble([IN_THE_COLUMN, IN_THE_COLUMN]) is None
    found = guard.first_trouble([WORKING, IN_THE_COLUMN])
    inside = found.joints
    assert guard.first_trouble([inside, WORKING]) is None
    assert guard.first_trouble([inside, IN_THE_COLUMN]).index == 0
    assert guard.is_worse(IN_THE_COLUMN, inside) and not guard.is_worse(inside, IN_THE_COLUMN)
    assert not guard.is_worse(inside, inside) and not guard.is_worse(WORKING, inside)


def test_joint_angles_that_are_not_finite_are_refused(guard):
    bad = (0.0, math.nan) + (0.0,) * 4
    for ask in (guard.nearest, guard.trouble, lambda pose: guard.is_worse(pose, WORKING),
                lambda pose: guard.first_trouble([WORKING, pose])):
        with pytest.raises(InvalidCommand, match="finite"):
            ask(bad)


@pytest.mark.parametrize("mapping, named", [
    ({"keep_out": [{"name": "press", "centre": [0.4, 0.0, 0.3], "size": [0.2, 0.4, 0.2]}]}, "keep-out box 'press'"),
    ({"keep_in": [{"name": "cell", "centre": [0.0, 0.0, 0.5], "size": [0.4, 0.4, 1.5]}]}, "keep-in box 'cell'"),
    ({"cylinders": [{"name": "post", "foot": [0.42, 0.11, 0.0], "height": 0.5, "radius": 0.03}]}, "cylinder 'post'"),
    ({"floor": 0.5}, "floor"),
    ({"tool": [{"name": "gripper", "start": [0, 0, 0], "end": [0, 0, 0.7], "radius": 0.03}], "floor": -0.1}, "gripper"),
])
def test_zones_and_tools_are_named(mapping, named):
    guard = MotionGuard(load_model("zu7"), workspace_of(mapping))
    assert named in guard.trouble(WORKING)
