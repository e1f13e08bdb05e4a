"""A master of the tests' own, jaka_bag and ROS nodes as processes against it, publishers with chosen faults."""
import contextlib
import os
import re
import signal
import socket
import subprocess
import threading
from pathlib import Path
from typing import Callable, Dict, Iterator, List, Optional, Sequence

import rosgraph
import rosmaster.master
from launching import end_server
from live_samples import PATIENCE_S, wait_until
from program_places import command_of

from jaka_bag.live.names import NodeNames
from jaka_bag.live.publisher import Publisher, TopicPublisher

SYSTEM_PYTHON = "/usr/bin/python3"


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
            code = self.popen.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            raise AssertionError("%s does not end: %s" % (self.command, self.output)) from None
        self._reader.join()
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
        with contextlib.closing(socket.socket()) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
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
        for process in self._processes:
            if process.popen.poll() is None:
                process.popen.kill()
            process.wait()
        self.stop_master()

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
    ports = {link.socket.getpeername()[1] for outlet in publisher.offers for link in outlet.links}

    def unread() -> int:
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        return sum(int(row[4].split(":")[1], 16) for row in rows if int(row[1].split(":")[1], 16) in ports)
    wait_until(lambda: unread() == 0, "subscribers read")
