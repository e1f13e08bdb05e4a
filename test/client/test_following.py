"""Trajectories through the client: their begin, how they are joined and cancelled, and what stands against them."""
import logging
import math
import time
from concurrent.futures import Future

import pytest
from arm_bench import PATIENT
from waiting import eventually

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.trajectory import StartChanged, TrajectoryStart
from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage
from jaka_ros_driver.client.followed_path import followed_path
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.trajectory.build import PathStart
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import InvalidTrajectory, JointTrajectory, TrajectoryPoint, TrajectoryTolerances

HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
REST = (0.0,) * 6
LOOSE = TrajectoryTolerances((None,) * 6, (0.01,) * 6, 5.0)


def to(first, seconds, starts_at=None):
    """Return points: joint 1 to here, at rest there after so many seconds."""
    return JointTrajectory((TrajectoryPoint(seconds, (first,) + HOME[1:], REST),), starts_at)


@pytest.fixture
def arm(bench):
    return bench().connect(**PATIENT)


def joint(arm):
    return arm.state.joint_position[0]


def test_a_trajectory_ends_at_rest_on_its_last_point(arm):
    assert arm.trajectory is None
    goal = arm.follow(to(0.2, 0.8), LOOSE)
    assert eventually(lambda: arm.trajectory is not None and arm.trajectory.call is goal)
    goal.result(20.0)
    assert joint(arm) == pytest.approx(0.2, abs=1e-3) and arm.motion_owner is None


def test_its_frames_are_sent_ahead_where_that_is_asked_for_and_it_ends_where_it_should(bench):
    one = bench()
    arm = one.connect(stream_ahead=4, **PATIENT)
    arm.follow(to(0.3, 0.8), LOOSE).result(20.0)
    assert joint(arm) == pytest.approx(0.3, abs=1e-3) and arm.motion_owner is None
    times = one.times_of("servo_j")
    assert times[3] - times[0] < 0.5 * (times[7] - times[3]), "four at once, then one each cycle"


def test_one_that_starts_later_starts_then_and_is_over_in_its_time(arm):
    starts_at = time.monotonic() + 1.0
    goal = arm.follow(to(0.2, 0.8, starts_at), LOOSE)
    assert eventually(lambda: arm.is_servo_active)
    looks = [True]
    while time.monotonic() < starts_at - 0.1:  # a look that comes too late does not count
        assert looks[-1]
        looks.append(abs(joint(arm)) < 1e-3)
        time.sleep(0.02)  # between two looks
    goal.result(20.0)
    assert time.monotonic() - starts_at > 0.75


def test_of_one_that_started_in_the_past_the_rest_is_followed(arm):
    # Its first point lies in the past: the arm must be where it leads from there.
    points = (TrajectoryPoint(0.5, HOME, REST), TrajectoryPoint(1.5, (0.2,) + HOME[1:], REST))
    starts_at = time.monotonic() - 0.4
    arm.follow(JointTrajectory(points, starts_at), LOOSE).result(20.0)
    assert joint(arm) == pytest.approx(0.2, abs=1e-3)
    with pytest.raises(InvalidTrajectory):
        arm.follow(JointTrajectory(points, time.monotonic() - 10.0), LOOSE)


@pytest.mark.parametrize("rests, elapsed, is_told", [(True, 0.4, True), (True, 0.0, False), (False, 0.4, False)])
def test_only_a_trajectory_that_begins_late_for_an_arm_at_rest_is_logged_to_be_late(caplog, rests, elapsed, is_told):
    caplog.set_level(logging.INFO)
    model = load_model("zu7")
    start = TrajectoryStart(PathStart(JointState(HOME, REST, REST), rests))
    points = (TrajectoryPoint(0.0, HOME, REST), *to(0.2, 1.6).points)
    followed_path(start, JointTrajectory(points), elapsed, model, ArmCore(ClientSettings("127.0.0.1"), model), 0)
    assert ("begins %.3f s late" % elapsed in caplog.text) is ("late" in caplog.text) is is_told


def test_the_next_one_takes_over_where_the_arm_then_is(arm):
    first = arm.follow(to(0.5, 2.0), LOOSE)
    assert eventually(lambda: joint(arm) > 0.05)
    second = arm.follow(to(0.1, 1.5), LOOSE)
    with pytest.raises(MotionInterrupted) as caught:
        first.result(20.0)
    assert caught.value.cause is StopCause.REPLACED
    second.result(20.0)
    assert joint(arm) == pytest.approx(0.1, abs=1e-3)


