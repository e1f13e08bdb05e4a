"""The subscriptions of a node without rospy: one loop over all publishers' links, with the kernel's receive times.

The loop belongs to the thread that calls ``poll``; registrations and slave API calls reach it through a queue.

Methods that ask the master raise ``ConnectionLost`` where it cannot be reached, ``ProtocolError`` where it refuses; a
topic that is unsubscribed is released all the same.
"""
import collections
import contextlib
import os
import select
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Deque, Dict, List, Optional, Tuple

from ..errors import ConnectionLost, JakaBagError, ProtocolError
from ..messages.connection import Connection
from .graph import RemoteNode, SlaveServer, master_uri
from .names import NodeNames, host_address
from .tcpros import Deliver, PublisherLink, resolve

_FIRST_RETRY_S = 0.1
"""First pause, s, before a connection is tried again; it doubles from try to try."""
_LAST_RETRY_S = 5.0
"""Longest pause, s: a publisher that is restarted is found so late, one that hangs is asked so seldom."""
_HOUSEKEEPING_S = 0.1
"""Period, s, of the looks at connections that are due: retries and time limits need no more."""
_MAX_EVENTS = 256
"""Links served in one round, before the looks that are due: a busy graph must not put them off."""

Accept = Callable[[Connection], bool]
"""A decision whether a publisher's stream on a subscribed topic is wanted."""

OpenStream = Callable[[Connection, str], Any]
"""A callback for each new stream (connection, XMLRPC URI of the publisher); returns the tag of its messages."""


def accept_all(connection: Connection) -> bool:
    """Take every stream."""
    return True


class _Publisher:
    """The loop's state of one publisher of one topic."""

    def __init__(self) -> None:
        self.is_listed = True
        self.is_asked = False
        self.is_refused = False
        self.link: Optional[PublisherLink] = None
        self.retry_at = 0.0
        self.delay_s = _FIRST_RETRY_S
        self.noticed = ""


