"""Points of a trajectory: malformed ones are refused by name."""
import math

import pytest
from plans import REST, at, joints

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.trajectory.points import (
    MAX_DURATION_S,
    MAX_POINTS,
    REST_VELOCITY,
    InvalidTrajectory,
    JointTrajectory,
    TrajectoryPoint,
    check_points,
)

FIRST = at(0.5, (0.1,), REST)
BAD_NUMBERS = [float("nan"), float("inf"), -float("inf")]


def with_number(kind, joint, value):
    """Return points of which one number is this."""
    values = {"position": joints(0.2), "velocity": REST, "acceleration": REST}
    values[kind] = values[kind][:joint] + (value,) + values[kind][joint + 1:]
    return TrajectoryPoint(1.0, **values)


def check(*points, **settings):
    check_points(JointTrajectory(points, **settings))


def test_good_points_are_taken():
    check(at(0.0, (0.1,)))
    check(FIRST, at(1.0, (0.2,)), at(2.0, (0.3,), REST), at(3.0, (0.3,), REST, (1.0,)))
    check(at(MAX_DURATION_S, (0.1,)))


@pytest.mark.parametrize("value", BAD_NUMBERS)
@pytest.mark.parametrize("joint", [0, 5])
@pytest.mark.parametrize("kind, unit", [("position", "rad"), ("velocity", "rad/s"), ("acceleration", "rad/s2")])
def test_a_number_that_is_not_finite_is_named_by_point_and_joint(kind, unit, joint, value):
    with pytest.raises(InvalidTrajectory) as refusal:
        check(FIRST, with_number(kind, joint, value))
    assert str(refusal.value) == "point 2: the %s of joint %d is %r; it must be a finite number in %s" % (
        kind, joint + 1, value, unit)


@pytest.mark.parametrize("length", [0, 5, 7])
@pytest.mark.parametrize("kind, unit", [("position", "rad"), ("velocity", "rad/s"), ("acceleration", "rad/s2")])
def test_a_wrong_number_of_joints_is_named(kind, unit, length):
    values = {"position": joints(0.2), "velocity": REST, "acceleration": REST, kind: (0.1,) * length}
    with pytest.raises(InvalidTrajectory, match="point 2 has %d numbers as its %s; it must be 6, in %s" % (
            length, kind, unit)):
        check(FIRST, TrajectoryPoint(1.0, **values))


@pytest.mark.parametrize("time, words", [
    (-0.001, r"point 2 has the time -0\.001 s; valid: 0 to 86400 s"),
    (MAX_DURATION_S + 1.0, r"point 2 has the time 86401 s; valid: 0 to 86400 s"),
    (1e38, r"point 2 has the time 1e\+38 s; valid: 0 to 86400 s"),
    (math.inf, "point 2 has the time inf s; valid: 0 to 86400 s"),
    (math.nan, "point 2 has the time nan s; valid: 0 to 86400 s"),
    (0.5, r"point 2 has the time 0\.5 s, and the point before it 0\.5 s; times must rise"),
    (0.3, r"point 2 has the time 0\.3 s, and the point before it 0\.5 s; times must rise")])
def test_times_that_do_not_rise_from_0_are_refused(time, words):
    with pytest.raises(InvalidTrajectory, match=words):
        check(FIRST, TrajectoryPoint(time, joints(0.2), REST))


def test_accelerations_without_velocities_are_refused():
    with pytest.raises(InvalidTrajectory, match="point 2 has accelerations, and no velocities"):
        check(FIRST, TrajectoryPoint(1.0, joints(0.2), None, REST))


def test_a_last_point_that_moves_is_refused_unless_it_may():
    last = at(1.0, (0.2,), (0.0, 0.1, -0.3))
    with pytest.raises(InvalidTrajectory, match=r"the last point has a velocity of -0\.3 rad/s; the arm must rest"):
        check(FIRST, last)
    check(FIRST, last, may_end_moving=True)
    check(FIRST, at(1.0, (0.2,), (REST_VELOCITY,)))


def test_no_point_and_too_many_are_refused():
    with pytest.raises(InvalidTrajectory, match="the trajectory has 0 points; valid: 1 to 100000"):
        check()
    point = at(0.0, (0.1,))
    with pytest.raises(InvalidTrajectory, match="the trajectory has 100001 points; valid: 1 to 100000"):
        check(*[point] * (MAX_POINTS + 1))


def test_the_refusals_are_those_of_a_command():
    assert issubclass(InvalidTrajectory, InvalidCommand)
