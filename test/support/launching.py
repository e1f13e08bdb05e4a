"""roslaunch and masters inside the test process, ended so that nothing of them runs on; masters of a test's own."""
import contextlib
import os
import signal
import subprocess

import rosgraph
import roslaunch
import rospy
from ros_bench import TYPES, WAIT, Arm, eventually

RUN_ID = "jaka-tests"


def end_server(node):
    """End the thread that serves a rosgraph XmlRpcNode.

    The node's own shutdown only closes the socket, and the thread polls the closed descriptor for ever.
    """
    if node is not None and node.server is not None:
        node.is_shutdown = True
        node.server.shutdown()


@contextlib.contextmanager
def launched_parent(files=(), **options):
    """Yield a ROSLaunchParent that runs these (path, arguments) of launch files."""
    parent = roslaunch.parent.ROSLaunchParent(RUN_ID, list(files), **options)
    parent.start()
    try:
        yield parent
    finally:
        end_server(parent.server)
        parent.shutdown()


class Roscore:
    """A master of one test's own, to be killed, started again and frozen: the session's must not be touched."""

    def __init__(self, port, home):
        self.uri = "http://127.0.0.1:%d" % port
        self.environment = dict(os.environ, ROS_MASTER_URI=self.uri, ROS_HOME=str(home), ROS_LOG_DIR=str(home))
        self._port = port
        self._process = None

    def start(self):
        self._process = subprocess.Popen(["roscore", "-p", str(self._port)], env=self.environment,
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        assert eventually(lambda: self.ask("getParam", "/run_id"))

    def _send(self, number):
        """Send a signal to the master first: roscore runs it in a process group of its own."""
        children = subprocess.run(["pgrep", "-P", str(self._process.pid)], stdout=subprocess.PIPE, text=True).stdout
        for pid in [int(word) for word in children.split()] + [self._process.pid]:
            os.kill(pid, number)

    @contextlib.contextmanager
    def frozen(self):
        self._send(signal.SIGSTOP)
        try:
            yield
        finally:
            self._send(signal.SIGCONT)

    def kill(self):
        if self._process is not None and self._process.poll() is None:
            self._send(signal.SIGKILL)
            self._process.wait(WAIT)
            assert eventually(lambda: self.ask("getPid") is None)

    def ask(self, method, *args):
        """Return the master's answer, None while there is none."""
        try:
            return getattr(rosgraph.Master("/asking", self.uri), method)(*args)
        except (OSError, rosgraph.MasterException):
            return None

    def run(self, *words):
        done = subprocess.run(words, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              timeout=60)
        return done.stdout

    def registered(self):
        published, subscribed, services = self.ask("getSystemState") or ([], [], [])
        return tuple({name for name, nodes in rows if "/jaka_driver" in nodes}
                     for rows in (published, subscribed, services))


class ArmOfAnotherMaster(Arm):
    """An arm that is called without asking this process's own master where the services are."""

    def __init__(self, simulator, name, uri):
        super().__init__(simulator, name)
        self._master = rosgraph.Master("/asking", uri)
        assert eventually(lambda: self._ask("lookupService", name + "/enable"))
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
