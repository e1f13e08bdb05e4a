"""~wrench, ~joint_temperatures, ~joint_currents: when they are offered and published, and on the running node."""
import contextlib
import dataclasses
import logging
from types import SimpleNamespace

import pytest
import rospy
from driver_bench import Arm, DriverProcess, SimulatorProcess, collecting, on
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from waiting import eventually

from jaka_ros_driver.ros.topics import sensors
from jaka_ros_driver.ros.topics.stamps import SampleStamps, StampClock
from jaka_ros_driver.state import RobotState

PERIOD_S = 0.008
STATE = RobotState((0.0,) * 6, True, True, True, False, False)
VALUES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
TOPICS = {"~wrench": "wrench", "~joint_temperatures": "joint_temperature", "~joint_currents": "joint_current"}


class Bench:
    """The publishers on an arm whose states the test gives; ``messages`` by topic, for the topics that are offered."""

    def __init__(self, monkeypatch):
        self.messages, self.subscribers, self.now = {}, 1, 100.0
        monkeypatch.setattr(sensors, "direct_publisher", lambda name, *_, **__: SimpleNamespace(
            publish=self.messages.setdefault(name, []).append, get_num_connections=lambda: self.subscribers))
        self.arm = SimpleNamespace(state=None, settings=SimpleNamespace(feed_period=PERIOD_S),
                                   add_listener=lambda listener: setattr(self, "arrived", listener))
        stamps = SampleStamps(StampClock(lambda: int(self.now * 1e9), lambda: self.now))
        self.publishers = sensors.SensorPublishers(self.arm, stamps, "left_tool0")
        self.publishers.start()

    def feed(self, count=1, is_new=True, **fields):
        for _ in range(count):
            self.now += PERIOD_S
            self.arm.state = dataclasses.replace(STATE, received_at=self.now, **fields)
            self.arrived(self.arm.state, is_new)
        self.publishers.offer()
        return self

    def counts(self):
        return {name: len(messages) for name, messages in self.messages.items()}


@pytest.fixture
def bench(monkeypatch):
    return Bench(monkeypatch)


@pytest.mark.parametrize("topic", TOPICS)
def test_a_topic_is_offered_once_the_feed_has_its_values(bench, topic):
    bench.publishers.offer()
    assert bench.feed(5).counts() == {}
    assert bench.feed(**{TOPICS[topic]: VALUES}).counts() == {topic: 0}
    assert bench.feed(**{TOPICS[topic]: VALUES}).counts() == {topic: 1}


def test_the_wrench_comes_with_each_sample_temperatures_and_currents_seldom(bench):
    everything = dict.fromkeys(TOPICS.values(), VALUES)
    counts = bench.feed(**everything).feed(1250, **everything).counts()
    assert counts["~wrench"] == 1250
    assert counts["~joint_temperatures"] in (10, 11) and 96 <= counts["~joint_currents"] <= 105
    wrench = bench.messages["~wrench"][-1]
    assert (wrench.header.frame_id, wrench.wrench.force.z, wrench.wrench.torque.x) == ("left_tool0", 3.0, 4.0)
    assert wrench.header.stamp.to_sec() == pytest.approx(bench.now)
    temperatures = bench.messages["~joint_temperatures"][-1]
    assert list(temperatures.data) == list(VALUES) and temperatures.layout.dim[0].size == 6


def test_nothing_is_published_that_is_old_or_lacks_the_value_or_that_nobody_hears(bench):
    everything = dict.fromkeys(TOPICS.values(), VALUES)
    bench.feed(**everything).feed(**everything)
    before = bench.counts()
    bench.feed(50, is_new=False, **everything).feed(50)
    bench.subscribers = 0
    assert bench.feed(50, **everything).counts() == before


def test_a_sensor_that_fails_is_told_in_the_log_once_and_again_when_it_is_well(bench, caplog):
    with caplog.at_level(logging.INFO, sensors.__name__):
        bench.feed(wrench=VALUES).feed(3, sensor_error=17).feed(wrench=VALUES).feed(wrench=VALUES)
        bench.publishers.offer()
    assert [record.getMessage() for record in caplog.records] == [
        "the force sensor reports error 17: ~wrench is silent", "the force sensor reports no error any more"]


# ---- on the running node ----

@pytest.fixture(scope="module")
def simulator():
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--force-sensor")) as process:
        yield process


def read(message):
    force, torque = message.wrench.force, message.wrench.torque
    return (force.x, force.y, force.z, torque.x, torque.y, torque.z)


def test_a_load_is_read_and_zeroed(arm):
    with collecting(arm.name + "/wrench", WrenchStamped) as received:
        assert eventually(lambda: received and read(received[-1][1]) == (0.0,) * 6)
        arm.simulator.operate("load_force_sensor", fx=10.0, fy=-5.0, mz=0.5)
        assert eventually(lambda: read(received[-1][1]) == (10.0, -5.0, 0.0, 0.0, 0.0, 0.5))
        answer = arm.call("zero_ftsensor")
        assert answer.success and answer.message == "the force sensor reads zero"
        assert eventually(lambda: read(received[-1][1]) == (0.0,) * 6)
        arm.simulator.operate("load_force_sensor")
        assert eventually(lambda: read(received[-1][1]) == (-10.0, 5.0, 0.0, 0.0, 0.0, -0.5))
    assert arm.call("zero_ftsensor").success
    assert received[-1][1].header.frame_id == "tool0"


def test_the_wrench_has_the_rate_and_the_stamps_of_the_joints(arm):
    with collecting(arm.name + "/wrench", WrenchStamped) as wrenches, \
            collecting(arm.name + "/joint_position", JointState) as joints:
        assert eventually(lambda: len(wrenches) > 130)
        assert eventually(lambda: {message.header.stamp for _, message in wrenches[20:120]} <= {
            message.header.stamp for _, message in joints})
        assert eventually(lambda: 100 / (wrenches[-1][0] - wrenches[-101][0]) == pytest.approx(125.0, rel=0.1))


def test_temperatures_and_currents_are_those_of_the_controller(arm):
    assert list(arm.listen("joint_temperatures", 1)[0].data) == [31.0] * 6
    with collecting(arm.name + "/joint_currents", Float64MultiArray) as received:
        assert eventually(lambda: len(received) > 3) and list(received[-1][1].data) == [0.4] * 6


def test_without_a_sensor_there_is_no_topic_and_nothing_to_zero(ros_node):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as without, DriverProcess(
            "numb", **on(without, guard=False)):
        other = Arm(without, "/numb")
        other.wait_until_seen()
        assert eventually(lambda: "/numb/joint_currents" in dict(rospy.get_published_topics("/numb")))
        assert "/numb/wrench" not in dict(rospy.get_published_topics("/numb"))
        refused = other.call("zero_ftsensor")
        assert not refused.success and refused.message == "the status feed shows no force sensor"
