"""A real roscore, killed and started again on the same port: the driver is found again, and old connections stay."""
import contextlib
import os
import signal
import subprocess

import pytest
import rosgraph
from ros_bench import HOME, WAIT, DriverProcess, SimulatorProcess, eventually, on

from jaka_ros_driver.ros.services.service_table import SERVICES

FIELDS = "{joint: %s}" % HOME


class Roscore:
    """A master of this test's own: the session's must not be touched."""

    def __init__(self, port, home):
        self.uri = "http://127.0.0.1:%d" % port
        self.environment = dict(os.environ, ROS_MASTER_URI=self.uri, ROS_HOME=str(home), ROS_LOG_DIR=str(home))
        self._port = port
        self._process = None

    def start(self):
        self._process = subprocess.Popen(["roscore", "-p", str(self._port)], env=self.environment,
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        assert eventually(lambda: self.ask("getParam", "/run_id"))

    def kill(self):
        """The master first: roscore runs it in a process group of its own."""
        if self._process is not None and self._process.poll() is None:
            children = subprocess.run(["pgrep", "-P", str(self._process.pid)], stdout=subprocess.PIPE, text=True).stdout
            for pid in [int(word) for word in children.split()] + [self._process.pid]:
                os.kill(pid, signal.SIGKILL)
            self._process.wait(WAIT)
            assert eventually(lambda: self.ask("getPid") is None)

    def ask(self, method, *args):
        """The master's answer, None while there is none."""
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


@pytest.fixture
def roscore(ros_master, free_ports, tmp_path):
    core = Roscore(free_ports(1)[0], tmp_path)
    yield core
    core.kill()


def test_the_driver_registers_with_the_new_master(roscore):
    roscore.start()
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, \
            DriverProcess("jaka_driver", roscore.environment, **on(simulator, guard=False)):
        expected = {"/jaka_driver/" + spec.name for spec in SERVICES}
        assert eventually(lambda: expected <= roscore.registered()[2])
        before = roscore.registered()
        first_run = roscore.ask("getParam", "/run_id")
        listener = subprocess.Popen(["rostopic", "echo", "-p", "/jaka_driver/joint_position"], env=roscore.environment,
                                    stdout=subprocess.PIPE, text=True)
        try:
            assert listener.stdout.readline().startswith("%time") and listener.stdout.readline()
            roscore.kill()
            assert listener.stdout.readline(), "an old connection ended with the master"
            roscore.start()
            assert roscore.ask("getParam", "/run_id") != first_run
            assert eventually(lambda: all(old <= new for old, new in zip(before, roscore.registered())))
            assert listener.stdout.readline(), "an old connection ended with the new master"
        finally:
            listener.terminate()
            listener.communicate(timeout=WAIT)
        assert eventually(lambda: '<robot name="zu7">' in (roscore.ask("getParam", "/robot_description") or ""))
        assert "cartesian_pose: [4" in roscore.run("rosservice", "call", "/jaka_driver/get_fk", FIELDS)
        assert "joint_1" in roscore.run("rostopic", "echo", "-n1", "/jaka_driver/joint_position")
