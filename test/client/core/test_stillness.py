"""Evidence that the arm rests: every joint, over fresh frames without a gap."""
import pytest

from jaka_ros_driver.client.core.stillness import MOVEMENT, REST_TIME_S, Stillness
from jaka_ros_driver.state import RobotState

PERIOD = 0.008


def seen(stillness, begin, end, joints=(0.0,) * 6):
    """Frames of these joints from begin to end, s, one every 8 ms."""
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
