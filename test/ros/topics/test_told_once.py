"""The messages published of motions, calls, speed and trajectories, on topics that the test plays: no ROS master."""
import dataclasses
import threading
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
import rospy
from std_srvs.srv import Trigger, TriggerResponse
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import WAIT, eventually

from jaka_msgs import msg as messages
from jaka_ros_driver.client.core.velocity_jog.motion import JogReport
from jaka_ros_driver.errors import ConnectionLost, MotionInterrupted, StopCause
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.errands import ERRANDS
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.services import call_publisher
from jaka_ros_driver.ros.services.handlers import ServiceOutcome
from jaka_ros_driver.ros.topics import motion_ends, robot_status, speed
from jaka_ros_driver.ros.trajectories import topics
from jaka_ros_driver.ros.trajectories.controller_params import controller_params
from jaka_ros_driver.state import ProgramState, RobotState

STATE = RobotState((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), True, True, True, False, False)
JOINTS = ["joint_%d" % n for n in range(1, 7)]


def state(**fields):
    return dataclasses.replace(STATE, **fields)


class Topic:
    """A keeper of what is published."""

    def __init__(self, kind):
        self.data_class, self.messages, self.subscribers = kind, [], 1

    def get_num_connections(self):
        return self.subscribers

    def publish(self, message):
        self.messages.append(message)


@pytest.fixture
def ros(monkeypatch):
    """Return topics and services by name, subscriptions' callbacks; a clock that stands."""
    found = SimpleNamespace(topics={}, subscribers={}, services={}, warnings=[])
    for room in (call_publisher, motion_ends, robot_status, speed, topics):
        monkeypatch.setattr(room, "direct_publisher", lambda name, kind, *_, **__: found.topics.setdefault(
            name, Topic(kind)))
    monkeypatch.setattr(rospy, "Subscriber", lambda name, kind, callback, argument=None, **_: (
        found.subscribers.setdefault(name, lambda message: callback(message, argument))))
    monkeypatch.setattr(topics, "ServiceServer", lambda name, kind, handler, calls, is_stop: is_stop and (
        found.services.setdefault(name, handler)))
    for module in (robot_status, topics):
        monkeypatch.setattr(module, "ros_clock", lambda: lambda: 10 ** 18)
    monkeypatch.setattr(rospy.Time, "now", classmethod(lambda cls: rospy.Time(100)))
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda period, text: found.warnings.append(text))
    return found


class Arm:
    """An arm that takes trajectories and shows states; the test sets its state."""

    def __init__(self):
        self.stops, self.trajectory, self.followed, self.cancels, self.stopped = 7, None, [], 0, 0
        self.error = None
        self.foreign_motion = ""
        self.velocity_jog = JogReport("", "", "")

    def add_listener(self, listener):
        self.arrived = listener

    def follow(self, trajectory, tolerances, stops):
        if self.error is not None:
            raise self.error
        self.followed.append((trajectory, stops))
        return Future()

    def end_trajectories(self):
        self.cancels += 1

    def stop(self, when_sent):
        if self.error is not None:
            raise self.error
        self.stopped += 1
        when_sent()


# ---- motions and programs ----

@pytest.fixture
def ends(ros):
    arm = Arm()
    one = motion_ends.MotionEnds(arm)
    one.start()
    return SimpleNamespace(ends=one, arm=arm, arrived=arm.arrived, moves=ros.topics["~motion_state"].messages,
                           programs=ros.topics["~program/state"].messages)


def test_each_move_has_an_id_and_its_own_end(ends):
    first, second = Future(), Future()
    assert [ends.ends.move_accepted(end) for end in (first, second)] == ["1", "2"]
    second.set_exception(MotionInterrupted(StopCause.STOPPED))
    first.set_result(None)
    assert ERRANDS.drain(WAIT)
    kinds = messages.MotionState
    assert [(one.id, one.state) for one in ends.moves] == [
        ("1", kinds.ACCEPTED), ("2", kinds.ACCEPTED), ("2", kinds.STOPPED), ("1", kinds.COMPLETED)]
    assert ends.moves[2].reason.startswith("stopped by request") and "reached" in ends.moves[3].reason


def test_whoever_sees_a_motion_end_does_not_wait_for_its_message(ends, monkeypatch):
    may_publish, topic = threading.Event(), ends.ends._moves
    publish = topic.publish
    monkeypatch.setattr(topic, "publish", lambda message: may_publish.wait(5.0) and publish(message))
    end = Future()
    ends.ends.move_accepted(end)
    end.set_result(None)
    assert not ends.moves
    may_publish.set()
    assert ERRANDS.drain(WAIT) and len(ends.moves) == 2


