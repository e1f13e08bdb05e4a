"""TCPROS without rospy: connection headers, and a subscriber's link that yields raw messages with kernel receive times.

After the ROS wiki pages "ROS/TCPROS" and "ROS/Connection Header".

``ConnectionLost`` is raised where a peer cannot be reached or the link breaks, ``ProtocolError`` where it refuses or
its bytes are not TCPROS.
"""
import errno
import os
import socket
import struct
import time
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple

from ..errors import ConnectionLost, ProtocolError
from ..messages.connection import Connection
from ..units import NS_PER_S

_LENGTH = struct.Struct("<I")
_TIMESPEC = struct.Struct("@ll")
_SO_TIMESTAMPNS = 35
"""Linux socket option, and the type of its control message (asm-generic/socket.h); absent from Python's socket."""
_CONTROL_SIZE = socket.CMSG_SPACE(_TIMESPEC.size)
_SMALL_READ = 16 * 1024
"""Bytes read where no long message is under way: many short ones at once."""
_LARGE_READ = 1024 * 1024
"""Bytes read at most of a long message: other links must not wait for it."""
_MAX_HEADER = 16 * 1024 * 1024
"""Longest header, byte, of a publisher: it holds the definition of its type; with more it is no publisher."""
_MAX_MESSAGE = 1 << 30
"""Longest message, byte: 1 GB, as roscpp's own limit; with more the length is damage."""
_CONNECT_TIMEOUT_S = 5.0
"""Longest wait, s, for a connection and its headers, before it is tried again."""
_CLOCK_STEP_NS = 128000000
"""The least, ns, by which a clock that was set goes back: ntpd slews what is less (its step threshold).

Stamps of one link go back by less than that on a clock that runs on: the kernel's clocks of two processors differ by
some hundred nanoseconds, and what has come before the kernel began to stamp has the time at which it was read. A log is
read in the order of its times.
"""

Deliver = Callable[[Any, int, bytes], None]
"""A callback for one message: the link's ``tag``, host time of receipt, ns since the epoch, serialised message."""

_KNOWN_FIELDS = ("topic", "type", "md5sum", "message_definition", "callerid", "latching")


def encode_header(fields: Mapping[str, str]) -> bytes:
    """Encode a connection header with its length."""
    parts = []
    for name, value in fields.items():
        item = ("%s=%s" % (name, value)).encode("utf-8", "surrogateescape")
        parts.append(_LENGTH.pack(len(item)) + item)
    body = b"".join(parts)
    return _LENGTH.pack(len(body)) + body


def decode_header(body: bytes) -> Dict[str, str]:
    """Decode the fields of a connection header, its length not included."""
    fields: Dict[str, str] = {}
    at = 0
    while at < len(body):
        if at + 4 > len(body):
            raise ProtocolError("connection header ends inside a length")
        size = _LENGTH.unpack_from(body, at)[0]
        at += 4
        item = body[at:at + size]
        name, sign, value = item.partition(b"=")
        if len(item) != size or not sign:
            raise ProtocolError("connection header has a field cut short or without '='")
        fields[name.decode("utf-8", "surrogateescape")] = value.decode("utf-8", "surrogateescape")
        at += size
    return fields


def connection_of(topic: str, fields: Mapping[str, str]) -> Connection:
    """Convert a publisher's connection header to the form that a log stores."""
    if "error" in fields:
        raise ProtocolError("publisher of %s refused: %s" % (topic, fields["error"]))
    if "type" not in fields or "md5sum" not in fields:
        raise ProtocolError("publisher of %s names no type" % topic)
    latching = fields.get("latching")
    return Connection(topic, fields["type"], fields["md5sum"], fields.get("message_definition", ""),
                      fields.get("callerid"), None if latching is None else latching == "1",
                      tuple((name, value) for name, value in fields.items() if name not in _KNOWN_FIELDS))


def resolve(host: str, port: int) -> Tuple[str, int]:
    """Resolve a host to its numeric address, to which connecting does not wait; this call may take long itself."""
    try:
        target = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][4]
    except OSError as error:
        raise ConnectionLost("cannot reach %s:%d: %s" % (host, port, error)) from error
    return str(target[0]), int(target[1])


