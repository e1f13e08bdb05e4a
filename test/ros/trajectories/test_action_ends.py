"""The ends of the action's goals, each with its code: an arm and goal handles of the tests' own, no ROS master."""
import dataclasses
import re
import threading
import time
import types
from concurrent.futures import Future

import pytest
import rospy
from waiting import eventually

from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.trajectory import TrajectoryProgress
from jaka_ros_driver.errors import (
    ConnectionLost,
    GoalToleranceViolated,
    InvalidCommand,
    MotionInterrupted,
    PathToleranceViolated,
    StopCause,
)
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.other_messages import made_type
from jaka_ros_driver.ros.params import config_from
from jaka_ros_driver.ros.services.server import CallCount
from jaka_ros_driver.ros.topics.stamps import StampClock
from jaka_ros_driver.ros.trajectories import action
from jaka_ros_driver.ros.trajectories.controller_params import controller_params
from jaka_ros_driver.ros.trajectories.messages import InvalidJoints, TrajectoryDecoder
from jaka_ros_driver.state import RobotState
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import InvalidTrajectory, TrajectoryOfThePast

WAIT = 20.0


class Arm:
    """An arm that follows whatever it is given until the test ends it; ``refusal`` is raised instead."""

    def __init__(self):
        self.refusal = None
        self.goals = []
        self.cancelled = []
        self.trajectory = None
        self.motion_owner = None
        self.stops = 0
        self.asked_with = []
        self.state = None
        self.asked = threading.Event()

    def follow(self, trajectory, tolerances, stops):
        self.asked_with.append(stops)
        if self.refusal is not None:
            raise self.refusal
        self.goals.append(Future())
        self.asked.set()
        return self.goals[-1]

    def cancel_trajectory(self, goal=None):
        self.cancelled.append(goal)
        return goal is not None or self.trajectory is not None


class Handle:
    """A goal as actionlib hands it over, with its states."""

    def __init__(self, number, points=1):
        goal = made_type("control_msgs/FollowJointTrajectoryGoal")()
        goal.trajectory.joint_names = ["joint_%d" % n for n in range(1, 7)]
        goal.trajectory.points = [made_type("trajectory_msgs/JointTrajectoryPoint")(positions=[0.0] * 6)] * points
        self._goal, self._id = goal, types.SimpleNamespace(id="goal %d" % number)
        self.ends = []
        self.feedback = []
        self.is_accepted = False
        self.ended = threading.Event()

    def get_goal(self):
        return self._goal

    def get_goal_id(self):
        return self._id

    def set_accepted(self):
        self.is_accepted = True

    def publish_feedback(self, feedback):
        self.feedback.append(feedback)

    def _end(self, how):
        def end(result, text):
            self.ends.append((how, result.error_code, text))
            assert result.error_string == text
            self.ended.set()
        return end

    def __getattr__(self, name):
        return self._end(name[4:]) if name.startswith("set_") else super().__getattribute__(name)

    def end(self):
        assert self.ended.wait(WAIT)
        (one,) = self.ends
        return one


@pytest.fixture
def arm():
    return Arm()


@pytest.fixture
def server(arm):
    decoder = TrajectoryDecoder(config_from({}), controller_params(config_from({}), None))
    return action.TrajectoryAction("controller/follow_joint_trajectory", arm, decoder, action.TurnQueue(), CallCount(),
                                   Recorder(None), StampClock())


def turn_threads():
    return [thread for thread in threading.enumerate() if thread.name == "trajectory goals"]


def test_goals_begin_one_after_the_other_in_their_order_and_their_thread_ends(monkeypatch):
    turns, begun, inside = action.TurnQueue(), [], []

    def begin(number):
        inside.append(number)
        assert inside == [number], "two at a time"
        time.sleep(0.001)
        inside.remove(number)
        begun.append(number)
        if number == 7:
            raise ValueError("a defect")

    for number in range(40):
        turns.put(lambda number=number: begin(number))
        assert len(turn_threads()) <= 1
        time.sleep(0.002 * (number % 3))
    assert eventually(lambda: len(begun) == 40) and begun == list(range(40))
    assert eventually(lambda: not turn_threads())