def test_a_jog_that_stands_is_told_with_its_reason_once_and_that_it_goes_on(ends):
    for obstacle in ("", "wrist singularity: jog joint 5", "wrist singularity: jog joint 5", ""):
        ends.arm.velocity_jog = JogReport("/pad", "", obstacle)
        ends.arrived(state(), True)
    assert ERRANDS.drain(WAIT)
    kinds = messages.MotionState
    assert [(one.id, one.state, one.reason) for one in ends.moves] == [
        ("jog", kinds.STOPPED, "wrist singularity: jog joint 5"), ("jog", kinds.ACCEPTED, "")]


def test_a_program_is_told_when_it_changes_and_only_then(ends):
    for shown, is_new in ((0, True), (0, True), (3, False), (None, True), (3, True), (3, True), (9, True)):
        ends.arrived(state(program_state=shown), is_new)
    assert ERRANDS.drain(WAIT)
    assert [one.state for one in ends.programs] == [ProgramState.IDLE, ProgramState.RUNNING,
                                                    messages.ProgramState.UNKNOWN]


def test_the_end_of_a_program_has_a_reason_which_the_next_one_has_not(ends):
    ends.ends.program_loaded("before the feed tells anything")
    ends.arrived(state(program_state=0), True)
    ends.ends.program_loaded("pick")
    for error in (None, MotionInterrupted(StopCause.STOPPED)):
        end = Future()
        ends.ends.program_began(end)
        ends.arrived(state(program_state=3), True)
        end.set_result(None) if error is None else end.set_exception(error)
        ends.arrived(state(program_state=0), True)
    assert ERRANDS.drain(WAIT)
    told = [(one.state, one.program, one.reason.split(" ")[0]) for one in ends.programs]
    assert told == [(0, "before the feed tells anything", ""), (0, "pick", ""), (3, "pick", ""),
                    (3, "pick", "completed"), (0, "pick", "completed"), (3, "pick", ""), (3, "pick", "stopped"),
                    (0, "pick", "stopped")]


# ---- calls ----

@pytest.mark.parametrize("md5sum, told", [("abc", "abc"), ("*", Trigger._md5sum)])
def test_a_call_is_told_with_what_its_client_was_built_with(ros, md5sum, told):
    publisher = call_publisher.CallPublisher()
    request = Trigger._request_class()
    request._connection_header = {"md5sum": md5sum, "callerid": "/client"}
    call = call_publisher.ReceivedCall("stop_move", Trigger, request, rospy.Time(5), 0.0)
    topic = ros.topics["~service_calls"]
    publisher.answered(call, TriggerResponse(True, "done"), ServiceOutcome("done"))
    publisher.answered(call, TriggerResponse(False, "no"), ServiceOutcome("no", is_success=False))
    publisher.failed(call, "broken")
    assert [(one.success, one.error) for one in topic.messages] == [(True, ""), (False, "no"), (False, "broken")]
    assert [bool(one.response) for one in topic.messages] == [True, True, False]
    assert {(one.md5sum, one.caller, one.service, one.header.stamp.to_sec()) for one in topic.messages} == {
        (told, "/client", "stop_move", 5.0)}
    assert all(one.duration > 0.0 for one in topic.messages)
    topic.subscribers = 0
    publisher.failed(call, "unheard")
    assert len(topic.messages) == 3


# ---- speed ----

def test_a_speed_is_told_when_it_changes(ros):
    arm = Arm()
    speed.SpeedPublisher(arm).start()
    for rate, is_new in ((None, True), (1.0, False), (1.0, True), (1.0, True), (0.5, True), (0.5, False), (0.0, True)):
        arm.arrived(state(rapid_rate=rate), is_new)
    assert [one.data for one in ros.topics["~speed_scaling_factor"].messages] == [1.0, 0.5, 0.0]


# ---- robot_status ----

def test_the_status_is_told_with_a_change_and_ten_times_a_second(ros):
    arm = Arm()
    arm.add_task = lambda task: None
    arm.is_hand_guided = lambda state: False
    arm.is_motion_possible, arm.is_servo_active, arm.motion_owner = True, False, None
    arm.has_moved_since = lambda since: False
    publisher = robot_status.RobotStatusPublisher(arm)
    publisher.start()
    topic = ros.topics["~robot_status"]
    for n in range(101):
        arm.arrived(state(received_at=50.0 + 0.01 * n), True)
    assert len(topic.messages) in (10, 11)
    arm.arrived(state(received_at=51.001, emergency_stop=True), False)
    assert topic.messages[-1].e_stopped.val == 0, "old news"
    arm.arrived(state(received_at=51.001, emergency_stop=True), True)
    assert topic.messages[-1].e_stopped.val == 1
    topic.subscribers = 0
    arm.arrived(state(received_at=51.002), True)
    assert topic.messages[-1].e_stopped.val == 1 and publisher.due() is None
    topic.subscribers = 1
    assert publisher.due() == pytest.approx(51.101)
    arm.fresh_state = lambda: state(received_at=51.001)
    publisher.run(51.102)
    assert publisher.due() == pytest.approx(51.202), "a loop that looks again at once is busy with nothing else"


