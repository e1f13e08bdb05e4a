"""The frames that servo targets become: they break no speed limit."""
import contextlib
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaka_ros_driver.client.core.servo_planner import JointServo, PoseServo
from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.limits import (
    JOINT_ACCELERATION_CEILING,
    JOINT_SPEED_CEILING,
    STREAM_INSET,
    stream_limits,
)
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between

PERIOD = 0.008
HOME = (0.0, 1.5, -1.5, 1.5, 1.5, 0.0)
ZU3 = load_model("zu3")
SPEEDS = ZU3.joint_max_speed
POSE = Pose((0.4, 0.1, 0.3), (3.0, 0.1, 0.2))


def joint_servo(max_jump=0.1, ahead=2.0):
    return JointServo(HOME, ZU3, max_jump, ahead, PERIOD)


def shifted(by, joint=0):
    return tuple(q + by if index == joint else q for index, q in enumerate(HOME))


def test_without_a_target_every_frame_holds():
    servo = joint_servo()
    assert all(servo.next_frame().joint_position == HOME for _ in range(100))


def test_a_smooth_stream_is_passed_on_as_it_is_once_under_way():
    servo = joint_servo()
    for cycle in range(1, 300):
        target = shifted(0.3 * (1 - math.cos(0.01 * cycle)))
        servo.set_target(target, False)
        assert servo.next_frame().joint_position == pytest.approx(target, abs=1e-12)


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("jump", [0.1, -0.1, 1e-4])
def test_a_jump_is_driven_within_speed_and_reached_exactly(joint, jump):
    servo = joint_servo()
    servo.set_target(shifted(jump, joint), False)
    last = HOME
    for _ in range(200):
        frame = servo.next_frame().joint_position
        assert max(abs(a - b) for a, b in zip(frame, last)) <= JOINT_SPEED_CEILING * PERIOD * (1 + 1e-9)
        last = frame
    assert last == pytest.approx(shifted(jump, joint), abs=1e-9)


@pytest.mark.parametrize("joint", range(6))
def test_a_long_way_is_driven_at_the_joints_highest_speed_and_no_faster(joint):
    servo, steps, way = joint_servo(max_jump=3.0), [], 2.5 if joint == 2 else -2.5
    servo.set_target(shifted(way, joint), False)
    last = HOME[joint]
    for _ in range(250):
        frame = servo.next_frame().joint_position[joint]
        steps.append(abs(frame - last))
        last = frame
    assert last == pytest.approx(HOME[joint] + way, abs=1e-9)
    assert max(steps) == pytest.approx(min(SPEEDS[joint], JOINT_SPEED_CEILING) * PERIOD, rel=1e-9)


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(1, 5), st.lists(st.floats(-0.1, 0.1), min_size=6, max_size=6)), max_size=40))
def test_whatever_targets_come_no_step_breaks_the_limits(stream):
    servo, last, before = joint_servo(), HOME, (0.0,) * 6
    for cycles, target in stream:
        with contextlib.suppress(InvalidCommand):
            servo.set_target(tuple(target), True)
        for _ in range(cycles):
            frame = servo.next_frame().joint_position
            velocity = tuple((a - b) / PERIOD for a, b in zip(frame, last))
            for speed, was, limit in zip(velocity, before, SPEEDS):
                assert abs(speed) <= min(limit, JOINT_SPEED_CEILING) * (1 + 1e-6)
                assert abs(speed - was) <= 4 * math.pi * PERIOD * (1 + 1e-6)
            last, before = frame, velocity


def test_a_target_too_far_away_is_refused_with_its_distance_and_nothing_moves():
    servo = joint_servo()
    with pytest.raises(InvalidCommand, match=r"joint 3 .* 0\.2000 rad .* 0\.1000 rad"):
        servo.set_target(shifted(0.2, joint=2), False)
    assert servo.next_frame().joint_position == HOME


def test_increments_add_up_and_none_is_lost():
    servo = joint_servo()
    for _ in range(50):
        servo.set_target((0.002, 0, 0, 0, 0, 0), True)
    for _ in range(200):
        frame = servo.next_frame()
    assert frame.joint_position[0] == pytest.approx(0.1)


