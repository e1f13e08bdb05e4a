"""The stop as one thing: whole from every sender, and seen to have worked before its caller gets success."""
import pytest
from stories import HOME, PERIOD, WHOLE_STOP, Story

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.procedures import power
from jaka_ros_driver.commands import (
    STOP_REPLY,
    Jog,
    JogFrame,
    JogStop,
    JointMove,
    SetServoMode,
    Stop,
    whole_stop,
)
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, ReplyTimeout, StopNotSeen

MOVE = JointMove((1.0,) + HOME[1:], 1.0, 1.0)
MOVING = {"inpos": False}


class Jogged(Story):
    """An arm that somebody else jogs, on a controller where ``stop_program`` ends no jog and each axis has its own end.
    """

    def __init__(self, axis, **settings):
        super().__init__(**settings)
        self.axis = axis
        self.pass_time(0.3)
        del self.sent[:]

    def _take(self, data):
        super()._take(data)
        for _, request in self.sent:
            if request["cmdName"] == "jog" and request["jog_mode"] == 0 and request["jnum"] == self.axis:
                self.axis = None

    def pass_time(self, seconds):
        """Let time pass while the jog goes on; return the seconds until it had ended."""
        began = self.now
        while self.now < began + seconds and self.axis is not None:
            self.joints[self.axis] += 0.3 * PERIOD
            self.run(PERIOD, **MOVING)
        ended = self.now - began
        self.run(seconds - ended)
        return ended


def under_way(**settings):
    story = Story(**settings)
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, **MOVING)
    del story.sent[:]
    return story


def jog_stops(story):
    return [(request["coord_map"], request["jnum"]) for _, request in story.sent
            if request["cmdName"] == "jog" and request["jog_mode"] == 0]


# ---- what it is ----

def test_it_leaves_servo_mode_and_stops_programs_and_jogs_and_its_word_is_that_of_stop_program():
    commands = whole_stop(None)
    assert commands[0] == SetServoMode(False) and commands[STOP_REPLY] == Stop()
    assert {(one.frame, one.axis) for one in commands[2:]} == {(JogFrame.JOINT, axis) for axis in range(6)}


def test_of_a_jog_that_is_known_it_stops_that_one_and_all_where_the_arm_moves_on():
    known = JogStop(JogFrame.TOOL, 2)
    assert whole_stop(known)[2:] == (known,)
    for jog in (None, known):
        assert {(one.frame, one.axis) for one in whole_stop(jog, is_repeated=True)[2:]} == {
            (frame, axis) for frame in JogFrame for axis in range(6)}


@pytest.mark.parametrize("refused", ["servo_move", "jog"])
def test_the_refusal_of_a_part_that_has_nothing_to_end_is_no_failure(refused):
    story = under_way()
    story.replies[refused] = "2"
    story.core.stop("stop", story.now)
    story.perform()
    assert story.error("stop") is None
    assert story.run(0.3).core.is_free
    story.core.stop("again", story.now)
    assert story.run(0.1).error("again") is None


def test_a_second_stop_that_is_refused_when_the_first_was_accepted_is_not_sent_again():
    story = under_way()
    story.replies["stop_program"] = None
    story.core.stop("first", story.now)
    story.core.stop("second", story.now)
    story.perform()
    story.reply("stop_program")
    story.reply("stop_program", "2")
    story.run(0.2, move=1.0)
    assert story.error("first") is None and isinstance(story.error("second"), CommandRejected)
    assert story.count("stop_program") == 2


# ---- from whom ----

def owed(story):
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.perform()
    del story.sent[:]
    story.core.opened(Port.COMMAND, story.now)


@pytest.mark.parametrize("stop", [
    lambda story: story.core.stop("stop", story.now), lambda story: story.core.close(story.now), owed,
    lambda story: story.core.run("off", power.set_power(story.core, False), story.now),
    lambda story: story.core.run("off", power.set_enabled(story.core, False), story.now)],
    ids=["stop_move", "shut-down", "a link that comes back", "power off", "disable"])
def test_in_custody_every_stop_is_the_whole_of_it(stop):
    story = under_way()
    stop(story)
    story.perform()
    assert story.names()[:8] == WHOLE_STOP


@pytest.mark.parametrize("stop", [
    lambda story: story.core.stop("stop", story.now),
    lambda story: story.core.run("off", power.set_power(story.core, False), story.now),
    lambda story: story.core.run("off", power.set_enabled(story.core, False), story.now)],
    ids=["stop_move", "power off", "disable"])
def test_without_custody_every_stop_is_the_whole_of_it(stop):
    story = Story()
    story.run(0.2, move=1.0, **MOVING)
    del story.sent[:]
    stop(story)
    story.perform()
    assert story.names()[:8] == WHOLE_STOP


@pytest.mark.parametrize("fields", [{"inpos": True}, {"inpos": True, "interp_state": 3}])
def test_drives_are_not_switched_off_before_a_stop_where_only_a_flag_says_rest(fields):
    story = Story()
    story.run(0.2, move=1.0 if "interp_state" not in fields else None, **fields)
    del story.sent[:]
    story.core.run("off", power.set_power(story.core, False), story.now)
    story.perform()
    assert story.names()[:8] == WHOLE_STOP


@pytest.mark.parametrize("axis", range(6))
def test_a_jog_of_nobodys_that_a_program_stop_does_not_end_is_ended(axis):
    story = Jogged(axis)
    story.core.stop("stop", story.now)
    story.perform()
    assert story.pass_time(2.0) < 2 * PERIOD
    assert story.error("stop") is None and story.answers["stop"][0] > story.now - 2.0


