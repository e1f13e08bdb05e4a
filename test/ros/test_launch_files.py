"""The launch files: documented arguments, ip alone drives a real arm, the demo, the tree of frames for display."""
import xml.etree.ElementTree as ElementTree

import pytest
import roslaunch
import rospy
import tf2_ros
from arm_bench import eventually
from import_graph import ROOT
from ros_bench import Arm

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.ros.params import DriverConfig

FILES = sorted((ROOT / "launch").glob("*.launch"))
START = str(ROOT / "launch" / "robot_start_launch.launch")


def nodes(arguments):
    config = roslaunch.config.load_config_default([(START, arguments)], None, verbose=False)
    return {node.type: node for node in config.nodes}, {key: p.value for key, p in config.params.items()}


def test_the_launch_files_are_these():
    assert [path.name for path in FILES] == ["demo.launch", "display.launch", "robot_start_launch.launch",
                                             "two_arms.launch"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_argument_is_documented(path):
    arguments = ElementTree.parse(path).getroot().findall("arg")
    assert arguments and all(argument.get("doc", "").endswith((".", "others (docs/parameters.md).")) and
                             argument.get("default") is not None for argument in arguments)


def test_ip_alone_drives_a_real_arm():
    started, params = nodes(["ip:=10.5.5.100"])
    assert set(started) == {"jaka_driver"}
    assert params["/jaka_driver/ip"] == "10.5.5.100"
    assert (params["/jaka_driver/command_port"], params["/jaka_driver/status_port"]) == (10001, 10000)
    assert params["/jaka_driver/auto_enable"] is True


def test_without_ip_a_simulated_controller_is_started_on_the_ports_of_the_real_one():
    started, params = nodes([])
    assert set(started) == {"jaka_driver", "jaka_sim"}
    assert "--command-port 10001 --status-port 10000" in started["jaka_sim"].args


def test_what_the_launch_file_sets_is_what_the_driver_takes_and_has_its_defaults():
    _, params = nodes(["sim:=false"])
    given = {key.split("/")[-1]: value for key, value in params.items() if key.startswith("/jaka_driver/")}
    assert given == {name: getattr(DriverConfig(), name) for name in given}


def test_the_demo_runs(ros_node, launch, free_ports):
    command_port, status_port = free_ports(2)
    launch("demo.launch", "command_port:=%d" % command_port, "status_port:=%d" % status_port,
           "sim_args:=--power-delay 0.1 --enable-delay 0.1")
    arm = Arm(None)
    arm.wait_until_seen()
    assert eventually(lambda: arm.listen("robot_states", 1)[0].power_state == 1)
    assert eventually(lambda: arm.call("joint_move", pose=[0.1, 1.5, -1.5, 1.5, 1.5, 0.0], mvvelo=3.0, mvacc=12.0).ret)


def test_display_has_one_tree_from_base_to_tool_that_equals_ours(ros_node, launch, free_ports):
    command_port, status_port = free_ports(2)
    rospy.delete_param("/robot_description") if rospy.has_param("/robot_description") else None
    launch("display.launch", "rviz:=false", "model:=pro16", "command_port:=%d" % command_port,
           "status_port:=%d" % status_port)
    arm = Arm(None)
    arm.wait_until_seen()
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    try:
        assert eventually(lambda: buffer.can_transform("base_link", "tool", rospy.Time(0)))
        frames = buffer.all_frames_as_yaml()
        assert "link_1" in frames and "tool0" in frames
        seen = buffer.lookup_transform("base_link", "tool0", rospy.Time(0)).transform.translation
        joints = arm.listen("joint_position", 1)[0].position
        assert (seen.x, seen.y, seen.z) == pytest.approx(forward(load_model("pro16"), joints)[9:], abs=1e-5)
    finally:
        listener.unregister()
