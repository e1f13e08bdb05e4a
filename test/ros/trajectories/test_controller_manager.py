"""The names of ros_control's controller manager and query_state, used as the programs use them that look for them.

rqt_joint_trajectory_controller and moveit_ros_control_interface are packaged nowhere for Debian. Their steps are from
their sources: ros-controls/ros_controllers, rqt_joint_trajectory_controller/src/rqt_joint_trajectory_controller/
joint_trajectory_controller.py and joint_limits_urdf.py, with ros-controls/ros_control, controller_manager_msgs/src/
controller_manager_msgs/utils.py; moveit/moveit, moveit_plugins/moveit_ros_control_interface/src/
controller_manager_plugin.cpp. Commits: bbd6f96, 4508d87, 5dbe67e, ee42c7c.
"""
import ast
import contextlib
import math
import os
import socket
import subprocess
import sys
import time
import types
from xml.dom import minidom

import pytest
import rosgraph
import rospy
import rosservice
from action_bench import CONTROLLER, NAMES, START, Client, goal_of, point, smooth
from driver_bench import Arm, DriverProcess, SimulatorProcess, on
from import_graph import ROOT
from page_commands import blocks
from trajectory_msgs.msg import JointTrajectory
from waiting import WAIT, eventually

from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.ros.other_messages import made_service, message_type, old_switch_type
from jaka_ros_driver.ros.params import config_from
from jaka_ros_driver.ros.start_checks import server_of
from jaka_ros_driver.ros.trajectories import controller_manager
from jaka_ros_driver.ros.trajectories.controller_manager import CONTROLLER_TYPE, ControllerManager, OneController
from jaka_ros_driver.ros.trajectories.query import StateQuery

BEST_EFFORT, STRICT = 1, 2
MANAGER = "/controller_manager"
NAME = CONTROLLER[1:]
REST = (0.0,) * 6
KINDS = {"list_controllers": "ListControllers", "list_controller_types": "ListControllerTypes",
         "load_controller": "LoadController", "unload_controller": "UnloadController",
         "switch_controller": "SwitchController", "reload_controller_libraries": "ReloadControllerLibraries"}


# ---- the answers, without a running driver ----

@pytest.mark.parametrize("start, stop, strictness, says", [
    (["arm"], [], STRICT, ""), ([], [], STRICT, ""), (["arm"], ["arm"], STRICT, ""), (["other"], [], BEST_EFFORT, ""),
    (["arm", "other"], [], BEST_EFFORT, ""), ([], ["other"], BEST_EFFORT, ""), ([], ["other"], 0, ""),
    (["other"], [], STRICT, "no controller is named 'other'"), ([], ["arm", "other"], STRICT, "is named 'other'"),
    ([], ["arm"], STRICT, "cannot be stopped"), (["other"], ["arm"], BEST_EFFORT, "cannot be stopped")])
def test_the_one_controller_can_be_started_and_not_stopped(start, stop, strictness, says):
    refusal = OneController("arm", lambda: False).switch(start, stop, strictness)
    assert (says in refusal) if says else refusal == ""


def test_a_controller_that_follows_a_trajectory_is_not_restarted():
    assert "follows a trajectory" in OneController("arm", lambda: True).switch(["arm"], ["arm"], STRICT)


def test_nothing_is_loaded_and_nothing_unloaded():
    one = OneController("arm", lambda: False)
    assert "loaded already" in one.load("arm") and "has one controller" in one.load("gripper")
    assert "it is running" in one.unload("arm") and "no controller is named" in one.unload("gripper")
    assert "part of the driver" in one.reload()


