"""Distances beside those of FCL, the Flexible Collision Library, which shares nothing with ours.

Poses come from kinematics that are written a second time (``dh_oracle``).
"""
import random

import dh_oracle
import numpy as np
import pytest
import second_opinions

from jaka_ros_driver.clearance.guard import MotionGuard
from jaka_ros_driver.clearance.shape import arm_shape
from jaka_ros_driver.clearance.workspace import workspace_of
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy

fcl = second_opinions.imported("fcl")

POSES = 2000
"""Random poses of each model."""
TOLERANCE = 1e-4
"""Largest difference, m."""
ZONES = {
    "keep_out": [{"name": "press", "centre": [0.5, 0.1, 0.3], "size": [0.3, 0.5, 0.2], "rpy": [0.3, -0.2, 0.7]}],
    "cylinders": [{"name": "post", "foot": [-0.4, 0.3, 0.0], "height": 0.6, "radius": 0.06}],
    "floor": -0.05,
    "tool": [{"name": "gripper", "start": [0.0, 0.0, 0.0], "end": [0.02, 0.0, 0.15], "radius": 0.04}],
}


def placed(shape, matrix, position):
    return fcl.CollisionObject(shape, fcl.Transform(np.ascontiguousarray(matrix), np.ascontiguousarray(position)))


def capsule_object(capsule, frame):
    """Return a capsule of FCL, whose axis is z, at the place of one of ours in a DH frame, a 4x4 matrix."""
    start, end = (frame[:3, :3] @ np.array(point) + frame[:3, 3] for point in (capsule.start, capsule.end))
    axis = end - start
    length = float(np.linalg.norm(axis))
    z = axis / length
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return placed(fcl.Capsule(capsule.radius, length), np.column_stack([x, np.cross(z, x), z]), 0.5 * (start + end))


def distance(one, other):
    """Return FCL's distance, m, which is negative where the two overlap, and says no more then."""
    return fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult())


@pytest.mark.parametrize("name", ["zu3", "zu7", "zu18", "a12", "minicobo"])
def test_distances_between_the_parts_are_those_of_fcl(name):
    model, rng = load_model(name), random.Random(31)
    guard, shape = MotionGuard(model), arm_shape(model)
    touching = 0
    for _ in range(POSES):
        joints = dh_oracle.random_joints(model, rng)
        frames = dh_oracle.matrices(model, joints)
        objects = [capsule_object(capsule, frames[capsule.frame]) for capsule in shape.capsules]
        theirs = min(distance(objects[n], objects[m]) for n, m in shape.pairs)
        ours = guard.nearest(joints).distance
        touching += theirs < 0.0
        assert (ours < 0.0) == (theirs < 0.0)
        if theirs >= 0.0:
            assert ours == pytest.approx(theirs, abs=TOLERANCE)
    assert touching


@pytest.mark.parametrize("name", ["zu7", "a12"])
def test_distances_from_zones_are_those_of_fcl(name):
    model, rng = load_model(name), random.Random(32)
    workspace = workspace_of(ZONES)
    guard, shape = MotionGuard(model, workspace), arm_shape(model, workspace.tool)
    box, = workspace.keep_out
    post, = workspace.cylinders
    zones = [placed(fcl.Box(*box.size), np.array(matrix_from_rpy(box.rpy)).reshape(3, 3), np.array(box.centre)),
             placed(fcl.Cylinder(post.radius, post.height), np.eye(3), np.array(post.foot) + [0.0, 0.0, 0.3])]
    near_zones = 0
    for _ in range(POSES):
        joints = dh_oracle.random_joints(model, rng)
        frames = dh_oracle.matrices(model, joints)
        objects = [capsule_object(capsule, frames[capsule.frame]) for capsule in shape.capsules]
        moving = [(capsule, thing) for capsule, thing in zip(shape.capsules, objects) if capsule.frame >= 2]
        lowest = min((frames[capsule.frame][:3, :3] @ np.array(end) + frames[capsule.frame][:3, 3])[2] - capsule.radius
                     for capsule, _ in moving for end in (capsule.start, capsule.end))
        of_zones = min([distance(thing, zone) for _, thing in moving for zone in zones] + [lowest + 0.05])
        theirs = min([of_zones] + [distance(objects[n], objects[m]) for n, m in shape.pairs])
        ours = guard.nearest(joints).distance
        near_zones += of_zones == theirs
        assert (ours < 0.0) == (theirs < 0.0)
        if theirs >= 0.0:
            assert ours == pytest.approx(theirs, abs=TOLERANCE)
    assert near_zones > 0.3 * POSES