def pose_servo():
    return PoseServo(POSE, 1.0, 0.05, 0.1, 2.0, PERIOD)


def test_a_pose_target_is_reached_within_its_limits():
    servo = pose_servo()
    goal = Pose((0.44, 0.1, 0.3), (3.0, 0.1, 0.28))
    servo.set_target(goal, False)
    last = POSE
    for _ in range(200):
        pose = servo.next_frame().target
        assert math.dist(pose.position, last.position) <= 1.0 * PERIOD * (1 + 1e-9)
        turn = rotation_angle_between(matrix_from_rpy(pose.rpy), matrix_from_rpy(last.rpy))
        assert turn <= JOINT_SPEED_CEILING * PERIOD * (1 + 1e-6)
        last = pose
    assert last.position == pytest.approx(goal.position, abs=1e-9)
    assert rotation_angle_between(matrix_from_rpy(last.rpy), matrix_from_rpy(goal.rpy)) < 1e-7


@pytest.mark.parametrize("pose", [Pose((0.46, 0.1, 0.3), POSE.rpy), Pose(POSE.position, (3.0, 0.1, 0.4))])
def test_a_pose_too_far_away_is_refused(pose):
    servo = pose_servo()
    with pytest.raises(InvalidCommand, match="more than the allowed 0.0500 m or 0.1000 rad"):
        servo.set_target(pose, False)
    assert servo.next_frame().target.position == pytest.approx(POSE.position)


def test_pose_increments_add_along_the_user_frame():
    servo = pose_servo()
    for _ in range(10):
        servo.set_target(Pose((0.001, 0.0, 0.0), (0.0, 0.0, 0.0)), True)
    for _ in range(100):
        pose = servo.next_frame().target
    assert pose.position == pytest.approx((0.41, 0.1, 0.3))
    assert rotation_angle_between(matrix_from_rpy(pose.rpy), matrix_from_rpy(POSE.rpy)) < 1e-9


def test_targets_that_come_faster_than_the_arm_can_follow_do_not_add_up():
    servo = joint_servo(ahead=0.1)
    accepted = 0.0
    for step in range(1, 41):
        with contextlib.suppress(InvalidCommand):
            servo.set_target(shifted(0.1 * step), False)
            accepted = 0.1 * step
    assert accepted == 0.0
    assert servo.next_frame().joint_position == HOME


@pytest.mark.parametrize("ahead", [0.05, 0.1, 0.5])
def test_an_accepted_target_is_reached_within_servo_ahead(ahead):
    servo, farthest = joint_servo(ahead=ahead), 0.0
    for step in range(1, 1000):
        try:
            servo.set_target(shifted(0.0005 * step), False)
        except InvalidCommand as refusal:
            assert "servo_ahead" in str(refusal) or "more than the allowed" in str(refusal)
            break
        farthest = 0.0005 * step
    assert farthest > 0.0
    for _ in range(int(ahead / PERIOD + 1e-6)):
        frame = servo.next_frame()
    assert frame.joint_position[0] == pytest.approx(farthest, abs=1e-6)
    assert servo.next_frame().joint_position[0] == pytest.approx(farthest, abs=1e-6)


