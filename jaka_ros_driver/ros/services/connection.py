"""One client's connection to a service, which never waits for the client: requests in, answers out."""
import contextlib
import logging
import select
import socket
import struct
from typing import Any, Callable, ContextManager, Dict

import rospy

from jaka_ros_driver.protocol.texts import printable
from jaka_ros_driver.ros.connections import SERVICE_CONNECTIONS

_LOG = logging.getLogger(__name__)

LONGEST_REQUEST = 1 << 20
"""Longest request, bytes, that is read."""
_PIECE = 1 << 16
"""Most bytes that are read at once."""
_LENGTH = struct.Struct("<I")


class UnreadableRequest(Exception):
    """The error that the bytes of a request are not those of its type."""


class ServiceConnection:
    """The connection of one client, as ``ServiceLoop`` serves it.

    Half a request is kept until the rest of it comes, and what the client does not read of an answer until it does; its
    next request is read only then.
    """

    def __init__(self, sock: socket.socket, header: Dict[str, Any], answer: Callable[[bytes], bytes],
                 calls: ContextManager[None]) -> None:
        """Set up the connection.

        Args:
            sock: From here on it does not block.
            header: The fields that the client has sent.
            answer: Carries out a request; takes its body and returns the whole answer. Raises UnreadableRequest.
            calls: The context in which a call counts as running.
        """
        sock.setblocking(False)
        self._sock = sock
        self._name = printable("%s: connection of %.200s" % (header["service"], header["callerid"]))
        self._is_persistent = header.get("persistent", "").lower() in ("1", "true")
        self._answer = answer
        self._calls = calls
        self._received = bytearray()
        self._unsent = memoryview(b"")
        self._is_over = False
        """No further request is read; the connection ends with the answer that is being sent."""
        self._pooled = SERVICE_CONNECTIONS.add(sock)

    def fileno(self) -> int:
        return self._sock.fileno()

    def close(self) -> None:
        """Close the connection, and count it no more."""
        SERVICE_CONNECTIONS.remove(self._pooled)
        with contextlib.suppress(OSError):  # the client has closed it already
            self._sock.shutdown(socket.SHUT_RDWR)
        self._sock.close()

    def serve(self) -> int:
        """Send the rest of an answer, or else read and carry out one request; return the epoll events to wait for
        next, 0 where the connection is to be closed.
        """
        try:
            if self._unsent:
                self._send()
            elif not self._has_request:
                self._read()
            if self._has_request and not self._unsent and not self._is_over:
                if rospy.is_shutdown():
                    return 0
                self._carry_out()
        except OSError as error:
            _LOG.debug("%s ended: %s", self._name, error)
            return 0
        except UnreadableRequest as error:
            _LOG.warning("%s is closed: %s", self._name, printable(str(error)))
            return 0
        if self._unsent:
            return select.EPOLLOUT
        if self._is_over:
            return 0
        # A further request that is here already takes its turn behind those of other connections: a socket that has
        # room for bytes is ready at once, and is put behind all that are ready now.
        return select.EPOLLOUT if self._has_request else select.EPOLLIN

    @property
    def _has_request(self) -> bool:
        """True where a whole request, or the length of one that is too long, has been read."""
        if len(self._received) < _LENGTH.size:
            return False
        length: int = _LENGTH.unpack_from(self._received)[0]
        return length > LONGEST_REQUEST or len(self._received) >= _LENGTH.size + length

    def _read(self) -> None:
        """Read what has come; raise OSError where the connection has ended."""
        try:
            piece = self._sock.recv(_PIECE)
        except BlockingIOError:
            return
        if not piece:
            raise ConnectionError("closed by the client")
        self._received += piece

    def _carry_out(self) -> None:
        """Carry out the first request that has been read, and send the answer."""
        length, = _LENGTH.unpack_from(self._received)
        if length > LONGEST_REQUEST:
            text = "a request has %d bytes; at most %d are read" % (length, LONGEST_REQUEST)
            _LOG.warning("%s is closed: %s", self._name, text)
            self._is_over = True
            self._unsent = memoryview(error_answer(text))
            self._send()
            return
        body = bytes(self._received[_LENGTH.size:_LENGTH.size + length])
        del self._received[:_LENGTH.size + length]
        self._is_over = not self._is_persistent
        self._pooled.begins()
        with self._calls:
            self._unsent = memoryview(self._answer(body))
            self._send()
        self._pooled.has_ended()

    def _send(self) -> None:
        """Send what the socket takes of the answer, and keep the rest."""
        try:
            self._unsent = self._unsent[self._sock.send(self._unsent):]
        except BlockingIOError:
            pass  # the client does not read


def error_answer(text: str) -> bytes:
    """Return the bytes that tell a client that its call has failed, and why."""
    said = printable(text).encode("utf-8")
    return b"\0" + _LENGTH.pack(len(said)) + said
