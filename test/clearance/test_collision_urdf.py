"""The URDF's collision geometry, read by a foreign parser, is the capsules of the guard."""
import io
import random

import dh_oracle
import numpy as np
import pytest
import second_opinions

from jaka_ros_driver.clearance.collision_urdf import collision_elements
from jaka_ros_driver.clearance.shape import Capsule, arm_shape
from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.kinematics.arm_models import load_model, model_names
from jaka_ros_driver.kinematics.urdf import urdf_from_model

yourdfpy = second_opinions.imported("yourdfpy")

GRIPPER = Capsule('a "gripper" <1>', 6, (0.0, 0.0, 0.0), (0.03, 0.0, 0.2), 0.04)
BALL = Capsule("ball", 6, (0.1, 0.0, 0.0), (0.1, 0.0, 0.0), 0.05)


def capsules_of(robot):
    """Return (name, radius, ends in the base) of the capsules that a robot of yourdfpy consists of, link by link."""
    found = []
    for name, link in robot.link_map.items():
        frame = robot.get_transform(name, "base_link")
        parts = {}
        for collision in link.collisions:
            parts.setdefault(collision.name, []).append(collision)
        for part, collisions in parts.items():
            balls = [one for one in collisions if one.geometry.sphere is not None]
            rods = [one.geometry.cylinder for one in collisions if one.geometry.cylinder is not None]
            radii = {one.geometry.sphere.radius for one in balls} | {rod.radius for rod in rods}
            assert len(radii) == 1 and len(balls) == len(rods) + 1 <= 2
            ends = np.array([(frame @ one.origin)[:3, 3] for one in balls])
            for rod, place in zip(rods, (one.origin for one in collisions if one.geometry.cylinder is not None)):
                tips = [(frame @ place @ np.array([0.0, 0.0, side * rod.length, 1.0]))[:3] for side in (-0.5, 0.5)]
                assert np.allclose(tips, ends, atol=1e-12)
            found.append((part, radii.pop(), ends))
    return found


@pytest.mark.parametrize("name", model_names())
def test_a_foreign_parser_reads_the_capsules_where_the_guard_has_them(name):
    model, rng = load_model(name), random.Random(8)
    tool = (GRIPPER, BALL)
    text = urdf_from_model(model, collisions=collision_elements(model, tool))
    robot = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=True)
    expected = arm_shape(model, tool).capsules
    for _ in range(3):
        joints = dh_oracle.random_joints(model, rng)
        robot.update_cfg(dict(zip(JOINTS, joints)))
        frames = dh_oracle.matrices(model, joints)
        found = capsules_of(robot)
        assert [part for part, _, _ in found] == [capsule.name for capsule in expected]
        for (_, radius, ends), capsule in zip(found, expected):
            assert radius == capsule.radius
            points = [capsule.start, capsule.end][:len(ends)]
            places = [frames[capsule.frame][:3, :3] @ np.array(point) + frames[capsule.frame][:3, 3]
                      for point in points]
            assert np.allclose(ends, places, atol=1e-9)


def test_a_urdf_without_collision_geometry_is_as_it_was():
    assert "<collision" not in urdf_from_model(load_model("zu7"))
