"""A simulated controller in a process of its own, and a driver node started on it by its launch file."""
import contextlib
import json
import os
import signal
import subprocess
import threading

import arm_bench
import rospy
import rostopic
import yaml
from program_places import command_of

from jaka_msgs.msg import ServiceCall
from jaka_ros_driver.ros.services.table import SERVICES
from jaka_ros_driver.simulation.server.event_loop import ask_operator_port

WAIT = 60.0
"""s; many programs are started here, which a busy host may delay. Never a measure of speed."""
TYPES = {spec.name: spec.srv_type for spec in SERVICES}
PROGRAM = command_of("jaka_driver")
HOME = [0.0, 1.5, -1.5, 1.5, 1.5, 0.0]


def eventually(condition, timeout=WAIT):
    """Wait until the condition holds; its last value."""
    return arm_bench.eventually(condition, timeout)


class SimulatorProcess:
    """``jaka_sim`` on free ports."""

    def __init__(self, *arguments, ports=(0, 0)):
        self._process = subprocess.Popen(
            [*command_of("jaka_sim"), "--command-port", str(ports[0]), "--status-port", str(ports[1]),
             "--poll-port", "0", "--power-delay", "0.1", "--enable-delay", "0.1", *arguments],
            stdout=subprocess.PIPE, text=True)
        self.ports = json.loads(self._process.stdout.readline())
        self.command_port, self.status_port = self.ports["command_port"], self.ports["status_port"]

    def panel(self, action, **parameters):
        answer = ask_operator_port(self.ports["panel_port"], dict(parameters, action=action))
        assert answer.pop("ok"), answer
        return answer

    def state(self):
        return self.panel("state")["state"]

    def is_moving(self):
        return self.state()["is_moving"]

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
        """One call on a connection that stays; a reply, or rospy.ServiceException."""
        key = (service, threading.get_ident())
        if key not in self._proxies:
            rospy.wait_for_service("%s/%s" % (self.name, service), WAIT)
            self._proxies[key] = rospy.ServiceProxy("%s/%s" % (self.name, service), TYPES[service], persistent=True)
        return self._proxies[key](**fields)

    def wait_until_seen(self):
        """The driver answers, and the link to the controller is up."""
        assert eventually(lambda: self.call("get_fk", joint=HOME).cartesian_pose), "the driver does not reach the arm"

    def wait_until_ready(self):
        self.wait_until_seen()
        assert eventually(lambda: self.simulator.state()["is_enabled"]), "the arm is not enabled"
        assert eventually(lambda: self.listen("robot_states", 1)[0].power_state == 1)

    def listen(self, topic, count, timeout=WAIT):
        """So many messages of a topic of the node."""
        return [message for _, message in listen(topic if topic[0] == "/" else self.name + "/" + topic, count, timeout)]

    def go_home(self):
        answers = []

        def is_heard():
            """A busy host may lose the link for a moment."""
            answers.append(self.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0))
            return "no link to the controller" not in answers[-1].message
        assert eventually(is_heard) and answers[-1].ret == 1, answers[-1].message


def listen(topic, count, timeout=WAIT, topic_type=None):
    """So many (time of receipt, message) of a topic."""
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
    """A list that grows with the messages of a topic: (time of receipt, message)."""
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
    """A function that returns the evidence of the calls from now on, those of get_fk left out.

    With calls of that it is made sure that the driver knows of the listener.
    """
    with collecting(arm.name + "/service_calls", ServiceCall) as received:
        assert eventually(lambda: arm.call("get_fk", joint=HOME) and received)
        yield lambda: [message for _, message in received if not message.service.endswith("/get_fk")]


def rosservice(*words):
    """What the program ``rosservice call`` answers, as a dictionary; its error as text."""
    done = subprocess.run(["rosservice", "call", *words], capture_output=True, text=True,
                          timeout=60)
    if done.returncode:
        return done.stderr
    return yaml.safe_load(done.stdout) or {}


class InBackground(arm_bench.InBackground):
    """A call in a thread of its own; programs may be behind it."""

    def join(self, timeout=WAIT):
        return super().join(timeout)


class DriverProcess:
    """The program jaka_driver, started directly; parameters as ``name=value``."""

    def __init__(self, name="jaka_driver", environment=None, remappings=(), **parameters):
        words = ["__name:=" + name, *remappings] + ["_%s:=%s" % (key, yaml.safe_dump(value).split("\n")[0])
                                       for key, value in parameters.items()]
        self.process = subprocess.Popen(
            [*PROGRAM, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env=dict(os.environ, **(environment or {})))

    def end(self, how=signal.SIGINT):
        """Its exit code, and all it said."""
        if self.process.poll() is None:
            self.process.send_signal(how)
        return self.wait()

    def wait(self):
        said, _ = self.process.communicate(timeout=WAIT)
        return self.process.returncode, said

    def __enter__(self):
        return self

    def __exit__(self, *_):
        """Politely, if it can be: a driver that is killed stays registered with the master."""
        try:
            self.end()
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate(timeout=WAIT)


def on(simulator, guard=True):
    """The parameters with which a driver finds this simulated controller.

    Tests of something else do without the guard: a driver that a busy host gives no time for 0.25 s is as good as dead.
    """
    return {"ip": "127.0.0.1", "command_port": simulator.command_port, "status_port": simulator.status_port,
            "guard": guard}
