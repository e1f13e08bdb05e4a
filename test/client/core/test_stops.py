"""Stops: delivered at once, repeated until accepted and seen, and ending only what was asked before them."""
import math

import pytest
from stories import HOME, PERIOD, WHOLE_STOP, Story

from jaka_ros_driver.client import arm_client
from jaka_ros_driver.client.core.actions import Open, Port
from jaka_ros_driver.client.core.motion import rest_time_at
from jaka_ros_driver.client.core.procedures.recovery import recover
from jaka_ros_driver.commands import Jog, JogFrame, JointMove, LinearMove, Pose, SetEnabled
from jaka_ros_driver.errors import (
    CommandRejected,
    ConnectionLost,
    InvalidCommand,
    JakaError,
    MotionInterrupted,
    ReplyTimeout,
    StopCause,
)

MOVE = JointMove((1.0,) + HOME[1:], 1.0, 1.0)
JOG = Jog(JogFrame.JOINT, 0, 0.3)
MOVING = {"inpos": False}


def under_way(**settings):
    story = Story(**settings)
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, **MOVING)
    del story.sent[:]
    return story


def test_a_stop_is_sent_at_once_and_answered_with_the_controllers_word():
    story = under_way()
    story.core.stop("stop", story.now)
    story.perform()
    assert story.names() == WHOLE_STOP
    assert story.error("stop") is None and story.cause("move") is StopCause.STOPPED
    assert not story.core.is_free
    assert story.run(0.2).core.is_free


def test_custody_is_kept_while_the_arm_coasts():
    story = under_way()
    story.core.stop("stop", story.now)
    story.run(0.3, move=1.0)
    assert not story.core.is_free and story.told == [True]
    assert story.run(0.15).core.is_free


def test_a_stop_that_is_accepted_and_not_obeyed_is_sent_again():
    story = under_way()
    story.core.stop("stop", story.now)
    story.run(1.2, move=1.0)
    assert story.count("stop_program") >= 2 and not story.core.is_free


def test_the_repeated_stop_of_an_arm_that_moves_on_is_owed_as_the_first_one_was():
    story = under_way()
    story.core.stop("stop", story.now)
    story.perform()
    story.replies["stop_program"] = "2"
    story.run(0.7, move=9.0)
    assert story.count("stop_program") >= 4, "a repeated stop that is refused is sent again at once"
    story.run(0.3)
    assert not story.core.is_free, "rest is no end while the last stop is refused"
    story.core.closed(Port.COMMAND, "cut", story.now)
    del story.sent[:]
    story.replies.clear()
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    assert story.names()[:2] == ["servo_move", "stop_program"]
    assert story.run(0.9).core.is_free


@pytest.mark.parametrize("motion", [
    lambda story: story.core.move("slow", JointMove((1.0,) + HOME[1:], 0.002, 1.0), True, story.now),
    lambda story: story.core.jog("slow", Jog(JogFrame.JOINT, 0, 0.002), story.now)])
def test_a_motion_so_slow_that_it_looks_like_rest_is_kept_in_custody_until_it_rests(motion):
    story = Story()
    motion(story)
    story.run(1.2, move=9.0, speed=0.002, **MOVING)
    story.core.stop("stop", story.now)
    story.run(0.4, move=9.0, speed=0.002)
    assert story.error("stop") is None and not story.core.is_free
    assert story.run(0.4).core.is_free


def test_a_refused_stop_is_told_and_repeated_until_it_is_accepted():
    story = under_way()
    story.replies["stop_program"] = "2"
    story.core.stop("stop", story.now)
    story.perform()
    assert isinstance(story.error("stop"), CommandRejected) and story.error("move") == "pending"
    story.run(0.5, move=1.0)
    assert story.count("stop_program") >= 5 and not story.core.is_free
    story.replies["stop_program"] = "0"
    story.run(0.1)
    assert story.cause("move") is StopCause.STOPPED
    assert story.run(0.9).core.is_free


def test_who_waits_for_a_motion_that_cannot_be_stopped_is_told_within_a_second():
    story = under_way()
    story.replies["stop_program"] = "2"
    story.core.stop("stop", story.now)
    assert story.run(1.1, move=1.0).cause("move") is StopCause.TIMEOUT
    assert not story.core.is_free


