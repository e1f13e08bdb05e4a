"""Polynomials between points: those of ros_controllers' JointTrajectoryController, whose formulas stand here again."""
import numpy as np
import pytest
from plans import HOME, REST, at, samples, six, wave

from jaka_ros_driver.client.core.motion_guard.motion_check import _times_of
from jaka_ros_driver.trajectory.path import Approach, Path, cubic, quintic
from jaka_ros_driver.trajectory.splines import spline, with_brake


def reference_quintic(t, p0, v0, a0, p1, v1, a1):
    """Return the coefficients of ros_controllers' quintic spline segment, from the constant term on."""
    t2 = t * t
    return np.array([p0, v0, 0.5 * a0,
                     (-20 * p0 + 20 * p1 - 3 * a0 * t2 + a1 * t2 - 12 * v0 * t - 8 * v1 * t) / (2 * t ** 3),
                     (30 * p0 - 30 * p1 + 3 * a0 * t2 - 2 * a1 * t2 + 16 * v0 * t + 14 * v1 * t) / (2 * t ** 4),
                     (-12 * p0 + 12 * p1 - a0 * t2 + a1 * t2 - 6 * v0 * t - 6 * v1 * t) / (2 * t ** 5)])


def reference_cubic(t, p0, v0, p1, v1):
    nothing = np.zeros_like(p0)
    return np.array([p0, v0, (-3 * p0 + 3 * p1 - 2 * v0 * t - v1 * t) / t ** 2,
                     (2 * p0 - 2 * p1 + v0 * t + v1 * t) / t ** 3, nothing, nothing])


@pytest.fixture
def ends():
    """Draw durations (20,), and positions, velocities, accelerations at both ends, (20, 6) each."""
    chance = np.random.default_rng(1)
    return chance.uniform(0.008, 2.0, 20), *(chance.uniform(-2.0, 2.0, (20, 6)) for _ in range(6))


def test_polynomials_are_those_of_ros_controllers(ends):
    durations, p0, v0, a0, p1, v1, a1 = ends
    fifth, third = quintic(durations, (p0, v0, a0), (p1, v1, a1)), cubic(durations, (p0, v0), (p1, v1))
    for n, t in enumerate(durations):
        scale = t ** -np.arange(6)[:, None]  # a short polynomial has large coefficients
        assert np.allclose(fifth[n] / scale, reference_quintic(
            t, p0[n], v0[n], a0[n], p1[n], v1[n], a1[n]) / scale, atol=1e-9)
        assert np.allclose(third[n] / scale, reference_cubic(t, p0[n], v0[n], p1[n], v1[n]) / scale, atol=1e-9)


@pytest.mark.parametrize("has_acceleration", [False, True])
def test_a_spline_has_positions_velocities_and_accelerations_of_its_points(has_acceleration):
    points = wave(0.1, has_acceleration)
    path = Path(*spline(points))
    for point in points[:-1]:
        state = path.at(point.time)
        assert state.position == pytest.approx(point.position, abs=1e-12)
        assert state.velocity == pytest.approx(point.velocity, abs=1e-12)
        if has_acceleration:
            assert state.acceleration == pytest.approx(point.acceleration, abs=1e-9)
    assert path.at(path.end).position == pytest.approx(points[-1].position, abs=1e-12)
    for point in points[1:]:  # from the left, too
        just = path.at(point.time - 1e-9)
        assert just.position == pytest.approx(point.position, abs=1e-8)
        assert just.velocity == pytest.approx(point.velocity, abs=1e-6)


def test_degree_of_each_piece_is_what_both_its_ends_give():
    full = REST, (0.5,)
    points = [at(0.0, (0.0,), *full), at(1.0, (0.1,), *full), at(2.0, (0.3,), (0.1,)), at(3.0, (0.2,), REST),
              at(4.0, (0.0,)), at(5.0, (0.4,), REST)]
    coefficients = spline(points)[1][:, :, 0]
    degrees = [int(np.flatnonzero(np.abs(piece) > 1e-12).max()) for piece in coefficients]
    assert degrees == [5, 3, 3, 1, 1]


