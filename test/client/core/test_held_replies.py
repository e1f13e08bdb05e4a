"""Calls beside a command whose reply takes its time: served where other replies pass it, else refused."""
import pytest
from stories import HOME, PERIOD, WHOLE_STOP, Story

from jaka_ros_driver.client.core.actions import Close, Port
from jaka_ros_driver.client.core.procedures import power, settings
from jaka_ros_driver.commands import ClearError, JointMove, SetDigitalOutput
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.state import IoBank

OFF = {"powered_on": 0, "enabled": False}
MOVE = JointMove((1.0,) + HOME[1:], 1.0, 1.0)
OUTPUT = SetDigitalOutput(IoBank.CABINET, 0, True)


class Controller(Story):
    """A controller whose reply to one command comes when the test lets it; ``holds``: and no later one before it."""

    def __init__(self, holds, slow="power_on", **fields):
        super().__init__()
        self.holds = holds
        self.slow = slow
        self.waiting = None
        self.fields.update(fields)
        self.run(0.1)
        del self.sent[:]
        del self.asked_to_connect[:]

    def reply(self, name, code="0"):
        if name == getattr(self, "slow", ""):
            self.waiting = [name]
        elif getattr(self, "waiting", None) and self.holds:
            self.waiting.append(name)
        else:
            super().reply(name, code)

    def release(self):
        waiting, self.waiting, self.slow = self.waiting, None, ""
        for name in waiting:
            self.reply(name)

    def call(self, token):
        self.core.run(token, self.core.ask(ClearError()), self.now)
        self.perform()


def powering(holds):
    story = Controller(holds, **OFF)
    story.core.run("power", power.set_power(story.core, True), story.now)
    story.perform()
    return story


def dropped(story):
    return [action for _, action in story.asked_to_connect if isinstance(action, Close)]


def test_where_replies_pass_a_call_is_served_after_one_heartbeat_and_then_at_once():
    story = powering(holds=False)
    story.run(0.01).call("first")
    assert story.run(0.27).error("first") is None
    story.release()
    story.fields["powered_on"] = 1
    story.run(0.1)
    story.slow = "enable_robot"
    story.core.run("enable", power.set_enabled(story.core, True), story.now)
    story.perform()
    story.call("second")
    assert story.error("second") is None and story.error("enable") == "pending"


def test_where_replies_are_held_a_call_is_refused_within_the_time_of_a_reply_and_not_sent():
    story = powering(holds=True)
    story.run(0.1).call("early")
    story.run(0.7)
    assert story.error("early") == "pending"
    story.run(0.12)
    assert isinstance(story.error("early"), InvalidCommand) and "until power_on is done" in str(story.error("early"))
    story.run(1.0).call("late")
    assert isinstance(story.error("late"), InvalidCommand)
    assert story.count("clear_error") == 0


def test_every_kind_of_call_that_asks_is_refused_at_once():
    story = powering(holds=True).run(1.0)
    story.core.run("io", settings.set_digital_output(story.core, OUTPUT), story.now)
    story.core.run("level", settings.set_collision_level(story.core, 3), story.now)
    story.core.run("alarms", power.clear_error(story.core), story.now)
    story.core.servo_mode("servo", False, story.now)
    story.perform()
    for call in ("io", "level", "alarms", "servo"):
        assert isinstance(story.error(call), InvalidCommand) and "power_on" in str(story.error(call)), call


def test_the_link_lasts_while_replies_are_held_and_calls_are_served_again_when_the_slow_one_is_done():
    story = powering(holds=True).run(7.0)
    assert not dropped(story) and story.count("is_in_servomove") == 1
    story.fields["powered_on"] = 1
    story.run(0.02)
    story.release()
    story.call("after")
    assert story.error("after") is None and story.run(0.1).error("power") is None
    assert not dropped(story.run(1.5)) and story.core.is_ready(story.now)


def test_a_call_that_waits_is_sent_when_the_slow_reply_comes():
    story = powering(holds=True).run(0.1)
    story.call("call")
    story.fields["powered_on"] = 1
    story.run(0.2)
    story.release()
    assert story.run(PERIOD).error("call") is None


def test_a_call_that_waits_learns_that_the_link_is_lost():
    story = powering(holds=True).run(0.1)
    story.call("call")
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.perform()
    assert "cut" in str(story.error("call"))


@pytest.mark.parametrize("holds", [True, False])
@pytest.mark.parametrize("after", [0.0, 0.1, 2.0])
def test_a_stop_is_sent_at_once_and_answered_when_the_arm_rests(holds, after):
    story = powering(holds).run(after)
    del story.sent[:]
    story.core.stop("stop", story.now)
    story.perform()
    assert story.names()[:8] == WHOLE_STOP
    assert story.run(0.1).error("stop") is None


def test_a_motion_is_refused_while_the_drives_are_being_switched_off():
    story = Controller(True, "disable_robot")
    story.core.run("disable", power.set_enabled(story.core, False), story.now)
    story.run(0.2)
    story.core.move("move", MOVE, True, story.now)
    story.perform()
    assert isinstance(story.error("move"), InvalidCommand) and "disable_robot" in str(story.error("move"))
    assert story.count("joint_move") == 0
