"""State topics of the running node: rate, stamps, units, slow feeds, silence."""
import math

import pytest
import rospy
from arm_bench import eventually
from geometry_msgs.msg import TwistStamped
from ros_bench import HOME, collecting
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from jaka_msgs.msg import RobotMsg
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward

TOPICS = {"tool_position": TwistStamped, "joint_position": JointState, "robot_states": RobotMsg}


def stamps(messages):
    return [message.header.stamp.to_sec() for _, message in messages]


@pytest.fixture
def feed(arm):
    """The simulated controller's panel; whatever was done to the feed is undone."""
    yield arm.simulator
    arm.simulator.panel("clear_faults")
    assert eventually(lambda: rate_of(arm, 0.5) == pytest.approx(125.0, rel=0.1))


def rate_of(arm, duration):
    with collecting(arm.name + "/joint_position", JointState) as messages:
        start = len(messages)
        rospy.sleep(duration)
        return (len(messages) - start) / duration


@pytest.mark.parametrize("topic", TOPICS)
def test_each_topic_comes_125_times_a_second(arm, topic):
    assert isinstance(arm.listen(topic, 1)[0], TOPICS[topic])
    with collecting("%s/%s" % (arm.name, topic), TOPICS[topic]) as received:
        def at_full_rate():
            """Of the last second; a busy host delays everybody now and then."""
            times = [at for at, _ in received[-126:]]
            return len(times) == 126 and 125.0 / (times[-1] - times[0]) == pytest.approx(125.0, rel=0.01)
        assert eventually(at_full_rate)


