"""The rules of a path from points: refused and dropped points, corners, and the brake behind the last point."""
import math

import numpy as np
import pytest

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING
from jaka_ros_driver.trajectory.build import BuildOptions, PathStart, build_path
from jaka_ros_driver.trajectory.clock import PathClock
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import (
    InvalidTrajectory,
    JointTrajectory,
    TrajectoryOfThePast,
    TrajectoryPoint,
)

MODEL = load_model("zu7")
HOME = (0.0, 1.5, -1.5, 1.5, 1.5, 0.0)
REST = (0.0,) * 6


def at(joint_1, time, velocity=REST, acceleration=None):
    return TrajectoryPoint(time, (joint_1,) + HOME[1:], velocity, acceleration)


def moving(velocity):
    return (velocity,) + REST[1:]


def built(*points, start=0.0, is_at_rest=True, velocity=0.0, elapsed=0.0, may_end_moving=False):
    begin = PathStart(JointState((start,) + HOME[1:], moving(velocity), REST), is_at_rest)
    return build_path(begin, JointTrajectory(points, may_end_moving=may_end_moving), elapsed, MODEL,
                      BuildOptions(0.01))


def joint_1(path, time):
    return path.at(time).position[0]


def highest_acceleration(path):
    """Return the highest acceleration from one cycle to the next of joint 1, rad/s2."""
    positions = path.samples(np.arange(path.breaks[0], path.end, 0.008))[0][:, 0]
    return float(np.abs(np.diff(positions, 2)).max()) / 0.008 ** 2


# ---- the audit ----

@pytest.mark.parametrize("points, what", [
    ((at(7.0, 20.0),), r"joint 1 would be at 6\..* rad after .* s; valid: -6.282185 to 6.282185 rad"),
    ((at(3.0, 1.2),), "joint 1 would run at 3.2.* rad/s after .* s; valid: at most 3.1416"),
    ((at(0.5, 1.0, None), at(-0.5, 1.1, None), at(0.0, 2.0, None)), "changes faster than the joints can"),
    ((at(0.5, 1.0, None), at(0.8, 1.1, None)), "within the 0.1 s behind point 2 the joints cannot take up, or give up"),
    ((at(0.25, 0.25),), "rad/s2 after 0.000 s; valid: at most 12.5664")])
def test_a_path_that_breaks_a_limit_anywhere_is_refused_with_joint_time_and_value(points, what):
    with pytest.raises(InvalidTrajectory, match=what):
        built(*points)


def test_a_limit_that_is_passed_between_the_points_only_is_found():
    points = at(6.2, 5.0), at(6.2, 5.3, moving(1.0)), at(6.2, 5.6)
    with pytest.raises(InvalidTrajectory, match="joint 1 would"):
        built(*points, start=6.0)


@pytest.mark.parametrize("points, when", [
    ((at(0.3, 1.0, None), at(0.6, 2.0)), "2.000"), ((at(0.3, 1.0), at(0.6, 2.0, None)), "1.000")])
def test_a_speed_that_jumps_at_the_end_or_between_two_polynomials_is_refused(points, when):
    with pytest.raises(InvalidTrajectory, match="the speed of joint 1 would change by .* at once after %s s" % when):
        built(*points)


# ---- the start ----

def test_an_arm_that_is_not_where_the_trajectory_begins_is_refused_and_one_that_is_near_is_led_onto_it():
    points = at(0.0, 0.0), at(1.0, 2.0)
    with pytest.raises(InvalidTrajectory, match="begins 0.0110 rad from where joint 1 is"):
        built(*points, start=0.011)
    path = built(*points, start=0.009)
    assert joint_1(path, 0.0) == pytest.approx(0.009) and joint_1(path, 2.0) == pytest.approx(1.0)
    assert joint_1(path, 1.9) == pytest.approx(joint_1(built(*points), 1.9), abs=1e-12)


def test_points_of_the_past_are_left_out_and_all_of_them_are_too_late():
    path = built(at(0.2, 1.0), at(0.6, 3.0), at(0.0, 5.0), start=0.2, elapsed=2.9, is_at_rest=False, velocity=0.0)
    assert path.begin == pytest.approx(2.9) and joint_1(path, 5.0) == pytest.approx(0.0)
    with pytest.raises(TrajectoryOfThePast, match="the last one was due 0.500 s ago"):
        built(at(0.2, 1.0), elapsed=1.5)


