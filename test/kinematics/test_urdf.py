import math
import random
import xml.etree.ElementTree as ElementTree

import dh_oracle
import numpy as np
import pytest

from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.kinematics.arm_models import ArmModel, DhRow, load_model, model_names
from jaka_ros_driver.kinematics.limits import stream_limits, top_joint_speeds
from jaka_ros_driver.kinematics.urdf import urdf_from_model

LINKS = ["base_link", "link_1", "link_2", "link_3", "link_4", "link_5", "link_6", "tool0"]


def numbers(text):
    return [float(word) for word in text.split()]


def origin(element):
    """Return the 4x4 matrix of an <origin>, as the URDF specification defines it."""
    matrix = np.eye(4)
    found = element.find("origin")
    roll, pitch, yaw = numbers(found.get("rpy", "0 0 0"))
    turn = np.eye(3)
    for axis, angle in (((0, 1), yaw), ((2, 0), pitch), ((1, 2), roll)):
        step = np.eye(3)
        i, j = axis
        step[i, i] = step[j, j] = math.cos(angle)
        step[i, j], step[j, i] = -math.sin(angle), math.sin(angle)
        turn = turn @ step
    matrix[:3, :3] = turn
    matrix[:3, 3] = numbers(found.get("xyz", "0 0 0"))
    return matrix


def chain(robot, joint_position):
    """Return the pose of each link in the base, following the tree from its root."""
    angles = dict(zip(JOINTS, joint_position))
    joints = {joint.find("parent").get("link"): joint for joint in robot.iter("joint")}
    link, frame, frames = "base_link", np.eye(4), {"base_link": np.eye(4)}
    while link in joints:
        joint = joints[link]
        frame = frame @ origin(joint)
        if joint.get("type") == "revolute":
            assert numbers(joint.find("axis").get("xyz")) == [0.0, 0.0, 1.0]
            angle = angles[joint.get("name")]
            spin = np.eye(4)
            spin[0, 0] = spin[1, 1] = math.cos(angle)
            spin[0, 1], spin[1, 0] = -math.sin(angle), math.sin(angle)
            frame = frame @ spin
        link = joint.find("child").get("link")
        frames[link] = frame
    return frames


@pytest.mark.parametrize("name", model_names())
def test_the_flange_of_the_urdf_is_ours(name):
    model, rng = load_model(name), random.Random(4)
    robot = ElementTree.fromstring(urdf_from_model(model))
    for _ in range(10):
        joints = dh_oracle.random_joints(model, rng)
        frames = chain(robot, joints)
        assert list(frames) == LINKS
        assert dh_oracle.error(frames["tool0"], dh_oracle.flange(model, joints)) < 1e-12
        for link, expected in zip(LINKS[1:7], dh_oracle.matrices(model, joints)):
            # axis n of the arm is z of DH frame n-1
            assert frames[link][:3, 2] == pytest.approx(expected[:3, 2], abs=1e-12)
            assert frames[link][:3, 3] == pytest.approx(expected[:3, 3], abs=1e-12)


def test_a_calibrated_arms_flange_too():
    rows = tuple(DhRow(row.a + 1e-4, row.d - 2e-4, row.alpha + 1e-3, row.theta_offset - 2e-3)
                 for row in load_model("minicobo").dh)
    nominal = load_model("minicobo")
    model = ArmModel(name="mine", family=nominal.family, dh=rows, joint_limits=nominal.joint_limits,
                     joint_max_speed=nominal.joint_max_speed)
    joints = (0.1, 0.2, -0.3, 0.4, 0.5, -0.6)
    frames = chain(ElementTree.fromstring(urdf_from_model(model)), joints)
    assert dh_oracle.error(frames["tool0"], dh_oracle.flange(model, joints)) < 1e-12


