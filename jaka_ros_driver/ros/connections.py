"""Limits of the connections that this node serves; some are closed when there are too many. rospy itself has no limit.

The number of file descriptors of a process is limited. rospy gives one to every connection, also where the peer then
sends nothing. When none is left, its accepting thread ends for good, and nobody could stop the arm any more.
"""
import contextlib
import errno
import logging
import resource
import socket
import struct
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Tuple

import rosgraph
import rosgraph.network
import rosgraph.xmlrpc
import rospy
from rospy.impl import tcpros_base

from jaka_ros_driver.protocol.texts import printable

_LOG = logging.getLogger(__name__)

MOST_DESCRIPTORS = 65536
"""Soft limit of file descriptors that is set where the hard limit allows it."""
HANDSHAKE_TIMEOUT_S = 5.0
"""Longest handshake, s; a ROS client sends all of it at once."""
MOST_HANDSHAKES = 64
"""Most connections whose handshake is not complete; no cell has as many clients that start at the same time."""
MOST_CONNECTIONS = 2000
"""Most connections of each other kind; those of topics and of XML-RPC may have a thread each."""
_XMLRPC_TIMEOUT_S = 60.0
"""Idle time, s, after which an XML-RPC connection is closed; masters and nodes connect again by themselves."""
_LONGEST_HANDSHAKE = 1 << 20
"""Longest connection header, bytes, that is read: names and a message's definition take far less."""
_BACKLOG = 128
"""Connections that wait in the kernel to be accepted: all clients of a cell may come at once."""
_NO_ROOM = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_CLOSED = (errno.EBADF, errno.EINVAL, errno.ENOTSOCK)
_RETRY_PERIOD_S = 0.01
"""Pause, s, after an accept that failed: without it the loop would take the processor."""
_JUST_COME_S = 1.0
"""Age, s, up to which a connection is spared when descriptors run out (``_make_room``)."""
_LOG_PERIOD_S = 10.0
"""Shortest period, s, of the warning: a flood of connections must not flood the log."""
_BUSY = float("inf")


class PooledConnection:
    """One connection of a ConnectionPool.

    Attributes:
        idle_since: Monotonic time, s; infinite while a call of it runs.
    """

    __slots__ = ("sock", "idle_since")

    def __init__(self, sock: socket.socket, now: float) -> None:
        self.sock = sock
        self.idle_since = now

    def begins(self) -> None:
        """Mark the connection as busy: the request of a call has come."""
        self.idle_since = _BUSY

    def has_ended(self) -> None:
        """Mark the connection as idle: its call has its reply."""
        self.idle_since = time.monotonic()


class ConnectionPool:
    """The connections of one kind. When there are more than ``most``, the one that has been idle longest is ended.

    Here it is only shut down, which is an event for whoever reads it; that one closes it and calls ``remove``.
    """

    def __init__(self, what: str, most: int) -> None:
        """Set up an empty pool.

        what: Names the connections in the log.
        """
        self.most = most
        self._what = what
        self._lock = threading.RLock()
        self._connections: Dict[PooledConnection, None] = {}
        self._logged_at = -_BUSY

    def add(self, sock: socket.socket) -> PooledConnection:
        """Add a connection; where there are too many, older ones are ended."""
        connection = PooledConnection(sock, time.monotonic())
        with self._lock:
            too_many = len(self._connections) + 1 - self.most
            for _ in range(too_many):
                self.close_oldest()
            self._connections[connection] = None
        return connection

    def remove(self, connection: PooledConnection) -> None:
        with self._lock:
            self._connections.pop(connection, None)

    def close_oldest(self, least_idle: float = 0.0) -> bool:
        """End the connection that has been idle longest; return False where none has been idle for ``least_idle`` s."""
        now = time.monotonic()
        with self._lock:
            oldest = min(self._connections, key=lambda connection: connection.idle_since, default=None)
            if oldest is None or now - oldest.idle_since < least_idle:
                return False
            del self._connections[oldest]
        with contextlib.suppress(OSError):  # it has been closed meanwhile
            oldest.sock.shutdown(socket.SHUT_RDWR)
        if now - self._logged_at > _LOG_PERIOD_S:
            self._logged_at = now
            _LOG.warning("too many %s: those that have been idle longest are closed", self._what)
        return True


