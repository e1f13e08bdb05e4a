"""The reserve of streams: frames that are sent some cycles ahead, over a driver that is late, a stop, and the end."""
import math

import numpy as np
import pytest
from streamed_arm import REST, TOLERANCES, StreamedArm, streamed_client

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, MotionGuard
from jaka_ros_driver.client.core.point_stream import StreamPoint
from jaka_ros_driver.client.core.procedures.pausing import pause, resume
from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage
from jaka_ros_driver.client.core.velocity_jog.ramp import Wish
from jaka_ros_driver.errors import MotionInterrupted
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint

MODEL = load_model("zu7")
GUARD = MotionGuard(MODEL)
CYCLE = 0.008
END = (0.9, *HOME[1:])
POINT = TrajectoryPoint(1.2, END, REST)
INTO_THE_BASE = (1.781, -0.866, -2.694, 0.38, 0.163, -3.141)
AHEAD = range(5)
JOG = Wish(c.JogFrame.JOINT, (0.4,) + REST[1:])


def simulated(ahead, **more):
    return StreamedArm(MODEL, HOME, stream_ahead=ahead, **more)


def follows(arm, ahead):
    """Return whether the arm is at the frame that was sent so many cycles ago; the newest may have come just now."""
    return any(arm.joints == pytest.approx(arm.frames[back - ahead][1], abs=1e-9) for back in (-1, -2))


def is_servo_active(arm):
    return arm.controller.state.plant.is_servo_active


@pytest.mark.parametrize("ahead", AHEAD)
def test_the_reserve_is_sent_with_the_first_frame_and_the_arm_follows_that_much_later(ahead):
    arm = simulated(ahead)
    call = arm.begin_trajectory(POINT)
    arm.run(0.8)
    times = [at for at, _ in arm.frames]
    at_once = max(1, ahead)  # the frame behind them goes out in its own cycle
    assert times[at_once - 1] == times[0] < times[at_once] < times[0] + 1.001 * CYCLE
    assert np.diff(times[at_once:]) == pytest.approx(CYCLE, abs=1e-9)
    assert follows(arm, ahead)
    assert arm.ended(call) is None and arm.joints == pytest.approx(END, abs=1e-9)
    assert arm.halts() == 0 and arm.hardest() <= 1.03 * JOINT_ACCELERATION_CEILING


@pytest.mark.parametrize("ahead", AHEAD)
@pytest.mark.parametrize("late", AHEAD)
def test_a_driver_that_is_late_by_no_more_than_the_reserve_leaves_no_gap(ahead, late):
    arm = simulated(ahead)
    call = arm.begin_trajectory(POINT)
    arm.run(0.5)
    for _ in range(3):
        arm.held_until = arm.now + late * CYCLE
        arm.run(0.2)
    assert arm.ended(call) is None and arm.joints == pytest.approx(END, abs=1e-9)
    if late <= ahead:
        assert arm.halts() == 0 and arm.hardest() <= 1.03 * JOINT_ACCELERATION_CEILING
    elif late > ahead + 1:
        assert arm.halts() >= 3, "the reserve is not what helped"
    bursts = [sum(abs(at - other) < 1e-9 for other, _ in arm.frames) for at, _ in arm.frames]
    assert max(bursts) <= ahead + 1


@pytest.mark.parametrize("ahead", AHEAD)
def test_a_driver_that_is_late_by_more_leaves_cycles_out_and_fills_its_reserve_again(ahead):
    arm = simulated(ahead)
    call = arm.begin_trajectory(POINT)
    arm.run(0.5)
    before = len(arm.frames)
    arm.held_until = arm.now + (ahead + 6) * CYCLE
    arm.run((ahead + 6) * CYCLE + 0.001)
    assert len(arm.frames) - before in (ahead, ahead + 1, ahead + 2)
    assert arm.core.late_servo_cycles in (5, 6)
    arm.run(0.1)
    assert follows(arm, ahead)
    assert arm.ended(call) is None and arm.joints == pytest.approx(END, abs=1e-9)


