"""Operations on the non-blocking sockets of every command that serves a controller's ports."""
import contextlib
import selectors
import socket
import struct
import time
from typing import Any, Optional, Tuple

from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.units import NS_PER_S

LOOPBACK = "127.0.0.1"
_RECEIVE_BYTES = 65536
"""Bytes read at a time: seven of the longest frames."""
_RESET_ON_CLOSE = struct.pack("ii", 1, 0)
_STAMP_ARRIVALS = getattr(socket, "SO_TIMESTAMPNS", 35)  # Linux; the socket module of Python 3.8 to 3.11 lacks it
_ARRIVAL = struct.Struct("@ll")  # struct timespec of the wall clock
_ANCILLARY_BYTES = socket.CMSG_SPACE(_ARRIVAL.size)


def accept(listener: Any) -> Optional[Tuple[socket.socket, str]]:
    """Return the socket of the next client, and its address as "host:port"; None where it has gone already."""
    try:
        link, address = listener.accept()
    except OSError:
        return None
    prepare(link)
    return link, endpoint(*address[:2])


def prepare(link: socket.socket) -> None:
    """Make the socket non-blocking and turn Nagle's algorithm off."""
    link.setblocking(False)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def receive(link: socket.socket, most: int = _RECEIVE_BYTES) -> Optional[bytes]:
    """Return the next bytes, at most ``most``; None where there are none now, empty where the connection has ended."""
    try:
        return link.recv(most)
    except BlockingIOError:
        return None
    except OSError:
        return b""


def stamp_arrivals(link: socket.socket) -> None:
    """Turn on the system's arrival stamps, which ``receive_stamped`` returns; without them it returns the time of its
    call.

    Linux switches its stamps on in the background where no other socket of the computer has them: what comes in within
    the next moments may have the time of its reading.
    """
    with contextlib.suppress(OSError):
        link.setsockopt(socket.SOL_SOCKET, _STAMP_ARRIVALS, 1)


def receive_stamped(link: socket.socket) -> Tuple[Optional[bytes], int]:
    """Return the next bytes as ``receive`` does, and when the last of them arrived, ns of ``time.monotonic_ns``.

    The system stamps with the wall clock. Where this process is held up between reading the two clocks, the moment is
    later than the arrival by so much, never earlier: an answer does not come before what it answers. A step of the wall
    clock between the arrival and this call shifts the moment, but never into the future.
    """
    try:
        data, ancillary, _, _ = link.recvmsg(_RECEIVE_BYTES, _ANCILLARY_BYTES)
    except BlockingIOError:
        return None, time.monotonic_ns()
    except OSError:
        return b"", time.monotonic_ns()
    wall = time.time_ns()  # first: the other way round, a pause between the two would make the moment too early
    now = time.monotonic_ns()
    for level, kind, content in ancillary:
        if level == socket.SOL_SOCKET and kind == _STAMP_ARRIVALS and len(content) >= _ARRIVAL.size:
            seconds, nanoseconds = _ARRIVAL.unpack_from(content)
            return data, min(now, now - wall + seconds * NS_PER_S + nanoseconds)
    return data, now


def send(link: socket.socket, data: bytes) -> bytes:
    """Send what the network takes now; return what is left. Raise OSError where the connection is broken."""
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
    """Close the socket, so that the peer receives an orderly end, or a reset (RST)."""
    if is_reset:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)
    link.close()
