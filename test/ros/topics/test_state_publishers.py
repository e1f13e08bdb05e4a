"""The messages that are published of a state, driven by states and times, without a ROS master."""
import dataclasses
from types import SimpleNamespace

import pytest

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.rotations import IDENTITY
from jaka_ros_driver.ros import convert
from jaka_ros_driver.ros.packed import PackedLayout
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.topics import state_publishers
from jaka_ros_driver.state import RobotState

FEED_PERIOD = 0.1
"""Period of a slow feed, s: its samples are repeated."""
STATE = RobotState((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), True, True, True, False, False, tcp_position=(0.4, 0.1, 0.3),
                   tcp_rpy=(0.0, 0.0, 0.5), user_frame_id=3)
REPEATED = ("~tool_position", "~joint_position", "~robot_states")


class Topic:
    """A keeper of what is published.

    Attributes:
        listeners: How many subscribe to it.
    """

    def __init__(self):
        self.messages = []
        self.listeners = 1

    def get_num_connections(self):
        return self.listeners

    def publish(self, message):
        self.messages.append(message)


class Packed:
    """A packed topic that makes every message, and holds the numbers beside it against the message's own."""

    def __init__(self, topic, fields):
        self._topic = topic
        self._fields = fields
        self._shapes = {}

    def is_heard(self):
        return bool(self._topic.listeners)

    def publish(self, shape, make, numbers):
        message = make()
        layout = PackedLayout(message)
        assert (layout.numbers, layout.fields) == (numbers, self._fields)
        if hasattr(message, "header"):
            message.header.seq = 0
        same = self._shapes.setdefault(shape, layout)
        assert same.pack(0, numbers) == layout.pack(0, numbers), "another text or length, and the same shape"
        self._topic.publish(message)


class Bench:
    """The publishers on an arm whose states the test gives.

    Attributes:
        topics: By name.
        arm: The arm's client, as far as it is used.
        frames: The transforms of tool and user frame by a state; None where they are not known.
        publishers: The publishers under test.
    """

    def __init__(self, monkeypatch, **parameters):
        self.topics = {}
        monkeypatch.setattr(state_publishers, "_publisher", lambda name, _: self.topics.setdefault(name, Topic()))
        monkeypatch.setattr(state_publishers, "PackedTopic", Packed)
        monkeypatch.setattr(state_publishers, "ros_clock", lambda: lambda: 10 ** 18)
        self.arm = SimpleNamespace(
            settings=SimpleNamespace(feed_period=0.008), model=load_model("zu7"), is_servo_active=False,
            is_stream_moving=None, link_health=SimpleNamespace(status_is_up=True),
            add_listener=self._listen, add_task=lambda task: None)
        self.frames = SimpleNamespace(flange_t_tool=lambda state: IDENTITY, base_t_user=lambda state: IDENTITY)
        self.publishers = state_publishers.StatePublishers(self.arm, DriverConfig(**parameters), self.frames)
        self.publishers.start()
        self.now = 100.0

    def _listen(self, listener):
        self.arrived = listener

    def feed(self, count, is_new=True, **fields):
        for _ in range(count):
            self.now += FEED_PERIOD
            self.arrived(dataclasses.replace(STATE, received_at=self.now, **fields), is_new)
        return self

    def counts(self):
        return {name: len(topic.messages) for name, topic in self.topics.items()}

    def newest(self, name):
        return self.topics[name].messages[-1]


@pytest.fixture
def bench(monkeypatch):
    return Bench(monkeypatch)


def test_a_new_state_is_on_every_topic(bench):
    bench.feed(1)
    assert set(bench.counts().values()) == {1} and len(bench.topics) == 5
    assert bench.newest("~joint_position").position == list(STATE.joint_position)
    assert bench.newest("~tool_position").header.frame_id == "user_frame_3"