@pytest.mark.parametrize("ahead", AHEAD)
def test_a_jog_that_is_released_stands_where_its_last_frame_led_and_servo_mode_is_left_then(ahead):
    arm = simulated(ahead)
    assert arm.jog(JOG, 0.6) == ""
    arm.until(lambda: not is_servo_active(arm))
    last = arm.frames[-1][1]
    assert arm.joints == pytest.approx(last, abs=1e-9), "frames that led on were dropped"
    led_at = max(at for (at, place), (_, before) in zip(arm.frames[1:], arm.frames) if place != before)
    assert arm.times_of("servo_move")[-1] - led_at <= (ahead + 3) * CYCLE + 1e-6, "a cycle to take it, one for it"
    assert arm.hardest() <= 1.03 * JOINT_ACCELERATION_CEILING
    arm.until(lambda: arm.core.is_free)
    assert arm.joints == pytest.approx(last, abs=1e-9)


def released_after(ahead, wish):
    """Return the time, s, from the last message of a jog, then this one where it is not None, until the arm rests."""
    arm = simulated(ahead)
    assert arm.jog(JOG, 0.6) == ""
    last = arm.now - 0.02 if wish is None else arm.now
    if wish is not None:
        message = JogMessage("pad", int(1e9 * arm.now), 0.0, arm.now, wish)
        arm.act(lambda now: arm.core.jog_velocity(message, now))
    arm.until(lambda: arm.core.is_free)
    return arm.rest_after(last) - last


@pytest.mark.parametrize("ahead", AHEAD)
def test_silence_ends_a_jog_no_later_and_a_message_of_rest_by_no_more_than_the_reserve(ahead):
    assert released_after(ahead, None) <= released_after(0, None) + CYCLE + 1e-6
    rest = JOG._replace(velocity=REST)
    assert released_after(ahead, rest) <= released_after(0, rest) + (ahead + 1) * CYCLE + 1e-6 <= 0.2


@pytest.mark.parametrize("ahead", AHEAD)
def test_what_the_motion_guard_brakes_stands_before_the_stop_is_sent(ahead):
    arm = simulated(ahead)
    way = [b - a for a, b in zip(HOME, INTO_THE_BASE)]
    wish = Wish(c.JogFrame.JOINT, tuple([0.5 * w / max(map(abs, way)) for w in way]))
    assert "(the flange is " in arm.jog(wish, 8.0)
    arm.until(lambda: arm.times_of("stop_program"))
    assert arm.joints == pytest.approx(arm.frames[-1][1], abs=1e-9), "the stop dropped frames of the brake"
    arm.until(lambda: arm.core.is_free)
    assert DEFAULT_MARGIN - 1e-4 <= GUARD.nearest(arm.joints).distance <= DEFAULT_MARGIN + 0.03


def stopped(ahead, drops):
    """Stop a fast trajectory in its middle; return the time from the stop to rest, s, and the largest acceleration."""
    arm = simulated(ahead, dialect={"stop_drops_frames": drops})
    arm.begin_trajectory(POINT)
    arm.run(0.75)
    called_at = arm.now
    assert arm.ended(arm.begin("stop")) is None
    arm.until(lambda: arm.core.is_free)
    arm.run(0.5)
    return arm.rest_after(called_at) - called_at, arm.hardest()


@pytest.mark.parametrize("ahead", AHEAD)
def test_a_stop_drops_the_reserve_or_lets_no_more_than_its_cycles_run_out(ahead):
    without, _ = stopped(0, True)
    dropped, _ = stopped(ahead, True)
    run_out, _ = stopped(ahead, False)
    assert dropped <= without + CYCLE
    assert dropped <= run_out <= without + (ahead + 1) * CYCLE + 1e-9


@pytest.mark.parametrize("ahead", AHEAD)
def test_a_trajectory_can_be_paused_resumed_and_cancelled(ahead):
    arm = simulated(ahead)
    call = arm.begin_trajectory(POINT)
    arm.run(0.6)
    arm.does(pause)
    at = arm.joints
    assert not arm.is_moving and at == pytest.approx(arm.frames[-1][1], abs=2e-4)
    arm.run(0.5)
    assert arm.joints == pytest.approx(at, abs=2e-4)
    arm.does(resume)
    arm.run(0.1)
    assert arm.core.cancel_trajectory(call, arm.now)
    assert isinstance(arm.ended(call), MotionInterrupted) and arm.halts() > 30
    assert arm.joints == pytest.approx(arm.frames[-1][1], abs=1e-9) and not arm.times_of("stop_program")


