from socket import socket as Socket
from typing import Any, Callable

_Handler = Callable[[Socket, Any, dict[str, str]], str | None]

class TCPServer:
    # Replaced by one that is like it.
    server_sock: Any
    def __init__(self, inbound_handler: Callable[[Socket, Any], None], port: int = 0) -> None: ...

class TCPROSServer:
    tcp_ros_server: TCPServer
    def __init__(self, port: int = 0) -> None: ...
    topic_connection_handler: _Handler
    service_connection_handler: _Handler
    # A method, which is replaced in the class.
    _tcp_server_callback: Callable[[TCPROSServer, Socket, Any], None]

class TCPROSTransportProtocol:
    def __init__(
        self, resolved_name: str, recv_data_class: Any, queue_size: int | None = None, buff_size: int = ...
    ) -> None: ...
    def get_header_fields(self) -> dict[str, str]: ...

class TCPROSTransport:
    # None once it is closed.
    socket: Socket | None
    stat_bytes: int
    stat_num_msg: int
    header: dict[str, str]
    def __init__(
        self, protocol: TCPROSTransportProtocol, name: str, header: dict[str, str] | None = None
    ) -> None: ...
    def close(self) -> None: ...

def get_tcpros_server_address() -> tuple[str, int]: ...
def init_tcpros_server(port: int = 0) -> TCPROSServer: ...
def start_tcpros_server() -> None: ...
