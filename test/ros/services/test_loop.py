"""The loop of the service connections over real sockets: whoever blocks, is silent or dies, all others are served."""
import contextlib
import selectors
import socket
import struct
import threading
import time
from unittest.mock import MagicMock

import pytest
from waiting import WAIT, eventually, repeating

from jaka_ros_driver.ros.connections import SERVICE_CONNECTIONS
from jaka_ros_driver.ros.services import loop as loop_module
from jaka_ros_driver.ros.services import table
from jaka_ros_driver.ros.services.connection import (
    LONGEST_REQUEST,
    ServiceConnection,
    UnreadableRequest,
    error_answer,
)
from jaka_ros_driver.ros.services.loop import ServiceLoop
from jaka_ros_driver.ros.services.server import CallCount

CLIENTS = 100
SOON_S = 10.0
"""Longest time, s, that a call may take on a busy host, where whoever blocks does so for ``WAIT``."""
MANY_BYTES = 8 << 20
"""Length of an answer that no socket takes at once."""


def framed(body):
    return struct.pack("<I", len(body)) + body


def ok(body):
    return b"\1" + framed(body)


class Client:
    """The client's side of one connection."""

    def __init__(self, sock):
        self.sock = sock

    def ask(self, body=b""):
        self.sock.sendall(framed(body))

    def read(self, count):
        data = bytearray()
        while len(data) < count:
            piece = self.sock.recv(min(1 << 16, count - len(data)))
            assert piece, "closed after %d of %d bytes" % (len(data), count)
            data += piece
        return bytes(data)

    def answer(self):
        """Read one answer; return its body, or the text of an error."""
        is_good, length = struct.unpack("<BI", self.read(5))
        body = self.read(length)
        return body if is_good else body.decode("utf-8")

    def call(self, body=b""):
        self.ask(body)
        return self.answer()

    def is_closed(self):
        try:
            return self.sock.recv(1) == b""
        except ConnectionError:
            return True


class Cell:
    """A loop with its clients.

    Attributes:
        loop: The loop.
        connections: Its side of each connection that was made.
        calls: Counts the running calls.
    """

    def __init__(self, stack):
        self._stack = stack
        self._listener = stack.enter_context(contextlib.closing(socket.create_server(("127.0.0.1", 0))))
        self._threads = set(threading.enumerate())
        self.loop = ServiceLoop()
        self.connections = []
        self.calls = CallCount()

    def client(self, answer=ok, is_stop=False, buffer=None, **header):
        """Return a new client, whose requests ``answer`` takes by their bodies."""
        peer = self._stack.enter_context(contextlib.closing(socket.socket()))
        if buffer is not None:
            peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        peer.settimeout(WAIT)
        peer.connect(self._listener.getsockname())
        here = self._listener.accept()[0]
        fields = dict({"service": "/driver/work", "callerid": "/client", "persistent": "1"}, **header)
        self.connections.append(ServiceConnection(here, fields, answer, self.calls))
        self.loop.add(self.connections[-1], is_stop)
        return Client(peer)

    def threads(self):
        """Return how many threads there are more than before."""
        return len(set(threading.enumerate()) - self._threads)

    def are_open(self):
        """Return how many connections are not closed."""
        return sum(connection.fileno() >= 0 for connection in self.connections)


@pytest.fixture
def cell():
    with contextlib.ExitStack() as stack:
        running = Cell(stack)
        yield running
    assert eventually(lambda: not running.are_open()), "no other test is to find its connections"


@pytest.fixture
def no_more_threads(cell, monkeypatch):
    """Let the system have no room for a further thread, once the loop runs; yield what ends that."""
    cell.loop.start()

    def start(thread):
        raise RuntimeError("no room")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", start)
        yield patch.undo


class Gate:
    """A handler that blocks until the test is over."""

    def __init__(self):
        self._lock = threading.Lock()
        self._is_open = threading.Event()
        self.inside = 0

    def __call__(self, body):
        with self._lock:
            self.inside += 1
        assert self._is_open.wait(WAIT)
        return ok(body)

    def open(self):
        self._is_open.set()


@pytest.fixture
def gate():
    gate = Gate()
    yield gate
    gate.open()


def assert_served(cell):
    """Assert that new clients, of a stop and of another service, are answered at once."""
    for is_stop in (True, False):
        began = time.monotonic()
        assert cell.client(is_stop=is_stop).call(b"now") == b"now"
        assert time.monotonic() - began < SOON_S


def test_what_stops_something_is_served_by_the_threads_of_the_stops(monkeypatch):
    stops = set()
    monkeypatch.setattr(table, "ServiceServer", lambda name, kind, handler, calls, others, is_stop: (
        stops.add(name) if is_stop else None))
    table.Services(MagicMock(), MagicMock(), MagicMock(), MagicMock()).offer()
    assert stops == {"~stop_move", "~program/stop"}


# ---- requests ----