def test_a_goal_begins_also_where_no_thread_can_be_started(monkeypatch):
    def start(self):
        raise RuntimeError("can't start new thread")

    turns, begun = action.TurnQueue(), []
    with monkeypatch.context() as full:
        full.setattr(threading.Thread, "start", start)
        turns.put(lambda: begun.append(1))
    turns.put(lambda: begun.append(2))
    assert eventually(lambda: begun == [1, 2])


def begun(server, arm, number=1):
    handle = Handle(number)
    server._take(handle)
    assert arm.asked.wait(WAIT)
    arm.asked.clear()
    return handle


@pytest.mark.parametrize("refusal, code", [
    (InvalidTrajectory("malformed"), action.INVALID_GOAL), (InvalidJoints("no such joint"), action.INVALID_JOINTS),
    (TrajectoryOfThePast("late"), action.OLD_HEADER_TIMESTAMP), (InvalidCommand("a jog"), action.INVALID_GOAL),
    (ConnectionLost("no link"), action.INVALID_GOAL)])
def test_what_is_refused_is_rejected_with_its_code_and_reason(server, arm, refusal, code):
    arm.refusal = refusal
    handle = Handle(1)
    server._take(handle)
    assert handle.end() == ("rejected", code, str(refusal)) and not handle.is_accepted


@pytest.mark.parametrize("outcome, end", [
    (None, ("succeeded", action.SUCCESSFUL)),
    (MotionInterrupted(StopCause.CANCELLED), ("canceled", action.SUCCESSFUL)),
    (MotionInterrupted(StopCause.REPLACED), ("canceled", action.SUCCESSFUL)),
    (PathToleranceViolated("far"), ("aborted", action.PATH_TOLERANCE_VIOLATED)),
    (GoalToleranceViolated("beside"), ("aborted", action.GOAL_TOLERANCE_VIOLATED)),
    (InvalidCommand("the arm has moved"), ("aborted", action.INVALID_GOAL)),
    *((MotionInterrupted(cause), ("aborted", action.PATH_TOLERANCE_VIOLATED)) for cause in (
        StopCause.STOPPED, StopCause.EMERGENCY_STOP, StopCause.PROTECTIVE_STOP, StopCause.FAULT, StopCause.NOT_ENABLED,
        StopCause.LINK_LOST, StopCause.SHUTDOWN))], ids=str)
def test_what_ends_a_trajectory_ends_its_goal_once_with_the_code_for_it(server, arm, outcome, end):
    handle = begun(server, arm)
    assert not handle.ended.wait(0.2), "it has ended before the arm"
    if outcome is None:
        arm.goals[0].set_result(None)
    else:
        arm.goals[0].set_exception(outcome)
    assert handle.end()[:2] == end and handle.is_accepted
    assert outcome is None or handle.ends[0][2] == str(outcome)


@pytest.mark.parametrize("led, text", [
    ("joint 3 is led to 2.617 rad, not to 2.618 rad", "the arm rests at the last point; joint 3 is led to 2.617 rad, "
                                                      "not to 2.618 rad"),
    ("", "the arm rests at the last point")])
def test_a_goal_that_was_led_inside_the_limits_says_so_in_its_result(server, arm, led, text):
    handle = begun(server, arm)
    arm.goals[0].set_result(led)
    assert handle.end() == ("succeeded", action.SUCCESSFUL, text)


def test_a_cancelled_goal_brakes_the_arm_and_no_other(server, arm):
    first = begun(server, arm, 1)
    second = begun(server, arm, 2)
    assert first.ended.wait(0.0) is second.ended.wait(0.0) is False
    server._cancel(second)
    assert arm.cancelled == [arm.goals[1]] and not second.ended.wait(0.2), "the end is published when the arm rests"
    arm.goals[1].set_exception(MotionInterrupted(StopCause.CANCELLED))
    assert second.end()[0] == "canceled" and not first.ends
    arm.goals[0].set_result(None)
    assert first.end()[0] == "succeeded"


def test_a_goal_that_is_cancelled_before_its_turn_never_moves_the_arm(server, arm):
    is_free = threading.Event()
    server._turns.put(lambda: is_free.wait(WAIT))
    handle = Handle(1)
    server._take(handle)
    server._cancel(handle)
    is_free.set()
    assert handle.end()[0] == "canceled" and not arm.goals


