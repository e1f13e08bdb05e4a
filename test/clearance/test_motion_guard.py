"""The judgement of the guard on joint positions and paths."""
import math
import random

import dh_oracle
import numpy as np
import pytest

from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, MotionGuard
from jaka_ros_driver.clearance.shape import arm_shape
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
    assert guard.first_trouble([inside, WORKING, inside]).index == 1


def test_a_path_of_many_points_is_the_path_of_its_ends(guard):
    whole = guard.first_trouble([WORKING, IN_THE_COLUMN])
    points = [tuple(a + k / 500.0 * (b - a) for a, b in zip(WORKING, IN_THE_COLUMN)) for k in range(501)]
    found = guard.first_trouble(points)
    assert (found.index + found.share) / 500.0 == pytest.approx(whole.share, abs=0.01)
    assert found.joints == pytest.approx(whole.joints, abs=0.03)


def test_joint_angles_that_are_not_finite_are_refused(guard):
    bad = (0.0, math.nan) + (0.0,) * 4
    for ask in (guard.nearest, guard.trouble, lambda pose: guard.first_trouble([WORKING, pose])):
        with pytest.raises(InvalidCommand, match="finite"):
            ask(bad)


@pytest.mark.parametrize("mapping, named", [
    ({"keep_out": [{"name": "press", "centre": [0.4, 0.0, 0.3], "size": [0.2, 0.4, 0.2]}]}, "keep-out box 'press'"),
    ({"keep_in": [{"name": "cell", "centre": [0.0, 0.0, 0.5], "size": [0.4, 0.4, 1.8]}]}, "keep-in box 'cell'"),
    ({"cylinders": [{"name": "post", "foot": [0.42, 0.11, 0.0], "height": 0.5, "radius": 0.03}]}, "cylinder 'post'"),
    ({"floor": 0.4}, "the floor"),
    ({"tool": [{"name": "lance", "start": [0, 0, 0], "end": [0, 0, 0.45], "radius": 0.03}], "floor": -0.1}, "lance"),
])
def test_zones_and_tools_are_named(mapping, named):
    guard = MotionGuard(load_model("zu7"), workspace_of(mapping))
    assert named in guard.trouble(WORKING)
    found = guard.first_trouble([STANDING, WORKING])
    assert found is not None and named in found.reason or "floor" in mapping


def test_a_part_that_moves_into_a_zone_is_seen_on_the_way_although_both_ends_are_clear():
    post = {"cylinders": [{"name": "post", "foot": [0.42, 0.11, 0.0], "height": 0.6, "radius": 0.02}]}
    guard = MotionGuard(load_model("zu7"), workspace_of(post))
    left, right = (-0.8,) + WORKING[1:], (0.8,) + WORKING[1:]
    assert guard.trouble(left) == guard.trouble(right) == ""
    found = guard.first_trouble([WORKING[:0] + left, left, right, left])
    assert found.index == 1 and 0.0 < found.share < 0.5
    assert "at least 10 mm are kept" in found.reason and "the cylinder 'post'" in found.reason


def test_a_floor_is_the_top_of_a_box_without_end(guard):
    slab = {"keep_out": [{"name": "slab", "centre": [0.0, 0.0, -9.8], "size": [20.0, 20.0, 20.0]}]}
    floored = MotionGuard(load_model("zu7"), workspace_of({"floor": 0.2}))
    boxed, rng = MotionGuard(load_model("zu7"), workspace_of(slab)), random.Random(5)
    for _ in range(200):
        joints = dh_oracle.random_joints(load_model("zu7"), rng)
        assert floored.nearest(joints).distance == pytest.approx(boxed.nearest(joints).distance, abs=1e-7)


def test_a_keep_in_box_keeps_all_of_every_part_in():
    model, rng = load_model("zu7"), random.Random(7)
    guard = MotionGuard(model, workspace_of({
        "keep_in": [{"name": "cell", "centre": [0.0, 0.0, 0.5], "size": [1.4, 1.4, 1.4]}]}))
    alone, decided = MotionGuard(model), 0
    for _ in range(200):
        joints = dh_oracle.random_joints(model, rng)
        frames = dh_oracle.matrices(model, joints)
        ends = [(frames[part.frame] @ (*end, 1.0), part.radius) for part in arm_shape(model).capsules if part.frame >= 2
                for end in (part.start, part.end)]
        way = min(0.7 - max(abs(x), abs(y), abs(z - 0.5)) - radius for (x, y, z, _), radius in ends)
        expected = min(way, alone.nearest(joints).distance)
        found = guard.nearest(joints).distance
        decided += way == expected
        if expected > -0.02:  # farther out the way to a corner counts, which is longer
            assert found == pytest.approx(expected, abs=1e-9)
        else:
            assert found < -0.02
    assert decided > 20


