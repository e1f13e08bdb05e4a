"""The threads of a live driver with many listeners and clients: few, whoever connects."""
import contextlib
import selectors
import signal
import socket
from pathlib import Path
from urllib.parse import urlparse

import pytest
import rosgraph
import rospy
from driver_bench import TYPES, LiveDriver
from rosgraph.network import encode_ros_handshake_header
from waiting import WAIT, eventually, repeating

MOST = 20
"""Most threads of the driver: those of docs/architecture.md, and two for a node that looks at it just then."""
TOPICS = ("tool_position", "joint_position", "robot_states")


@pytest.fixture
def live(ros_node, tmp_path, monkeypatch):
    monkeypatch.setenv("WATCHDOG_USEC", "0")  # it tells the stacks of its threads on SIGABRT then
    with LiveDriver(tmp_path, name="threaded") as running:
        running.arm.wait_until_ready()
        yield running


@contextlib.contextmanager
def listeners(live, count):
    """Listen so many times to each topic, and read all of it; yield the bytes that each has read."""
    uri = urlparse(rosgraph.Master("/tests").lookupService(live.arm.name + "/get_io"))
    selector, read = selectors.DefaultSelector(), {}

    def drain():
        for key, _ in selector.select(0.1):
            read[key.fileobj] += len(key.fileobj.recv(1 << 16))

    with contextlib.ExitStack() as stack:
        for name in TOPICS:
            for number in range(count):
                sock = stack.enter_context(socket.create_connection((uri.hostname, uri.port), WAIT))
                sock.sendall(encode_ros_handshake_header({
                    "topic": live.arm.name + "/" + name, "callerid": "/listener_%d" % number, "md5sum": "*",
                    "type": "*"}))
                read[sock] = 0
                selector.register(sock, selectors.EVENT_READ)
        with repeating(drain):
            yield read


@contextlib.contextmanager
def clients(live, count):
    """Let so many clients call again and again, each on a connection that stays; yield the number of calls."""
    proxies = [rospy.ServiceProxy(live.arm.name + "/get_io", TYPES["get_io"], persistent=True) for _ in range(count)]
    calls = []

    def call():
        for proxy in proxies:
            calls.append(proxy(signal="digital", path=1, type=0, index=0))

    try:
        with repeating(call, 0.01):
            yield calls
    finally:
        for proxy in proxies:
            proxy.close()


def test_a_driver_with_20_listeners_and_100_clients_has_at_most_20_threads(live):
    def threads():
        return len(list(Path("/proc/%d/task" % live.process.pid).iterdir()))

    with listeners(live, 20) as read, clients(live, 100) as calls:
        assert eventually(lambda: len(calls) > 200 and min(read.values()) > 10000)
        if not eventually(lambda: threads() <= MOST):
            count = threads()
            pytest.fail("%d threads:\n%s" % (count, live.end_driver(signal.SIGABRT)[1]))
