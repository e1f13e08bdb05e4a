"""What every program that serves a controller's ports does with a socket; all of them are non-blocking."""
import selectors
import socket
import struct
from typing import Any, Optional, Tuple

LOOPBACK = "127.0.0.1"
_RECEIVE_BYTES = 65536
_RESET_ON_CLOSE = struct.pack("ii", 1, 0)


def accept(listener: Any) -> Optional[Tuple[socket.socket, str]]:
    """The socket of the next client, and its address as "host:port"; None where it has gone already."""
    try:
        link, address = listener.accept()
    except OSError:
        return None
    prepare(link)
    return link, "%s:%d" % address[:2]


def prepare(link: socket.socket) -> None:
    """Make it non-blocking and turn Nagle's algorithm off."""
    link.setblocking(False)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def receive(link: socket.socket, most: int = _RECEIVE_BYTES) -> Optional[bytes]:
    """The next bytes, at most ``most``; None where there are none now, empty where the connection has ended."""
    try:
        return link.recv(most)
    except BlockingIOError:
        return None
    except OSError:
        return b""


def send(link: socket.socket, data: bytes) -> bytes:
    """Send what the network takes now; returns what is left. Raises OSError where the connection is broken."""
    try:
        while data:
            data = data[link.send(data):]
    except BlockingIOError:
        pass
    return data


def watch(selector: selectors.BaseSelector, link: socket.socket, events: int, data: Any = None) -> None:
    """Have the selector wait for these events of the socket, and for none where ``events`` is 0."""
    key = selector.get_map().get(link)
    if key is None:
        if events:
            selector.register(link, events, data)
    elif not events:
        selector.unregister(link)
    elif key.events != events:
        selector.modify(link, events, data)


def close(link: socket.socket, is_reset: bool) -> None:
    """Close it, so that the peer sees an orderly end, or a reset (RST)."""
    if is_reset:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)
    link.close()
