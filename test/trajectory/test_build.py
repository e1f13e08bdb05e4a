"""The begin of a trajectory where the arm is: at rest or moving, in time or late, at its start or a little beside
it."""
import numpy as np
import pytest
from plans import ACCELERATION, HOME, MODEL, REST, at, build, joints, moving, resting, samples, wave

from jaka_ros_driver.trajectory.audit import ACCELERATION_SLACK
from jaka_ros_driver.trajectory.clock import PathClock
from jaka_ros_driver.trajectory.path import Path
from jaka_ros_driver.trajectory.points import InvalidTrajectory
from jaka_ros_driver.trajectory.splines import spline


def is_smooth(path):
    """Assert that nothing jumps, neither position nor speed, and no joint needs more than it has."""
    _, position, velocity, acceleration = samples(path)
    assert np.abs(np.diff(position, axis=0)).max() <= np.abs(velocity).max() * 0.000501
    assert np.abs(np.diff(velocity, axis=0)).max() <= ACCELERATION * ACCELERATION_SLACK * 0.000501
    assert np.abs(acceleration).max() <= ACCELERATION * ACCELERATION_SLACK


# ---- from rest ----

def test_a_path_from_its_own_start_is_the_spline_through_its_points():
    points = wave(0.1)
    path, ideal = build(points), Path(*spline(points))
    assert path.approach is None and (path.begin, path.end) == (0.0, 4.0)
    for time in np.linspace(0.0, 4.0, 777).tolist():
        assert path.at(time).position == pytest.approx(ideal.at(time).position, abs=1e-12)


def test_points_that_begin_later_are_reached_from_where_the_arm_is():
    path = build([at(1.0, (0.3,), (0.2,)), at(2.0, (0.5,), REST)], resting(0.0, 0.1))
    assert path.at(0.0).position == pytest.approx(joints(0.0, 0.1))
    assert path.at(1.0).position == pytest.approx(joints(0.3)) and path.at(1.0).velocity[0] == pytest.approx(0.2)
    is_smooth(path)


def test_until_a_trajectory_starts_the_arm_rests():
    path = build(wave(0.1), elapsed=-1.5)
    assert path.begin == -1.5 and path.end == pytest.approx(4.0)
    for time in (-1.5, -0.7, -0.001):
        assert path.at(time) == (pytest.approx(HOME), REST, REST)


@pytest.mark.parametrize("offset", [0.009, -0.009, 1e-4, 1e-7])
def test_a_small_offset_of_the_start_decays(offset):
    points = wave(0.1)
    path, ideal = build(points, resting(0.0, offset)), Path(*spline(points))
    assert path.at(0.0).position == pytest.approx(joints(0.0, offset), abs=1e-12)
    times = np.arange(0.0, 1.7, 0.002)
    away = np.array([path.at(t).position[1] - ideal.at(t).position[1] for t in times.tolist()]) / offset
    assert away[0] == pytest.approx(1.0) and (np.diff(away) <= 1e-6).all() and (away >= -1e-6).all()
    assert np.abs(away[times > 0.4]).max() < 1e-6 and path.approach.until <= 0.4
    is_smooth(path)


def test_a_single_point_that_is_due_at_once_is_where_the_arm_is():
    path = build([at(0.0, (0.0,), REST)], resting(0.004))
    assert path.at(path.end).position == pytest.approx(joints(0.004)) and path.end - path.begin < 0.01


def test_a_plan_under_way_is_joined_where_it_is_now():
    slow = [at(0.0, (0.0,), REST), at(20.0, (0.05,), REST)]
    path = build(slow, resting(0.008), elapsed=5.0)
    ideal = Path(*spline(slow))
    assert path.begin == 5.0 and path.at(5.0).position == pytest.approx(joints(0.008))
    assert path.at(7.0).position == pytest.approx(ideal.at(7.0).position, abs=1e-12)
    is_smooth(path)


def test_a_first_point_that_moves_is_taken_up_from_rest():
    points = [at(0.0, (0.0,), (0.4,)), at(1.0, (0.4,), (0.4,)), at(2.0, (0.6,), REST)]
    path, ideal = build(points), Path(*spline(points))
    assert path.at(0.0).velocity[0] == pytest.approx(0.0, abs=1e-12)
    assert path.at(1.0).position == pytest.approx(ideal.at(1.0).position, abs=1e-12)
    is_smooth(path)


# ---- from motion ----

@pytest.mark.parametrize("velocity", [(0.5,), (-0.5, 0.3), (0.0, 0.0, 0.0, 0.0, 0.0, 1.5)])
def test_a_moving_arm_goes_on_to_points_that_are_due_later(velocity):
    start = moving((0.1, 0.2), velocity, (1.0, -1.0))
    path = build([at(1.0, (0.3, 0.1), (0.1,)), at(2.0, (0.5,), REST)], start)
    first = path.at(path.begin)
    assert first.position == pytest.approx(start.state.position)
    assert first.velocity == pytest.approx(start.state.velocity)
    is_smooth(path)