def test_a_move_asked_for_after_the_stop_begins_when_the_arm_rests():
    story = under_way()
    story.core.stop("stop", story.now)
    story.core.move("next", MOVE, True, story.now)
    story.run(0.2, move=1.0)
    assert story.count("joint_move") == 0 and story.error("next") == "pending"
    story.run(0.15)
    assert story.count("joint_move") == 1 and story.error("next") == "pending"


def test_a_stop_ends_what_waits_for_the_arm_to_rest():
    story = under_way()
    story.core.stop("stop", story.now)
    story.core.move("next", MOVE, True, story.now)
    story.core.stop("again", story.now)
    story.perform()
    assert story.cause("next") is StopCause.STOPPED
    story.run(1.0)
    assert story.count("joint_move") == 0


def test_both_replies_in_one_segment_end_the_right_motion():
    story = Story()
    story.replies["stop_program"] = story.replies["joint_move"] = None
    story.core.stop("stop", story.now)
    story.core.move("move", MOVE, True, story.now)
    story.perform()
    assert story.names()[-8:] == WHOLE_STOP
    story.reply("stop_program")
    assert story.names()[-1] == "joint_move"
    story.reply("joint_move")
    story.run(0.2, move=1.0, **MOVING)
    assert story.error("stop") is None and story.error("move") == "pending" and not story.core.is_free


@pytest.mark.parametrize("lost", [Port.COMMAND, Port.STATUS])
def test_a_lost_link_stops_the_arm_and_keeps_it_in_custody(lost):
    story = under_way()
    story.feed = lost is Port.COMMAND
    story.core.closed(lost, "cut", story.now)
    story.perform()
    assert story.cause("move") is StopCause.LINK_LOST
    story.run(0.3, move=1.0)
    assert not story.core.is_free and any(action == Open(lost) for _, action in story.asked_to_connect)
    del story.sent[:]
    story.core.opened(lost, story.now)
    story.perform()
    if lost is Port.COMMAND:
        assert story.names()[:8] == WHOLE_STOP
    story.feed = True
    story.run(0.9)
    assert story.core.is_free


def test_a_feed_of_which_nothing_can_be_read_is_as_good_as_none():
    story = under_way()
    story.run(1.0, move=1.0, joint_actual_position="x")
    assert story.count("stop_program") == 1 and story.cause("move") is StopCause.LINK_LOST
    assert not story.core.is_free


def test_a_driver_that_was_held_up_stops_what_it_moves_and_shows_nothing_old():
    story = under_way()
    story.now += 30.0
    shown = len(story.shown)
    for _ in range(200):
        story.frame()
    story.core.tick(story.now)
    story.perform()
    assert not any(show.is_new for show in story.shown[shown:])
    assert story.count("stop_program") == 1 and story.cause("move") is StopCause.LINK_LOST


def test_a_jog_is_stopped_on_time_while_the_feed_is_dark():
    story = Story(jog_timeout=1.0)
    story.core.jog("jog", JOG, story.now)
    story.run(0.3, move=1.0)
    story.feed = False
    story.run(0.9)
    assert story.count("stop_program") >= 1 and not story.core.is_free


@pytest.mark.parametrize("fields", [{"inpos": True}, {"errcode": "0x020033"}, {"inpos": False}])
def test_a_jog_lasts_as_long_as_it_is_called_for(fields):
    story = Story(jog_timeout=0.5)
    for turn in range(5):
        story.core.jog(turn, JOG, story.now)
        story.run(0.3, move=9.0, **fields)
    assert story.count("jog") == 1 and story.count("stop_program") == 0
    story.run(0.3, move=9.0, **fields)
    assert [request.get("jog_mode") for _, request in story.sent if request["cmdName"] == "jog"] == [1, 0]
    assert story.count("stop_program") == 1 and not story.core.is_free
    assert story.run(0.3).core.is_free


@pytest.mark.parametrize("frame, axis", [(JogFrame.JOINT, 0), (JogFrame.JOINT, 5), (JogFrame.TOOL, 2)])
def test_the_jog_that_was_begun_is_the_one_that_is_ended(frame, axis):
    story = Story()
    story.core.jog("jog", Jog(frame, axis, 0.03), story.now)
    story.run(0.3, move=1.0, **MOVING)
    story.core.stop("stop", story.now)
    story.perform()
    begun, ended = [request for _, request in story.sent if request["cmdName"] == "jog"]
    assert (begun["jog_mode"], ended["jog_mode"]) == (1, 0)
    assert all(begun[key] == ended[key] for key in ("coord_map", "jnum")) and begun["jnum"] == axis


