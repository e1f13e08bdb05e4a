"""The clock along a path: as fast as is wanted, within the limits, always on the path, and on its last point."""
import random

import numpy as np
import pytest
from plans import ACCELERATION, HOME, MODEL, PERIOD, REST, TOP, at, build, resting, wave

from jaka_ros_driver.trajectory.clock import PathClock
from jaka_ros_driver.trajectory.path import Path
from jaka_ros_driver.trajectory.points import InvalidTrajectory
from jaka_ros_driver.trajectory.splines import spline

SLACK = 1.03


def run(clock, wanted=1.0, limit=4000):
    """Return positions of each cycle until the end, from where the clock is."""
    frames = [clock.position]
    while not (clock.is_at_end and clock.is_still):
        frames.append(clock.step(wanted))
        assert len(frames) < limit, "it does not end"
    return np.array(frames)


def accelerations(frames):
    """Return rad/s2 of each second difference; the arm rests before the first frame and behind the last."""
    padded = np.concatenate((frames[:1], frames, frames[-1:]))
    return np.abs(np.diff(padded, 2, axis=0)).max(axis=1) / PERIOD ** 2


def moving_cycles(frames):
    steps = np.abs(np.diff(frames, axis=0)).max(axis=1)
    return int(np.flatnonzero(steps > 1e-9).max()) + 1


@pytest.mark.parametrize("has_acceleration", [False, True])
@pytest.mark.parametrize("spacing_ms", [100, 50, 20, 10, 8, 4])
def test_a_plan_takes_its_time_and_is_followed_on_its_spline(spacing_ms, has_acceleration):
    points = wave(spacing_ms / 1000.0, has_acceleration)
    frames, ideal = run(PathClock(build(points), MODEL)), Path(*spline(points))
    assert moving_cycles(frames) * PERIOD == pytest.approx(4.0, abs=PERIOD)
    wanted = np.array([ideal.at(k * PERIOD).position for k in range(len(frames))])
    assert np.sqrt(((frames - wanted) ** 2).mean(axis=0)).max() < 2e-4
    assert frames[-1] == pytest.approx(points[-1].position, abs=1e-12)
    assert accelerations(frames).max() <= ACCELERATION * SLACK


@pytest.mark.parametrize("duration", [4.0, 4.001, 4.0079])
def test_a_plan_that_is_no_whole_number_of_cycles_ends_on_its_last_point_too(duration):
    path = build([at(duration, (0.7, -0.3), REST)])
    frames = run(PathClock(path, MODEL))
    assert tuple(frames[-1]) == path.at(path.end).position
    assert duration <= moving_cycles(frames) * PERIOD + 1e-9 < duration + PERIOD


PATHS = {
    "fast wave": lambda: build(wave(0.05, duration=2.2, size=0.65)),
    "with accelerations": lambda: build(wave(0.02, True, duration=2.4, size=0.7)),
    "highest speed": lambda: build([at(0.5, (0.5 * 0.25 * TOP * 2,), (TOP,)),
                                    at(1.0, (0.25 * TOP + 0.5 * TOP,), (TOP,)), at(1.5, (TOP,), REST)]),
    "back and forth": lambda: build([at(0.6 * n, (0.4 * (n % 2), -0.6 * (n % 2)), REST) for n in range(1, 6)]),
    "lines": lambda: build([at(0.5 * n, (0.5 * (n % 2), 0.3 * (n % 3), -0.2 * n)) for n in range(1, 7)]),
    "one line": lambda: build([at(1.2, (2.2, -1.1))]),
    "from beside": lambda: build(wave(0.1, duration=3.0, size=0.5), resting(0.008, -0.008)),
}