def test_half_a_request_waits_for_its_rest_and_keeps_nobody(cell):
    whole = framed(b"the whole request")
    halves = [(cell.client(is_stop=number % 2 == 0), number) for number in range(len(whole))]
    for client, cut in halves:
        client.sock.sendall(whole[:cut])
    assert_served(cell)
    assert eventually(lambda: cell.threads() <= 6)
    for client, cut in halves:
        client.sock.sendall(whole[cut:])
    assert all(client.answer() == b"the whole request" for client, _ in halves)


def test_requests_in_one_segment_are_answered_in_order_one_at_a_time(cell):
    running = threading.Lock()

    def answer(body):
        assert running.acquire(blocking=False), "two requests of one connection at once"
        time.sleep(0.0005)
        running.release()
        return ok(body)

    client = cell.client(answer)
    bodies = [b"%d" % number for number in range(200)]
    client.sock.sendall(b"".join(map(framed, bodies)))
    assert [client.answer() for _ in bodies] == bodies


def test_a_client_that_sends_ahead_leaves_others_their_turn(cell, no_more_threads):
    done = []

    def answer(body):
        time.sleep(0.001)
        done.append(body)
        return ok(body)

    for _ in range(8):
        cell.client(answer).sock.sendall(framed(b"") * 500)
    assert cell.client().call(b"between") == b"between"
    assert len(done) < 400


@pytest.mark.parametrize("length", [LONGEST_REQUEST + 1, 0x7fffffff, 0xffffffff])
def test_a_length_that_is_none_is_told_and_ends_the_connection(cell, length):
    client = cell.client()
    client.sock.sendall(struct.pack("<I", length))
    assert client.answer() == "a request has %d bytes; at most %d are read" % (length, LONGEST_REQUEST)
    assert client.is_closed() and eventually(lambda: not cell.are_open())
    assert_served(cell)


def test_the_longest_request_is_read(cell):
    body = b"x" * LONGEST_REQUEST
    assert cell.client().call(body) == body


def test_what_is_no_request_ends_its_connection_and_no_thread(cell, caplog):
    def unreadable(body):
        raise UnreadableRequest("3 bytes are no std_srvs/SetBoolRequest")

    def ends_the_thread(body):
        raise SystemExit

    for answer in (unreadable, ends_the_thread):
        for is_stop in (True, False):
            for _ in range(10):
                client = cell.client(answer, is_stop)
                client.ask(b"abc")
                assert client.is_closed()
    assert "connection of /client is closed: 3 bytes are no std_srvs/SetBoolRequest" in caplog.text
    assert_served(cell)
    assert eventually(lambda: cell.are_open() == 2) and cell.calls.wait_for_none(WAIT)


# ---- answers ----

@pytest.mark.parametrize("is_stop", [True, False])
def test_a_client_that_does_not_read_keeps_no_thread(cell, is_stop):
    deaf = [cell.client(lambda body: ok(body * MANY_BYTES), is_stop, buffer=4096) for _ in range(20)]
    for client in deaf:
        client.ask(b"x")
        client.ask(b"y")
    assert cell.calls.wait_for_none(WAIT)
    assert_served(cell)
    assert eventually(lambda: cell.threads() <= 6)
    assert all(client.answer() == letter * MANY_BYTES for client in deaf[:2] for letter in (b"x", b"y"))


def test_who_reads_late_gets_the_whole_answer_before_the_end_of_its_only_call(cell):
    client = cell.client(lambda body: ok(body * MANY_BYTES), buffer=4096, persistent="0")
    client.ask(b"z")
    assert cell.calls.wait_for_none(WAIT)
    time.sleep(0.1)
    assert client.answer() == b"z" * MANY_BYTES and client.is_closed()


@pytest.mark.parametrize("fields, stays", [({"persistent": "1"}, True), ({"persistent": "True"}, True),
                                           ({"persistent": "0"}, False), ({"persistent": ""}, False)])
def test_a_connection_stays_for_another_call_where_the_client_wants_it(cell, fields, stays):
    client = cell.client(**fields)
    assert client.call(b"once") == b"once"
    if stays:
        assert client.call(b"twice") == b"twice"
    else:
        assert client.is_closed() and eventually(lambda: not cell.are_open())


def test_an_error_is_told_as_text_without_half_characters():
    assert error_answer("too far: 1 m \ud800") == b"\0" + framed(b"too far: 1 m ?")


# ---- ends ----

