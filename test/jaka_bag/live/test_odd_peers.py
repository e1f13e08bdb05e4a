"""Peers with an odd address, and a system that refuses connections: what was begun is tried again."""
import contextlib
import errno
import os
import socket
import struct
import threading
import time

import pytest

from jaka_bag.live.graph import RemoteNode, SlaveServer
from jaka_bag.live.names import NodeNames
from jaka_bag.live.publisher import Publisher
from jaka_bag.live.subscriber import Subscriber, accept_all
from jaka_bag.live.tcpros import encode_header

PATIENCE_S = 20.0


@pytest.fixture(autouse=True)
def no_master(monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1/")
    monkeypatch.setenv("ROS_IP", "127.0.0.1")
    monkeypatch.delenv("ROS_HOSTNAME", raising=False)


def poll_until_asked_twice(uri, asked):
    """Subscribe to the publisher at a URI until two questions to it are noted, or patience is over."""
    listener = Subscriber(NodeNames("/me"), lambda *message: None, lambda *link: None, lambda text: None, str)
    try:
        listener._accepts["/a"] = accept_all
        listener._on_publishers("/a", [uri])
        until = time.monotonic() + PATIENCE_S
        while len(asked) < 2 and time.monotonic() < until:
            listener.poll(0.05)
    finally:
        listener._accepts.clear()
        listener.close()


@pytest.mark.parametrize("address", [("a..b", 80), ("%s.b" % ("a" * 70), 80), ("127.0.0.1", "x"), ("127.0.0.1", []),
                                     ("127.0.0.1", -1)])
def test_a_publisher_with_an_odd_address_is_asked_again(address):
    asked = []
    talker = SlaveServer("/talker", "127.0.0.1", "127.0.0.1", lambda topic, uris: None, lambda reason: None)
    talker.topic_address = lambda topic: asked.append(topic) or address
    with contextlib.closing(talker):
        poll_until_asked_twice(talker.uri, asked)
    assert len(asked) >= 2


class Talker:
    """A publisher of ``std_msgs/String`` that sends one message to each that connects."""

    def __init__(self):
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.slave = SlaveServer("/talker", "127.0.0.1", "127.0.0.1", lambda topic, uris: None, lambda reason: None)
        self.slave.topic_address = lambda topic: self._listener.getsockname()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        links = []
        with contextlib.suppress(OSError):
            while True:
                link = self._listener.accept()[0]
                links.append(link)
                link.recv(4096)
                link.sendall(encode_header({"type": "std_msgs/String", "md5sum": "*", "callerid": "/talker"})
                             + struct.pack("<II", 8, 4) + b"text")

    def close(self):
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.slave.close()


def test_a_publisher_that_meets_a_defect_costs_its_own_link_alone():
    opened, taken, notices = [], [], []
    odd, good = Talker(), Talker()

    def open_stream(connection, uri):
        opened.append(uri)
        if uri == odd.slave.uri:
            raise ValueError("nobody foresaw this")
        return uri
    listener = Subscriber(NodeNames("/me"), lambda *message: taken.append(message), open_stream, notices.append, str)
    try:
        for topic, talker in (("/odd", odd), ("/good", good)):
            listener._accepts[topic] = accept_all
            listener._on_publishers(topic, [talker.slave.uri])
        until = time.monotonic() + PATIENCE_S
        while not (taken and notices and opened.count(odd.slave.uri) >= 2) and time.monotonic() < until:
            listener.poll(0.05)
    finally:
        listener._accepts.clear()
        listener.close()
        odd.close()
        good.close()
    assert [tag for tag, _, _ in taken] == [good.slave.uri]
    assert opened.count(odd.slave.uri) >= 2 and opened.count(good.slave.uri) == 1
    assert "nobody foresaw this" in notices[0] and len(set(notices)) == 1


def test_a_publisher_whose_answer_breaks_the_library_is_asked_again(monkeypatch):
    asked = []

    def call(node, method, *arguments):
        asked.append(method)
        raise RuntimeError("nobody foresaw it")
    monkeypatch.setattr(RemoteNode, "call", call)
    poll_until_asked_twice("http://127.0.0.1:1/", asked)
    assert len(asked) >= 2


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ECONNABORTED])
def test_a_connection_that_the_system_refuses_does_not_end_a_publisher(monkeypatch, number):
    publisher = Publisher(NodeNames("/player"), lambda text: None, lambda reason: None)
    address = publisher._listener.getsockname()
    real, refusals = socket.socket.accept, []

    def refuse(listener):
        if listener is publisher._listener and len(refusals) < 2:
            refusals.append(number)
            raise OSError(number, os.strerror(number))
        return real(listener)
    monkeypatch.setattr(socket.socket, "accept", refuse)
    try:
        for _ in range(2):  # the first takes the accept that is under way
            with socket.create_connection(address, PATIENCE_S) as link:
                link.settimeout(PATIENCE_S / 2)
                link.sendall(b"\xff\xff\xff\xff")  # too long a header: it is closed
                link.shutdown(socket.SHUT_WR)
                try:
                    assert link.recv(1) == b""
                except ConnectionResetError:
                    pass
    finally:
        publisher.close(0.0)
    assert len(refusals) == 2