def test_the_number_of_a_fault_fits_its_field():
    truth = robot_status.truth_of(state(error_code=0xFFFFFFFFF), False, True, False)
    assert truth.error_code == 2 ** 31 - 1 and truth.in_error == 1


# ---- trajectories ----

def message(*times):
    return JointTrajectory(joint_names=JOINTS, points=[
        JointTrajectoryPoint(positions=[0.1] * 6, time_from_start=rospy.Duration(time)) for time in times])


@pytest.fixture
def offered(ros, monkeypatch):
    actions = []
    monkeypatch.setattr(topics, "TrajectoryAction", lambda name, *_: actions.append(name) or SimpleNamespace(
        offer=lambda: None))

    def offer(**parameters):
        arm = Arm()
        config = DriverConfig(**parameters)
        interface = topics.TrajectoryInterface(arm, config, controller_params(config, None), lambda state: (0.5,) * 6,
                                              Recorder(None))
        interface.offer()
        return SimpleNamespace(arm=arm, actions=actions, interface=interface, command=next(
            take for name, take in ros.subscribers.items() if name.endswith("/command")))
    return offer


@pytest.mark.parametrize("industrial", [True, False])
def test_the_names_of_ros_industrial_are_offered_where_they_are_wanted(ros, offered, industrial):
    one = offered(industrial_names=industrial)
    assert ("joint_trajectory_action" in one.actions) is industrial and len(one.actions) == 1 + industrial
    assert ("joint_path_command" in ros.subscribers) is industrial
    assert ("feedback_states" in ros.topics) is industrial and ("stop_motion" in ros.services) is industrial


def test_a_command_is_followed_with_the_stops_of_its_arrival(offered):
    one = offered()
    one.command(message(1.0))
    assert eventually(lambda: one.arm.followed)
    trajectory, stops = one.arm.followed[0]
    assert stops == 7 and len(trajectory.points) == 1 and one.arm.cancels == 0


def test_a_command_without_points_ends_what_is_under_way(offered):
    one = offered()
    one.command(message())
    assert one.arm.cancels == 1 and not one.arm.followed


def test_a_command_that_is_refused_is_logged_and_the_next_one_is_taken(ros, offered):
    one = offered()
    one.arm.error = ConnectionLost("silent")
    one.command(message(1.0))
    assert eventually(lambda: ros.warnings)
    one.arm.error = None
    one.command(message(1.0))
    assert eventually(lambda: one.arm.followed)


def test_stop_motion_tells_whether_the_stop_was_delivered(ros, offered):
    one = offered(industrial_names=True)
    assert ros.services["stop_motion"](None).code.val == 1 and one.arm.stopped == 1
    one.arm.error = ConnectionLost("silent")
    assert ros.services["stop_motion"](None).code.val == -1


def test_states_are_told_at_their_rate_to_who_listens(ros, offered):
    one = offered(industrial_names=True)
    own = next(topic for name, topic in ros.topics.items() if name.endswith("/state"))
    feedback = ros.topics["feedback_states"]
    one.arm.arrived(state(received_at=10.0), False)
    assert not own.messages
    for n in range(100):
        one.arm.arrived(state(received_at=10.0 + 0.01 * n), True)
    count = len(own.messages)
    assert count == len(feedback.messages) and 0.8 <= count * 0.02 <= 1.1
    assert own.messages[-1].actual.positions == pytest.approx(STATE.joint_position)
    assert own.messages[-1].desired.positions == pytest.approx(STATE.joint_position)
    assert list(own.messages[-1].actual.velocities) == [0.5] * 6
    own.subscribers = 0
    one.arm.arrived(state(received_at=12.0, joint_position_commanded=(0.7,) * 6), True)
    assert len(own.messages) == count and len(feedback.messages) == count + 1
    assert list(feedback.messages[-1].desired.positions) == [0.7] * 6
    feedback.subscribers = 0
    one.arm.arrived(state(received_at=14.0), True)
    assert len(feedback.messages) == count + 1
