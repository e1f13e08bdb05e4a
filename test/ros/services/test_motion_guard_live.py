"""The motion guard behind the services, with a real master: refusals with their texts, and a stream that stands."""
import contextlib
import math
import time
from xml.etree import ElementTree

import pytest
import rospy
import yaml
from driver_bench import HOME, SimulatorProcess
from waiting import eventually

from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, MotionGuard
from jaka_ros_driver.clearance.shape import arm_shape
from jaka_ros_driver.clearance.workspace import workspace_of, workspace_of_text
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.ros.other_messages import message_type

INTO_THE_BASE = [1.781, -0.866, -2.694, 0.38, 0.163, -3.141]
SPEED = {"mvvelo": 2.0, "mvacc": 8.0}
POST = {"name": "post", "foot": [0.2, -0.35, 0.0], "height": 1.0, "radius": 0.05}
NEEDLE = {"name": "needle", "start": [0.0, 0.0, 0.0], "end": [0.0, 0.0, 0.04], "radius": 0.015}
CELL = {"cylinders": [POST], "tool": [NEEDLE]}
GUARD = MotionGuard(load_model("zu7"), workspace_of(CELL))


@pytest.fixture(scope="module")
def guarded(ros_node, driven_by, tmp_path_factory):
    """Start a driver with a post beside the arm, and a tool."""
    file = tmp_path_factory.mktemp("workspace") / "post.yaml"
    file.write_text(yaml.safe_dump(CELL))
    rospy.set_param("/jaka_driver/workspace", str(file))
    try:
        with contextlib.closing(SimulatorProcess("--start", "enabled")) as process, driven_by(process) as arm:
            arm.wait_until_ready()
            yield arm
    finally:
        rospy.delete_param("/jaka_driver/workspace")


def joints(arm):
    return tuple(math.radians(angle) for angle in arm.simulator.state()["joint_position"])


def zones_shown(arm):
    """Return the namespaces of the markers of zones that a new listener is sent."""
    topic, kind = arm.name + "/workspace_markers", message_type("visualization_msgs/MarkerArray")
    markers = rospy.wait_for_message(topic, kind, 10.0).markers
    assert any(marker.ns == "arm" for marker in markers)
    return {marker.ns for marker in markers} - {"", "arm"}


def test_the_description_of_the_arm_carries_the_tool_of_the_file(guarded):
    links = ElementTree.fromstring(rospy.get_param("/robot_description")).findall("link")
    named = [[collision.get("name") for collision in link.findall("collision")] for link in links]
    assert [names for names in named if "needle" in names] == [
        [capsule.name for capsule in arm_shape(load_model("zu7")).capsules if capsule.frame == 6 for _ in range(3)]
        + 3 * ["needle"]]


def test_a_joint_move_into_the_base_is_refused_with_the_text_and_a_legal_one_goes(guarded):
    refused = guarded.call("joint_move", pose=INTO_THE_BASE, **SPEED)
    assert refused.ret != 1 and "of the way" in refused.message
    assert "from the base; at least 10 mm are kept" in refused.message
    assert not guarded.simulator.is_moving()
    legal = guarded.call("joint_move", pose=[0.2] + HOME[1:], **SPEED)
    assert legal.ret == 1, legal.message
    assert guarded.call("joint_move", pose=HOME, **SPEED).ret == 1


def test_a_move_into_a_zone_of_the_file_is_refused(guarded):
    refused = guarded.call("joint_move", pose=[-1.6] + HOME[1:], **SPEED)
    assert refused.ret != 1 and "from the cylinder 'post'" in refused.message


def test_zones_are_replaced_while_nothing_moves_and_the_next_move_keeps_the_new_ones(guarded):
    assert zones_shown(guarded) == {"cylinder post", "tool needle"}
    asked = guarded.call("set_workspace", yaml="")
    assert asked.ret == 1 and workspace_of_text(asked.yaml) == workspace_of(CELL)
    try:
        table = {"keep_out": [{"name": "table", "centre": [1.0, 0.0, 0.1], "size": [0.2, 1.0, 0.2]}]}
        replaced = guarded.call("set_workspace", yaml=yaml.safe_dump(table))
        assert replaced.ret == 1, replaced.message
        assert workspace_of_text(replaced.yaml) == workspace_of(table)
        assert eventually(lambda: zones_shown(guarded) == {"keep-out box table"})
        assert guarded.call("joint_move", pose=[-1.6] + HOME[1:], **SPEED).ret == 1, "the post is gone"
        assert guarded.call("servo_move_enable", enable=True).ret == 1
        refused = guarded.call("set_workspace", yaml="{}")
        assert refused.ret == 0 and "owns the arm's motion" in refused.message and refused.yaml == ""
        assert guarded.call("servo_move_enable", enable=False).ret == 1
        assert workspace_of_text(guarded.call("set_workspace", yaml="").yaml) == workspace_of(table)
        assert guarded.call("joint_move", pose=HOME, **SPEED).ret == 1
    finally:
        assert guarded.call("set_workspace", yaml=asked.yaml).ret == 1
    back = guarded.call("joint_move", pose=[-1.6] + HOME[1:], **SPEED)
    assert back.ret != 1 and "'post'" in back.message


def test_a_servo_stream_towards_the_zone_stands_before_it(guarded):
    assert guarded.call("servo_move_enable", enable=True).ret == 1
    target, reply = 0.0, None
    while reply is None or reply.ret == 1:
        target -= 0.004
        reply = guarded.call("servo_j", pose=[target] + HOME[1:])
        assert target > -1.6
        time.sleep(0.008)  # the pace of the client is the subject
    assert "refused: on the way to the servo target" in reply.message and "'post'" in reply.message
    assert eventually(lambda: not guarded.simulator.is_moving())
    assert DEFAULT_MARGIN - 1e-3 <= GUARD.nearest(joints(guarded)).distance <= 2.0 * DEFAULT_MARGIN
    assert guarded.call("servo_move_enable", enable=False).ret == 1
    assert guarded.call("joint_move", pose=HOME, **SPEED).ret == 1
