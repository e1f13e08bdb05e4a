"""The page docs/moveit.md: its files name what the driver has; they are not run, as MoveIt is nowhere to be had."""
from xml.etree import ElementTree

import import_graph
import yaml
from page_commands import blocks

from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.urdf import urdf_from_model
from jaka_ros_driver.ros.params import config_from

PAGE = import_graph.ROOT / "docs" / "moveit.md"
START = "$(find jaka_ros_driver)/launch/robot_start_launch.launch"
NODE = "/jaka_driver/"


def block(language):
    """Return the first block of a language."""
    return next(one.text for one in blocks(PAGE) if one.language == language)


def test_the_controllers_are_those_of_the_driver():
    (controller,) = yaml.safe_load(block("yaml"))["controller_list"]
    assert controller["name"] == config_from({"model": "zu7"}).trajectory_controller_name
    assert controller["action_ns"] == "follow_joint_trajectory" and controller["type"] == "FollowJointTrajectory"
    assert controller["joints"] == list(JOINTS)


def test_the_gripper_s_entry_is_that_of_its_example():
    (entry,) = yaml.safe_load(next(one.text for one in blocks(PAGE) if "gripper_cmd" in one.text))
    described = yaml.safe_load((import_graph.ROOT / "docs" / "examples" / "gripper.yaml").read_text(encoding="utf-8"))
    gripper = config_from(described).gripper
    assert (entry["name"], entry["joints"]) == (gripper.controller, [gripper.joint])
    assert (entry["action_ns"], entry["type"]) == ("gripper_cmd", "GripperCommand")


def test_the_launch_file_sets_what_the_driver_and_its_launch_file_know():
    launch = ElementTree.fromstring(block("xml"))
    kinds = {"bool": lambda text: text == "true", None: str}
    config_from({param.get("name")[len(NODE):]: kinds[param.get("type")](param.get("value"))
                 for param in launch.findall("param") if param.get("name").startswith(NODE)})
    ours = next(one for one in launch.findall("include") if one.get("file") == START)
    known = {one.get("name") for one in ElementTree.parse(str(
        import_graph.ROOT / "launch" / "robot_start_launch.launch")).findall("arg")}
    assert {one.get("name") for one in ours.findall("arg")} <= known


def test_the_urdf_is_as_the_page_says():
    urdf = ElementTree.fromstring(urdf_from_model(load_model("zu7")))
    assert [link.get("name") for link in urdf.findall("link")] == [
        "base_link", *("link_%d" % n for n in range(1, 7)), "tool0"]
    assert urdf.find(".//collision") is None and urdf.find(".//mesh") is None
