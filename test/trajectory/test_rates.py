"""Paths that pass a limit a little: slowed there on the same way, and refused from a quarter on."""
import math
import tracemalloc

import numpy as np
import pytest
from plans import ACCELERATION, HOME, MODEL, PERIOD, REST, TOP, at, build, moving, resting, wave

from jaka_ros_driver.trajectory.clock import PathClock
from jaka_ros_driver.trajectory.points import InvalidTrajectory, TrajectoryOfThePast
from jaka_ros_driver.trajectory.rates import Rates, SlowPart


def fast(factor, spacing=0.05):
    """Return a wave whose highest acceleration is ``factor`` times what a joint has."""
    points = wave(spacing, duration=2.0)
    needed = np.abs(build(points).samples(np.arange(0.0, 2.0, 0.001))[2]).max()
    scale = (factor * ACCELERATION / needed) ** 0.5
    return [type(p)(p.time / scale, p.position, tuple(v * scale for v in p.velocity)) for p in points]


def followed(path):
    """Return the frames of the path, rad (n, 6), and the time that they take, s."""
    clock = PathClock(path, MODEL)
    frames = [clock.position]
    while not (clock.is_at_end and clock.is_still):
        frames.append(clock.step(1.0))
        assert len(frames) < 5000
    return np.array(frames), (len(frames) - 2) * PERIOD


def shares(frames):
    """Return the largest shares of a joint's speed and acceleration."""
    return (float(np.abs(np.diff(frames, axis=0)).max() / PERIOD / TOP),
            float(np.abs(np.diff(frames, 2, axis=0)).max() / PERIOD ** 2 / ACCELERATION))


@pytest.mark.parametrize("spacing", [0.1, 0.02])
@pytest.mark.parametrize("factor", [1.03, 1.24])
def test_a_small_overshoot_is_slowed_on_the_same_way(factor, spacing):
    points = fast(factor, spacing)
    with pytest.raises(InvalidTrajectory, match=r"would need -?1[2-5]\.\d+ rad/s2"):
        build(points)
    path = build(points, slows=True)
    assert path.rates is not None and "would need" in path.rates.text
    frames, duration = followed(path)
    assert max(shares(frames)) <= 1.021
    assert points[-1].time < duration <= points[-1].time * factor
    assert duration == pytest.approx(points[-1].time + path.rates.delay(), abs=0.03)
    assert min(part.rate for part in path.rates.stretches) > 0.97 * factor ** -0.5, "no more than needed"
    exact = path.samples(np.arange(0.0, path.end, 0.0005))[0]
    for frame in frames[::7]:  # the way is that of the plan: only its clock is slower
        assert np.abs(exact - frame).max(axis=1).min() < 2e-3


def test_only_the_part_that_needs_it_is_slowed():
    calm = wave(0.05, duration=4.0, size=0.2)
    points = calm + [type(p)(p.time + 4.0, p.position, p.velocity) for p in fast(1.15)[1:]]
    path = build(points, slows=True)
    first = path.rates.stretches[0]
    assert path.highest_rate(2.0) == float("inf") and path.highest_rate(first.until) == first.rate < 1.0
    assert first.since - path.rates.ramp > 3.8
    clock = PathClock(path, MODEL)
    for _ in range(400):
        clock.step(1.0)
    assert clock.time == pytest.approx(3.2, abs=0.01)


@pytest.mark.parametrize("factor", [1.3, 2.0])
def test_a_quarter_over_a_limit_is_refused_by_joint_time_value_and_limit(factor):
    with pytest.raises(InvalidTrajectory, match=r"joint \d would need .* rad/s2 after .* s; valid: at most 12\.5664"):
        build(fast(factor), slows=True)


def test_a_speed_a_little_over_the_limit_is_slowed():
    points = [at(1.0, (1.6,), (3.3,)), at(1.5, (3.25,), (3.3,)), at(2.5, (4.85,), REST)]
    with pytest.raises(InvalidTrajectory, match=r"joint 1 would run at 3\.\d+ rad/s"):
        build(points)
    frames, _ = followed(build(points, slows=True))
    assert max(shares(frames)) <= 1.0 + 1e-6


