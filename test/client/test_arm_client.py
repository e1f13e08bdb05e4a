"""Calls of the client on real sockets: when they return, a stop beside them, and the shutdown."""
import socket
import time

import pytest
from arm_bench import LOOSE, PATIENT
from waiting import eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.client import arm_client
from jaka_ros_driver.client.core.procedures.steps import pause
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint, TrajectoryTolerances


def joint_move(first=0.3, speed=1.0, acceleration=4.0):
    return c.JointMove((first,) + HOME[1:], speed, acceleration)


def test_a_joint_move_returns_when_the_arm_is_there(bench):
    one = bench()
    arm = one.connect(**PATIENT)
    arm.move(joint_move(0.3))
    assert arm.fresh_state().joint_position[0] == pytest.approx(0.3, abs=1e-4)
    assert arm.motion_owner is None
    assert one.joints()[-1][1][0] == pytest.approx(0.3, abs=1e-9)


def test_stop_is_served_while_a_move_blocks_even_when_every_reply_is_late(bench, call):
    one = bench()
    arm = one.connect(**PATIENT)
    one.operate("fault", kind="delay", port="command", count=None, delay_ms=50)
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
    arm = one.connect(**PATIENT)
    one.controller.close()
    with pytest.raises(ConnectionLost):
        arm.stop()


def test_closing_stops_the_arm_and_answers_the_pending_call(bench, call):
    one = bench()
    arm = one.connect(**PATIENT)
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
    arm = one.connect(**PATIENT)
    arm.move(joint_move(3.0, speed=0.2), wait=False)
    assert eventually(one.is_moving)
    stop, move = call(arm.stop), call(arm.move, joint_move(1.0))  # waits until the arm has come to rest
    stop.wait()
    arm.close()
    # The error depends on how far the call had come.
    assert isinstance(move.failure(), (MotionInterrupted, InvalidCommand, ConnectionLost)) and arm.motion_owner is None
    assert len(one.times_of("joint_move")) == 1


def test_a_trajectory_is_joined_by_the_next_one_and_that_is_cancelled_beside_the_clients_thread(bench):
    arm = bench().connect(**PATIENT)

    def follow(first, seconds):
        points = (TrajectoryPoint(seconds, (first,) + HOME[1:], (0.0,) * 6),)
        return arm.follow(JointTrajectory(points), TrajectoryTolerances((None,) * 6, (0.01,) * 6, 5.0))

    def is_beyond(first):
        return arm.state.joint_position[0] > first
    first = follow(0.5, 2.0)
    assert eventually(lambda: is_beyond(0.05))
    second = follow(0.9, 6.0)
    with pytest.raises(MotionInterrupted) as caught:
        first.result(20.0)
    assert caught.value.cause is StopCause.REPLACED
    assert eventually(lambda: is_beyond(0.15))
    assert arm.cancel_trajectory(second)
    with pytest.raises(MotionInterrupted) as caught:
        second.result(20.0)
    assert caught.value.cause is StopCause.CANCELLED and not is_beyond(0.85)
    follow(0.3, 2.0).result(20.0)
    assert arm.state.joint_position[0] == pytest.approx(0.3, abs=1e-3) and arm.motion_owner is None


def test_a_call_is_served_when_it_is_due_however_long_the_thread_was_to_wait(monkeypatch):
    # Nothing else wakes the thread: the controller is connected and silent, and no reply is due for long.
    monkeypatch.setattr(arm_client, "_LONGEST_WAIT_S", 300.0)

    def wait(core):
        yield pause(0.01)
        return "done"
    with socket.create_server(("127.0.0.1", 0)) as mute:
        port = mute.getsockname()[1]
        arm = arm_client.ArmClient(ClientSettings("127.0.0.1", port, port, reply_timeout=300.0, silence_timeout=300.0),
                                   load_model("zu7"))
        arm.start()
        try:
            assert eventually(lambda: arm.link_health.status_is_up and arm.link_health.connections)
            assert [arm.begin(wait).result(20.0) for _ in range(3)] == ["done"] * 3
        finally:
            arm.close()