def reset(sock):
    """Close a connection as a process that dies with unread bytes does."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    sock.close()


@pytest.mark.parametrize("end", [socket.socket.close, reset])
def test_clients_that_die_at_any_moment_leave_nothing(cell, gate, end):
    idle, amid, deaf, waiting = (
        cell.client(), cell.client(), cell.client(lambda body: ok(body * MANY_BYTES), buffer=4096), cell.client(gate))
    amid.sock.sendall(framed(b"request")[:7])
    deaf.ask(b"x")
    waiting.ask(b"x")
    assert eventually(lambda: gate.inside)
    for client in (idle, amid, deaf, waiting):
        end(client.sock)
    assert eventually(lambda: cell.are_open() == 1), "only the running call is left"
    gate.open()
    assert eventually(lambda: cell.are_open() == 0)
    assert not set(SERVICE_CONNECTIONS._connections) & {connection._pooled for connection in cell.connections}
    assert_served(cell)


def test_a_client_that_only_ends_its_own_side_gets_its_answer(cell):
    client = cell.client()
    client.ask(b"last")
    client.sock.shutdown(socket.SHUT_WR)
    assert client.answer() == b"last" and client.is_closed()


def test_what_the_pool_closes_is_removed_and_a_running_call_is_spared(cell, gate):
    idle, busy = cell.client(), cell.client(gate)
    busy.ask(b"kept")
    assert eventually(lambda: gate.inside)
    assert SERVICE_CONNECTIONS.close_oldest() and idle.is_closed()
    assert eventually(lambda: cell.are_open() == 1)
    assert not SERVICE_CONNECTIONS.close_oldest()
    gate.open()
    assert busy.answer() == b"kept" and busy.call(b"again") == b"again"


# ---- threads ----

@pytest.mark.parametrize("count", [1, 2, 3, 4, CLIENTS])
def test_a_stop_and_every_other_call_are_served_while_so_many_block(cell, gate, count):
    for _ in range(count):
        cell.client(gate).ask()
    assert_served(cell)
    assert eventually(lambda: gate.inside == count)
    assert_served(cell)


@pytest.mark.parametrize("count", [1, 2, 3, 20])
def test_a_stop_is_served_while_so_many_stops_block(cell, gate, count):
    for _ in range(count):
        cell.client(gate, is_stop=True).ask()
    assert_served(cell)
    assert eventually(lambda: gate.inside == count)
    assert_served(cell)


def test_a_thread_that_waits_alone_does_not_end(cell, gate, monkeypatch):
    monkeypatch.setattr(loop_module, "_SPARE_IDLE_S", 0.02)
    for number in range(20):
        cell.client(gate, is_stop=number % 2 == 0).ask()
    assert eventually(lambda: gate.inside == 20)
    time.sleep(0.2)
    assert_served(cell)


def test_a_stop_waits_for_no_other_call_even_where_no_thread_can_be_started(cell, gate, no_more_threads, caplog):
    first = [cell.client(gate) for _ in range(10)]
    for client in first:
        client.ask(b"x")
    late = cell.client()
    late.ask(b"late")
    assert eventually(lambda: "no further thread can be started (no room)" in caplog.text)
    assert cell.client(is_stop=True).call(b"stop") == b"stop"
    time.sleep(0.1)
    assert len(caplog.records) < 10, "the log is flooded"
    gate.open()
    assert all(client.answer() == b"x" for client in first) and late.answer() == b"late"


@pytest.mark.parametrize("is_stop, count", [(True, 2), (False, 3)])
def test_threads_are_started_again_once_there_is_room_for_them(cell, gate, no_more_threads, is_stop, count, caplog):
    first = Gate()
    for _ in range(count):
        cell.client(first, is_stop).ask()
    assert eventually(lambda: first.inside == count) and eventually(lambda: "no room" in caplog.text)
    first.open()
    assert_served(cell)
    no_more_threads()
    for _ in range(count):
        cell.client(gate, is_stop).ask()
    assert eventually(lambda: gate.inside == count)
    assert_served(cell)


def test_threads_of_long_calls_end_after_them(cell, gate):
    clients = [cell.client(gate, is_stop=number % 2 == 0) for number in range(20)]
    for client in clients:
        client.ask()
    assert eventually(lambda: gate.inside == 20) and cell.threads() >= 20
    gate.open()
    assert eventually(lambda: cell.threads() <= 7)
    assert_served(cell)



def test_a_hundred_clients_that_call_take_few_threads_and_a_stop_passes_them(cell, monkeypatch):
    monkeypatch.setattr(loop_module, "_LONG_CALL_S", 0.5)  # on a busy host, short calls take long, too

    def answer(body):
        time.sleep(0.002)
        return ok(body)

    clients = [cell.client(answer) for _ in range(CLIENTS)]
    stop, answered, selector = cell.client(is_stop=True), [], selectors.DefaultSelector()
    for client in clients:
        selector.register(client.sock, selectors.EVENT_READ, client)
        client.ask(b"io")

    def flood():
        for key, _ in selector.select(0.1):
            answered.append(key.data.answer())
            key.data.ask(b"io")

    took, threads = [], []
    with repeating(flood):
        for _ in range(30):
            began = time.monotonic()
            assert stop.call(b"stop") == b"stop"
            took.append(time.monotonic() - began)
            threads.append(cell.threads())
            time.sleep(0.01)
    assert sorted(took)[len(took) // 2] < 0.1, took
    assert len(answered) > CLIENTS and set(answered) == {b"io"}
    assert max(threads) <= 20, threads
