import socket
from typing import Any, Callable

from rospy.service import _Service

from .tcpros_base import TCPROSTransportProtocol

class TCPService(TCPROSTransportProtocol):
    def __init__(self, resolved_name: str, service_class: Any, buff_size: int = ...) -> None: ...

# The class of a service is generated from its definition, or made at run time.
class ServiceProxy(_Service):
    def __init__(
        self, name: str, service_class: Any, persistent: bool = False, headers: dict[str, str] | None = None
    ) -> None: ...
    def __call__(self, *args: Any, **kwds: Any) -> Any: ...
    def close(self) -> None: ...

class ServiceImpl(_Service):
    buff_size: int
    seq: int
    handler: Callable[[Any], Any]
    # A method, in whose place a caller may put another function.
    error_handler: Callable[..., None]
    def __init__(
        self,
        name: str,
        service_class: Any,
        handler: Callable[[Any], Any],
        buff_size: int = ...,
        error_handler: Callable[..., None] | None = None,
    ) -> None: ...
    def shutdown(self, reason: str = "") -> None: ...

class Service(ServiceImpl): ...

def convert_return_to_response(response: Any, response_class: Any) -> Any: ...
def service_connection_handler(sock: socket.socket, client_addr: Any, header: dict[str, str]) -> str | None: ...
def wait_for_service(service: str, timeout: float | None = None) -> None: ...
