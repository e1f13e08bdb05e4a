"""The decisions on a gripper: what its parameter says, which goals it takes, what its inputs prove; without a node."""
import dataclasses
import math
import threading
from types import SimpleNamespace

import pytest
from actionlib_msgs.msg import GoalStatus
from waiting import eventually

from jaka_ros_driver.commands import SetDigitalOutput
from jaka_ros_driver.errors import CommandRejected, InvalidCommand
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.gripper import KEYS, Inputs, end_of_goal, gripper_from, position_of, read_inputs
from jaka_ros_driver.ros.other_messages import MD5, made_type
from jaka_ros_driver.ros.params import WrongParameter, config_from
from jaka_ros_driver.ros.services.gripper_action import GripperAction, GripperJoint
from jaka_ros_driver.state import IoBank, IoState, RobotState

LEAST = {"joint": "finger_joint", "open_position": 0.08, "closed_position": 0.0, "stroke_time": 0.5, "close_output": 0}
FULL = {**LEAST, "open_output": 1, "open_input": 0, "closed_input": 1, "gripped_input": 2, "gripped_position": 0.03,
        "input_bank": "cabinet", "timeout": 2.0}
BLIND, SEEING = gripper_from(LEAST), gripper_from(FULL)


# ---- the parameter ----

def test_what_is_left_out_has_its_default():
    assert BLIND.controller == "jaka_gripper_controller" and BLIND.threshold == pytest.approx(0.04)
    assert (BLIND.output_bank, BLIND.input_bank, BLIND.timeout) == (IoBank.TOOL, IoBank.TOOL, 2.5)
    assert not BLIND.has_inputs and SEEING.has_inputs and SEEING.input_bank is IoBank.CABINET
    assert config_from({}).gripper is None and config_from({"gripper": {}}).gripper is None
    assert config_from({"gripper": FULL}).gripper == SEEING


@pytest.mark.parametrize("changed, said", [
    ({"joint": None}, "joint is None; valid: a ROS name"), ({"joint": "a b"}, "joint is 'a b'"),
    ({"controller": "/x"}, "controller is '/x'"), ({"output_bank": "extension"}, "valid: cabinet or tool"),
    ({"close_output": -1}, "close_output is -1; valid: a whole number, 0 to 1023"),
    ({"close_output": True}, "close_output is True"), ({"open_output": 0}, "both 0; they must differ"),
    ({"closed_position": 0.08}, "both 0.08; they must differ"), ({"open_position": math.nan}, "open_position is nan"),
    ({"open_position": "wide"}, "a number, -10 to 10"), ({"threshold": 0.08}, "threshold is 0.08; valid: between"),
    ({"stroke_time": 0}, "stroke_time is 0; valid: a number, 0.01 to 60"), ({"timeout": 0.4}, "timeout is 0.4"),
    ({"open_input": 1, "closed_input": 1}, "two inputs"), ({"gripped_input": 1}, "need each other"),
    ({"gripped_position": 0.03}, "need each other"), ({"gripped_position": 0.3, "gripped_input": 1}, "0 to 0.08"),
    ({"closes_output": 1}, "unknown key closes_output; known: controller")])
def test_a_wrong_key_is_refused_by_its_name_value_and_range(changed, said):
    with pytest.raises(WrongParameter) as refusal:
        config_from({"gripper": {**LEAST, **changed}})
    assert "parameter ~gripper" in str(refusal.value) and said in str(refusal.value)


@pytest.mark.parametrize("missing", ["joint", "open_position", "closed_position", "stroke_time", "close_output"])
def test_what_must_be_given_is_asked_for(missing):
    with pytest.raises(ValueError, match="%s is missing" % missing):
        gripper_from({name: value for name, value in LEAST.items() if name != missing})


def test_every_key_is_known_and_taken():
    assert set(FULL) | {"controller", "output_bank", "threshold"} == set(KEYS)


# ---- which goal is which ----

@pytest.mark.parametrize("position, closes", [(0.0, True), (0.039, True), (0.04, False), (0.08, False), (0.087, False),
                                              (-0.007, True)])
def test_the_threshold_separates_goals_that_open_from_those_that_close(position, closes):
    assert BLIND.closes(position, 0.0) is closes
    turned = gripper_from({**LEAST, "open_position": 0.0, "closed_position": 0.08})
    assert turned.closes(0.08 - position, 10.0) is closes


@pytest.mark.parametrize("position, effort, said", [
    (math.nan, 0.0, "position is nan; valid: 0 to 0.08"), (math.inf, 0.0, "position"), (0.09, 0.0, "position is 0.09"),
    (-0.009, 0.0, "position"), (0.0, math.nan, "max_effort is nan"), (0.0, -1.0, "max_effort is -1")])
def test_what_cannot_be_meant_is_refused(position, effort, said):
    with pytest.raises(InvalidCommand, match=said):
        BLIND.closes(position, effort)


