"""Servo mode: entered when the controller confirms it, one frame a cycle, ended by whatever goes wrong."""
import math

import pytest
from stories import HOME, PERIOD, Story

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.commands import ServoJoint
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, StopCause
from jaka_ros_driver.state import MotionState


def streaming(**settings):
    """Return a story in servo mode, held where the arm is."""
    story = Story(**settings)
    story.core.servo_mode("servo", True, story.now)
    story.perform()
    story.run(0.2)
    assert story.error("servo") is None
    del story.sent[:]
    return story


def frames(story):
    return [request["jointPosition"] for _, request in story.sent if request["cmdName"] == "servo_j"]


def without_stop(story):
    return story.count("stop_program") == 0 and not story.core.is_free


def test_the_stream_begins_where_the_arm_is_with_one_frame_a_cycle():
    story = streaming().run(1.0)
    assert len(frames(story)) == pytest.approx(1.0 / PERIOD, abs=1)
    for frame in frames(story):
        assert frame == pytest.approx([math.degrees(q) for q in HOME], abs=1e-9)
    assert without_stop(story)


@pytest.mark.parametrize("period", [1, 4, 8])
def test_a_steady_stream_moves_until_the_arm_rests_whatever_the_controller_says_between_its_frames(period):
    """Stream 0.05 rad/s with a target every ``period`` cycles, to a controller that is in position now and then."""
    story, seen = streaming(), []

    def shown():
        is_moving = story.core.is_stream_moving
        return is_moving, story.core.state.shown_motion_state(is_moving)
    assert shown() == (False, MotionState.STOPPED)
    for cycle in range(250):
        if cycle % period == 0:
            target = HOME[0] + 0.05 * PERIOD * (cycle + period)
            story.core.set_servo_target(ServoJoint((target,) + HOME[1:]), story.now)
        story.run(PERIOD, move=target, speed=0.1, inpos=cycle % 3 != 0)
        seen.append(shown())
    assert set(seen[2:]) == {(True, MotionState.RUNNING)}
    for _ in range(40):
        story.run(PERIOD, inpos=story.now % 0.024 > 0.01)
        seen.append(shown())
    assert seen[-1] == (False, MotionState.STOPPED), "a held stream is at rest"
    assert sum(one != other for one, other in zip(seen[2:], seen[3:])) == 1, "it ends once"
    story.core.stop("stop", story.now)
    story.run(0.2)
    assert story.core.is_stream_moving is None


@pytest.mark.parametrize("away, begins_at", [(0.01, 0.01), (0.2, 0.0)])
def test_the_stream_begins_at_the_commanded_joints_where_the_arm_is_near_them(away, begins_at):
    story = Story()
    story.fields["joint_position"] = [math.degrees(q + away) for q in HOME]
    story.run(0.1)
    story.core.servo_mode("servo", True, story.now)
    story.run(0.1)
    assert frames(story)[0] == pytest.approx([math.degrees(q + begins_at) for q in HOME], abs=1e-9)


@pytest.mark.parametrize("away, is_stopped", [(0.0, False), (0.015, False), (-0.03, True), (0.6, True)])
def test_an_arm_that_is_seen_elsewhere_before_the_first_frame_is_sent_none(away, is_stopped):
    # A status frame of when the arm still moved may come late, or twice, just then.
    story = Story()
    story.replies["is_in_servomove"] = None
    story.core.servo_mode("servo", True, story.now)
    story.perform()
    story.joints[0] += away
    story.run(PERIOD)
    story.joints[0] -= away
    story.reply("is_in_servomove")
    story.replies.pop("is_in_servomove")
    story.run(0.05)
    assert (not frames(story)) is is_stopped and without_stop(story) is not is_stopped
    assert not is_stopped or "0.%03d rad from where" % (1000 * abs(away)) in str(story.error("servo"))


