"""The messages of the velocity jog's topics, as they are read and given to the core."""
import math
from types import SimpleNamespace

import pytest
import rospy
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand
from jaka_ros_driver.kinematics.rotations import IDENTITY
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.topics import jog_topics
from jaka_ros_driver.ros.topics.jog_topics import JogSubscribers, jog_frame, joint_wish
from jaka_ros_driver.ros.topics.state_publishers import FrameNames

PLAIN, LEFT = FrameNames(DriverConfig()), FrameNames(DriverConfig(frame_prefix="left_"))
NOW = 1000.0
TURNED = (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 5.0, 6.0, 7.0)
"""A user frame, whose x is the base's y."""
TOOL = IDENTITY[:9] + (0.0, 0.0, 0.1)


class Arm:
    """A recorder of what it is given."""

    def __init__(self):
        self.told = []
        self.is_stale = False
        self.user_frame_id = 0

    def fresh_state(self):
        if self.is_stale:
            raise ConnectionLost("no fresh state")
        return SimpleNamespace(user_frame_id=self.user_frame_id)

    def jog_velocity(self, message):
        self.told.append(message)


class Frames:
    """A frame table that knows the active tool, or not."""

    def __init__(self):
        self.tool, self.users = TOOL, {0: IDENTITY, 3: TURNED}

    def flange_t_tool(self, state):
        return self.tool

    def base_t_user(self, state):
        return self.users.get(state.user_frame_id)


@pytest.fixture
def topics(monkeypatch):
    """Return the subscribed topics, as rospy would have it; messages come by ``say``."""
    takers = {}
    monkeypatch.setattr(rospy, "Subscriber", lambda name, kind, take, **_: takers.update({name: take}))
    monkeypatch.setattr(rospy.Time, "now", classmethod(lambda cls: rospy.Time.from_sec(NOW)))
    monkeypatch.setattr(jog_topics.time, "monotonic", lambda: 5.0)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda *_: None)
    one = JogSubscribers(Arm(), PLAIN, Frames(), Recorder(None))
    one.recorded = []
    monkeypatch.setattr(one._recorder, "message", lambda name, message, refusal="", state="": one.recorded.append(
        (bool(refusal), state)))
    one.start()

    def say(name, message, age=0.05, publisher="/pad"):
        message.header.stamp = rospy.Time.from_sec(NOW - age)
        message._connection_header = {"callerid": publisher}
        takers[name](message)
        return one._arm.told[-1]
    one.say = say
    return one


def joints(names, velocity, position=()):
    return JointState(name=names, velocity=velocity, position=position)


def twist(frame_id="base", **linear):
    message = TwistStamped()
    message.header.frame_id = frame_id
    for axis, value in linear.items():
        setattr(message.twist.linear, axis, value)
    return message


def test_joints_come_in_any_order_and_those_not_named_rest():
    wish = joint_wish(joints(["joint_5", "joint_1"], [0.5, -0.1], position=[9.0]), PLAIN)
    assert wish.frame is JogFrame.JOINT and wish.velocity == (-0.1, 0.0, 0.0, 0.0, 0.5, 0.0)
    assert joint_wish(joints(["left_joint_2", "joint_3"], [0.1, 0.2]), LEFT).velocity[1:3] == (0.1, 0.2)


@pytest.mark.parametrize("names, velocity, told", [
    ([], [], "0 names and 0 velocities"), ([], [0.1] * 6, "0 names and 6"), (["joint_1"], [], "1 names and 0"),
    (["joint_1"], [0.1, 0.2], "1 names and 2"), (["joint_1", "joint_1"], [0.1, 0.1], "'joint_1' twice"),
    (["joint_7"], [0.1], "'joint_7'"), (["left_joint_1"], [0.1], "left_joint_1"),
    (["joint_1"], [float("nan")], "finite"), (["joint_1"], [math.inf], "finite")])
def test_joints_that_cannot_be_understood(names, velocity, told):
    with pytest.raises(InvalidCommand, match=told):
        joint_wish(joints(names, velocity), PLAIN)


