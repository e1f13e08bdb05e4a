"""Streams that are asked to end on a limit, and beside it, at every end of every joint of every model.

The simulated plant takes their frames: it ends a stream with a fault where a joint comes onto its soft limit.
"""
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plant_watch import PlantWatch

from jaka_ros_driver.client.core.servo_planner import JointServo
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model, model_names
from jaka_ros_driver.kinematics.limits import SERVO_PERIOD_S, STREAM_INSET, stream_limits
from jaka_ros_driver.trajectory.build import BuildOptions, PathStart, build_path
from jaka_ros_driver.trajectory.clock import PathClock
from jaka_ros_driver.trajectory.follower import PointFollower, require_within
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import InvalidTrajectory, JointTrajectory, TrajectoryPoint

REST = (0.0,) * 6
WAY = 0.1
"""Way to the limit, rad."""
PAST_LIMIT = (-5e-4, 0.0, 5e-7)
"""Targets: how far beyond the limit, rad; the last one is on it, as float32 has it."""
OPTIONS = BuildOptions(0.01)


def by_trajectory(model, start, goal):
    points = tuple(TrajectoryPoint(time, tuple((np.array(start) + share * (np.array(goal) - start)).tolist()), REST)
                   for time, share in ((0.4, 0.5), (0.8, 1.0)))
    path = build_path(PathStart(JointState(start, REST, REST), True), JointTrajectory(points), 0.0, model, OPTIONS)
    clock = PathClock(path, model)
    return [clock.step(1.0) for _ in range(130)], path.led


def by_servo_targets(model, start, goal):
    servo, frames, led = JointServo(start, model, 0.2, 1.0, SERVO_PERIOD_S), [], ""
    for cycle in range(130):
        share = min((cycle + 1) / 60.0, 1.0)
        target = tuple((np.array(start) + share * (np.array(goal) - start)).tolist())
        led = servo.set_target(goal if share == 1.0 else target, False)
        frames.append(servo.next_frame().joint_position)
    return frames, led


def by_points(model, start, goal):
    follower, frames, led = PointFollower(start, model, 0.0), [], ""
    for cycle in range(150):
        follower.now = now = cycle * SERVO_PERIOD_S
        if cycle % 4 == 0 and cycle <= 64:
            target = tuple((np.array(start) + cycle / 64.0 * (np.array(goal) - start)).tolist())
            require_within(target, model)
            led = follower.add(target, now + 0.05, now)
        frames.append(follower.step(1.0))
    return frames, led


STREAMS = (by_trajectory, by_servo_targets, by_points)


def ends(model):
    """Return (joint, sign, start, limit) of each end of each joint; the start is ``WAY`` beside the limit."""
    middle = tuple(min(max(0.3, low), high) for low, high in model.joint_limits)
    for joint, side in itertools.product(range(6), range(2)):
        limit, sign = model.joint_limits[joint][side], 1.0 if side else -1.0
        yield joint, sign, middle[:joint] + (limit - sign * WAY,) + middle[joint + 1:], limit