def drawn_rates(seed):
    """Draw rates that a client, a pendant and a pause might ask for: some for long, some for one cycle."""
    chance = random.Random(seed)
    while True:
        rate = chance.choice([0.0, 0.0, 1.0, 1.0, 0.01, 0.1, 0.5, 1.05, chance.random(), chance.random()])
        for _ in range(chance.choice([1, 1, 2, 5, 20, 60])):
            yield rate


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("make", PATHS.values(), ids=PATHS)
def test_whatever_rates_are_wanted_the_frames_keep_to_the_path_and_to_the_limits(make, seed):
    path = make()
    clock = PathClock(path, MODEL)
    frames, before = [clock.position], clock.time
    for cycle, wanted in enumerate(drawn_rates(seed)):
        frames.append(clock.step(wanted if cycle < 4000 else 1.0))
        assert before <= clock.time <= path.end, "time runs back"
        assert frames[-1] == pytest.approx(path.at(clock.time).position, abs=1e-12), "beside its path"
        before = clock.time
        if clock.is_at_end and clock.is_still:
            break
        assert cycle < 6000, "it does not end"
    frames = np.array(frames)
    assert np.abs(np.diff(frames, axis=0)).max() <= TOP * PERIOD * (1.0 + 1e-9)
    assert accelerations(frames).max() <= ACCELERATION * SLACK
    assert tuple(frames[-1]) == path.at(path.end).position


@pytest.mark.parametrize("share", [0.95, 1.0, 1.01, 1.019])
def test_a_brake_that_needs_what_the_audit_allows_above_the_ceiling_keeps_its_time(share):
    speed, length = 2.5, 2.5 / (share * ACCELERATION)
    path = build([at(1.0, (0.5 * speed,), (speed,)), at(1.1, (0.6 * speed,), (speed,)),
                  at(1.1 + length, ((0.6 + 0.5 * length) * speed,), REST)])
    frames = run(PathClock(path, MODEL))
    assert accelerations(frames).max() <= ACCELERATION * SLACK
    assert moving_cycles(frames) * PERIOD == pytest.approx(1.1 + length, abs=PERIOD)


def drawn_points(chance):
    """Draw points of some kind, near to each other or far apart; many of them ask too much."""
    count, apart, kind, size = chance.integers(2, 8), chance.uniform(0.08, 0.6), chance.integers(3), chance.uniform(
        0.02, 1.2)
    positions, velocities, accelerations_ = (
        chance.uniform(-1.0, 1.0, (count, 6)) * size * scale for scale in (apart, 1.5, 5.0))
    velocities[-1] = accelerations_[-1] = 0.0
    return [at(float(apart) * (n + 1), tuple(positions[n]), tuple(velocities[n]) if kind else None,
               tuple(accelerations_[n]) if kind == 2 else None) for n in range(count)]


@pytest.mark.parametrize("first", range(0, 200, 20))
def test_whatever_the_audit_takes_is_followed_within_the_limits(first):
    taken = 0
    for seed in range(first, first + 20):
        try:
            path = build(drawn_points(np.random.default_rng(seed)))
        except InvalidTrajectory:
            continue
        taken += 1
        clock, rates = PathClock(path, MODEL), drawn_rates(seed)
        frames = [clock.position]
        while not (clock.is_at_end and clock.is_still):
            frames.append(clock.step(next(rates) if len(frames) < 3000 else 1.0))
            assert len(frames) < 5000, "it does not end"
        assert accelerations(np.array(frames)).max() <= ACCELERATION * SLACK, "seed %d" % seed
        assert tuple(frames[-1]) == path.at(path.end).position
    assert taken > 2


def test_time_is_made_up_for_where_there_is_room():
    frames = run(PathClock(build(wave(0.1, size=0.2)), MODEL), 1.05)
    assert moving_cycles(frames) * PERIOD == pytest.approx(4.0 / 1.05, abs=2 * PERIOD)


