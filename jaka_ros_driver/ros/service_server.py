"""A rospy service that knows more than one definition of its type, and how many calls are under way.

rospy accepts a caller by the md5 of the definition that it was built with. Where clients exist that were built with
another definition, their connections get a request class of their own.
"""
import contextlib
import threading
from typing import Any, Callable, Dict, Iterator, Optional, Tuple

import rospy
from rospy.impl import registration, tcpros_base, tcpros_service


class CallCount:
    """How many calls are under way."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._count = 0

    @contextlib.contextmanager
    def one(self) -> Iterator[None]:
        """One call, from its request to its reply."""
        with self._changed:
            self._count += 1
        try:
            yield
        finally:
            with self._changed:
                self._count -= 1
                self._changed.notify_all()

    def wait_for_none(self, timeout: float) -> bool:
        """Wait, s; False when there are still some."""
        with self._changed:
            return self._changed.wait_for(lambda: self._count == 0, timeout)


class ServiceServer(rospy.Service):
    """A service; every connection has a thread of its own, so that calls run in parallel."""

    def __init__(self, name: str, srv_type: Any, handler: Callable[[Any], Any], calls: CallCount,
                 other_types: Tuple[Any, ...] = ()) -> None:
        """Register it.

        Args:
            name: As rospy takes it.
            srv_type: The generated type.
            handler: Request to response; runs in the connection's thread.
            calls: Counts.
            other_types: Other definitions of the type; their requests must do for the handler.
        """
        self._calls = calls
        self._other: Dict[str, Any] = {other._md5sum: other for other in other_types}
        super().__init__(name, srv_type, handler)

    def accept(self, sock: Any, header: Dict[str, str]) -> bool:
        """Take a connection of a client built with another definition; False where it is none of those."""
        other = self._other.get(header.get("md5sum", ""))
        if other is None:
            return False
        protocol = tcpros_service.TCPService(self.resolved_name, other, self.buff_size)
        transport = tcpros_base.TCPROSTransport(protocol, self.resolved_name, header=header)
        transport.set_socket(sock, header["callerid"])
        transport.write_header()
        threading.Thread(target=self.handle, args=(transport, header), daemon=True).start()
        return True

    def _handle_request(self, transport: Any, request: Any) -> None:
        with self._calls.one():
            super()._handle_request(transport, request)


def prepare_connections() -> None:
    """Change how this process takes TCPROS connections; call once, after init_node.

    Services look at a connection before rospy compares its md5. And every connection is greeted in a thread of its
    own: rospy greets one after the other, so that a peer which connects and says nothing would keep everybody out,
    also who wants to stop the arm.
    """
    tcpros_base.start_tcpros_server()
    server = tcpros_base.init_tcpros_server()
    server.service_connection_handler = _service_connection
    greet = server.tcp_ros_server.inbound_handler
    server.tcp_ros_server.inbound_handler = lambda sock, client_addr: threading.Thread(
        target=greet, args=(sock, client_addr), name="greeting", daemon=True).start()


def _service_connection(sock: Any, client_addr: Any, header: Dict[str, str]) -> Optional[str]:
    service = registration.get_service_manager().get_service(header.get("service", ""))
    if isinstance(service, ServiceServer) and "callerid" in header and service.accept(sock, header):
        return None
    error: Optional[str] = tcpros_service.service_connection_handler(sock, client_addr, header)
    return error
