"""The two non-blocking TCP connections of driver or guard to the controller, and one wait for both."""
import contextlib
import errno
import ipaddress
import itertools
import math
import os
import select
import socket
import threading
import time
from collections import deque
from typing import Deque, Dict, List, NamedTuple, Tuple, Union

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.protocol.ports import endpoint

_RECEIVE_BYTES = 1 << 16
"""Bytes of one read, more than any status frame has; a shorter read shows that nothing else waits."""
_READS_A_TURN = 8
"""Most reads of a port in one turn: a flood on one port does not keep the other waiting."""
_MAX_UNSENT_BYTES = 1 << 20
"""Most bytes that wait to be sent: a controller that leaves so many unread reads no more, and its port is closed."""
_TURNED_AWAY = (errno.ECONNREFUSED, errno.ECONNRESET, errno.ECONNABORTED, errno.EPIPE)


class Opened(NamedTuple):
    """The event that the port is connected."""

    port: Port


class Failed(NamedTuple):
    """The event that the port could not be connected; ``is_turned_away``: the controller is reachable and refused."""

    port: Port
    reason: str
    is_turned_away: bool


class Closed(NamedTuple):
    """The event that the connection has ended; ``is_turned_away``: the controller has closed or reset it."""

    port: Port
    reason: str
    is_turned_away: bool


class Received(NamedTuple):
    """The event that bytes have arrived."""

    port: Port
    data: bytes


TransportEvent = Union[Opened, Failed, Closed, Received]


class _PortSocket:
    def __init__(self, port: Port, sock: socket.socket, deadline: float) -> None:
        self.port = port
        self.socket = sock
        self.deadline = deadline
        self.is_open = False
        self.waits_for_room = False
        self.unsent = bytearray()


