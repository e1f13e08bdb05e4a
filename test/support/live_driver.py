"""The driver's program on a simulated controller that keeps a log, both processes of their own; motions under way."""
import contextlib
import os
import signal
import time

import rospy
from arm_bench import WAIT, eventually
from ros_bench import HOME, Arm, DriverProcess, InBackground, SimulatorProcess, on
from wire_verdict import WireVerdict

SPEED = 0.2
"""rad/s of the first joint in every motion."""


class LiveDriver:
    """One driver node and its simulated controller; ``verdict`` ends both."""

    def __init__(self, folder, name="mortal", simulator=(), **parameters):
        self.log_file = os.path.join(str(folder), "wire-%s-%d.mcap" % (name, time.monotonic_ns()))
        self._name, self._parameters = name, parameters
        self.simulator = SimulatorProcess("--start", "enabled", "--log", self.log_file, *simulator)
        self.arm = Arm(self.simulator, "/" + name)
        self._drivers = []
        self.start()

    def start(self):
        """A driver, the first one or one after another has died."""
        self.arm = Arm(self.simulator, self.arm.name)
        self._drivers.append(DriverProcess(self._name, **on(self.simulator), **self._parameters))

    @property
    def process(self):
        return self._drivers[-1].process

    def send(self, number):
        """Send it; returns the moment before."""
        moment = time.monotonic()
        self.process.send_signal(number)
        return moment

    def guards(self):
        """Process ids of guards of this controller."""
        return processes_with("jaka_ros_driver.client.guard", "--port\0%d\0" % self.simulator.command_port)

    def end_driver(self, how=signal.SIGINT):
        """Its exit code, and all it said."""
        return self._drivers[-1].end(how)

    def kill_driver(self):
        """End what is left of it; what it said."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
        return self._drivers[-1].wait()[1]

    def close(self):
        for driver in self._drivers:
            if driver.process.poll() is None:
                driver.process.send_signal(signal.SIGCONT)
            driver.__exit__()
        eventually(lambda: not self.guards(), 12.0)
        if self.simulator is not None:
            self.simulator.close()
            self.simulator = self.arm.simulator = None

    def verdict(self):
        self.close()
        return WireVerdict(self.log_file)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.simulator is not None:
            self.close()


def processes_with(*words):
    """Process ids of those whose command line (words end with a NUL) has all of these."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError), open("/proc/%s/cmdline" % pid, encoding="utf-8", errors="replace") as file:
            line = file.read()
            if all(word in line for word in words):
                found.append(int(pid))
    return found


# ---- motions, each long enough to be cut short: they return what waits for their end, None where nothing does ----

def begin_move(arm):
    return InBackground(arm.call, "joint_move", pose=[3.0] + HOME[1:], mvvelo=SPEED, mvacc=4.0)


def begin_line(arm):
    return InBackground(arm.call, "linear_move", pose=[420.0, 300.0, 370.0, 2.2214, -2.2214, 0.0], mvvelo=20.0,
                        mvacc=100.0)


def begin_jog(arm):
    assert arm.call("jog", mvvelo=SPEED, coord_mode=0, index=0).ret == 1


def begin_servo(arm):
    """A stream of targets that goes on until one is refused, or the driver is gone."""
    reply = arm.call("servo_move_enable", enable=True)
    assert reply.ret == 1, reply
    return InBackground(stream, arm)


def stream(arm, period=0.008, speed=SPEED):
    first = arm.listen("joint_position", 1)[0].position[0]
    due = time.monotonic()
    for step in range(1, int(2.5 / speed / period)):
        try:
            reply = arm.call("servo_j", pose=[first + step * speed * period] + HOME[1:])
        except (rospy.ServiceException, rospy.ROSException):
            return None
        if reply.ret != 1:
            return reply
        due = max(due + period, time.monotonic() - period)
        time.sleep(max(0.0, due - time.monotonic()))
    return None


MOTIONS = {"move": begin_move, "line": begin_line, "jog": begin_jog, "servo": begin_servo}


def begin(live, motion):
    """Begin one of MOTIONS on a rested arm, and see it move."""
    live.arm.go_home()
    pending = MOTIONS[motion](live.arm)
    assert eventually(live.simulator.is_moving, WAIT), "no motion: %s" % (pending.result if pending else "")
    return pending