class Subscriber:
    """Subscriptions of one node, served by one loop.

    Args:
        names: Names of the node.
        deliver: Called with each message, in the thread that polls.
        open_stream: Called for each new link, in the thread that polls.
        notice: Takes a line for the user when something fails or changes.
        on_shutdown: Called with a reason when another node asks this one to end.
        tcp_nodelay: Ask publishers to send each message at once.
        kernel_stamps: Stamp messages with the kernel's time of receipt.

    Attributes:
        master: The ROS master, for the thread that subscribes.
    """

    def __init__(self, names: NodeNames, deliver: Deliver, open_stream: OpenStream, notice: Callable[[str], None],
                 on_shutdown: Callable[[str], None], tcp_nodelay: bool = False, kernel_stamps: bool = True) -> None:
        self.names = names
        self._deliver = deliver
        self._open_stream = open_stream
        self._notice = notice
        self._tcp_nodelay = tcp_nodelay
        self._kernel_stamps = kernel_stamps
        self._topics: Dict[str, Dict[str, _Publisher]] = {}
        self._links: Dict[int, Tuple[PublisherLink, _Publisher]] = {}
        self._commands: Deque[Tuple[Callable[..., None], Tuple[Any, ...]]] = collections.deque()
        self._epoll = select.epoll()
        self._wake_lock = threading.RLock()
        self._is_closed = False
        self._wake_out, self._wake_in = os.pipe()
        os.set_blocking(self._wake_in, False)
        os.set_blocking(self._wake_out, False)
        self._epoll.register(self._wake_out, select.EPOLLIN)
        self._next_housekeeping = 0.0
        self._askers = ThreadPoolExecutor(8, "request-topic")
        self._accepts: Dict[str, Accept] = {}
        self.master = RemoteNode(master_uri(), names.node)
        host, bind = host_address(os.environ)
        self._slave = SlaveServer(names.node, host, bind, self._on_publishers, on_shutdown)
        self._slave.subscriptions = lambda: [[topic, "*"] for topic in list(self._accepts)]
        self._slave.bus_info = self._bus_info

    @property
    def uri(self) -> str:
        """The node's XMLRPC URI."""
        return self._slave.uri

    # Called from other threads

    def subscribe(self, topic: str, accept: Accept = accept_all) -> None:
        """Register with the master and connect to all publishers, now and later."""
        self._accepts[topic] = accept
        publishers = self.master.call("registerSubscriber", topic, "*", self._slave.uri)
        self._command(self._apply_publishers, topic, publishers, False)

    def resubscribe(self) -> bool:
        """Register again where the master knows nothing of a subscription, as after its restart; return whether it did.

        That it knows the node says less: a service that this process offers or a parameter that it asks for is enough.
        """
        known = dict(self.master.call("getSystemState")[1])
        lost = [topic for topic in list(self._accepts) if self.names.node not in known.get(topic, ())]
        for topic in lost:
            self.subscribe(topic, self._accepts[topic])
        return bool(lost)

    def unsubscribe(self, topic: str) -> None:
        """Take no more of a topic."""
        self._accepts.pop(topic, None)
        self._command(self._drop_topic, topic)
        self.master.call("unregisterSubscriber", topic, self._slave.uri)

    def wake(self) -> None:
        """Make a waiting ``poll`` return; after ``close`` it does nothing. A signal handler may call it."""
        with self._wake_lock:
            if not self._is_closed:
                with contextlib.suppress(BlockingIOError):  # a full pipe wakes as well
                    os.write(self._wake_in, b"w")

    def _command(self, function: Callable[..., None], *arguments: Any) -> None:
        self._commands.append((function, arguments))
        self.wake()

    def _on_publishers(self, topic: str, uris: List[str]) -> None:
        self._command(self._apply_publishers, topic, uris, True)

    def _bus_info(self) -> List[List[Any]]:
        return [[fd, publisher, "i", "TCPROS", topic, 1, "TCPROS"] for fd, topic, publisher in self.links()]

    def links(self) -> List[Tuple[int, str, str]]:
        """Return the established links: file descriptor, topic, XMLRPC URI of the publisher."""
        return [(fd, link.topic, link.publisher) for fd, (link, _) in list(self._links.items())
                if link.connection is not None]

    # The loop's thread

    def fileno(self) -> int:
        """Return a file descriptor that is readable while ``poll`` has something to do, but for its clockwork."""
        return self._epoll.fileno()

    def poll(self, timeout_s: float) -> None:
        """Deliver what arrives within the time; returns after the first messages or events.

        Call it some times a second: what is to be done at its time, as trying again, is done here, too.
        """
        for fd, _ in self._epoll.poll(timeout_s, _MAX_EVENTS):
            entry = self._links.get(fd)
            if entry is None:
                self._on_wake(fd)
                continue
            link = entry[0]
            try:
                if link.is_connecting:
                    link.finish_connecting()
                    self._epoll.modify(fd, select.EPOLLIN)
                else:
                    link.read(self._deliver)
            except (ConnectionLost, ProtocolError) as error:
                self._lose(entry, error)
            except Exception as error:  # whatever one publisher's header meets must not end what the others send
                self._lose(entry, ProtocolError("the link to %s is given up (%s: %s)" % (
                    link.publisher, type(error).__name__, str(error)[:160])))
        now = time.monotonic()
        if now >= self._next_housekeeping:
            self._next_housekeeping = now + _HOUSEKEEPING_S
            self._keep_house(now)

    def close(self) -> None:
        """Unregister everywhere and close all links; no message is delivered any more."""
        for topic in list(self._accepts):
            try:
                self.master.call("unregisterSubscriber", topic, self._slave.uri)
            except (ConnectionLost, ProtocolError):
                break  # the master is gone, and with it the registrations
        self._slave.close()
        self._askers.shutdown(wait=False)
        for link, _ in list(self._links.values()):
            link.close()
        self._links.clear()
        self._epoll.close()
        with self._wake_lock:  # threads that still answer others must not write to what this number means next
            self._is_closed = True
            os.close(self._wake_in)
            os.close(self._wake_out)
        self.master.close()

    def _on_wake(self, fd: int) -> None:
        if fd == self._wake_out:
            os.read(fd, 4096)
        while self._commands:
            function, arguments = self._commands.popleft()
            function(*arguments)

    def _apply_publishers(self, topic: str, uris: List[str], is_complete: bool) -> None:
        if topic not in self._accepts:
            return
        known = self._topics.setdefault(topic, {})
        if is_complete:
            for uri in [uri for uri in known if uri not in uris]:
                known[uri].is_listed = False  # its link is read to the end
                if known[uri].link is None:
                    del known[uri]
        for uri in uris:
            known.setdefault(uri, _Publisher()).is_listed = True
        self._keep_house(time.monotonic())

    def _drop_topic(self, topic: str) -> None:
        for publisher in self._topics.pop(topic, {}).values():
            if publisher.link is not None:
                self._forget_link(publisher)

    def _forget_link(self, publisher: _Publisher) -> None:
        assert publisher.link is not None
        self._epoll.unregister(publisher.link.fileno())
        del self._links[publisher.link.fileno()]
        publisher.link.close()
        publisher.link = None

    def _keep_house(self, now: float) -> None:
        for topic, publishers in self._topics.items():
            for uri, publisher in list(publishers.items()):
                link = publisher.link
                if link is not None:
                    if link.connection is None and now > link.deadline:
                        self._lose((link, publisher), ConnectionLost("%s does not answer" % uri))
                elif not publisher.is_listed:
                    del publishers[uri]
                elif not publisher.is_asked and not publisher.is_refused and now >= publisher.retry_at:
                    publisher.is_asked = True
                    self._askers.submit(self._ask, topic, uri)

    def _ask(self, topic: str, uri: str) -> None:
        """Ask a publisher where its TCPROS port is; in a thread of the pool."""
        try:
            with RemoteNode(uri, self.names.node) as node:
                protocol = node.call("requestTopic", topic, [["TCPROS"]])
            if not isinstance(protocol, (list, tuple)) or len(protocol) < 3 or protocol[0] != "TCPROS":
                raise ProtocolError("%s offers no TCPROS for %s" % (uri, topic))
            try:
                address = resolve(str(protocol[1]), int(protocol[2]))
            except (ValueError, TypeError, OverflowError) as error:  # UnicodeError among them
                raise ProtocolError("%s names no address for %s: %s" % (uri, topic, error)) from error
            self._command(self._connect, topic, uri, address)
        except JakaBagError as error:
            self._command(self._ask_failed, topic, uri, error)
        except Exception as error:  # what nobody foresaw: it is asked again
            self._command(self._ask_failed, topic, uri, ProtocolError("%s at %s: %r" % (topic, uri, error)))

    def _ask_failed(self, topic: str, uri: str, error: JakaBagError) -> None:
        publisher = self._topics.get(topic, {}).get(uri)
        if publisher is not None:
            publisher.is_asked = False
            self._retry_later(publisher, topic, error)

    def _connect(self, topic: str, uri: str, address: Tuple[str, int]) -> None:
        publisher = self._topics.get(topic, {}).get(uri)
        if publisher is None or publisher.link is not None:
            return
        publisher.is_asked = False

        def on_open(link: PublisherLink) -> Any:
            assert link.connection is not None and publisher is not None
            accept = self._accepts.get(topic)
            if accept is None or not accept(link.connection):
                publisher.is_refused = True
                raise ProtocolError("not wanted")
            tag = self._open_stream(link.connection, uri)
            publisher.delay_s = _FIRST_RETRY_S  # behind what may fail, which would be tried again at once and for ever
            return tag

        try:
            link = PublisherLink(self.names.node, topic, uri, address, self._tcp_nodelay, self._kernel_stamps, on_open)
        except ConnectionLost as error:
            self._retry_later(publisher, topic, error)
            return
        publisher.link = link
        self._links[link.fileno()] = (link, publisher)
        self._epoll.register(link.fileno(), select.EPOLLOUT)

    def _lose(self, entry: Tuple[PublisherLink, _Publisher], error: JakaBagError) -> None:
        link, publisher = entry
        self._forget_link(publisher)
        if not publisher.is_refused:
            self._retry_later(publisher, link.topic, error)

    def _retry_later(self, publisher: _Publisher, topic: str, error: JakaBagError) -> None:
        if publisher.is_listed and publisher.delay_s > 4 * _FIRST_RETRY_S and publisher.noticed != str(error):
            publisher.noticed = str(error)
            self._notice("%s: %s; trying again" % (topic, error))
        publisher.retry_at = time.monotonic() + publisher.delay_s
        publisher.delay_s = min(2 * publisher.delay_s, _LAST_RETRY_S)
