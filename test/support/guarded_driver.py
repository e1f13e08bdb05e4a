"""A driver with its guard, in a process of its own, that a test may kill and freeze, on the simulated controller.

It moves the arm, keeps the guard informed, and reads orders from its standard input, one a line: "health" prints the
guard's health, "begin" begins the motion once more, "leave" ends it in good order.
"""
import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

from arm_bench import processes_with
from waiting import WAIT, eventually

ROOT = Path(__file__).resolve().parents[2]

DRIVER = """
import contextlib, dataclasses, json, logging, math, select, sys, time
from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.custody_file import CustodyFile
from jaka_ros_driver.client.guard import Guard
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.kinematics.arm_models import load_model

logging.basicConfig()
command_port, status_port, motion = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
guard = Guard("127.0.0.1", command_port, status_port)
arm = ArmClient(ClientSettings("127.0.0.1", command_port, status_port), load_model("zu7"), guard,
                CustodyFile("127.0.0.1", command_port))
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
for what in map(str.strip, sys.stdin):
    if what == "health":
        print(json.dumps(dataclasses.asdict(guard.health())), flush=True)
    elif what == "begin":
        with contextlib.suppress(JakaError):  # it may be refused: the asker looks whether the arm moves
            begin()
    else:
        break
arm.close()
guard.close()
"""


class GuardedDriver:
    """A driver with its guard in one process; ``motion`` is "move", "jog", "servo" or "idle"."""

    def __init__(self, bench, motion):
        self._bench = bench
        controller = bench.controller
        self.process = subprocess.Popen(
            [sys.executable, "-c", DRIVER, str(controller.command_port), str(controller.status_port), motion],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=str(ROOT))
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
        """Return the guard's health as the driver sees it."""
        self.order("health")
        return json.loads(self.process.stdout.readline())

    def guards(self):
        """Return the process ids of the live guards of this controller."""
        return processes_with("jaka_ros_driver.client.guard", "--port\0%d\0" % self._bench.controller.command_port)

    def watched(self):
        """Wait until its guard has answered; return the guard's process id."""
        assert eventually(lambda: self.health()["is_alive"])
        pid, = self.guards()
        return pid

    def hears(self, words):
        """Wait until it or its guard has printed these words."""
        def heard():
            if select.select([self.process.stderr], [], [], 0.0)[0]:
                self._said += os.read(self.process.stderr.fileno(), 65536).decode()
            return words in self._said
        return eventually(heard)

    def leave(self):
        """End in good order; return what it and its guard have printed."""
        self.order("leave")
        return self.end()

    def end(self):
        """Return what it and its guard have printed; it must be over, or is ended."""
        self._said += self.process.communicate(timeout=WAIT)[1]
        return self._said

    def kill(self):
        """End it in disorder; return what it and its guard have printed, when both are gone."""
        if self.process.poll() is None:
            self.send(signal.SIGCONT)
            self.process.kill()
        if not self.process.stderr.closed:
            self.end()
        return self._said
