import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaka_ros_driver.simulation.arm.profiles import JERK_TIME_S, Profile, speed_for_way, stopping_way

DT = 0.008
BOTH = pytest.mark.parametrize("jerk_limited", [True, False])


def run(profile, cycles=100_000, stop_at=None):
    """Return positions of every cycle until the profile rests or reaches stop_at."""
    positions = [profile.position]
    for _ in range(cycles):
        positions.append(profile.step(DT))
        if profile.at_rest or (stop_at is not None and len(positions) > stop_at):
            return positions
    raise AssertionError("never rests")


def check_bounds(positions, speed, acceleration):
    velocities = [(b - a) / DT for a, b in zip(positions, positions[1:])]
    assert min(velocities) >= 0.0
    assert max(velocities) <= speed * (1.0 + 1e-9)
    assert max(abs(b - a) / DT for a, b in zip([0.0, *velocities], [*velocities, 0.0])) <= acceleration * 1.001


@BOTH
@settings(max_examples=60)
@given(way=st.floats(1e-6, 2.0), speed=st.floats(0.1, 5.0), acceleration=st.floats(0.1, 20.0))
def test_reaches_its_target_exactly_and_within_its_limits(jerk_limited, way, speed, acceleration):
    profile = Profile(jerk_limited)
    profile.aim(way, speed, acceleration)
    positions = run(profile)
    assert positions[-1] == way
    check_bounds(positions, speed, acceleration)


@BOTH
@settings(max_examples=60)
@given(way=st.floats(0.01, 2.0), speed=st.floats(0.01, 2.0), acceleration=st.floats(0.1, 10.0),
       cycles=st.integers(1, 300))
def test_brakes_to_where_it_said(jerk_limited, way, speed, acceleration, cycles):
    profile = Profile(jerk_limited)
    profile.aim(way, speed, acceleration)
    before = run(profile, stop_at=cycles)
    end = profile.brake(acceleration)
    after = [profile.position] if profile.at_rest else run(profile)
    assert after[-1] == pytest.approx(end, abs=1e-9)
    assert end <= way + 1e-9
    check_bounds(before + after[1:], speed, acceleration)


@BOTH
def test_a_lower_speed_in_mid_motion_is_reached_smoothly(jerk_limited):
    profile = Profile(jerk_limited)
    profile.aim(2.0, 1.0, 2.0)
    positions = run(profile, stop_at=100)
    assert profile.velocity == pytest.approx(1.0)
    profile.aim(2.0, 0.25, 2.0)
    positions += run(profile, stop_at=80)[1:]
    assert profile.velocity == pytest.approx(0.25)
    positions += run(profile)[1:]
    assert positions[-1] == 2.0
    check_bounds(positions, 1.0, 2.0)


@BOTH
def test_a_lowered_acceleration_never_carries_it_beyond_the_target(jerk_limited):
    profile = Profile(jerk_limited)
    profile.aim(1.0, 1.0, 4.0)
    run(profile, stop_at=95)
    profile.aim(1.0, 1.0, 0.1)
    assert run(profile)[-1] == 1.0


def test_speed_zero_waits_where_it_comes_to_rest():
    profile = Profile()
    profile.aim(1.0, 0.5, 2.0)
    run(profile, stop_at=50)
    profile.aim(1.0, 0.0, 2.0)
    assert 0.0 < run(profile)[-1] < 1.0


def test_braking_at_rest_stays():
    profile = Profile()
    assert profile.brake(1.0) == 0.0
    assert profile.step(DT) == 0.0
    assert profile.at_rest


@BOTH
def test_the_jerk_time_is_how_long_acceleration_builds_up(jerk_limited):
    profile = Profile(jerk_limited)
    profile.aim(10.0, 5.0, 1.0)
    profile.step(profile.jerk_time + 1e-6 or DT)
    assert profile.acceleration == pytest.approx(1.0, rel=1e-3)
    if profile.jerk_time:
        assert profile.jerk_time == JERK_TIME_S


@given(way=st.floats(1e-4, 10.0), final=st.floats(0.0, 2.0), acceleration=st.floats(0.05, 20.0),
       jerk=st.sampled_from([0.0, 0.05]))
def test_speed_for_way_uses_just_that_way(way, final, acceleration, jerk):
    speed = speed_for_way(way, final, acceleration, jerk)
    assert speed >= final
    if speed > final:
        used = 0.5 * (speed + final) * ((speed - final) / acceleration + jerk)
        assert used == pytest.approx(way, rel=1e-6)


def test_stopping_way_is_that_of_speed_for_way():
    way = stopping_way(0.7, 2.0, 0.05)
    assert speed_for_way(way, 0.0, 2.0, 0.05) == pytest.approx(0.7)