@pytest.mark.parametrize("there, is_told", [(None, False), (CONTROLLER_TYPE, False), ("another/Type", True)])
def test_parameters_that_are_there_are_left_and_told_only_where_they_differ(there, is_told, monkeypatch, caplog):
    kept = {"/c/type": there, "/c/joints": None}
    monkeypatch.setattr(rospy, "get_param", lambda name, default: kept[name])
    monkeypatch.setattr(rospy, "set_param", lambda name, value: kept.update({name: value}))
    manager = ControllerManager.__new__(ControllerManager)
    manager._services, manager._controller, manager._joints = [object()], "/c", ["joint_1"]
    manager.set_parameters()
    assert kept == {"/c/type": there or CONTROLLER_TYPE, "/c/joints": ["joint_1"]}
    assert len(caplog.records) == is_told


@pytest.mark.parametrize("mode, at_once, later", [("true", 1, 1), ("auto", 0, 1), ("false", 0, 0)])
def test_the_services_come_later_where_nobody_has_asked_for_them_and_once(monkeypatch, mode, at_once, later):
    manager = ControllerManager.__new__(ControllerManager)
    manager._mode, manager._offer_at, offered, now = mode, None, [], [100.0]
    monkeypatch.setattr(manager, "_offer", lambda: offered.append(now[0]), raising=False)
    monkeypatch.setattr(controller_manager, "time", types.SimpleNamespace(monotonic=lambda: now[0]))
    manager.offer()
    for now[0] in (100.0, 109.9):
        manager.offer_late()
        assert len(offered) == at_once
    for now[0] in (110.0, 130.0):
        manager.offer_late()
        assert len(offered) == later


class Held:
    """An arm that holds its position, or is moved by something."""

    def __init__(self, owner=None, foreign=""):
        self.motion_owner, self.foreign_motion = owner, foreign

    def desired_at(self, at):
        return None

    def fresh_state(self):
        return self.state(20.0, (0.2,) * 6)

    @staticmethod
    def state(at, joints):
        return types.SimpleNamespace(received_at=at, joint_position_commanded=joints, joint_position=(9.0,) * 6)


def queried(arm):
    query = StateQuery(arm, config_from({"frame_prefix": "left_"}))
    for at, joints in ((1.0, (0.1,) * 6), (10.0, (0.2,) * 6), (20.0, (0.20005,) * 6)):
        query._held.observe(arm.state(at, joints))
    return query


def test_without_a_trajectory_the_held_position_is_wanted_from_when_it_was_reached_on():
    query = queried(Held())
    for at in (10.0, 19.0, 1e6):
        assert query.desired_at(at) == ((0.2,) * 6, REST, REST)
    with pytest.raises(InvalidCommand, match=r"held its position only since 1\.000 s after that time"):
        query.desired_at(9.0)


@pytest.mark.parametrize("arm", [Held(owner=MotionOwner.JOG), Held(foreign="the pendant moves it")])
def test_of_an_arm_that_is_moved_otherwise_nothing_is_said(arm):
    with pytest.raises(InvalidCommand, match="something else has the arm: "):
        queried(arm).desired_at(20.0)


@pytest.mark.parametrize("answer, served", [
    (rosgraph.MasterError("unknown"), False), (OSError("no master"), True), ("listening", True), ("closed", False)])
def test_a_name_is_served_where_somebody_listens(monkeypatch, answer, served):
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        uri = "rosrpc://127.0.0.1:%d" % server.getsockname()[1]
        if answer == "listening":
            server.listen()

        def look_up(service):
            if isinstance(answer, Exception):
                raise answer
            return uri
        monkeypatch.setattr(rosgraph, "Master", lambda name: types.SimpleNamespace(lookupService=look_up))
        monkeypatch.setattr(rospy, "get_name", lambda: "/jaka_driver")
        assert bool(server_of("/controller_manager/list_controllers")) is served


# ---- as the programs do it ----

@pytest.fixture(scope="module")
def cell(ros_node, driven_by):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator:
        with driven_by(simulator, "controller_manager:=true") as arm:
            arm.wait_until_ready()
            rospy.wait_for_service(MANAGER + "/reload_controller_libraries", WAIT)
            assert eventually(lambda: rospy.get_param(CONTROLLER + "/joints", None))
            yield arm


