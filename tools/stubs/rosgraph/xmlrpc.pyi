import socketserver
from collections.abc import Callable
from typing import ClassVar
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

class SilenceableXMLRPCRequestHandler(SimpleXMLRPCRequestHandler):
    timeout: ClassVar[float | None]

class ThreadingXMLRPCServer(socketserver.ThreadingMixIn, SimpleXMLRPCServer):
    def __init__(self, addr: tuple[str, int], log_requests: bool | int = 1) -> None: ...

class XmlRpcHandler: ...

class XmlRpcNode:
    uri: str | None
    server: ThreadingXMLRPCServer | None
    is_shutdown: bool
    def __init__(self, port: int = 0, rpc_handler: XmlRpcHandler | None = None,
                 on_run_error: Callable[[Exception], object] | None = None) -> None: ...
    def start(self) -> None: ...
