"""A move or a path that is paused by a call: whoever ends its pause, it comes to an end, and in its own time."""
import math

import pytest
from stories import HOME, Story

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
def test_one_frame_without_the_pause_does_not_end_it(kind):
    story = paused(kind)
    story.run(0.008, paused=False, **MOVING).run(20.0, **MOVING)
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
