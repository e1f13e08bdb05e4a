import socketserver
from typing import ClassVar
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

class SilenceableXMLRPCRequestHandler(SimpleXMLRPCRequestHandler):
    timeout: ClassVar[float | None]

class ThreadingXMLRPCServer(socketserver.ThreadingMixIn, SimpleXMLRPCServer):
    def __init__(self, addr: tuple[str, int], log_requests: bool | int = 1) -> None: ...
