"""A simulated controller on real sockets, and the driver's client connected to it.

The client is judged by the controller's own log of bytes and true joints.
"""
import collections
import contextlib
import os

from waiting import eventually
from wire_verdict import WireVerdict

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.simulated_controller import SimulatedController

LOOSE = 2.0
"""Loose bound on what a quiet computer does within some tenths, s. The exact figures are judged under virtual time."""


def fill(pipe):
    """Fill a pipe that is not read, given by its reading end: every later writer waits."""
    descriptor = os.open("/proc/self/fd/%d" % pipe.fileno(), os.O_WRONLY | os.O_NONBLOCK)
    try:
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(descriptor, b".")
    finally:
        os.close(descriptor)


def processes_with(*words):
    """Return the ids of processes whose command line (words end with a NUL) has all of these."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError), open("/proc/%s/cmdline" % pid, encoding="utf-8", errors="replace") as file:
            line = file.read()
            if all(word in line for word in words):
                found.append(int(pid))
    return found


PATIENT = {"silence_timeout": 5.0, "reply_timeout": 5.0}
"""Settings of a client where links are not what a test is about: a busy host holds it up for a second."""


class Bench:
    """One simulated controller with its log, and the client that drives it."""

    def __init__(self, folder, **options):
        self.log_file = str(folder / "wire.mcap")
        options = {"start": "enabled", **options}
        self.controller = SimulatedController(log=self.log_file, **options)
        self._count_requests(self.controller.server.controller)
        self.controller.start()
        self.arm = None
        self._log = None

    def connect(self, ready=True, **settings):
        """Make a client with these settings; a host that stands still for half a second makes no state stale for it."""
        settings = {"stale_after": 2.0, **settings}
        self.arm = ArmClient(ClientSettings("127.0.0.1", self.controller.command_port, self.controller.status_port,
                                            **settings), load_model("zu7"))
        self.arm.start()
        if ready:
            assert eventually(lambda: self.arm.is_ready)
        return self.arm

    def operate(self, action, **parameters):
        return self.controller.operate(action, **parameters)

    def requests(self, name):
        """Count the requests of this name that have come in, while the controller runs."""
        return self._decoder[name]

    def _count_requests(self, core):
        self._decoder = collections.Counter()
        execute = core.execute

        def counted(request):
            outcome = execute(request)
            self._decoder[outcome.command] += 1
            return outcome
        core.execute = counted

    def is_moving(self):
        return self.controller.state()["is_moving"]

    def close(self):
        if self.arm is not None:
            self.arm.close()
            self.arm = None
        self.controller.close()

    # ---- verdicts: they end the bench ----

    def log(self):
        self.close()
        if self._log is None:
            self._log = WireVerdict(self.log_file)
        return self._log

    def received(self):
        return self.log().received()

    def times_of(self, name):
        return self.log().times_of(name)

    def joints(self):
        return self.log().joints()

    def rest_after(self, moment):
        return self.log().rest_after(moment)
