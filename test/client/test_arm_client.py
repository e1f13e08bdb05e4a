"""Moves, jog, servo mode and stop, on real sockets against the simulated controller."""
import contextlib
import math
import time
from dataclasses import replace

import pytest
from arm_bench import LOOSE
from waiting import eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics import limits

HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))


def joint_move(first=0.3, speed=1.0, acceleration=4.0):
    return c.JointMove((first,) + HOME[1:], speed, acceleration)


def line(arm, x=0.0, y=0.0, z=0.0, speed=0.2):
    state = arm.fresh_state()
    position = tuple(p + d for p, d in zip(state.tcp_position, (x, y, z)))
    return c.LinearMove(c.Pose(position, state.tcp_rpy), speed, 1.0)


def stream(arm, to, joint=0, step=0.004):
    """Send targets from where the stream holds the arm, as a client does."""
    position = list(arm.fresh_state().joint_position)
    while position[joint] != to:
        away = to - position[joint]
        position[joint] = to if abs(away) <= step else position[joint] + math.copysign(step, away)
        arm.servo_target(c.ServoJoint(tuple(position)))
        time.sleep(0.008)  # the rate of a stream


JOG = c.Jog(c.JogFrame.JOINT, 0, 0.3)


def test_a_joint_move_returns_when_the_arm_is_there(bench):
    one = bench()
    arm = one.connect()
    arm.move(joint_move(0.3))
    assert arm.fresh_state().joint_position[0] == pytest.approx(0.3, abs=1e-4)
    assert arm.motion_owner is None
    assert one.joints()[-1][1][0] == pytest.approx(0.3, abs=1e-9)


def test_a_line_returns_when_the_tool_is_there(bench):
    arm = bench(time_scale=4.0).connect()
    command = line(arm, x=-0.05, y=0.08)
    arm.move(command)
    assert arm.fresh_state().tcp_position == pytest.approx(command.target.position, abs=1e-5)


def test_a_move_to_where_the_arm_is_and_a_tiny_one_return(bench):
    arm = bench().connect()
    arm.move(joint_move(0.0))
    arm.move(joint_move(1e-5))


@pytest.mark.parametrize("make", [
    lambda arm: joint_move(0.002, limits.SLOWEST, limits.WEAKEST),
    lambda arm: replace(line(arm, y=0.002, speed=limits.SLOWEST), acceleration=limits.WEAKEST)])
def test_the_slowest_move_that_is_taken_is_seen_to_begin_and_to_end_and_its_stop_too(bench, make):
    arm = bench().connect()
    arm.move(make(arm))
    arm.move(joint_move(0.0))
    moving, since = arm.queue(make(arm)), time.monotonic()
    assert eventually(lambda: moving.done() and arm.has_moved_since(since))
    arm.stop()
    assert eventually(lambda: arm.motion_owner is None)


def test_without_waiting_moves_queue_and_the_last_ends_them(bench):
    one = bench()
    arm = one.connect()
    for first in (0.2, 0.4, 0.1):
        arm.move(joint_move(first), wait=False)
    assert arm.motion_owner is MotionOwner.MOVE
    assert eventually(lambda: arm.motion_owner is None)
    assert arm.fresh_state().joint_position[0] == pytest.approx(0.1, abs=1e-4)
    # No sample need lie at the turning point: braking at 4 rad/s2, the arm is within 0.05 rad of it for 0.3 s.
    assert 0.35 < max(joints[0] for _, joints in one.joints()) < 0.4001


@pytest.mark.parametrize("command, words", [
    (c.JointMove((7.0,) + HOME[1:], 1.0, 1.0), "joint"),
    (c.JointMove(HOME[:5], 1.0, 1.0), "6"),
    (c.JointMove((float("nan"),) + HOME[1:], 1.0, 1.0), "finite"),
    (c.JointMove(HOME, 0.0, 1.0), "speed"),
    (c.JointMove(HOME, 1.0, -1.0), "acceleration"),
    (c.JointMove(HOME, 50.0, 1.0), "speed")])
def test_what_breaks_a_limit_is_refused_and_nothing_is_sent(bench, command, words):
    one = bench()
    arm = one.connect()
    with pytest.raises(InvalidCommand, match=words):
        arm.move(command)
    assert one.times_of("joint_move") == []


def test_the_controllers_refusal_is_told_and_the_motion_is_free_again(bench):
    arm = bench().connect()
    with pytest.raises(CommandRejected, match="moveL"):
        arm.move(line(arm, x=5.0))
    arm.move(joint_move(0.05))


@pytest.mark.parametrize("start, words", [("off", "no power"), ("powered", "not enabled")])
def test_an_arm_that_is_not_enabled_is_not_moved(bench, start, words):
    one = bench(start=start)
    arm = one.connect()
    for act in (lambda: arm.move(joint_move()), lambda: arm.jog(JOG), lambda: arm.set_servo_mode(True)):
        with pytest.raises(InvalidCommand, match=words):
            act()
    names = {request["cmdName"] for _, request in one.received()}
    assert not names & {"joint_move", "jog", "servo_move", "power_on", "enable_robot"}