@pytest.mark.parametrize("ahead", AHEAD)
def test_the_wanted_state_that_is_published_is_the_one_of_now(ahead):
    arm = simulated(ahead)
    arm.begin_trajectory(POINT)
    away = []
    for _ in range(100):
        arm.run(CYCLE)
        away.append(abs(arm.core.trajectory.desired.position[0] - arm.state.joint_position[0]))
    assert max(away) <= 1.6 * 0.9 * 2 * CYCLE


@pytest.mark.parametrize("ahead", AHEAD)
def test_a_trajectory_joins_another_and_ends_at_its_target(ahead):
    arm = simulated(ahead)
    first = arm.begin_trajectory(POINT)
    arm.run(0.6)
    second = arm.begin_trajectory(TrajectoryPoint(1.5, (0.2, 1.3, *HOME[2:]), REST))
    assert isinstance(arm.ended(first), MotionInterrupted)
    assert arm.ended(second) is None and arm.joints == pytest.approx((0.2, 1.3, *HOME[2:]), abs=1e-9)
    assert arm.halts() == 0 and arm.hardest() <= 1.03 * JOINT_ACCELERATION_CEILING


@pytest.mark.parametrize("ahead", AHEAD)
@pytest.mark.parametrize("in_future", [0.5, -0.3])
def test_a_trajectory_that_joins_another_keeps_the_time_of_its_stamp(ahead, in_future, monkeypatch):
    arm = simulated(ahead)
    arm.begin_trajectory(TrajectoryPoint(3.0, END, REST))
    arm.run(0.6)
    starts_at = arm.now + in_future
    points = tuple(TrajectoryPoint(at, (way, *HOME[1:]), REST) for at, way in ((1.0, 0.3), (2.0, 0.7)))
    with streamed_client(arm, MODEL, monkeypatch) as client:
        goal = client.follow(JointTrajectory(points, starts_at), TOLERANCES)
        arm.run(starts_at + 1.5 - arm.now)
        assert arm.joints[0] == pytest.approx(0.5, abs=0.6 * 1.01 * 2 * CYCLE)
        arm.until(goal.done)
        assert goal.exception() is None


def test_targets_and_points_of_a_client_have_no_reserve():
    arm = simulated(4)
    assert arm.ended(arm.begin("servo_mode", True)) is None
    arm.target(c.ServoJoint((0.02, *HOME[1:])))
    arm.run(0.3)
    assert np.diff([at for at, _ in arm.frames]) == pytest.approx(CYCLE, abs=1e-9)
    assert arm.ended(arm.begin("servo_mode", False)) is None
    arm = simulated(4)
    for number in range(20):
        arm.begin("follow_point", StreamPoint((0.005 * number, *HOME[1:]), arm.now + 0.02), arm.core.stops)
        arm.run(0.02)
    assert arm.frames and np.diff([at for at, _ in arm.frames]) == pytest.approx(CYCLE, abs=1e-9)


@pytest.mark.parametrize("ahead", [1, 4])
@pytest.mark.parametrize("queue", [0, 1, 4])
def test_a_controller_that_keeps_fewer_frames_is_followed_to_the_target_or_the_arm_is_stopped(ahead, queue):
    arm = simulated(ahead, dialect={"servo_queue": queue})
    call = arm.begin_trajectory(POINT)
    arm.run(0.5)
    arm.held_until = arm.now + 3 * CYCLE
    error = arm.ended(call)
    arm.until(lambda: arm.core.is_free)
    if error is None:
        assert arm.joints == pytest.approx(END, abs=1e-9)
    else:
        assert isinstance(error, MotionInterrupted) and not arm.is_moving
    if queue >= ahead:
        assert error is None
    assert not math.isinf(arm.rest_after(0.0))