def test_of_two_valves_the_one_that_rests_is_set_first():
    assert BLIND.commands(True) == [SetDigitalOutput(IoBank.TOOL, 0, True)]
    assert BLIND.commands(False) == [SetDigitalOutput(IoBank.TOOL, 0, False)]
    assert [(one.index, one.value) for one in SEEING.commands(True)] == [(1, False), (0, True)]
    assert [(one.index, one.value) for one in SEEING.commands(False)] == [(0, False), (1, True)]


# ---- what ends a goal ----

def end(gripper, is_closing, shown, elapsed):
    found = end_of_goal(gripper, is_closing, shown, elapsed)
    return found and (found.is_success, found.position, found.is_stalled, found.reached_goal)


def test_without_inputs_the_time_of_a_stroke_ends_it_and_the_text_says_so():
    assert end(BLIND, True, None, 0.49) is None
    assert end(BLIND, True, None, 0.5) == (True, 0.0, False, True)
    assert "no input shows it" in end_of_goal(BLIND, False, None, 0.5).text


@pytest.mark.parametrize("is_closing, shown, expected", [
    (True, (0, 1, 0), (True, 0.0, False, True)), (True, (0, 0, 1), (True, 0.03, True, False)),
    (False, (1, 0, 0), (True, 0.08, False, True)), (True, (1, 0, 0), None), (False, (0, 0, 1), None),
    (False, (0, 0, 0), None), (True, (0, 0, 0), None), (True, (1, 1, 0), None), (False, (1, 0, 1), None)])
def test_with_inputs_they_alone_end_it_before_the_timeout(is_closing, shown, expected):
    assert end(SEEING, is_closing, Inputs(*map(bool, shown)), 1.9) == expected


@pytest.mark.parametrize("is_closing, shown, is_stalled", [
    (True, (0, 0, 0), True), (True, (1, 0, 0), False), (False, (0, 0, 1), False), (False, (0, 0, 0), True),
    (True, (1, 1, 0), False)])
def test_at_the_timeout_it_fails_and_is_stalled_where_it_was_seen_to_leave(is_closing, shown, is_stalled):
    assert end(SEEING, is_closing, Inputs(*map(bool, shown)), 2.0) == (False, None, is_stalled, False)


def test_inputs_that_do_not_come_prove_nothing():
    assert end(SEEING, True, None, 1.9) is None and end(SEEING, True, None, 2.0) == (False, None, False, False)


def test_the_one_input_that_there_is_must_not_contradict():
    only_open = gripper_from({**LEAST, "open_input": 0})
    assert end(only_open, True, Inputs(is_open=False), 0.4) is None, "the stroke takes its time"
    assert end(only_open, True, Inputs(is_open=False), 0.5) == (True, 0.0, False, True)
    assert end(only_open, True, Inputs(is_open=True), 2.4) is None
    assert end(only_open, True, Inputs(is_open=True), 2.5) == (False, None, False, False)


@pytest.mark.parametrize("shown, assumed, position", [
    ((1, 0, 0), 0.0, 0.08), ((0, 1, 0), None, 0.0), ((0, 0, 1), 0.08, 0.03), ((0, 1, 1), None, 0.0),
    ((1, 1, 0), 0.0, None), ((1, 0, 1), None, None), ((0, 0, 0), 0.08, None), ((0, 0, 0), 0.03, None)])
def test_the_position_is_what_the_inputs_show(shown, assumed, position):
    assert position_of(SEEING, Inputs(*map(bool, shown)), assumed) == position


def test_without_inputs_it_is_that_of_the_last_goal():
    assert position_of(BLIND, Inputs(), None) is None and position_of(BLIND, Inputs(), 0.08) == 0.08
    only_open = gripper_from({**LEAST, "open_input": 0})
    assert position_of(only_open, Inputs(is_open=False), 0.0) == 0.0
    assert position_of(only_open, Inputs(is_open=False), 0.08) is None


def test_an_input_that_the_controller_does_not_have_is_named():
    with pytest.raises(InvalidCommand, match="cabinet digital input 2 of the gripper"):
        read_inputs(SEEING, IoState({IoBank.CABINET: (0, 0)}))
    assert read_inputs(SEEING, IoState({IoBank.CABINET: (0, 1, 1)})) == (False, True, True)


# ---- its joint ----

def frame(at, outputs=(1,)):
    return RobotState((0.0,) * 6, True, True, True, False, False, received_at=at,
                      io=IoState(digital_outputs={IoBank.TOOL: tuple(outputs)}))