def test_stop_is_served_while_a_move_blocks_even_when_every_reply_is_late(bench, call):
    one = bench()
    arm = one.connect()
    one.panel("fault", kind="delay", port="command", count=None, delay_ms=50)
    move = call(arm.move, joint_move(3.0, speed=0.2))
    assert eventually(one.is_moving)
    called = time.monotonic()
    arm.stop()
    assert isinstance(move.failure(), MotionInterrupted) and move.error.cause is StopCause.STOPPED
    assert eventually(lambda: arm.motion_owner is None)
    stop, = one.times_of("stop_program")
    assert stop - called < LOOSE
    assert one.rest_after(called) - stop < LOOSE
    assert one.joints()[-1][1][0] < 1.0


def test_a_stop_that_cannot_be_delivered_fails(bench):
    one = bench()
    arm = one.connect()
    one.controller.close()
    with pytest.raises(ConnectionLost):
        arm.stop()


@pytest.mark.parametrize("fault, cause", [("press_emergency_stop", StopCause.EMERGENCY_STOP),
                                          ("hit", StopCause.PROTECTIVE_STOP)])
def test_a_move_ends_with_the_name_of_what_stopped_the_arm(bench, call, fault, cause):
    one = bench()
    arm = one.connect()
    arm.execute(c.SetCollisionLevel(1))
    move = call(arm.move, joint_move(3.0, speed=0.2))
    assert eventually(one.is_moving)
    one.panel(fault)
    assert move.failure().cause is cause
    with pytest.raises(InvalidCommand, match=cause.value):
        arm.move(joint_move(0.0))
    assert {request["cmdName"] for _, request in one.received()}.isdisjoint({"power_on", "enable_robot", "clear_error"})


def test_a_jog_goes_on_as_long_as_it_is_called_and_ends_three_seconds_after(bench):
    one = bench()
    arm = one.connect()
    for _ in range(5):
        last = time.monotonic()
        arm.jog(JOG)
        time.sleep(0.2)  # a caller that says it again
    with pytest.raises(InvalidCommand, match="a jog owns"):
        arm.move(joint_move())
    assert eventually(lambda: arm.motion_owner is None)
    jogs = [request["jog_mode"] for _, request in one.received() if request["cmdName"] == "jog"]
    assert jogs == [1, 0]
    stop, = one.times_of("stop_program")
    assert 2.999 <= stop - last < 3.0 + LOOSE


def test_another_jog_replaces_the_running_one(bench):
    one = bench()
    arm = one.connect(jog_timeout=1.0)
    arm.jog(JOG)
    assert eventually(lambda: one.controller.state()["joint_position"][0] > 3.0)
    arm.jog(c.Jog(c.JogFrame.JOINT, 0, -0.3))
    assert eventually(lambda: one.controller.state()["joint_position"][0] < 0.0)
    assert eventually(lambda: arm.motion_owner is None)
    jogs = [(request["jog_mode"], request.get("jogvel", 0) > 0) for _, request in one.received()
            if request["cmdName"] == "jog"]
    assert jogs == [(1, True), (0, False), (1, False), (0, False)]


