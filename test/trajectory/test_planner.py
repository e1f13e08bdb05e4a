"""Plans of a real planner, carried out in virtual time: OMPL finds ways between joints, TOPP-RA gives them their time.

The frames on the wire are compared with the spline through the plan's points, which scipy computes here by itself.
"""
import importlib
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from simulated_arm import SimulatedArm, moving_frames

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import link_transforms
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, JOINT_SPEED_CEILING, SERVO_PERIOD_S
from jaka_ros_driver.kinematics.urdf import urdf_from_model
from jaka_ros_driver.trajectory.build import BuildOptions, PathStart, build_path
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint


def planner(name):
    """Import and return a module of the planners where it is used: every process that collects tests has this file, and
    these take seconds.

    requirements.txt asks for them from Python 3.10 on: only below may one be missing.
    """
    return pytest.importorskip(name) if sys.version_info < (3, 10) else importlib.import_module(name)


PLANS = {"zu3": 10, "zu7": 10, "zu18": 10}
BATCH = 5
FAST_MODELS = ("zu3", "zu5", "zu7", "zu12", "zu18", "zu20")
FAST_PLANS = 17
FAST_SPACINGS_S = (0.1, 0.05, 0.02)
FAST_SHARE, FAST_ACCELERATION = 0.98, 10.0
"""The plans of the figure in docs/moveit.md: share of the joints' speeds, and acceleration, rad/s2."""
SPACINGS_S = (0.1, 0.05, 0.04, 0.02, 0.01, 0.008)
SPEED_SHARE = 0.6
ACCELERATION = 4.0
"""Acceleration of the plans, rad/s2."""
MARGIN = 0.3
"""Distance, rad, that a spline through a planner's points may swing out beside them."""
FLOOR = 0.05
"""Lowest height of a link, m, which is what makes paths of more than one line."""
LONGEST_STEP = 0.8
DURATION_TOLERANCE_S = SERVO_PERIOD_S
RMS_TOLERANCE = 2e-4
REST_TOLERANCE = 1e-3


def limits(model):
    """Return lower and upper bounds, rad, and speeds, rad/s, (6,) each, as the URDF gives them to a planner."""
    found = [joint.find("limit") for joint in ElementTree.fromstring(urdf_from_model(model)).iter("joint")
             if joint.get("type") == "revolute"]
    return tuple(np.array([float(limit.get(name)) for limit in found]) for name in ("lower", "upper", "velocity"))


def is_free(model, joints):
    return all(transform[11] >= FLOOR for transform in link_transforms(model, joints)[1:])


def way(model, low, high, seed):
    """Return joints from one place at random to another, rad (n, 6), all above the floor."""
    base, geometric, util = planner("ompl.base"), planner("ompl.geometric"), planner("ompl.util")
    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(seed)
    chance = np.random.default_rng(seed)

    def drawn():
        while True:
            joints = chance.uniform(low, high)
            if is_free(model, joints.tolist()):
                return joints

    space, bounds = base.RealVectorStateSpace(6), base.RealVectorBounds(6)
    for joint in range(6):
        bounds.setLow(joint, low[joint])
        bounds.setHigh(joint, high[joint])
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: is_free(model, [state[joint] for joint in range(6)]))
    start, goal = space.allocState(), space.allocState()
    for state, joints in ((start, drawn()), (goal, drawn())):
        for joint in range(6):
            state[joint] = float(joints[joint])
    setup.setStartAndGoalStates(start, goal)
    search = geometric.RRTConnect(setup.getSpaceInformation())
    search.setRange(LONGEST_STEP)
    setup.setPlanner(search)
    setup.solve(60.0)
    assert setup.haveExactSolutionPath()
    return np.array([[state[joint] for joint in range(6)] for state in setup.getSolutionPath().getStates()])


def timed_way(model, seed, share, acceleration):
    """Return a way as a function of time, with this share of the joints' speeds and this acceleration, rad/s2."""
    toppra, constraint, algorithm = planner("toppra"), planner("toppra.constraint"), planner("toppra.algorithm")
    low, high, speed = limits(model)
    points = way(model, low + MARGIN, high - MARGIN, seed)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.concatenate(([True], lengths > 1e-6))]
    along = np.concatenate(([0.0], np.cumsum(lengths[lengths > 1e-6])))
    top = share * np.minimum(speed, JOINT_SPEED_CEILING)
    timed = algorithm.TOPPRA(
        [constraint.JointVelocityConstraint(np.stack((-top, top), axis=1)),
         constraint.JointAccelerationConstraint(np.array([[-acceleration, acceleration]] * 6))],
        toppra.SplineInterpolator(along, points), parametrizer="ParametrizeConstAccel").compute_trajectory()
    assert timed is not None
    return timed


def plan(model, seed):
    """Return points of one plan; their spacing, and whether they have accelerations, are drawn."""
    spacing = float(np.random.default_rng(seed).choice(SPACINGS_S))
    return resampled(timed_way(model, seed, SPEED_SHARE, ACCELERATION), spacing, seed % 2 == 0)