def test_joints_carry_the_range_and_the_speeds_of_streams():
    for name in model_names():
        model = load_model(name)
        robot = ElementTree.fromstring(urdf_from_model(model))
        joints = [joint for joint in robot.iter("joint") if joint.get("type") == "revolute"]
        assert tuple(joint.get("name") for joint in joints) == JOINTS
        for joint, (low, high), speed in zip(joints, stream_limits(model), top_joint_speeds(model)):
            limit = joint.find("limit")
            assert (float(limit.get("lower")), float(limit.get("upper"))) == (low, high)
            assert float(limit.get("velocity")) == speed <= math.pi


def test_a_prefix_stands_before_every_link_and_joint():
    robot = ElementTree.fromstring(urdf_from_model(load_model("zu7"), prefix="left_"))
    names = [element.get("name") for kind in ("link", "joint") for element in robot.findall(kind)]
    assert len(names) == len(set(names)) == 15 and all(name.startswith("left_") for name in names)
    linked = {element.get("link") for kind in ("parent", "child") for element in robot.iter(kind)}
    assert linked == {link.get("name") for link in robot.findall("link")}


def test_links_may_be_named_and_odd_names_stay_xml():
    robot = ElementTree.fromstring(urdf_from_model(load_model("zu7"), '<"&>', "pedestal", "gripper"))
    assert [link.get("name") for link in robot.findall("link")] == [
        '<"&>' + link for link in ["pedestal"] + LINKS[1:7] + ["gripper"]]


def test_every_visual_has_a_size_and_a_known_colour():
    for name in model_names():
        robot = ElementTree.fromstring(urdf_from_model(load_model(name)))
        colours = {material.get("name") for material in robot.findall("material")}
        for link in robot.findall("link"):
            assert link.findall("visual")
        for visual in robot.iter("visual"):
            assert visual.find("material").get("name") in colours
            shape = visual.find("geometry")[0]
            sizes = numbers(shape.get("size")) if shape.tag == "box" else [
                float(shape.get("radius")), float(shape.get("length"))]
            assert all(0.0 < size < 2.0 for size in sizes)
        assert robot.find(".//mesh") is None


@pytest.mark.parametrize("link, is_above", [("base_link", True), ("tool0", False)])
def test_base_and_flange_are_flat_discs_on_their_frames(link, is_above):
    # The base stands on its frame, the flange ends at its own: there the tool is fixed.
    robot = ElementTree.fromstring(urdf_from_model(load_model("zu7")))
    visual, = next(one for one in robot.findall("link") if one.get("name") == link).findall("visual")
    cylinder = visual.find("geometry/cylinder")
    height, radius = float(cylinder.get("length")), float(cylinder.get("radius"))
    x, y, z = numbers(visual.find("origin").get("xyz"))
    assert (x, y, z) == pytest.approx((0.0, 0.0, 0.5 * height if is_above else -0.5 * height))
    assert 0.0 < height < radius < 0.2
    sizes = [float(one.get("radius")) for one in robot.iter("cylinder")]
    assert radius == pytest.approx(max(sizes) if is_above else 0.5 * max(sizes)), "the base is the widest"


def cylinders(robot, link):
    """Return (radius, bottom, top) of each cylinder of a link, m, in the frame of the link."""
    found = []
    for visual in robot.find("link[@name='%s']" % link).iter("visual"):
        cylinder = visual.find("geometry/cylinder")
        if cylinder is not None:
            middle, half = numbers(visual.find("origin").get("xyz"))[2], 0.5 * float(cylinder.get("length"))
            found.append((float(cylinder.get("radius")), middle - half, middle + half))
    return found


@pytest.mark.parametrize("name", ["zu3", "zu7", "minicobo", "a12"])
def test_the_arm_stands_on_a_foot_wider_than_itself_and_ends_in_a_flat_flange(name):
    robot = ElementTree.fromstring(urdf_from_model(load_model(name)))
    radius = cylinders(robot, "link_1")[0][0]
    (foot, bottom, top), = cylinders(robot, "base_link")
    assert radius < foot < 2.0 * radius and bottom == pytest.approx(0.0, abs=1e-12) and 0.0 < top < radius
    (flange, bottom, top), = cylinders(robot, "tool0")
    assert 0.0 < flange < radius and top == pytest.approx(0.0, abs=1e-12) and -0.3 * radius < bottom < 0.0