@pytest.mark.parametrize("cycles", [1, 25, 43, 51, 125])
def test_servo_ahead_is_counted_in_whole_cycles_whatever_its_rounding(cycles):
    def farthest(ahead):
        servo, reached = joint_servo(max_jump=3.0, ahead=ahead), 0.0
        for step in range(1, 2000):
            try:
                servo.set_target(shifted(0.0001 * cycles * step), False)
            except InvalidCommand:
                break
            reached = 0.0001 * cycles * step
        return reached
    assert 0.0 < farthest(cycles * 8 / 1000) == farthest(cycles * 0.008 + 0.004)


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("side", [0, 1])
def test_a_target_that_float32_puts_beyond_a_limit_is_led_to_where_streams_end(joint, side):
    limit, end = ZU3.joint_limits[joint][side], stream_limits(ZU3)[joint][side]
    inside = tuple(limit + (5e-3 if side == 0 else -5e-3) if n == joint else q for n, q in enumerate(HOME))
    servo = JointServo(inside, ZU3, 0.1, 0.5, PERIOD)
    led = servo.set_target(tuple(limit + (-5e-7 if side == 0 else 5e-7) if n == joint else q
                                 for n, q in enumerate(HOME)), False)
    assert "joint %d is led to %.6f rad" % (joint + 1, end) in led
    for _ in range(60):
        reached = servo.next_frame().joint_position[joint]
        assert stream_limits(ZU3)[joint][0] <= reached <= stream_limits(ZU3)[joint][1]
    assert reached == pytest.approx(end, abs=1e-9)
    assert servo.is_at_rest, "a target that cannot be reached would keep the arm in servo mode"


def test_increments_do_not_pass_a_joint_limit():
    low, high = ZU3.joint_limits[1]
    servo = JointServo((0.0, high - 0.0025) + HOME[2:], ZU3, 0.1, 0.1, PERIOD)
    assert servo.set_target((0.0, 0.001, 0.0, 0.0, 0.0, 0.0), True) == ""
    for _ in range(9):  # led increments do not add up
        assert "joint 2 is led" in servo.set_target((0.0, 0.0009, 0.0, 0.0, 0.0, 0.0), True)
    with pytest.raises(InvalidCommand, match="joint 2"):
        servo.set_target((0.0, 0.0011, 0.0, 0.0, 0.0, 0.0), True)
    for _ in range(20):
        assert servo.next_frame().joint_position[1] <= high - STREAM_INSET


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("beyond", [-9e-4, -1e-6, 0.0, 0.05])
def test_an_arm_beyond_the_end_of_streams_is_neither_pushed_back_nor_refused_the_way_out(beyond, side):
    sign = 1.0 if side else -1.0
    start = ZU3.joint_limits[1][side] + sign * beyond
    servo = JointServo((HOME[0], start, *HOME[2:]), ZU3, 0.1, 0.2, PERIOD)
    for _ in range(20):
        assert servo.next_frame().joint_position[1] == start
    with pytest.raises(InvalidCommand, match="joint 2"):
        servo.set_target((HOME[0], start + sign * 0.01, *HOME[2:]), False)
    if beyond < 0.0:
        assert "is led to %.6f rad" % start in servo.set_target(
            (HOME[0], ZU3.joint_limits[1][side], *HOME[2:]), False) or beyond > -2e-6
    for step in range(1, 30):
        assert servo.set_target((HOME[0], start - sign * 0.002 * step, *HOME[2:]), False) == ""
        assert sign * servo.next_frame().joint_position[1] <= sign * start
    for _ in range(60):
        servo.next_frame()
    assert servo.next_frame().joint_position[1] == pytest.approx(start - sign * 0.058)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0, 3.0])
def test_a_fast_stream_that_ends_at_a_limit_does_not_pass_it(speed, side):
    low, high = stream_limits(ZU3)[1]
    limit, sign = (low, -1.0) if side == 0 else (high, 1.0)
    began = limit - sign * 1.5
    servo = JointServo((HOME[0], began, *HOME[2:]), ZU3, 0.1, 0.2, PERIOD)
    target, now, velocity, fastest = began, began, 0.0, 0.0
    for cycle in range(900):
        target += sign * min(speed, 10.0 * PERIOD * (cycle + 1)) * PERIOD
        target = min(max(target, low), high)
        with contextlib.suppress(InvalidCommand):  # what the arm cannot follow near the limit
            servo.set_target((HOME[0], target, *HOME[2:]), False)
        then, now, was = now, servo.next_frame().joint_position[1], velocity
        velocity = (now - then) / PERIOD
        assert low <= now <= high
        assert abs(velocity - was) <= JOINT_ACCELERATION_CEILING * PERIOD * 1.15
        fastest = max(fastest, abs(velocity))
    assert now == pytest.approx(limit, abs=1e-9) and fastest > 0.6 * speed
