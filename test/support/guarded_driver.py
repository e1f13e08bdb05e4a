"""A driver with its guard, in a process of its own, that a test may kill and freeze, on the simulated controller.

It moves the arm, keeps the guard informed, and reads orders from its standard input, one a line: "health" prints the
guard's health, "begin" begins the motion once more, "leave" ends it in good order.
"""
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

from arm_bench import WAIT, eventually, processes_with

ROOT = Path(__file__).resolve().parents[2]

_BEGIN = """
import dataclasses, json, logging, math, select, sys, time
from jaka_ros_driver.client.guard import Guard
logging.basicConfig()
command_port, status_port, motion = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
guard = Guard("127.0.0.1", command_port, status_port)

def order():
    return sys.stdin.readline().strip() if select.select([sys.stdin], [], [], 0.01)[0] else ""

def show_health():
    print(json.dumps(dataclasses.asdict(guard.health())), flush=True)
"""

PLAIN_DRIVER = _BEGIN + """
from raw_client import RawClient

def is_lost(link):
    link.socket.settimeout(0.001)
    try:
        return not link.socket.recv(4096)
    except OSError as error:
        return not isinstance(error, TimeoutError)

def stop(link):
    link.ask("servo_move", relFlag=0)
    link.ask("stop_program")

def begin(link):
    guard.tell(motion != "idle")
    if motion == "move":
        link.ask("joint_move", relFlag=0, jointPosition=[170, 90, -90, 90, 90, 0], speed=11.0, accel=200.0)
    elif motion == "jog":
        link.ask("jog", jog_mode=1, coord_map=1, jnum=0, jogvel=11.0)
    elif motion == "servo":
        link.ask("servo_move", relFlag=1)

link = RawClient(command_port)
begin(link)
print("under way", flush=True)
what = ""
while what != "leave":
    guard.beat(time.monotonic())
    what = order()
    if what == "health":
        show_health()
    if what == "begin":
        begin(link)
    if link is None or is_lost(link):
        try:
            link = RawClient(command_port)
            stop(link)
            guard.tell(False)
        except OSError:
            link = None
if link is not None:
    stop(link)
    guard.tell(False)
guard.close()
"""
"""The least that a driver does: it stops the arm on each new connection. It needs no more than the guard."""

ARM_DRIVER = _BEGIN + """
from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.kinematics.arm_models import load_model

arm = ArmClient(ClientSettings("127.0.0.1", command_port, status_port), load_model("zu7"), guard)
arm.start()

def begin():
    while not arm.is_ready:
        time.sleep(0.01)
    home = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
    if motion == "move":
        arm.move(c.JointMove((3.0,) + home[1:], 0.2, 4.0), wait=False)
    elif motion == "jog":
        arm.jog(c.Jog(c.JogFrame.JOINT, 0, 0.2))
    elif motion == "servo":
        arm.set_servo_mode(True)

begin()
print("under way", flush=True)
what = ""
while what != "leave":
    what = order()
    if what == "health":
        show_health()
    if what == "begin":
        begin()
arm.close()
guard.close()
"""
"""The driver's own client."""

DRIVER = PLAIN_DRIVER


class GuardedDriver:
    """One such process; ``motion`` is "move", "jog", "servo" or "idle"."""

    def __init__(self, bench, motion):
        self._bench = bench
        controller = bench.controller
        path = os.pathsep.join([str(ROOT / "test" / "support"), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            [sys.executable, "-c", DRIVER, str(controller.command_port), str(controller.status_port), motion],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=str(ROOT),
            env={**os.environ, "PYTHONPATH": path})
        self._said = ""
        assert self.process.stdout.readline() == "under way\n", self.process.communicate()
        if motion != "idle":
            assert eventually(lambda: bench.is_moving() or bench.controller.state()["is_servo_active"])

    def send(self, number):
        self.process.send_signal(number)

    def order(self, what):
        self.process.stdin.write(what + "\n")
        self.process.stdin.flush()

    def health(self):
        """The guard's health as the driver sees it."""
        self.order("health")
        return json.loads(self.process.stdout.readline())

    def guards(self):
        """Process ids of the live guards of this controller."""
        return processes_with("jaka_ros_driver.client.guard", "--port\0%d\0" % self._bench.controller.command_port)

    def watched(self):
        """The process id of its guard, once that has answered."""
        assert eventually(lambda: self.health()["is_alive"])
        pid, = self.guards()
        return pid

    def leave(self):
        """End in good order; what it and its guard have said."""
        self.order("leave")
        return self.end()

    def end(self):
        """What it and its guard have said; it must be over, or is ended."""
        self._said += self.process.communicate(timeout=WAIT)[1]
        return self._said

    def kill(self):
        """End it in disorder; what it and its guard have said, when both are gone."""
        if self.process.poll() is None:
            self.send(signal.SIGCONT)
            self.process.kill()
        if not self.process.stderr.closed:
            self.end()
        return self._said
