"""When an accepted motion counts as completed, and when as interrupted, by the states that follow."""
import dataclasses
import threading

import pytest

from jaka_ros_driver.client.motion_waiter import START_WINDOW, MotionWaiter
from jaka_ros_driver.commands import Jog, JogFrame, JointMove, LinearMove, Pose
from jaka_ros_driver.errors import MotionInterrupted, StopCause
from jaka_ros_driver.state import RobotState

HOME = (0.0, 1.5, -1.5, 1.5, 1.5, 0.0)
TARGET = (0.5, 1.5, -1.5, 1.5, 1.5, 0.0)
MOVE = JointMove(TARGET, 1.0, 1.0)
RESTING = RobotState(HOME, True, True, True, False, False, tcp_position=(0.4, 0.1, 0.3), tcp_rpy=(3.1, 0.0, 0.0))
LINE = LinearMove(Pose((0.5, 0.1, 0.3), (3.1, 0.0, 0.0)), 0.1, 0.1)


class Story:
    """A motion accepted at time 0, and the states after it."""

    def __init__(self, command=MOVE, timeout=100.0, before=RESTING):
        self.ended = []
        self.waiter = MotionWaiter(command, timeout, 0.0, before, self.ended.append)

    def at(self, time, **changes):
        self.waiter.observe(dataclasses.replace(RESTING, received_at=time, **changes))
        return self

    def moving(self, time, **changes):
        return self.at(time, is_in_position=False, **changes)

    @property
    def outcome(self):
        assert len(self.ended) <= 1
        if not self.ended:
            return "under way"
        try:
            self.waiter.wait()
        except MotionInterrupted as interrupted:
            return interrupted.cause
        return "completed"


def test_a_move_is_completed_when_the_arm_rests_at_the_target():
    story = Story().moving(0.01)
    assert story.outcome == "under way"
    assert story.at(0.5, joint_position=TARGET).outcome == "completed"


def test_a_move_too_short_to_be_seen_is_completed_at_the_target():
    assert Story().at(0.01, joint_position=TARGET).outcome == "completed"


def test_already_there_is_completed():
    assert Story(JointMove(HOME, 1.0, 1.0)).at(0.01).outcome == "completed"


def test_states_from_before_the_acceptance_say_nothing():
    assert Story(JointMove(HOME, 1.0, 1.0)).at(-0.01).at(0.0).outcome == "under way"


def test_a_move_that_is_accepted_and_never_begins_is_a_fault():
    story = Story().at(0.01).at(START_WINDOW - 0.01)
    assert story.outcome == "under way"
    assert story.at(START_WINDOW + 0.01).outcome is StopCause.FAULT


def test_rest_elsewhere_than_at_the_target_was_a_stop():
    story = Story().moving(0.01).at(0.2)
    assert story.outcome == "under way"
    assert story.at(0.55).outcome is StopCause.STOPPED


def test_a_pause_in_being_in_position_is_not_the_end():
    story = Story().moving(0.01).at(0.2).moving(0.3).at(0.55)
    assert story.outcome == "under way"
    assert story.at(0.6, joint_position=TARGET).outcome == "completed"


@pytest.mark.parametrize("changes, cause", [
    ({"emergency_stop": True, "is_powered": False, "is_enabled": False}, StopCause.EMERGENCY_STOP),
    ({"protective_stop": True}, StopCause.PROTECTIVE_STOP),
    ({"is_enabled": False}, StopCause.NOT_ENABLED),
    ({"is_powered": False}, StopCause.NOT_ENABLED),
    ({"error_code": 0xF0017, "error_message": "unreachable"}, StopCause.FAULT)])
def test_what_stops_the_arm_ends_the_move_with_its_name(changes, cause):
    assert Story().moving(0.01).moving(0.02, **changes).outcome is cause


def test_a_note_in_the_event_code_is_not_a_fault():
    assert Story().moving(0.01, error_code=0x10F0015).outcome == "under way"


def test_a_fault_that_stood_before_is_not_this_motions():
    before = dataclasses.replace(RESTING, error_code=0xF0017)
    story = Story(before=before).moving(0.01, error_code=0xF0017)
    assert story.outcome == "under way"
    assert story.moving(0.02, error_code=0xF0018).outcome is StopCause.FAULT


def test_a_move_that_takes_too_long_is_over_time():
    story = Story(timeout=5.0).moving(0.01).moving(5.1)
    assert story.outcome is StopCause.TIMEOUT
    assert story.waiter.is_over_time


def test_a_line_is_completed_by_the_tool_pose():
    assert Story(LINE).moving(0.01).at(1.0, tcp_position=(0.4999, 0.1, 0.3)).outcome == "completed"
    assert Story(LINE).moving(0.01).at(1.0).at(1.4).outcome is StopCause.STOPPED
    assert Story(LINE).moving(0.01).at(1.0, tcp_position=(0.5, 0.1, 0.3), tcp_rpy=(3.1, 0.1, 0.0)).at(
        1.4, tcp_position=(0.5, 0.1, 0.3), tcp_rpy=(3.1, 0.1, 0.0)).outcome is StopCause.STOPPED


def test_where_the_tool_pose_is_not_reported_rest_is_the_end():
    story = Story(LINE).at(0.01, tcp_position=None)
    assert story.outcome == "under way"
    assert story.moving(0.02, tcp_position=None).at(0.5, tcp_position=None).outcome == "completed"


def test_a_jog_ends_when_the_arm_rests():
    assert Story(Jog(JogFrame.JOINT, 0, 0.1), float("inf")).moving(0.01).at(3.0).outcome == "completed"


def test_who_waits_is_told_last():
    order = []
    told = threading.Thread(target=lambda: (waiter.wait(), order.append("told")))

    def on_ended(_):
        told.join(0.05)
        order.append("ended")
    waiter = MotionWaiter(MOVE, 100.0, 0.0, RESTING, on_ended)
    told.start()
    waiter.end(None)
    told.join()
    assert order == ["ended", "told"]


def test_the_first_word_on_the_end_counts():
    story = Story().moving(0.01)
    story.waiter.end(MotionInterrupted(StopCause.STOPPED))
    story.waiter.end(MotionInterrupted(StopCause.LINK_LOST))
    assert story.at(1.0, joint_position=TARGET).outcome is StopCause.STOPPED