def test_a_position_outside_the_limits_is_never_slowed_but_refused():
    with pytest.raises(InvalidTrajectory, match="joint 2 would be at"):
        build([at(4.0, (0.0, 3.1), REST)], slows=True)


def test_a_slowed_path_keeps_its_limits_at_other_speeds_and_when_it_is_stopped():
    path = build(fast(1.2), slows=True)
    for wanted in (0.95, 0.5, 1.05):
        clock = PathClock(path, MODEL)
        frames = [clock.position]
        for cycle in range(900):
            frames.append(clock.step(0.0 if 60 <= cycle < 120 else wanted))
        assert clock.is_at_end and max(shares(np.array(frames))) <= 1.021


# ---- a stamp in the past ----

PLAN = [at(0.0, (0.0,), REST), at(1.0, (0.5,), REST), at(2.0, (1.0,), REST)]


@pytest.mark.parametrize("elapsed", [0.1, 0.15, 0.5, 0.99])
def test_an_arm_at_the_first_point_of_a_late_plan_follows_the_whole_of_it(elapsed):
    with pytest.raises(TrajectoryOfThePast, match=r"%.3f s ago \(header.stamp\).* still at its first" % elapsed):
        build(PLAN, elapsed=elapsed)
    path, plan = build(PLAN, elapsed=elapsed, late=1.0), build(PLAN)
    assert (path.begin, path.end) == (0.0, 2.0)
    for time in (0.0, 0.3, 1.0, 1.7, 2.0):
        assert path.at(time).position == pytest.approx(plan.at(time).position, abs=1e-9)


def test_an_arm_that_is_where_the_plan_would_be_now_joins_it_there():
    path = build(PLAN, resting(0.25), elapsed=0.5, late=1.0)
    assert path.begin == 0.5


def test_too_late_and_elsewhere_are_told_apart():
    with pytest.raises(TrajectoryOfThePast, match=r"1\.200 s ago .*at most 1 s late is taken \(late_stamp\)"):
        build(PLAN, elapsed=1.2, late=1.0)
    with pytest.raises(InvalidTrajectory, match=r"begins 0\.1000 rad from where joint 1 is"):
        build(PLAN, resting(-0.1), elapsed=0.5, late=1.0)


# ---- goals for some of the joints ----

def test_joints_that_are_not_named_are_held_where_they_are():
    points = [at(1.0, (0.3, 9.0, 9.0), REST), at(2.0, (0.1, 9.0, 9.0), REST)]
    path = build(points, resting(0.0, 0.2, -0.1), held=(1, 2))
    for time in (0.0, 0.7, 1.0, 2.0):
        assert path.at(time).position[1:3] == pytest.approx((HOME[1] + 0.2, HOME[2] - 0.1))
    assert path.at(1.0).position[0] == pytest.approx(HOME[0] + 0.3)


@pytest.mark.parametrize("points", [
    [at(6.0, (0.3, 9.0, 9.0), REST)], [at(6.0, (0.3, 9.0, 9.0))],
    [at(0.0, (0.0, 9.0, 9.0), REST), at(6.0, (0.3, 9.0, 9.0), REST)]],
    ids=["with velocities", "without", "due at once"])
def test_a_joint_that_moves_and_is_not_named_stops_on_its_way_and_does_not_come_back(points):
    path = build(points, moving((0.0, 0.2, -0.1), (0.0, 1.0, -0.5)), held=(1, 2))
    positions, velocities, accelerations = path.samples(np.arange(0.0, path.end, 0.002))
    assert velocities[0] == pytest.approx((0.0, 1.0, -0.5, 0.0, 0.0, 0.0), abs=1e-6)
    assert velocities[:, 1].min() > -1e-9 and velocities[:, 2].max() < 1e-9
    assert 0.0 < positions[-1, 1] - positions[0, 1] < 0.11
    assert np.abs(accelerations).max() < ACCELERATION * 1.02
    assert path.at(6.0).position[0] == pytest.approx(HOME[0] + 0.3)


def test_a_goal_that_ends_before_the_joints_that_it_does_not_name_can_stop_is_refused():
    with pytest.raises(InvalidTrajectory, match="ends too soon"):
        build([at(0.2, (0.01, 9.0), REST)], moving((0.0, 0.2), (0.0, 2.0)), held=(1,))


