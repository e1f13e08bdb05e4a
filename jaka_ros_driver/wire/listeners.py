"""Listening sockets that can be closed and opened again under the same port number."""
import selectors
import socket
from typing import Dict, Tuple

_BACKLOG = 16
"""Connections that wait to be accepted: a client that retries quickly is not refused meanwhile."""


class Listeners:
    """The listening sockets of a server by port name.

    Each is registered with the selector, with its name as data.

    Attributes:
        numbers: Name of a port to its TCP port number.
    """

    def __init__(self, selector: selectors.BaseSelector) -> None:
        self.numbers: Dict[str, int] = {}
        self._selector = selector
        self._listeners: Dict[str, Tuple[str, socket.socket]] = {}

    def add(self, port: str, host: str, number: int) -> None:
        """Listen at host on TCP port ``number``, 0 for a free one; raise OSError where it cannot be bound."""
        listener = _bound(host, number)
        self._listeners[port] = (host, listener)
        self.numbers[port] = listener.getsockname()[1]
        self.open(port)

    def open(self, port: str) -> None:
        """Listen again; no effect while the port is open."""
        _, listener = self._listeners[port]
        if listener not in self._selector.get_map():
            listener.listen(_BACKLOG)
            self._selector.register(listener, selectors.EVENT_READ, port)

    def shut(self, port: str) -> None:
        """Stop listening; the socket stays bound, so that connections are refused and nobody else gets the number."""
        host, listener = self._listeners[port]
        if listener in self._selector.get_map():
            self._selector.unregister(listener)
            listener.close()
            self._listeners[port] = (host, _bound(host, self.numbers[port]))

    def close(self) -> None:
        for _, listener in self._listeners.values():
            listener.close()
        self._listeners.clear()


def _bound(host: str, number: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, number))
        listener.setblocking(False)
    except OSError:
        listener.close()
        raise
    return listener