SERVICE_CONNECTIONS = ConnectionPool("service connections", MOST_CONNECTIONS)
_HANDSHAKES = ConnectionPool("connections that have not said what they want", MOST_HANDSHAKES)
_XMLRPC_CONNECTIONS = ConnectionPool("XML-RPC connections", MOST_CONNECTIONS)


class _TopicConnections:
    """Connections of topics; their idle time is not known, so a new one is refused when there are too many."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._lock = threading.Lock()
        self._sockets: List[socket.socket] = []

    def add(self, sock: socket.socket) -> bool:
        """Add a connection; return False where there are too many."""
        with self._lock:
            self._sockets = [other for other in self._sockets if other.fileno() != -1]
            if len(self._sockets) >= self.most:
                return False
            self._sockets.append(sock)
            return True


_TOPIC_CONNECTIONS = _TopicConnections(MOST_CONNECTIONS)


def serve_from_the_start() -> None:
    """Have every connection of this process make its handshake in a thread of its own; call once, before init_node.

    rospy makes one handshake after the other, in the thread that takes connections, so that a peer which connects and
    sends nothing would keep everybody out, also clients that want to stop the arm. Peers connect as soon as a node has
    its first topic.
    """
    tcpros_base.TCPROSServer._tcp_server_callback = _shake_hands_in_background


def keep_serving(service_handler: Callable[[socket.socket, Any, Dict[str, str]], Optional[str]]) -> None:
    """Bound the connections of this process; call once, after ``serve_from_the_start`` and init_node.

    Args:
        service_handler: Takes socket, address and connection header of a service client; returns why it is refused, or
            None.
    """
    _share_out(_raise_descriptor_limit())
    tcpros_base.start_tcpros_server()
    server = tcpros_base.init_tcpros_server()
    server.service_connection_handler = service_handler
    listener = server.tcp_ros_server
    listener.server_sock.listen(_BACKLOG)
    listener.server_sock = _AcceptingSocket(listener.server_sock)
    _prepare_xmlrpc()


def _raise_descriptor_limit() -> int:
    """Raise the soft limit of file descriptors towards the hard one; return the limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    soft, highest = (MOST_DESCRIPTORS if limit == resource.RLIM_INFINITY else limit for limit in (soft, hard))
    wanted = min(highest, MOST_DESCRIPTORS)
    if soft < wanted:
        try:
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            return wanted
        except (OSError, ValueError) as error:
            _LOG.warning("the limit of open files stays at %d: %s", soft, error)
    return soft


