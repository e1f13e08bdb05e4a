"""State topics of the running node: rate, stamps, units, slow feeds, silence."""
import contextlib
import math

import pytest
import rospy
from driver_bench import HOME, collecting
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from waiting import eventually

from jaka_msgs.msg import RobotMsg
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward

TOPICS = {"tool_position": TwistStamped, "joint_position": JointState, "robot_states": RobotMsg}


def stamps(messages):
    return [message.header.stamp.to_sec() for _, message in messages]


@pytest.fixture
def feed(arm):
    """Return the simulated controller's operator port; undo whatever was done to the feed."""
    yield arm.simulator
    arm.simulator.operate("clear_faults")
    assert eventually(lambda: rate_of(arm, 0.5) == pytest.approx(125.0, rel=0.1))


@contextlib.contextmanager
def newest_of(topic, topic_type):
    """Yield a function that returns the newest message."""
    with collecting(topic, topic_type) as received:
        assert eventually(lambda: received)
        yield lambda: received[-1][1]


def rate_of(arm, duration):
    with collecting(arm.name + "/joint_position", JointState) as messages:
        start = len(messages)
        rospy.sleep(duration)  # the time over which a rate is counted
        return (len(messages) - start) / duration


@pytest.mark.parametrize("topic", TOPICS)
def test_each_topic_comes_125_times_a_second(arm, topic):
    assert isinstance(arm.listen(topic, 1)[0], TOPICS[topic])
    with collecting("%s/%s" % (arm.name, topic), TOPICS[topic]) as received:
        def at_full_rate():
            """Return whether the last second was full; a busy host delays everybody now and then."""
            times = [at for at, _ in received[-126:]]
            return len(times) == 126 and 125.0 / (times[-1] - times[0]) == pytest.approx(125.0, rel=0.02)
        assert eventually(at_full_rate)


def test_stamps_are_arrival_times_and_strictly_increase(arm):
    with collecting(arm.name + "/joint_position", JointState) as received:
        assert eventually(lambda: len(received) > 500)
    times = stamps(received)
    assert times == sorted(times) and len(set(times)) > 450
    ages = sorted(at - stamp for (at, _), stamp in zip(received, times))
    assert 0.0 <= ages[0] and ages[len(ages) // 2] < 0.25


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
    with newest_of(arm.name + "/robot_states", RobotMsg) as newest:
        arm.call("jog", mvvelo=0.1, index=0)
        assert eventually(lambda: newest().motion_state == 3)
        arm.call("stop_move")
        assert eventually(lambda: newest().motion_state == 0)
        arm.call("servo_move_enable", enable=True)
        assert eventually(lambda: newest().servo_state == 1)
        arm.call("servo_move_enable", enable=False)
        assert eventually(lambda: newest().servo_state == 0)
        arm.simulator.operate("press_emergency_stop")
        assert eventually(lambda: newest().motion_state == 2)
        arm.simulator.operate("release_emergency_stop")
        arm.call("clear_err")
        assert arm.call("power", data=True).success and arm.call("enable", data=True).success
        assert eventually(lambda: newest().motion_state == 0 and newest().power_state == 1)


def test_joint_states_have_velocity(arm):
    arm.go_home()
    with newest_of("/joint_states", JointState) as newest:
        def velocity_is(expected, tolerance):
            """Return whether the velocity is this; none is reported right after a gap in the feed."""
            velocity = newest().velocity
            return len(velocity) == 6 and velocity == pytest.approx(expected, abs=tolerance)
        assert eventually(lambda: velocity_is([0.0] * 6, 1e-6))
        arm.call("jog", mvvelo=0.2, index=3)
        assert eventually(lambda: velocity_is([0.0, -0.2, 0.0, 0.0, 0.0, 0.0], 0.02))
        arm.call("stop_move")
        assert eventually(lambda: velocity_is([0.0] * 6, 1e-3))


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
    feed.operate("slow_feed", rate=40.0)
    with collecting(arm.name + "/joint_position", JointState) as received:
        def filled():
            """Return whether the last second has 125 messages, of 40 samples."""
            window = received[-126:]
            elapsed = window[-1][0] - window[0][0]
            return 125.0 / elapsed == pytest.approx(125.0, rel=0.03) and (
                len(set(stamps(window))) / elapsed == pytest.approx(40.0, rel=0.1))
        assert eventually(lambda: len(received) > 126)
        assert eventually(filled)
    assert stamps(received) == sorted(stamps(received))


def test_a_feed_at_the_full_rate_is_never_filled(arm):
    # Unless the host is so busy that the simulated controller itself falls behind: then once more.
    with collecting(arm.name + "/joint_position", JointState) as received:
        assert eventually(lambda: len(received) > 250 and len(set(stamps(received[-250:]))) == 250)


def repeats_across_a_gap(received):
    """Count how often the last sample before a second without samples was published; 0 where there is no such gap.

    Counted, not timed: a busy host may deliver late.
    """
    times = stamps(list(received))
    return next((times.count(a) for a, b in zip(times, times[1:]) if b - a > 1.0), 0)


@pytest.mark.parametrize("rate, most", [(None, 1), (40.0, 65)], ids=["full rate", "slow feed"])
def test_nothing_is_published_of_a_stale_state(arm, feed, rate, most):
    # A sample is stale 0.5 s after its arrival: at most 63 messages can be made of it, and one of a fast feed.
    with collecting(arm.name + "/joint_position", JointState) as received:
        if rate:
            feed.operate("slow_feed", rate=rate)
            assert eventually(lambda: len(received) > 200 and len(set(stamps(received[-100:]))) < 60)
        assert eventually(lambda: len(received) > 10)
        feed.operate("stall", port="status", duration_ms=2500)
        assert eventually(lambda: repeats_across_a_gap(received))
    assert repeats_across_a_gap(received) <= most


def test_nothing_is_published_while_the_link_is_down(arm, feed):
    with collecting(arm.name + "/joint_position", JointState) as received:
        assert eventually(lambda: len(received) > 10)
        feed.operate("refuse", port="status", duration_ms=2000)
        feed.operate("close", port="status")
        assert eventually(lambda: repeats_across_a_gap(received))
    assert repeats_across_a_gap(received) <= 3