@pytest.fixture
def arm(cell):
    assert eventually(lambda: cell.call("joint_move", pose=START, mvvelo=3.0, mvacc=12.0).ret == 1)
    return cell


def ask(service, **fields):
    return rospy.ServiceProxy("%s/%s" % (MANAGER, service), made_service(
        "controller_manager_msgs/" + KINDS[service]))(**fields)


def limits_of_urdf(text):
    """Return (lower, upper, velocity) of each movable joint, as rqt's joint_limits_urdf reads them."""
    found = {}
    for joint in minidom.parseString(text).getElementsByTagName("joint"):
        if joint.getAttribute("type") != "fixed":
            limit = joint.getElementsByTagName("limit")[0]
            found[joint.getAttribute("name")] = tuple(float(limit.getAttribute(key))
                                                      for key in ("lower", "upper", "velocity"))
    return found


def test_what_rqt_joint_trajectory_controller_does(arm):
    managers = [name[:-len("/list_controllers")] for name in rosservice.get_service_list()
                if name.endswith("/list_controllers")]
    assert managers == [MANAGER]
    for service, kind in KINDS.items():
        assert rosservice.get_service_type("%s/%s" % (MANAGER, service)) == "controller_manager_msgs/" + kind
    (controller,) = [one for one in ask("list_controllers").controller
                     if "JointTrajectoryController" in one.type and one.state == "running"]
    joints = controller.claimed_resources[0].resources
    limits = limits_of_urdf(rospy.get_param("robot_description"))
    assert joints == NAMES and set(joints) <= set(limits)
    namespace = MANAGER.rsplit("/", 1)[0] + "/" + controller.name
    assert namespace == CONTROLLER
    states, commands = [], rospy.Publisher(namespace + "/command", JointTrajectory, queue_size=1)
    reader = rospy.Subscriber(namespace + "/state", message_type("control_msgs/JointTrajectoryControllerState"),
                              states.append, queue_size=1)
    try:
        assert eventually(lambda: states and commands.get_num_connections())
        at = dict(zip(states[-1].joint_names, states[-1].actual.positions))
        command = {**at, "joint_1": at["joint_1"] + 0.2}
        speed_scale = 0.5
        duration = max(max(abs(command[name] - at[name]) / limits[name][2], 0.5) for name in joints) / speed_scale
        commands.publish(JointTrajectory(joint_names=joints, points=[point(duration, [command[n] for n in joints])]))
        assert eventually(lambda: math.isclose(states[-1].actual.positions[0], command["joint_1"], abs_tol=1e-3))
    finally:
        reader.unregister()
        commands.unregister()


def test_what_moveit_ros_control_interface_does(arm):
    (controller,) = ask("list_controllers").controller
    assert controller.state == "running" and controller.type == CONTROLLER_TYPE
    assert [name for one in controller.claimed_resources for name in one.resources] == NAMES
    assert ask("switch_controller", start_controllers=[controller.name], strictness=STRICT).ok
    assert ask("switch_controller", start_controllers=[controller.name], stop_controllers=[controller.name],
               strictness=STRICT).ok, "what it sends where it takes the controller for another one"
    with contextlib.closing(Client("/" + controller.name + "/follow_joint_trajectory")) as client:
        assert client.run(goal_of(smooth(0.2, 1.0, 0.1)))[0] == "SUCCEEDED"


