"""Masters of the tests' own, launch files and processes against them, and publishers with chosen faults."""
import contextlib
import os
import re
import signal
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import Callable, Dict, Iterator, List, Optional, Sequence
from xmlrpc.client import ServerProxy

import rosgraph
import roslaunch
import rosmaster.master
import rospy
from command_places import command_of
from figures import HostLoad
from waiting import WAIT, eventually, free_port, wait_until

from jaka_bag.live.names import NodeNames
from jaka_bag.live.publisher import Publisher, TopicPublisher

SYSTEM_PYTHON = "/usr/bin/python3"
RUN_ID = "jaka-tests"
_POLITE_S = 15.0


@contextlib.contextmanager
def changed_environment(values: Dict[str, str]) -> Iterator[None]:
    """Change variables of this process's environment for a while."""
    before = dict(os.environ)
    os.environ.update(values)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


class Process:
    """A child process whose output is collected while it runs."""

    def __init__(self, command: Sequence[str], environment: Dict[str, str], folder: Path, **options) -> None:
        self.lines: List[str] = []
        self.command = list(command)
        self.popen = subprocess.Popen(self.command, env=environment, cwd=str(folder), stdout=subprocess.PIPE,
                                      universal_newlines=True, errors="replace",
                                      **dict({"stdin": subprocess.DEVNULL, "stderr": subprocess.STDOUT}, **options))
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.popen.stdout is not None
        for line in self.popen.stdout:
            self.lines.append(line.rstrip("\n"))

    @property
    def output(self) -> str:
        return "\n".join(self.lines)

    def wait_for_line(self, pattern: str) -> str:
        def found() -> bool:
            assert self.popen.poll() is None or re.search(pattern, self.output), self.output
            return re.search(pattern, self.output) is not None
        wait_until(found, "%s says %r" % (" ".join(self.command), pattern))
        return next(line for line in self.lines if re.search(pattern, line))

    def wait(self) -> int:
        try:
            code = self.popen.wait(WAIT)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            raise AssertionError("%s does not end: %s" % (self.command, self.output)) from None
        self._reader.join(WAIT)  # a process that it left behind has the pipe as well
        assert not self._reader.is_alive(), "%s has left processes behind: %s" % (self.command, self.output)
        self.popen.stdout.close()
        return code

    def stop(self, number: int = signal.SIGINT) -> int:
        if self.popen.poll() is None:
            self.popen.send_signal(number)
        return self.wait()


class Graph:
    """A master, and processes that are started against it; all end with the context.

    Args:
        folder: Their working folder.
        is_mortal: The master is a process of its own, which can be stopped and started; else it lives in this one,
            which is faster.

    Attributes:
        uri: The master's URI.
        environment: Variables for the processes.
    """

    def __init__(self, folder: Path, is_mortal: bool = False) -> None:
        self.folder = folder
        self._is_mortal = is_mortal
        self.port = free_port()
        self.uri = "http://127.0.0.1:%d" % self.port
        self.environment = dict(os.environ, ROS_MASTER_URI=self.uri, ROS_IP="127.0.0.1", ROS_HOME=str(folder / "ros"),
                                ROS_LOG_DIR=str(folder / "ros"), PYTHONUNBUFFERED="1")
        for name in ("ROS_HOSTNAME", "ROS_NAMESPACE"):
            self.environment.pop(name, None)
        self._processes: List[Process] = []
        self._process: Optional[Process] = None
        self._master: Optional[rosmaster.master.Master] = None

    def __enter__(self) -> "Graph":
        self.start_master()
        return self

    def __exit__(self, *failure) -> None:
        try:
            self._end_all()
        finally:
            self.stop_master()

    def _end_all(self) -> None:
        """End what runs still, politely: roslaunch ends its nodes then, and else leaves them behind."""
        running = [process.popen for process in self._processes if process.popen.poll() is None]
        for popen in running:
            popen.send_signal(signal.SIGCONT)
            popen.send_signal(signal.SIGINT)
        end = time.monotonic() + _POLITE_S
        for popen in running:
            with contextlib.suppress(subprocess.TimeoutExpired):
                popen.wait(max(0.0, end - time.monotonic()))
            popen.kill()
        for process in self._processes:
            process.wait()

    def start_master(self) -> None:
        if self._is_mortal:
            script = "import sys, rosmaster; rosmaster.rosmaster_main(sys.argv[1:])"
            self._process = Process([SYSTEM_PYTHON, "-c", script, "--core", "-p", str(self.port)], self.environment,
                                    self.folder)
        else:
            with changed_environment({name: self.environment[name] for name in ("ROS_MASTER_URI", "ROS_IP")}):
                self._master = rosmaster.master.Master(self.port)
                self._master.start()
        wait_until(lambda: rosgraph.is_master_online(self.uri), "the master answers")

    def stop_master(self) -> None:
        if self._process is not None:
            self._process.popen.kill()
            self._process.wait()
        if self._master is not None:
            end_server(self._master.master_node)
            self._master.stop()

    def master(self) -> rosgraph.Master:
        return rosgraph.Master("/test", self.uri)

    def start(self, *command: str, **options) -> Process:
        process = Process(command, self.environment, self.folder, **options)
        self._processes.append(process)
        return process

    def jaka_bag(self, *arguments: str, **options) -> Process:
        return self.start(*command_of("jaka_bag"), *arguments, **options)

    def record(self, *arguments: str, **options) -> Process:
        """Start ``jaka_bag record``, and wait until it listens."""
        process = self.jaka_bag("record", *arguments, **options)
        process.wait_for_line("recording to")
        return process

    def python(self, script: str, *arguments: str) -> Process:
        """Run a script with the interpreter that has rospy."""
        return self.start(SYSTEM_PYTHON, "-c", script, *arguments)

    def subscribed(self, topic: str, count: int = 1) -> None:
        """Wait until so many nodes have registered as subscribers of a topic."""
        def is_there() -> bool:
            subscribers = dict(self.master().getSystemState()[1])
            return len(subscribers.get(topic, [])) >= count
        wait_until(is_there, "%d subscribers of %s" % (count, topic))

    @contextlib.contextmanager
    def publisher(self, node: str, notice: Callable[[str], None] = str) -> Iterator[Publisher]:
        """Yield the package's own publisher in this process, for messages and faults of the test's choice."""
        with changed_environment({name: self.environment[name] for name in ("ROS_MASTER_URI", "ROS_IP")}):
            publisher = Publisher(NodeNames(node), notice, lambda reason: None)
        try:
            yield publisher
        finally:
            publisher.close(5.0)


