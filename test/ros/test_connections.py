"""Connections that merely connect and keep nobody from being served: a node with few descriptors under each flood."""
import contextlib
import errno
import itertools
import os
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from urllib.parse import urlparse

import pytest
import rosgraph
import rospy
from import_graph import ROOT
from roscpp.srv import GetLoggers
from rosgraph.network import encode_ros_handshake_header
from std_srvs.srv import Empty, SetBool, Trigger
from waiting import WAIT, eventually

from jaka_msgs.srv import GetIO
from jaka_ros_driver.ros import connections
from jaka_ros_driver.ros.services.server import CallCount

DESCRIPTORS = 256
SERVED_WITHIN = 2.0
NODE = """
import os
import socket
import time
import rospy
from rospy.impl import tcpros_base
from std_srvs.srv import Empty, EmptyResponse, SetBool, SetBoolResponse, Trigger, TriggerResponse
from jaka_msgs.srv import GetIO, GetIOResponse
from jaka_ros_driver.ros.connections import keep_serving, serve_from_the_start
from jaka_ros_driver.ros.log_bridge import log_to_ros
from jaka_ros_driver.ros.services.server import CallCount, ServiceServer, take_connection

def hold_all_descriptors(request):
    held, until = [], time.monotonic() + 1.5
    while time.monotonic() < until:
        try:
            held.append(os.open("/dev/null", os.O_RDONLY))
        except OSError:
            time.sleep(0.001)
    for descriptor in held:
        os.close(descriptor)
    return TriggerResponse(True, str(len(held)))

serve_from_the_start()
rospy.init_node("doorkeeper", disable_signals=True, disable_rosout=True)
tcpros_base.start_tcpros_server()
early = socket.create_connection(tcpros_base.get_tcpros_server_address())  # it sends nothing, and connects first
time.sleep(0.2)  # so that rospy's own thread has taken it, of which nothing tells
log_to_ros()
keep_serving(take_connection)
calls = CallCount()
ServiceServer("~stop", Empty, lambda request: EmptyResponse(), calls, is_stop=True)
ServiceServer("~wait", Trigger, lambda request: time.sleep(3600.0), calls)
ServiceServer("~hold", Trigger, hold_all_descriptors, calls)
ServiceServer("~read", GetIO, lambda request: GetIOResponse(message="read", value=10.0 ** request.index), calls)
ServiceServer("~text", SetBool, lambda request: SetBoolResponse(True, "\\ud800" if request.data else "whole"), calls)
print("ready", flush=True)
while not rospy.is_shutdown():
    time.sleep(0.1)
"""


class Node:
    """The small node above, in a process of its own."""

    def __init__(self, soft=DESCRIPTORS, hard=DESCRIPTORS):
        self.process = subprocess.Popen(
            [sys.executable, "-c", NODE], cwd=str(ROOT), stdout=subprocess.PIPE, text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard)))
        assert self.process.stdout.readline() == "ready\n"
        master = rosgraph.Master("/tests")
        self.uri = master.lookupService("/doorkeeper/stop")
        self.xmlrpc_uri = master.lookupNode("/doorkeeper")

    def connect(self, uri=""):
        address = urlparse(uri or self.uri)
        return socket.create_connection((address.hostname, address.port), WAIT)

    def greet(self, **fields):
        """Return a connection that has sent its header, and has been accepted."""
        sock = self.connect()
        header = dict({"callerid": "/tests", "md5sum": "*", "type": "*", "tcp_nodelay": "0"}, **fields)
        sock.sendall(encode_ros_handshake_header(header))
        sock.recv(4096)
        return sock

    def threads(self):
        return len(os.listdir("/proc/%d/task" % self.process.pid))

    def descriptors(self):
        return len(os.listdir("/proc/%d/fd" % self.process.pid))

    def close(self):
        self.process.kill()
        self.process.wait(WAIT)
        self.process.stdout.close()


@pytest.fixture
def node(ros_node):
    running = Node()
    yield running
    running.close()


def answered_after(service="stop", kind=Empty, **fields):
    """Return the seconds that a new caller waits for the answer."""
    begin = time.monotonic()
    rospy.ServiceProxy("/doorkeeper/" + service, kind)(**fields)
    return time.monotonic() - begin


def assert_served():
    """Assert that a new caller is served; once more for the host's sake: nobody may wait for ever, and hardly anybody
    long."""
    waits = [answered_after() for _ in range(5)]
    assert sorted(waits)[-2] < SERVED_WITHIN, waits


def is_closed(sock, timeout=WAIT):
    sock.settimeout(timeout)
    try:
        return sock.recv(1) == b""
    except socket.timeout:
        return False
    except OSError:
        return True


