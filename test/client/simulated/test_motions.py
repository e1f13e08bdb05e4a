"""Moves, jog, servo mode and stop against the simulated controller, in virtual time."""
import contextlib
import math
from dataclasses import replace

import pytest
from simulated_arm import Call, SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.arm_core import exclusive_use
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, StopCause
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.simulation.controller.state import Start

MODEL = load_model("zu7")
JOG = c.Jog(c.JogFrame.JOINT, 0, 0.3)
CYCLE = 0.008


def simulated(**settings):
    return SimulatedArm(MODEL, HOME, **settings)


def joint_move(first=0.3, speed=1.0, acceleration=4.0):
    return c.JointMove((first,) + HOME[1:], speed, acceleration)


def line(arm, x=0.0, y=0.0, z=0.0, speed=0.2):
    state = arm.core.fresh_state(arm.now)
    position = tuple(p + d for p, d in zip(state.tcp_position, (x, y, z)))
    return c.LinearMove(c.Pose(position, state.tcp_rpy), speed, 1.0)


def moved(arm, command):
    return arm.ended(arm.begin("move", command, True))


def execute(arm, command):
    return arm.ended(arm.begin("run", arm.core.ask(command), exclusive=exclusive_use(command)))


def in_servo_mode(arm, active=True):
    return arm.ended(arm.begin("servo_mode", active))


def is_refused(error, words):
    return isinstance(error, InvalidCommand) and words in str(error)


def stream(arm, to, joint=0, step=0.004):
    """Send targets from where the stream holds the arm, as a client does."""
    position = list(arm.core.fresh_state(arm.now).joint_position)
    while position[joint] != to:
        away = to - position[joint]
        position[joint] = to if abs(away) <= step else position[joint] + math.copysign(step, away)
        arm.target(c.ServoJoint(tuple(position)))
        arm.run(CYCLE)


def names(arm):
    return {request["cmdName"] for _, request in arm.sent}


def test_a_line_is_completed_when_the_tool_is_there():
    arm = simulated()
    command = line(arm, x=-0.05, y=0.08)
    assert moved(arm, command) is None
    assert arm.core.fresh_state(arm.now).tcp_position == pytest.approx(command.target.position, abs=1e-5)


def test_a_move_to_where_the_arm_is_and_a_tiny_one_are_completed():
    arm = simulated()
    assert moved(arm, joint_move(0.0)) is None
    assert moved(arm, joint_move(1e-5)) is None


@pytest.mark.parametrize("make", [
    lambda arm: joint_move(0.002, limits.SLOWEST, limits.WEAKEST),
    lambda arm: replace(line(arm, y=0.002, speed=limits.SLOWEST), acceleration=limits.WEAKEST)])
def test_the_slowest_move_that_is_taken_is_seen_to_begin_and_to_end_and_its_stop_too(make):
    arm = simulated()
    assert moved(arm, make(arm)) is None
    assert moved(arm, joint_move(0.0)) is None
    end, since = Call(), arm.now
    assert arm.ended(arm.begin("move", make(arm), False, end=end)) is None
    arm.until(lambda: end.is_over and arm.core.custody.stillness.has_moved_since(since))
    assert arm.ended(arm.begin("stop")) is None
    arm.until(lambda: arm.core.is_free, 1.0)


def test_without_waiting_moves_queue_and_the_last_ends_them():
    arm = simulated()
    for first in (0.2, 0.4, 0.1):
        assert arm.ended(arm.begin("move", joint_move(first), False)) is None
    assert arm.core.motion_owner is MotionOwner.MOVE
    highest = [0.0]

    def is_over():
        highest[0] = max(highest[0], arm.joints[0])
        return arm.core.is_free
    arm.until(is_over)
    assert arm.core.motion_owner is None
    assert arm.joints[0] == pytest.approx(0.1, abs=1e-9)
    # No sample need lie at the turning point: braking at 4 rad/s2, the arm is within 3.2e-5 rad of it for a cycle.
    assert 0.4 - 4e-5 < highest[0] < 0.4001


@pytest.mark.parametrize("command, words", [
    (c.JointMove((7.0,) + HOME[1:], 1.0, 1.0), "joint"),
    (c.JointMove(HOME[:5], 1.0, 1.0), "6"),
    (c.JointMove((float("nan"),) + HOME[1:], 1.0, 1.0), "finite"),
    (c.JointMove(HOME, 0.0, 1.0), "speed"),
    (c.JointMove(HOME, 1.0, -1.0), "acceleration"),
    (c.JointMove(HOME, 50.0, 1.0), "speed")])
