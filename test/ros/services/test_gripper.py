"""The decisions on a gripper: what its parameter says, which goals it takes, what its inputs prove; without a node."""
import dataclasses
import math
import threading
from types import SimpleNamespace

import pytest
from actionlib_msgs.msg import GoalStatus
from waiting import eventually

from jaka_ros_driver.commands import SetAnalogOutput, SetDigitalOutput
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.limits import check
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.gripper import KEYS, Inputs, end_of_goal, gripper_from, position_of
from jaka_ros_driver.ros.other_messages import MD5, made_type
from jaka_ros_driver.ros.params import WrongParameter, config_from
from jaka_ros_driver.ros.services.gripper_action import GripperAction, GripperJoint
from jaka_ros_driver.state import BusTerminals, FieldBus, IoBank, IoState, RobotState

LEAST = {"joint": "finger_joint", "open_position": 0.08, "closed_position": 0.0, "stroke_time": 0.5, "close_output": 0}
FULL = {**LEAST, "open_output": 1, "open_input": 0, "closed_input": 1, "gripped_input": 2, "gripped_position": 0.03,
        "input_bank": "cabinet", "timeout": 2.0}
BLIND, SEEING = gripper_from(LEAST), gripper_from(FULL)
LEAST_WIDTH = {"joint": "finger_joint", "open_position": 0.08, "closed_position": 0.0, "stroke_time": 0.5,
               "analog_output": 3, "open_value": 10.0, "closed_value": 2.0}
FULL_WIDTH = {**LEAST_WIDTH, "output_bank": "modbus_slave", "open_value": 1000, "closed_value": 0,
              "input_bank": "cabinet", "analog_input": 1, "open_reading": 4.0, "closed_reading": 20.0,
              "position_tolerance": 0.002, "gripped_time": 0.3, "timeout": 2.0}
SENT, WIDE = gripper_from(LEAST_WIDTH), gripper_from(FULL_WIDTH)


# ---- the parameter ----

def test_what_is_left_out_has_its_default():
    assert BLIND.controller == "jaka_gripper_controller" and BLIND.threshold == pytest.approx(0.04)
    assert (BLIND.output_bank, BLIND.input_bank, BLIND.timeout) == (IoBank.TOOL, IoBank.TOOL, 2.5)
    assert not BLIND.has_inputs and SEEING.has_inputs and SEEING.input_bank is IoBank.CABINET
    assert config_from({}).gripper is None and config_from({"gripper": {}}).gripper is None
    assert config_from({"gripper": FULL}).gripper == SEEING