@pytest.mark.parametrize("at_rate", [1.0, 0.5])
@pytest.mark.parametrize("make", PATHS.values(), ids=PATHS)
def test_an_arm_is_braked_within_three_tenths_of_a_second_from_anywhere(make, at_rate):
    path, longest = make(), 0
    for cycles in range(5, int(path.end / PERIOD), 7):
        clock = PathClock(path, MODEL)
        for _ in range(cycles):
            clock.step(at_rate)
        frames = [clock.position]
        while not (clock.is_still and clock.rate == 0.0) and len(frames) < 500:
            frames.append(clock.step(0.0))
            if clock.is_at_end and clock.is_still:
                break
        longest = max(longest, len(frames) - 1)
    assert longest * PERIOD <= 0.3


@pytest.mark.parametrize("cycles", [3, 8, 15])
def test_an_arm_is_braked_at_once_out_of_a_start_that_needs_what_the_audit_allows_above_the_ceiling(cycles):
    speed, length = 2.5, 2.5 / (1.015 * ACCELERATION)
    clock = PathClock(build([at(length, (0.5 * length * speed,), (speed,)),
                             at(length + 0.5, ((0.5 * length + 0.5) * speed,), (speed,)),
                             at(length + 1.5, ((0.5 * length + 1.0) * speed,), REST)]), MODEL)
    frames = [clock.position]
    for _ in range(cycles):
        frames.append(clock.step(1.0))
    speeds = [clock.velocity[0]]
    while speeds[-1] > 1e-9:
        frames.append(clock.step(0.0))
        speeds.append(clock.velocity[0])
        assert speeds[-1] < speeds[-2], "it goes on to speed up"
    assert accelerations(np.array(frames)).max() <= ACCELERATION * SLACK


def test_a_clock_that_is_paused_stays_and_goes_on_as_if_nothing_had_been():
    path = PATHS["highest speed"]()
    clock = PathClock(path, MODEL)
    for _ in range(80):
        clock.step(1.0)
    for _ in range(60):
        clock.step(0.0)
    rested, time = clock.position, clock.time
    assert clock.is_still and clock.rate == 0.0
    for _ in range(500):
        assert clock.step(0.0) == rested and clock.time == time
    assert run(clock)[-1] == pytest.approx(path.at(path.end).position, abs=1e-12)


def test_half_the_rate_takes_twice_the_time():
    path = build(wave(0.1))
    assert moving_cycles(run(PathClock(path, MODEL), 0.5)) * PERIOD == pytest.approx(8.0, abs=2 * PERIOD)


def test_points_of_the_highest_speed_are_not_passed_any_faster():
    # Between them the spline is a little faster than that; the audit lets it, and the clock slows there.
    points = [at(0.0, (0.0,), REST), at(0.5, (0.25 * TOP,), (TOP,)), at(0.6, (0.351 * TOP,), (TOP,)),
              at(1.1, (0.601 * TOP,), REST)]
    path = build(points)
    assert max(abs(path.at(t).velocity[0]) for t in np.arange(0.0, 1.1, 0.001).tolist()) > TOP * 1.005
    frames = run(PathClock(path, MODEL))
    assert np.abs(np.diff(frames, axis=0)).max() <= TOP * PERIOD
    assert moving_cycles(frames) * PERIOD == pytest.approx(1.1, abs=2 * PERIOD)


def test_a_clock_waits_for_a_trajectory_that_starts_later():
    clock = PathClock(build(wave(0.1), elapsed=-0.5), MODEL)
    frames = run(clock)
    steps = np.abs(np.diff(frames, axis=0)).max(axis=1)
    assert int(np.flatnonzero(steps > 1e-9).min()) * PERIOD == pytest.approx(0.5, abs=PERIOD)


