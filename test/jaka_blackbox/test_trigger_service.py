"""The black box's service ~trigger beside a system that refuses connections, and callers that only hold theirs."""
import contextlib
import errno
import os
import socket
import struct
import threading
from urllib.parse import urlsplit

import pytest

from jaka_bag.live.tcpros import encode_header
from jaka_blackbox import service as module
from jaka_blackbox.service import MD5SUM, TriggerService

PATIENCE_S = 10.0


@pytest.fixture
def service(monkeypatch):
    """Offer the service, without a master."""
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1/")
    monkeypatch.setenv("ROS_IP", "127.0.0.1")
    monkeypatch.delenv("ROS_HOSTNAME", raising=False)
    offered = TriggerService("/box/trigger", "/box", "http://127.0.0.1:1/", lambda: (True, "a.mcap"))
    yield offered
    offered.close()


def connect(service):
    address = urlsplit(service.uri)
    link = socket.create_connection((address.hostname, address.port), PATIENCE_S)
    link.settimeout(PATIENCE_S)
    return link


def call(service):
    """Call the service; return all that it sent."""
    with connect(service) as link:
        link.sendall(encode_header({"callerid": "/me", "service": "/box/trigger", "md5sum": MD5SUM}))
        link.sendall(struct.pack("<I", 0))
        said = b""
        while True:
            piece = link.recv(4096)
            if not piece:
                return said
            said += piece


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENFILE, errno.ECONNABORTED])
def test_a_connection_that_the_system_refuses_does_not_end_the_service(service, monkeypatch, number):
    real, refusals = socket.socket.accept, []

    def refuse(listener):
        if len(refusals) < 3:
            refusals.append(number)
            raise OSError(number, os.strerror(number))
        return real(listener)
    monkeypatch.setattr(socket.socket, "accept", refuse)
    assert b"a.mcap" in call(service), "the accept that was under way"
    assert b"a.mcap" in call(service)
    assert len(refusals) == 3


def test_a_thread_that_the_system_refuses_does_not_end_the_service(service, monkeypatch):
    refusals = []

    class Refused(threading.Thread):
        def start(self):
            if not refusals:
                refusals.append(self.name)
                raise RuntimeError("can't start new thread")
            super().start()
    monkeypatch.setattr(module.threading, "Thread", Refused)
    with contextlib.suppress(ConnectionError):
        assert call(service) == b""
    assert refusals and b"a.mcap" in call(service)


def test_connections_are_bounded_and_the_next_is_answered_when_one_has_gone(service):
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(connect(service)) for _ in range(module.MOST_CONNECTIONS)]
        with connect(service) as more, contextlib.suppress(ConnectionResetError):
            assert more.recv(1) == b"", "it is closed at once"
        held[0].close()
        for _ in range(100):  # its thread ends in its own time
            with contextlib.suppress(ConnectionError):
                if b"a.mcap" in call(service):
                    return
    raise AssertionError("no call is answered")
