"""A velocity jog in the core: its begin, its ends, and that nothing begins it again."""
import math

import pytest
from stories import HOME, PERIOD, Story

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.velocity_jog.dead_man import FRESH_S, JogMessage
from jaka_ros_driver.client.core.velocity_jog.ramp import Wish
from jaka_ros_driver.commands import JogFrame, JointMove
from jaka_ros_driver.errors import InvalidCommand, JakaError, StopCause

REST = (0.0,) * 6
SPEED = 0.3
WISH = (SPEED,) + (0.0,) * 5
BRAKE_S = 0.1
STOPPED_WITHIN_S = 0.3


class Pad:
    """A publisher of messages, one every 16 ms, and an arm that follows what it is sent."""

    def __init__(self, source="/pad", **settings):
        self.story = Story(**settings)
        self.source = source
        self.told_at = 0.0
        self.refusals = []

    def say(self, velocity, frame=JogFrame.JOINT, source=None, problem=""):
        story = self.story
        wish = None if velocity is None else Wish(frame, velocity)
        try:
            story.core.jog_velocity(JogMessage(source or self.source, int(1e9 * story.now), 0.0, story.now, wish,
                                               problem), story.now)
            self.told_at = story.now
        except JakaError as error:
            self.refusals.append(str(error))
        story.perform()

    def wait(self, seconds, says=None, **fields):
        """Let time pass; ``says``: a velocity that is published meanwhile."""
        for count in range(int(round(seconds / PERIOD))):
            if says is not None and count % 2 == 0:
                self.say(says)
            sent = self.frames()
            if sent:
                self.story.joints = [math.radians(q) for q in sent[-1][1]]
            self.story.run(PERIOD, **fields)
        return self

    def jogging(self):
        self.wait(0.1, REST).wait(0.4, WISH)
        assert self.story.core.motion_owner is MotionOwner.VELOCITY_JOG and self.speed() == pytest.approx(SPEED)
        return self

    def frames(self):
        return [(at, request["jointPosition"]) for at, request in self.story.sent if request["cmdName"] == "servo_j"]

    def speed(self):
        """Return the first joint's speed in the last two frames, rad/s."""
        (_, before), (_, after) = self.frames()[-2:]
        return math.radians(after[0] - before[0]) / PERIOD

    def stopped_after(self):
        """Return the time from the last message that counted until the frames are all the same, s."""
        frames = self.frames()
        moving = [b for a, b in zip(frames, frames[1:]) if a[1] != b[1]]
        return moving[-1][0] - self.told_at


def rests(pad, reason, says=WISH):
    """Check that the jog came to rest in time, is free, and begins again only after a message of rest."""
    assert pad.stopped_after() <= STOPPED_WITHIN_S
    pad.wait(0.7)
    count = len(pad.frames())
    assert pad.story.core.is_free and not pad.story.servo_mode
    pad.wait(0.5, says)
    assert len(pad.frames()) == count and pad.story.core.is_free
    assert reason in pad.refusals[-1] and "zero velocity must come first" in pad.refusals[-1]
    pad.jogging()


def test_rest_moves_nothing_and_takes_no_custody():
    pad = Pad().wait(1.0, REST)
    assert pad.story.core.is_free and pad.story.count("servo_move") == 0 and not pad.refusals


def test_without_rest_first_nothing_moves():
    pad = Pad().wait(1.0, WISH)
    assert pad.story.core.is_free and pad.story.count("servo_move") == 0
    assert all("zero velocity must come first" in refusal for refusal in pad.refusals)


def test_it_begins_where_the_arm_is_and_follows():
    pad = Pad().jogging()
    frames = [q for _, q in pad.frames()]
    assert frames[0][1:] == pytest.approx([math.degrees(q) for q in HOME][1:]) and 0.0 <= frames[0][0] < 0.1
    assert pad.story.told[-1] is True


def test_silence_brakes_and_leaves_servo_mode():
    pad = Pad().jogging().wait(FRESH_S - 2 * PERIOD)
    assert pad.speed() == pytest.approx(SPEED)
    pad.wait(0.5)
    assert any("no fresh message for 0.2 s; the arm brakes" in line for line in pad.story.log)
    assert pad.story.count("stop_program") == 0
    rests(pad, "no fresh message")