@pytest.mark.parametrize("ms", [0, 1, 3, 5.5, 7, 8])
def test_frames_begin_within_a_cycle_and_fall_between_two_status_frames_whenever_servo_mode_is_confirmed(ms):
    story = Story()
    story.replies["is_in_servomove"] = None
    story.core.servo_mode("servo", True, story.now)
    story.perform()
    story.run(PERIOD)
    status_at = story.now
    story.now += ms / 1000.0
    story.reply("is_in_servomove")
    confirmed_at = story.now
    while not frames(story):
        story.core.tick(story.now)
        story.perform()
        story.now += 0.00025
    assert story.sent[-1][0] - confirmed_at <= PERIOD
    assert (story.sent[-1][0] - status_at) % PERIOD == pytest.approx(0.006, abs=0.0003)


def test_servo_mode_that_the_controller_does_not_confirm_is_not_entered_and_the_arm_stopped():
    story = Story()
    story.replies["servo_move"] = None
    story.core.servo_mode("servo", True, story.now)
    story.perform()
    story.reply("servo_move")
    story.run(1.9)
    assert story.error("servo") == "pending" and not frames(story)
    story.replies["servo_move"] = "0"
    story.run(0.4)
    assert story.cause("servo") is StopCause.TIMEOUT and story.count("stop_program") == 1 and not frames(story)


def test_servo_mode_that_is_refused_leaves_the_arm_free():
    story = Story()
    story.replies["servo_move"] = "2"
    story.core.servo_mode("servo", True, story.now)
    story.perform()
    assert isinstance(story.error("servo"), CommandRejected)
    assert story.run(0.2).core.is_free and story.count("stop_program") == 0


def test_targets_are_followed_and_the_last_one_is_held():
    story = streaming()
    for n in range(1, 101):
        story.core.set_servo_target(ServoJoint((0.001 * n,) + HOME[1:]), story.now)
        story.run(PERIOD, move=0.001 * n)
    story.run(0.2, move=0.1)
    assert frames(story)[-1][0] == pytest.approx(math.degrees(0.1)) and without_stop(story)


def test_late_cycles_are_left_out_and_never_caught_up():
    story = streaming()
    first_due = story.core.next_deadline()
    story.now += 0.06
    story.frame()
    story.core.tick(story.now)
    story.perform()
    assert len(frames(story)) == 1 and story.core.late_servo_cycles == int((story.now - first_due) / PERIOD) == 6
    assert story.now < story.core.next_deadline() <= story.now + PERIOD


def test_a_frame_that_is_sent_when_the_next_one_falls_due_is_sent_alone():
    story = streaming()
    story.now = story.core.next_deadline() + PERIOD
    story.core.tick(story.now)
    story.perform()
    assert len(frames(story)) == 1


@pytest.mark.parametrize("held_up, goes_on", [(0.4, True), (0.6, False)])
def test_a_driver_that_stood_still_for_longer_than_state_is_believed_sends_no_frame_but_a_stop(held_up, goes_on):
    story = streaming().run(0.1)
    del story.sent[:]
    story.now += held_up
    story.core.tick(story.now)
    story.perform()
    assert bool(frames(story)) is goes_on and (story.count("stop_program") == 0) is goes_on


def test_a_silent_client_leaves_servo_mode_and_the_arm_held():
    story = streaming(servo_timeout=0.5).run(0.25)
    assert without_stop(story) and story.servo_mode
    story.run(0.3)
    assert not story.servo_mode and story.core.is_free and story.count("stop_program") == 0
    with pytest.raises(InvalidCommand, match="no servo target for 0.5 s"):
        story.core.set_servo_target(ServoJoint(HOME), story.now)


def test_targets_that_are_refused_do_not_keep_servo_mode():
    story = streaming(servo_timeout=0.5)
    for _ in range(70):
        with pytest.raises(InvalidCommand):
            story.core.set_servo_target(ServoJoint((HOME[0] + 1.0,) + HOME[1:]), story.now)
        story.run(PERIOD)
    assert not story.servo_mode and story.core.is_free


