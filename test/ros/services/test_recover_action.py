"""~recover, action and service side by side, on the running node; requests are judged by the controller's log."""
import contextlib
import queue
import threading
from concurrent.futures import Future
from types import SimpleNamespace

import actionlib
import pytest
import rospy
import rosservice as rosservice_library
from actionlib_msgs.msg import GoalStatus
from driver_bench import SimulatorProcess, rosservice
from waiting import eventually

from jaka_msgs.msg import RecoverAction, RecoverActionFeedback, RecoverGoal
from jaka_ros_driver.client.core.procedures.recovery import RecoveryStep
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.services import recover_action

STEPS = ["clear error", "power", "enable"]


@pytest.fixture(scope="module")
def slow_arm(ros_node, driven_by):
    """Start a driver on a controller whose drives take their time; it does not power them by itself."""
    with contextlib.closing(SimulatorProcess("--power-delay", "1.0", "--enable-delay", "1.0")) as simulator:
        with driven_by(simulator, "auto_enable:=false") as arm:
            arm.wait_until_seen()
            yield arm


@pytest.fixture
def off(slow_arm):
    """Switch its drives off, with no fault left."""
    slow_arm.simulator.operate("clear_faults")
    slow_arm.simulator.operate("release_emergency_stop")
    assert eventually(lambda: not slow_arm.listen("robot_states", 1)[0].motion_state == 2)
    slow_arm.call("clear_err")
    assert slow_arm.call("power", data=False).success
    return slow_arm


class Client:
    """An action client that keeps the feedback of its goal, from the topic: actionlib's client may miss the first."""

    def __init__(self, arm):
        self._feedback = []
        name = arm.name + "/recover"
        self._client = actionlib.SimpleActionClient(name, RecoverAction)
        self._subscriber = rospy.Subscriber(name + "/feedback", RecoverActionFeedback, self._feedback.append)
        assert self._client.wait_for_server(rospy.Duration(60.0))
        assert eventually(lambda: self._subscriber.get_num_connections())

    @property
    def steps(self):
        """The steps, each once, in the order of the feedback."""
        mine = self._client.gh.comm_state_machine.action_goal.goal_id.id
        return list(dict.fromkeys(message.feedback.step for message in list(self._feedback)
                                  if message.status.goal_id.id == mine))

    def begin(self):
        self._client.send_goal(RecoverGoal())
        return self

    def cancel(self):
        self._client.cancel_goal()

    def end(self):
        """Wait for the end; return terminal state and result."""
        assert self._client.wait_for_result(rospy.Duration(60.0))
        return self._client.get_state(), self._client.get_result()


def pressed_and_released(arm):
    arm.simulator.operate("press_emergency_stop")
    assert eventually(lambda: arm.listen("robot_states", 1)[0].motion_state == 2)
    arm.simulator.operate("release_emergency_stop")
    assert eventually(lambda: arm.listen("robot_states", 1)[0].motion_state == 4)


def test_a_goal_brings_the_arm_back_and_tells_each_step(off):
    pressed_and_released(off)
    before = off.simulator.state()["joint_position"]
    client = Client(off).begin()
    state, result = client.end()
    assert (state, result.success) == (GoalStatus.SUCCEEDED, True)
    assert result.message == "the arm is ready: " + ", ".join(STEPS)
    assert eventually(lambda: client.steps == STEPS)
    after = off.simulator.state()
    assert after["is_enabled"] and after["errcode"] == "0x0" and after["joint_position"] == before
    again = Client(off).begin()
    assert again.end()[1].message == "the arm is ready: nothing was to be done" and again.steps == []


def test_the_service_of_the_same_name_takes_the_same_steps(off):
    assert rosservice_library.get_service_type(off.name + "/recover") == "std_srvs/Trigger"
    pressed_and_released(off)
    answer = rosservice(off.name + "/recover")
    assert answer == {"success": True, "message": "the arm is ready: " + ", ".join(STEPS)}
    assert off.simulator.state()["is_enabled"]


def test_it_is_refused_with_the_reason_while_the_emergency_stop_is_pressed(off):
    off.simulator.operate("press_emergency_stop")
    assert eventually(lambda: off.listen("robot_states", 1)[0].motion_state == 2)
    state, result = Client(off).begin().end()
    assert (state, result.success) == (GoalStatus.ABORTED, False)
    assert result.message == "refused to recover: the emergency stop is pressed; release it first"
    answer = off.call("recover")
    assert not answer.success and answer.message == result.message


@pytest.mark.parametrize("step", ["power", "enable"])
def test_cancelling_ends_it_as_preempted_and_nothing_more_is_sent(off, step):
    client = Client(off).begin()
    assert eventually(lambda: step in client.steps)
    client.cancel()
    state, result = client.end()
    assert (state, result.success) == (GoalStatus.PREEMPTED, False)
    assert result.message == "the recovery was cancelled at the step \"%s\"" % step
    assert eventually(lambda: off.simulator.state()["is_powered"])
    rospy.sleep(1.2)  # what must not come has no other sign
    assert off.simulator.state()["is_enabled"] is (step == "enable"), "what was sent is carried out, nothing more"


def test_a_second_goal_and_the_service_are_refused_while_one_is_under_way(off):
    first = Client(off).begin()
    assert eventually(lambda: "power" in first.steps)
    state, result = Client(off).begin().end()
    assert state == GoalStatus.ABORTED and result.message == "refused to recover: another recovery is running"
    assert off.call("recover").message == result.message
    assert first.end()[0] == GoalStatus.SUCCEEDED


def test_a_stop_ends_it(off):
    client = Client(off).begin()
    assert eventually(lambda: "power" in client.steps)
    off.call("stop_move")
    state, result = client.end()
    assert state == GoalStatus.ABORTED and "was ended at the step \"power\": a stop" in result.message
    rospy.sleep(1.2)  # what must not come has no other sign
    assert not off.simulator.state()["is_enabled"]


def test_cancelling_all_goals_without_their_names_ends_it(off):
    client = Client(off).begin()
    assert eventually(lambda: "power" in client.steps)
    client._client.cancel_all_goals()
    assert client.end()[0] == GoalStatus.PREEMPTED


def test_the_step_under_way_is_told_again_for_those_who_missed_its_beginning(off):
    client = Client(off).begin()
    assert client.end()[0] == GoalStatus.SUCCEEDED
    assert eventually(lambda: client.steps == ["power", "enable"])
    assert len(client._feedback) >= 6


def test_the_present_step_is_told_again_four_times_a_second_and_more(monkeypatch):
    waits, told = [], []

    def get(timeout=None):
        waits.append(timeout)
        if len(waits) == 5:
            return None
        if timeout is None:
            return RecoveryStep.POWER
        raise queue.Empty
    monkeypatch.setattr(recover_action, "SimpleQueue", lambda: SimpleNamespace(get=get, put=lambda step: None))
    done = Future()
    done.set_result("recovered")
    action = recover_action.RecoverAction(SimpleNamespace(begin=lambda work: done), Recorder(None))
    goal = SimpleNamespace(publish_feedback=lambda feedback: told.append(feedback.step))
    assert action._recover(goal, threading.Event()) == "recovered"
    assert told == [RecoveryStep.POWER.value] * 4 and max(waits[1:]) <= 0.25
