"""Trajectories through the client: their begin, how they are joined and cancelled, and what stands against them.

The client, without its thread and its sockets, and the simulated controller run in virtual time.
"""
import contextlib
import logging
import math
from concurrent.futures import Future

import pytest
from streamed_arm import StreamedArm, streamed_client

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

MODEL = load_model("zu7")
HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
REST = (0.0,) * 6
LOOSE = TrajectoryTolerances((None,) * 6, (0.01,) * 6, 5.0)
CYCLE = 0.008


def to(first, seconds, starts_at=None):
    """Return points: joint 1 to here, at rest there after so many seconds."""
    return JointTrajectory((TrajectoryPoint(seconds, (first,) + HOME[1:], REST),), starts_at)


@pytest.fixture
def make(monkeypatch):
    """Return a function that makes arms with these settings; each has its ``client``, closed in the end."""
    with contextlib.ExitStack() as open_clients:
        def one(**settings):
            arm = StreamedArm(MODEL, HOME, **settings)
            arm.client = open_clients.enter_context(streamed_client(arm, MODEL, monkeypatch))
            return arm
        yield one


@pytest.fixture
def arm(make):
    return make()


def joint(arm):
    return arm.joints[0]


def completed(arm, goal, first):
    """Let time pass until a goal is completed: joint 1 is there, rad, and the arm is free again."""
    arm.until(goal.done)
    assert goal.result() == ""
    assert joint(arm) == pytest.approx(first, abs=1e-9) and arm.client.motion_owner is None


def test_a_trajectory_ends_at_rest_on_its_last_point(arm):
    assert arm.client.trajectory is None
    goal = arm.client.follow(to(0.2, 0.8), LOOSE)
    assert arm.client.trajectory.call is goal
    completed(arm, goal, 0.2)
    assert not arm.is_moving and arm.halts() == 0


def test_its_frames_are_sent_ahead_where_that_is_asked_for_and_it_ends_where_it_should(make):
    arm = make(stream_ahead=4)
    completed(arm, arm.client.follow(to(0.3, 0.8), LOOSE), 0.3)
    times = arm.times_of("servo_j")
    assert times[3] == times[0], "four at once"
    assert times[7] - times[4] == pytest.approx(3 * CYCLE, abs=1e-9), "then one each cycle"


def test_one_that_starts_later_starts_then_and_is_over_in_its_time(arm):
    starts_at = arm.now + 1.0
    goal = arm.client.follow(to(0.2, 0.8, starts_at), LOOSE)
    arm.until(lambda: arm.client.is_servo_active)
    assert arm.now < starts_at - 0.9
    completed(arm, goal, 0.2)
    led = arm.moved_frames()
    assert starts_at < led[0] <= starts_at + CYCLE and starts_at + 0.8 <= led[-1] <= starts_at + 0.8 + CYCLE


def test_of_one_that_started_in_the_past_the_rest_is_followed(arm):
    # Its first point lies in the past: the arm must be where it leads from there.
    points = (TrajectoryPoint(0.5, HOME, REST), TrajectoryPoint(1.5, (0.2,) + HOME[1:], REST))
    starts_at = arm.now - 0.4
    completed(arm, arm.client.follow(JointTrajectory(points, starts_at), LOOSE), 0.2)
    led = arm.moved_frames()
    assert starts_at + 0.5 < led[0] and starts_at + 1.5 <= led[-1] <= starts_at + 1.5 + 2 * CYCLE
    with pytest.raises(InvalidTrajectory):
        arm.client.follow(JointTrajectory(points, arm.now - 10.0), LOOSE)


