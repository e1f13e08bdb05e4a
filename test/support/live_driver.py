"""The driver node on a simulated controller that keeps a log, each in a process of its own; running motions."""
import os
import signal
import time

import rospy
from arm_bench import processes_with
from ros_bench import HOME, WAIT, Arm, DriverProcess, InBackground, SimulatorProcess, eventually, on
from wire_verdict import WireVerdict

SPEED = 0.2
"""rad/s of the first joint in every motion."""


class LiveDriver:
    """One driver node and its simulated controller; ``verdict`` ends both."""

    def __init__(self, folder, name="mortal", simulator=(), guard=True, **parameters):
        self.log_file = os.path.join(str(folder), "wire-%s-%d.mcap" % (name, time.monotonic_ns()))
        self._name, self._parameters, self._guard = name, parameters, guard
        self.simulator = SimulatorProcess("--start", "enabled", "--log", self.log_file, *simulator)
        self.arm = Arm(self.simulator, "/" + name)
        self._drivers = []
        self.motions = 0
        self.start()

    def start(self):
        """Start a driver, the first one or one after another has died."""
        self.arm = Arm(self.simulator, self.arm.name)
        self._drivers.append(DriverProcess(self._name, **on(self.simulator, self._guard), **self._parameters))

    @property
    def process(self):
        return self._drivers[-1].process

    def send(self, number):
        """Send a signal to the driver; return the moment before."""
        moment = time.monotonic()
        self.process.send_signal(number)
        return moment

    def guards(self):
        """Return the process ids of guards of this controller."""
        return processes_with("jaka_ros_driver.client.guard", "--port\0%d\0" % self.simulator.command_port)

    def end_driver(self, how=signal.SIGINT):
        """End the driver; return its exit code and its output."""
        return self._drivers[-1].end(how)

    def kill_driver(self):
        """Kill what is left of the driver; return its output."""
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


# ---- motions, each long enough to be cut short: they return what waits for their end, None where nothing does.
# Each has a speed of its own, so that the log tells two of them from one that was sent twice. ----

def begin_move(arm, speed=SPEED):
    return InBackground(arm.call, "joint_move", pose=[3.0] + HOME[1:], mvvelo=speed, mvacc=4.0)


def begin_line(arm, speed=SPEED):
    return InBackground(arm.call, "linear_move", pose=[420.0, 300.0, 370.0, 2.2214, -2.2214, 0.0], mvvelo=100.0 * speed,
                        mvacc=100.0)


def begin_jog(arm, speed=SPEED):
    reply = arm.call("jog", mvvelo=speed, coord_mode=0, index=0)
    return None if reply.ret == 1 else InBackground(lambda: reply)


def begin_servo(arm, speed=SPEED):
    """Start a stream of targets that goes on until one is refused, or the driver is gone."""
    reply = arm.call("servo_move_enable", enable=True)
    return InBackground(stream, arm, speed) if reply.ret == 1 else InBackground(lambda: reply)


def stream(arm, speed, period=0.008):
    """Stream targets; return the reply that refused one, None where there was none."""
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
    """Begin one of MOTIONS on a rested arm, and see it move; try again where a busy host stands against it."""
    said = []
    for _ in range(5):
        live.motions += 1
        reply = live.arm.call("joint_move", pose=HOME, mvvelo=3.0 - live.motions * 1e-3, mvacc=12.0)
        if reply.ret == 1:
            pending = MOTIONS[motion](live.arm, SPEED + live.motions * 1e-3)
            if eventually(lambda pending=pending: live.simulator.is_moving() or pending and pending.is_over, WAIT) and (
                    pending is None or not pending.is_over):
                return pending
            reply = pending.result
        said.append(reply)
        time.sleep(0.5)
    raise AssertionError("no motion: %s" % said)
