"""Evidence that the arm rests: every joint, over fresh frames without a gap."""
import pytest

from jaka_ros_driver.client.core.stillness import MOVEMENT, Stillness
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


def test_a_gap_in_which_the_arm_went_elsewhere_is_no_evidence_that_it_moves_now():
    stillness = seen(seen(Stillness(), 100.0, 100.4), 101.2, 101.24, (1.0,) * 6)
    assert not stillness.has_moved_since(100.0)


def test_what_was_seen_before_the_sight_was_lost_does_not_count():
    stillness = seen(Stillness(), 100.0, 100.4)
    stillness.lose_sight()
    assert stillness.duration() == 0.0
    assert seen(stillness, 100.408, 100.448).duration() == pytest.approx(0.04)
