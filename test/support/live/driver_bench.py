"""The driver node on a simulated controller, each in its own process: services, topics, signals, motions."""
import contextlib
import json
import math
import os
import signal
import subprocess
import threading
import time

import rosgraph
import rospy
import rostopic
import yaml
from arm_bench import processes_with
from command_places import command_of
from waiting import WAIT, InBackground, eventually
from wire_verdict import WireVerdict

from jaka_msgs.msg import ServiceCall
from jaka_ros_driver.ros.services.table import SERVICES
from jaka_ros_driver.simulation.server.event_loop import ask_operator_port

TYPES = {spec.name: spec.srv_type for spec in SERVICES}
PROGRAM = command_of("jaka_driver")
HOME = [0.0, 1.5, -1.5, 1.5, 1.5, 0.0]
SPEED = 0.2
"""Speed of the first joint in every motion, rad/s."""


class SimulatorProcess:
    """The executable ``jaka_sim`` on free ports."""

    def __init__(self, *arguments, ports=(0, 0)):
        self._process = subprocess.Popen(
            [*command_of("jaka_sim"), "--command-port", str(ports[0]), "--status-port", str(ports[1]),
             "--poll-port", "0", "--power-delay", "0.1", "--enable-delay", "0.1", *arguments],
            stdout=subprocess.PIPE, text=True)
        self.ports = json.loads(self._process.stdout.readline())
        self.command_port, self.status_port = self.ports["command_port"], self.ports["status_port"]

    def operate(self, action, **parameters):
        answer = ask_operator_port(self.ports["panel_port"], dict(parameters, action=action))
        assert answer.pop("ok"), answer
        return answer

    def state(self):
        return self.operate("state")["state"]

    def is_moving(self):
        return self.state()["is_moving"]

    def freeze_feed(self):
        """Have the feed show the arm where it is now, joints and tool: a pose that moves alone is a contradiction."""
        now = self.state()
        self.operate("fields", add={"joint_actual_position": now["joint_position"], "actual_position": now["tcp_pose"]})

    def make_well(self):
        """Undo what a test, or one that failed before, has done to the feed, and release the emergency stop."""
        self.operate("clear_faults")
        self.operate("release_emergency_stop")

    def close(self):
        self._process.terminate()
        self._process.wait(WAIT)
        self._process.stdout.close()


class Arm:
    """A driver node, its services and topics."""

    def __init__(self, simulator, name="/jaka_driver"):
        self.simulator = simulator
        self.name = name
        self._proxies = {}

    def call(self, service, **fields):
        """Call a service on a connection that stays; return the reply, or the rospy.ServiceException."""
        key = (service, threading.get_ident())
        if key not in self._proxies:
            rospy.wait_for_service("%s/%s" % (self.name, service), WAIT)
            self._proxies[key] = rospy.ServiceProxy("%s/%s" % (self.name, service), TYPES[service], persistent=True)
        return self._proxies[key](**fields)

    def wait_until_seen(self):
        """Wait until the driver answers, the link to the controller is up, and so is its status feed."""
        self.wait_until_reached()
        self.listen("joint_position", 1)

    def wait_until_reached(self):
        """Wait until the driver answers, and the link to the controller is up: its status feed may still be silent."""
        assert eventually(lambda: self.call("get_fk", joint=HOME).cartesian_pose), "the driver does not reach the arm"

    def wait_until_ready(self):
        self.wait_until_seen()
        assert eventually(lambda: self.simulator.state()["is_enabled"]), "the arm is not enabled"
        assert eventually(lambda: self.listen("robot_states", 1)[0].power_state == 1)

    def listen(self, topic, count, timeout=WAIT):
        """Return so many messages of a topic of the node."""
        return [message for _, message in listen(topic if topic[0] == "/" else self.name + "/" + topic, count, timeout)]

    def go_home(self):
        answers = []

        def is_heard():
            """Return whether the driver has a link; a busy host may lose it for a moment."""
            answers.append(self.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0))
            return "no link to the controller" not in answers[-1].message
        assert eventually(is_heard) and answers[-1].ret == 1, answers[-1].message