def test_the_reply_to_the_stop_of_one_motion_says_nothing_of_the_next_ones_stop():
    story = under_way()
    story.replies["stop_program"] = None
    for call in ("first", "second"):
        story.core.stop(call, story.now)
    story.perform()
    story.reply("stop_program")
    assert story.run(0.2).core.is_free
    story.core.move("next", JointMove(HOME, 1.0, 1.0), True, story.now)
    story.run(0.1, move=0.0, **MOVING)
    story.core.stop("third", story.now)
    story.perform()
    story.reply("stop_program")
    assert story.error("second") is None and story.error("third") == "pending"
    story.run(0.2)
    assert story.error("next") == "pending" and not story.core.is_free
    story.reply("stop_program")
    assert story.run(0.2).cause("next") is StopCause.STOPPED and story.core.is_free


def test_a_jog_that_somebody_else_ended_can_be_begun_anew():
    story = Story()
    story.core.jog("first", JOG, story.now)
    story.run(0.8, move=0.2, **MOVING).run(1.2)
    assert story.core.is_free and story.count("stop_program") == 1
    story.core.jog("second", JOG, story.now)
    story.perform()
    assert story.error("second") is None and story.names()[-1] == "jog"


def test_without_a_link_a_stop_fails_and_is_owed():
    story = under_way()
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.core.stop("stop", story.now)
    story.perform()
    assert isinstance(story.error("stop"), ConnectionLost)
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    assert story.names()[:8] == WHOLE_STOP


def test_closing_answers_every_call_and_stops_the_arm():
    story = under_way()
    story.core.close(story.now)
    story.perform()
    assert story.names() == WHOLE_STOP and story.cause("move") is StopCause.SHUTDOWN
    story.core.move("late", MOVE, True, story.now)
    story.perform()
    assert isinstance(story.error("late"), (ConnectionLost, MotionInterrupted))
    assert story.run(0.2).core.is_free


def test_the_caller_of_a_stop_does_not_wait_for_a_slow_command_before_it():
    story = under_way()
    story.replies.update(disable_robot=None, stop_program=None)
    story.core.channel.request(SetEnabled(False), story.now, lambda *_: None)
    story.core.stop("stop", story.now)
    story.perform()
    story.run(0.8, move=0.5)
    assert story.error("stop") == "pending"
    story.run(0.2, move=0.5)
    assert isinstance(story.error("stop"), ReplyTimeout) and not story.core.is_free


def test_a_stop_that_is_refused_after_a_lost_link_is_repeated_on_the_next_one():
    # One was on its way when the link went down; its reply will never come, and holds nothing back.
    story = Story()
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, inpos=False)
    story.replies["stop_program"] = None
    story.core.stop("stop", story.now)
    story.run(0.1, move=1.0, inpos=False)
    story.core.closed(Port.COMMAND, "closed by the controller", story.now)
    story.run(0.3, move=1.0, inpos=False)
    story.core.opened(Port.COMMAND, story.now)
    before = story.count("stop_program")
    story.replies["stop_program"] = "2"
    story.perform()
    story.run(1.0, move=10.0, inpos=False)
    assert story.count("stop_program") > before + 3


STILL_IN_SERVO_MODE = {"is_in_servomove": {"in_servomove": True}}


def test_the_next_motion_waits_until_a_stop_has_ended_servo_mode_and_the_stops_caller_does_not():
    story = Story()
    story.core.servo_mode("servo", True, story.now)
    story.run(0.2)
    story.extra.update(STILL_IN_SERVO_MODE)
    story.core.stop("stop", story.now)
    story.perform()
    assert story.error("stop") is None
    story.core.move("next", MOVE, True, story.now)
    assert story.run(0.3).count("joint_move") == 0 and story.count("stop_program") == 1
    story.extra.clear()
    assert story.run(0.05).count("joint_move") == 1


def test_servo_mode_that_a_stop_does_not_end_is_stopped_again_and_holds_custody_for_two_seconds():
    story = Story()
    story.core.servo_mode("servo", True, story.now)
    story.run(0.2)
    story.extra.update(STILL_IN_SERVO_MODE)
    story.core.stop("stop", story.now)
    story.core.move("next", MOVE, True, story.now)
    story.run(1.9)
    assert not story.core.is_free and story.count("stop_program") >= 3
    story.run(0.8)
    assert story.core.is_free and isinstance(story.error("next"), JakaError) and story.count("joint_move") == 0