@pytest.mark.parametrize("name", ["zu7", "a12", "minicobo"])
def test_no_distance_changes_faster_than_its_bound(name):
    model, rng = load_model(name), random.Random(6)
    guard = MotionGuard(model, workspace_of({
        "keep_out": [{"name": "press", "centre": [0.4, 0.0, 0.3], "size": [0.2, 0.4, 0.2]}], "floor": 0.0,
        "keep_in": [{"name": "cell", "centre": [0.0, 0.0, 0.5], "size": [1.0, 1.0, 1.0]}],
        "tool": [{"name": "hook", "start": [0.1, 0, 0.0], "end": [0.1, 0.1, 0.2], "radius": 0.02}]}))
    steepest = 0.0
    for _ in range(300):
        joints = dh_oracle.random_joints(model, rng)
        step = tuple(rng.choice((-1.0, 0.0, 1.0)) * 10.0 ** rng.uniform(-4.0, 0.0) for _ in joints)
        moved = tuple(angle + part for angle, part in zip(joints, step))
        ends, moved_ends = guard._ends(joints), guard._ends(moved)
        for check in guard._checks:
            change = abs(check.gap(ends, math.inf) - check.gap(moved_ends, math.inf))
            bound = sum(abs(part) * reach for part, reach in zip(step, check.reach))
            assert change <= bound + 1e-6
            steepest = max(steepest, change / bound if bound else 0.0)
    assert steepest > 0.9  # the bound is not idle either


def test_a_long_plan_is_audited_with_far_fewer_looks_than_points(guard, monkeypatch):
    looks, ends = [], guard._ends
    monkeypatch.setattr(guard, "_ends", lambda *of: looks.append(of) or ends(*of))
    plan = [tuple(angle + 0.4 * math.sin(0.01 * k + n) for n, angle in enumerate(WORKING)) for k in range(2000)]
    assert guard.first_trouble(plan) is None
    assert len(looks) < 400


RINGS = {"cylinders": [{"name": "ring %d" % n, "foot": [0.0, 0.0, -1.0], "height": 4.0, "radius": 0.2 + 0.01 * n}
                       for n in range(50)]}
"""Cylinders around the axis of joint 1, in which an arm that turns about it is as deep everywhere."""


def test_a_look_that_would_be_too_long_ends_with_its_place_and_the_number():
    guard = MotionGuard(load_model("zu7"), workspace_of(RINGS))
    way = [(angle,) + WORKING[1:] for angle in (-3.0, 3.0)]
    assert guard.first_trouble(way) is None
    found = guard.first_trouble(way, 5000)
    assert found.index == 0 and 0.0 < found.share < 1.0 and found.joints[0] == pytest.approx(-3.0 + 6.0 * found.share)
    assert "it has taken 5000 distances" in found.reason and "send it in parts" in found.reason


def test_every_step_of_a_look_is_small_and_pieces_find_what_the_whole_finds():
    guard = MotionGuard(load_model("zu7"), workspace_of(RINGS))
    rng = random.Random(9)
    for case in range(10):
        ends = [dh_oracle.random_joints(load_model("zu7"), rng) for _ in range(5)]
        points = np.concatenate([np.linspace(a, b, 100, endpoint=False) for a, b in zip(ends, ends[1:])])
        whole, steps = guard.first_trouble([tuple(point) for point in points]), []
        looks = guard.looks(points[first:first + 71] for first in range(0, len(points) - 1, 70))
        with pytest.raises(StopIteration) as end:
            while True:
                steps.append(next(looks))
        assert max(steps) <= len(guard._checks) + 10
        found = end.value.value
        assert (found is None) is (whole is None), case
        if whole is not None:
            assert found.index + found.share == pytest.approx(whole.index + whole.share, abs=0.5)
            assert found.reason.split()[1] == whole.reason.split()[1]