class ArmOfAnotherMaster(Arm):
    """An arm that is called without asking this process's own master where the services are."""

    def __init__(self, simulator, name, uri):
        super().__init__(simulator, name)
        self._master = rosgraph.Master("/asking", uri)
        last = SERVICES[-1].name  # a driver registers them in this order
        assert eventually(lambda: self._ask("lookupService", "%s/%s" % (name, last)))
        self._uris = {service: self._ask("lookupService", "%s/%s" % (name, service)) for service in TYPES}

    def _ask(self, method, *arguments):
        try:
            return getattr(self._master, method)(*arguments)
        except (OSError, rosgraph.MasterException):
            return None

    def call(self, service, **fields):
        proxy = rospy.ServiceProxy("%s/%s" % (self.name, service), TYPES[service])
        proxy._get_service_uri = lambda request: self._uris[service]
        return proxy(**fields)


def listen(topic, count, timeout=WAIT, topic_type=None):
    """Return so many (time of receipt, message) of a topic."""
    received, enough = [], threading.Event()

    def take(message):
        if len(received) < count:
            received.append((rospy.get_time(), message))
        if len(received) >= count:
            enough.set()

    subscriber = rospy.Subscriber(topic, topic_type or topic_class(topic), take, queue_size=1000, tcp_nodelay=True)
    try:
        assert enough.wait(timeout), "%d of %d messages on %s" % (len(received), count, topic)
    finally:
        subscriber.unregister()
    return received


def topic_class(topic):
    kind = eventually(lambda: rostopic.get_topic_class(topic)[0])
    assert kind is not None, "nobody publishes " + topic
    return kind


@contextlib.contextmanager
def collecting(topic, topic_type=None):
    """Yield a list that grows with the messages of a topic: (time of receipt, message)."""
    received = []
    subscriber = rospy.Subscriber(topic, topic_type or topic_class(topic),
                                  lambda message: received.append((rospy.get_time(), message)), queue_size=1000,
                                  tcp_nodelay=True)
    try:
        assert eventually(lambda: subscriber.get_num_connections() > 0)
        yield received
    finally:
        subscriber.unregister()


@contextlib.contextmanager
def evidence_of(arm):
    """Yield a function that returns the evidence of the calls from now on, those of get_fk left out.

    Calls of get_fk make sure that the driver has connected to the listener.
    """
    with collecting(arm.name + "/service_calls", ServiceCall) as received:
        assert eventually(lambda: arm.call("get_fk", joint=HOME) and received)
        yield lambda: [message for _, message in received if not message.service.endswith("/get_fk")]


def rosservice(*words):
    """Call a service with ``rosservice call``; return the answer as a dictionary, an error as text."""
    done = subprocess.run(["rosservice", "call", *words], capture_output=True, text=True,
                          timeout=60)
    if done.returncode:
        return done.stderr
    return yaml.safe_load(done.stdout) or {}


class DriverProcess:
    """The executable jaka_driver, started directly; parameters as ``name=value``."""

    def __init__(self, name="jaka_driver", environment=None, remappings=(), **parameters):
        words = ["__name:=" + name, *remappings] + ["_%s:=%s" % (key, yaml.safe_dump(
            value, default_flow_style=True, width=math.inf).split("\n")[0])
                                       for key, value in parameters.items()]
        self.process = subprocess.Popen(
            [*PROGRAM, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env=dict(os.environ, **(environment or {})))

    def end(self, how=signal.SIGINT):
        """End it; return its exit code and its output."""
        if self.process.poll() is None:
            self.process.send_signal(how)
        return self.wait()

    def wait(self):
        said, _ = self.process.communicate(timeout=WAIT)
        return self.process.returncode, said

    def __enter__(self):
        return self

    def __exit__(self, *_):
        """End it politely, if possible: a driver that is killed stays registered with the master.

        It prints what the driver said, which pytest shows where a test or a fixture has failed.
        """
        try:
            _, said = self.end()
        except subprocess.TimeoutExpired:
            self.process.kill()
            _, said = self.wait()
        print("driver %s said:\n%s" % (self.process.args[1], said))


def on(simulator, guard=True):
    """Return the parameters with which a driver finds this simulated controller.

    Tests of something else do without the guard: a driver that a busy host gives no time for 0.25 s is as good as dead.
    """
    return {"ip": "127.0.0.1", "command_port": simulator.command_port, "status_port": simulator.status_port,
            "guard": guard}


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
# Each has a speed of its own, so that in the log two of them differ from one that was sent twice. ----

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
