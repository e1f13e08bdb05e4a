"""Bytes in and out of the sockets, with a controller that the test plays."""
import contextlib
import socket

import pytest
from waiting import eventually

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.transport import Closed, Opened, Received, Transport

MORE_THAN_ONE_READ = 150000
"""Number of bytes that takes several reads of a socket, which is read 65,536 at a time."""


class Peer:
    """A transport, and the other ends of its connections."""

    def __init__(self, acknowledge_timeout=5.0):
        self.listeners = {port: socket.create_server(("127.0.0.1", 0)) for port in Port}
        ports = {port: one.getsockname()[1] for port, one in self.listeners.items()}
        self.transport = Transport("127.0.0.1", ports, 5.0, acknowledge_timeout)
        self.ends, self.events = {}, []

    def connect(self, port):
        self.transport.open(port)
        self.ends[port] = self.listeners[port].accept()[0]
        assert eventually(lambda: any(isinstance(one, Opened) for one in self.read()))
        return self.ends[port]

    def read(self):
        self.transport.wait(0.01)
        new = self.transport.read()
        self.events += new
        return new

    def close(self):
        for port in Port:
            self.transport.close(port)
        for one in [*self.ends.values(), *self.listeners.values()]:
            one.close()


@pytest.fixture
def peer():
    with contextlib.closing(Peer()) as one:
        yield one


def test_all_that_waits_is_received_in_one_piece(peer):
    # Of several status frames that wait only the last is current: that must be seen.
    end = peer.connect(Port.STATUS)
    end.settimeout(10.0)
    end.sendall(b"x" * MORE_THAN_ONE_READ)
    received = eventually(lambda: [one for one in peer.read() if isinstance(one, Received)])
    assert len(received[0].data) > 65536


def test_what_fills_its_last_read_is_received_once(peer):
    end = peer.connect(Port.STATUS)
    end.settimeout(10.0)
    sent = bytes(range(256)) * 256
    assert len(sent) == 65536
    end.sendall(sent)
    assert eventually(lambda: peer.read() and sum(
        len(one.data) for one in peer.events if isinstance(one, Received)) >= len(sent))
    peer.read()
    assert b"".join(one.data for one in peer.events if isinstance(one, Received)) == sent


def test_what_the_network_does_not_take_at_once_is_sent_later_and_in_order(peer):
    peer.listeners[Port.COMMAND].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    end = peer.connect(Port.COMMAND)
    end.settimeout(10.0)
    sent = bytes(range(256)) * 3000
    for begin in range(0, len(sent), 8192):
        peer.transport.send(sent[begin:begin + 8192])
    got = bytearray()
    while len(got) < len(sent):
        got += end.recv(1 << 16)
        peer.read()
    assert bytes(got) == sent and not [one for one in peer.events if isinstance(one, Closed)]


def test_a_controller_that_does_not_read_is_left(peer):
    end = peer.connect(Port.COMMAND)
    end.settimeout(10.0)
    sent = taken = 0
    while not [one for one in peer.transport.read() if isinstance(one, Closed) and "does not read" in one.reason]:
        peer.transport.send(b"x" * 8192)
        sent += 8192
        assert sent < 1 << 26, "it goes on for ever"
    for piece in iter(lambda: end.recv(1 << 16), b""):
        taken += len(piece)
    assert 1 << 20 < sent - taken < 5 << 18, "so much waits for the network; a moment's delay is no reason"


def test_without_a_connection_nothing_is_sent(peer):
    peer.transport.send(b"lost")
    end = peer.connect(Port.COMMAND)
    end.settimeout(10.0)
    peer.transport.send(b"sent")
    assert end.recv(100) == b"sent"


def test_the_other_end_of_a_connection_that_ends_is_told_once(peer):
    peer.connect(Port.COMMAND).close()
    assert eventually(lambda: [one for one in peer.read() if isinstance(one, Closed)])
    for _ in range(3):
        peer.read()
    closed = [one for one in peer.events if isinstance(one, Closed)]
    assert len(closed) == 1 and "closed by the controller" in closed[0].reason
    assert not [one for one in peer.events if isinstance(one, Received)], "nothing has come"


def test_a_connection_ends_whose_other_end_acknowledges_nothing():
    # a host that has gone acknowledges nothing, nor does one whose buffers are full
    with contextlib.closing(Peer(acknowledge_timeout=0.3)) as peer:
        peer.listeners[Port.COMMAND].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        peer.connect(Port.COMMAND)
        for _ in range(10):
            peer.transport.send(bytes(65536))
        closed = eventually(lambda: [one for one in peer.read() if isinstance(one, Closed)])
        assert closed[0].port is Port.COMMAND and "timed out" in closed[0].reason, closed
