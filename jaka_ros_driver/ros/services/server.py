"""A rospy service for clients that were built with different definitions of its type; it counts the running calls.

rospy compares the md5 of the definition with which a client was built. A connection of a client that was built with
another known definition is served with that definition's request class.
"""
import contextlib
import logging
import threading
from typing import Any, Callable, Dict, Iterator, Mapping, Optional

import rospy
from rospy.impl import registration, tcpros_base, tcpros_service

from jaka_ros_driver.protocol.texts import printable
from jaka_ros_driver.ros.audit.callers import note_peer
from jaka_ros_driver.ros.connections import SERVICE_CONNECTIONS

_LOG = logging.getLogger(__name__)


class CallCount:
    """The number of running calls."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._count = 0

    @contextlib.contextmanager
    def one(self) -> Iterator[None]:
        """Count a call from its request to its reply."""
        with self._changed:
            self._count += 1
        try:
            yield
        finally:
            with self._changed:
                self._count -= 1
                self._changed.notify_all()

    def wait_for_none(self, timeout: float) -> bool:
        """Wait until no call runs, at most ``timeout`` s; return False when there are still some."""
        with self._changed:
            return self._changed.wait_for(lambda: self._count == 0, timeout)


class ServiceServer(rospy.Service):
    """A service; every connection has a thread of its own, so that calls run in parallel."""

    def __init__(self, name: str, srv_type: Any, handler: Callable[[Any], Any], calls: CallCount,
                 other_types: Optional[Mapping[str, Any]] = None) -> None:
        """Register the service.

        Args:
            name: As rospy takes it.
            srv_type: The generated type.
            handler: Takes the request and returns the response; runs in the connection's thread.
            calls: Counts the calls.
            other_types: Other definitions of the type, by the md5 that their clients send; the handler must be able to
                take their requests.
        """
        self._calls = calls
        self._other = other_types or {}
        super().__init__(name, srv_type, handler)

    def accept(self, sock: Any, header: Dict[str, str]) -> bool:
        """Accept a connection of a client that was built with one of the other definitions; return False where it was
        not.
        """
        other = self._other.get(header.get("md5sum", ""))
        if other is None:
            return False
        protocol = tcpros_service.TCPService(self.resolved_name, other, self.buff_size)
        transport = tcpros_base.TCPROSTransport(protocol, self.resolved_name, header=header)
        transport.set_socket(sock, header["callerid"])
        transport.write_header()
        threading.Thread(target=self.handle, args=(transport, header), daemon=True).start()
        return True

    def handle(self, transport: Any, header: Dict[str, str]) -> None:
        """Serve one connection, in its thread, until it ends."""
        note_peer(header, transport.socket)
        transport.connection = SERVICE_CONNECTIONS.add(transport.socket)
        try:
            super().handle(transport, header)
        except (rospy.exceptions.TransportException, OSError) as error:
            _LOG.debug("%s: connection of %s ended: %s", self.resolved_name, header["callerid"], error)
        finally:
            transport.close()
            SERVICE_CONNECTIONS.remove(transport.connection)

    def _handle_request(self, transport: Any, request: Any) -> None:
        with transport.connection.busy(), self._calls.one():
            super()._handle_request(transport, request)

    def _write_service_error(self, transport: Any, err_msg: str) -> None:
        """Send an error in place of a response that was serialised in part."""
        if transport.write_buff is not None:
            transport.write_buff.seek(0)
            transport.write_buff.truncate(0)
        super()._write_service_error(transport, printable(err_msg))


def take_connection(sock: Any, client_addr: Any, header: Dict[str, str]) -> Optional[str]:
    """Accept a service client's connection, before rospy compares its md5; return why it is refused, or None."""
    service = registration.get_service_manager().get_service(header.get("service", ""))
    if isinstance(service, ServiceServer) and "callerid" in header and service.accept(sock, header):
        return None
    return tcpros_service.service_connection_handler(sock, client_addr, header)
