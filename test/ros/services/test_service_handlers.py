"""The services' requests to the arm, and their answers: with an arm that notes what it is asked."""
from types import SimpleNamespace

import pytest

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.workspace import NO_ZONES, workspace_of, workspace_of_text
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.ros.convert import Terminal
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.services.handlers import ServiceHandlers
from jaka_ros_driver.state import IoBank, IoState, RobotState

MOVE = c.JointMove((0.0,) * 6, 1.0, 1.0)
IO = IoState({IoBank.CABINET: (0, 1)}, {IoBank.CABINET: (1, 0)}, {IoBank.CABINET: (0.5, 1.5)},
             {IoBank.CABINET: (2.5, 3.5)})


class Arm:
    """A recorder of moves and of how procedures are run; ``result`` is what they return."""

    def __init__(self):
        self.settings = SimpleNamespace(jog_timeout=3.0)
        self.state = RobotState((0.0,) * 6, True, True, True, False, False, io=IO)
        self.moves, self.runs, self.asked = [], [], []
        self.result = None

    def move(self, command):
        self.moves.append((command, True))

    def queue(self, command):
        self.moves.append((command, False))

    def run(self, procedure, exclusive=None):
        self.runs.append(exclusive)
        return self.result

    def execute(self, command):
        self.asked.append(command)
        return 1

    def fresh_state(self):
        return self.state


class NoEnds:
    """A stand-in that gives every accepted move the same id."""

    def move_accepted(self, end):
        return "7"


@pytest.fixture
def arm():
    return Arm()


def handlers(arm, **parameters):
    return ServiceHandlers(
        arm, DriverConfig(**parameters), FrameReader(arm), NoEnds(), getattr(arm, "shown", []).append)


@pytest.mark.parametrize("led, message", [("", "accepted"), ("joint 2 is led away", "accepted; joint 2 is led away")])
def test_a_servo_target_that_is_led_inside_the_limits_says_so_in_its_reply(arm, led, message):
    arm.servo_target = lambda command: led
    outcome = handlers(arm).servo_target(c.ServoJoint((0.0,) * 6))
    assert outcome.is_success and outcome.message == message


@pytest.mark.parametrize("blocking, message", [(True, "completed"), (False, "accepted, id 7")])
def test_a_move_is_waited_for_as_the_parameter_says_and_its_caller_told_so(arm, blocking, message):
    outcome = handlers(arm, blocking=blocking).move(MOVE)
    assert arm.moves == [(MOVE, blocking)]
    assert outcome.is_success and outcome.message.startswith(message)


ZONES = workspace_of({"floor": -0.1, "tool": [{"name": "rod", "start": [0, 0, 0], "end": [0, 0, 0.1], "radius": 0.02}]})


class GuardedArm(Arm):
    """An arm whose motion guard keeps what was set last; ``trouble`` is where it stands."""

    def __init__(self, trouble=""):
        super().__init__()
        self.model, self.workspace, self.trouble = load_model("zu7"), NO_ZONES, trouble
        self.shown = []

    def run(self, procedure, exclusive=None):
        self.runs.append(exclusive)
        if exclusive is None:
            return self.workspace
        checked = SimpleNamespace(keep=lambda guard: setattr(self, "workspace", guard.workspace))
        running = procedure(SimpleNamespace(
            fresh_state=lambda now: self.state, custody=SimpleNamespace(motion_check=checked),
            actions=SimpleNamespace(log=lambda level, text: None)))
        running.send(None)
        with pytest.raises(StopIteration):
            running.send(0.0)
        return self.trouble


def test_zones_are_changed_on_an_arm_that_nothing_moves_and_told_with_what_they_were():
    arm = GuardedArm()
    outcome = handlers(arm).workspace(ZONES)
    assert arm.runs == [None, MotionOwner.ZONES, None] and arm.workspace == ZONES and arm.shown == [ZONES]
    assert outcome.message == "1 zone and 1 part of a tool are kept, before 0 zones and 0 parts of a tool"
    assert workspace_of_text(outcome.text) == ZONES