def test_the_joint_is_told_while_it_is_known_20_times_a_second_and_never_after_others_set_the_outputs():
    told = []
    joint = GripperJoint(BLIND, "left_finger_joint", told.append, SimpleNamespace(of=lambda state: "stamp"))
    joint.arrived(frame(0.0), True)
    assert told == [], "nothing is known before the first goal"
    joint.assume(0.0, True)
    for n in range(125):
        joint.arrived(frame(1.0 + 0.008 * n), True)
    assert 15 <= len(told) <= 21 and told[0].name == ["left_finger_joint"] and told[0].position == [0.0]
    assert told[0].header.stamp == "stamp"
    count = len(told)
    joint.arrived(frame(3.0), False)
    joint.arrived(frame(3.1, (0,)), True)
    joint.arrived(frame(3.2, (1,)), True)
    assert len(told) == count and joint.position is None, "old frames, and outputs of others"


# ---- goals against outputs that the test plays ----

class Handle:
    """A goal as actionlib keeps it, with its end."""

    def __init__(self, name, position):
        self.name, self.status, self.ends = name, GoalStatus.PENDING, []
        self._goal = made_type("control_msgs/GripperCommandGoal")()
        self._goal.command.position = position

    def get_goal(self):
        return self._goal

    def get_goal_id(self):
        return SimpleNamespace(id=self.name)

    def set_accepted(self):
        self.status = GoalStatus.ACTIVE

    def publish_feedback(self, feedback):
        assert feedback.effort == 0.0

    def __getattr__(self, name):
        if not name.startswith("set_"):
            raise AttributeError(name)
        return lambda result, text: self.ends.append((name[4:], result, text))


class Bench:
    def __init__(self, gripper):
        self.outputs, self.refusal, self.gate = [], None, threading.Event()
        self.gate.set()
        self.joint = GripperJoint(gripper, "joint", lambda message: None, SimpleNamespace(of=lambda state: None))
        self.action = GripperAction(SimpleNamespace(), gripper, self.set_output, self.joint, Recorder(None))

    def set_output(self, command):
        assert self.gate.wait(10.0)
        if self.refusal is not None:
            raise self.refusal
        self.outputs.append((command.index, command.value))

    def send(self, name, position):
        handle = Handle(name, position)
        self.action._take(handle)
        return handle

    def ended(self, handle):
        assert eventually(lambda: handle.ends)
        (one,) = handle.ends
        return one


@pytest.fixture
def bench():
    made = Bench(dataclasses.replace(BLIND, stroke_time=0.2, timeout=0.4))
    yield made
    made.gate.set()
    made.action.finish_goals(10.0)


def test_a_goal_sets_the_output_and_succeeds(bench):
    kind, result, text = bench.ended(bench.send("one", 0.0))
    assert (kind, result.position, result.reached_goal, result.stalled) == ("succeeded", 0.0, True, False)
    assert bench.outputs == [(0, True)] and "no input shows it" in text


def test_an_output_that_cannot_be_set_aborts_with_the_reason(bench):
    bench.refusal = CommandRejected("set_digital_output", 1, "no such output")
    kind, result, text = bench.ended(bench.send("one", 0.0))
    assert kind == "aborted" and "no such output" in text and math.isnan(result.position)


def test_a_refused_goal_sets_nothing_and_leaves_the_running_one(bench):
    running = bench.send("one", 0.0)
    kind, _, text = bench.ended(bench.send("two", math.nan))
    assert kind == "rejected" and "position is nan" in text
    assert bench.ended(running)[0] == "succeeded" and bench.outputs == [(0, True)]


def test_a_cancel_leaves_the_output_as_it_is(bench):
    goal = bench.send("one", 0.0)
    assert eventually(lambda: bench.outputs)
    bench.action._cancel(goal)
    kind, _, text = bench.ended(goal)
    assert kind == "canceled" and "stay as they are" in text and bench.outputs == [(0, True)]


def test_a_newer_goal_ends_the_older_one_and_has_the_last_word(bench):
    bench.gate.clear()
    first, second, third = bench.send("one", 0.0), bench.send("two", 0.08), bench.send("three", 0.0)
    bench.gate.set()
    assert [bench.ended(one)[0] for one in (first, second, third)] == ["canceled", "canceled", "succeeded"]
    assert bench.outputs[-1] == (0, True)


def test_the_end_of_the_driver_ends_the_goal_and_sets_nothing(bench):
    goal = bench.send("one", 0.0)
    assert eventually(lambda: bench.outputs)
    bench.action.finish_goals(10.0)
    assert bench.ended(goal)[0] == "aborted" and bench.outputs == [(0, True)]
    assert bench.ended(bench.send("two", 0.08))[0] == "rejected" and bench.outputs == [(0, True)]


def test_the_type_of_our_own_is_the_published_one():
    # The md5 is that in generated code of control_msgs, as rosserial's control_msgs/GripperCommandAction.h.
    made = made_type("control_msgs/GripperCommandAction")
    assert made._md5sum == MD5["control_msgs/GripperCommandAction"] == "950b2a6ebe831f5d4f4ceaba3d8be01e"
