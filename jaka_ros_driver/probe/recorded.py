"""Connections whose every byte is kept, and the wire log that they become when the probe is over.

The log is written at the end, because what names an arm is made unreadable in it first, and may lie across two pieces.
"""
import contextlib
import re
import select
import socket
import time
from typing import List, NamedTuple, Sequence

from jaka_ros_driver.wire.log import WireLog

CONNECT_S = 3.0
"""Longest wait, s, for a connection, and to send and read on it: nothing answers at a wrong address."""
MAX_KEPT_BYTES = 1 << 26
"""Bytes that are kept for the log: half a minute of the longest frames known, every 8 ms. What comes later is used and
not kept.
"""
_RECEIVE_BYTES = 1 << 16
"""Bytes read at a time: seven of the longest frames."""
_NAMING = re.compile(rb'"[^"]*(?:serial|robot_id|robot_name|_sn|mac_addr)[^"]*"\s*:\s*'
                     rb'(?:"((?:[^"\\]|\\.)*)"|(-?[\d.]+))', re.IGNORECASE)
"""A field of JSON whose value names one arm."""


class KeptPiece(NamedTuple):
    """Bytes as they were sent or received; ``time_ns`` is the host's monotonic clock."""

    time_ns: int
    is_sent: bool
    data: bytes


class KeptConnection:
    """A TCP connection to one of the controller's ports.

    Attributes:
        port: "command", "status" or "poll".
        is_closed: The controller has closed it.
        pieces: What went over it, oldest first.
    """

    def __init__(self, record: "ConnectionLog", port: str, connected: socket.socket) -> None:
        self._record = record
        self._socket = connected
        self.port = port
        self.is_closed = False
        self.opened_ns = time.monotonic_ns()
        self.closed_ns = 0
        self.pieces: List[KeptPiece] = []

    def fileno(self) -> int:
        """Return the descriptor, for ``select``."""
        return self._socket.fileno()

    def send(self, data: bytes) -> bool:
        """Send these bytes; return False where the controller takes nothing."""
        try:
            self._socket.settimeout(CONNECT_S)
            self._socket.sendall(data)
        except OSError:
            self.is_closed = True
            return False
        self._keep(True, data)
        return True

    def receive(self, deadline: float) -> bytes:
        """Return what has come by a moment of ``time.monotonic``; empty where nothing has, or it is closed."""
        while not self.is_closed:
            ready, _, _ = select.select([self._socket], [], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                return b""
            return self.receive_now()
        return b""

    def receive_now(self) -> bytes:
        """Return what ``select`` has said is there; empty where the controller has closed it."""
        try:
            self._socket.settimeout(CONNECT_S)
            data = self._socket.recv(_RECEIVE_BYTES)
        except OSError:
            data = b""
        self.is_closed = not data
        if data:
            self._keep(False, data)
        return data

    def close(self) -> None:
        """Close it from this side."""
        if not self.closed_ns:
            self.closed_ns = time.monotonic_ns()
            with contextlib.suppress(OSError):
                self._socket.close()

    def _keep(self, is_sent: bool, data: bytes) -> None:
        if self._record.has_room(len(data)):
            self.pieces.append(KeptPiece(time.monotonic_ns(), is_sent, data))


class ConnectionLog:
    """All connections of a probe.

    Attributes:
        left_out: Bytes that were not kept.
    """

    def __init__(self, host: str) -> None:
        self._host = host
        self._connections: List[KeptConnection] = []
        self._kept = 0
        self.left_out = 0

    def connect(self, port: str, number: int) -> KeptConnection:
        """Connect a port; raise OSError where nobody answers."""
        try:
            connected = socket.create_connection((self._host, number), CONNECT_S)
        except UnicodeError as error:
            raise OSError("%s is no address: %s" % (self._host, error)) from error
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection = KeptConnection(self, port, connected)
        self._connections.append(connection)
        return connection

    def has_room(self, size: int) -> bool:
        """Count bytes that are to be kept; False where that would be too many."""
        if self._kept + size > MAX_KEPT_BYTES:
            self.left_out += size
            return False
        self._kept += size
        return True

    def close(self) -> None:
        """Close all connections."""
        for connection in self._connections:
            connection.close()

    def write(self, path: str, keep_identity: bool) -> None:
        """Write the wire log; without identity, what names the arm is x in it, and its address is none.

        Raises:
            WireLogError: It cannot be written.
        """
        log = WireLog(path)
        try:
            for number, connection in enumerate(self._connections, 1):
                peer = self._host if keep_identity else "controller"
                log.event(connection.opened_ns, connection.port, number, "open", peer)
                pieces = connection.pieces if keep_identity else without_identity(connection.pieces, self._host)
                for piece in pieces:
                    note = log.bytes_out if piece.is_sent else log.bytes_in
                    note(piece.time_ns, connection.port, number, piece.data)
                log.event(connection.closed_ns or time.monotonic_ns(), connection.port, number, "close", peer)
        finally:
            log.close()


def without_identity(pieces: Sequence[KeptPiece], host: str = "") -> List[KeptPiece]:
    """Return the same pieces, as long as before, with x for what names the arm in what the controller sent."""
    received = hidden(b"".join(piece.data for piece in pieces if not piece.is_sent), host)
    result, place = [], 0
    for piece in pieces:
        if not piece.is_sent:
            piece = piece._replace(data=received[place:place + len(piece.data)])
            place += len(piece.data)
        result.append(piece)
    return result


def hidden(text: bytes, host: str = "") -> bytes:
    """Return a text of the same length with x for what names the arm, 0 where that is a number, and for its address."""
    def unreadable(match: "re.Match[bytes]") -> bytes:
        group = 1 if match.group(1) is not None else 2
        start, end = (place - match.start() for place in match.span(group))
        whole = match.group(0)
        return whole[:start] + (b"x" if group == 1 else b"0") * (end - start) + whole[end:]
    text = _NAMING.sub(unreadable, text)
    return text.replace(host.encode("utf-8"), b"x" * len(host.encode("utf-8"))) if host else text


def quantile(values: Sequence[float], share: float) -> float:
    """Return the value below which this share of them lies; of nothing 0."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else 0.0
