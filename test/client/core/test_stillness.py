"""Evidence that the arm rests: every joint, over fresh frames without a gap."""
import math
import random

import pytest

from jaka_ros_driver.client.core.motion import rest_time_at
from jaka_ros_driver.client.core.stillness import MOVEMENT, REST_TIME_S, SURE_REST_S, Stillness
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.state import RobotState

PERIOD = 0.008


def seen(stillness, begin, end, joints=(0.0,) * 6):
    """Pass frames of these joints from begin to end, s, one every 8 ms; return the judge of stillness."""
    for n in range(int(round((end - begin) / PERIOD)) + 1):
        stillness.observe(RobotState(tuple(joints), True, True, True, False, False, received_at=begin + n * PERIOD))
    return stillness


def test_rest_is_counted_from_the_first_frame_or_from_the_moment_that_is_asked_about():
    stillness = seen(Stillness(), 100.0, 100.4)
    assert stillness.duration() == pytest.approx(0.4)
    assert stillness.duration(100.3) == pytest.approx(0.1)
    assert stillness.duration(101.0) == 0.0


@pytest.mark.parametrize("joint", range(6))
def test_any_joint_that_moves_ends_the_rest(joint):
    joints = [0.0] * 6
    joints[joint] = -1.5 * MOVEMENT
    stillness = seen(seen(Stillness(), 100.0, 100.4), 100.408, 100.408, joints)
    assert stillness.duration() == 0.0 and stillness.has_moved_since(100.4)


def test_many_steps_each_too_small_to_count_are_a_movement():
    stillness = Stillness()
    for n in range(100):
        seen(stillness, 100.0 + n * PERIOD, 100.0 + n * PERIOD, (0.3 * MOVEMENT * n,) * 6)
    assert stillness.duration() < 4.5 * PERIOD


def test_across_a_gap_nothing_is_known():
    stillness = seen(seen(Stillness(), 100.0, 100.4), 101.2, 101.24)
    assert stillness.duration() == pytest.approx(0.04)


def test_one_frame_that_came_late_does_not_show_rest():
    stillness = seen(seen(Stillness(), 100.0, 100.016), 100.316, 100.316)
    assert stillness.duration() == pytest.approx(0.016 + 0.04)
    assert stillness.duration(100.2) == stillness.duration(100.1) == pytest.approx(0.04)
    assert stillness.duration(100.306) == pytest.approx(0.01)
    seen(stillness, 100.324, 100.356)
    assert stillness.duration() == pytest.approx(0.016 + 0.04 + 0.04)
    assert stillness.duration(100.316) == pytest.approx(0.04)
    assert seen(stillness, 100.364, 100.396, (1.0,) * 6).duration() == pytest.approx(0.032)


@pytest.mark.parametrize("period", [0.02, 0.05, 0.1, 0.5])
def test_a_slow_feed_shows_rest_too_with_three_frames_at_least(period):
    stillness, frames = Stillness(), 0
    while stillness.duration() < REST_TIME_S:
        seen(stillness, 100.0 + frames * period, 100.0 + frames * period)
        frames += 1
    assert 3 <= frames <= 6
    for n in range(frames, frames + 1000):
        seen(stillness, 100.0 + n * period, 100.0 + n * period)
    assert stillness.duration() > 10.0


def test_a_gap_in_which_the_arm_went_elsewhere_is_no_evidence_that_it_moves_now():
    stillness = seen(seen(Stillness(), 100.0, 100.4), 101.2, 101.24, (1.0,) * 6)
    assert not stillness.has_moved_since(100.0)


def test_what_was_seen_before_the_sight_was_lost_does_not_count():
    stillness = seen(Stillness(), 100.0, 100.4)
    stillness.lose_sight()
    assert stillness.duration() == 0.0
    assert seen(stillness, 100.408, 100.448).duration() == pytest.approx(0.04)


NOISE = 2e-5
"""Noise of these joints, rad; more than their readings are known to differ at rest."""
QUANTUM = math.radians(1e-4)


