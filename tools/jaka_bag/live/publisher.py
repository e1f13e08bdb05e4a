"""The publication of messages without rospy: blocking and in order, so that no subscriber ever misses a message.

After the ROS wiki pages "ROS/TCPROS" and "ROS/Connection Header".

``ConnectionLost`` is raised where the master cannot be reached, ``ProtocolError`` where it refuses.
"""
import collections
import contextlib
import os
import select
import socket
import struct
import threading
import time
from typing import Any, Callable, Deque, Dict, List, Optional, Tuple, Union

from ..errors import ConnectionLost, ProtocolError
from ..messages.connection import Connection
from .graph import REGISTRATION_PERIOD_S, RemoteNode, SlaveServer, master_uri
from .names import NodeNames, host_address
from .tcpros import decode_header, encode_header

_LENGTH = struct.Struct("<I")
_REFUSED_PAUSE_S = 0.1
"""Pause, s, after the system has refused a connection: descriptors run out and come free again."""
_HANDSHAKE_TIMEOUT_S = 5.0
"""Longest wait, s, for a subscriber's header: one that sends none keeps a thread so long."""
_MAX_HEADER = 1 << 20
"""Longest header, byte, of a subscriber: it holds the definition of its type at most."""
_SLOW_NOTICE_S = 1.0
"""Time, s, without a byte read after which a subscriber is named as slow."""


class _Link:
    """One subscriber's connection."""

    def __init__(self, link_socket: socket.socket, subscriber: str) -> None:
        self.socket = link_socket
        self.subscriber = subscriber
        self.sent_bytes = 0
        self.sent = 0


class TopicPublisher:
    """One topic with one type, as subscribers see it.

    Attributes:
        topic: Global name.
        connection: Type, md5 and definition.
        is_latching: Subscribers learn that messages are latched.
        sent: Messages published.
    """

    def __init__(self, topic: str, connection: Connection, is_latching: bool) -> None:
        self.topic = topic
        self.connection = connection
        self.is_latching = is_latching
        self.sent = 0
        self.links: List[_Link] = []
        self.joining: Deque[_Link] = collections.deque()
        self.latched: Dict[Any, bytes] = {}


def frame_of(payload: bytes) -> bytes:
    """Encode a message as TCPROS sends it."""
    return _LENGTH.pack(len(payload)) + payload