class Transport:
    """The connections to the controller, at most one to each port.

    ``wait`` and ``read`` are for one thread; the other methods are called with its lock held. Only ``wait`` blocks. A
    host name is resolved in a thread of its own, because that may take long.
    """

    def __init__(self, host: str, ports: Dict[Port, int], connect_timeout: float, acknowledge_timeout: float) -> None:
        """Prepare; ``open`` connects.

        Args:
            host: Name or address of the controller.
            ports: TCP.
            connect_timeout: Longest wait to connect, s.
            acknowledge_timeout: Longest time in which what was sent stays unacknowledged by the controller's host, s.
                Then the connection has ended (TCP_USER_TIMEOUT, tcp(7)): a reply may be held back for long, but an
                acknowledgement is not, so that its absence tells a dead connection from a slow controller.
        """
        self._host = host
        self._ports = ports
        self._connect_timeout = connect_timeout
        self._acknowledge_timeout_ms = max(1, math.ceil(1000.0 * acknowledge_timeout))
        self._epoll = select.epoll()  # made first, because select() takes only low descriptors
        self._wake_receive, self._wake_send = socket.socketpair()
        self._wake_receive.setblocking(False)
        self._wake_send.setblocking(False)
        self._epoll.register(self._wake_receive.fileno(), select.EPOLLIN)
        self._connections: Dict[Port, _PortSocket] = {}
        self._by_descriptor: Dict[int, _PortSocket] = {}
        self._events: Deque[TransportEvent] = deque()
        self._resolved: Deque[Tuple[Port, int, Union[str, OSError]]] = deque()
        self._tries: Dict[Port, int] = {}
        self._numbers = itertools.count()

    def fileno(self) -> int:
        """Return a descriptor for ``select``: readable when ``read`` has something to do."""
        return self._epoll.fileno()

    def open(self, port: Port, address: str = "") -> None:
        """Begin to connect; ``read`` returns the result.

        address: One of the host's, where it is known already.
        """
        self._tries[port] = next(self._numbers)
        try:
            ipaddress.ip_address(address or self._host)
        except ValueError:
            threading.Thread(target=self._resolve, args=(port, self._tries[port]), name="resolver",
                             daemon=True).start()
        else:
            self._connect(port, address or self._host)

    def close(self, port: Port) -> None:
        """Close the connection or end the attempt to connect; ``read`` returns no further event of it."""
        self._tries[port] = next(self._numbers)
        connection = self._connections.pop(port, None)
        if connection is not None:
            self._forget(connection)
        self._events = deque(event for event in self._events if event.port is not port)

    def send(self, data: bytes) -> None:
        """Send bytes on the command port; what the network does not take at once is sent later."""
        connection = self._connections.get(Port.COMMAND)
        if connection is None or not connection.is_open:
            return
        connection.unsent += data
        if len(connection.unsent) == len(data):
            self._flush(connection)
        elif len(connection.unsent) > _MAX_UNSENT_BYTES:
            self._end(connection, "%s: the controller does not read" % connection.port.value)

    def wake(self) -> None:
        """End ``wait`` now; from any thread."""
        with contextlib.suppress(OSError):
            self._wake_send.send(b"\0")

    def wait(self, seconds: float) -> None:
        """Wait until something happens. epoll counts in whole ms; select on its descriptor is exact."""
        select.select([self._epoll], [], [], max(0.0, seconds))

    def read(self) -> List[TransportEvent]:
        """Return the events since the last call, in order."""
        for descriptor, mask in self._epoll.poll(0):
            connection = self._by_descriptor.get(descriptor)
            if connection is None:
                with contextlib.suppress(OSError):
                    self._wake_receive.recv(_RECEIVE_BYTES)
            elif not connection.is_open:
                self._connected(connection)
            else:
                if mask & select.EPOLLOUT:
                    self._flush(connection)
                if mask & ~select.EPOLLOUT:
                    self._receive(connection)
        while self._resolved:
            self._take_address(*self._resolved.popleft())
        now = time.monotonic()
        for connection in [one for one in self._connections.values() if not one.is_open and now > one.deadline]:
            self._fail(connection.port, "timed out")
        events = list(self._events)
        self._events.clear()
        return events

    def shut(self) -> None:
        """Close everything."""
        for port in list(self._connections):
            self.close(port)
        self._epoll.close()
        self._wake_receive.close()
        self._wake_send.close()

    # ---- inside ----

    def _resolve(self, port: Port, number: int) -> None:
        try:
            found: Union[str, OSError] = addresses_of(self._host)[0]
        except OSError as error:
            found = error
        self._resolved.append((port, number, found))
        self.wake()

    def _take_address(self, port: Port, number: int, found: Union[str, OSError]) -> None:
        if number != self._tries.get(port):
            return
        if isinstance(found, OSError):
            self._fail(port, str(found))
        else:
            self._connect(port, found)

    def _connect(self, port: Port, address: str) -> None:
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        try:
            sock = socket.socket(family, socket.SOCK_STREAM)
        except OSError as error:
            self._fail(port, str(error))
            return
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, True)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, True)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, self._acknowledge_timeout_ms)
        connection = _PortSocket(port, sock, time.monotonic() + self._connect_timeout)
        self._connections[port] = connection
        self._by_descriptor[sock.fileno()] = connection
        code = sock.connect_ex((address, self._ports[port]))
        if code not in (0, errno.EINPROGRESS):
            self._fail(port, os.strerror(code), code in _TURNED_AWAY)
            return
        self._epoll.register(sock.fileno(), select.EPOLLOUT)

    def _connected(self, connection: _PortSocket) -> None:
        code = connection.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            self._fail(connection.port, os.strerror(code), code in _TURNED_AWAY)
            return
        connection.is_open = True
        self._epoll.modify(connection.socket.fileno(), select.EPOLLIN)
        self._events.append(Opened(connection.port))

    def _receive(self, connection: _PortSocket) -> None:
        """Receive all bytes in one piece: only the last of several waiting status frames is current."""
        pieces: List[bytes] = []
        reason, is_turned_away = "", False
        for _ in range(_READS_A_TURN):
            try:
                data = connection.socket.recv(_RECEIVE_BYTES)
            except BlockingIOError:
                break
            except OSError as error:
                reason, is_turned_away = "%s: %s" % (connection.port.value, error), error.errno in _TURNED_AWAY
                break
            if not data:
                reason, is_turned_away = "%s: closed by the controller" % connection.port.value, True
                break
            pieces.append(data)
            if len(data) < _RECEIVE_BYTES:
                break
        if pieces:
            self._events.append(Received(connection.port, b"".join(pieces)))
        if reason:
            self._end(connection, reason, is_turned_away)

    def _flush(self, connection: _PortSocket) -> None:
        try:
            while connection.unsent:
                del connection.unsent[:connection.socket.send(connection.unsent)]
        except BlockingIOError:
            pass
        except OSError as error:
            self._end(connection, "%s: sending failed: %s" % (connection.port.value, error),
                      error.errno in _TURNED_AWAY)
            return
        if bool(connection.unsent) is not connection.waits_for_room:
            connection.waits_for_room = bool(connection.unsent)
            self._epoll.modify(connection.socket.fileno(),
                               select.EPOLLIN | (select.EPOLLOUT if connection.unsent else 0))

    def _fail(self, port: Port, why: str, is_turned_away: bool = False) -> None:
        connection = self._connections.pop(port, None)
        if connection is not None:
            self._forget(connection)
        self._put(Failed(port, "%s: cannot connect to %s: %s" % (
            port.value, endpoint(self._host, self._ports[port]), why), is_turned_away))

    def _end(self, connection: _PortSocket, reason: str, is_turned_away: bool = False) -> None:
        if self._connections.get(connection.port) is connection:
            del self._connections[connection.port]
            self._forget(connection)
            self._put(Closed(connection.port, reason, is_turned_away))

    def _put(self, event: TransportEvent) -> None:
        self._events.append(event)
        self.wake()

    def _forget(self, connection: _PortSocket) -> None:
        descriptor = connection.socket.fileno()
        self._by_descriptor.pop(descriptor, None)
        with contextlib.suppress(OSError):
            self._epoll.unregister(descriptor)
        connection.socket.close()


def addresses_of(host: str) -> List[str]:
    """Return the addresses of a host, those of IPv4 first; raise OSError where its name cannot be resolved."""
    found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    return [str(entry[4][0]) for entry in sorted(found, key=lambda entry: entry[0] is not socket.AF_INET)]
