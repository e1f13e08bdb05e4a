"""Points without velocities: straight lines, rounded so far as the joints' acceleration asks for."""
import numpy as np
import pytest
from plans import ACCELERATION, HOME, PERIOD, TOP, at, build, joints, moving, samples

from jaka_ros_driver.trajectory.build import InvalidTrajectory


def zigzag(seed, count=8, apart=0.5):
    """Return targets at random around home, far enough apart in time for the turns."""
    chance = np.random.default_rng(seed)
    return [at(apart * (n + 1), tuple(chance.uniform(-0.25, 0.25, 6))) for n in range(count)]


@pytest.mark.parametrize("seed", range(10))
def test_a_rounded_line_begins_and_ends_on_its_points_and_keeps_the_limits(seed):
    points = zigzag(seed)
    path = build(points)
    times, position, velocity, acceleration = samples(path)
    assert path.begin == 0.0 and path.end == pytest.approx(points[-1].time)
    assert path.at(path.begin).position == pytest.approx(HOME, abs=1e-12)
    assert path.at(path.end).position == pytest.approx(points[-1].position, abs=1e-9)
    assert np.abs(acceleration).max() <= ACCELERATION * 1.0001
    assert np.abs(velocity).max() <= TOP
    assert np.abs(velocity[0]).max() < 1e-9 and np.abs(velocity[-1]).max() < ACCELERATION * 0.0006
    assert np.abs(np.diff(position, axis=0)).max() <= np.abs(velocity).max() * 0.000501, "it jumps"
    assert np.abs(np.diff(velocity, axis=0)).max() <= ACCELERATION * 0.000501, "its speed jumps"


@pytest.mark.parametrize("seed", range(10))
def test_a_corner_is_passed_by_the_change_of_speed_squared_over_eight_accelerations(seed):
    points = zigzag(seed)
    path = build(points)
    for point in points[:-1]:
        before, after = path.at(point.time - 0.2), path.at(point.time + 0.2)
        change = np.abs(np.array(after.velocity) - np.array(before.velocity))
        away = np.abs(np.array(path.at(point.time).position) - np.array(point.position))
        assert (away <= change * change.max() / (8.0 * ACCELERATION) + 1e-9).all()
        assert away.max() == pytest.approx(change.max() ** 2 / (8.0 * ACCELERATION), rel=1e-6)


def test_between_its_turns_the_line_is_straight():
    path = build([at(1.0, (0.5, 0.1)), at(2.0, (0.0, 0.4)), at(3.0, (0.2, 0.2))])
    for time in (0.5, 1.5, 2.5):
        assert np.abs(path.at(time).acceleration).max() == 0.0
    assert path.at(1.5).velocity == pytest.approx((-0.5, 0.3, 0.0, 0.0, 0.0, 0.0))


def test_a_turn_that_fits_into_one_cycle_is_not_rounded():
    change = 0.9 * ACCELERATION * PERIOD
    path = build([at(1.0, (0.3,)), at(2.0, (0.6 + change,)), at(3.0, (0.6 + change,))])
    assert path.at(1.0).position == pytest.approx(joints(0.3), abs=1e-12)


@pytest.mark.parametrize("way, time", [(0.3, 1.0), (0.3, 0.33), (1e-4, 0.05), (0.0, 0.5), (-2.0, 1.0)])
def test_a_single_goal_is_a_line_with_both_ends_rounded(way, time):
    path = build([at(time, (way, -0.5 * way))])
    times, position, velocity, acceleration = samples(path)
    assert path.end == pytest.approx(time)
    assert path.at(0.0).position == pytest.approx(HOME) and path.at(time).position == pytest.approx(
        joints(way, -0.5 * way), abs=1e-9)
    assert np.abs(acceleration).max() <= ACCELERATION * 1.0001
    assert (np.sign(way) * np.diff(position[:, 0]) >= -1e-12).all(), "it goes back"
    assert position[:, 1] - HOME[1] == pytest.approx(-0.5 * (position[:, 0] - HOME[0]), abs=1e-9), "no line"


@pytest.mark.parametrize("speed", [1.0, -1.0, 0.05, 2.5])
@pytest.mark.parametrize("points", [[at(1.0, (0.4,))], [at(0.8, (0.4,)), at(1.6, (0.1, 0.2)), at(2.4, (0.0, 0.1))]])
def test_from_a_moving_start_the_line_takes_that_speed_up(speed, points):
    path = build(points, moving((0.1,), (speed, -0.3 * speed)))
    first = path.at(path.begin)
    assert first.position == pytest.approx(joints(0.1)) and first.velocity[:2] == pytest.approx((speed, -0.3 * speed))
    _, position, velocity, acceleration = samples(path)
    assert np.abs(acceleration).max() <= ACCELERATION * 1.0001
    assert np.abs(np.diff(velocity, axis=0)).max() <= ACCELERATION * 0.000501
    assert path.at(path.end).position == pytest.approx(points[-1].position, abs=1e-9)


@pytest.mark.parametrize("points, words", [
    ([at(0.05, (0.3,))], r"within the 0\.05 s behind point 1 the joints cannot take up, or give up, the speed"),
    ([at(1.0, (0.3,)), at(1.05, (0.4,))], r"within the 0\.05 s behind point 2 the joints cannot take up"),
    ([at(1.0, (0.9,)), at(1.02, (0.9,)), at(2.0, (0.0,)), at(3.0, (0.0,))],
     r"between points 2 and 3 the speed changes faster than the joints can: 0\.\d+ s would be needed, 0\.02 s are "
     "there; give velocities, or more time")])
def test_points_without_room_for_their_turns_are_refused_by_number(points, words):
    with pytest.raises(InvalidTrajectory, match=words):
        build(points)
