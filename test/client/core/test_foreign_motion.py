"""Motion that is not this driver's: it is noticed at once, and only motion left by a dead driver is stopped unasked."""
import pytest
from stories import HOME, PERIOD, WHOLE_STOP, Story

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.foreign_motion import LeftMotion
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.commands import JogFrame, JogStop, JointMove
from jaka_ros_driver.errors import InvalidCommand

MOVE = JointMove((1.0,) + HOME[1:], 1.0, 1.0)
MOVING = {"inpos": False}


class Heir(Story):
    """A driver that finds the custody file of a dead one."""

    left = LeftMotion("a jog", JogStop(JogFrame.TOOL, 2), 1764000000.0, 4711)

    def __init__(self, left=left):
        self._left = left
        super().__init__(ready=False)

    def _begin(self):
        self.core.start(self.now, self._left)


# ---- in nobody's custody ----

@pytest.mark.parametrize("speed, within", [(0.5, 0.05), (0.05, 0.1), (0.01, 0.3)])
def test_an_arm_that_moves_in_nobodys_custody_is_said_once_and_not_stopped(speed, within):
    story = Story()
    story.run(within, move=9.0, speed=speed, **MOVING)
    assert "nobody's custody" in story.core.foreign_motion
    story.run(2.0, move=9.0, speed=speed, **MOVING)
    assert len([line for line in story.log if "nobody's custody" in line]) == 1
    assert story.count("stop_program") == 0 and story.core.is_free
    story.run(0.4)
    assert story.core.foreign_motion
    assert story.run(0.2).core.foreign_motion == ""


def test_an_arm_that_moves_when_the_driver_starts_is_noticed():
    story = Story(ready=False)
    story.connect()
    story.run(0.1, move=9.0, **MOVING)
    assert "nobody's custody" in story.core.foreign_motion and story.count("stop_program") == 0


def test_a_program_of_the_controllers_own_is_named():
    story = Story()
    story.run(0.1, move=9.0, interp_state=3, **MOVING)
    assert "a program of the controller's own" in story.core.foreign_motion


def test_this_drivers_own_motion_hand_guiding_and_opening_brakes_are_not_foreign():
    story = Story()
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, **MOVING)
    story.core.stop("stop", story.now)
    story.run(0.1, move=1.0).run(1.0)
    assert story.core.is_free
    story.run(1.0, move=2.0, drag_status=True)
    story.run(0.5)
    for _ in range(5):  # each time the brakes open
        story.joints[1] -= 1.5e-3
        story.run(0.3)
    assert story.core.foreign_motion == "" and not [line for line in story.log if "custody" in line]


def test_an_arm_that_is_elsewhere_after_a_gap_of_the_feed_does_not_move():
    story = Story()
    story.feed = False
    story.run(0.7)
    story.joints[0] += 1.0
    story.feed = True
    assert story.run(1.0).core.foreign_motion == ""


# ---- left by a dead driver ----

def test_what_a_dead_driver_left_moving_is_stopped_as_the_first_word_with_its_axis():
    story = Heir()
    assert story.told == [True] and "a jog that a dead driver (process 4711) left" in story.core.foreign_motion
    assert any("process 4711" in line for line in story.log)
    story.connect()
    jog = next(request for _, request in story.sent if request["cmdName"] == "jog")
    assert story.names()[:3] == WHOLE_STOP[:3] and (jog["jog_mode"], jog["coord_map"], jog["jnum"]) == (0, 2, 2)
    story.run(0.3, move=9.0, **MOVING)
    assert story.core.motion_owner is MotionOwner.LEFT and not story.core.is_motion_possible(story.now)
    story.run(0.9)
    assert story.core.is_motion_possible(story.now)
    assert story.core.is_free and story.told == [True, False] and story.core.foreign_motion == ""
    assert not {"power_on", "enable_robot", "clear_error", "joint_move", "resume_program"} & set(story.names())


def test_it_is_stopped_again_while_it_moves_on_and_nothing_else_begins_meanwhile():
    story = Heir()
    story.connect()
    story.run(0.3, move=9.0, **MOVING)
    story.core.move("move", MOVE, True, story.now)
    story.run(2.4, move=9.0, **MOVING)
    assert story.count("stop_program") >= 3 and story.count("joint_move") == 0
    assert isinstance(story.error("move"), InvalidCommand) and "dead driver" in str(story.error("move"))


def test_it_is_stopped_again_as_soon_as_any_other_motion_and_rests_for_longer():
    story = Heir()
    story.connect()
    began = story.now
    story.run(0.7, move=9.0, **MOVING)
    again = [at - began for at, request in story.sent if request["cmdName"] == "stop_program" and at > began]
    assert again and again[0] <= 0.6
    assert not story.run(0.7).core.is_free and story.run(0.5).core.is_free


def test_it_is_owed_until_a_link_takes_it():
    story = Heir()
    story.run(3.0)
    story.replies["stop_program"] = None
    for _ in range(3):
        story.connect()
        assert story.names()[:3] == WHOLE_STOP[:3]
        story.core.closed(Port.COMMAND, "cut", story.now)
        story.run(PERIOD)
        del story.sent[:]
    assert story.core.motion_owner is MotionOwner.LEFT


def test_custody_says_what_moves_for_the_disk():
    story = Story()
    story.core.move("move", MOVE, True, story.now)
    story.perform()
    assert [(tell.is_moving, tell.name, tell.jog_stop) for tell in story.tells] == [(True, "a move", None)]
