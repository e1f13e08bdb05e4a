"""The guard's two connections to the controller: one sends stops, the other shows whether the arm is at rest.

Neither ever waits, because the guard has one thread, which also answers the driver.
"""
import errno
import os
import socket
from typing import Any, List, Tuple

from jaka_ros_driver.errors import ConnectionLost, FramingError, StatusFrameError
from jaka_ros_driver.protocol.framing import FrameStream, Item, ObjectStream
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.state import RobotState

Address = Tuple[int, Any]
"""Family and address of a socket."""

_RECEIVE_BYTES = 1 << 16
_TURNED_AWAY = (errno.ECONNREFUSED, errno.ECONNRESET, errno.ECONNABORTED, errno.EPIPE)


class TurnedAway(ConnectionLost):
    """The controller is reachable but refuses, closes or resets the connection."""


def addresses_of(host: str, port: int) -> List[Address]:
    """The addresses of a host name, for a connection; raises ConnectionLost where it cannot be resolved."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except OSError as error:
        raise ConnectionLost("%s cannot be resolved: %s" % (host, error)) from error
    return [(family, address) for family, _, _, _, address in found]


class Line:
    """One non-blocking TCP connection.

    Attributes:
        is_connecting: It is neither connected nor refused yet; it becomes writable when that is decided.
    """

    def __init__(self, address: Address, name: str) -> None:
        """Begin to connect; raises ConnectionLost where that is not possible."""
        self._name = name
        self.is_connecting = True
        try:
            self._socket = socket.socket(address[0], socket.SOCK_STREAM)
        except OSError as error:
            raise ConnectionLost("%s: %s" % (name, error)) from error
        try:
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            code = self._socket.connect_ex(address[1])
            if code not in (0, errno.EINPROGRESS):
                raise OSError(code, os.strerror(code))
        except OSError as error:
            self.close()
            raise self._lost(error) from error

    def fileno(self) -> int:
        """The descriptor, for ``select``."""
        return self._socket.fileno()

    def finish_connecting(self) -> None:
        """Call it when a connecting line is writable; raises ConnectionLost where it is not connected."""
        code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise self._lost(OSError(code, os.strerror(code)))
        self.is_connecting = False

    def send(self, data: bytes) -> None:
        """Send a few bytes; raises ConnectionLost where the network does not take them."""
        try:
            taken = self._socket.send(data)
        except OSError as error:
            raise self._lost(error) from error
        if taken < len(data):
            raise ConnectionLost("%s: the network takes no bytes" % self._name)

    def receive(self) -> bytes:
        """The bytes that have arrived, empty for none; raises ConnectionLost where the connection has ended."""
        try:
            data = self._socket.recv(_RECEIVE_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._lost(error) from error
        if not data:
            raise TurnedAway("%s: closed by the controller" % self._name)
        return data

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _lost(self, error: OSError) -> ConnectionLost:
        kind = TurnedAway if error.errno in _TURNED_AWAY else ConnectionLost
        return kind("%s: %s" % (self._name, error.strerror or error))


class StopLink(Line):
    """A connection to the command port."""

    def __init__(self, address: Address) -> None:
        super().__init__(address, "command port")
        self._stream = ObjectStream()

    def replies(self) -> List[Item]:
        """The replies that have arrived, with an error for what cannot be read; raises as ``receive``."""
        return self._stream.feed(self.receive())


class FeedLink(Line):
    """A connection to the status port.

    Attributes:
        trouble: Why the newest frame could not be read; empty where it could.
    """

    def __init__(self, address: Address) -> None:
        super().__init__(address, "status port")
        self._stream = FrameStream()
        self.trouble = "status port: no frame has come"

    def states(self, now: float) -> List[RobotState]:
        """The states that have arrived, without frames that cannot be read; raises as ``receive``."""
        states: List[RobotState] = []
        for item in self._stream.feed(self.receive()):
            try:
                if isinstance(item, FramingError):
                    raise item
                states.append(parse_status(item, now))
                self.trouble = ""
            except (FramingError, StatusFrameError) as error:
                self.trouble = str(error)
        return states
