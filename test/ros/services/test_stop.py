"""The ends of a motion: stop, watchdog, shutdown; nothing keeps a stop out."""
import contextlib
import math
import signal
import socket
import time

import pytest
import rosgraph
import rospy
from driver_bench import HOME, Arm, DriverProcess, SimulatorProcess, evidence_of, on
from std_srvs.srv import Empty
from waiting import InBackground, eventually

AWAY = [2.0] + HOME[1:]
SLOW_LINE = {"pose": [420.0, 300.0, 370.0, 2.2214, -2.2214, 0.0], "mvvelo": 20.0, "mvacc": 100.0}


def begin(arm, service, **fields):
    call = InBackground(arm.call, service, **fields)
    assert eventually(arm.simulator.is_moving)
    return call


@pytest.mark.parametrize("service, fields", [
    ("linear_move", SLOW_LINE), ("joint_move", {"pose": AWAY, "mvvelo": 0.05, "mvacc": 1.0})])
def test_a_blocking_move_is_stopped_at_once_and_its_caller_is_told(arm, service, fields):
    arm.go_home()
    call = begin(arm, service, **fields)
    asked = time.monotonic()
    arm.call("stop_move")
    answer = call.join()
    assert time.monotonic() - asked < 5.0
    assert answer.ret == 0 and "stopped by request" in answer.message
    assert eventually(lambda: not arm.simulator.is_moving())
    assert arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0).ret == 1, "the arm can be moved again"


def test_a_second_move_names_the_owner_and_many_calls_are_served_beside_a_move(arm):
    arm.go_home()
    call = begin(arm, "joint_move", pose=AWAY, mvvelo=0.05, mvacc=1.0)
    refused = arm.call("linear_move", **SLOW_LINE)
    assert refused.ret == 0 and "a move owns the arm's motion" in refused.message
    others = [InBackground(arm.call, "get_io", signal="digital", path=0, type=0, index=0) for _ in range(20)]
    assert all(other.join().value == 0.0 for other in others)
    assert not call.is_over
    arm.call("stop_move")
    assert call.join().ret == 0


def test_an_emergency_stop_ends_the_move_with_its_name(arm):
    arm.go_home()
    call = begin(arm, "joint_move", pose=AWAY, mvvelo=0.05, mvacc=1.0)
    arm.simulator.operate("press_emergency_stop")
    answer = call.join()
    assert answer.ret == 0 and "emergency stop" in answer.message
    standing = arm.call("clear_err")
    assert standing.ret == 0 and "release the emergency stop" in standing.message
    assert "emergency stop" in arm.call("power", data=True).message
    arm.simulator.operate("release_emergency_stop")
    cleared = arm.call("clear_err")
    assert cleared.ret == 1 and "power" in cleared.message and "enable" in cleared.message
    assert not arm.simulator.state()["is_powered"], "nothing energises by itself"
    assert arm.call("power", data=True).success and arm.call("enable", data=True).success


@pytest.mark.parametrize("is_kept_going", [False, True], ids=["once", "kept going"])
def test_the_jog_watchdog_stops_3_s_after_the_last_call(arm, is_kept_going):
    # Judged by the way that the arm has gone meanwhile.
    def jog():
        """Return when a jog call was taken; None where it was refused: the host may have cut the link."""
        asked = time.monotonic()
        return asked if arm.call("jog", mvvelo=0.05, index=0).ret == 1 else None

    arm.go_home()
    first = last = eventually(jog)
    assert first is not None
    if is_kept_going:
        assert eventually(lambda: time.monotonic() > first + 1.5)
        last = jog()
        assert last is not None
    assert eventually(arm.simulator.is_moving)
    assert eventually(lambda: not arm.simulator.is_moving())
    went = math.radians(arm.simulator.state()["joint_position"][0])
    assert went == pytest.approx(0.05 * (last - first + 3.0), abs=0.05 * 0.4)


def test_another_direction_replaces_the_jog(arm):
    arm.go_home()
    assert arm.call("jog", mvvelo=0.1, index=0).ret == 1
    assert eventually(lambda: arm.simulator.state()["joint_velocity"][0] > 1.0)
    assert arm.call("jog", mvvelo=0.1, index=1).ret == 1
    assert eventually(lambda: arm.simulator.state()["joint_velocity"][0] < -1.0)
    arm.call("stop_move")
    assert eventually(lambda: not arm.simulator.is_moving())


def test_a_peer_that_connects_and_says_nothing_keeps_nobody_out(arm):
    uri = rosgraph.Master("/jaka_tests").lookupService(arm.name + "/stop_move")
    host, port = rospy.core.parse_rosrpc_uri(uri)
    silent = [socket.create_connection((host, port)) for _ in range(3)]
    try:
        call = begin(arm, "joint_move", pose=AWAY, mvvelo=0.05, mvacc=1.0)
        newcomer = rospy.ServiceProxy(arm.name + "/stop_move", Empty)
        newcomer()
        assert "stopped by request" in call.join().message
    finally:
        for peer in silent:
            peer.close()


def test_a_stop_that_cannot_be_delivered_is_a_service_error(ros_node, simulator_of_its_own):
    arm = Arm(simulator_of_its_own, "/cut_off_driver")
    with DriverProcess("cut_off_driver", **on(arm.simulator, guard=False)):
        arm.wait_until_seen()
        with evidence_of(arm) as call_publisher:
            arm.simulator.close()
            with pytest.raises(rospy.ServiceException, match="link|connect"):
                eventually(lambda: arm.call("stop_move") and False)
            assert eventually(lambda: call_publisher() and not call_publisher()[-1].success)
    failed = call_publisher()[-1]
    assert failed.service == "/cut_off_driver/stop_move" and failed.error and bytes(failed.response) == b""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_a_move_that_is_under_way_at_shutdown_is_answered_and_the_arm_stopped(ros_node, simulator_of_its_own, how):
    arm = Arm(simulator_of_its_own, "/leaving_driver")
    with DriverProcess("leaving_driver", **on(arm.simulator, guard=False)) as driver:
        arm.wait_until_ready()
        call = begin(arm, "joint_move", pose=AWAY, mvvelo=0.05, mvacc=1.0)
        code, said = driver.end(how)
        answer = call.join()
        assert answer.ret == 0 and "driver shut down" in answer.message
        assert code == 0, said
    assert eventually(lambda: not arm.simulator.is_moving())
    assert math.degrees(0.0) < arm.simulator.state()["joint_position"][0] < math.degrees(1.9)


def test_the_guard_stops_a_jog_whose_driver_is_killed_and_the_next_driver_may_start(ros_node, simulator_of_its_own):
    arm = Arm(simulator_of_its_own, "/killed_driver")
    with DriverProcess("killed_driver", **on(arm.simulator, guard=True)) as driver:
        arm.wait_until_ready()
        assert arm.call("jog", mvvelo=0.05, index=0).ret == 1
        assert eventually(arm.simulator.is_moving)
        driver.end(signal.SIGKILL)
    assert eventually(lambda: not arm.simulator.is_moving())
    with DriverProcess("next_driver", **on(arm.simulator, guard=False)):
        Arm(arm.simulator, "/next_driver").wait_until_ready()


@pytest.fixture
def simulator_of_its_own():
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as process:
        yield process