def with_subscribers(publisher: Publisher, *outlets: TopicPublisher, count: int = 1) -> None:
    """Wait until each outlet has so many subscribers."""
    def have() -> bool:
        publisher.admit()
        return all(len(outlet.links) >= count for outlet in outlets)
    wait_until(have, "subscribers connect")


def all_read(publisher: Publisher) -> None:
    """Wait until the subscribers have read everything that was sent; they handle it in the order they read it."""
    # both ends: on a busy host another connection has the same port at one of its ends now and then
    ends = {(link.socket.getpeername()[1], link.socket.getsockname()[1])
            for outlet in publisher.offers for link in outlet.links}

    def unread() -> int:
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        return sum(int(row[4].split(":")[1], 16) for row in rows
                   if (int(row[1].split(":")[1], 16), int(row[2].split(":")[1], 16)) in ends)
    wait_until(lambda: unread() == 0, "subscribers read")


def end_server(node):
    """End the thread that serves a rosgraph XmlRpcNode.

    The node's own shutdown only closes the socket, and the thread polls the closed descriptor for ever.
    """
    if node is not None and node.server is not None:
        node.is_shutdown = True
        node.server.shutdown()


def tell_name(uri: str, node: str, address: str) -> None:
    """Ask a master for a parameter in the name of a node, as rospy does with each line of a node's log.

    From then on it knows the node, and nothing that the node offers. The address is the node's own: at another one the
    master ends a node that has registered meanwhile.
    """
    ServerProxy(uri).subscribeParam(node, address, "/rosout_disable_topics_generation")
    assert rosgraph.Master("/asking", uri).lookupNode(node)


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
            os.kill(self._process.pid, signal.SIGSTOP)  # it begins no rosout meanwhile, which would be left over
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


@contextlib.contextmanager
def core(home: Path) -> Iterator[str]:
    """Run a master with rosout on a free port of loopback; yield its URI, at which the environment points meanwhile."""
    port = free_port()
    uri = "http://127.0.0.1:%d" % port
    with changed_environment({"ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1", "ROS_HOME": str(home), "TMPDIR": str(home),
                              "ROS_LOG_DIR": str(home / "log")}):
        for name in ("ROS_HOSTNAME", "ROS_NAMESPACE"):
            os.environ.pop(name, None)
        with launched_parent(is_core=True, port=port, num_workers=3):
            assert rosgraph.is_master_online(uri)
            yield uri


@contextlib.contextmanager
def master():
    """Make this process a ROS node of a master of its own, for a while; print the host's load at begin and end."""
    with tempfile.TemporaryDirectory() as home, core(Path(home)):
        host = HostLoad()
        print("at start: load average %.2f" % os.getloadavg()[0], flush=True)
        rospy.init_node("soak", anonymous=True, disable_signals=True)
        try:
            yield
            print("in all: %s" % host, flush=True)
        finally:
            rospy.signal_shutdown("done")