def test_a_question_for_the_zones_changes_nothing():
    arm = GuardedArm()
    arm.workspace = ZONES
    outcome = handlers(arm).workspace(None)
    assert arm.runs == [None] and arm.shown == []
    assert outcome.message == "nothing is changed: 1 zone and 1 part of a tool"
    assert workspace_of_text(outcome.text) == ZONES


@pytest.mark.parametrize("mode", ["warn", "off"])
def test_who_sets_zones_hears_that_the_arm_stands_in_one_and_that_nothing_is_refused(mode):
    message = handlers(GuardedArm("the flange is 4 mm from the floor"), guard_motion=mode).workspace(ZONES).message
    assert "; where the arm stands the flange is 4 mm from the floor: it can move out, and no deeper" in message
    assert message.endswith("; ~guard_motion is %s: no motion is refused" % mode)


@pytest.mark.parametrize("active", [True, False])
def test_hand_guiding_needs_a_free_arm_to_begin_and_nothing_to_end(arm, active):
    handlers(arm).hand_guiding(active)
    assert arm.runs == [MotionOwner.SETTING if active else None]


@pytest.mark.parametrize("is_digital, is_output, values", [
    (True, False, (0, 1)), (True, True, (1, 0)), (False, False, (0.5, 1.5)), (False, True, (2.5, 3.5))])
def test_each_terminal_is_read_from_its_own_place_and_none_beyond_the_last(arm, is_digital, is_output, values):
    read = handlers(arm).read
    for index, value in enumerate(values):
        assert read(Terminal(is_digital, is_output, IoBank.CABINET, index)).value == value
    with pytest.raises(InvalidCommand, match="index is 2; valid: 0 to 1"):
        read(Terminal(is_digital, is_output, IoBank.CABINET, 2))
    assert not arm.asked


@pytest.mark.parametrize("is_digital, query", [(True, c.GetDigitalOutput), (False, c.GetAnalogOutput)])
def test_an_output_that_the_feed_does_not_contain_is_asked_for_and_an_input_cannot_be(arm, is_digital, query):
    read = handlers(arm).read
    assert read(Terminal(is_digital, True, IoBank.TOOL, 1)).value == 1.0
    assert arm.asked == [query(IoBank.TOOL, 1)]
    with pytest.raises(InvalidCommand, match="does not report"):
        read(Terminal(is_digital, False, IoBank.TOOL, 1))


@pytest.mark.parametrize("is_digital, is_output, query", [
    (True, False, c.GetDigitalInput), (True, True, c.GetDigitalOutput), (False, False, c.GetAnalogInput),
    (False, True, c.GetAnalogOutput)])
def test_with_the_makers_interface_of_2025_the_controller_is_asked_by_the_same_index(arm, is_digital, is_output, query):
    handlers(arm, interface="vendor_2025").read(Terminal(is_digital, is_output, IoBank.CABINET, 1))
    assert arm.asked == [query(IoBank.CABINET, 1)]
    handlers(arm, interface="vendor").read(Terminal(is_digital, is_output, IoBank.CABINET, 1))
    assert len(arm.asked) == 1


def test_clearing_succeeds_unless_the_emergency_stop_stands_and_tells_what_is_missing(arm):
    clear = handlers(arm).clear_error
    arm.result = "alarms cleared", []
    assert clear(None).is_success and "ready" in clear(None).message
    arm.result = "alarms cleared", ["power", "enable"]
    assert clear(None).is_success and clear(None).message.endswith("power, enable")
    arm.state = RobotState((0.0,) * 6, False, False, True, True, False)
    assert not clear(None).is_success and "emergency stop" in clear(None).message


@pytest.mark.parametrize("service, on, told", [
    ("power", True, "power on"), ("power", False, "power off"), ("enable", True, "enabled"),
    ("enable", False, "disabled")])
def test_power_and_brakes_are_told_as_they_are_with_what_else_was_done(arm, service, on, told):
    arm.result = ""
    assert getattr(handlers(arm), service)(on).message == told
    arm.result = "the drives were disabled"
    assert getattr(handlers(arm), service)(on).message == told + "; the drives were disabled"