def test_what_breaks_a_limit_is_refused_and_nothing_is_sent(command, words):
    arm = simulated()
    assert is_refused(moved(arm, command), words)
    arm.run(1.0)
    assert arm.times_of("joint_move") == []


def test_the_controllers_refusal_is_told_and_the_motion_is_free_again():
    arm = simulated()
    error = moved(arm, line(arm, x=5.0))
    assert isinstance(error, CommandRejected) and "moveL" in str(error)
    assert moved(arm, joint_move(0.05)) is None


@pytest.mark.parametrize("start, words", [(Start.OFF, "no power"), (Start.POWERED, "not enabled")])
def test_an_arm_that_is_not_enabled_is_not_moved(start, words):
    arm = simulated(start=start)
    for act in (("move", joint_move(), True), ("jog", JOG), ("servo_mode", True)):
        assert is_refused(arm.ended(arm.begin(*act)), words)
    assert not names(arm) & {"joint_move", "jog", "servo_move", "power_on", "enable_robot"}


@pytest.mark.parametrize("fault, cause", [
    (lambda state: state.press_emergency_stop(), StopCause.EMERGENCY_STOP),
    (lambda state: state.hit(150.0), StopCause.PROTECTIVE_STOP)])
def test_a_move_ends_with_the_name_of_what_stopped_the_arm(fault, cause):
    arm = simulated()
    assert execute(arm, c.SetCollisionLevel(1)) is None
    move = arm.begin("move", joint_move(3.0, speed=0.2), True)
    arm.until(lambda: arm.is_moving)
    fault(arm.controller.state)
    assert arm.ended(move, 0.1).cause is cause
    arm.run(1.0)
    assert is_refused(moved(arm, joint_move(0.0)), cause.value)
    assert names(arm).isdisjoint({"power_on", "enable_robot", "clear_error"})


def test_a_jog_goes_on_as_long_as_it_is_called_and_ends_three_seconds_after():
    arm = simulated()
    for _ in range(5):
        last = arm.now
        assert arm.ended(arm.begin("jog", JOG)) is None
        arm.run(0.2)
    assert is_refused(moved(arm, joint_move()), "a jog owns")
    arm.until(lambda: arm.core.is_free)
    assert [request["jog_mode"] for _, request in arm.sent if request["cmdName"] == "jog"] == [1, 0]
    assert arm.times_of("stop_program") == [last + 3.0]


def test_another_jog_replaces_the_running_one():
    arm = simulated(jog_timeout=1.0)
    assert arm.ended(arm.begin("jog", JOG)) is None
    arm.until(lambda: arm.joints[0] > 0.05)
    assert arm.ended(arm.begin("jog", c.Jog(c.JogFrame.JOINT, 0, -0.3))) is None
    arm.until(lambda: arm.joints[0] < 0.0)
    arm.until(lambda: arm.core.is_free)
    assert [(request["jog_mode"], request.get("jogvel", 0) > 0) for _, request in arm.sent
            if request["cmdName"] == "jog"] == [(1, True), (0, False), (1, False), (0, False)]


def test_servo_targets_are_followed_every_cycle_and_held_between_them():
    arm = simulated()
    assert in_servo_mode(arm) is None
    assert arm.core.links.is_servo_active and arm.core.motion_owner is MotionOwner.SERVO
    for step in range(1, 101):
        arm.target(c.ServoJoint((0.001 * step,) + HOME[1:]))
        arm.run(CYCLE)
    arm.run(0.3)
    assert arm.joints[0] == pytest.approx(0.1, abs=1e-9)
    assert is_refused(moved(arm, joint_move()), "servo mode owns")
    assert in_servo_mode(arm, False) is None
    assert not arm.core.links.is_servo_active and arm.core.motion_owner is None
    frames = [at for at, _ in arm.frames]
    gaps = [b - a for a, b in zip(frames, frames[1:])]
    assert len(gaps) > 130 and gaps == pytest.approx([CYCLE] * len(gaps), abs=1e-9)


