"""A service without request fields, ``std_srvs/Trigger``, offered without rospy.

After the ROS wiki pages "ROS/TCPROS", "ROS/Connection Header" and "ROS/Master_API".
"""
import contextlib
import os
import socket
import struct
import threading
from typing import Callable, Dict, Tuple

from jaka_bag.errors import ConnectionLost, JakaBagError, ProtocolError
from jaka_bag.live.graph import RemoteNode, master_uri
from jaka_bag.live.names import host_address
from jaka_bag.live.tcpros import decode_header, encode_header

TYPE = "std_srvs/Trigger"
MD5SUM = "937c9679a518e3a18d831e57125ea522"
"""MD5 sum of ``std_srvs/Trigger`` (``rosservice``, std_srvs 1.11)."""
_LENGTH = struct.Struct("<I")
_MAX_HEADER = 1 << 16
"""Longest header, byte, of a caller: a service's names and checksum, no definition."""
_PATIENCE_S = 30.0
"""Longest silence, s, of a caller: one that hangs keeps a thread and a connection so long."""
MOST_CONNECTIONS = 16
"""Most connections at a time, each with a thread; one that is too many is closed at once."""
_REFUSED_PAUSE_S = 0.1
"""Pause, s, after the system has refused a connection: descriptors run out and come free again."""


class TriggerService:
    """A service server with a thread for each call. Call ``register`` repeatedly: the master may restart.

    Args:
        name: Global name of the service.
        node: Global name of the offering node.
        node_uri: XMLRPC URI of that node.
        answer: Performs a call; returns success and message.
    """

    def __init__(self, name: str, node: str, node_uri: str, answer: Callable[[], Tuple[bool, str]]) -> None:
        self._name = name
        self._node = node
        self._node_uri = node_uri
        self._answer = answer
        self._is_closing = threading.Event()
        self._places = threading.BoundedSemaphore(MOST_CONNECTIONS)
        host, bind = host_address(os.environ)
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.settimeout(None)  # whatever new sockets have in this process
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._listener.bind((bind, 0))
        self._listener.listen(16)
        self.uri = "rosrpc://%s:%d" % (host, self._listener.getsockname()[1])
        self._thread = threading.Thread(target=self._accept, name="trigger-service", daemon=True)
        self._thread.start()

    def register(self) -> None:
        """Register the service with the master unless it is registered; do nothing where the master does not answer."""
        try:
            with RemoteNode(master_uri(), self._node) as master:
                try:
                    if master.call("lookupService", self._name) == self.uri:
                        return
                except ProtocolError:  # it does not know the service
                    pass
                master.call("registerService", self._name, self.uri, self._node_uri)
        except JakaBagError:
            return

    def close(self) -> None:
        """Withdraw the service."""
        with contextlib.suppress(JakaBagError), RemoteNode(master_uri(), self._node) as master:
            master.call("unregisterService", self._name, self.uri)
        self._is_closing.set()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join()

    def _accept(self) -> None:
        while True:
            try:
                link, _ = self._listener.accept()
            except OSError:
                if self._is_closing.wait(_REFUSED_PAUSE_S):
                    return
                continue
            if not self._places.acquire(blocking=False):
                link.close()
                continue
            try:
                threading.Thread(target=self._serve, args=(link,), name="trigger-call", daemon=True).start()
            except RuntimeError:  # the system gives no thread now
                link.close()
                self._places.release()

    def _serve(self, link: socket.socket) -> None:
        try:
            self._talk(link)
        finally:
            self._places.release()

    def _talk(self, link: socket.socket) -> None:
        with contextlib.suppress(OSError, JakaBagError), link:
            link.settimeout(_PATIENCE_S)
            fields = decode_header(self._block(link, _MAX_HEADER))
            error = self._refusal(fields)
            if error:
                link.sendall(encode_header({"error": error}))
                return
            link.sendall(encode_header({
                "callerid": self._node, "md5sum": MD5SUM, "service": self._name, "type": TYPE,
                "request_type": TYPE + "Request", "response_type": TYPE + "Response"}))
            if fields.get("probe") == "1":
                return
            is_persistent = fields.get("persistent", "").lower() in ("1", "true")
            while True:
                link.settimeout(None if is_persistent else _PATIENCE_S)
                if self._block(link, 0):
                    return
                success, message = self._answer()
                text = message.encode("utf-8", "replace")
                body = bytes([success]) + _LENGTH.pack(len(text)) + text
                link.sendall(b"\x01" + _LENGTH.pack(len(body)) + body)
                if not is_persistent:
                    return

    def _refusal(self, fields: Dict[str, str]) -> str:
        if fields.get("service") != self._name:
            return "%s is not offered by %s" % (fields.get("service"), self._node)
        if fields.get("md5sum") not in ("*", MD5SUM):
            return "%s has md5sum %s, not %s" % (self._name, MD5SUM, fields.get("md5sum"))
        return ""

    @staticmethod
    def _block(link: socket.socket, most: int) -> bytes:
        """Return the bytes after a length prefix, which may be at most ``most``."""
        def read(count: int) -> bytes:
            data = b""
            while len(data) < count:
                piece = link.recv(count - len(data))
                if not piece:
                    raise ConnectionLost("the caller has gone")
                data += piece
            return data
        size = _LENGTH.unpack(read(_LENGTH.size))[0]
        if size > most:
            raise ProtocolError("a caller sends %d bytes where at most %d are expected" % (size, most))
        return read(size)