class PublisherLink:
    """One TCPROS link from one publisher on one topic; non-blocking, to be polled by its ``fileno``.

    Args:
        node: Global name of the subscribing node.
        topic: Global topic name.
        publisher: XMLRPC URI of the publishing node.
        address: Host and port that the publisher named.
        tcp_nodelay: Ask the publisher to send each message at once.
        kernel_stamps: Stamp messages with the kernel's time of receipt, else with the time at which they are read.
        on_open: Called once, when ``connection`` is known.

    Attributes:
        connection: The publisher's description of its stream; None until its header came.
        tag: Value from ``on_open``; goes with every message of the link.
        is_connecting: True until the TCP connection stands; poll for writing until then.
    """

    def __init__(self, node: str, topic: str, publisher: str, address: Tuple[str, int], tcp_nodelay: bool = False,
                 kernel_stamps: bool = True, on_open: Callable[["PublisherLink"], Any] = lambda link: None) -> None:
        self.topic = topic
        self.publisher = publisher
        self.connection: Optional[Connection] = None
        self.tag: Any = None
        self.is_connecting = True
        self.deadline = time.monotonic() + _CONNECT_TIMEOUT_S
        self._on_open = on_open
        self._parts: List[bytes] = []
        self._held = 0
        self._wanted = 4
        self._stamp = 0
        request = {"callerid": node, "topic": topic, "type": "*", "md5sum": "*", "message_definition": ""}
        if tcp_nodelay:
            request["tcp_nodelay"] = "1"
        self._request = encode_header(request)
        try:
            family, kind, proto, _, target = socket.getaddrinfo(address[0], address[1], type=socket.SOCK_STREAM)[0]
            self._socket = socket.socket(family, kind, proto)
        except OSError as error:
            raise ConnectionLost("cannot reach %s:%d: %s" % (address[0], address[1], error)) from error
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        if kernel_stamps:
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._receive = self._socket.recvmsg
        code = self._socket.connect_ex(target)
        if code not in (0, errno.EINPROGRESS):
            self.close()
            raise ConnectionLost("cannot reach %s:%d" % address)

    def fileno(self) -> int:
        """Return the file descriptor to poll."""
        return self._socket.fileno()

    def finish_connecting(self) -> None:
        """Send the request; to be called once when the socket has become writable."""
        code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise ConnectionLost("cannot reach %s: %s" % (self.publisher, os.strerror(code)))
        self.is_connecting = False
        try:
            taken = self._socket.send(self._request)
        except OSError as error:
            raise ConnectionLost("link to %s broke: %s" % (self.publisher, error)) from error
        if taken != len(self._request):
            raise ConnectionLost("%s takes no connection header" % self.publisher)

    def read(self, deliver: Deliver) -> None:
        """Take what has arrived; to be called when the socket is readable.

        Args:
            deliver: Called with each whole message.
        """
        size = _SMALL_READ
        if self._wanted > size:
            size = min(self._wanted - self._held, _LARGE_READ)
        try:
            data, control, _, _ = self._receive(size, _CONTROL_SIZE)
        except BlockingIOError:
            return
        except OSError as error:
            raise ConnectionLost("link to %s broke: %s" % (self.publisher, error)) from error
        if not data:
            raise ConnectionLost("%s closed the link" % self.publisher)
        if control:
            seconds, nanoseconds = _TIMESPEC.unpack(control[0][2])
            stamp = seconds * NS_PER_S + nanoseconds
        else:
            stamp = time.time_ns()
        if 0 < self._stamp - stamp < _CLOCK_STEP_NS:
            stamp = self._stamp
        self._stamp = stamp
        if not self._held and len(data) > 4 and self.connection is not None \
                and _LENGTH.unpack_from(data)[0] == len(data) - 4:
            deliver(self.tag, stamp, data[4:])
            return
        self._parts.append(data)
        self._held += len(data)
        if self._held >= self._wanted:
            self._cut(stamp, deliver)

    def _cut(self, stamp: int, deliver: Deliver) -> None:
        data = self._parts[0] if len(self._parts) == 1 else b"".join(self._parts)
        at = 0
        while True:
            if len(data) - at < 4:
                self._wanted = 4
                break
            length = _LENGTH.unpack_from(data, at)[0]
            if length > (_MAX_MESSAGE if self.connection is not None else _MAX_HEADER):
                raise ProtocolError("%s announces %d bytes: not TCPROS" % (self.publisher, length))
            self._wanted = 4 + length
            if len(data) - at < self._wanted:
                break
            body = data[at + 4:at + self._wanted]
            at += self._wanted
            if self.connection is None:
                self.connection = connection_of(self.topic, decode_header(body))
                self.tag = self._on_open(self)
            else:
                deliver(self.tag, stamp, body)
        self._parts = [data[at:]] if at < len(data) else []
        self._held = len(data) - at

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