def test_a_jog_that_is_said_to_rest_holds_the_arm_for_a_while_and_then_lets_go():
    pad = Pad().jogging().wait(0.5, REST)
    assert pad.story.servo_mode and pad.speed() == 0.0
    pad.wait(0.2, WISH)
    assert pad.speed() == pytest.approx(SPEED)
    pad.wait(1.5, REST)
    assert pad.story.core.is_free and not pad.story.servo_mode
    pad.wait(0.3, WISH)
    assert pad.speed() == pytest.approx(SPEED), "rest has been said all the time"


def test_what_cannot_be_understood_brakes_at_once():
    pad = Pad().jogging()
    pad.say(None, problem="twist holds nan")
    pad.wait(BRAKE_S)
    assert pad.speed() == 0.0
    rests(pad, "twist holds nan")


def test_a_speed_that_the_arm_does_not_have_brakes():
    pad = Pad().jogging()
    pad.say((30.0,) + REST[1:])
    pad.wait(BRAKE_S)
    assert pad.speed() == 0.0
    rests(pad, "joint 1 is asked for 30 rad/s")


def test_two_publishers_brake():
    pad = Pad().jogging()
    pad.say(WISH, source="/other")
    pad.wait(0.5, WISH)
    assert pad.speed() == 0.0 and "several publishers at once: /other, /pad" in pad.refusals[-1]
    rests(pad, "several publishers")


def test_a_hand_that_was_let_go_and_taken_anew_between_two_frames_brakes_all_the_same():
    pad = Pad().jogging()
    pad.story.core.dead_man.release("between two frames")
    for says in (REST, WISH):
        pad.story.now += 0.001
        pad.say(says)
    assert not pad.refusals
    pad.wait(0.05, WISH)
    assert pad.speed() == 0.0


@pytest.mark.parametrize("fields", [{"emergency_stop": 1}, {"protective_stop": 1}, {"enabled": False},
                                    {"powered_on": 0}, {"errcode": "0x7abcde"}], ids=str)
def test_what_contradicts_it_stops_the_arm_and_nothing_resumes(fields):
    pad = Pad().jogging().wait(0.1, WISH, **fields)
    assert pad.story.count("stop_program") == 1
    pad.wait(0.5)
    count = len(pad.frames())
    pad.wait(0.5, WISH)
    assert len(pad.frames()) == count and pad.story.core.is_free
    pad.jogging()


def test_stop_ends_it_and_nothing_resumes():
    pad = Pad().jogging()
    pad.story.core.stop("stop", pad.story.now)
    pad.story.perform()
    count = len(pad.frames())
    pad.wait(0.5, WISH)
    assert pad.story.error("stop") is None and len(pad.frames()) == count and pad.story.core.is_free
    assert pad.story.count("stop_program") == 1
    pad.jogging()


@pytest.mark.parametrize("port", list(Port))
def test_a_lost_link_ends_it_and_nothing_resumes(port):
    pad = Pad().jogging()
    count = len(pad.frames())
    pad.story.core.closed(port, "cut", pad.story.now)
    pad.story.perform()
    pad.story.feed = port is Port.COMMAND
    pad.wait(0.1, WISH)
    pad.story.core.opened(port, pad.story.now)
    pad.story.perform()
    pad.story.feed = True
    pad.wait(1.0, WISH)
    assert pad.story.count("stop_program") == 1 and len(pad.frames()) == count and pad.story.core.is_free
    pad.jogging()


def test_a_driver_that_was_held_up_does_not_move_on():
    pad = Pad().jogging()
    pad.story.now += 0.25
    pad.say(WISH)
    pad.story.frame()
    pad.story.core.tick(pad.story.now)
    pad.story.perform()
    pad.wait(0.2, WISH)
    assert pad.speed() == 0.0 and "no fresh message" in pad.refusals[0]


def test_a_frame_that_is_refused_ends_it():
    pad = Pad().jogging()
    pad.story.replies["servo_j"] = "-8"
    pad.wait(0.2, WISH)
    assert pad.story.count("stop_program") == 1
    del pad.story.replies["servo_j"]
    rests(pad, "the jog was stopped")


def test_servo_mode_that_is_refused_lets_go():
    pad = Pad()
    pad.story.replies["servo_move"] = "2"
    pad.wait(0.1, REST).wait(0.3, WISH)
    assert pad.story.count("servo_move") == 1 and pad.story.core.is_free
    assert any("velocity jog: controller rejected servo_move" in line for line in pad.story.log)