def resampled(timed, spacing, has_acceleration):
    """Return points of a way, so far apart, s."""
    times = np.append(np.arange(0.0, timed.duration - 0.5 * spacing, spacing), timed.duration)
    positions, velocities, accelerations = timed(times), timed(times, 1), timed(times, 2)
    velocities[[0, -1]] = 0.0
    return [TrajectoryPoint(t, tuple(p), tuple(v), tuple(a) if has_acceleration else None) for t, p, v, a in zip(
        times.tolist(), positions.tolist(), velocities.tolist(), accelerations.tolist())]


def ideal(points):
    """Return the spline through points, at any time, rad."""
    kinds = [[point.position for point in points], [point.velocity for point in points]]
    if points[0].acceleration is not None:
        kinds.append([point.acceleration for point in points])
    return planner("scipy.interpolate").BPoly.from_derivatives([point.time for point in points], np.stack(
        [np.array(kind) for kind in kinds], axis=1))


def followed(model, points):
    """Carry out one plan; return how far its duration, s, and its joints (RMS of the worst one), rad, are off."""
    arm = SimulatedArm(model, points[0].position)
    error = arm.follow(points)
    assert error is None, error
    assert np.abs(np.array(arm.joints) - np.array(points[-1].position)).max() <= REST_TOLERANCE
    assert not arm.controller.state.plant.is_moving and not arm.controller.state.plant.is_servo_active
    times, joints = moving_frames(arm.frames)
    top = np.minimum(model.joint_max_speed, JOINT_SPEED_CEILING)
    assert (np.abs(np.diff(joints, axis=0)) <= top * SERVO_PERIOD_S * (1.0 + 1e-6)).all()
    assert np.abs(np.diff(joints, 2, axis=0)).max() <= JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S ** 2 * 1.03
    assert np.diff(times) == pytest.approx(SERVO_PERIOD_S, abs=1e-6)
    wanted = ideal(points)(np.clip(times - times[0], 0.0, points[-1].time))
    rms = np.sqrt(((joints - wanted) ** 2).mean(axis=0)).max()
    return abs(float(times[-1] - times[0]) - points[-1].time), float(rms)


@pytest.mark.parametrize("name, first", [
    (name, first) for name, count in PLANS.items() for first in range(0, count, BATCH)])
def test_plans_of_a_planner_are_followed_in_their_time_and_on_their_spline(name, first, record_property):
    model = load_model(name)
    errors = []
    for number in range(first, first + BATCH):
        points = plan(model, 1000 * list(PLANS).index(name) + number + 1)
        duration_error, rms = followed(model, points)
        assert duration_error <= DURATION_TOLERANCE_S + 1e-6, "plan %d" % number
        assert rms < RMS_TOLERANCE, "plan %d" % number
        errors.append((duration_error, rms))
    worst = np.array(errors).max(axis=0).tolist()  # pytest-xdist passes plain numbers on, and no others
    record_property("worst duration error, s", worst[0])
    record_property("worst RMS error, rad", worst[1])
    print("%s, plans %d to %d: duration within %.2f ms, RMS error at most %.7f mrad" % (
        name, first, first + BATCH - 1, 1e3 * worst[0], 1e3 * worst[1]))


@pytest.mark.parametrize("name", FAST_MODELS)
def test_plans_of_a_planner_at_nearly_full_speed_are_taken_and_slowed_where_their_polynomials_overshoot(name):
    model, slowed, longest = load_model(name), 0, 0.0
    for number in range(FAST_PLANS):
        way = timed_way(model, 500 + number, FAST_SHARE, FAST_ACCELERATION)
        for spacing in FAST_SPACINGS_S:
            points = resampled(way, spacing, number % 2 == 0)
            start = PathStart(JointState(points[0].position, (0.0,) * 6, (0.0,) * 6), True)
            path = build_path(start, JointTrajectory(tuple(points)), 0.0, model, BuildOptions(0.01, slows=True))
            if path.rates is not None:
                slowed += 1
                longest = max(longest, path.rates.delay())
    assert longest < 0.05
    print("%s: %d plans, %d slowed, by at most %.0f ms" % (
        name, FAST_PLANS * len(FAST_SPACINGS_S), slowed, 1e3 * longest))


def test_a_plan_is_the_same_again():
    model = load_model("zu7")
    assert plan(model, 5) == plan(model, 5) != plan(model, 6)


def test_half_of_the_plans_have_accelerations_and_all_spacings_occur():
    model = load_model("zu3")
    plans = [plan(model, number) for number in range(1, 31)]
    assert sum(points[0].acceleration is not None for points in plans) == 15
    assert {round(points[1].time, 6) for points in plans} == set(SPACINGS_S)
    assert sum(len(points) > 100 for points in plans) > 5
