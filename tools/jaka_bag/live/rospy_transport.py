"""Subscribing through rospy: the same messages as the raw transport, stamped when rospy hands them over."""
import os
import threading
import time
from typing import Any, Callable, Dict, List, Tuple

from ..errors import ConnectionLost, MissingDependency, ProtocolError
from .graph import RemoteNode, master_uri
from .names import NodeNames
from .subscriber import Accept, OpenStream, accept_all
from .tcpros import Deliver, connection_of


class RospyTransport:
    """Subscriptions of one rospy node; see ``RawTransport`` for the arguments.

    Raises:
        MissingDependency: rospy is not installed.
    """

    def __init__(self, names: NodeNames, deliver: Deliver, open_stream: OpenStream, notice: Callable[[str], None],
                 on_shutdown: Callable[[str], None], tcp_nodelay: bool = False) -> None:
        os.environ["ROS_NAMESPACE"] = names.namespace
        try:
            import rospy
        except ImportError:
            raise MissingDependency("the rospy transport needs the Python package rospy") from None
        self._rospy: Any = rospy
        self.names = names
        self._deliver = deliver
        self._open_stream = open_stream
        self._notice = notice
        self._tcp_nodelay = tcp_nodelay
        self._lock = threading.Lock()
        self._woken = threading.Event()
        self._subscribers: Dict[str, Any] = {}
        self._tags: Dict[int, Tuple[Any, Any]] = {}
        self.master = RemoteNode(master_uri(), names.node)
        self._rospy.init_node(names.node.rsplit("/", 1)[1], argv=[], disable_signals=True, disable_rosout=True)
        self._rospy.core.add_preshutdown_hook(on_shutdown)

    def subscribe(self, topic: str, accept: Accept = accept_all) -> None:
        """See ``RawTransport.subscribe``; rospy itself waits where the master cannot be reached."""
        def take(message: Any) -> None:
            stamp = time.time_ns()
            with self._lock:
                tag = self._tag(topic, message._connection_header, accept)
                if tag is not None:
                    self._deliver(tag, stamp, message._buff)

        self._subscribers[topic] = self._rospy.Subscriber(topic, self._rospy.AnyMsg, take,
                                                          tcp_nodelay=self._tcp_nodelay)

    def _tag(self, topic: str, header: Dict[str, str], accept: Accept) -> Any:
        known = self._tags.get(id(header))
        if known is not None:
            return known[1]
        tag = None
        try:
            connection = connection_of(topic, header)
            if accept(connection):
                tag = self._open_stream(connection, self._uri(connection.callerid or ""))
        except ProtocolError as error:
            self._notice("%s: %s" % (topic, error))
        self._tags[id(header)] = (header, tag)  # the header is kept, so that its id stays its own
        return tag

    def _uri(self, caller_id: str) -> str:
        node = RemoteNode(master_uri(), self.names.node)
        try:
            return str(node.call("lookupNode", caller_id))
        except (ConnectionLost, ProtocolError):
            return caller_id
        finally:
            node.close()

    def resubscribe(self) -> None:
        """Register again with a master that was restarted."""
        for topic in list(self._subscribers):
            self.master.call("registerSubscriber", topic, "*", self._rospy.get_node_uri())

    def unsubscribe(self, topic: str) -> None:
        """See ``RawTransport.unsubscribe``."""
        self._subscribers.pop(topic).unregister()

    def wake(self) -> None:
        """Make a waiting ``poll`` return."""
        self._woken.set()

    def poll(self, timeout_s: float) -> None:
        """Wait; rospy's own threads deliver."""
        if self._woken.wait(timeout_s):
            self._woken.clear()

    def links(self) -> List[Tuple[int, str, str]]:
        """Links that stand: a number, topic, XMLRPC URI of the publisher."""
        return [(0, header["topic"], tag.publisher) for header, tag in list(self._tags.values()) if tag is not None]

    def close(self) -> None:
        """Unsubscribe everywhere; no message is delivered any more."""
        for subscriber in self._subscribers.values():
            subscriber.unregister()
        self._rospy.signal_shutdown("recording ended")
        with self._lock:
            self._deliver = lambda tag, stamp, data: None
        self.master.close()