def test_a_stop_leaves_servo_mode_first_and_no_frame_follows():
    story = streaming()
    story.core.stop("stop", story.now)
    story.run(0.3)
    assert story.names()[:2] == ["servo_move", "stop_program"] and not frames(story)
    assert not story.servo_mode and story.core.is_free


def test_a_frame_that_the_controller_refuses_ends_the_stream():
    story = streaming()
    story.replies["servo_j"] = "-8"
    story.run(0.3)
    assert story.count("servo_j") == 1 and story.names()[1:3] == ["servo_move", "stop_program"]


def test_an_arm_that_is_not_where_it_was_sent_is_stopped():
    story = streaming().run(0.1, move=0.03)
    assert without_stop(story)
    story.run(0.1, move=0.2)
    assert story.count("stop_program") == 1


@pytest.mark.parametrize("whose", ["the driver's", "somebody else's"])
def test_servo_mode_is_not_claimed_while_the_link_is_down(whose):
    story = streaming() if whose == "the driver's" else Story()
    story.servo_mode = True
    story.run(0.5)
    assert story.core.links.is_servo_active
    story.core.closed(Port.COMMAND, "cut", story.now)
    assert not story.core.links.is_servo_active


def test_a_controller_that_accepts_servo_mode_and_does_not_enter_it_is_told_after_two_seconds():
    story = Story()
    story.extra["is_in_servomove"] = {"in_servomove": False}
    story.core.servo_mode("servo", True, story.now)
    story.run(1.8)
    assert story.error("servo") == "pending"
    assert story.run(0.5).cause("servo") is StopCause.TIMEOUT and not frames(story)


def test_a_target_that_comes_while_the_arm_is_being_stopped_is_refused():
    story = Story()
    story.core.servo_mode("servo", True, story.now)
    story.run(0.2)
    story.replies["stop_program"] = None
    story.core.stop("stop", story.now)
    story.perform()
    count = len(frames(story))
    with pytest.raises(InvalidCommand):
        story.core.set_servo_target(ServoJoint(HOME), story.now)
    assert not story.core.is_free and len(frames(story.run(0.1))) == count


def test_only_a_servo_mode_that_was_entered_is_said_to_have_ended():
    story = Story()
    story.replies["is_in_servomove"] = None
    story.core.servo_mode("too early", True, story.now)
    story.run(0.1)
    story.core.stop("first", story.now)
    story.run(0.3)
    assert story.cause("too early") is StopCause.STOPPED
    assert not any("servo mode has ended" in text for text in story.log)
    del story.replies["is_in_servomove"]
    for _ in range(story.count("is_in_servomove")):
        story.reply("is_in_servomove")
    story.run(0.3)
    assert story.core.is_free
    story.core.servo_mode("servo", True, story.now)
    story.run(0.2)
    story.core.stop("stop", story.now)
    story.run(0.5)
    assert sum("servo mode has ended" in text for text in story.log) == 1


@pytest.mark.parametrize("wanted, words", [(True, "being entered"), (False, "being left: ")])
def test_no_target_is_taken_while_servo_mode_is_entered_or_left(wanted, words):
    story = Story() if wanted else streaming()
    story.replies["servo_move"] = None
    story.core.servo_mode("mode", wanted, story.now)
    story.perform()
    with pytest.raises(InvalidCommand, match="refused: servo mode is " + words):
        story.core.set_servo_target(ServoJoint((HOME[0] + 1e-4,) + HOME[1:]), story.now)


def test_servo_mode_that_ends_in_a_stop_is_not_said_to_have_ended_because_its_client_left():
    story = streaming()
    story.replies["servo_move"] = None
    story.core.servo_mode("leave", False, story.now)
    story.run(0.05)
    story.replies["stop_program"] = None
    story.core.stop("stop", story.now)
    story.perform()
    story.servo_mode = False
    story.reply("servo_move")  # the one to its client's request
    story.reply("stop_program")
    story.run(0.3)
    assert story.cause("leave") is StopCause.STOPPED and not any("client left" in text for text in story.log)