def flood(how, count, stack):
    socks = []
    for _ in range(count):
        with contextlib.suppress(OSError):  # a connection that is shed while it speaks
            socks.append(stack.enter_context(how()))
    return socks


NUMBERS = itertools.count()
"""Numbers of subscribers: rospy drops the older one of two with the same name."""
FLOODS = {
    "silent": lambda node: node.connect(),
    "silent at the other port": lambda node: node.connect(node.xmlrpc_uri),
    "persistent callers": lambda node: node.greet(service="/doorkeeper/stop", persistent="1"),
    "callers without a request": lambda node: node.greet(service="/doorkeeper/stop"),
    "callers of nothing": lambda node: node.greet(service="/doorkeeper/nothing"),
    "subscribers": lambda node: node.greet(topic="/rosout", callerid="/listener_%d" % next(NUMBERS)),
    "subscribers of nothing": lambda node: node.greet(topic="/nothing"),
}


@pytest.mark.parametrize("kind", FLOODS)
def test_a_service_is_answered_while_hundreds_of_connections_stay(node, kind):
    before = node.descriptors()
    with contextlib.ExitStack() as stack:
        flood(lambda: FLOODS[kind](node), 600, stack)
        assert_served()
        assert node.descriptors() < DESCRIPTORS
    if kind != "subscribers":  # rospy sees that a subscriber has gone when it publishes to it
        assert eventually(lambda: node.descriptors() <= before + 8), node.descriptors()
    assert_served()


def test_all_floods_at_once(node):
    with contextlib.ExitStack() as stack:
        for how in FLOODS.values():
            flood(lambda how=how: how(node), 200, stack)
            assert_served()
        assert_served()


def test_the_accepting_thread_outlives_the_lack_of_descriptors(node):
    with contextlib.ExitStack() as stack:
        flood(lambda: FLOODS["silent"](node), 5, stack)
        keeper = rospy.ServiceProxy("/doorkeeper/hold", Trigger, persistent=True)
        assert int(keeper().message) > 50
    with node.greet(service="/doorkeeper/hold", persistent="1") as holder:
        holder.sendall(b"\0\0\0\0")
        assert eventually(lambda: node.descriptors() > DESCRIPTORS - 10)
        assert answered_after() < WAIT
    assert_served()


def test_who_says_nothing_is_sent_away_and_who_says_little_too(node):
    begin = time.monotonic()
    with node.connect() as silent, node.connect() as slow:
        slow.sendall(b"\xff\0\0\0")
        for _ in range(3):
            time.sleep(1.0)  # this caller sends little
            with contextlib.suppress(OSError):
                slow.sendall(b"\x10")
        assert not is_closed(slow, 0.1) or time.monotonic() - begin >= 5.0, "5 s are not over"
        assert is_closed(silent) and is_closed(slow)
    assert 4.5 < time.monotonic() - begin < 4.5 + WAIT


@pytest.mark.parametrize("greeting", [b"\xff\xff\xff\xff", b"\x04\0\0\0\0\0\0\0", b"\x05\0\0\0\x01\0\0\0\xff",
                                      b"GET / HTTP/1.0\r\n\r\n", encode_ros_handshake_header({"callerid": "/x"}),
                                      encode_ros_handshake_header({"service": "/doorkeeper/stop"}),
                                      encode_ros_handshake_header({"topic": "/rosout"})])
def test_what_is_no_greeting_ends_its_connection(node, greeting):
    with node.connect() as sock:
        sock.sendall(greeting)
        sock.settimeout(WAIT)
        with contextlib.suppress(OSError):
            while sock.recv(4096):
                pass
    assert_served()


@pytest.mark.parametrize("fields, refusal", [
    ({"service": "/doorkeeper/nothing", "md5sum": "*"}, "[/doorkeeper] is not a provider of  [/doorkeeper/nothing]"),
    ({"service": "/doorkeeper/stop"}, "Missing required 'md5sum' field"),
    ({"service": "/doorkeeper/stop", "md5sum": "other"},
     "request from [/tests]: md5sums do not match: [other] vs. [%s]" % Empty._md5sum)])
def test_a_caller_is_told_why_it_is_refused(node, fields, refusal):
    with node.connect() as sock:
        sock.sendall(encode_ros_handshake_header(dict(fields, callerid="/tests")))
        assert b"error=" + refusal.encode() in sock.recv(4096) and is_closed(sock)


def test_who_only_probes_is_greeted_and_sent_away(node):
    with node.greet(service="/doorkeeper/stop", probe="1") as sock:
        assert is_closed(sock)


def test_rospys_own_services_are_served(node):
    assert rospy.ServiceProxy("/doorkeeper/get_loggers", GetLoggers)().loggers


def test_connections_that_stay_take_no_threads(node):
    with contextlib.ExitStack() as stack:
        before = node.threads()
        flood(lambda: FLOODS["persistent callers"](node), 100, stack)
        assert_served()
        assert eventually(lambda: node.threads() <= before + 2)  # handshakes and registrations have threads


