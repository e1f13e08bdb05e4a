"""The driver's process ends or freezes in the middle of a motion: the arm stops. Verdicts from the controller's log.

Bounds are loose, for a busy host; test/soak/soak_death.py measures.
"""
import contextlib
import signal
import subprocess
import time

import pytest
import rosgraph
from arm_bench import fill
from driver_bench import HOME, Arm, ArmOfAnotherMaster, LiveDriver, SimulatorProcess, begin
from waiting import WAIT, eventually

IN_TIME = 3.0
"""Time limit, s; on a quiet host it takes a tenth of that."""
LEAVES_SERVO_MODE = {"relFlag": 0}


@pytest.fixture
def live(ros_node, tmp_path):
    with LiveDriver(tmp_path) as running:
        running.arm.wait_until_ready()
        yield running


def assert_stopped_in_time(verdict, since):
    """Assert that a stop came in after that moment, and the arm came to rest with it; return all such moments."""
    stops = verdict.times_of("stop_program", after=since)
    assert stops and stops[0] - since < IN_TIME
    assert verdict.rest_after(since) - stops[0] < IN_TIME
    return stops


def assert_stopped(verdict, since, motion):
    """Assert that a stop came in after that moment, the arm came to rest with it, and nothing was sent after it."""
    stops = assert_stopped_in_time(verdict, since)
    moves = [at for at, request in verdict.received() if at > stops[0] and (
        request["cmdName"] in ("joint_move", "moveL", "servo_j", "servo_p", "power_on", "enable_robot")
        or request["cmdName"] == "jog" and request["jog_mode"] != 0)]
    assert not moves, "motion after the stop"
    if motion == "servo":
        left = verdict.times_of("servo_move", after=since, **LEAVES_SERVO_MODE)
        assert left and left[0] <= stops[0]


@pytest.mark.parametrize("how, motion", [(signal.SIGINT, "jog"), (signal.SIGTERM, "servo")],
                         ids=["SIGINT-jog", "SIGTERM-servo"])
def test_a_driver_that_is_told_to_end_stops_the_arm_first(live, how, motion):
    begin(live, motion)
    since = live.send(how)
    code, said = live.end_driver(how)
    assert code == 0 and "guard" not in said and "Traceback" not in said, said
    assert live.guards() == []
    assert_stopped(live.verdict(), since, motion)


def test_a_driver_whose_launch_file_ends_stops_the_arm_first(ros_node, launched_file, tmp_path):
    log = str(tmp_path / "wire.mcap")
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--log", log)) as simulator:
        live = LiveDriver.__new__(LiveDriver)
        live.simulator, live.log_file, live._drivers, live.motions = simulator, log, [], 0
        live.arm = Arm(simulator)
        arguments = ["sim:=false", "command_port:=%d" % simulator.command_port,
                     "status_port:=%d" % simulator.status_port]
        with launched_file("robot_start_launch.launch", arguments):
            live.arm.wait_until_ready()
            pending = begin(live, "servo")
            since = time.monotonic()
        pending.join()
        assert eventually(lambda: live.guards() == [])
    assert_stopped(live.verdict(), since, "servo")


@pytest.mark.parametrize("motion", ["move", "jog", "servo"])
def test_a_driver_that_is_killed_leaves_the_arm_to_the_guard_and_the_guard_leaves(live, motion):
    begin(live, motion)
    assert len(live.guards()) == 1
    since = live.send(signal.SIGKILL)
    said = live.kill_driver()
    assert eventually(lambda: not live.simulator.is_moving())
    assert eventually(lambda: live.guards() == [])
    assert "guard: the driver has died while the arm moves" in said
    verdict = live.verdict()
    assert_stopped(verdict, since, motion)
    assert len(verdict.times_of("stop_program", after=since)) == 1


def test_a_driver_that_freezes_loses_the_arm_to_the_guard_and_does_not_resume(live):
    frozen = []
    for motion in ("move", "jog", "servo"):
        pending = begin(live, motion)
        frozen.append((motion, live.send(signal.SIGSTOP)))
        assert eventually(lambda: not live.simulator.is_moving() and not live.simulator.state()["is_servo_active"])
        live.send(signal.SIGCONT)
        if pending is not None:
            reply = pending.join()
            assert reply is None or reply.ret == 0, reply
        live.arm.wait_until_seen()
        assert not live.simulator.is_moving()
    verdict = live.verdict()
    for motion, since in frozen:
        stops = verdict.times_of("stop_program", after=since)
        assert stops[0] - since < IN_TIME, motion
    assert len(verdict.times_of("jog", jog_mode=1)) == 1


def test_nobody_reads_what_the_driver_prints_and_everything_works_all_the_same(live):
    fill(live.process.stdout)
    pending = begin(live, "move")
    live.arm.call("stop_move")
    assert pending.join().ret == 0
    pending = begin(live, "move")
    frozen = live.send(signal.SIGSTOP)
    assert eventually(lambda: not live.simulator.is_moving())
    live.send(signal.SIGCONT)
    assert pending.join().ret == 0
    live.arm.wait_until_ready()
    begin(live, "jog")
    ended = live.send(signal.SIGTERM)
    assert live.process.wait(WAIT) == 0
    assert eventually(lambda: live.guards() == [])
    verdict = live.verdict()
    for since in (frozen, ended):
        assert_stopped_in_time(verdict, since)


def test_a_driver_told_to_end_at_any_moment_of_its_start_ends(ros_node, tmp_path):
    with LiveDriver(tmp_path) as live:
        for delay in (0.3, 0.6, 0.9, 1.2, 1.8):
            time.sleep(delay)  # another moment of its start
            live.process.send_signal(signal.SIGTERM)
            live.process.communicate(timeout=WAIT)
            assert eventually(lambda: live.guards() == [])
            live.start()


def test_a_terminal_that_stops_reading_stops_nothing_else(live):
    # Nobody reads the program's output here: after some hundred refusals the pipe is full.
    for _ in range(700):
        assert live.arm.call("joint_move", pose=HOME, mvvelo=-1.0, mvacc=1.0).ret == 0
    pending = begin(live, "move")
    live.simulator.operate("close")
    assert "link" in pending.join().message
    live.arm.wait_until_seen()
    begin(live, "jog")
    live.arm.call("stop_move")
    assert eventually(lambda: not live.simulator.is_moving())
    live.send(signal.SIGTERM)
    assert live.process.wait(WAIT) == 0
    assert live.verdict().times_of("stop_program")


def test_without_a_master_the_arm_can_be_stopped_and_the_driver_ended(ros_node, free_ports, tmp_path):
    port = free_ports(1)[0]
    uri = "http://127.0.0.1:%d" % port
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)],
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        assert eventually(lambda: rosgraph.is_master_online(uri))
        with LiveDriver(tmp_path, environment={"ROS_MASTER_URI": uri}) as live:
            live.arm = arm = ArmOfAnotherMaster(live.simulator, live.arm.name, uri)
            arm.wait_until_reached()
            pending = begin(live, "move")
            master.kill()
            master.wait(WAIT)
            assert eventually(live.simulator.is_moving), "the death of the master is no reason to stop"
            arm.call("stop_move")
            assert "stopped by request" in pending.join().message
            pending = begin(live, "line")
            since = live.send(signal.SIGTERM)
            code, said = live.end_driver(signal.SIGTERM)
            assert code == 0 and "driver shut down" in pending.join().message, said
            assert_stopped(live.verdict(), since, "line")
    finally:
        master.kill()
        master.wait(WAIT)
