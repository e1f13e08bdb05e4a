"""The HTTP server of one page, in one thread of its own, whose clients cannot take time or memory from the driver.

prometheus_client's own server has a thread for each connection, without an end: whoever reaches the port could fill the
process. Here connections, bytes, times and turns are bounded, and the page is made at most twice a second.
"""
import logging
import selectors
import socket
import threading
import time
from typing import Callable, Dict, NamedTuple, Optional

_LOG = logging.getLogger(__name__)

MOST_CONNECTIONS = 8
"""Most clients at a time: Prometheus is one, and each takes a descriptor that the driver may need."""
LONGEST_REQUEST = 8192
"""Longest request, bytes: Prometheus sends some 300."""
DEADLINE_S = 2.0
"""Longest time, s, from a connection to the last byte of its answer."""
PAUSE_S = 0.01
"""Pause, s, after each turn: a flood of requests gets a hundred turns a second, and no more of the processor."""
PAGE_AGE_S = 0.5
"""Age, s, up to which a page is given out again."""
_LOOK_ROUND_S = 0.25
"""Longest wait, s, for clients, between two looks for the end and for clients that are late."""
_BACKLOG = 16
"""Clients that wait in the kernel while ``MOST_CONNECTIONS`` others are served."""


class Page(NamedTuple):
    """The page: its type, as in Content-Type, and its bytes."""

    kind: str
    body: bytes


class _Connection:
    """One client: what it has sent, and what it has not got yet."""

    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        self.request = b""
        self.answer: Optional[memoryview] = None


class PageServer:
    """The server, at most ``MOST_CONNECTIONS`` clients at a time; the others wait in the kernel."""

    def __init__(self, address: str, port: int, make_page: Callable[[], Page]) -> None:
        """Listen at an IP address and a port; ``start`` serves. Raises OSError where the port cannot be had.

        make_page: Makes the page, in the server's thread.
        """
        self._make_page = make_page
        self._page: Optional[Page] = None
        self._made_at = 0.0
        self._closing = threading.Event()
        self._connections: Dict[socket.socket, _Connection] = {}
        self._listening = socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listening.bind((address, port))
            self._listening.listen(_BACKLOG)
        except OSError:
            self._listening.close()
            raise
        self._listening.setblocking(False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listening, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name="metrics", daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def close(self) -> None:
        """End; clients that wait for an answer get none."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(2.0 * _LOOK_ROUND_S)

    def _run(self) -> None:
        while not self._closing.wait(PAUSE_S):
            try:
                self._turn()
            except Exception:  # neither a client nor a figure ends the thread
                _LOG.exception("a defect of the page for Prometheus")
                self._closing.wait(_LOOK_ROUND_S)
        for client in list(self._connections):
            self._end(client)
        self._selector.unregister(self._listening)
        self._listening.close()
        self._selector.close()

    def _turn(self) -> None:
        ready = self._selector.select(_LOOK_ROUND_S)
        now = time.monotonic()
        for key, _ in ready:
            client = key.fileobj
            if client is self._listening:
                self._accept(now)
            elif isinstance(client, socket.socket):
                self._serve(client, self._connections[client], now)
        for client in [client for client, known in self._connections.items() if now > known.deadline]:
            self._end(client)

    def _accept(self, now: float) -> None:
        if len(self._connections) >= MOST_CONNECTIONS:
            return
        try:
            client, _ = self._listening.accept()
        except OSError:  # gone again, or no descriptor is left
            return
        client.setblocking(False)
        self._connections[client] = _Connection(now + DEADLINE_S)
        self._selector.register(client, selectors.EVENT_READ)

    def _serve(self, client: socket.socket, known: _Connection, now: float) -> None:
        """Read a piece, or send one; end the connection where it is done, broken or asks for too much."""
        try:
            if known.answer is None:
                piece = client.recv(LONGEST_REQUEST)
                known.request += piece
                if b"\r\n\r\n" in known.request:
                    known.answer = memoryview(self._answer(known.request, now))
                    self._selector.modify(client, selectors.EVENT_WRITE)
                elif not piece or len(known.request) >= LONGEST_REQUEST:
                    self._end(client)
                return
            known.answer = known.answer[client.send(known.answer):]
        except BlockingIOError:
            return
        except OSError:
            self._end(client)
            return
        if not known.answer:
            self._end(client)

    def _end(self, client: socket.socket) -> None:
        del self._connections[client]
        self._selector.unregister(client)
        client.close()

    def _answer(self, request: bytes, now: float) -> bytes:
        words = request.split(b"\r\n", 1)[0].split(b" ")
        if len(words) != 3 or not words[2].startswith(b"HTTP/1."):
            return _response("400 Bad Request", _text("not a request of HTTP/1"), True)
        if words[0] not in (b"GET", b"HEAD"):
            return _response("405 Method Not Allowed", _text("GET or HEAD"), True)
        if words[1].split(b"?")[0] != b"/metrics":
            return _response("404 Not Found", _text("the figures are at /metrics"), words[0] == b"GET")
        if self._page is None or now - self._made_at > PAGE_AGE_S:
            self._page, self._made_at = self._make_page(), now
        return _response("200 OK", self._page, words[0] == b"GET")


def _text(words: str) -> Page:
    return Page("text/plain; charset=utf-8", words.encode() + b"\n")


def _response(status: str, page: Page, has_body: bool) -> bytes:
    head = "HTTP/1.1 %s\r\nContent-Type: %s\r\nContent-Length: %d\r\nConnection: close\r\n" % (
        status, page.kind, len(page.body))
    more = "Allow: GET, HEAD\r\n" if status.startswith("405") else ""
    return (head + more + "\r\n").encode() + (page.body if has_body else b"")