@pytest.mark.parametrize("cycles", [0, 1, 40, 120])
@pytest.mark.parametrize("lead", [0.0, 0.004, 0.016, 0.1])
def test_another_path_is_joined_where_it_begins_without_a_jump(cycles, lead):
    first = build([at(1.2, (0.8, -0.5), REST)])
    clock = PathClock(first, MODEL)
    frames = [clock.position] + [clock.step(1.0) for _ in range(cycles)]
    time = clock.time + lead
    state = first.at(time)
    count = 40
    way = tuple((np.array(state.position) - np.array(HOME))[:2])
    second = Path(*spline([
        at(7.0, way, state.velocity, state.acceleration), at(8.0, (0.1, 0.1), REST, REST)]))
    clock.join(time, second)
    for _ in range(count):
        before = clock.time
        frames.append(clock.step(1.0))
        if clock.path is second and before < 7.0:
            assert clock.time == pytest.approx(7.0 + before + clock.rate * PERIOD - time, abs=1e-9)
    assert clock.path is second
    frames.extend(run(clock)[1:])
    assert accelerations(np.array(frames)).max() <= ACCELERATION * SLACK
    assert tuple(frames[-1]) == second.at(second.end).position


def test_the_state_tells_where_the_joints_are_wanted_at_the_present_rate():
    path = build(wave(0.1))
    clock = PathClock(path, MODEL)
    for _ in range(100):
        clock.step(0.5)
    state, on_path = clock.state(), path.at(clock.time)
    assert clock.rate == pytest.approx(0.5) and state.position == clock.position
    assert state.velocity == pytest.approx(tuple(0.5 * v for v in on_path.velocity))
    assert state.acceleration == pytest.approx(tuple(0.25 * a for a in on_path.acceleration))


def test_what_was_computed_ahead_changes_no_frame_whatever_happens_meanwhile():
    chance = random.Random(5)
    first = build(wave(0.05), elapsed=-0.1)
    plain, ahead = PathClock(first, MODEL), PathClock(first, MODEL)
    for cycle in range(400):
        guess, wanted = (chance.choice((0.0, 0.3, 1.0, 1.05)) for _ in range(2))
        ahead.look_ahead(wanted if cycle in (3, 100) else guess)
        for clock in (plain, ahead):
            if cycle == 3:
                clock.pass_rest(0.05)
            if cycle == 100:  # the other path leads elsewhere at once
                state = first.at(clock.time)
                clock.join(clock.time, Path(*spline([
                    at(7.0, np.subtract(state.position, HOME), state.velocity, state.acceleration),
                    at(8.0, (0.1, 0.1), REST, REST)])))
        assert ahead.step(wanted) == plain.step(wanted)
        assert (ahead.time, ahead.rate, ahead.velocity) == (plain.time, plain.rate, plain.velocity)
    assert plain.path is not first and plain.is_at_end


@pytest.mark.parametrize("name", ["fast wave", "with accelerations"])
def test_a_clock_that_hurries_is_never_slower_than_one_that_does_not(name):
    # Where a turn lies ahead it goes at the programmed speed, and no slower.
    usual, hurried = PathClock(PATHS[name](), MODEL), PathClock(PATHS[name](), MODEL)
    while not usual.is_at_end:
        usual.step(1.0)
        hurried.step(1.05)
        assert hurried.time >= usual.time - 0.5 * PERIOD


@pytest.mark.parametrize("share", [1.0, 1.019])
def test_starts_that_need_what_the_audit_allows_above_the_ceiling_lose_no_time(share):
    # Each would lose 2 ms of a cycle's 8 if the clock kept to the ceiling; ten lose what is seen at the end.
    speed, points = 2.5, []
    length = speed / (share * ACCELERATION)
    for n in range(10):
        begin, way = 2.0 * n * length, 0.5 * length * speed
        first, turn = (0.0, 1.0) if n % 2 == 0 else (2.0 * way, -1.0)
        points += [at(begin + length, (first + turn * way,), (turn * speed,)),
                   at(begin + 2.0 * length, (first + turn * 2.0 * way,), REST)]
    frames = run(PathClock(build(points), MODEL))
    assert accelerations(frames).max() <= ACCELERATION * SLACK
    assert moving_cycles(frames) * PERIOD == pytest.approx(20.0 * length, abs=PERIOD)