def test_servo_targets_are_followed_every_cycle_and_held_between_them(bench):
    one = bench()
    arm = one.connect()
    arm.set_servo_mode(True)
    assert arm.is_servo_active and arm.motion_owner is MotionOwner.SERVO
    for step in range(1, 101):
        arm.servo_target(c.ServoJoint((0.001 * step,) + HOME[1:]))
        time.sleep(0.008)  # the rate of a stream
    assert eventually(lambda: abs(one.controller.state()["joint_position"][0] - math.degrees(0.1)) < 1e-3)
    with pytest.raises(InvalidCommand, match="servo mode owns"):
        arm.move(joint_move())
    arm.set_servo_mode(False)
    assert not arm.is_servo_active and arm.motion_owner is None
    frames = one.times_of("servo_j")
    gaps = sorted(b - a for a, b in zip(frames, frames[1:]))
    assert 0.004 < gaps[len(gaps) // 2] < 0.04


def test_pose_targets_are_followed(bench):
    one = bench()
    arm = one.connect()
    start = arm.fresh_state()
    arm.set_servo_mode(True)
    goal = (start.tcp_position[0] - 0.02,) + start.tcp_position[1:]
    for part in (0.25, 0.5, 0.75, 1.0):
        between = tuple(s + part * (g - s) for s, g in zip(start.tcp_position, goal))
        arm.servo_target(c.ServoPose(c.Pose(between, start.tcp_rpy)))
        time.sleep(0.02)  # the rate of a stream
    assert eventually(lambda: abs(arm.fresh_state().tcp_position[0] - goal[0]) < 1e-4)

    def takes_joints():
        with contextlib.suppress(InvalidCommand):  # at rest only
            arm.servo_target(c.ServoJoint(arm.fresh_state().joint_position))
            return True
    assert eventually(takes_joints)
    arm.set_servo_mode(False)
    assert one.times_of("servo_p")


def test_frames_are_not_changed_under_a_servo_stream(bench):
    one = bench()
    arm = one.connect()
    arm.set_servo_mode(True)
    with pytest.raises(InvalidCommand, match="servo mode owns"):
        arm.execute(c.SelectTool(1))
    assert one.times_of("set_tool_id") == []


def test_joint_and_pose_targets_change_over_at_rest_only(bench):
    one = bench()
    arm = one.connect()
    start = arm.fresh_state()
    arm.set_servo_mode(True)
    stream(arm, 0.05)
    with pytest.raises(InvalidCommand, match="at rest only"):
        arm.servo_target(c.ServoPose(c.Pose(start.tcp_position, start.tcp_rpy)))


def test_a_servo_target_too_far_away_moves_nothing(bench):
    one = bench()
    arm = one.connect()
    with pytest.raises(InvalidCommand, match="not in servo mode"):
        arm.servo_target(c.ServoJoint(HOME))
    arm.set_servo_mode(True)
    with pytest.raises(InvalidCommand, match="0.5000 rad"):
        arm.servo_target(c.ServoJoint((0.5,) + HOME[1:]))
    arm.set_servo_mode(False)
    assert max(abs(joints[0]) for _, joints in one.joints()) < 1e-6


def test_a_silent_caller_leaves_servo_mode_and_the_arm_held(bench):
    one = bench()
    arm = one.connect(servo_timeout=1.5)
    arm.set_servo_mode(True)
    stream(arm, 0.05)
    assert eventually(lambda: arm.motion_owner is None)
    assert not one.controller.state()["is_servo_active"]
    with pytest.raises(InvalidCommand, match="not in servo mode"):
        arm.servo_target(c.ServoJoint(HOME))
    assert one.joints()[-1][1][0] == pytest.approx(0.05, abs=1e-6)


def test_stop_ends_a_servo_stream(bench):
    one = bench()
    arm = one.connect()
    arm.set_servo_mode(True)
    stream(arm, 0.1)
    arm.stop()
    assert eventually(lambda: arm.motion_owner is None)
    assert eventually(lambda: not arm.is_servo_active)
    stop, = one.times_of("stop_program")
    assert max(one.times_of("servo_j")) <= stop


def test_an_emergency_stop_ends_servo_mode_and_nothing_comes_back_by_itself(bench):
    one = bench()
    arm = one.connect()
    arm.set_servo_mode(True)
    one.panel("press_emergency_stop")
    assert eventually(lambda: arm.motion_owner is None)
    one.panel("release_emergency_stop")
    with pytest.raises(InvalidCommand):
        arm.servo_target(c.ServoJoint(HOME))
    time.sleep(0.5)  # what must not come has no other sign
    entered = [request for _, request in one.received() if request["cmdName"] == "servo_move" and request["relFlag"]]
    assert len(entered) == 1
    assert {request["cmdName"] for _, request in one.received()}.isdisjoint({"power_on", "enable_robot"})


def test_hand_guiding_excludes_motion(bench):
    arm = bench().connect()
    arm.execute(c.SetHandGuiding(True))
    assert eventually(lambda: arm.fresh_state().is_hand_guided)
    with pytest.raises(InvalidCommand, match="hand guiding owns"):
        arm.move(joint_move())


def test_closing_stops_the_arm_and_answers_the_pending_call(bench, call):
    one = bench()
    arm = one.connect()
    move = call(arm.move, joint_move(3.0, speed=0.2))
    assert eventually(one.is_moving)
    called = time.monotonic()
    arm.close()
    assert time.monotonic() - called < 5.0, "the move itself takes 15 s"
    assert move.failure().cause is StopCause.SHUTDOWN
    assert eventually(lambda: not one.is_moving())
    assert len(one.times_of("stop_program")) == 1


def test_nothing_that_was_asked_for_before_the_shutdown_is_sent_after_it(bench, call):
    one = bench()
    arm = one.connect()
    arm.move(joint_move(3.0, speed=0.2), wait=False)
    assert eventually(one.is_moving)
    stop, move = call(arm.stop), call(arm.move, joint_move(1.0))  # waits until the arm has come to rest
    stop.wait()
    arm.close()
    # which of them depends on how far the call had come
    assert isinstance(move.failure(), (MotionInterrupted, InvalidCommand, ConnectionLost)) and arm.motion_owner is None
    assert len(one.times_of("joint_move")) == 1


def test_a_move_that_takes_too_long_is_stopped(bench, call):
    one = bench()
    arm = one.connect(motion_timeout=0.5)
    move = call(arm.move, joint_move(3.0, speed=0.2))
    assert move.failure().cause is StopCause.TIMEOUT
    assert eventually(lambda: not one.is_moving())
    assert len(one.times_of("stop_program")) == 1
