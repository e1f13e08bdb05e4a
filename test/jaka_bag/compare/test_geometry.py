"""Angles between orientations against matrices; distances to a curve whose times are uncertain."""
import math

import numpy as np
import pytest

from jaka_bag.compare.checks.rotation_angles import continuous, quaternions
from jaka_bag.compare.matching.curve_distance import box_distances, distances, interpolated, lateness, lengths
from jaka_bag.operations.tool_poses import rotation_vectors
from jaka_ros_driver.kinematics.rotations import matrix_from_rotation_vector, rotation_angle_between


def angles_between(a, b):
    """Return the angle of unit quaternions as the checks compute it: from their distance as points."""
    chord = np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    return 4.0 * np.arcsin(0.5 * chord)


def test_angles_are_those_of_the_matrices():
    random = np.random.RandomState(3)
    a, b = random.uniform(-3, 3, (200, 3)), random.uniform(-3, 3, (200, 3))
    expected = [rotation_angle_between(matrix_from_rotation_vector(x), matrix_from_rotation_vector(y))
                for x, y in zip(a, b)]
    assert angles_between(quaternions(a), quaternions(b)) == pytest.approx(expected, abs=1e-7)


def test_small_angles_are_exact_and_a_full_turn_is_none():
    a = quaternions(np.array([[0.3, 0.2, 0.1]]))
    assert angles_between(a, quaternions(np.array([[0.3, 0.2, 0.1 + 1e-9]])))[0] == pytest.approx(1e-9, rel=0.1)
    turn = np.array([[0.0, 0.0, 2 * math.pi - 0.1], [0.0, 0.0, -0.1]])
    assert angles_between(quaternions(turn[:1]), quaternions(turn[1:]))[0] == pytest.approx(0.0, abs=1e-9)


def test_signs_follow_each_other_over_half_a_turn():
    angle = np.linspace(0.0, 9.0, 500)
    vectors = np.stack([np.zeros(500), np.zeros(500), (angle + math.pi) % (2 * math.pi) - math.pi], axis=1)
    smooth = continuous(quaternions(vectors))
    assert lengths(np.diff(smooth, axis=0)).max() < 0.02
    for cut in (0, 1, 175, 499):  # in two pieces: the second goes on with the signs of the first
        first = continuous(quaternions(vectors[:cut]))
        second = continuous(quaternions(vectors[cut:]), first[-1] if cut else None)
        assert np.array_equal(np.concatenate([first, second]), smooth)


def test_rotation_vectors_of_quaternions_are_those_that_made_them():
    vectors = np.random.RandomState(4).uniform(-1.7, 1.7, (200, 3))
    vectors[0] = 0.0
    w, x, y, z = quaternions(vectors).T
    made = np.stack([x, y, z, w], axis=1)
    for same in (made, -made, 3.0 * made):
        assert np.abs(rotation_vectors(same) - vectors).max() < 1e-9
    assert np.isnan(rotation_vectors(np.zeros((1, 4)))).all()


def near(at, seen, jitter):
    time = np.arange(0.0, 10.0, 0.008)
    curve = np.stack([np.sin(time), np.cos(time)], axis=1)
    at, seen = np.array([at]), np.array([seen])
    direct = lengths(seen - interpolated(time, curve, at))
    return distances(time, curve, at, seen, direct, np.array([jitter]), 0.0)[0]


@pytest.mark.parametrize("late", [-0.03, -0.005, 0.0, 0.011, 0.039])
def test_a_sample_with_a_late_stamp_is_on_the_curve(late):
    t = 4.2
    assert near(t + late, [math.sin(t), math.cos(t)], 0.04) < 2e-5


def test_a_sample_later_than_the_jitter_is_off_by_what_is_left():
    t = 4.2
    assert near(t + 0.100, [math.sin(t), math.cos(t)], 0.04) == pytest.approx(0.06, abs=0.009)


def test_an_offset_across_the_path_is_seen_whatever_the_jitter():
    t = 4.2
    assert near(t, [1.01 * math.sin(t), 1.01 * math.cos(t)], 0.5) == pytest.approx(0.01, abs=1e-4)


def test_a_reader_that_was_held_up_stamps_late_until_it_has_caught_up():
    sent = np.arange(0.0, 4.0, 0.008)
    stamp = np.maximum(sent, np.where((sent > 1.0) & (sent < 1.12), 1.12 + 1e-4 * (sent - 1.0), 0.0))
    late = lateness(stamp, 0.5)
    assert np.all(late > stamp - sent - 0.0125)
    assert late[sent <= 1.0].max() < 0.001 and late[sent > 2.0].max() < 0.001
    assert late.max() == pytest.approx((stamp - sent).max(), abs=0.002)


def test_a_silence_of_the_sender_and_a_steady_rhythm_excuse_nothing():
    time = np.concatenate([np.arange(0.0, 1.0, 0.008), np.arange(3.0, 4.0, 0.008)])
    assert lateness(time, 0.5).max() < 1e-9
    assert lateness(np.arange(0.0, 5.0, 0.016), 0.5).max() < 1e-9
    assert lateness(np.array([0.0, 9.0]), 0.5).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize("jitter_s", [0.0, 0.02, 0.05, 0.2, 1.5])  # a few rows to either side, and many
def test_how_far_a_value_is_from_a_curve_s_range_is_as_sought_one_by_one(columns, jitter_s):
    random = np.random.RandomState(4)
    time = np.cumsum(random.uniform(0.004, 0.012, 900))
    value = np.cumsum(random.normal(0.0, 0.1, (900, columns)), axis=0)
    at = np.sort(random.uniform(time[0], time[-1], 200))
    sought = interpolated(time, value, at) + random.normal(0.0, 0.5, (200, columns))
    found = box_distances(time, value, at, sought, np.full(200, jitter_s))
    for number, moment in enumerate(at.tolist()):
        first = int(np.searchsorted(time, moment - jitter_s, "right")) - 1
        last = int(np.searchsorted(time, moment + jitter_s))
        off = 0.0
        if first >= 0 and last < len(time):
            part = value[first:last + 1]
            off = np.linalg.norm(np.maximum(np.maximum(part.min(axis=0) - sought[number],
                                                       sought[number] - part.max(axis=0)), 0.0))
        assert found[number] == pytest.approx(off, abs=1e-12)