def test_straight_pieces_join_positions_at_even_speed():
    path = Path(*spline([at(0.0, (0.0, 0.0)), at(0.5, (0.1, -0.2)), at(1.0, (0.1, 0.0))]))
    assert path.at(0.25).position == pytest.approx(six(*(h + w for h, w in zip(HOME, six(0.05, -0.1)))))
    assert path.at(0.25).velocity == pytest.approx(six(0.2, -0.4))
    assert path.at(0.75).velocity == pytest.approx(six(0.0, 0.4))


@pytest.mark.parametrize("has_acceleration", [False, True])
def test_velocity_and_acceleration_are_the_derivatives_of_position(has_acceleration):
    path = Path(*spline(wave(0.1, has_acceleration)))
    h = 1e-5
    for time in np.random.default_rng(2).uniform(0.1, 3.9, 200).tolist():
        if min(abs(path.breaks - time)) < 2 * h:
            continue  # accelerations of cubics jump there
        before, state, after = path.at(time - h), path.at(time), path.at(time + h)
        slope = (np.array(after.position) - np.array(before.position)) / (2 * h)
        curvature = (np.array(after.velocity) - np.array(before.velocity)) / (2 * h)
        assert np.allclose(state.velocity, slope, atol=1e-8)
        assert np.allclose(state.acceleration, curvature, atol=1e-6)


def test_many_times_at_once_give_what_each_gives():
    breaks, coefficients = spline(wave(0.05))
    approach = Approach(0.3, 0.7, quintic(np.array([0.4]), (np.full((1, 6), 0.005), np.zeros((1, 6)), np.zeros(
        (1, 6))), (np.zeros((1, 6)),) * 3)[0])
    path = Path(breaks, coefficients, 0.3, approach)
    times = np.random.default_rng(3).uniform(0.3, path.end - 1e-6, 300)
    together = path.samples(times)
    for n, time in enumerate(times.tolist()):
        for many, one in zip(together, path.at(time)):
            assert many[n] == pytest.approx(one, abs=1e-11)


def test_before_its_begin_and_behind_its_end_the_arm_rests():
    points = [at(0.0, (0.0,), (0.5,)), at(1.0, (0.4,), REST)]
    path = Path(*spline(points), begin=-2.0)
    assert path.begin == -2.0 and path.end == 1.0
    for time, point in ((-1.0, points[0]), (1.0, points[1]), (5.0, points[1])):
        assert path.at(time) == (pytest.approx(point.position), REST, REST)


def test_a_brake_behind_the_last_point_ends_at_rest_within_the_acceleration():
    points = [at(0.0, (0.0,), REST), at(1.0, (0.4, -0.2), (0.8, -0.4))]
    path = Path(*with_brake(*spline(points), points[-1].velocity, 2.0))
    assert path.end == pytest.approx(1.4)
    assert path.at(path.end).position == pytest.approx(
        tuple(p + w for p, w in zip(points[-1].position, six(0.16, -0.08))))
    _, _, velocity, acceleration = samples(path)
    assert np.abs(acceleration[2001:]).max() == pytest.approx(2.0)
    assert np.abs(velocity[-2:]).max() < 1.01e-3


@pytest.mark.parametrize("until, is_marked", [(0.7123, True), (1e9, False)])
def test_the_end_of_the_way_onto_a_path_is_a_place_where_the_motion_guard_looks(until, is_marked):
    breaks, coefficients = spline(wave(0.05))
    still = (np.zeros((1, 6)),) * 3
    approach = Approach(0.3, until, quintic(np.array([until - 0.3]), still, still)[0])
    times = _times_of(Path(breaks, coefficients, 0.3, approach), (1.0,) * 6)
    assert (until in times.tolist()) is is_marked and (np.diff(times) > 0.0).all()
    assert times[0] == 0.3 and times[-1] == Path(breaks, coefficients, 0.3, approach).end
