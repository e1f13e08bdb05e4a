"""A connection to a driver's stop service on which every wait has a limit: rospy's connections have none."""
import socket
import struct
import time
from typing import Optional, Tuple

from std_srvs.srv import Empty

from jaka_bag.live.tcpros import encode_header

_LENGTH = struct.Struct("<I")
_LONGEST = 1 << 20
"""Longest answer, byte, of a stop; with more the link is no driver's."""
Address = Tuple[str, int]


class StopLink:
    """A TCPROS connection to a service of the type std_srvs/Empty, made when it is needed, and kept."""

    def __init__(self, node: str, service: str) -> None:
        """Prepare calls of ``service`` by the node ``node``."""
        self._header = encode_header({"callerid": node, "service": service, "md5sum": Empty._md5sum, "persistent": "1"})
        self._socket: Optional[socket.socket] = None

    def call(self, address: Address, until: float) -> None:
        """Call the service at a numeric address; raise OSError where it has not answered by ``until``, monotonic, s."""
        try:
            if self._socket is None:
                self._socket = socket.create_connection(address, _left(until))
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._socket.sendall(self._header)
                self._block(until)
            self._socket.sendall(_LENGTH.pack(0))
            is_served = self._receive(1, until) == b"\1"
            text = self._block(until)
        except socket.timeout as error:
            self.close()
            raise OSError("no answer in time") from error
        except OSError:
            self.close()
            raise
        if not is_served:
            raise OSError(text.decode("utf-8", "replace"))

    def close(self) -> None:
        """Close the connection; the next call makes another one."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _block(self, until: float) -> bytes:
        (length,) = _LENGTH.unpack(self._receive(4, until))
        if length > _LONGEST:
            raise ConnectionError("no answer of a service")
        return self._receive(length, until)

    def _receive(self, count: int, until: float) -> bytes:
        assert self._socket is not None
        data = b""
        while len(data) < count:
            self._socket.settimeout(_left(until))
            more = self._socket.recv(count - len(data))
            if not more:
                raise ConnectionError("the driver has closed the connection")
            data += more
        return data


def _left(until: float) -> float:
    left = until - time.monotonic()
    if left <= 0.0:
        raise socket.timeout
    return left
