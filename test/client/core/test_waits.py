"""A request that has waited in vain is told what it waited for, and nothing else: each cause has its own words."""
import math

import pytest
from stories import HOME, Story

from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.procedures.power import set_enabled
from jaka_ros_driver.client.core.procedures.recovery import recover
from jaka_ros_driver.client.core.procedures.steps import pause
from jaka_ros_driver.commands import JointMove, LinearMove, Pose
from jaka_ros_driver.errors import InvalidCommand, MotionInterrupted, StopNotSeen

MOVE = JointMove((0.5,) + HOME[1:], 1.0, 4.0)
WAITED_S = 2.4


def lasting():
    yield pause(5.0)


def looked_at(story):
    """Have the motion guard look at a move for long, as where there are many zones."""
    def look(command, start):
        for _ in range(100_000):
            yield 1_000_000
    story.core.custody.motion_check.after_move = look
    story.core.move("long", MOVE, True, story.now)
    story.perform()


def audited(story):
    """Have a path audited whose inverse kinematics the controller does not answer yet."""
    story.replies["kine_inverse"] = None
    line = LinearMove(Pose((0.45, 0.1, 0.3), (math.pi, 0.0, 0.0)), 0.1, 1.0)
    story.core.move_path("path", (line,), lambda: False, lambda: None, story.now)
    story.perform()


def changed(owner):
    def begin(story):
        story.core.run("change", lasting(), story.now, owner)
        story.perform()
    return begin


def ending(story):
    """Stop a move, which is accepted; the arm moves on."""
    story.core.move("first", MOVE, True, story.now)
    story.perform()
    story.run(0.3, move=MOVE.joint_position[0])
    story.core.stop("stop", story.now)
    story.perform()


def refused_to_stop(story):
    """Stop a move, which the controller refuses."""
    story.replies["stop_program"] = "2"
    ending(story)


def without_an_answer_to_a_stop(story):
    story.replies["stop_program"] = None
    story.core.stop("stop", story.now)
    story.perform()


CAUSES = {
    "a look at a move": (looked_at, {}, "the motion guard's look at a move has not ended"),
    "an audit": (audited, {}, "the audit of a path has not ended"),
    "a change": (changed(MotionOwner.SETTING), {}, "a change of frames, payload or hand guiding has not ended"),
    "a sensor": (changed(MotionOwner.SENSOR), {}, "the zeroing of the force sensor has not ended"),
    "zones": (changed(MotionOwner.ZONES), {}, "a change of the zones has not ended"),
    "a program that is loaded": (changed(MotionOwner.LOADING), {}, "the loading of a program has not ended"),
    "a stop of a free arm": (without_an_answer_to_a_stop, {}, "the controller has not answered a stop"),
    "a move that is being stopped": (ending, {"move": 9.0}, "a move has not come to its end"),
    "a stop that is refused": (refused_to_stop, {"move": 9.0}, "the stop of a move has not been accepted"),
    "somebody else": (lambda story: story.run(0.2, move=9.0), {"move": 9.0},
                      "the arm has not come to rest; it moves, and not by this driver"),
}


@pytest.mark.parametrize("name", CAUSES)
def test_who_has_waited_in_vain_is_told_what_for(name):
    begin, meanwhile, words = CAUSES[name]
    story = Story(reply_timeout=3.0)  # longer than a request waits
    begin(story)
    story.core.move("move", MOVE, True, story.now)
    story.perform()
    story.run(WAITED_S, **meanwhile)
    assert isinstance(story.error("move"), InvalidCommand)
    assert str(story.error("move")) == "refused: within 2.3 s " + words


def test_a_feed_that_shows_no_rest_is_not_called_a_motion():
    story = Story()
    story.core.custody.stillness.lose_sight()
    story.core.move("move", MOVE, True, story.now)
    for _ in range(300):
        story.core.custody.stillness.lose_sight()
        story.run(0.008)
    assert str(story.error("move")) == "refused: within 2.3 s the status feed has not shown that the arm rests"


@pytest.mark.parametrize("fields, meanwhile, words", [
    ({"interp_state": 3}, {}, "its program has not ended"),
    ({}, {"move": 9.0}, "the arm has not come to rest; it moves, and not by this driver")])
def test_a_stop_that_is_accepted_and_ends_nothing_is_told_what_goes_on(fields, meanwhile, words):
    story = Story()
    story.fields.update(fields)
    story.run(0.1, **meanwhile)
    story.core.stop("stop", story.now)
    story.run(2.0, **meanwhile)
    assert isinstance(story.error("stop"), StopNotSeen)
    assert str(story.error("stop")).endswith("the controller accepted the stop, and within 0.9 s " + words)


def test_an_arm_that_does_not_come_to_rest_is_neither_recovered_nor_disabled():
    story = Story()
    story.fields["protective_stop"] = 1
    story.run(0.2, move=9.0)
    story.core.run("recover", recover(story.core), story.now)
    story.run(2.5, move=9.0)
    assert str(story.error("recover")) == (
        "refused to recover: within 2.3 s the arm has not come to rest; it moves, and not by this driver")
    story.core.run("disable", set_enabled(story.core, False), story.now)
    story.run(4.0, move=9.0)
    assert isinstance(story.error("disable"), MotionInterrupted)
    assert "within 3 s the arm has not come to rest; it moves, and not by this driver" in str(story.error("disable"))