def test_a_stop_is_served_while_a_hundred_calls_wait_for_ever(node):
    with contextlib.ExitStack() as stack:
        before = node.threads()
        for _ in range(100):
            sock = stack.enter_context(node.greet(service="/doorkeeper/wait", persistent="1"))
            sock.sendall(b"\0\0\0\0")
        assert_served()
        assert eventually(lambda: node.threads() >= before + 90)
        assert_served()


def test_what_is_no_request_of_the_type_ends_its_connection(node):
    with node.greet(service="/doorkeeper/text", persistent="1") as sock:
        sock.sendall(b"\0\0\0\0")
        assert is_closed(sock)
    assert_served()


@pytest.mark.parametrize("length, is_served", [(1 << 19, True), (1 << 20, False)])
def test_a_greeting_longer_than_a_mebibyte_is_not_read(node, length, is_served):
    greeting = {"callerid": "/" + "x" * length, "md5sum": "*", "service": "/doorkeeper/stop"}
    with node.connect() as sock:
        with contextlib.suppress(OSError):  # the node has closed it meanwhile
            sock.sendall(encode_ros_handshake_header(greeting) + b"\0\0\0\0")
        assert is_closed(sock) is not is_served


def test_a_subscriber_too_many_is_told_that_there_is_no_room(node):
    # The node has room for an eighth as many subscribers as it has descriptors.
    with contextlib.ExitStack() as stack:
        flood(lambda: FLOODS["subscribers"](node), DESCRIPTORS // 8, stack)
        late = stack.enter_context(node.connect())
        late.sendall(encode_ros_handshake_header({"callerid": "/tests", "md5sum": "*", "type": "*",
                                                  "topic": "/rosout"}))
        assert b"this node has %d subscribers, and room for no more" % (DESCRIPTORS // 8) in late.recv(4096)


def test_callers_that_come_while_the_node_is_held_up_are_connected_and_served_then(ros_node):
    with contextlib.ExitStack() as stack:
        node = stack.enter_context(contextlib.closing(Node(1024, 1024)))  # enough for all that may shake hands at once
        node.process.send_signal(signal.SIGSTOP)
        try:
            # Fewer than there is room for, also where rosout or the master connects just then.
            socks = [stack.enter_context(node.connect()) for _ in range(connections.MOST_HANDSHAKES - 8)]
        finally:
            node.process.send_signal(signal.SIGCONT)
        for sock in socks:
            sock.settimeout(WAIT)
            sock.sendall(encode_ros_handshake_header({"callerid": "/tests", "md5sum": "*",
                                                      "service": "/doorkeeper/stop"}) + b"\0\0\0\0")
        assert all(sock.recv(1) for sock in socks)


def test_a_request_that_comes_with_the_greeting_is_served(node):
    with node.connect() as sock:
        sock.sendall(encode_ros_handshake_header({"callerid": "/tests", "md5sum": "*", "service": "/doorkeeper/stop"})
                     + b"\0\0\0\0")
        sock.settimeout(WAIT)
        said = b""
        while len(said) < 4 or len(said) < 4 + int.from_bytes(said[:4], "little") + 5:
            said += sock.recv(4096)
    assert said.endswith(b"\x01\0\0\0\0")


def test_the_caller_that_was_idle_longest_has_to_go(node):
    # The node has room for half as many callers as it has descriptors.
    busy = rospy.ServiceProxy("/doorkeeper/stop", Empty, persistent=True)
    busy()
    with contextlib.ExitStack() as stack:
        socks = flood(lambda: FLOODS["persistent callers"](node), DESCRIPTORS // 2 - 1, stack)
        busy()
        more = flood(lambda: FLOODS["persistent callers"](node), 10, stack)
        busy()
        # each enters in a thread of its own: on a busy host not quite in the order in which they came
        assert eventually(lambda: sum(is_closed(sock, 0.001) for sock in socks[:40]) == 10)
        assert not any(is_closed(sock, 0.001) for sock in socks[40:] + more)
        busy()


def test_the_soft_limit_is_raised_to_the_hard_one(ros_node):
    node = Node(100, 1024)
    try:
        with open("/proc/%d/limits" % node.process.pid) as limits:
            assert re.search(r"Max open files +1024 +1024", limits.read())
        with contextlib.ExitStack() as stack:
            flood(lambda: FLOODS["persistent callers"](node), 300, stack)
            assert node.descriptors() > 300
            assert_served()
    finally:
        node.close()


def test_a_response_that_cannot_be_written_spoils_no_later_one(node):
    read = rospy.ServiceProxy("/doorkeeper/read", GetIO, persistent=True)
    assert read(index=2).value == 100.0
    with pytest.raises(rospy.ServiceException, match="float too large"):
        read(index=39)
    assert (read(index=3).message, read(index=3).value) == ("read", 1000.0)
    text = rospy.ServiceProxy("/doorkeeper/text", SetBool, persistent=True)
    with pytest.raises(rospy.ServiceException, match="surrogates"):
        text(True)
    assert text(False).message == "whole"


# ---- parts of it, without a master ----

class Listener:
    """A listening socket whose ``accept`` gives these, one after the other; an error is raised."""

    def __init__(self, *outcomes):
        self.outcomes = list(outcomes)

    def accept(self):
        outcome = self.outcomes.pop(0)
        if isinstance(outcome, OSError):
            raise outcome
        return outcome


@pytest.fixture
def spared(monkeypatch):
    """Count how often a connection had to make room; nothing waits."""
    made = []
    monkeypatch.setattr(connections, "_make_room", lambda: made.append(True))
    monkeypatch.setattr(connections.time, "sleep", lambda seconds: None)
    return made


@pytest.mark.parametrize("number, has_to_go", [
    (errno.EMFILE, 1), (errno.ENFILE, 1), (errno.ENOMEM, 1), (errno.ECONNABORTED, 0), (errno.EPROTO, 0)])
def test_a_connection_makes_room_only_where_there_is_none(spared, number, has_to_go):
    listener = connections._AcceptingSocket(Listener(OSError(number, "told"), "the next connection"))
    assert listener.accept() == "the next connection" and len(spared) == has_to_go


def test_the_accepting_thread_ends_with_its_socket(spared):
    with pytest.raises(OSError):
        connections._AcceptingSocket(Listener(OSError(errno.EBADF, "closed"))).accept()
    assert not spared


class Sock:
    """A connection; closed where its descriptor is -1, as Python has it."""

    def __init__(self, descriptor=7):
        self.descriptor = descriptor
        self.is_shut = False

    def fileno(self):
        return self.descriptor

    def shutdown(self, how):
        self.is_shut = True


def test_subscribers_that_have_gone_make_room_for_others():
    pool, socks = connections._TopicConnections(2), [Sock(), Sock()]
    assert [pool.add(sock) for sock in [*socks, Sock()]] == [True, True, False]
    socks[0].descriptor = -1
    assert pool.add(Sock()) and not pool.add(Sock())


def test_a_pool_that_is_full_ends_the_one_that_was_idle_longest_and_no_more():
    pool, socks = connections.ConnectionPool("tests", 2), [Sock() for _ in range(4)]
    busy = pool.add(socks[0])
    busy.begins()
    for sock in socks[1:]:
        pool.add(sock)
    assert [sock.is_shut for sock in socks] == [False, True, True, False]
    busy.has_ended()
    pool.close_oldest()
    assert [sock.is_shut for sock in socks] == [False, True, True, True], "it is the one that was idle longest"


def test_a_connection_that_has_just_come_is_spared():
    pool, sock = connections.ConnectionPool("tests", 2), Sock()
    assert not pool.close_oldest()
    pool.add(sock)
    assert not pool.close_oldest(60.0) and not sock.is_shut
    assert pool.close_oldest(0.0) and sock.is_shut and not pool.close_oldest()


class Desk:
    """The handlers of a connection by its kind, as rospy has them; each keeps what is asked for and refuses nothing."""

    def __init__(self):
        self.handled = []

    def topic_connection_handler(self, sock, address, header):
        self.handled.append(("topic", header["topic"]))

    def service_connection_handler(self, sock, address, header):
        self.handled.append(("service", header["service"]))


@pytest.mark.parametrize("fields, handled", [
    ({"topic": "/joint_states"}, [("topic", "/joint_states")]),
    ({"service": "/stop"}, [("service", "/stop")]), ({}, [])])
def test_a_subscriber_is_handed_to_the_topics_and_a_caller_to_the_services(fields, handled):
    desk, (here, peer) = Desk(), socket.socketpair()
    with here, peer:
        peer.sendall(encode_ros_handshake_header(dict(fields, callerid="/tests")))
        connections._shake_hands(desk, connections.PooledConnection(here, 0.0), "a peer")
        assert desk.handled == handled and (here.fileno() == -1) is not bool(handled)
        assert handled or b"no topic or service name" in peer.recv(4096)


def test_the_count_of_calls_is_none_again_when_the_last_one_has_ended():
    calls = CallCount()
    assert calls.wait_for_none(0.0)
    with calls:
        with calls:
            pass
        assert not calls.wait_for_none(0.0)
    assert calls.wait_for_none(0.0)
    with pytest.raises(KeyError), calls:
        raise KeyError("a call that fails has ended, too")
    assert calls.wait_for_none(0.0)
