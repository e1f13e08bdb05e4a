"""A node's XMLRPC side without rospy: calls to the master and other nodes, and the server they call back.

After the ROS wiki pages "ROS/Master_API", "ROS/Slave_API" and "ROS/Parameter Server API".
"""
import http.client
import os
import re
import socketserver
import threading
import xmlrpc.client
import xmlrpc.server
import zlib
from typing import Any, Callable, Dict, List, Optional, Tuple
from xml.parsers.expat import ExpatError

from ..errors import ConnectionLost, ProtocolError

_MASTERS_REASON = re.compile(r"\[(/[^\]]*)\] Reason: ")
"""The beginning of a master's reason for a shutdown: the name of the node that it means (rosmaster.master_api)."""
REGISTRATION_PERIOD_S = 1.0
"""Time between two looks for a master that was restarted, s."""
_UNREACHABLE = (OSError, http.client.HTTPException)
_BROKEN = (xmlrpc.client.Error, ExpatError, ValueError, TypeError, ArithmeticError, LookupError, EOFError, zlib.error)


class _TimedTransport(xmlrpc.client.Transport):
    """XMLRPC over HTTP that gives up after a time."""

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


class RemoteNode:
    """One XMLRPC peer: the master, or another node's slave server. Not for several threads at once.

    Args:
        uri: Its XMLRPC URI.
        caller_id: Global name of the calling node.
        timeout_s: Longest wait for one reply, s.
    """

    def __init__(self, uri: str, caller_id: str, timeout_s: float = 5.0) -> None:
        self.uri = uri
        self._caller_id = caller_id
        try:
            self._proxy = xmlrpc.client.ServerProxy(uri, transport=_TimedTransport(timeout_s))
        except (OSError, ValueError) as error:
            raise ProtocolError("%r is no XMLRPC address: %s" % (uri, error)) from error

    def raw_call(self, method: str, *arguments: Any) -> Any:
        """Call a method; return the unchecked reply.

        Raises:
            ConnectionLost: The peer cannot be reached or did not answer in time.
            ProtocolError: It answered with an XMLRPC fault or something that is not XMLRPC.
        """
        try:
            return getattr(self._proxy, method)(self._caller_id, *arguments)
        except _UNREACHABLE as error:
            raise ConnectionLost("no answer from %s: %s" % (self.uri, error)) from error
        except _BROKEN as error:
            raise ProtocolError("%s failed at %s: %s" % (method, self.uri, error)) from error

    def call(self, method: str, *arguments: Any) -> Any:
        """Call a method of the master or slave API, give its value.

        Raises:
            ConnectionLost: The peer does not answer.
            ProtocolError: The peer refuses, or its status code is not success.
        """
        reply = self.raw_call(method, *arguments)
        if not isinstance(reply, (list, tuple)) or len(reply) != 3:
            raise ProtocolError("%s at %s: reply %.80r is not (code, message, value)" % (method, self.uri, reply))
        code, message, value = reply
        if code != 1:
            raise ProtocolError("%s at %s: %s" % (method, self.uri, message))
        return value

    def close(self) -> None:
        """Drop the kept-alive connection."""
        self._proxy("close")()

    def __enter__(self) -> "RemoteNode":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def master_uri() -> str:
    """Return the master's URI: ``ROS_MASTER_URI``, else the usual one."""
    return os.environ.get("ROS_MASTER_URI") or "http://localhost:11311"


class _Handler(xmlrpc.server.SimpleXMLRPCRequestHandler):
    protocol_version = "HTTP/1.1"
    rpc_paths = ()
    timeout = 60.0
    """Longest silence, s, of a peer; then its thread ends. Masters keep a connection open between calls."""

    def log_message(self, format: str, *arguments: Any) -> None:
        """Suppress reports of peers that are silent or go away."""


class _Server(socketserver.ThreadingMixIn, xmlrpc.server.SimpleXMLRPCServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a peer that hangs up in mid-call."""


class SlaveServer:
    """The XMLRPC server every node has: the master reports publishers here, ``rosnode`` asks and may end the node.

    Args:
        node: The node's resolved name; a shutdown that the master means for another one is refused.
        host: This host's name or address for the URI.
        bind: Address to listen on, empty for all; the port is free choice.
        on_publishers: Called with a topic and the XMLRPC URIs of all its publishers, in a server thread.
        on_shutdown: Called with a reason when somebody asks the node to end.

    Attributes:
        uri: This server's XMLRPC URI.
        subscriptions: Gives what ``getSubscriptions`` answers: (topic, type); set by the owner, as those that follow.
        publications: Gives what ``getPublications`` answers.
        bus_info: Gives what ``getBusInfo`` answers.
        publish_statistics: Gives the publishers' part of what ``getBusStats`` answers.
        topic_address: Host and TCPROS port for a topic that this node publishes; None for one that it does not.
    """

    def __init__(self, node: str, host: str, bind: str, on_publishers: Callable[[str, List[str]], None],
                 on_shutdown: Callable[[str], None]) -> None:
        self._node = node
        self._on_publishers = on_publishers
        self._on_shutdown = on_shutdown
        self.subscriptions: Callable[[], List[List[str]]] = list
        self.publications: Callable[[], List[List[str]]] = list
        self.bus_info: Callable[[], List[List[Any]]] = list
        self.publish_statistics: Callable[[], List[List[Any]]] = list
        self.topic_address: Callable[[str], Optional[Tuple[str, int]]] = lambda topic: None
        self._server = _Server((bind, 0), requestHandler=_Handler, logRequests=False, allow_none=True)
        self.uri = "http://%s:%d/" % (host, self._server.server_address[1])
        questions: Dict[str, Callable[[], Any]] = {
            "getPid": os.getpid, "getName": lambda: self._node, "getMasterUri": master_uri,
            "getSubscriptions": lambda: self.subscriptions(), "getPublications": lambda: self.publications(),
            "getBusInfo": lambda: self.bus_info(), "getBusStats": lambda: [self.publish_statistics(), [], []]}
        for name, answer in questions.items():
            self._server.register_function(lambda caller_id, answer=answer: (1, "", answer()), name)
        methods: Tuple[Callable[..., Any], ...] = (
            self.publisherUpdate, self.paramUpdate, self.requestTopic, self.shutdown)
        for method in methods:
            self._server.register_function(method)
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.05},
                                        name="slave-api", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    # The names below are those of the slave API.

    def publisherUpdate(self, caller_id: str, topic: str, publishers: List[str]) -> Tuple[int, str, int]:
        self._on_publishers(topic, [str(uri) for uri in publishers])
        return 1, "", 0

    def paramUpdate(self, caller_id: str, key: str, value: Any) -> Tuple[int, str, int]:
        return 1, "", 0

    def requestTopic(self, caller_id: str, topic: str, protocols: List[List[Any]]) -> Tuple[int, str, List[Any]]:
        address = self.topic_address(topic)
        if address is None or not any(protocol and protocol[0] == "TCPROS" for protocol in protocols):
            return 0, "%s is not published here over TCPROS" % topic, []
        return 1, "", ["TCPROS", address[0], address[1]]

    def shutdown(self, caller_id: str, reason: str = "") -> Tuple[int, str, int]:
        meant = _MASTERS_REASON.match(str(reason))
        if meant and meant.group(1) != self._node:
            return 0, "this is %s" % self._node, 0  # that node was killed, and this one has its port now
        self._on_shutdown("%s: %s" % (caller_id, reason))
        return 1, "", 0