def test_a_goal_belongs_to_the_time_at_which_it_came_not_to_that_of_its_turn(server, arm):
    is_free = threading.Event()
    server._turns.put(lambda: is_free.wait(WAIT))
    handle = Handle(1)
    server._take(handle)
    arm.stops += 1
    is_free.set()
    assert arm.asked.wait(WAIT) and arm.asked_with == [0]


def test_a_goal_without_points_ends_what_is_under_way_and_succeeds_when_the_arm_rests(server, arm):
    arm.trajectory = object()
    handle = Handle(1, points=0)
    server._take(handle)
    assert not handle.ended.wait(0.2) and arm.cancelled == [None] and handle.is_accepted
    arm.trajectory = None
    assert handle.end()[:2] == ("succeeded", action.SUCCESSFUL) and not arm.goals


def test_a_goal_without_points_is_refused_while_something_else_moves_the_arm(server, arm):
    arm.motion_owner = MotionOwner.MOVE
    handle = Handle(1, points=0)
    server._take(handle)
    how, code, text = handle.end()
    assert (how, code) == ("rejected", action.INVALID_GOAL) and "a move owns" in text


def test_a_defect_in_one_goal_ends_it_and_does_not_keep_the_next_one_from_being_taken(server, arm):
    arm.refusal = RuntimeError("a defect")
    first = Handle(1)
    server._take(first)
    assert first.end()[:2] == ("rejected", action.INVALID_GOAL) and "a defect" in first.ends[0][2]
    server._turns.put(lambda: setattr(arm, "refusal", None))
    second = begun(server, arm, 2)
    arm.goals[-1].set_result(None)
    assert second.end()[0] == "succeeded"


def test_feedback_tells_how_far_the_arm_is_while_its_own_trajectory_is_under_way(server, arm):
    handle = begun(server, arm)
    desired = JointState((0.5,) * 6, (0.1,) * 6, (0.0,) * 6)
    state = RobotState((0.4,) * 6, True, True, True, False, False, time.monotonic() - 0.4)
    arm.state, arm.trajectory = state, TrajectoryProgress(object(), 9.0, desired)
    assert not handle.ended.wait(0.2) and not handle.feedback, "another one is running"
    arm.trajectory = TrajectoryProgress(arm.goals[0], 1.5, desired)
    assert eventually(lambda: handle.feedback)
    told = handle.feedback[0]
    assert told.desired.positions == (0.5,) * 6 and told.desired.time_from_start == rospy.Duration.from_sec(1.5)
    assert told.actual.positions == (0.4,) * 6 and told.error.positions == pytest.approx((0.1,) * 6)
    assert time.time() - told.header.stamp.to_sec() >= 0.4, "as old as the state"
    assert not handle.ended.wait(0.2) and len(handle.feedback) == 1, "no old state comes as a new one"
    arm.state = dataclasses.replace(state, received_at=time.monotonic())
    assert eventually(lambda: len(handle.feedback) == 2)
    assert handle.feedback[1].header.stamp > told.header.stamp
    arm.goals[0].set_result(None)
    assert handle.end()[0] == "succeeded"


def test_before_the_arm_is_known_there_is_no_feedback_and_the_goal_ends_all_the_same(server, arm):
    handle = begun(server, arm)
    arm.trajectory = TrajectoryProgress(arm.goals[0], 1.5, JointState((0.5,) * 6, (0.1,) * 6, (0.0,) * 6))
    assert not handle.ended.wait(0.2) and not handle.feedback
    arm.goals[0].set_result(None)
    assert handle.end()[0] == "succeeded"


@pytest.mark.parametrize("name", ["SUCCESSFUL", "INVALID_GOAL", "INVALID_JOINTS", "OLD_HEADER_TIMESTAMP",
                                  "PATH_TOLERANCE_VIOLATED", "GOAL_TOLERANCE_VIOLATED"])
def test_the_codes_are_those_of_the_messages_definition(name):
    definition = made_type("control_msgs/FollowJointTrajectoryResult")._full_text
    found = re.search(r"^int32 %s *= *(-?\d+)$" % name, definition, re.MULTILINE)
    assert getattr(action, name) == int(found.group(1))