@pytest.mark.parametrize("rests, elapsed, is_told", [(True, 0.4, True), (True, 0.0, False), (False, 0.4, False)])
def test_only_a_trajectory_that_begins_late_for_an_arm_at_rest_is_logged_to_be_late(caplog, rests, elapsed, is_told):
    caplog.set_level(logging.INFO)
    model = load_model("zu7")
    start = TrajectoryStart(PathStart(JointState(HOME, REST, REST), rests))
    points = (TrajectoryPoint(0.0, HOME, REST), *to(0.2, 1.6).points)
    followed_path(start, JointTrajectory(points), elapsed, model, ArmCore(ClientSettings("127.0.0.1"), model), 0)
    assert ("begins %.3f s late" % elapsed in caplog.text) is ("late" in caplog.text) is is_told


def test_the_next_one_takes_over_where_the_arm_then_is(arm):
    first = arm.client.follow(to(0.5, 2.0), LOOSE)
    arm.until(lambda: joint(arm) > 0.05)
    second = arm.client.follow(to(0.1, 1.5), LOOSE)
    assert first.done() and first.exception().cause is StopCause.REPLACED
    completed(arm, second, 0.1)
    assert arm.halts() == 0 and arm.hardest() < 1.0, "the join is a jump"


def test_one_that_starts_later_is_joined_when_it_starts(arm):
    first = arm.client.follow(to(0.4, 1.6), LOOSE)
    arm.until(lambda: joint(arm) > 0.02)
    starts_at = arm.now + 0.5
    second = arm.client.follow(to(0.0, 2.0, starts_at), LOOSE)
    assert first.done() and first.exception().cause is StopCause.REPLACED
    completed(arm, second, 0.0)
    led = arm.moved_frames()
    assert starts_at + 2.0 <= led[-1] <= starts_at + 2.0 + CYCLE
    assert arm.halts() == 0 and arm.hardest() < 1.0, "the join is a jump"


def test_a_goal_is_cancelled_once_and_no_other_with_it(arm):
    goal = arm.client.follow(to(0.5, 6.0), LOOSE)
    arm.until(lambda: joint(arm) > 0.05)
    assert not arm.client.cancel_trajectory(object())
    assert arm.client.cancel_trajectory(goal)
    cancelled_at = arm.now
    arm.until(goal.done)
    assert goal.exception().cause is StopCause.CANCELLED
    assert arm.rest_after(cancelled_at) <= cancelled_at + 2 * CYCLE and joint(arm) < 0.051
    assert not arm.client.cancel_trajectory(goal)


def test_a_stop_since_it_was_asked_for_ends_it_before_anything_is_sent(arm):
    asked_with = arm.client.stops
    assert arm.ended(arm.begin("stop")) is None
    with pytest.raises(MotionInterrupted) as caught:
        arm.client.follow(to(0.2, 0.8), LOOSE, asked_with)
    arm.run(1.0)
    assert caught.value.cause is StopCause.STOPPED and not arm.times_of("servo_j")


def test_an_end_of_all_trajectories_ends_one_that_was_asked_for_before_and_no_other_motion(arm):
    asked_with = arm.client.stops
    assert not arm.client.end_trajectories(), "none runs yet"
    with pytest.raises(MotionInterrupted):
        arm.client.follow(to(0.2, 0.8), LOOSE, asked_with)
    arm.run(1.0)
    assert not arm.times_of("servo_j")
    goal = arm.client.follow(to(0.5, 6.0), LOOSE)
    arm.until(lambda: joint(arm) > 0.05)
    assert arm.client.end_trajectories()
    arm.until(goal.done)
    assert goal.exception().cause is StopCause.CANCELLED and joint(arm) < 0.051


def test_one_that_breaks_a_limit_is_refused_and_nothing_is_sent(arm):
    with pytest.raises(InvalidTrajectory):
        arm.client.follow(to(3.0, 0.1), LOOSE)
    arm.run(1.0)
    assert not arm.times_of("servo_move") and arm.client.motion_owner is None


def test_after_the_end_of_the_driver_a_jog_message_is_refused(arm):
    arm.client.close()
    with pytest.raises(ConnectionLost, match="driver shut down"):
        arm.client.jog_velocity(JogMessage("/pad", 1, 0.0, arm.now, None, ""))


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