def test_an_arm_that_is_not_where_it_was_sent_is_stopped():
    pad = Pad().jogging()
    for _ in range(25):
        pad.say(WISH)
        pad.story.run(2 * PERIOD, move=-1.0, speed=1.0)
    assert pad.story.count("stop_program") == 1


def test_others_are_refused_by_name_and_it_is_refused_while_others_move():
    pad = Pad().jogging()
    pad.story.core.move("move", JointMove((0.5,) + HOME[1:], 1.0, 4.0), True, pad.story.now)
    pad.story.core.servo_mode("servo", True, pad.story.now)
    pad.story.perform()
    for call in ("move", "servo"):
        assert isinstance(pad.story.error(call), InvalidCommand)
        assert "a velocity jog owns the arm's motion" in str(pad.story.error(call))
    pad = Pad()
    pad.story.core.move("move", JointMove((0.5,) + HOME[1:], 1.0, 4.0), True, pad.story.now)
    pad.story.run(0.1, move=0.5)
    pad.wait(PERIOD, REST)
    for _ in range(2):
        pad.story.run(PERIOD, move=0.5)
        pad.say(WISH)
    assert "a move owns the arm's motion" in pad.refusals[0]
    assert "zero velocity must come first" in pad.refusals[1] and pad.story.count("servo_move") == 0


@pytest.mark.parametrize("fields", [{"emergency_stop": 1}, {"enabled": False}, {"drag_status": True}], ids=str)
def test_an_arm_that_cannot_move_is_not_jogged(fields):
    pad = Pad().wait(0.1, REST, **fields).wait(0.2, WISH, **fields)
    assert pad.story.count("servo_move") == 0 and pad.refusals[0].startswith("refused")
    pad.wait(0.3, WISH)
    assert pad.story.count("servo_move") == 0, "it begins by itself when the arm can move again"


def test_a_tool_that_stands_is_logged_once_with_its_reason_and_said_no_more_when_it_is_let_go():
    pad, out = Pad(), (0.2, 0.0, 0.0, 0.0, 0.0, 0.0)
    pad.wait(0.1, REST)
    core, told = pad.story.core, []
    for _ in range(400):
        pad.say(out, JogFrame.BASE)
        sent = pad.frames()
        if sent:
            pad.story.joints = [math.radians(q) for q in sent[-1][1]]
        pad.story.run(PERIOD)
        told.append(core.velocity_jog.obstacle)
    assert told[0] == "" and told[-1]
    assert [line for line in pad.story.log if "the tool stands" in line] == [
        "velocity jog: the tool stands: " + told[-1]]
    pad.wait(0.5)
    assert core.velocity_jog.obstacle == ""


def test_a_call_of_power_lets_go():
    pad = Pad().jogging()
    pad.story.core.note_disturbance("a call of power")
    pad.wait(0.2, WISH)
    assert pad.speed() == 0.0 and "a call of power" in pad.refusals[-1]


def test_the_driver_that_ends_stops_it():
    pad = Pad().jogging()
    pad.story.core.close(pad.story.now)
    pad.story.perform()
    pad.story.run(0.3)
    count = len(pad.frames())
    pad.wait(0.1, REST).wait(0.1, WISH)
    assert pad.story.count("stop_program") == 1 and len(pad.frames()) == count
    assert "shutting down" in pad.refusals[0]


def test_the_speed_override_slows_it():
    pad = Pad().wait(0.1, REST, rapidrate=0.5).wait(0.4, WISH, rapidrate=0.5)
    assert pad.speed() == pytest.approx(0.5 * SPEED)


def test_nothing_is_told_about_a_stop_that_was_asked_for():
    pad = Pad().jogging()
    pad.story.core.stop("stop", pad.story.now)
    pad.wait(0.3)
    assert pad.story.cause("stop") is None
    assert StopCause.STOPPED.value in " ".join(pad.story.log)


def test_a_program_of_the_pendant_is_not_joined_by_a_jog():
    pad = Pad().wait(0.1, REST, interp_state=3).wait(0.1, WISH, interp_state=3)
    assert "a program of the controller's own runs" in pad.refusals[0] and not pad.frames()