class Publisher:
    """The publishers of one node. One thread publishes; subscribers may come and go at any time.

    Args:
        names: Names of the node.
        notice: Takes a line for the user.
        on_shutdown: Called with a reason when another node asks this one to end.
    """

    def __init__(self, names: NodeNames, notice: Callable[[str], None], on_shutdown: Callable[[str], None]) -> None:
        self.names = names
        self.offers: List[TopicPublisher] = []
        self._notice = notice
        self.master = RemoteNode(master_uri(), names.node)
        self._has_joining = threading.Event()
        self._is_closing = False
        self._closes = threading.Event()
        self._types: Dict[str, str] = {}  # by topic, as it is registered
        self._registrar = threading.Thread(target=self._stay_registered, name="registration", daemon=True)
        self._host, bind = host_address(os.environ)
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.settimeout(None)  # whatever new sockets have in this process
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._listener.bind((bind, 0))
        self._listener.listen(64)
        self._acceptor = threading.Thread(target=self._accept, name="tcpros-accept", daemon=True)
        self._acceptor.start()
        self._slave = SlaveServer(names.node, self._host, bind, lambda topic, uris: None, on_shutdown)
        self._slave.publications = lambda: [[o.topic, o.connection.datatype] for o in self.offers]
        self._slave.bus_info = lambda: [[id(link) % 2147483647, link.subscriber, "o", "TCPROS", offer.topic, 1, ""]
                                        for offer in self.offers for link in offer.links]
        self._slave.publish_statistics = lambda: [
            [o.topic, sum(link.sent_bytes for link in o.links),
             [[id(link) % 2147483647, link.sent_bytes, link.sent, True] for link in o.links]] for o in self.offers]
        self._slave.topic_address = self._topic_address
        self._registrar.start()

    def advertise(self, topic: str, connection: Connection, is_latching: bool) -> TopicPublisher:
        """Offer a topic with a type; further types of one topic are served to those who ask for their md5."""
        offer = TopicPublisher(topic, connection, is_latching)
        self.offers.append(offer)
        if topic not in self._types:
            self.master.call("registerPublisher", topic, connection.datatype, self._slave.uri)
            self._types[topic] = connection.datatype
        return offer

    def _stay_registered(self) -> None:
        """Register again where the master knows nothing of a topic, as after its restart."""
        master = RemoteNode(self.master.uri, self.names.node)
        while not self._closes.wait(REGISTRATION_PERIOD_S):
            with contextlib.suppress(ConnectionLost, ProtocolError):
                known = dict(master.call("getSystemState")[0])
                lost = [topic for topic in list(self._types) if self.names.node not in known.get(topic, ())]
                for topic in lost:
                    master.call("registerPublisher", topic, self._types[topic], self._slave.uri)
                if lost:
                    self._notice("registered again: the master was restarted")

    def _topic_address(self, topic: str) -> Optional[Tuple[str, int]]:
        if self._is_closing or all(offer.topic != topic for offer in self.offers):
            return None
        return self._host, int(self._listener.getsockname()[1])

    def _accept(self) -> None:
        while True:
            try:
                link_socket, _ = self._listener.accept()
            except OSError:
                if self._closes.wait(_REFUSED_PAUSE_S):
                    return
                continue
            try:
                threading.Thread(target=self._shake_hands, args=(link_socket,), name="tcpros-hello",
                                 daemon=True).start()
            except RuntimeError:  # the system gives no thread now: a subscriber tries again
                link_socket.close()

    def _shake_hands(self, link_socket: socket.socket) -> None:
        try:
            link_socket.settimeout(_HANDSHAKE_TIMEOUT_S)
            link_socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            link_socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            with link_socket.makefile("rb") as stream:
                size = _LENGTH.unpack(stream.read(_LENGTH.size))[0]
                header = stream.read(min(size, _MAX_HEADER))
            if len(header) != size:
                raise ProtocolError("a connection header of %d bytes is too long or cut off" % size)
            request = decode_header(header)
            offer = self._offer_for(request)
            if isinstance(offer, str):
                link_socket.sendall(encode_header({"error": offer}))
                link_socket.close()
                return
            connection = offer.connection
            link_socket.sendall(encode_header({
                "callerid": self.names.node, "latching": "1" if offer.is_latching else "0",
                "md5sum": connection.md5sum, "message_definition": connection.definition, "topic": offer.topic,
                "type": connection.datatype}))
            link_socket.settimeout(None)
        except (OSError, ProtocolError, struct.error):
            link_socket.close()  # a peer that does not speak TCPROS, or left
            return
        offer.joining.append(_Link(link_socket, request.get("callerid", "")))
        self._has_joining.set()

    def _offer_for(self, request: Dict[str, str]) -> Union[TopicPublisher, str]:
        topic, md5sum = request.get("topic", ""), request.get("md5sum", "*")
        of_topic = [offer for offer in self.offers if offer.topic == topic]
        if not of_topic:
            return "%s is not published by %s" % (topic, self.names.node)
        for offer in of_topic:
            if md5sum in ("*", offer.connection.md5sum):
                return offer
        return "%s is published with md5sum %s, not %s" % (topic, of_topic[0].connection.md5sum, md5sum)

    def admit(self) -> None:
        """Take in the subscribers that have connected, send them what is latched."""
        if not self._has_joining.is_set():
            return
        self._has_joining.clear()
        for offer in self.offers:
            while offer.joining:
                link = offer.joining.popleft()
                offer.links.append(link)
                for frame in list(offer.latched.values()):
                    self._send(offer, link, frame)

    def publish(self, offer: TopicPublisher, frame: bytes, latch_key: Any = None) -> None:
        """Send a message to all subscribers; returns when the system has taken it for each of them.

        Args:
            offer: Offer from ``advertise``.
            frame: Message from ``frame_of``.
            latch_key: Keep the message for later subscribers, in place of the last one with this key; None: do not.
        """
        if self._has_joining.is_set():
            self.admit()
        if latch_key is not None:
            offer.latched[latch_key] = frame
        offer.sent += 1
        for link in offer.links:
            try:
                done = link.socket.send(frame, socket.MSG_DONTWAIT)
            except OSError:
                done = 0
            if done == len(frame):
                link.sent += 1
                link.sent_bytes += done
            else:
                self._send(offer, link, frame[done:])

    def _send(self, offer: TopicPublisher, link: _Link, data: bytes) -> None:
        """Send the rest of a message, however long the subscriber takes; drop one that has gone."""
        rest = memoryview(data)
        is_noticed = False
        try:
            while rest:
                _, writable, _ = select.select([], [link.socket], [], _SLOW_NOTICE_S)
                if writable:
                    with contextlib.suppress(BlockingIOError):
                        rest = rest[link.socket.send(rest, socket.MSG_DONTWAIT):]
                elif not is_noticed:
                    is_noticed = True
                    self._notice("%s does not read %s: waiting for it" % (link.subscriber, offer.topic))
        except OSError:
            link.socket.close()
            offer.links = [other for other in offer.links if other is not link]
            return
        link.sent += 1
        link.sent_bytes += len(data)

    def has_subscribers(self) -> bool:
        """Return whether each topic has at least one subscriber."""
        self.admit()
        subscribed = {offer.topic for offer in self.offers if offer.links}
        return all(offer.topic in subscribed for offer in self.offers)

    def close(self, patience_s: float) -> None:
        """End: let every subscriber read to the end, then unregister.

        A subscriber drops a publisher that is unregistered together with what it has not read yet; so each link is
        closed first, and its subscriber answers by closing it when it has read everything.

        Args:
            patience_s: Longest wait for subscribers that do not read, s.
        """
        self._is_closing = True
        self.admit()
        waiting = {link.socket: link for offer in self.offers for link in offer.links}
        for link_socket in waiting:
            with contextlib.suppress(OSError):
                link_socket.shutdown(socket.SHUT_WR)
        deadline = time.monotonic() + patience_s
        while waiting and time.monotonic() < deadline:
            readable, _, _ = select.select(list(waiting), [], [], max(0.0, deadline - time.monotonic()))
            for link_socket in readable:
                try:
                    is_over = not link_socket.recv(4096)
                except OSError:
                    is_over = True
                if is_over:
                    waiting.pop(link_socket).socket.close()
        for link in waiting.values():
            self._notice("%s did not read to the end" % link.subscriber)
            link.socket.close()
        self._closes.set()
        self._registrar.join()
        for topic in sorted(self._types):
            try:
                self.master.call("unregisterPublisher", topic, self._slave.uri)
            except (ConnectionLost, ProtocolError):
                break  # the master is gone, and with it the registrations
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._acceptor.join()
        self._slave.close()
        self.master.close()
