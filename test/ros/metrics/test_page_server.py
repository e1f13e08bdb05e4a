"""The server of the page for Prometheus against clients that are slow, rude or many, on real sockets; no ROS."""
import contextlib
import socket
import threading
import time

import pytest
from waiting import eventually, free_ports

from jaka_ros_driver.ros.metrics import page_server
from jaka_ros_driver.ros.metrics.page_server import LONGEST_REQUEST, MOST_CONNECTIONS, Page, PageServer

GET = b"GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n"


class Served:
    """A server whose page counts how often it was made."""

    def __init__(self, body=b"one 1\n"):
        self.body, self.made = body, 0
        self.port, = free_ports(1)
        self.server = PageServer("127.0.0.1", self.port, self._page)
        self.server.start()

    def _page(self):
        self.made += 1
        if isinstance(self.body, Exception):
            raise self.body
        return Page("text/plain", self.body)

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.port), 10.0)

    def ask(self, request=GET):
        with self.connect() as client:
            client.sendall(request)
            return read(client)


def read(client):
    """Return all that comes until the connection ends, however it ends."""
    received = b""
    with contextlib.suppress(ConnectionResetError):
        while True:
            piece = client.recv(65536)
            if not piece:
                break
            received += piece
    return received


@pytest.fixture
def served():
    served = Served()
    yield served
    served.server.close()
    assert not [thread for thread in threading.enumerate() if thread.name == "metrics"]


@pytest.mark.parametrize("request_, status, has_body", [
    (GET, b"200 OK", True), (b"GET /metrics?x=1 HTTP/1.0\r\n\r\n", b"200 OK", True),
    (GET.replace(b"GET", b"HEAD"), b"200 OK", False), (GET.replace(b"/metrics", b"/"), b"404", False),
    (GET.replace(b"GET", b"POST"), b"405", False), (b"\r\n\r\n", b"400", False), (b"\xff\x00 x\r\n\r\n", b"400", False),
    (b"GET /metrics SSH-2\r\n\r\n", b"400", False)])
def test_it_serves_one_page_and_says_what_else_is_wrong(served, request_, status, has_body):
    head, _, body = served.ask(request_).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 " + status) and (body == served.body) is has_body, head
    assert b"Content-Length: %d" % len(body) in head or request_.startswith(b"HEAD")


def test_a_request_without_an_end_is_cut_off(served, monkeypatch):
    monkeypatch.setattr(page_server, "DEADLINE_S", 60.0)  # its length alone ends it
    with served.connect() as client:
        with contextlib.suppress(OSError):
            client.sendall(b"GET /metrics HTTP/1.1\r\n" + b"a: b\r\n" * LONGEST_REQUEST)
        assert read(client) == b""
    assert served.ask().endswith(served.body)


def test_clients_that_send_nothing_give_way_to_one_that_asks(served, monkeypatch):
    monkeypatch.setattr(page_server, "DEADLINE_S", 0.5)
    with contextlib.ExitStack() as stack:
        silent = [stack.enter_context(served.connect()) for _ in range(MOST_CONNECTIONS + 2)]
        assert eventually(lambda: len(served.server._connections) == MOST_CONNECTIONS)
        time.sleep(10 * page_server.PAUSE_S)  # what must not come has no other sign
        assert len(served.server._connections) <= MOST_CONNECTIONS
        assert served.ask().endswith(served.body)
        assert all(read(client) == b"" for client in silent)


def test_a_client_that_does_not_read_is_cut_off_at_its_deadline(monkeypatch):
    monkeypatch.setattr(page_server, "DEADLINE_S", 0.5)
    served = Served(b"x" * 20_000_000)
    with served.connect() as client:
        client.sendall(GET)
        assert eventually(lambda: served.server._connections)
        assert eventually(lambda: not served.server._connections)
        assert served.made == 1 and len(read(client)) < len(served.body)
    served.server.close()


def test_the_page_is_made_at_most_twice_a_second_however_many_ask(served):
    begun = time.monotonic()
    assert all(served.ask().endswith(served.body) for _ in range(20))
    took = time.monotonic() - begun
    assert served.made <= 1 + took / page_server.PAGE_AGE_S
    assert took > 10 * page_server.PAUSE_S, "requests are not slowed down"


def test_a_figure_that_fails_costs_its_answer_alone(served, caplog):
    served.body = ValueError("a figure")
    with served.connect() as client:
        client.sendall(GET)
        assert eventually(lambda: "a defect of the page for Prometheus" in caplog.text)
        served.body = b"two 2\n"
        assert served.ask().endswith(b"two 2\n")


def test_a_port_that_is_taken_is_an_error_and_nothing_stays_open(served):
    with pytest.raises(OSError, match="in use"):
        PageServer("127.0.0.1", served.port, lambda: Page("", b""))


def test_a_server_that_was_never_started_is_closed():
    PageServer("127.0.0.1", 0, lambda: Page("text/plain", b"")).close()
