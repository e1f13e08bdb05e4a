"""The driver's process dies or freezes in mid-motion; the guard stops the arm. Verdicts from the controller's log."""
import os
import signal
import subprocess
import sys
import time

import pytest
from arm_bench import WAIT, eventually, fill, processes_with

from jaka_ros_driver.client.guard import waits_for_processor

DRIVER = """
import math, sys, threading
from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.guard import Guard
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.kinematics.arm_models import load_model

command_port, status_port, motion = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
guard = Guard("127.0.0.1", command_port)
arm = ArmClient(ClientSettings("127.0.0.1", command_port, status_port), load_model("zu7"), guard.tell)
arm.start()
while not arm.is_ready:
    threading.Event().wait(0.01)
home = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
if motion == "move":
    arm.move(c.JointMove((3.0,) + home[1:], 0.2, 4.0), wait=False)
elif motion == "jog":
    arm.jog(c.Jog(c.JogFrame.JOINT, 0, 0.2))
elif motion == "servo":
    arm.set_servo_mode(True)
print("under way", flush=True)
sys.stdin.readline()
arm.close()
guard.close()
"""


@pytest.fixture
def driver(bench, root):
    one = bench()
    started = []

    def start(motion):
        process = subprocess.Popen(
            [sys.executable, "-c", DRIVER, str(one.controller.command_port), str(one.controller.status_port), motion],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=str(root))
        started.append(process)
        assert process.stdout.readline() == "under way\n", process.communicate()
        if motion != "idle":
            assert eventually(lambda: one.is_moving() or one.controller.state()["is_servo_active"])
        return one, process

    yield start
    for process in started:
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.kill()
        process.communicate(timeout=WAIT)


def guards_of(one):
    """Process ids of the live guards of this controller."""
    return processes_with("jaka_ros_driver.client.guard", "--port\0%d\0" % one.controller.command_port)


@pytest.mark.parametrize("motion", ["move", "jog", "servo"])
@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGSTOP])
def test_the_arm_is_stopped_when_the_driver_dies_or_freezes(driver, motion, death):
    one, process = driver(motion)
    died_at = time.monotonic()
    process.send_signal(death)
    assert eventually(lambda: not one.is_moving() and not one.controller.state()["is_servo_active"])
    if death == signal.SIGKILL:
        assert eventually(lambda: not guards_of(one)), "the guard outlives the driver"
    time.sleep(0.3)  # leaving servo mode is the first of the guard's two words
    stop = one.times_of("stop_program")[0]
    assert stop - died_at < 1.0
    left = [at for at, request in one.received() if request["cmdName"] == "servo_move" and request["relFlag"] == 0]
    assert left and left[0] <= stop


def test_the_arm_is_stopped_though_nobody_reads_what_the_guard_says(driver):
    one, process = driver("jog")
    fill(process.stderr)
    process.send_signal(signal.SIGSTOP)
    assert eventually(lambda: not one.is_moving())
    assert one.times_of("stop_program")
    process.send_signal(signal.SIGKILL)
    assert eventually(lambda: not guards_of(one)), "a guard that is not heard outlives its driver"


def test_a_driver_that_dies_idle_is_none_of_the_guards_business(driver):
    one, process = driver("idle")
    assert len(guards_of(one)) == 1
    process.kill()
    assert eventually(lambda: not guards_of(one))
    assert one.times_of("stop_program") == []


def test_a_driver_that_leaves_in_good_order_takes_its_guard_along(driver):
    one, process = driver("jog")
    process.stdin.write("\n")
    process.stdin.flush()
    _, errors = process.communicate(timeout=WAIT)
    assert process.returncode == 0 and "guard" not in errors
    assert not guards_of(one)
    assert len(one.times_of("stop_program")) == 1


def test_an_arm_that_could_not_be_stopped_at_shutdown_is_stopped_by_the_guard(driver):
    one, process = driver("jog")
    one.panel("refuse", port="command", duration_ms=2000)
    one.panel("close", port="command")
    process.stdin.write("\n")
    process.stdin.flush()
    assert eventually(lambda: not one.is_moving())
    assert eventually(lambda: not guards_of(one))
    assert one.times_of("stop_program")


def test_a_guard_that_dies_is_replaced(driver):
    one, process = driver("jog")
    pid, = guards_of(one)
    os.kill(pid, signal.SIGKILL)
    assert eventually(lambda: set(guards_of(one)) - {pid})
    process.kill()
    assert eventually(lambda: not one.is_moving())
    assert one.times_of("stop_program")


def test_a_guard_that_never_hears_a_word_of_its_driver_stops_what_the_driver_moved(driver):
    one, process = driver("jog")
    pid, = guards_of(one)
    process.send_signal(signal.SIGSTOP)
    os.kill(pid, signal.SIGKILL)
    successor = [sys.executable, "-m", "jaka_ros_driver.client.guard", "--host", "127.0.0.1",
                 "--port", str(one.controller.command_port), "--moving"]
    assert one.is_moving()
    subprocess.run(successor, stdin=subprocess.DEVNULL, check=True, timeout=WAIT)
    assert eventually(lambda: not one.is_moving())


def test_a_frozen_driver_that_thaws_does_not_resume(driver):
    one, process = driver("jog")
    process.send_signal(signal.SIGSTOP)
    assert eventually(lambda: not one.is_moving())
    process.send_signal(signal.SIGCONT)
    time.sleep(1.0)
    assert not one.is_moving()
    assert [request["jog_mode"] for _, request in one.received() if request["cmdName"] == "jog"].count(1) == 1


def test_a_starved_process_is_told_from_a_stopped_and_a_sleeping_one():
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    asleep = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    try:
        assert eventually(lambda: waits_for_processor(busy.pid))
        assert eventually(lambda: not waits_for_processor(asleep.pid))
        busy.send_signal(signal.SIGSTOP)
        assert eventually(lambda: not waits_for_processor(busy.pid))
    finally:
        for process in (busy, asleep):
            process.kill()
            process.wait()
    assert not waits_for_processor(busy.pid)