def test_what_ros_control_scripts_ask_for_is_refused_where_there_is_nothing_to_be_done(arm):
    types_known = ask("list_controller_types")
    assert types_known.types == [CONTROLLER_TYPE] == [rospy.get_param(CONTROLLER + "/type")]
    assert rospy.get_param(CONTROLLER + "/joints") == NAMES
    assert not ask("load_controller", name=NAME).ok and not ask("unload_controller", name=NAME).ok
    assert not ask("reload_controller_libraries", force_kill=True).ok
    assert not ask("switch_controller", stop_controllers=[NAME], strictness=BEST_EFFORT).ok
    old = rospy.ServiceProxy(MANAGER + "/switch_controller", old_switch_type())
    assert old(start_controllers=[NAME], strictness=STRICT).ok
    assert not old(stop_controllers=[NAME], strictness=STRICT).ok


def test_query_state_foretells_where_the_arm_will_be_and_refuses_what_it_does_not_know(arm):
    query = rospy.ServiceProxy(CONTROLLER + "/query_state", made_service("control_msgs/QueryTrajectoryState"))

    def after(seconds):
        """Return the state so much later than now, None where that is refused, as while a trajectory begins."""
        with contextlib.suppress(rospy.ServiceException):
            return query(rospy.Time.now() + rospy.Duration.from_sec(seconds))
    assert eventually(lambda: after(3600.0))
    held = after(3600.0)
    assert held.name == NAMES and held.position == pytest.approx(START, abs=1e-4) and held.velocity == REST
    with contextlib.closing(Client()) as client:
        client.send(goal_of(smooth(0.6, 4.0, 0.1)))
        assert eventually(lambda: getattr(after(0.0), "velocity", REST)[0] > 0.05)
        now, soon, end = after(0.0), after(0.5), after(60.0)
        assert START[0] < now.position[0] < soon.position[0] < end.position[0] == pytest.approx(0.6)
        assert end.velocity == REST and soon.velocity[0] > 0.0
        with pytest.raises(rospy.ServiceException, match="before the running trajectory was begun"):
            query(rospy.Time.now() - rospy.Duration(30))
        arm.call("stop_move")
    assert eventually(lambda: after(1.0))
    with pytest.raises(rospy.ServiceException, match="held its position only since"):
        query(rospy.Time(1))


def test_the_programs_of_the_page_run_as_they_stand(arm):
    asking, listing = [block.text for block in blocks(ROOT / "docs" / "trajectories.md") if block.language == "python"]
    for text, printed in ((asking, pytest.approx(START, abs=1e-4)), (listing, [(NAME, "running")])):
        done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=WAIT,
                              env=dict(os.environ, PYTHONPATH=os.pathsep.join([str(ROOT), *sys.path])))
        assert done.returncode == 0, done.stderr
        assert ast.literal_eval(done.stdout) == printed


def test_unless_it_is_asked_for_it_comes_when_a_real_one_would_be_there(ros_node):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator:
        with DriverProcess("later", remappings=["__ns:=later"], publish_description=False, auto_enable=False,
                           **on(simulator, guard=False)):
            begun = time.monotonic()
            rospy.wait_for_service("/later/jaka_zu7_controller/query_state", WAIT)
            rospy.wait_for_service("/later/controller_manager/list_controllers", WAIT)
            assert time.monotonic() - begun > 5.0
            assert eventually(lambda: rospy.get_param("/later/jaka_zu7_controller/type", None) == CONTROLLER_TYPE)


def test_a_controller_manager_that_is_there_is_left_alone(arm):
    before = rosgraph.Master("/jaka_tests").lookupService(MANAGER + "/list_controllers")
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator:
        second = DriverProcess("second", trajectory_controller="gripper_side", controller_manager=True,
                               publish_description=False, auto_enable=False, **on(simulator, guard=False))
        with second:
            Arm(simulator, "/second").wait_until_seen()
            rospy.wait_for_service("/gripper_side/query_state", WAIT)
        assert "/controller_manager/list_controllers is served by %s already" % before in second.wait()[1]
    assert rosgraph.Master("/jaka_tests").lookupService(MANAGER + "/list_controllers") == before
    assert [one.name for one in ask("list_controllers").controller] == [NAME]
    assert rospy.get_param("/gripper_side/type", None) is None