def test_a_stop_of_an_arm_that_this_driver_does_not_move_sees_servo_mode_end():
    story = Story()
    story.extra.update(STILL_IN_SERVO_MODE)
    story.core.stop("stop", story.now)
    story.run(0.2)
    assert story.error("stop") is None
    story.core.move("next", MOVE, True, story.now)
    assert story.run(0.2).count("joint_move") == 0
    story.extra.clear()
    assert story.run(0.05).count("joint_move") == 1


def test_an_arm_that_somebody_else_moves_on_is_stopped_again_each_half_second_for_ten():
    story = Story()
    story.run(0.3, move=50.0, **MOVING)
    story.core.stop("stop", story.now)
    begun = story.now
    story.perform()
    story.run(14.0, move=50.0, **MOVING)
    assert isinstance(story.error("stop"), JakaError)
    times = [at - begun for at, request in story.sent if request["cmdName"] == "stop_program"]
    assert 9.5 <= times[-1] <= 11.5
    assert all(0.4 <= later - sooner <= 0.7 for sooner, later in zip(times, times[1:])), times


def test_the_end_of_a_jog_that_is_refused_is_sent_again_until_the_arm_rests():
    story = Story()
    story.core.jog("jog", JOG, story.now)
    story.run(0.3, move=1.0, **MOVING)
    del story.sent[:]
    story.replies["jog"] = "1"
    story.core.stop("stop", story.now)
    story.run(0.2, move=1.0, **MOVING)
    assert story.error("stop") is None and 3 <= story.count("stop_program") <= 4 and not story.core.is_free
    story.run(0.2)
    assert story.core.is_free


def test_a_retry_that_is_due_on_a_lost_link_asks_for_no_ticks_without_end():
    story = under_way()
    story.replies["stop_program"] = "1"
    story.core.stop("stop", story.now)
    story.perform()
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.run(0.1, move=1.0)
    assert story.core.custody.deadline > story.now


# ---- an arm that creeps on ----

def refused(story):
    story.replies["stop_program"] = "2"
    story.core.stop("stop", story.now)
    story.perform()
    story.run(0.1, move=9.0, speed=0.5, inpos=False)
    story.replies.clear()


def out_of_sight(story):
    story.core.closed(Port.STATUS, "cut", story.now)
    story.perform()
    story.core.opened(Port.STATUS, story.now)
    story.perform()


DOUBTS = [
    lambda story: story.run(PERIOD, protective_stop=1), lambda story: story.run(PERIOD, errcode="0xf0017"),
    lambda story: story.run(PERIOD, enabled=False), refused, out_of_sight,
    lambda story: (story.core.stop("stop", story.now), story.perform(), out_of_sight(story)),
    lambda story: (story.core.closed(Port.COMMAND, "cut", story.now), story.perform(), story.run(PERIOD),
                   story.core.opened(Port.COMMAND, story.now), story.perform())]
"""Stops of a motion for another reason than that it has come to its end, or that a call has asked for it."""


@pytest.mark.parametrize("speed", [0.0005, 0.001, 0.002])
@pytest.mark.parametrize("doubt", DOUBTS, ids=["protective stop", "fault", "disabled", "refused", "unseen",
                                               "unseen in a stop", "without a link"])
def test_an_arm_that_creeps_on_behind_a_stop_in_doubt_stays_in_custody_and_is_stopped_again(doubt, speed):
    story = Story()
    story.core.move("move", JointMove((2.0,) + HOME[1:], 1.0, 1.0), False, story.now, "end")
    story.perform()
    story.run(0.3, move=2.0, inpos=False)
    doubt(story)
    for _ in range(500):
        story.run(PERIOD, move=9.0, speed=speed, inpos=False)
        assert not story.core.is_free
    assert story.count("stop_program") >= 3
    story.run(1.0)
    assert story.core.is_free and isinstance(story.error("end"), MotionInterrupted)


def test_after_a_stop_that_was_asked_for_and_obeyed_the_next_motion_does_not_wait_for_long():
    story = Story()
    story.core.move("move", JointMove((2.0,) + HOME[1:], 1.0, 1.0), False, story.now)
    story.perform()
    story.run(0.3, move=2.0, inpos=False)
    story.core.stop("stop", story.now)
    story.perform()
    story.run(0.15)
    assert story.core.is_free


