"""A rospy service for clients that were built with different definitions of its type; it counts the running calls.

rospy compares the md5 of the definition with which a client was built. A connection of a client that was built with
another known definition is served with that definition's request class.
"""
import functools
import io
import sys
import threading
from typing import Any, Callable, Dict, Mapping, Optional

import rosgraph.network
import rospy
import rospy.msg
from rospy.impl import registration, tcpros_service

from jaka_ros_driver.ros.audit.callers import note_peer
from jaka_ros_driver.ros.services.connection import ServiceConnection, UnreadableRequest, error_answer
from jaka_ros_driver.ros.services.loop import SERVICE_LOOP


class CallCount:
    """The number of running calls; a call is within its context from its request to its reply."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._count = 0

    def __enter__(self) -> None:
        with self._changed:
            self._count += 1

    def __exit__(self, *error: Any) -> None:
        with self._changed:
            self._count -= 1
            self._changed.notify_all()

    def wait_for_none(self, timeout: float) -> bool:
        """Wait until no call runs, at most ``timeout`` s; return False when there are still some."""
        with self._changed:
            return self._changed.wait_for(lambda: self._count == 0, timeout)


class ServiceServer(rospy.Service):
    """A service whose connections are served by the loop of this process, so that calls run in parallel."""

    def __init__(self, name: str, srv_type: Any, handler: Callable[[Any], Any], calls: CallCount,
                 other_types: Optional[Mapping[str, Any]] = None, is_stop: bool = False) -> None:
        """Register the service.

        Args:
            name: As rospy takes it.
            srv_type: The generated type.
            handler: Takes the request and returns the response; it may block, for others are served meanwhile.
            calls: Counts the calls.
            other_types: Other definitions of the type, by the md5 that their clients send; the handler must be able to
                take their requests.
            is_stop: It stops something: its calls wait for no others.
        """
        self._calls = calls
        self._other = other_types or {}
        self._is_stop = is_stop
        SERVICE_LOOP.start()
        super().__init__(name, srv_type, handler)

    def accept(self, sock: Any, header: Dict[str, Any]) -> Optional[str]:
        """Accept the connection of a client that was built with a known definition; return why it is refused, in
        rospy's words, or None.
        """
        for field in ("md5sum", "callerid"):
            if field not in header:
                return "Missing required '%s' field" % field
        own, md5 = self.service_class._md5sum, header["md5sum"]
        kind = self._other.get(md5)
        if kind is None and md5 not in (own, rospy.names.SERVICE_ANYTYPE):
            return "request from [%s]: md5sums do not match: [%s] vs. [%s]" % (header["callerid"], md5, own)
        kind = kind or self.service_class
        greeting = tcpros_service.TCPService(self.resolved_name, kind, self.buff_size).get_header_fields()
        rosgraph.network.write_ros_handshake_header(sock, greeting)
        if header.get("probe") == "1":
            sock.close()
            return None
        note_peer(header, sock)
        answer = functools.partial(self.answer, kind._request_class, header)
        connection = ServiceConnection(sock, header, answer, self._calls)
        try:
            SERVICE_LOOP.add(connection, self._is_stop)
        except OSError:
            connection.close()
            raise
        return None

    def answer(self, request_class: Any, header: Dict[str, Any], body: bytes) -> bytes:
        """Carry out a request; return the whole answer, or the error that takes its place.

        Args:
            request_class: The class of the request, by the definition with which the client was built.
            header: The fields that the client has sent when it connected.
            body: The serialised request.

        Raises:
            UnreadableRequest: The body is none of this class.
        """
        try:
            request = request_class().deserialize(body)
        except Exception as error:
            raise UnreadableRequest("%d bytes are no %s (%s)" % (len(body), request_class._type, error)) from error
        request._connection_header = header
        try:
            response = tcpros_service.convert_return_to_response(self.handler(request), self.response_class)
            self.seq += 1
            buffer = io.BytesIO(b"\1")
            buffer.seek(1)
            rospy.msg.serialize_message(buffer, self.seq, response)
            return buffer.getvalue()
        except rospy.ServiceException as error:
            return error_answer("service cannot process request: %s" % error)
        except Exception as error:
            self.error_handler(error, *sys.exc_info())
            return error_answer("error processing request: %s" % error)


def take_connection(sock: Any, client_addr: Any, header: Dict[str, str]) -> Optional[str]:
    """Accept the connection of a service's client; return why it is refused, or None.

    rospy serves its own services, and refuses whoever asks for one that does not exist.
    """
    service = registration.get_service_manager().get_service(header.get("service", ""))
    if isinstance(service, ServiceServer):
        return service.accept(sock, header)
    return tcpros_service.service_connection_handler(sock, client_addr, header)
