"""The gripper of docs/examples/gripper.yaml on a running driver: goals as MoveIt sends them, outputs, inputs, joint."""
import contextlib
import math
import subprocess
import time

import pytest
import rosgraph
import rospy
from action_bench import Client
from audit_reading import those_of
from driver_bench import Arm, DriverProcess, SimulatorProcess, collecting, on
from import_graph import ROOT
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import WAIT, InBackground, eventually

from jaka_bag.driver_interface import INPUT_TOPICS
from jaka_ros_driver.ros.other_messages import made_type, message_type

NAME = "gripping"
ACTION = "/jaka_gripper_controller/gripper_cmd"
KIND = message_type("control_msgs/GripperCommandAction")
GOAL = type(KIND().action_goal.goal)
OPEN, CLOSED, GRIPPED = (1, 0, 0), (0, 1, 0), (0, 0, 1)
ON_ITS_WAY = (0, 0, 0)


class MoveItHandle(Client):
    """A sender of goals as moveit_simple_controller_manager does, by its gripper_controller_handle.h.

    The goal is the last point's position of the joint that ``joints`` of controllers.yaml names, and its effort where
    it has one; the execution has succeeded where the goal's state is SUCCEEDED. No field of the result is read.
    """

    def __init__(self):
        super().__init__(ACTION, KIND)

    def execute(self, trajectory, joint="finger_joint"):
        index, last = trajectory.joint_names.index(joint), trajectory.points[-1]
        goal = GOAL()
        goal.command.position = last.positions[index]
        goal.command.max_effort = last.effort[index] if len(last.effort) > index else 0.0
        state, result = self.run(goal)
        return state == "SUCCEEDED", result


def goal_to(position, effort=0.0):
    goal = GOAL()
    goal.command.position, goal.command.max_effort = position, effort
    return goal


class Gripper:
    """The gripper as the operator port of the simulated controller plays it."""

    def __init__(self, arm):
        self._arm = arm

    def show(self, inputs):
        for index, value in enumerate(inputs):
            self._arm.simulator.operate("set_input", bank="tool", index=index, value=value)

    def valves(self):
        """Return (open, close) as the controller has its outputs."""
        return tuple(int(self._arm.call("get_io", signal="digital", path=1, type=1, index=index).value)
                     for index in (0, 1))


@pytest.fixture(scope="module")
def audit(tmp_path_factory):
    return tmp_path_factory.mktemp("audit")


@pytest.fixture(scope="module")
def arm(ros_node, audit):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator:
        subprocess.run(["rosparam", "load",
                        str(ROOT / "docs" / "examples" / "gripper.yaml"), "/" + NAME], check=True, timeout=WAIT)
        with DriverProcess(NAME, audit_dir=str(audit), **on(simulator, guard=False)):
            running = Arm(simulator, "/" + NAME)
            running.wait_until_ready()
            yield running
        rospy.delete_param("/%s/gripper" % NAME)


@pytest.fixture
def gripper(arm):
    return Gripper(arm)


@pytest.fixture(scope="module")
def client(arm):
    with contextlib.closing(Client(ACTION, KIND)) as made:
        yield made


def begin(client, gripper, position, valves):
    """Send a goal; return its handle when the outputs are as it asks."""
    handle = client.send(goal_to(position))
    assert eventually(lambda: gripper.valves() == valves)
    return handle


def test_the_list_of_inputs_has_the_goals_of_a_gripper(arm):
    _, subscribers, _ = rosgraph.Master("/tests").getSystemState()
    taken = {topic for topic, nodes in subscribers if "/" + NAME in nodes}
    assert ACTION + "/goal" in taken
    assert {topic for topic in taken if not topic.endswith(tuple("/" + name for name in INPUT_TOPICS))} == set()
    assert INPUT_TOPICS["gripper_cmd/goal"] == "control_msgs/GripperCommandActionGoal"