@pytest.mark.parametrize("changed, said", [
    ({"joint": None}, "joint is None; valid: a ROS name"), ({"joint": "a b"}, "joint is 'a b'"),
    ({"controller": "/x"}, "controller is '/x'"),
    ({"output_bank": "pump"}, "valid: cabinet, extension, modbus_slave, tool"),
    ({"input_bank": "extension"}, "valid: cabinet, modbus_slave, tool"),
    ({"close_output": -1}, "close_output is -1; valid: a whole number, 0 to 1023"),
    ({"close_output": True}, "close_output is True"), ({"open_output": 0}, "both 0; they must differ"),
    ({"closed_position": 0.08}, "both 0.08; they must differ"), ({"open_position": math.nan}, "open_position is nan"),
    ({"open_position": "wide"}, "a number, -10 to 10"), ({"threshold": 0.08}, "threshold is 0.08; valid: between"),
    ({"stroke_time": 0}, "stroke_time is 0; valid: a number, 0.01 to 60"), ({"timeout": 0.4}, "timeout is 0.4"),
    ({"timeout": 120.5}, "timeout is 120.5; valid: a number, 0.5 to 120"),
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
    assert {*FULL, *FULL_WIDTH, "controller", "threshold"} == set(KEYS)
    assert config_from({"gripper": FULL_WIDTH}).gripper == WIDE
    assert (WIDE.output_bank, WIDE.input_bank) == (FieldBus.MODBUS_SLAVE, IoBank.CABINET)


@pytest.mark.parametrize("changed, said", [
    ({"closed_value": 1000}, "open_value and closed_value are both 1000; they must differ"),
    ({"open_value": 65536}, "open_value is 65536; valid: a number, 0 to 65535"),
    ({"closed_reading": 4.0}, "open_reading and closed_reading are both 4"),
    ({"closed_reading": -2000}, "closed_reading is -2000; valid: a number, -1000 to 1000"),
    ({"position_tolerance": 0}, "position_tolerance is 0"), ({"gripped_time": 0}, "gripped_time is 0"),
    ({"close_output": 1}, "close_output has no use beside the other keys"),
    ({"threshold": 0.04}, "threshold has no use"), ({"analog_output": None}, "analog_output is None")])
def test_a_wrong_key_of_a_width_is_refused(changed, said):
    with pytest.raises(ValueError) as refusal:
        gripper_from({**FULL_WIDTH, **changed})
    assert said in str(refusal.value)


def test_the_smallest_tolerance_is_a_thousandth_of_the_stroke():
    smallest = 1e-3 * (FULL_WIDTH["open_position"] - FULL_WIDTH["closed_position"])
    assert gripper_from({**FULL_WIDTH, "position_tolerance": smallest}).position_tolerance == smallest
    with pytest.raises(ValueError, match="position_tolerance is"):
        gripper_from({**FULL_WIDTH, "position_tolerance": 0.99 * smallest})


def test_what_only_an_analog_input_needs_is_refused_without_one():
    for key, value in (("gripped_time", 1.0), ("open_reading", 0.0), ("position_tolerance", 0.01)):
        with pytest.raises(ValueError, match="%s has no use beside the other keys" % key):
            gripper_from({**LEAST_WIDTH, key: value})
    with pytest.raises(ValueError, match="closed_value is missing"):
        gripper_from({key: value for key, value in LEAST_WIDTH.items() if key != "closed_value"})


# ---- which goal is which ----

@pytest.mark.parametrize("position, closes", [(0.0, True), (0.039, True), (0.04, False), (0.08, False), (0.087, False),
                                              (-0.007, True)])
def test_the_threshold_separates_goals_that_open_from_those_that_close(position, closes):
    assert BLIND.aim(position, 0.0) == (0.0 if closes else 0.08)
    turned = gripper_from({**LEAST, "open_position": 0.0, "closed_position": 0.08})
    assert turned.aim(0.08 - position, 10.0) == (0.08 if closes else 0.0)


@pytest.mark.parametrize("position, effort, said", [
    (math.nan, 0.0, "position is nan; valid: 0 to 0.08"), (math.inf, 0.0, "position"), (0.09, 0.0, "position is 0.09"),
    (-0.009, 0.0, "position"), (0.0, math.nan, "max_effort is nan"), (0.0, -1.0, "max_effort is -1")])
def test_what_cannot_be_meant_is_refused(position, effort, said):
    with pytest.raises(InvalidCommand, match=said):
        BLIND.aim(position, effort)
    with pytest.raises(InvalidCommand, match=said):
        WIDE.aim(position, effort)


def test_of_two_valves_the_one_that_rests_is_set_first():
    assert BLIND.commands(0.0) == [SetDigitalOutput(IoBank.TOOL, 0, True)]
    assert BLIND.commands(0.08) == [SetDigitalOutput(IoBank.TOOL, 0, False)]
    assert [(one.index, one.value) for one in SEEING.commands(0.0)] == [(1, False), (0, True)]
    assert [(one.index, one.value) for one in SEEING.commands(0.08)] == [(0, False), (1, True)]


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
        SEEING.read_inputs(IoState({IoBank.CABINET: (0, 0)}))
    assert SEEING.read_inputs(IoState({IoBank.CABINET: (0, 1, 1)})) == (False, True, True)


# ---- a gripper with a width ----

def reading(milliamperes):
    """Return the terminals with this reading on the input of ``WIDE``: 4 mA at 0.08 m, 20 mA at 0 m."""
    return IoState(analog_inputs={IoBank.CABINET: (0.0, milliamperes)})


@pytest.mark.parametrize("position, volts, register", [(0.08, 10.0, 1000), (0.0, 2.0, 0), (0.02, 4.0, 250),
                                                       (0.087, 10.0, 1000), (0.0333, 5.33, 416)])
def test_the_value_is_linear_between_its_ends_and_whole_in_a_register(position, volts, register):
    (command,) = SENT.commands(SENT.aim(position, 0.0))
    assert command == SetAnalogOutput(IoBank.TOOL, 3, pytest.approx(volts))
    assert WIDE.commands(WIDE.aim(position, 5.0)) == [SetAnalogOutput(FieldBus.MODBUS_SLAVE, 3, register)]
    check(command, load_model("zu7"))
    check(*WIDE.commands(position), load_model("zu7"))


@pytest.mark.parametrize("milliamperes, position", [(4.0, 0.08), (20.0, 0.0), (12.0, 0.04), (3.0, 0.085), (0.0, None),
                                                    (24.0, None)])
def test_the_reading_shows_the_position_unless_no_gripper_gives_it(milliamperes, position):
    assert WIDE.position(reading(milliamperes), 0.01) == (None if position is None else pytest.approx(position))
    assert SENT.position(IoState(), 0.01) == 0.01 and SENT.position(IoState(), None) is None
    with pytest.raises(InvalidCommand, match="cabinet analog input 1 of the gripper"):
        WIDE.position(IoState(analog_inputs={IoBank.CABINET: (0.0,)}), None)


def test_another_value_of_the_output_ends_what_is_known_by_the_last_goal():
    def held(register):
        terminals = BusTerminals(analog_outputs=(0, 0, 0, register))
        return IoState(field_buses={FieldBus.MODBUS_SLAVE: terminals})
    assert WIDE.outputs_hold(held(250), 0.02) and not WIDE.outputs_hold(held(251), 0.02)
    assert WIDE.outputs_hold(IoState(), 0.02), "an output that the feed lacks"


def course(gripper, aim, *seen):
    """Return the end of a goal by (elapsed, reading) in turn, and when; None for a frame that does not come."""
    watch = gripper.watch(aim)
    for elapsed, milliamperes in seen:
        found = watch(None if milliamperes is None else reading(milliamperes), elapsed)
        if found:
            return elapsed, found.is_success, found.position, found.is_stalled, found.reached_goal
    return None


def test_a_goal_of_a_width_ends_where_its_input_shows_that_it_is_there():
    assert course(WIDE, 0.04, (0.0, 4.0), (0.2, 8.0), (0.4, 11.8), (0.5, 12.0)) == (
        0.4, True, pytest.approx(0.041), False, True)
    assert course(WIDE, 0.04, (0.0, None), (1.9, None)) is None
    assert course(WIDE, 0.04, (0.0, 0.0), (2.0, 0.0)) == (2.0, False, None, False, False), "a wire that is off"


def test_a_closing_gripper_that_stands_still_on_its_way_holds_a_work_piece():
    assert course(WIDE, 0.0, (0.0, 4.0), (0.1, 8.0), (0.2, 12.0), (0.4, 12.0), (0.5, 12.0)) == (
        0.5, True, pytest.approx(0.04), True, False)
    assert course(WIDE, 0.0, (0.0, 12.0), (0.3, 12.0)) == (0.3, True, pytest.approx(0.04), True, False), "as before"


def test_one_that_does_not_leave_opens_or_has_no_such_time_holds_none():
    assert course(WIDE, 0.0, (0.0, 4.0), (1.9, 4.0)) is None
    assert course(WIDE, 0.0, (0.0, 4.0), (2.0, 4.0)) == (2.0, False, pytest.approx(0.08), False, False)
    assert course(WIDE, 0.08, (0.0, 20.0), (0.2, 12.0), (1.9, 12.0)) is None
    assert course(WIDE, 0.08, (0.0, 20.0), (0.2, 12.0), (2.0, 12.0)) == (2.0, False, pytest.approx(0.04), True, False)
    without = dataclasses.replace(WIDE, gripped_time=None)
    assert course(without, 0.0, (0.0, 4.0), (0.2, 12.0), (2.0, 12.0)) == (2.0, False, pytest.approx(0.04), True, False)


def test_without_an_input_the_time_of_a_stroke_ends_the_goal_of_a_width():
    watch = SENT.watch(0.02)
    assert watch(None, 0.49) is None and watch(None, 0.5)[:4] == (True, 0.02, False, True)
    assert "no input shows it" in watch(None, 0.5).text


# ---- its joint ----

def frame(at, outputs=(1,)):
    return RobotState((0.0,) * 6, True, True, True, False, False, received_at=at,
                      io=IoState(digital_outputs={IoBank.TOOL: tuple(outputs)}))


def test_the_joint_is_told_while_it_is_known_20_times_a_second_and_never_after_others_set_the_outputs():
    told = []
    joint = GripperJoint(BLIND, "left_finger_joint", told.append, SimpleNamespace(of=lambda state: "stamp"))
    joint.arrived(frame(0.0), True)
    assert told == [], "nothing is known before the first goal"
    joint.assume(0.0, 0.0)
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
        self.action = GripperAction(SimpleNamespace(fresh_state=self.no_state), gripper, self.set_output, self.joint,
                                    Recorder(None))

    @staticmethod
    def no_state():
        raise ConnectionLost("the test has no controller")

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