def test_one_that_starts_later_is_joined_when_it_starts(arm):
    first = arm.follow(to(0.4, 1.6), LOOSE)
    assert eventually(lambda: joint(arm) > 0.02)
    starts_at = time.monotonic() + 0.5
    second = arm.follow(to(0.0, 2.0, starts_at), LOOSE)
    with pytest.raises(MotionInterrupted):
        first.result(20.0)
    second.result(20.0)
    assert joint(arm) == pytest.approx(0.0, abs=1e-3)
    assert 1.9 < time.monotonic() - starts_at < 8.0


def test_a_goal_is_cancelled_once_and_no_other_with_it(arm):
    goal = arm.follow(to(0.5, 6.0), LOOSE)
    assert eventually(lambda: joint(arm) > 0.05)
    assert not arm.cancel_trajectory(object())
    assert arm.cancel_trajectory(goal)
    with pytest.raises(MotionInterrupted) as caught:
        goal.result(20.0)
    assert caught.value.cause is StopCause.CANCELLED and joint(arm) < 0.45
    assert not arm.cancel_trajectory(goal)


def test_a_stop_since_it_was_asked_for_ends_it_before_anything_is_sent(bench):
    one = bench()
    arm = one.connect(**PATIENT)
    asked_with = arm.stops
    arm.stop()
    with pytest.raises(MotionInterrupted) as caught:
        arm.follow(to(0.2, 0.8), LOOSE, asked_with)
    assert caught.value.cause is StopCause.STOPPED and one.requests("servo_j") == 0


def test_an_end_of_all_trajectories_ends_one_that_was_asked_for_before_and_no_other_motion(bench):
    one = bench()
    arm = one.connect(**PATIENT)
    asked_with = arm.stops
    assert not arm.end_trajectories(), "none runs yet"
    with pytest.raises(MotionInterrupted):
        arm.follow(to(0.2, 0.8), LOOSE, asked_with)
    assert one.requests("servo_j") == 0
    goal = arm.follow(to(0.5, 6.0), LOOSE)
    assert eventually(lambda: joint(arm) > 0.05)
    assert arm.end_trajectories()
    with pytest.raises(MotionInterrupted) as caught:
        goal.result(20.0)
    assert caught.value.cause is StopCause.CANCELLED and joint(arm) < 0.45


def test_one_that_breaks_a_limit_is_refused_and_nothing_is_sent(bench):
    one = bench()
    arm = one.connect(**PATIENT)
    with pytest.raises(InvalidTrajectory):
        arm.follow(to(3.0, 0.1), LOOSE)
    assert one.requests("servo_move") == 0 and arm.motion_owner is None


def test_after_the_end_of_the_driver_a_jog_message_is_refused(bench):
    one = bench()
    arm = one.connect(**PATIENT)
    arm.close()
    with pytest.raises(ConnectionLost):
        arm.jog_velocity(JogMessage("/pad", 1, 0.0, time.monotonic(), None, ""))


# ---- an arm that goes on while a path is built ----

@pytest.fixture
def tries(monkeypatch):
    """Return a client without a link; ``outcomes`` are those of each try to hand a path over, ``leads`` what it was
    given.

    An outcome is an error, or None for a trajectory that is running.
    """
    arm = ArmClient(ClientSettings("127.0.0.1"), load_model("zu7"))
    arm.outcomes, arm.leads = [], []

    def try_to_follow(trajectory, tolerances, stops, lead):
        arm.leads.append(lead)
        done, error = Future(), arm.outcomes.pop(0)
        if error is not None:
            done.set_exception(error)
        return done

    monkeypatch.setattr(arm, "_try_to_follow", try_to_follow)
    yield arm
    arm.close()


def test_where_the_arm_has_gone_further_the_path_is_built_again_from_farther_ahead(tries):
    tries.outcomes += [StartChanged("gone"), StartChanged("gone"), None]
    assert not tries.follow(to(0.2, 0.8), LOOSE).done()
    first = tries.leads[0]
    assert tries.leads == [first, 2.0 * first, 4.0 * first] and 0.0 < first < 0.5


def test_an_arm_that_is_always_ahead_is_told_in_the_end(tries):
    tries.outcomes += [StartChanged("gone")] * 100
    with pytest.raises(StartChanged):
        tries.follow(to(0.2, 0.8), LOOSE)
    assert tries.leads[-2] <= 1.0 < tries.leads[-1] <= 2.0


def test_what_is_refused_is_not_tried_again(tries):
    tries.outcomes += [InvalidCommand("a jog is under way"), None]
    with pytest.raises(InvalidCommand):
        tries.follow(to(0.2, 0.8), LOOSE)
    assert len(tries.leads) == 1


def test_a_long_trajectory_joins_farther_ahead_because_its_audit_takes_longer(tries):
    point = to(0.2, 0.8).points
    tries.outcomes += [None, None]
    for count in (1, 1000):
        tries.follow(JointTrajectory(point * count), LOOSE)
    assert tries.leads[1] > 1.2 * tries.leads[0]
