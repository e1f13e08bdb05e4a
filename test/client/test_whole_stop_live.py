"""Stops on a controller where ``stop_program`` ends no jog, and each axis has its own end; with real processes."""
import os
import signal
import time

import pytest
from guarded_driver import GuardedDriver
from raw_client import RawClient
from waiting import eventually

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.jog import JogMotion as JogMotion
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.custody_file import CustodyFile
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import Jog, JogFrame
from jaka_ros_driver.errors import StopNotSeen
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec
from jaka_ros_driver.simulation.controller.command_table import COMMANDS


@pytest.fixture(autouse=True)
def stubborn(monkeypatch):
    """Give the simulated controller of this process such jogs; it keeps on when its client is lost, too."""
    real_stop, real_jog = COMMANDS["stop_program"], COMMANDS["jog"]
    jogged = []

    def stop(state, arguments):
        if not state.plant.queue.is_jogging:
            real_stop.handler(state, arguments)

    def jog(state, arguments):
        if arguments.integer("jog_mode") != 0:
            jogged[:] = [arguments.integer("jnum")]
        elif jogged != [arguments.integer("jnum")]:
            return
        real_jog.handler(state, arguments)
    for name, handler in (("stop_program", stop), ("jog", jog),
                          ("set_network_exception_handle", lambda state, arguments: None)):
        monkeypatch.setitem(COMMANDS, name, CommandSpec(name, COMMANDS[name].section, handler))


@pytest.fixture
def jogging(bench):
    """Start a driver with its guard that jogs joint 1."""
    one = bench()
    process = GuardedDriver(one, "jog")
    yield one, process
    process.kill()


@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGSTOP])
def test_the_guard_ends_a_jog_that_a_program_stop_does_not_end(jogging, death):
    one, process = jogging
    process.send(death)
    assert eventually(lambda: not one.is_moving(), 5.0), "the arm jogs on"
    assert death is signal.SIGSTOP or eventually(lambda: not process.guards())  # a frozen driver keeps its guard
    assert "the arm is at rest" in process.kill()
    assert CustodyFile("127.0.0.1", one.controller.command_port).read() is None


def test_a_driver_that_starts_stops_first_what_a_dead_one_left_moving(jogging):
    # Driver and guard are killed at once, as where memory runs out; the new driver's first request is the stop.
    one, process = jogging
    file = CustodyFile("127.0.0.1", one.controller.command_port)
    assert eventually(file.read)
    guard = process.watched()
    process.send(signal.SIGSTOP)
    os.kill(guard, signal.SIGKILL)
    process.send(signal.SIGKILL)
    process.process.wait()
    assert not file.read().is_alive
    assert one.is_moving(), "the arm jogs on, and nobody moves it any more"
    arm = ArmClient(ClientSettings("127.0.0.1", one.controller.command_port, one.controller.status_port),
                    load_model("zu7"), custody_file=file)
    one.arm = arm
    started_at = time.monotonic()
    arm.start()
    assert "left moving" in arm.foreign_motion and arm.motion_owner is MotionOwner.LEFT
    assert eventually(lambda: not one.is_moving())
    assert eventually(lambda: not arm.foreign_motion and file.read() is None)
    words = [request for at, request in one.received() if at >= started_at]
    assert [request["cmdName"] for request in words[:4]] == [
        "servo_move", "stop_program", "jog", "get_simulator_identity"]
    assert (words[2]["coord_map"], words[2]["jnum"]) == (1, 0), "the axis is that of the file"


def test_a_driver_whose_core_fails_ends_its_jog(bench, monkeypatch, tmp_path):
    def fail(*_):
        raise ZeroDivisionError("planted")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    one = bench()
    arm = one.connect()
    arm.jog(Jog(JogFrame.JOINT, 3, 0.2))
    assert eventually(one.is_moving)
    monkeypatch.setattr(JogMotion, "observe", fail)
    assert eventually(lambda: arm.has_failed and not one.is_moving())


@pytest.mark.parametrize("coord_map, axis", [(1, 0), (1, 5), (0, 2)])
def test_stop_move_of_a_driver_that_does_not_move_the_arm_ends_the_jog_of_another_client(bench, coord_map, axis):
    one = bench()
    with RawClient(one.controller.command_port) as client:
        client.ask("jog", jog_mode=1, coord_map=coord_map, jnum=axis, jogvel=10.0)
        assert eventually(one.is_moving)
        arm = one.connect()
        assert one.is_moving()
        arm.stop()
        assert not one.is_moving()


def test_stop_move_tells_the_truth_of_an_arm_that_no_stop_ends(bench, monkeypatch):
    one = bench()
    with RawClient(one.controller.command_port) as client:
        client.ask("jog", jog_mode=1, coord_map=1, jnum=0, jogvel=10.0)
        assert eventually(one.is_moving)
        monkeypatch.setitem(COMMANDS, "jog", CommandSpec("jog", "5.5", lambda state, arguments: None))
        arm = one.connect()
        with pytest.raises(StopNotSeen, match="not by this driver"):
            arm.stop()