@pytest.mark.parametrize("elapsed", [0.3, 1.234, 2.0, 2.9])
@pytest.mark.parametrize("has_acceleration", [False, True])
def test_a_moving_arm_joins_a_plan_that_is_already_under_way(has_acceleration, elapsed):
    points = wave(0.1, has_acceleration)
    ideal = Path(*spline(points))
    on_plan = ideal.at(elapsed)
    ways = np.array(on_plan.position) - np.array(HOME) + np.array([0.01, -0.01, 0.005, 0.0, 0.02, 0.0])
    start = moving(tuple(ways), tuple(np.array(on_plan.velocity) + 0.1))
    path = build(points, start, elapsed)
    first = path.at(elapsed)
    assert path.begin == elapsed and first.position == pytest.approx(start.state.position, abs=1e-12)
    assert first.velocity == pytest.approx(start.state.velocity, abs=1e-12)
    joined = path.approach.until
    assert joined - elapsed <= 0.8
    for time in np.linspace(joined, 4.0, 50).tolist():
        assert path.at(time).position == pytest.approx(ideal.at(time).position, abs=1e-12)
    is_smooth(path)


@pytest.mark.parametrize("speed, joined_after", [(0.2, 0.1), (0.5, 0.2), (0.9, 0.4), (2.0, 0.8), (3.0, 1.6)])
def test_a_moving_arm_is_led_onto_a_plan_as_soon_as_its_limits_allow(speed, joined_after):
    path = build([at(0.0, (0.0,), REST), at(1.7, (0.0,), REST)], moving((0.0,), (speed,)), 0.05)
    assert path.approach.until - 0.05 == pytest.approx(joined_after)
    is_smooth(path)


def test_points_of_before_now_are_left_out():
    points = [at(0.0, (0.0,), REST), at(1.0, (0.5,), REST), at(2.0, (0.0,), REST)]
    path, ideal = build(points, moving((0.5,), (0.0,)), 1.0), Path(*spline(points))
    assert path.begin == 1.0
    assert path.at(1.5).position == pytest.approx(ideal.at(1.5).position)
    late = build(points[1:], moving((0.2,), (0.3,)), 0.0)
    assert late.at(0.0).velocity[0] == pytest.approx(0.3) and late.at(1.0).position == pytest.approx(joints(0.5))


def test_an_arm_too_fast_to_join_before_the_end_is_refused():
    with pytest.raises(InvalidTrajectory):
        build(wave(0.1), moving((0.3,), (2.0,)), elapsed=3.95)


def test_a_moving_arm_does_not_wait_for_a_trajectory_that_starts_later():
    path = build([at(1.0, (0.3,), REST)], moving((0.0,), (0.2,)), elapsed=-3.0)
    assert path.begin == 0.0


@pytest.mark.parametrize("rate", [1.0, 0.4])
@pytest.mark.parametrize("points", [
    wave(0.1), [at(1.0, (0.1,), REST)], [at(0.7, (0.1,)), at(1.4, (0.2, 0.3))],
    [at(0.8, (0.4,), (-0.1,)), at(1.8, (0.2,), REST)]], ids=["under way", "one", "without velocities", "later"])
def test_the_frames_of_one_path_and_of_the_next_are_smooth(points, rate):
    # As a running trajectory is replaced: built ahead of where the clock is, and joined there.
    clock = PathClock(build([at(3.0, (0.4, 0.3), REST)]), MODEL)
    frames = [clock.step(rate) for _ in range(60)]
    time = clock.time + 0.02
    state = clock.path.at(time)
    ways = np.array(state.position) - np.array(HOME)
    path = build(points, moving(tuple(ways), state.velocity, state.acceleration))
    clock.join(time, path)
    while not clock.is_at_end:
        frames.append(clock.step(rate))
        assert len(frames) < 3000
    assert clock.path is path and frames[-1] == pytest.approx(points[-1].position, abs=1e-9)
    speeds = np.diff(frames, axis=0) / 0.008
    assert np.abs(np.diff(speeds, axis=0)).max() / 0.008 <= ACCELERATION * 1.03


def test_a_point_that_is_due_now_but_for_rounding_is_not_still_to_be_reached():
    # Stamps are whole nanoseconds and times floating point: nothing can be done within what is lost between them.
    points = [at(1.0, (0.3,), REST), at(2.0, (0.4,), REST)]
    path = build(points, resting(0.295), elapsed=1.0 - 1e-12)
    assert path.at(path.begin).position == pytest.approx(joints(0.295), abs=1e-9)
    assert path.at(path.end).position == pytest.approx(joints(0.4), abs=1e-9)