def test_a_trajectory_that_starts_later_is_waited_for_at_most_60_s():
    path = built(at(0.5, 2.0), elapsed=-3.0)
    assert path.begin == -3.0 and joint_1(path, -0.1) == 0.0 and joint_1(path, 2.0) == pytest.approx(0.5)
    with pytest.raises(InvalidTrajectory, match="at most 60 s"):
        built(at(0.5, 2.0), elapsed=-60.1)


# ---- points ----

@pytest.mark.parametrize("points, what", [
    ((at(math.nan, 1.0),), "position of joint 1 is nan"), ((at(0.1, 1.0, moving(math.inf)),), "velocity of joint 1"),
    ((at(0.1, 1.0), at(0.2, 1.0)), "times must rise"), ((at(0.1, -1.0),), "valid: 0 to"),
    ((at(0.1, 1.0, None, REST),), "accelerations, and no velocities"),
    ((at(0.1, 1.0, moving(0.5)),), "the last point has a velocity")])
def test_points_that_make_no_sense_are_refused(points, what):
    with pytest.raises(InvalidTrajectory, match=what):
        built(*points)


def test_a_last_point_in_motion_is_braked_behind_it_where_that_is_asked_for():
    path = built(at(0.5, 1.0, moving(1.0)), may_end_moving=True)
    assert path.at(1.0).velocity[0] == pytest.approx(1.0, abs=1e-6)
    assert joint_1(path, path.end) == pytest.approx(0.5 + 1.0 / (2.0 * JOINT_ACCELERATION_CEILING))


@pytest.mark.parametrize("middle, degree", [((moving(0.4), None), 3), ((moving(0.4), moving(0.7)), 5)])
def test_polynomials_pass_the_points_as_they_are_specified(middle, degree):
    ends = (REST, REST if degree == 5 else None)
    path = built(at(0.0, 0.0, *ends), at(0.3, 1.0, *middle), at(0.6, 2.0, *ends))
    state = path.at(1.0)
    assert state.position[0] == pytest.approx(0.3) and state.velocity[0] == pytest.approx(0.4)
    assert degree == 3 or state.acceleration[0] == pytest.approx(0.7)
    assert (np.abs(path.coefficients[:, degree + 1:]).max() if degree < 5 else 0.0) == 0.0


def test_corners_between_straight_lines_are_rounded_as_closely_as_the_joints_can():
    path = built(at(0.6, 1.0, None), at(0.0, 2.0, None))
    assert highest_acceleration(path) <= JOINT_ACCELERATION_CEILING * 1.03
    change = path.at(0.5).velocity[0] - path.at(1.5).velocity[0]
    assert change == pytest.approx(1.2, rel=0.1)
    assert 0.6 - joint_1(path, 1.0) == pytest.approx(change ** 2 / (8.0 * JOINT_ACCELERATION_CEILING), rel=1e-3)
    assert joint_1(path, 2.0) == pytest.approx(0.0, abs=1e-12)


# ---- the clock ----

def run(clock, rate, cycles):
    """Return positions of joint 1."""
    return [clock.step(rate)[0] for _ in range(cycles)]


def test_no_cycle_is_faster_than_the_joints_whatever_rate_is_wanted():
    clock = PathClock(built(at(3.0, 2.0)), MODEL)
    path = [0.0, *run(clock, 3.0, 400)]
    assert path[-1] == pytest.approx(3.0)
    assert max(b - a for a, b in zip(path, path[1:])) <= MODEL.joint_max_speed[0] * 0.008 * (1.0 + 1e-6)


def test_a_clock_that_is_stopped_brakes_with_what_the_joints_have_and_rests_on_the_path():
    clock = PathClock(built(at(2.0, 2.0)), MODEL)
    path = run(clock, 1.0, 125) + run(clock, 0.0, 60)
    steps = [b - a for a, b in zip(path, path[1:])]
    assert clock.is_still and clock.rate == 0.0 and not clock.is_at_end
    assert max(abs(b - a) for a, b in zip(steps, steps[1:])) / 0.008 ** 2 <= JOINT_ACCELERATION_CEILING * 1.03
    assert path[-1] == pytest.approx(joint_1(clock.path, clock.time), abs=1e-12)