@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("name", model_names())
def test_no_stream_runs_onto_a_limit(name, stream):
    model = load_model(name)
    for joint, sign, start, limit in ends(model):
        for past in PAST_LIMIT:
            goal = start[:joint] + (limit + sign * past,) + start[joint + 1:]
            frames, led = stream(model, start, goal)
            end = stream_limits(model)[joint][sign > 0.0]
            assert "joint %d is led to %.6f rad" % (joint + 1, end) in led
            assert frames[-1] == pytest.approx(start[:joint] + (end,) + start[joint + 1:], abs=1e-6)
            assert max(sign * (frame[joint] - end) for frame in frames) <= 1e-9
            watch = PlantWatch(start, model, checks_acceleration=False)
            watch.plant.enter_servo()
            for frame in frames:
                watch.plant.servo_joint(frame)
                watch.step()
            faults = [hex(code) for code in watch.codes if code & 0xFFFF not in (0x33, 0x34)]
            assert not faults and not watch.plant.on_soft_limit, "joint %d, end %g" % (joint + 1, sign)
            assert watch.plant.joint_position == pytest.approx(frames[-1], abs=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@given(speed=st.floats(0.05, 2.5), period=st.floats(0.004, 0.04), way=st.floats(0.02, 0.5))
def test_points_that_run_into_the_end_at_any_speed_are_braked_to_stand_there(sign, speed, period, way):
    model = load_model("zu7")
    end = stream_limits(model)[3][sign > 0.0]
    place = end - sign * way
    follower, passed = PointFollower((0.0, 1.57, -1.57, place, 1.57, 0.0), model, 0.0), []
    due = period
    for cycle in range(int((way / speed + 0.6) / SERVO_PERIOD_S)):
        follower.now = now = cycle * SERVO_PERIOD_S
        while due <= now:
            place += sign * speed * min(due / 0.2, 1.0) * period
            follower.add((0.0, 1.57, -1.57, sign * min(sign * place, sign * end), 1.57, 0.0), due + 2.0 * period, due)
            due += period
        passed.append(sign * (follower.step(1.0)[3] - end))
    assert max(passed) <= 1e-9 and passed[-1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("beyond", [-5e-4, 0.0])
@pytest.mark.parametrize("name", ["zu7", "c7", "a12"])
def test_an_arm_that_stands_beyond_is_not_pushed_back_and_gets_away(name, beyond, stream):
    model = load_model(name)
    for joint, sign, inside, limit in ends(model):
        start = inside[:joint] + (limit + sign * beyond,) + inside[joint + 1:]
        held, _ = stream(model, start, start)
        assert all(frame == pytest.approx(start, abs=1e-12) for frame in held)
        frames, led = stream(model, start, inside)
        assert led == "" and frames[-1] == pytest.approx(inside, abs=1e-6)
        assert all(sign * (frame[joint] - start[joint]) <= 1e-9 for frame in frames)
        watch = PlantWatch(start, model, checks_acceleration=False)
        watch.plant.enter_servo()
        for frame in frames:
            watch.plant.servo_joint(frame)
            watch.step()
        assert [code for code in watch.codes if code & 0xFFFF not in (0x33, 0x34)] == []


@pytest.mark.parametrize("stream", STREAMS)
def test_what_is_beyond_the_limit_itself_is_refused(stream):
    model = load_model("zu7")
    for joint, sign, start, limit in ends(model):
        with pytest.raises(InvalidCommand, match="joint %d" % (joint + 1)):
            stream(model, start, start[:joint] + (limit + sign * 2e-3,) + start[joint + 1:])


def test_a_led_trajectory_keeps_its_other_joints_and_becomes_nowhere_faster():
    model = load_model("zu7")
    high = model.joint_limits[1][1]
    start = (0.0, high - 0.5, -1.5, 1.5, 1.5, 0.0)
    times = np.linspace(0.008, 1.6, 200)
    shares = 10.0 * (times / 1.6) ** 3 - 15.0 * (times / 1.6) ** 4 + 6.0 * (times / 1.6) ** 5
    speeds = (30.0 * (times / 1.6) ** 2 - 60.0 * (times / 1.6) ** 3 + 30.0 * (times / 1.6) ** 4) / 1.6

    def plan(way):
        return JointTrajectory(tuple(TrajectoryPoint(float(time), (share, start[1] + way * share) + start[2:],
                                                     (speed, way * speed, 0.0, 0.0, 0.0, 0.0))
                                     for time, share, speed in zip(times, shares, speeds)))
    begin = PathStart(JointState(start, REST, REST), True)
    path = build_path(begin, plan(0.5), 0.0, model, OPTIONS)
    same = build_path(begin, plan(0.5 - STREAM_INSET), 0.0, model, OPTIONS)
    assert path.led.startswith("joint 2 is led to %.6f rad, not to %.6f rad" % (high - STREAM_INSET, high))
    assert same.led == ""
    at = np.linspace(0.0, 1.6, 400)
    for led, planned in zip(path.samples(at), same.samples(at)):
        assert np.abs(led - planned).max() < 1e-2 * STREAM_INSET + 1e-3 * np.abs(planned).max()
    with pytest.raises(InvalidTrajectory, match="joint 2"):
        build_path(begin, plan(0.5 + 1e-4), 0.0, model, OPTIONS)


def test_a_trajectory_that_comes_back_to_the_limit_where_the_arm_was_led_before_moves_all_the_same():
    model = load_model("zu7")
    low, high = model.joint_limits[2]
    start = (0.0, 1.5, high - STREAM_INSET, 1.5, 1.5, 0.0)
    points = tuple(TrajectoryPoint(time, start[:2] + (place,) + start[3:], REST)
                   for time, place in ((3.0, 0.0), (6.0, low), (9.0, 0.0), (12.0, high)))
    path = build_path(PathStart(JointState(start, REST, REST), True), JointTrajectory(points), 0.0, model, OPTIONS)
    assert "joint 3" in path.led
    assert path.at(6.0).position[2] == pytest.approx(low + STREAM_INSET)
    assert path.at(12.0).position[2] == pytest.approx(high - STREAM_INSET)
    assert path.at(3.0).position[2] == pytest.approx(0.0, abs=STREAM_INSET)
