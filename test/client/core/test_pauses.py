"""Motions that are paused by a call: whoever ends the pause, it has an end; and what the call answers is true."""
import math

import pytest
from stories import HOME, Story
from test_trajectory_stories import following, moves, to

from jaka_ros_driver.client.core.procedures.pausing import pause, resume
from jaka_ros_driver.commands import JointMove
from jaka_ros_driver.errors import InvalidCommand, StopCause

MOVING = {"inpos": False}
KINDS = ("move", "path")


def asked(story, call, procedure):
    story.core.run(call, procedure(story.core), story.now)
    story.perform()
    return story


def paused(kind, motion_timeout=60.0, shows=True):
    """Return a motion to 1 rad that is paused by a call on its way; ``shows``: the feed shows pauses."""
    story = Story(motion_timeout=motion_timeout)
    story.extra = {"kine_inverse": {"jointPosition": [math.degrees(q) for q in HOME]},
                   "kine_forward": {"cartPosition": story.tcp}}
    story.fields["paused"] = False
    command = JointMove((1.0,) + HOME[1:], 0.5, 1.0)
    if kind == "move":
        story.core.move("end", command, True, story.now)
    else:
        story.core.move_path("end", (command,), lambda: False, lambda: None, story.now)
    story.perform()
    story.run(0.6, move=1.0, **MOVING)
    asked(story, "pause", pause).fields["paused"] = shows
    story.run(1.0, **MOVING)
    assert story.error("end") == "pending" and (story.error("pause") is None or not shows)
    return story


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_was_paused_by_a_call_and_resumed_at_the_pendant_is_completed(kind):
    story = paused(kind)
    story.fields["paused"] = False
    story.run(2.0, move=1.0, **MOVING).run(1.5)
    assert story.error("end") is None and story.core.is_free


@pytest.mark.parametrize("kind", KINDS)
def test_rest_on_the_way_ends_a_motion_that_was_resumed_at_the_pendant(kind):
    story = paused(kind)
    story.fields["paused"] = False
    story.run(0.3, move=1.0, **MOVING).run(1.5)
    assert story.cause("end") is StopCause.STOPPED and story.core.is_free and story.count("stop_program") == 1


@pytest.mark.parametrize("kind", KINDS)
def test_the_time_of_a_motion_that_was_resumed_at_the_pendant_runs_on(kind):
    story = paused(kind, motion_timeout=4.0).run(20.0, **MOVING)
    story.fields["paused"] = False
    story.run(5.0, move=9.0, speed=0.02, **MOVING).run(0.5)
    assert story.cause("end") is StopCause.TIMEOUT


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_was_resumed_at_the_pendant_cannot_be_resumed(kind):
    story = paused(kind)
    story.fields["paused"] = False
    asked(story.run(0.3, move=1.0, **MOVING), "resume", resume)
    assert isinstance(story.error("resume"), InvalidCommand) and story.count("resume_program") == 0


@pytest.mark.parametrize("kind", KINDS)
def test_two_frames_without_the_pause_do_not_end_it(kind):
    story = paused(kind)
    story.run(0.016, paused=False, **MOVING).run(20.0, **MOVING)
    assert asked(story, "resume", resume).error("resume") is None and story.error("end") == "pending"
    assert story.core.custody.motion.deadline > story.now + 50.0, "the time limit has waited"


@pytest.mark.parametrize("kind", KINDS)
def test_the_time_of_a_pause_by_a_call_does_not_count(kind):
    story = asked(paused(kind, motion_timeout=4.0).run(20.0, **MOVING), "resume", resume)
    story.run(0.05, **MOVING).fields["paused"] = False
    story.run(1.6, move=9.0, speed=0.1, **MOVING)
    assert story.error("end") == "pending" and story.count("stop_program") == 0, "of its 4 s it has used 2.5"
    assert story.run(2.0, move=9.0, speed=0.1, **MOVING).run(0.5).cause("end") is StopCause.TIMEOUT


@pytest.mark.parametrize("kind", KINDS)
def test_a_pause_that_the_feed_never_shows_fails_and_rest_ends_the_motion_as_without_it(kind):
    story = paused(kind, shows=False).run(1.5, **MOVING)
    assert story.cause("end") is StopCause.STOPPED and isinstance(story.error("pause"), InvalidCommand)


def trembling():
    """Return a trajectory that a call has paused, and whose arm was not seen at rest."""
    story = asked(following(to(1.5, 1.0)).run(0.7), "pause", pause).run(0.1)
    story.is_held = True
    for number in range(300):
        story.joints[0] += 3e-4 if number // 4 % 2 else -3e-4
        story.run(0.008)
    story.is_held = False
    return story


def test_a_trajectory_that_was_not_seen_at_rest_in_its_pause_is_held_and_said_to_be():
    story = trembling()
    assert story.cause("pause") is StopCause.TIMEOUT and "trajectory is held" in str(story.error("pause"))
    assert "goes on with it" in str(story.error("pause"))
    story.run(5.0)
    assert max(map(abs, moves(story)[-100:])) == 0.0 and story.error("goal") == "pending"
    assert asked(story, "resume", resume).run(1.6).error("goal") is None and story.error("resume") is None


def test_a_pause_that_was_refused_does_not_hold_the_trajectory_that_takes_over():
    story = following(to(1.5, 1.0)).run(0.7)
    asked(story, "pause", pause).run(0.016)
    assert story.core.cancel_trajectory("goal", story.now)
    story.run(0.016)
    assert isinstance(story.error("pause"), InvalidCommand), "it has ended"
    story.follow("next", (to(2.0, 0.5),))
    assert story.run(3.0).error("next") is None