def _share_out(descriptors: int) -> None:
    """Divide the descriptors among the kinds; about a quarter is left for the controller, the log and other files."""
    SERVICE_CONNECTIONS.most = min(MOST_CONNECTIONS, descriptors // 2)
    _HANDSHAKES.most = min(MOST_HANDSHAKES, descriptors // 16)
    _XMLRPC_CONNECTIONS.most = min(MOST_CONNECTIONS, descriptors // 16)
    _TOPIC_CONNECTIONS.most = min(MOST_CONNECTIONS, descriptors // 8)


def _make_room() -> None:
    """End one connection, of the kind whose loss matters least; whoever reads it then frees the descriptor.

    New connections are spared: the next connection would take the descriptor, and nothing would be gained.
    """
    for pool in (_HANDSHAKES, _XMLRPC_CONNECTIONS, SERVICE_CONNECTIONS):
        if pool.close_oldest(_JUST_COME_S):
            break
    time.sleep(_RETRY_PERIOD_S)


class _AcceptingSocket:
    """The listening socket of rospy's TCPServer; its ``accept`` raises only when the socket was closed."""

    def __init__(self, sock: socket.socket) -> None:
        self._sock = sock

    def __getattr__(self, name: str) -> Any:
        return getattr(self._sock, name)

    def accept(self) -> Tuple[socket.socket, Any]:
        """Return the next connection."""
        while True:
            try:
                return self._sock.accept()
            except OSError as error:
                if error.errno in _CLOSED:
                    raise
                if error.errno in _NO_ROOM:
                    _make_room()
                else:  # an error of this peer or the network: try again, see accept(2)
                    time.sleep(_RETRY_PERIOD_S)


def _shake_hands_in_background(server: tcpros_base.TCPROSServer, sock: socket.socket, address: Any) -> None:
    connection = _HANDSHAKES.add(sock)
    try:
        threading.Thread(target=_shake_hands, args=(server, connection, address), name="handshake", daemon=True).start()
    except RuntimeError:  # no more threads: the accepting thread must not end
        _HANDSHAKES.remove(connection)
        sock.close()
        _make_room()


def _shake_hands(server: tcpros_base.TCPROSServer, connection: PooledConnection, address: Any) -> None:
    """Handle a new connection as rospy's TCPROSServer does, but wait for the peer for a limited time only."""
    sock = connection.sock
    try:
        header = _read_handshake(sock, time.monotonic() + HANDSHAKE_TIMEOUT_S)
    except (OSError, ValueError, struct.error, rosgraph.network.ROSHandshakeException) as error:
        _LOG.debug("connection of %s ended before it said what it wants: %s", address, error)
        sock.close()
        return
    finally:
        _HANDSHAKES.remove(connection)
    try:
        refusal: Optional[str]
        if "topic" in header and not _TOPIC_CONNECTIONS.add(sock):
            refusal = "this node has %d subscribers, and room for no more" % _TOPIC_CONNECTIONS.most
        elif "topic" in header:
            refusal = server.topic_connection_handler(sock, address, header)
        elif "service" in header:
            refusal = server.service_connection_handler(sock, address, header)
        else:
            refusal = "no topic or service name detected"
        if refusal:
            _LOG.warning("connection of %s refused: %s", printable(header.get("callerid", str(address))),
                         printable(refusal))
            rosgraph.network.write_ros_handshake_header(
                sock, {"error": "node shutting down" if rospy.core.is_shutdown_requested() else refusal})
            sock.close()
    except Exception as error:  # whatever goes wrong ends this connection and nothing else
        if not rospy.core.is_shutdown_requested():
            _LOG.warning("connection of %s failed: %s", address, printable(str(error)))
        sock.close()


def _read_handshake(sock: socket.socket, deadline: float) -> Dict[str, str]:
    """Read the connection header and no byte more: a first request may follow at once."""
    size_bytes = _read_exactly(sock, 4, deadline)
    size, = struct.unpack("<I", size_bytes)
    if size > _LONGEST_HANDSHAKE:
        raise ValueError("a handshake of %d bytes" % size)
    header: Dict[str, str] = rosgraph.network.decode_ros_handshake_header(
        size_bytes + _read_exactly(sock, size, deadline))
    sock.settimeout(None)
    return header


def _read_exactly(sock: socket.socket, count: int, deadline: float) -> bytes:
    data = b""
    while len(data) < count:
        remaining = deadline - time.monotonic()
        if remaining <= 0.0:
            raise socket.timeout("no handshake in time")
        sock.settimeout(remaining)
        piece = sock.recv(count - len(data))
        if not piece:
            raise ConnectionError("closed by the peer")
        data += piece
    return data


def _prepare_xmlrpc() -> None:
    """Bound the connections of the node's XML-RPC port, each of which takes a descriptor and a thread, too."""
    server = rosgraph.xmlrpc.ThreadingXMLRPCServer
    rosgraph.xmlrpc.SilenceableXMLRPCRequestHandler.timeout = _XMLRPC_TIMEOUT_S
    accept, process, close = server.get_request, server.process_request, server.shutdown_request
    connections: Dict[Any, PooledConnection] = {}

    def get_request(self: Any) -> Any:
        try:
            return accept(self)
        except OSError as error:
            if error.errno in _NO_ROOM:
                _make_room()
            raise

    def process_request(self: Any, request: Any, client_address: Any) -> None:
        connections[request] = _XMLRPC_CONNECTIONS.add(request)
        process(self, request, client_address)

    def shutdown_request(self: Any, request: Any) -> None:
        connection = connections.pop(request, None)
        if connection is not None:
            _XMLRPC_CONNECTIONS.remove(connection)
        close(self, request)

    # rospy keeps no reference to the running server, so that the methods of its class are replaced.
    server.get_request = get_request  # type: ignore[method-assign]
    server.process_request = process_request  # type: ignore[method-assign]
    server.shutdown_request = shutdown_request  # type: ignore[method-assign]
