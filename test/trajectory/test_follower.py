"""Streams of single points, at the rates of joysticks and planners, with and without the jitter of their sender."""
import math
import random

import numpy as np
import pytest
from plans import ACCELERATION, HOME, MODEL, PERIOD, REST, TOP, joints

from jaka_ros_driver.trajectory.follower import HOLD_S, PointFollower, require_within
from jaka_ros_driver.trajectory.points import InvalidTrajectory

RATES_HZ = (10, 30, 50, 100, 125, 250)


def swing(time, speed=0.3):
    """Return a way, rad, that begins and ends at rest, and goes there and back."""
    return 0.5 * speed * (1.0 - math.cos(2.0 * min(max(time, 0.0), math.pi)))


def streamed(rate, periods, jitter, way=swing, duration=math.pi, seed=1):
    """Return times s (n,), frames rad (n, 6) and the wanted ways rad (n,) of a stream of points ``periods`` ahead.

    jitter: Of the times at which points come, as a share of the period.
    """
    chance, period = random.Random(seed), 1.0 / rate
    points = sorted((n * period + chance.uniform(0.0, jitter) * period, n * period)
                    for n in range(int(duration * rate) + 1))
    follower, frames, times = PointFollower(HOME, MODEL, 0.0), [], np.arange(0.0, duration + 1.0, PERIOD)
    for now in times.tolist():
        while points and points[0][0] <= now:
            came_at, made_at = points.pop(0)
            follower.add(joints(way(made_at + periods * period), -way(made_at + periods * period)),
                         came_at + periods * period, came_at)
        follower.now = now
        frames.append(follower.step(1.0))
    return times, np.array(frames), np.array([way(t) for t in times.tolist()])


def within_limits(frames):
    speeds = np.diff(frames, axis=0) / PERIOD
    return bool(np.abs(speeds).max() <= TOP * 1.0001
                and np.abs(np.diff(speeds, axis=0)).max() / PERIOD <= ACCELERATION * 1.0001)


@pytest.mark.parametrize("jitter", [0.0, 1.0])
@pytest.mark.parametrize("periods", [1, 2, 3])
@pytest.mark.parametrize("rate", RATES_HZ)
def test_a_stream_is_followed_smoothly_and_held_at_its_last_point(rate, periods, jitter):
    times, frames, ways = streamed(rate, periods, jitter)
    assert within_limits(frames)
    lag = 0.012 + 2.5 / rate  # two periods in which a point may be late, and some for the joints
    assert np.abs(frames[:, 0] - HOME[0] - ways).max() <= 0.3 * lag
    assert np.abs(frames[:, 1] - HOME[1] + ways).max() <= 0.3 * lag
    assert frames[-1] == pytest.approx(joints(swing(math.pi), -swing(math.pi)))


def accelerations(rate, jitter):
    """Return the RMS of the acceleration, rad/s2, beside what the swing itself needs."""
    _, frames, _ = streamed(rate, 2, jitter)
    return float(np.sqrt((np.diff(frames[:, 0], 2) ** 2).mean())) / PERIOD ** 2


def test_jitter_of_a_whole_period_does_not_make_the_arm_shake():
    assert all(accelerations(rate, 1.0) < 0.35 * ACCELERATION for rate in RATES_HZ)
    assert accelerations(30, 0.0) < 0.1 * ACCELERATION


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("rate", [10, 30, 125])
def test_a_stream_that_breaks_off_in_motion_is_held_at_its_last_point_and_not_passed(rate, speed):
    last = speed * (int(0.6 * rate) + 1) / rate
    times, frames, _ = streamed(rate, 1, 0.0, lambda time: speed * time, duration=0.6)
    assert within_limits(frames)
    assert frames[:, 0].max() - HOME[0] <= last + 1e-4
    assert frames[-1, 0] - HOME[0] == pytest.approx(last, abs=1e-6)
    still = times[np.flatnonzero(np.abs(np.diff(frames[:, 0])) > 1e-9)[-1]]
    braking = speed / (0.9 * ACCELERATION)
    assert still <= 0.6 + 2.0 / rate + max(0.2, braking + 0.1)