REFUSED = {
    "jog": lambda story, speed: story.core.jog("motion", Jog(JogFrame.JOINT, 0, speed), story.now),
    "joint_move": lambda story, speed: story.core.move("motion", JointMove((1.0,) + HOME[1:], speed, 1.0), False,
                                                       story.now),
    "moveL": lambda story, speed: story.core.move(
        "motion", LinearMove(Pose((0.45, 0.1, 0.3), (math.pi, 0.0, 0.0)), speed, 1.0), False, story.now),
}


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("speed", [0.0005, 0.001, 0.002])
def test_a_refused_motion_that_creeps_on_is_stopped(name, speed):
    story = Story()
    story.replies[name] = "2"
    REFUSED[name](story, speed)
    story.perform()
    story.run(1.2, move=9.0, speed=speed, inpos=False)
    assert story.count(name) >= 1 and story.count("stop_program") >= 1


def test_a_fast_move_that_is_queued_does_not_shorten_the_rest_of_a_slow_one():
    story = Story()
    for speed in (0.001, 1.0):
        story.core.move(speed, JointMove((1.0,) + HOME[1:], speed, 1.0), False, story.now)
        story.perform()
    assert story.core.custody.motion.rest_time == pytest.approx(rest_time_at(0.001, False))


# ---- the time that rest takes after a stop in doubt ----

def stopped_in_doubt(coasting, ask):
    """Return a story after a protective stop within a move, ``ask``, and ``coasting`` s of braking."""
    story = under_way()
    story.run(PERIOD, protective_stop=1).run(PERIOD, move=9.0, speed=0.2, **MOVING)
    ask(story)
    story.perform()
    return story.run(coasting, move=9.0, speed=0.2, **MOVING)


def test_a_shut_down_after_a_stop_in_doubt_waits_long_enough_for_rest():
    story = stopped_in_doubt(0.3, lambda story: story.core.close(story.now))
    story.run(arm_client._REST_TIMEOUT_S - 0.3)
    assert story.core.is_free


def test_a_motion_asked_for_after_a_stop_in_doubt_waits_long_enough_for_rest():
    story = stopped_in_doubt(0.75, lambda story: story.core.move("next", MOVE, False, story.now)).run(1.5)
    assert story.error("next") is None


def test_a_recovery_asked_for_after_a_stop_in_doubt_waits_long_enough_for_rest():
    def stays(story):
        story.fields["protective_stop"] = 1
        story.run(PERIOD)
        story.core.run("next", recover(story.core), story.now)
    story = stopped_in_doubt(0.75, stays).run(1.0)
    assert story.count("clear_error") == 1 and story.error("next") == "pending"


# ---- a jog that waits for the arm ----

def stops_after(story, began):
    """Return how long after ``began``, s, each stop went out that followed the jog's own begin."""
    begin = next(n for n, (_, request) in enumerate(story.sent)
                 if request["cmdName"] == "jog" and request["jog_mode"] == 1)
    return [at - began for at, request in story.sent[begin:] if request["cmdName"] == "stop_program"]


@pytest.mark.parametrize("calls", [(0.0,), (0.0, 0.2, 0.4), (0.0, 0.2, 2.0)])
def test_a_jog_that_waited_for_the_arm_is_stopped_its_time_after_the_last_call_too(calls):
    story = under_way()
    story.core.stop("stop", story.now)
    story.perform()
    began = story.now
    for n in range(300):  # the arm coasts for 0.45 s
        if [call for call in calls if n * PERIOD <= call < (n + 1) * PERIOD]:
            story.core.jog(("jog", n), JOG, story.now)
            story.perform()
        story.run(PERIOD, move=2.0, speed=0.1 if n < 56 else 0.0 if n < 75 else 0.3, **MOVING)
    story.run(3.0, move=9.0, speed=0.3, **MOVING)
    assert stops_after(story, began)[0] == pytest.approx(calls[-1] + 3.0, abs=0.05)


def test_a_jog_whose_time_is_over_when_the_arm_rests_does_not_begin():
    story = under_way(jog_timeout=0.4)
    story.core.stop("stop", story.now)
    story.perform()
    story.core.jog("jog", JOG, story.now)
    story.perform()
    story.run(0.45, move=2.0, speed=0.1, **MOVING).run(0.3)
    assert isinstance(story.error("jog"), InvalidCommand)
    assert not [request for _, request in story.sent if request["cmdName"] == "jog" and request["jog_mode"] == 1]