def test_a_plan_of_moveit_opens_and_closes_it_and_the_joint_follows_the_inputs(arm, gripper):
    with collecting("/joint_states", JointState) as received, contextlib.closing(MoveItHandle()) as moveit:
        def positions():
            return [message.position[0] for _, message in list(received) if message.name == ["finger_joint"]]

        assert eventually(lambda: len(received) > 50)
        assert positions() == [], "no input is on: nothing is known"
        for position, valves, inputs in ((0.08, (1, 0), OPEN), (0.0, (0, 1), CLOSED)):
            plan = JointTrajectory(joint_names=["finger_joint"], points=[
                JointTrajectoryPoint(positions=[0.04]), JointTrajectoryPoint(positions=[position])])
            execution = InBackground(lambda plan=plan: moveit.execute(plan))
            assert eventually(lambda valves=valves: gripper.valves() == valves)
            gripper.show(ON_ITS_WAY)
            gripper.show(inputs)
            execution.wait()
            is_success, result = execution.result
            assert is_success and (result.position, result.reached_goal, result.stalled) == (position, True, False)
            assert eventually(lambda position=position: positions() and positions()[-1] == position)
        gripper.show(ON_ITS_WAY)
        assert eventually(lambda: time.sleep(0.2) or rospy.get_time() - max(
            at for at, message in list(received) if message.name == ["finger_joint"]) > 0.5), "it is not told any more"
        assert {len(message.name) for _, message in received} == {1, 6}
        arms = sum(len(message.name) == 6 for _, message in received)
        assert arms > 4 * len(positions()), "the arm's own are as frequent as ever"


def test_a_work_piece_that_is_gripped_is_a_success(client, gripper):
    gripper.show(OPEN)
    handle = begin(client, gripper, 0.01, (0, 1))
    gripper.show(GRIPPED)
    state, result = client.end(handle)
    assert (state, result.position, result.stalled, result.reached_goal) == ("SUCCEEDED", 0.03, True, False)


@pytest.mark.parametrize("inputs, is_stalled", [(ON_ITS_WAY, True), (OPEN, False)])
def test_inputs_that_do_not_show_it_abort_the_goal(client, gripper, inputs, is_stalled):
    gripper.show(inputs)
    handle = client.send(goal_to(0.0))
    state, result = client.end(handle)
    assert state == "ABORTED" and result.stalled is is_stalled and not result.reached_goal
    assert math.isnan(result.position) and "not closed within 1 s: open_input is" in handle.get_goal_status_text()
    assert gripper.valves() == (0, 1), "nothing is taken back"


def test_what_is_refused_changes_no_output(client, gripper):
    before = gripper.valves()
    for goal in (goal_to(math.nan), goal_to(0.3), goal_to(0.08, math.inf)):
        handle = client.send(goal)
        state, _ = client.end(handle)
        assert state == "REJECTED" and "valid: 0" in handle.get_goal_status_text()
    assert gripper.valves() == before


def test_a_cancel_a_newer_goal_and_a_stop_leave_the_work_piece_where_it_is(arm, client, gripper):
    gripper.show(GRIPPED)
    first = begin(client, gripper, 0.08, (1, 0))
    second = begin(client, gripper, 0.0, (0, 1))
    assert client.end(first)[0] == "PREEMPTED" and "newer goal" in first.get_goal_status_text()
    assert client.end(second)[0] == "SUCCEEDED"
    gripper.show(ON_ITS_WAY)
    third = begin(client, gripper, 0.08, (1, 0))
    arm.call("stop_move")
    assert gripper.valves() == (1, 0)
    client.cancel(third)
    assert client.end(third)[0] == "PREEMPTED" and gripper.valves() == (1, 0)


def test_an_output_that_cannot_be_set_aborts_with_the_reason(arm, client, gripper):
    before = gripper.valves()
    arm.simulator.operate("refuse", port="command", duration_ms=1500)
    arm.simulator.operate("close", port="command")
    handle = client.send(goal_to(0.0))
    state, _ = client.end(handle)
    assert state == "ABORTED" and handle.get_goal_status_text()
    arm.wait_until_seen()
    assert gripper.valves() == before


def test_goals_and_results_are_in_the_audit_log(client, audit):
    name = ACTION[1:]
    assert eventually(lambda: any(line["what"] == name and line["ok"] for line in those_of(audit, "result")))
    assert any(line["what"] == name and "position" in str(line["arguments"]) for line in those_of(audit, "goal"))
    assert any(line["what"] == name for line in those_of(audit, "cancel"))


def test_a_wrong_parameter_is_refused_at_the_start(ros_node):
    code, said = DriverProcess("clumsy", gripper={"joint": "finger_joint", "stroke_time": 99}).wait()
    assert code == 2 and "stroke_time is 99; valid: a number, 0.01 to 60" in said
    assert made_type("control_msgs/GripperCommandAction")._md5sum == KIND._md5sum