def test_the_clock_slows_and_recovers_smoothly_beside_a_slowed_part():
    rates = Rates([SlowPart(1.0, 2.0, 0.5)], 0.4, "")
    assert [rates.at(time) for time in (0.59, 1.0, 1.7, 2.0, 2.41)] == [math.inf, 0.5, 0.5, 0.5, math.inf]
    assert [rates.at(0.8), rates.at(2.2)] == pytest.approx([0.75, 0.75])
    assert rates.at(0.601) == pytest.approx(1.0, abs=1e-4) and rates.at(0.999) == pytest.approx(0.5, abs=1e-4)
    times = np.array([0.7, 0.8, 1.5, 2.3])
    here, slopes = rates.samples(times)
    assert here == pytest.approx([rates.at(time) for time in times])
    assert slopes == pytest.approx([(rates.at(time + 1e-4) - rates.at(time)) / 1e-4 for time in times], abs=2e-3)


def test_how_late_a_trajectory_is_counts_from_its_first_point():
    points = [at(5.0, (0.0,), ()), at(8.0, (0.5,), ()), at(11.0, (1.0,), ())]
    path = build(points, elapsed=8.3, late=3.5)
    assert path.end - path.begin == pytest.approx(6.0, abs=0.01)
    with pytest.raises(TrajectoryOfThePast, match=r"3\.700 s ago"):
        build(points, elapsed=8.7, late=3.5)


def test_many_rates_are_those_of_one_place_after_the_other():
    rates = Rates([SlowPart(1.0, 2.0, 0.5), SlowPart(3.0, 3.1, 0.8)], 0.4, "")
    times = np.concatenate(list(rates.times()))
    times = np.append(times, [0.0, 0.6, 2.0, 2.4, 2.5, 3.5, 9.0])
    here, slope = rates.samples(times)
    assert here.tolist() == pytest.approx([min(1.0, rates.at(time)) for time in times.tolist()])
    assert np.abs(slope).max() == pytest.approx(1.5 * 0.5 / 0.4, rel=1e-3)
    assert len(times) in range(1350, 1360)


def test_the_times_of_many_and_of_long_stretches_come_in_parts():
    for parts in ([SlowPart(0.0, 200.0, 0.9)], [SlowPart(n, n + 0.3, 0.9) for n in range(400)]):
        rates = Rates(parts, 0.05, "")
        times = list(rates.times())
        assert len(times) > 3 and max(map(len, times)) <= 40_000
        joined = np.concatenate(times)
        expected = np.concatenate([np.arange(since - 0.05, until + 0.05, 0.002) for since, until, _ in parts])
        assert len(joined) == len(expected) and np.abs(joined - expected).max() < 1e-9
        assert rates.delay() == pytest.approx((1.0 / 0.9 - 1.0) * sum(u - s for s, u, _ in parts), rel=0.25)


@pytest.mark.parametrize("factor", [1.15, 1.24])
def test_the_rates_alone_keep_the_limits_where_they_change_too_and_from_the_first_piece_on(factor):
    duration = (6.0 * 2.0 / (factor * ACCELERATION)) ** 0.5
    path = build([at(0.0, (0.0,), REST), at(duration, (2.0,), REST)], slows=True)
    times = np.arange(0.0, path.end, 0.001)
    _, velocities, accelerations = path.samples(times)
    rates, slopes = (values[:, None] for values in path.rates.samples(times))
    assert np.abs(velocities * rates).max() <= TOP
    assert np.abs(accelerations * rates ** 2 + velocities * rates * slopes).max() <= ACCELERATION


def test_a_long_plan_is_slowed_in_memory_that_does_not_grow_with_it():
    duration = 1.5 * 4.0 / (1.1 * TOP)
    points = [at(n * duration, (2.0 if n % 2 else -2.0,), REST) for n in range(int(600.0 / duration))]
    tracemalloc.start()
    try:
        path = build(points, resting(-2.0), slows=True)
        assert path.rates.delay() > 10.0
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert path.rates.stretches and peak < 30e6, "it took 85 kB for each second"