def rests(angle, period, seconds, noise=0.0, is_still=Stillness, rest_time=REST_TIME_S):
    """Return when an arm counts as at rest, whose joint 1 is at ``angle(t)``, as the feed writes it."""
    chance, stillness, found = random.Random(1), is_still(), []
    for n in range(int(seconds / period)):
        told = [q + chance.uniform(-noise, noise) for q in (angle(n * period), 0.5)]
        joints = [round(q / QUANTUM) * QUANTUM for q in told] + [0.0] * 4
        stillness.observe(RobotState(tuple(joints), True, True, True, False, False, received_at=100.0 + n * period))
        if stillness.duration() >= rest_time:
            found.append(n * period)
    return found


@pytest.mark.parametrize("noise", [0.0, NOISE])
@pytest.mark.parametrize("period", [0.008, 0.03, 0.1])
@pytest.mark.parametrize("speed", [0.0005, 0.0007, 0.001, 0.0024])
def test_an_arm_whose_creep_was_seen_does_not_rest(speed, period, noise):
    rested = rests(lambda t: speed * t, period, 30.0, noise)
    assert not [t for t in rested if t > 1.2], rested[:5]


@pytest.mark.parametrize("noise", [0.0, NOISE])
@pytest.mark.parametrize("period", [0.008, 0.03, 0.1])
@pytest.mark.parametrize("speed", [0.00035, 0.0005, 0.0007, 0.001, 0.0015, 0.0024])
def test_an_arm_that_creeps_never_rests_for_long_also_behind_a_fast_motion(speed, period, noise):
    rested = rests(lambda t: 0.5 * min(t, 1.0) + speed * t, period, 30.0, noise, rest_time=SURE_REST_S)
    assert not rested, rested[:5]


def test_the_slowest_motion_that_is_taken_moves_twice_in_the_time_of_sure_rest():
    assert SURE_REST_S >= 2.0 * MOVEMENT / limits.SLOWEST and SURE_REST_S > 0.5 * rest_time_at(limits.SLOWEST, True)


@pytest.mark.parametrize("period", [0.008, 0.03, 0.1])
def test_an_arm_whose_readings_are_noisy_rests(period):
    rested = rests(lambda t: 0.0, period, 30.0, NOISE)
    assert len(rested) >= 29.5 / period


class _WithoutCreep(Stillness):
    """Stillness as it was before creeping counted."""

    def observe(self, state):
        super().observe(state)
        self._step_time = 0.0


ENDS = {
    "4 rad/s2": lambda t: -2.0 * t * t, "0.5 rad/s2": lambda t: -0.25 * t * t, "0.1 rad/s2": lambda t: -0.05 * t * t,
    "20 rad/s3": lambda t: -20.0 * t ** 3 / 6.0, "1 rad/s3": lambda t: -t ** 3 / 6.0,
    "a filter of 0.05 s": lambda t: 0.02 * (1.0 - math.exp(t / 0.05)) if t < 0.0 else 0.0}
SOFT = ("0.1 rad/s2", "1 rad/s3")
"""Profiles slower than 0.005 rad/s for long enough to look like a creep for a moment."""


@pytest.mark.parametrize("period", [0.008, 0.03, 0.1])
@pytest.mark.parametrize("end", ENDS)
def test_a_motion_that_ends_as_motions_do_rests_no_later_or_hardly(end, period):
    def angle(t):
        left = 1.0 - t
        return -abs(ENDS[end](-left)) if left > 0.0 else 0.0
    now, before = [rests(angle, period, 3.0, NOISE, kind)[0] for kind in (Stillness, _WithoutCreep)]
    assert 0.0 <= now - before <= (0.12 if end in SOFT else 0.0) + 0.5 * PERIOD


def test_a_jump_is_no_creep():
    assert seen(seen(Stillness(), 100.0, 100.4), 100.408, 100.488, (0.001,) * 6).duration() == pytest.approx(0.08)


def test_an_arm_that_twitches_once_in_a_second_of_rest_does_not_creep():
    twitched = (1.5 * MOVEMENT,) * 6
    assert seen(seen(Stillness(), 100.0, 101.0), 101.008, 101.088, twitched).duration() == pytest.approx(0.08)


@pytest.mark.parametrize("speed, is_linear, joint_speed", [
    (0.0005, False, 0.0005), (0.0002, False, 0.0002), (0.00045, True, 0.0003)])
def test_a_slow_motion_is_waited_for_as_long_as_two_movements_take(speed, is_linear, joint_speed):
    assert rest_time_at(speed, is_linear) == pytest.approx(2.0 * MOVEMENT / joint_speed)
    assert rest_time_at(1.0, is_linear) == REST_TIME_S