def test_a_pause_brakes_and_the_stream_goes_on_from_there():
    follower = PointFollower(HOME, MODEL, 0.0)
    before = None
    for cycle in range(200):
        now = cycle * PERIOD
        if cycle % 4 == 0:
            follower.add(joints(0.3 * now), now + 0.064, now)
        follower.now = now
        frame = follower.step(0.0 if 60 <= cycle < 120 else 1.0)
        if cycle == 119:
            assert follower.is_still and follower.rate == 0.0
            before = frame
    assert before is not None and follower.position[0] > before[0] + 0.05


def test_a_stream_has_ended_when_it_is_at_its_last_point_and_silent():
    follower = PointFollower(HOME, MODEL, 0.0)
    follower.add(joints(0.01), 0.03, 0.0)
    ends = []
    for cycle in range(100):
        follower.now = cycle * PERIOD
        follower.step(1.0)
        ends.append(follower.is_at_end)
    assert ends.index(True) == pytest.approx(HOLD_S / PERIOD, abs=1.0) and all(ends[ends.index(True):])
    assert follower.state() == (pytest.approx(joints(0.01)), REST, REST)


def test_a_jump_is_refused_and_the_stream_goes_on():
    follower = PointFollower(HOME, MODEL, 0.0)
    with pytest.raises(InvalidTrajectory, match=r"joint 1 would have to run at 14\.\d+ rad/s to the point 0\.034 s"):
        follower.add(joints(0.5), 0.034, 0.0)
    follower.add(joints(0.01), 0.034, 0.0)
    with pytest.raises(InvalidTrajectory, match="joint 2"):
        follower.add(joints(0.01, -1.0), 0.068, 0.034)
    for cycle in range(60):
        follower.now = cycle * PERIOD
        follower.step(1.0)
    assert follower.position == pytest.approx(joints(0.01))


def test_points_that_come_at_once_after_a_stall_are_followed_one_after_the_other():
    follower = PointFollower(HOME, MODEL, 0.0)
    frames, sent = [], 0
    for cycle in range(300):
        now = cycle * PERIOD
        while sent * 0.033 <= now < 1.0 and not 0.3 <= now < 0.5:
            follower.add(joints(0.3 * sent * 0.033), now + 0.033, now)
            sent += 1
        follower.now = now
        frames.append(follower.step(1.0))
    assert within_limits(np.array(frames))
    assert frames[-1] == pytest.approx(joints(0.3 * (sent - 1) * 0.033))


def test_a_point_outside_the_limits_is_refused_by_joint_value_and_limit():
    require_within(HOME, MODEL)
    for value in (4.7, -1.5, math.nan, 1e38):
        with pytest.raises(InvalidTrajectory, match=r"joint 2 would be at .* rad; valid: -1\.483530 to 4\.625123 rad"):
            require_within((0.0, value, 0.0, 0.0, 0.0, 0.0), MODEL)


def led(cycles, *points):
    """Return the way of joint 1, rad, in each cycle; ``points`` are the cycle in which one comes, its way and when it
    is due, s."""
    follower, ways = PointFollower(HOME, MODEL, 0.0), []
    for cycle in range(cycles):
        for comes, way, due in points:
            if comes == cycle:
                follower.add(joints(way), due, cycle * PERIOD)
        follower.now = cycle * PERIOD
        ways.append(follower.step(1.0)[0] - HOME[0])
    return ways


def test_a_point_after_a_pause_is_reached_when_it_is_due_and_not_as_one_that_is_late():
    frames = led(500, (0, 0.05, 0.1), (250, 0.45, 3.0))
    assert frames[249] == pytest.approx(0.05) and frames[-1] == pytest.approx(0.45)
    assert frames[313] == pytest.approx(0.25, abs=0.05), "half of the way in half of the time"


def test_a_point_after_the_time_of_the_last_one_begins_anew_and_the_arm_does_not_hurry():
    frames = led(100, (0, 0.0, 0.03), (32, 0.05, 0.29))
    assert frames[-1] == pytest.approx(0.05) and np.diff(frames).max() / PERIOD < 0.4


def test_a_point_where_the_arm_stands_already_is_at_its_end_when_its_time_is_over_and_not_before():
    follower, ends = PointFollower(HOME, MODEL, 0.0), []
    follower.add(HOME, 4.0 * HOLD_S, 0.0)
    for cycle in range(int(6.0 * HOLD_S / PERIOD)):
        follower.now = cycle * PERIOD
        follower.step(1.0)
        if follower.is_at_end:
            ends.append(follower.now)
    assert ends and ends[0] == pytest.approx(4.0 * HOLD_S, abs=3 * PERIOD)