@pytest.mark.parametrize("interface", ["documented", "vendor", "vendor_2025"])
def test_every_new_pose_of_the_tool_is_published_and_one_at_rest_is_made_once(monkeypatch, interface):
    bench, made = Bench(monkeypatch, interface=interface), []
    for name in ("tool_twist", "tool_pose"):
        make = getattr(convert, name)
        monkeypatch.setattr(convert, name, lambda *words, make=make: made.append(1) or make(*words))
    for fields in ({}, {"tcp_position": (0.4, 0.1, 0.2)}, {"tcp_rpy": (0.0, 0.1, 0.5)}, {"tcp_rpy": None}, {}):
        bench.feed(3, **fields)
    messages = [str(message).split("frame_id")[1] for message in bench.topics["~tool_position"].messages]
    assert [messages.count(one) for one in dict.fromkeys(messages)] == [6, 3, 3] and messages[0] == messages[-1]
    assert len(made) == 5


def test_old_news_is_not_published(bench):
    bench.feed(5, is_new=False)
    assert not any(bench.counts().values())


def test_the_newest_state_of_a_slow_feed_is_repeated_with_its_own_stamp(bench):
    bench.feed(10)
    assert bench.publishers.due() is not None
    bench.publishers.run(bench.now + 0.01)
    for name in REPEATED:
        *_, last, repeated = bench.topics[name].messages
        assert len(bench.topics[name].messages) == 11 and repeated == last
    assert len(bench.topics["joint_states"].messages) == len(bench.topics["/tf"].messages) == 10


def test_a_message_that_nobody_listens_to_is_not_made(bench, monkeypatch):
    bench.feed(1)
    for topic in bench.topics.values():
        topic.listeners = 0
    for name in ("tool_twist", "joint_position", "robot_conditions", "transform_message"):
        monkeypatch.setattr(state_publishers.convert, name, lambda *_: pytest.fail("a message was made for nobody"))
    bench.feed(10)
    bench.publishers.run(bench.now + 0.01)
    assert set(bench.counts().values()) == {1}


@pytest.mark.parametrize("trouble", ["stale", "no link"])
def test_a_state_that_is_stale_or_whose_link_is_down_is_not_repeated_then_or_later(bench, trouble):
    bench.feed(10)
    if trouble == "stale":
        bench.now += DriverConfig().stale_after
    else:
        bench.arm.link_health.status_is_up = False
    bench.publishers.run(bench.now + 0.001)
    assert set(bench.counts().values()) == {10}
    assert bench.publishers.due() is None


def test_a_pose_that_the_controller_does_not_tell_is_not_published(bench):
    bench.feed(1, tcp_position=None)
    assert bench.counts()["~tool_position"] == 0 and bench.counts()["~joint_position"] == 1


@pytest.mark.parametrize("publish_tf, unknown, links", [
    ("all", (), ["base_link tool0", "tool0 tool", "base_link user_frame_3"]),
    ("tool", (), ["tool0 tool", "base_link user_frame_3"]),
    ("all", ("flange_t_tool",), ["base_link tool0", "base_link user_frame_3"]),
    ("all", ("base_t_user",), ["base_link tool0", "tool0 tool"])])
def test_the_transforms_are_those_of_flange_tool_and_user_frame_as_far_as_they_are_known(
        monkeypatch, publish_tf, unknown, links):
    bench = Bench(monkeypatch, publish_tf=publish_tf)
    for name in unknown:
        setattr(bench.frames, name, lambda state: None)
    transforms = bench.feed(1).newest("/tf").transforms
    assert ["%s %s" % (one.header.frame_id, one.child_frame_id) for one in transforms] == links


@pytest.mark.parametrize("interface", ["documented", "vendor", "vendor_2025"])
def test_what_is_packed_is_what_the_messages_say_whatever_changes(monkeypatch, interface):
    bench = Bench(monkeypatch, interface=interface)
    for fields in ({}, {"user_frame_id": 0}, {"joint_velocity": (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)}, {"is_powered": False},
                   {"protective_stop": True}, {"joint_position": (0.0,) * 6, "tcp_rpy": (1.0, -0.5, 3.0)}) * 3:
        bench.feed(1, **fields)
    assert set(bench.counts().values()) == {18}
    vendor = "pose" if interface == "vendor_2025" else "twist"
    assert hasattr(bench.newest("~tool_position"), vendor)
