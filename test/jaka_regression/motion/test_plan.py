"""The way from samples to a trajectory: smooth, near to them, within the limits that the driver's own audit checks."""
import importlib
import importlib.util

import numpy as np
import pytest
from motion_logs import limits_of, recording_of, session

from jaka_bag import driver_interface
from jaka_bag.errors import BagError, MissingDependency
from jaka_regression.motion.path import LARGEST_DEVIATION, smooth
from jaka_regression.motion.plan import BeyondLimits, plan_motion
from jaka_regression.motion.time_law import SOLVERS, find_solver
from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, JOINT_SPEED_CEILING
from jaka_ros_driver.trajectory.build import BuildOptions, PathStart, build_path
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import MAX_POINTS, JointTrajectory, TrajectoryPoint

INSTALLED = [name for name in SOLVERS if importlib.util.find_spec(name)]
solvers = pytest.mark.parametrize("solver", [pytest.param(name, marks=pytest.mark.skipif(
    name not in INSTALLED, reason="not installed")) for name in SOLVERS])


def audited(plan, model="zu7"):
    """Return the path that the driver makes of a plan; raise where it would refuse it."""
    rows = zip(plan.time.tolist(), plan.position.tolist(), plan.velocity.tolist(), plan.acceleration.tolist())
    points = tuple(TrajectoryPoint(t, tuple(p), tuple(v), tuple(a)) for t, p, v, a in rows)
    rest = PathStart(JointState(plan.start, (0.0,) * 6, (0.0,) * 6), True)
    return build_path(rest, JointTrajectory(points), 0.0, load_model(model), BuildOptions(0.01))


def test_what_is_known_of_the_driver_is_so():
    assert driver_interface.JOINTS == tuple(JOINTS)
    assert driver_interface.JOINT_SPEED_CEILING == JOINT_SPEED_CEILING
    assert driver_interface.JOINT_ACCELERATION_CEILING == JOINT_ACCELERATION_CEILING
    assert importlib.import_module("jaka_regression.motion.plan").MOST_POINTS == MAX_POINTS


@solvers
@pytest.mark.parametrize("noise, deviation", [(0.0, 3e-4), (2e-5, 4e-4), (1e-3, 5.5e-3)])
def test_a_motion_is_followed_in_its_time_and_noise_is_no_acceleration(tmp_path, solver, noise, deviation):
    made = session(noise=noise)
    plan = plan_motion(recording_of(tmp_path / "log.mcap", made), limits_of(), solver=solver)
    audited(plan)
    assert plan.smoothed.deviation < deviation and plan.smoothed.noise == pytest.approx(noise, rel=0.3, abs=1e-5)
    assert plan.duration == pytest.approx(4.0, abs=0.9) and plan.notes == []
    assert plan.slowest > 0.98 and (np.diff(plan.time) > 0.0).all()
    truth = np.gradient(np.gradient(session().joints, 0.008, axis=0), 0.008, axis=0)
    assert np.abs(plan.acceleration).max() < np.abs(truth).max() + 4.0 * 0.3 + 0.5
    assert not plan.velocity[[0, -1]].any() and not plan.acceleration[[0, -1]].any()
    way = plan.smoothed.path.at(plan.place)[0]
    assert np.abs(way - plan.position).max() < 1e-9, "its shape does not depend on its speed"


@solvers
def test_a_motion_that_is_too_fast_is_slowed_down_and_says_by_how_much(tmp_path, solver):
    plan = plan_motion(recording_of(tmp_path / "log.mcap", session(seconds=1.2, reach=1.6)), limits_of(), solver=solver)
    audited(plan)
    assert plan.slowest < 0.9
    (note,) = plan.notes
    assert "too fast for the arm" in note and "slowed down to %.0f %%" % (100.0 * plan.slowest) in note
    assert (np.abs(plan.velocity) <= plan.limits.speed).all()


@solvers
@pytest.mark.parametrize("factor", [0.3, 2.5])
def test_another_speed_changes_the_time_and_not_the_way(tmp_path, solver, factor):
    recording = recording_of(tmp_path / "log.mcap", session(reach=0.3))
    one, other = (plan_motion(recording, limits_of(), f, solver=solver) for f in (1.0, factor))
    audited(other)
    assert other.slowest > 0.98
    moving = [np.flatnonzero(np.abs(plan.velocity).max(axis=1) > 0.01) for plan in (one, other)]
    lasts = [plan.time[where[-1]] - plan.time[where[0]] for plan, where in zip((one, other), moving)]
    assert lasts[1] == pytest.approx(lasts[0] / factor, rel=0.08)
    assert np.abs(other.position[0] - one.position[0]).max() < 1e-3


def test_standstill_is_cut_at_both_ends_and_inside_where_asked_for(tmp_path):
    both = session(seconds=2.0, before=3.0, after=9.0)
    both.joints[1000:1250] = both.joints[375:625]
    recording = recording_of(tmp_path / "log.mcap", both)
    whole, cut = smooth(recording), smooth(recording, longest_pause=0.6)
    assert whole.cut[0] > 2.0 and whole.cut[2] > 2.0 and whole.cut[1] == 0.0
    assert cut.cut[1] == pytest.approx(whole.path.duration - cut.path.duration) and cut.cut[1] > 1.5
    audited(plan_motion(recording, limits_of(), longest_pause=0.6))


def test_an_arm_that_stands_still_has_no_motion(tmp_path):
    for noise in (0.0, 1e-4):
        with pytest.raises(BagError, match="stands still on /jaka_driver/joint_position"):
            plan_motion(recording_of(tmp_path / "log.mcap", session(reach=0.0, noise=noise)), limits_of())


def test_a_log_of_the_middle_of_a_motion_is_begun_and_ended_at_rest(tmp_path):
    part = session(before=-1.0, after=-1.0)
    plan = plan_motion(recording_of(tmp_path / "log.mcap", part), limits_of())
    audited(plan)
    assert [note.split(" of a motion")[0] for note in plan.notes[:2]] == [
        "the log begins in the middle", "the log ends in the middle"]


def test_joints_beyond_the_limits_are_refused_and_those_on_them_are_not(tmp_path):
    limits, made = limits_of(), session()
    highest = np.abs(made.joints).max(axis=0)
    recording = recording_of(tmp_path / "log.mcap", made)
    with pytest.raises(BeyondLimits, match=r"joint_\d was at .* the zu7 can go from .* another arm"):
        plan_motion(recording, limits._replace(low=-highest + 0.05, high=highest - 0.05))
    tight = limits._replace(low=-highest - 1e-4, high=highest + 1e-4)
    plan = plan_motion(recording, tight)
    assert (plan.position <= tight.high + 1e-6).all() and (plan.position >= tight.low - 1e-6).all()


def test_a_joint_that_shakes_more_than_a_motion_does_is_refused(tmp_path):
    shaking = session()
    shaking.joints[:, 3] += 0.03 * np.where(np.arange(len(shaking.time)) % 4 < 2, 1.0, -1.0)
    with pytest.raises(BagError, match="joint_4 .* shakes more than a motion does"):
        plan_motion(recording_of(tmp_path / "log.mcap", shaking), limits_of())
    assert LARGEST_DEVIATION < 0.03


def test_without_a_solver_it_says_which_one_is_needed(monkeypatch):
    def nothing(name, *_):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", nothing)
    with pytest.raises(MissingDependency, match="needs the Python package toppra, or ruckig"):
        find_solver()
