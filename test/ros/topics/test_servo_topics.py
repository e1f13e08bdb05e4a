"""Servo targets that come by topic: which of them count, by their stamp."""
import io

import pytest
import rospy
import rospy.msg
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.convert import RequestDecoder
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.topics.servo_topics import ServoTopics
from jaka_ros_driver.ros.topics.state_publishers import FrameNames

NOW = 1000.0


class Arm:
    """A keeper of the targets that it is given."""

    user_frame_id = 0

    def __init__(self):
        self.targets = []

    def fresh_state(self):
        return self

    def servo_target(self, command):
        self.targets.append(command)


@pytest.fixture
def topics(monkeypatch):
    """Return the subscribed topics, as rospy would have it; ``send(message, stamp)`` gives the number of targets and
    refusals."""
    takers, refusals, arm = {}, [], Arm()
    monkeypatch.setattr(rospy, "Subscriber", lambda name, kind, take, **_: takers.update({kind: take}))
    monkeypatch.setattr(rospy.Time, "now", classmethod(lambda cls: rospy.Time.from_sec(NOW)))
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda period, text: refusals.append((period, text)))
    ServoTopics(arm, RequestDecoder(load_model("zu7"), False, False, False), FrameNames(DriverConfig()),
                Recorder(None)).start()

    def send(message, stamp):
        message.header.stamp = rospy.Time.from_sec(stamp)
        takers[type(message)](message)
        return len(arm.targets), refusals

    return send


def joints():
    return JointState(position=[0.0, 1.5, -1.5, 1.5, 1.5, 0.0])


def pose():
    message = PoseStamped()
    message.pose.position.x, message.pose.orientation.w = 0.4, 1.0
    return message


@pytest.mark.parametrize("make", [joints, pose])
@pytest.mark.parametrize("stamp", [0.0, NOW, NOW - 0.19, NOW + 0.04])
def test_a_target_with_a_fresh_stamp_or_none_counts(topics, make, stamp):
    assert topics(make(), stamp) == (1, [])


@pytest.mark.parametrize("make", [joints, pose])
@pytest.mark.parametrize("stamp, told", [
    (NOW - 60.0, "60.000 s old"), (NOW - 0.25, "0.250 s old"), (NOW + 60.0, "60.000 s in the future"),
    (NOW + 0.1, "0.100 s in the future"), (1e-9, "1000.000 s old")])
def test_a_target_that_is_old_or_from_a_clock_ahead_moves_nothing_and_is_logged(topics, make, stamp, told):
    count, ((period, text),) = topics(make(), stamp)
    assert count == 0 and period == 1.0 and "header.stamp is " + told in text


@pytest.mark.parametrize("kind, target", [(JointState, joints), (PoseStamped, pose)])
def test_of_targets_that_come_together_only_the_newest_is_taken(monkeypatch, kind, target):
    # A link that was held up brings them all at once; rospy keeps as many of them as the queue is long.
    made = {}
    monkeypatch.setattr(rospy, "Subscriber", lambda name, kind, take, **options: made.update({kind: options}))
    ServoTopics(Arm(), RequestDecoder(load_model("zu7"), False, False, False), FrameNames(DriverConfig()),
                Recorder(None)).start()
    buffer, kept = io.BytesIO(), []
    for second in range(1, 4):
        message = target()
        message.header.stamp = rospy.Time(second)
        rospy.msg.serialize_message(buffer, second, message)
    rospy.msg.deserialize_messages(buffer, kept, kind, made[kind]["queue_size"], buffer.tell())
    assert [message.header.stamp.secs for message in kept] == [3]
