"""One goal of ~move_path against an arm that the test plays: which end it has, and that a cancel is not lost."""
import threading
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
from actionlib_msgs.msg import GoalStatus
from waiting import eventually

from jaka_ros_driver.client.core.planned.path_move import PathProgress
from jaka_ros_driver.errors import InvalidCommand, MotionInterrupted, PathInterrupted, StopCause
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.services import path_action
from jaka_ros_driver.ros.services.path_action import PathAction


class Arm:
    """An arm that takes one path; the test chooses when it begins and how it ends."""

    def __init__(self):
        self.done = Future()
        self.begun = threading.Event()
        self.cancels = []
        self.can_be_cancelled = False
        self.path = None

    def begin_path(self, _segments, is_cancelled, on_begun):
        self.is_cancelled, self.on_begun = is_cancelled, on_begun
        self.begun.set()
        return self.done

    def cancel_path(self, done):
        assert done is self.done
        self.cancels.append(self.can_be_cancelled)
        return self.can_be_cancelled


class Handle:
    """A goal as actionlib keeps it; its ends are kept, each with the states that actionlib allows before it."""

    def __init__(self, name="goal"):
        self.status, self.ends, self.feedback, self._name = GoalStatus.PENDING, [], [], name
        self.ended = threading.Event()

    def get_goal_id(self):
        return SimpleNamespace(id=self._name)

    def get_goal(self):
        return None

    def get_goal_status(self):
        return SimpleNamespace(status=self.status, PENDING=GoalStatus.PENDING, RECALLING=GoalStatus.RECALLING)

    def set_accepted(self):
        assert self.status == GoalStatus.PENDING
        self.status = GoalStatus.ACTIVE

    def publish_feedback(self, feedback):
        self.feedback.append(feedback)

    def _end(self, name, result, allowed):
        assert self.status in allowed, (name, self.status)
        self.ends.append((name, result))
        self.ended.set()

    def set_succeeded(self, result, _text):
        self._end("succeeded", result, [GoalStatus.ACTIVE])

    def set_aborted(self, result, _text):
        self._end("aborted", result, [GoalStatus.ACTIVE])

    def set_rejected(self, result, _text):
        self._end("rejected", result, [GoalStatus.PENDING])

    def set_canceled(self, result, _text):
        self._end("cancelled", result, [GoalStatus.PENDING, GoalStatus.ACTIVE])


class Decoder:
    def path(self, _goal):
        return ["segment"]


@pytest.fixture
def goal():
    """Return an arm, a goal that it has taken, and the action between them; the goal's thread ends with the test."""
    arm, handle = Arm(), Handle()
    action = PathAction(arm, Decoder(), Recorder(None))
    action._take(handle)
    assert arm.begun.wait(10.0)
    yield arm, handle, action
    if not arm.done.done():
        arm.done.set_exception(InvalidCommand("the test is over"))
    assert handle.ended.wait(10.0)
    action.finish_goals(10.0)


def ended(handle):
    assert handle.ended.wait(10.0) and len(handle.ends) == 1
    name, result = handle.ends[0]
    return name, result.success, result.completed


def test_a_path_that_arrives_succeeds_with_the_way_it_came(goal):
    arm, handle, _ = goal
    arm.on_begun()
    arm.path = PathProgress(arm.done, 1, 2, 0.5)
    assert eventually(lambda: handle.feedback)
    assert (handle.feedback[0].segment, handle.feedback[0].fraction) == (1, 0.5)
    arm.done.set_result(PathProgress(arm.done, 2, 2, 1.0))
    assert ended(handle) == ("succeeded", True, 2) and handle.ends[0][1].fraction == 1.0


def test_a_path_that_is_over_before_anybody_looks_has_an_end_too(goal):
    arm, handle, _ = goal
    arm.on_begun()
    arm.done.set_result(PathProgress(arm.done, 2, 2, 1.0))
    assert ended(handle) == ("succeeded", True, 2)


def test_a_cancel_that_comes_between_the_audit_and_the_first_segment_is_made_good(goal):
    arm, handle, action = goal
    action._cancel(handle)
    assert arm.is_cancelled() and arm.cancels == [False], "no path was running yet"
    arm.can_be_cancelled = True
    arm.on_begun()
    assert eventually(lambda: True in arm.cancels)
    arm.done.set_exception(PathInterrupted(MotionInterrupted(StopCause.CANCELLED), 0, 2, 0.1))
    assert ended(handle) == ("cancelled", False, 0)
    assert arm.cancels.count(True) == 1, "once is enough"


def test_a_path_that_nobody_cancels_is_not_cancelled(goal):
    arm, handle, action = goal
    arm.on_begun()
    arm.path = PathProgress(arm.done, 0, 2, 0.5)
    assert eventually(lambda: len(handle.feedback) > 1)
    action._cancel(Handle("another"))
    assert not arm.is_cancelled() and arm.cancels == []


@pytest.mark.parametrize("error, is_begun, end, completed", [
    (InvalidCommand("no"), False, "rejected", 0),
    (MotionInterrupted(StopCause.STOPPED), False, "rejected", 0),
    (MotionInterrupted(StopCause.CANCELLED), False, "cancelled", 0),
    (PathInterrupted(MotionInterrupted(StopCause.STOPPED), 1, 2, 0.6), True, "aborted", 1),
    (PathInterrupted(MotionInterrupted(StopCause.CANCELLED), 1, 2, 0.6), True, "cancelled", 1)])
def test_the_end_says_whether_it_was_begun_and_how_far_it_came(goal, error, is_begun, end, completed):
    arm, handle, _ = goal
    if is_begun:
        arm.on_begun()
    arm.done.set_exception(error)
    assert ended(handle) == (end, False, completed)
    assert handle.ends[0][1].fraction == (0.6 if completed else 0.0)


def test_a_path_of_somebody_else_is_not_told_as_this_ones_progress(goal):
    arm, handle, _ = goal
    arm.path = PathProgress(Future(), 1, 2, 0.5)
    arm.on_begun()
    assert eventually(lambda: handle.status == GoalStatus.ACTIVE)
    arm.done.set_result(PathProgress(arm.done, 2, 2, 1.0))
    assert ended(handle)[0] == "succeeded" and not handle.feedback


def test_where_the_installed_messages_lack_the_action_a_warning_says_so_and_it_is_not_offered(monkeypatch, caplog):
    monkeypatch.setattr(path_action, "messages", SimpleNamespace(__path__=["/opt/maker/jaka_msgs"]))
    PathAction(Arm(), Decoder(), Recorder(None)).offer()
    assert "/opt/maker/jaka_msgs has no action MovePath: ~move_path is not offered" in caplog.text
