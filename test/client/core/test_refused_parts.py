"""A queue of moves of which the controller refuses one: what runs on, what is stopped, and what comes behind it."""
import math

import pytest
from stories import HOME, Story

from jaka_ros_driver.clearance.workspace import workspace_of
from jaka_ros_driver.commands import JointMove
from jaka_ros_driver.errors import CommandRejected, StopCause

MOVING = {"inpos": False}


def to(first):
    return JointMove((first,) + HOME[1:], 0.5, 1.0)


def queued(story, *names):
    for number, name in enumerate(names):
        story.core.move(name, to(0.5 - 0.2 * number), False, story.now, "end of " + name)
        story.perform()


def test_a_refused_part_at_the_end_leaves_those_before_it():
    story = Story()
    queued(story, "first")
    story.replies["joint_move"] = "2"
    story.core.move("second", to(0.0), False, story.now, "end of second")
    story.perform()
    assert isinstance(story.error("end of second"), CommandRejected)
    story.run(1.2, move=0.5, **MOVING).run(0.3)
    assert story.error("end of first") is None and story.core.is_free and story.count("stop_program") == 0


@pytest.mark.parametrize("codes", ["020", "200", "220", "022"])
def test_a_refused_part_with_others_behind_it_stops_the_queue_for_they_would_begin_elsewhere(codes):
    story = Story()
    story.replies["joint_move"] = None
    queued(story, "first", "second", "third")
    story.run(0.02, move=0.5, **MOVING)
    for code in codes:
        story.reply("joint_move", code)
    story.run(0.1, move=0.5, **MOVING).run(1.0)
    assert story.count("stop_program") == 1 and story.core.is_free
    names = ("first", "second", "third")
    refused = names[codes.index("2")]
    assert isinstance(story.error("end of " + refused), CommandRejected)
    for name in names:
        assert name == refused or "would begin elsewhere" in str(story.error("end of " + name))
        assert (story.error(name) is None) is (name == "first" and codes[0] == "0")


def beside_a_post():
    """Return a story with a post between two places, and the moves up, over it, and down behind it."""
    post = workspace_of({"keep_out": [{"name": "post", "centre": [0.28, 0.28, 0.2], "size": [0.15, 0.15, 0.4]}]})
    up = JointMove((0.0, HOME[1] + 0.3, HOME[2] - 0.15) + HOME[3:], 0.5, 1.0)
    over, down = (JointMove((math.pi / 2,) + way[1:], 0.5, 1.0) for way in (up.joint_position, HOME))
    return Story(workspace=post), up, over, down


def test_a_move_behind_a_refused_one_is_looked_at_from_the_end_of_the_one_before_it():
    story, up, over, down = beside_a_post()
    story.core.move("nowhere", to(0.05), False, story.now)
    story.perform()
    story.replies["joint_move"] = "2"
    story.core.move("up", up, False, story.now)
    story.perform()
    assert isinstance(story.error("up"), CommandRejected)
    story.replies["joint_move"] = "0"
    story.core.move("down", down, False, story.now)
    story.perform()
    assert "post" in str(story.error("down")) and story.count("joint_move") == 2
    story.core.move("up again", up, False, story.now)
    story.perform()
    story.core.move("over", over, False, story.now)
    story.perform()
    assert story.error("up again") is story.error("over") is None and story.count("joint_move") == 4


def test_moves_behind_one_that_was_refused_do_not_run_where_the_motion_guard_has_not_looked():
    story, up, over, down = beside_a_post()
    story.replies["joint_move"] = None
    for name, move in (("up", up), ("over", over), ("down", down)):
        story.core.move(name, move, False, story.now, "end of " + name)
        story.perform()
    story.run(0.02, **MOVING)
    assert story.count("joint_move") == 3, [str(story.error(name)) for name in ("up", "over", "down")]
    for code in "020":
        story.reply("joint_move", code)
    story.run(1.0)
    assert story.count("stop_program") == 1 and story.cause("end of down") is StopCause.FAULT
    story.core.move("direct", down, False, story.now)
    story.run(0.1)
    assert "post" in str(story.error("direct")), "it is the way that the third move would have taken"