def test_a_jog_in_custody_that_its_own_end_does_not_end_is_ended_by_all():
    # It was begun by this driver, and another axis moves.
    story = Story()
    story.core.jog("jog", Jog(JogFrame.JOINT, 0, 0.3), story.now)
    story.run(0.3, move=1.0, **MOVING)
    del story.sent[:]
    story.core.stop("stop", story.now)
    story.perform()
    assert jog_stops(story) == [(1, 0)]
    story.run(0.7, move=9.0)
    assert {axis for _, axis in jog_stops(story)} == set(range(6))


def test_a_stop_that_waits_for_a_reply_asks_for_no_ticks_meanwhile():
    # The jog's own end is refused, and the controller keeps silent on stop_program.
    story = Story()
    story.core.jog("jog", Jog(JogFrame.JOINT, 0, 0.3), story.now)
    story.run(0.3, move=1.0, **MOVING)
    story.replies.update(jog="7", stop_program=None)
    story.core.stop("stop", story.now)
    story.perform()
    story.run(0.2, move=9.0)
    assert story.count("stop_program") == 1 and jog_stops(story) == [(1, 0)]
    assert story.core.next_deadline() > story.now
    story.reply("stop_program")
    story.run(2 * PERIOD, move=9.0)
    assert story.count("stop_program") == 2


# ---- seen, without custody ----

def test_the_caller_is_answered_when_the_arm_is_seen_at_rest():
    story = Story()
    story.run(0.2, move=1.0, **MOVING)
    story.core.stop("stop", story.now)
    story.run(0.2, move=1.0, **MOVING)
    assert story.error("stop") == "pending"
    story.run(0.1)
    assert story.error("stop") is None and story.count("stop_program") == 1


@pytest.mark.parametrize("age", [0.0, 0.5])
def test_an_arm_that_rests_already_is_answered_for_when_the_controller_was_asked_where_it_is(age):
    story = Story().run(age)
    story.core.stop("stop", story.now)
    story.perform()
    assert story.run(PERIOD).error("stop") == "pending"
    assert story.run(2 * PERIOD).error("stop") is None


def test_of_an_arm_that_moves_on_the_caller_is_told_in_time_and_it_is_stopped_again():
    story = Story()
    story.run(0.2, move=9.0, **MOVING)
    story.core.stop("stop", story.now)
    began = story.now
    story.run(3.2, move=9.0, **MOVING)
    at, _, error = story.answers["stop"]
    assert isinstance(error, StopNotSeen) and "moves" in str(error)
    assert at - began == pytest.approx(story.core.settings.reply_timeout, abs=2 * PERIOD)
    assert 5 <= story.count("stop_program") <= 7
    story.run(0.3)
    stops = story.count("stop_program")
    story.run(3.0, move=9.0, **MOVING)
    assert story.count("stop_program") == stops, "who moves an arm that has rested is not stopped"


@pytest.mark.parametrize("code", ["2", None])
def test_the_refusal_or_silence_that_meets_a_repeated_stop_is_not_taken_for_the_first_ones_reply(code):
    story = Story()
    story.run(0.2, move=9.0, **MOVING)
    story.core.stop("stop", story.now)
    story.run(0.4, move=9.0, **MOVING)
    story.replies["stop_program"] = code
    story.run(0.55, move=9.0, **MOVING)
    assert isinstance(story.error("stop"), StopNotSeen)
    story.run(1.2 if code else 0.1, move=9.0, **MOVING)
    assert story.count("stop_program") == (5 if code else 3)


def test_an_arm_that_somebody_else_moves_on_is_not_stopped_for_ever():
    story = Story()
    story.run(0.2, move=9.0, **MOVING)
    story.core.stop("stop", story.now)
    story.run(12.0, move=9.0, speed=0.1, **MOVING)
    stops = story.count("stop_program")
    story.run(3.0, move=9.0, speed=0.1, **MOVING)
    assert 15 <= stops <= 25 and story.count("stop_program") == stops


def test_a_program_that_runs_on_is_no_rest():
    story = Story()
    story.core.stop("stop", story.now)
    story.run(0.8, interp_state=3)
    assert story.error("stop") == "pending" and story.count("stop_program") == 2
    assert story.run(0.05, interp_state=0).error("stop") is None


def test_an_arm_that_is_guided_by_hand_is_told_of_and_not_stopped_again():
    story = Story()
    story.run(0.2, move=9.0, drag_status=True)
    story.core.stop("stop", story.now)
    story.run(2.0, move=9.0, drag_status=True)
    assert isinstance(story.error("stop"), StopNotSeen) and story.count("stop_program") == 1


def test_where_the_arm_is_not_seen_the_caller_is_told_that():
    story = Story()
    story.feed = False
    story.run(1.0)
    story.core.stop("stop", story.now)
    story.run(1.0)
    assert isinstance(story.error("stop"), StopNotSeen) and "is not known" in str(story.error("stop"))
    assert story.count("stop_program") == 1


def test_a_stop_that_is_refused_lost_or_not_answered_is_told_as_that():
    story = Story()
    story.replies["stop_program"] = "2"
    story.core.stop("refused", story.now)
    assert isinstance(story.run(0.1).error("refused"), CommandRejected)
    story.replies["stop_program"] = None
    story.core.stop("late", story.now)
    assert isinstance(story.run(1.0).error("late"), ReplyTimeout)
    story.run(0.6)
    story.connect()
    story.run(0.2)
    story.core.stop("lost", story.now)
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.perform()
    assert isinstance(story.error("lost"), ConnectionLost)


def test_a_motion_that_begins_after_the_stop_is_not_stopped_by_it():
    story = Story()
    story.core.stop("stop", story.now)
    story.core.move("next", MOVE, True, story.now)
    story.run(0.02).run(2.0, move=1.0, **MOVING)
    assert story.error("stop") is None and story.count("joint_move") == 1 and story.count("stop_program") == 1
