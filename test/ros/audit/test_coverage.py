"""The coverage of the audit log: every request that a node can make is recorded, or listed with the reason.

The driver names in its log what it records; the ROS master knows what the node really offers. A service, an action or
a topic that is added beside both fails here.
"""
import re
import sys

import pytest
import rosgraph
import rospy
from action_bench import CONTROLLER
from audit_reading import those_of
from driver_bench import DriverProcess, SimulatorProcess, on
from import_graph import ROOT
from waiting import WAIT, eventually

from jaka_ros_driver.ros.audit.recorder import NOT_RECORDED, STREAMED, URGENT
from jaka_ros_driver.ros.services.table import SERVICES

PLANTED = """
import sys, rospy
from std_msgs.msg import Float64
from std_srvs.srv import Trigger, TriggerResponse
from jaka_ros_driver.ros import node
from jaka_ros_driver.ros.services import table as service_table

begin = node.DriverNode.start

def start(driver):
    rospy.Service("~planted", Trigger, lambda request: TriggerResponse(True, "moved"))
    rospy.Subscriber("~planted_command", Float64, lambda message: None)
    begin(driver)

node.DriverNode.start = start
(recover,) = [spec for spec in service_table.SERVICES if spec.name == "recover"]
service_table.SERVICES += (recover._replace(name="planted_in_the_table"),)
sys.exit(node.main(sys.argv[1:]))
"""


def taken_by(node):
    """Return names of the services that a node offers and of the topics that it reads, as the master knows them."""
    _, subscribers, services = rosgraph.Master("/jaka_tests").getSystemState()
    return {name for name, nodes in services + subscribers if node in nodes}


def resolved(name, node):
    name = name.replace("NAME/", CONTROLLER + "/")
    return node + "/" + name[1:] if name.startswith("~") else name if name.startswith("/") else "/" + name


def unrecorded(node, folder):
    """Return what a node takes that its driver neither records nor is listed for."""
    known = {resolved(name, node) for name in NOT_RECORDED}
    for entry in those_of(folder, "recorded")[-1]["names"]:
        kind, name = entry.split(" ")
        known |= {resolved(name, node) + end for end in (("/goal", "/cancel") if kind == "action" else ("",))}
    return taken_by(node) - known


@pytest.fixture(scope="module")
def simulator():
    process = SimulatorProcess("--start", "enabled")
    yield process
    process.close()


def wait_until_all_is_offered(node, folder):
    assert eventually(lambda: (folder / "127.0.0.1").parent.exists() and those_of(folder, "recorded"), WAIT)
    assert eventually(lambda: {node + "/stop_move", node + "/recover/goal"} <= taken_by(node), WAIT)


def test_all_that_a_driver_takes_is_recorded_or_listed_with_the_reason(ros_node, simulator, tmp_path):
    gripper = {"joint": "finger", "open_position": 0.1, "closed_position": 0, "stroke_time": 1, "open_output": 0}
    with DriverProcess("covered", audit_dir=str(tmp_path), industrial_names=True, controller_manager=True,
                       gripper=gripper, **on(simulator, guard=False)):
        wait_until_all_is_offered("/covered", tmp_path)
        taken = taken_by("/covered")
        assert unrecorded("/covered", tmp_path) == set()
    assert {"/stop_motion", "/joint_path_command", "/joint_trajectory_action/goal", "/covered/jog_twist",
            "/covered/servo_p_command", "/covered/move_path/cancel", "/covered/power", CONTROLLER + "/query_state",
            "/controller_manager/list_controllers", "/controller_manager/switch_controller",
            "/jaka_gripper_controller/gripper_cmd/goal"} <= taken


def test_what_is_neither_is_found(ros_node, simulator, tmp_path, monkeypatch):
    script = tmp_path / "planted.py"
    script.write_text(PLANTED)
    monkeypatch.setattr("driver_bench.PROGRAM", [sys.executable, str(script)])
    folder = tmp_path / "audit"
    with DriverProcess("planted", audit_dir=str(folder), **on(simulator, guard=False)):
        wait_until_all_is_offered("/planted", folder)
        assert unrecorded("/planted", folder) == {"/planted/planted", "/planted/planted_command"}
        rospy.wait_for_service("/planted/planted_in_the_table", WAIT)
        assert "service ~planted_in_the_table" in those_of(folder, "recorded")[-1]["names"], "without another word"


def test_the_lists_name_what_there_is_and_each_has_its_reason():
    names = {"~" + spec.name for spec in SERVICES}
    assert {name for name in NOT_RECORDED if name[0] == "~" and NOT_RECORDED[name].split()[0] != "rospy's"} <= names
    assert all(len(reason) > 10 for reason in NOT_RECORDED.values())
    assert URGENT | STREAMED <= names and not (URGENT | STREAMED) & set(NOT_RECORDED)


def test_the_page_names_every_service_and_whether_it_is_recorded():
    text = (ROOT / "docs" / "audit.md").read_text(encoding="utf-8")
    table = re.search(r"<!-- recorded -->\n(.*?)<!-- end -->", text, re.DOTALL).group(1)
    left_out = re.search(r"<!-- not recorded -->\n(.*?)<!-- end -->", text, re.DOTALL).group(1)
    recorded = set(re.findall(r"`(~[\w/]+)`", table))
    for spec in SERVICES:
        name = "~" + spec.name
        assert (name in recorded) is (name not in NOT_RECORDED), name
        assert (name in set(re.findall(r"`(~[\w/]+)`", left_out))) is (name in NOT_RECORDED), name
