"""Publishers that write to their listeners at once, in the publishing thread.

rospy has a thread for each listener, and hands it each message. With many listeners these threads take most of the
processor, and a stop waits for them. Here a message goes to the socket without waiting; what a listener does not take
in time is sent by a thread, which ends when that listener has caught up.
"""
import functools
import select
import threading
from collections import deque
from typing import Any, Deque, Type, TypeVar

import genpy
import rospy
from rospy.exceptions import TransportTerminated
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.topics import _PublisherImpl

_Message = TypeVar("_Message", bound=genpy.Message)
_LONGEST_WAIT_MS = 500
"""Longest wait of a sending thread for its listener, ms, before it looks whether the connection was closed."""


def direct_publisher(name: str, message_type: Type[_Message], queue_size: int,
                     latch: bool = False) -> "rospy.Publisher[_Message]":
    """Return a publisher whose ``publish`` writes to the listeners and never waits for them.

    Args:
        name: Of the topic.
        message_type: Of its messages.
        queue_size: Most whole messages that wait for one listener; then the oldest is dropped.
        latch: A new listener is sent the last message.
    """
    publisher = rospy.Publisher(name, message_type, queue_size=queue_size, latch=latch, tcp_nodelay=True)
    impl = publisher.impl
    # From here on the connections have their own queues; one that came before keeps the queue that rospy gave it.
    impl.queue_size = None
    impl.add_connection = functools.partial(_add_directly, impl, queue_size)  # type: ignore[method-assign]
    # Asked for every frame; rospy's own waits for whoever adds or removes a listener. The list is only ever replaced.
    publisher.get_num_connections = lambda: len(impl.connections or ())  # type: ignore[method-assign]
    with impl.c_lock:  # rospy sets its queue after the topic is known: until then, a listener would be waited for
        impl.connections = [DirectConnection(connection, queue_size) if isinstance(connection, TCPROSTransport)
                            else connection for connection in impl.connections]
    return publisher


def _add_directly(impl: _PublisherImpl, queue_size: int, transport: TCPROSTransport) -> bool:
    return _PublisherImpl.add_connection(impl, DirectConnection(transport, queue_size))


class DirectConnection:
    """The connection to one listener, in the place of rospy's QueuedConnection."""

    def __init__(self, transport: TCPROSTransport, queue_size: int) -> None:
        """Set up the connection.

        Args:
            transport: Its socket, and its counts for the bus statistics.
            queue_size: Most messages that wait; then the oldest is dropped.
        """
        self._transport = transport
        if transport.socket is not None:
            # A socket with a time limit waits in spite of MSG_DONTWAIT, and rospy sets one for all of its process.
            transport.socket.setblocking(False)
        self._lock = threading.Lock()
        self._unsent = b""
        """The rest of the message that is being sent; the listener needs it before any other."""
        self._waiting: Deque[bytes] = deque(maxlen=queue_size)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._transport, name)

    def write_data(self, data: bytes) -> bool:
        """Send a message as far as the listener takes it now; the rest waits.

        Raises:
            TransportTerminated: The connection is closed.
        """
        with self._lock:
            if self._unsent and self._transport.socket is not None:
                self._waiting.append(data)
                return True
            self._send(data)
            if self._unsent:
                threading.Thread(target=self._catch_up, name="slow listener", daemon=True).start()
        return True

    def _send(self, data: bytes) -> None:
        """Send what the socket takes without waiting; keep the rest."""
        sock = self._transport.socket
        if sock is None:
            raise TransportTerminated("connection closed")
        try:
            sent = sock.send(data)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            raise TransportTerminated(str(error)) from error
        self._transport.stat_bytes += sent
        self._unsent = data[sent:]
        if not self._unsent:
            self._transport.stat_num_msg += 1

    def _catch_up(self) -> None:
        """Send what waits, until nothing does or the connection is closed."""
        try:
            while self._wait_for_room():
                with self._lock:
                    self._send(self._unsent)
                    if not self._unsent:
                        if not self._waiting:
                            return
                        self._unsent = self._waiting.popleft()
        except TransportTerminated:
            self._transport.close()

    def _wait_for_room(self) -> bool:
        """Wait until the listener takes something; return False where the connection was closed."""
        while True:
            sock = self._transport.socket
            descriptor = -1 if sock is None else sock.fileno()
            if descriptor < 0:
                return False
            poller = select.poll()
            poller.register(descriptor, select.POLLOUT)
            if poller.poll(_LONGEST_WAIT_MS):
                return True