def test_pose_targets_are_followed():
    arm = simulated()
    arm.run(0.4)  # until the controller, asked twice, has said that it rests
    start = arm.core.fresh_state(arm.now)
    assert in_servo_mode(arm) is None
    goal = (start.tcp_position[0] - 0.02,) + start.tcp_position[1:]
    for part in (0.25, 0.5, 0.75, 1.0):
        between = tuple(s + part * (g - s) for s, g in zip(start.tcp_position, goal))
        arm.target(c.ServoPose(c.Pose(between, start.tcp_rpy)))
        arm.run(0.02)
    arm.until(lambda: abs(arm.core.fresh_state(arm.now).tcp_position[0] - goal[0]) < 1e-4, 1.0)

    def takes_joints():
        with contextlib.suppress(InvalidCommand):  # at rest only
            arm.target(c.ServoJoint(arm.core.fresh_state(arm.now).joint_position))
            return True
    arm.until(takes_joints, 1.0)
    assert in_servo_mode(arm, False) is None
    assert arm.times_of("servo_p")


def test_frames_are_not_changed_under_a_servo_stream():
    arm = simulated()
    assert in_servo_mode(arm) is None
    assert is_refused(execute(arm, c.SelectTool(1)), "servo mode owns")
    assert arm.times_of("set_tool_id") == []


def test_joint_and_pose_targets_change_over_at_rest_only():
    arm = simulated()
    start = arm.core.fresh_state(arm.now)
    assert in_servo_mode(arm) is None
    stream(arm, 0.05)
    with pytest.raises(InvalidCommand, match="at rest only"):
        arm.target(c.ServoPose(c.Pose(start.tcp_position, start.tcp_rpy)))


def test_a_servo_target_too_far_away_moves_nothing():
    arm = simulated()
    with pytest.raises(InvalidCommand, match="not in servo mode"):
        arm.target(c.ServoJoint(HOME))
    assert in_servo_mode(arm) is None
    with pytest.raises(InvalidCommand, match="0.5000 rad"):
        arm.target(c.ServoJoint((0.5,) + HOME[1:]))
    arm.run(0.5)
    assert in_servo_mode(arm, False) is None
    assert max(abs(joints[0]) for _, joints in arm.frames) < 1e-6 and abs(arm.joints[0]) < 1e-6


def test_a_silent_caller_leaves_servo_mode_and_the_arm_held():
    arm = simulated(servo_timeout=1.5)
    assert in_servo_mode(arm) is None
    stream(arm, 0.05)
    last = arm.now - CYCLE
    arm.until(lambda: arm.core.is_free)
    assert not arm.controller.state.plant.is_servo_active
    left, = [at for at, request in arm.sent if request["cmdName"] == "servo_move" and not request["relFlag"]]
    assert last + 1.5 - 1e-9 <= left < last + 1.5 + 2.0 * CYCLE
    with pytest.raises(InvalidCommand, match="not in servo mode"):
        arm.target(c.ServoJoint(HOME))
    assert arm.joints[0] == pytest.approx(0.05, abs=1e-6)


def test_stop_ends_a_servo_stream():
    arm = simulated()
    assert in_servo_mode(arm) is None
    stream(arm, 0.1)
    called = arm.now
    assert arm.ended(arm.begin("stop")) is None
    arm.until(lambda: arm.core.is_free and not arm.core.links.is_servo_active)
    assert arm.times_of("stop_program") == [called]
    assert arm.frames[-1][0] <= called


def test_an_emergency_stop_ends_servo_mode_and_nothing_comes_back_by_itself():
    arm = simulated()
    assert in_servo_mode(arm) is None
    arm.controller.state.press_emergency_stop()
    arm.until(lambda: arm.core.is_free)
    arm.controller.state.release_emergency_stop()
    arm.run(10.0)
    with pytest.raises(InvalidCommand):
        arm.target(c.ServoJoint(HOME))
    entered = [request for _, request in arm.sent if request["cmdName"] == "servo_move" and request["relFlag"]]
    assert len(entered) == 1
    assert names(arm).isdisjoint({"power_on", "enable_robot"})


def test_hand_guiding_excludes_motion():
    arm = simulated()
    assert execute(arm, c.SetHandGuiding(True)) is None
    arm.until(lambda: arm.core.fresh_state(arm.now).is_hand_guided)
    assert is_refused(moved(arm, joint_move()), "hand guiding owns")


def test_a_move_that_takes_too_long_is_stopped():
    arm = simulated(motion_timeout=0.5)
    called = arm.now
    assert moved(arm, joint_move(3.0, speed=0.2)).cause is StopCause.TIMEOUT
    arm.until(lambda: not arm.is_moving, 0.1)
    assert arm.times_of("stop_program") == pytest.approx([called + 0.5], abs=1e-9)