@pytest.mark.parametrize("names, frame_id, frame", [
    (PLAIN, "base", JogFrame.BASE), (PLAIN, "base_link", JogFrame.BASE), (PLAIN, "tool", JogFrame.TOOL),
    (LEFT, "base", JogFrame.BASE), (LEFT, "left_base_link", JogFrame.BASE), (LEFT, "left_tool", JogFrame.TOOL),
    (PLAIN, "", None), (PLAIN, "tool0", None), (PLAIN, "world", None), (LEFT, "base_link", None)])
def test_frames_are_called_as_in_tf_or_base_and_tool(names, frame_id, frame):
    if frame is None:
        with pytest.raises(InvalidCommand, match="frame_id is .*; valid: "):
            jog_frame(frame_id, names)
    else:
        assert jog_frame(frame_id, names) is frame


def test_the_core_is_told_who_said_what_and_how_old_it_is(topics):
    told = topics.say("~jog_joints", joints(["joint_1"], [0.1]))
    assert told.source == "/pad on ~jog_joints" and told.age == pytest.approx(0.05) and told.received_at == 5.0
    assert told.stamp_ns == int((NOW - 0.05) * 1e9) and told.wish.velocity[0] == 0.1
    told = topics.say("~jog_twist", twist("tool", y=0.2), publisher="/other")
    assert told.source == "/other on ~jog_twist" and told.wish == (JogFrame.TOOL, (0.0, 0.2, 0.0, 0.0, 0.0, 0.0), TOOL)


@pytest.mark.parametrize("number, frame_id, velocity", [
    (3, "user", (0.0, 0.2)), (3, "user_frame_3", (0.0, 0.2)), (3, "base", (0.2, 0.0)), (0, "user", (0.2, 0.0))])
def test_the_user_frame_is_the_active_one_and_base_the_true_base(topics, number, frame_id, velocity):
    topics._arm.user_frame_id = number
    message = twist(frame_id, x=0.2)
    message.twist.angular.x = 0.2
    wish = topics.say("~jog_twist", message).wish
    assert wish.frame is JogFrame.BASE and wish.velocity == (*velocity, 0.0, *velocity, 0.0)


def test_a_user_frame_that_is_not_known_or_not_active_is_refused(topics):
    topics._arm.user_frame_id = 4
    assert topics.say("~jog_twist", twist("user", x=0.2)).problem == "the active user frame is not known yet"
    assert "frame_id is 'user_frame_3'; valid: " in topics.say("~jog_twist", twist("user_frame_3", x=0.2)).problem


def test_turning_is_read_behind_moving(topics):
    message = twist()
    message.twist.angular.x, message.twist.angular.z = 0.1, 0.3
    assert topics.say("~jog_twist", message).wish.velocity == (0.0, 0.0, 0.0, 0.1, 0.0, 0.3)


@pytest.mark.parametrize("message, problem", [
    (twist("camera"), "frame_id is 'camera'"), (twist(x=float("nan")), "twist holds .nan"),
    (twist(z=-math.inf), "finite")], ids=["frame", "nan", "inf"])
def test_the_core_is_told_what_cannot_be_understood(topics, message, problem):
    told = topics.say("~jog_twist", message)
    assert told.wish is None and problem.replace(".nan", "[nan") in told.problem


def test_a_tool_that_is_not_known_or_a_state_that_is_stale_is_told(topics):
    topics._frames.tool = None
    assert "not known yet" in topics.say("~jog_twist", twist()).problem
    topics._arm.is_stale = True
    assert "no fresh state" in topics.say("~jog_twist", twist()).problem


def test_messages_that_let_go_are_recorded_as_a_stream_of_their_own(topics):
    for velocity in (0.2, 0.0, float("nan")):
        topics.say("~jog_joints", joints(["joint_1"], [velocity]))
    assert topics.recorded == [(False, ""), (False, "at rest"), (False, "")]