def test_stamps_are_arrival_times_and_strictly_increase(arm):
    with collecting(arm.name + "/joint_position", JointState) as received:
        assert eventually(lambda: len(received) > 500)
    times = stamps(received)
    assert all(a < b for a, b in zip(times, times[1:])), "a stamp was used twice, at a healthy feed"
    ages = sorted(at - stamp for (at, _), stamp in zip(received, times))
    assert 0.0 <= ages[0] and ages[len(ages) // 2] < 0.05


def test_the_topics_tell_what_the_controller_has(arm):
    arm.go_home()
    truth = arm.simulator.state()
    joints, tool = arm.listen("joint_position", 1)[0], arm.listen("tool_position", 1)[0]
    assert joints.name == ["joint_%d" % n for n in range(1, 7)] and list(joints.velocity) == []
    assert joints.position == pytest.approx([math.radians(value) for value in truth["joint_position"]], abs=1e-6)
    linear = tool.twist.linear
    assert (linear.x, linear.y, linear.z) == pytest.approx([v / 1000.0 for v in truth["tcp_pose"][:3]], abs=1e-6)
    assert tool.header.frame_id == "base_link"
    states = arm.listen("robot_states", 1)[0]
    assert (states.motion_state, states.power_state, states.servo_state, states.collision_state) == (0, 1, 0, 0)


def test_motion_and_servo_mode_are_seen_in_robot_states(arm):
    with collecting(arm.name + "/robot_states", RobotMsg) as received:
        arm.call("jog", mvvelo=0.1, index=0)
        assert eventually(lambda: received[-1][1].motion_state == 3)
        arm.call("stop_move")
        assert eventually(lambda: received[-1][1].motion_state == 0)
        arm.call("servo_move_enable", enable=True)
        assert eventually(lambda: received[-1][1].servo_state == 1)
        arm.call("servo_move_enable", enable=False)
        assert eventually(lambda: received[-1][1].servo_state == 0)
        arm.simulator.panel("press_emergency_stop")
        assert eventually(lambda: received[-1][1].motion_state == 2)
        arm.simulator.panel("release_emergency_stop")
        arm.call("clear_err")
        assert arm.call("power", data=True).success and arm.call("enable", data=True).success
        assert eventually(lambda: received[-1][1].motion_state == 0 and received[-1][1].power_state == 1)


def test_joint_states_have_velocity(arm):
    with collecting("/joint_states", JointState) as received:
        arm.go_home()
        assert eventually(lambda: received and received[-1][1].velocity)
        arm.call("jog", mvvelo=0.2, index=3)
        assert eventually(lambda: abs(received[-1][1].velocity[1] + 0.2) < 0.02)
        assert abs(received[-1][1].velocity[0]) < 0.005
        arm.call("stop_move")
        assert eventually(lambda: max(map(abs, received[-1][1].velocity)) < 1e-3)


def test_transforms_are_our_model_at_the_measured_joints_and_the_active_tool(arm):
    arm.go_home()
    with collecting("/tf", TFMessage) as received:
        assert arm.call("set_toolframe", pose=[0.0, 0.0, 120.0, 0.0, 0.0, 0.0], tool_num=1).ret == 1
        assert arm.call("set_userframe", pose=[10.0, 0.0, 0.0, 0.0, 0.0, 0.0], user_num=1).ret == 1

        def newest():
            return {t.child_frame_id: t for t in received[-1][1].transforms} if received else {}
        assert eventually(lambda: set(newest()) == {"tool0", "tool", "user_frame_1"})
        assert eventually(lambda: newest()["tool"].transform.translation.z == pytest.approx(0.12))
    flange = newest()["tool0"]
    assert flange.header.frame_id == "base_link" and newest()["tool"].header.frame_id == "tool0"
    assert newest()["user_frame_1"].transform.translation.x == pytest.approx(0.01)
    expected = forward(load_model("zu7"), HOME)
    t = flange.transform.translation
    assert (t.x, t.y, t.z) == pytest.approx(expected[9:], abs=1e-5)
    assert arm.listen("tool_position", 1)[0].header.frame_id == "user_frame_1"
    assert arm.call("set_payload", tool_num=0, mass=0.0).ret == 1
    assert arm.call("set_userframe", pose=[0.0] * 6, user_num=1).ret == 1


def test_a_slow_feed_is_filled_up_with_samples_that_keep_their_stamp(arm, feed):
    feed.panel("slow_feed", rate=40.0)
    with collecting(arm.name + "/joint_position", JointState) as received:
        def filled():
            return len(received) > 260 and len(set(stamps(received[-125:]))) < 60
        assert eventually(filled)
        received[:] = []
        assert eventually(lambda: len(received) > 500)
        elapsed = received[500][0] - received[0][0]
    times = stamps(received[:500])
    assert 500 / elapsed == pytest.approx(125.0, rel=0.04)
    assert times == sorted(times) and len(set(times)) / elapsed == pytest.approx(40.0, rel=0.1)


def test_a_feed_at_the_full_rate_is_never_filled(arm):
    with collecting(arm.name + "/joint_position", JointState) as received:
        assert eventually(lambda: len(received) > 625)
    assert len(set(stamps(received))) == len(received)


@pytest.mark.parametrize("rate", [None, 40.0], ids=["full rate", "slow feed"])
def test_nothing_is_published_of_a_stale_state(arm, feed, rate):
    if rate:
        feed.panel("slow_feed", rate=rate)
        assert eventually(lambda: arm.listen("joint_position", 50))
    feed.panel("stall", port="status", duration_ms=2500)
    with collecting(arm.name + "/joint_position", JointState) as received:
        stalled_at = rospy.get_time()
        assert eventually(lambda: rospy.get_time() > stalled_at + 1.0)
        assert not [at for at, _ in received if at > stalled_at + 0.8]
        newest = max(stamps(received), default=0.0)
        assert all(at - newest < 0.75 for at, _ in received[-1:]), "older than stale_after, and published"
        count = len(received)
        assert eventually(lambda: len(received) > count + 100), "silent after the feed has come back"


def test_nothing_is_published_while_the_link_is_down(arm, feed):
    feed.panel("refuse", port="status", duration_ms=1500)
    feed.panel("close", port="status")
    with collecting(arm.name + "/robot_states", RobotMsg) as received:
        closed_at = rospy.get_time()
        assert eventually(lambda: rospy.get_time() > closed_at + 1.2)
        assert not [at for at, _ in received if at > closed_at + 0.3]
        assert eventually(lambda: len(received) > 100)
