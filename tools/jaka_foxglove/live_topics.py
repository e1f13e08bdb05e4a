"""The topics of a running ROS graph as channels, without rospy.

A topic's type and definition are in the header that its publisher sends to a subscriber: each topic is connected to
once to learn them, and subscribed for as long as a viewer is. Links are read in the server's loop; what asks the master
runs in a thread of its own.
"""
import asyncio
import struct
import threading
import time
from typing import Any, Callable, Dict, FrozenSet, Iterable, List, NamedTuple, Optional, Tuple

from jaka_bag.errors import ConnectionLost, JakaBagError, ProtocolError
from jaka_bag.live.graph import REGISTRATION_PERIOD_S, RemoteNode, master_uri
from jaka_bag.live.names import NodeNames
from jaka_bag.live.subscriber import Subscriber
from jaka_bag.live.topic_selection import TopicSelection
from jaka_bag.messages.connection import Connection
from jaka_bag.units import NS_PER_S

from .graph_view import GraphView
from .outbox import SocketFrame
from .protocol import Channel, Parameter, Service, channel_of
from .service_calls import ServiceCalls
from .source import ChannelSource, Recipient

CLOCK_TOPIC = "/clock"
_WATCH_PERIOD_S = 0.5
"""Period, s, of the looks at the graph: the delay with which a new topic is shown."""
_CLOCKWORK_S = 0.1
"""Period, s, of the connections' own looks (retries, time limits) where no message comes."""
_CLOCK = struct.Struct("<II")


class LiveOptions(NamedTuple):
    """The options that select the part of a ROS graph to show.

    Attributes:
        selection: Selection of topics.
        accept: Returns whether to show a publisher's stream on such a topic.
        is_simulated_time: Times are those of ``/clock``.
        has_calls: Viewers may call services.
        services: Prefix of the names of services to offer.
    """

    selection: TopicSelection
    accept: Callable[[Connection], bool]
    is_simulated_time: bool = False
    has_calls: bool = False
    services: str = "/"


class _Stream(NamedTuple):
    """One publisher's link."""

    channel: int
    connection: Connection


class LiveTopics(ChannelSource):
    """The topics, services and parameters of a running graph.

    Args:
        names: Names of this node.
        options: Selection of what to show.
        notice: Takes a line for the user.
        on_shutdown: Called with a reason when another node asks this one to end, in a thread.
    """

    def __init__(self, names: NodeNames, options: LiveOptions, notice: Callable[[str], None],
                 on_shutdown: Callable[[str], None]) -> None:
        super().__init__("jaka_foxglove %s" % master_uri())
        self.capabilities = ("parameters", "parametersSubscribe", "connectionGraph")
        self.metadata = {"ROS_DISTRO": "noetic", "ROS_MASTER_URI": master_uri()}  # viewers read ROS 1 out of it
        if options.is_simulated_time:
            self.capabilities += ("time",)
        if options.has_calls:
            self.capabilities += ("services",)
            self.encodings = ("ros1",)
        self._names = names
        self._options = options
        self._notice = notice
        self._on_shutdown = on_shutdown
        self._wanted: FrozenSet[str] = frozenset()
        self._by_topic: Dict[str, Channel] = {}
        self._numbers: Dict[Tuple[str, str, str, str], int] = {}
        self._latched: Dict[int, Dict[Optional[str], Tuple[int, bytes]]] = {}
        self._now = 0
        self._noticed: Dict[str, str] = {}
        self._stop = threading.Event()
        self._wake = threading.Event()
        self._registration_due = 0.0
        self._registered: Dict[str, bool] = {}  # by topic: for its messages, or only to learn its type
        self._calls = ServiceCalls(names.node, options.services, notice) if options.has_calls else None
        self._graph = GraphView(names.node)
        self._clockwork: Optional[asyncio.TimerHandle] = None

    async def open(self) -> None:
        """Begin.

        Raises:
            ProtocolError: The master's address is none.
        """
        self._loop = asyncio.get_running_loop()
        self._bus = Subscriber(self._names, self._take, self._open_stream, self._notice, self._on_shutdown)
        self._thread = threading.Thread(target=self._watch, name="graph-watch", daemon=True)
        self._want_topics(frozenset())
        self._loop.add_reader(self._bus.fileno(), self._bus.poll, 0.0)
        self._thread.start()
        self._tick()

    async def close(self) -> None:
        self._stop.set()
        self._wake.set()
        if self._clockwork is not None:
            self._clockwork.cancel()
        self._loop.remove_reader(self._bus.fileno())
        await self._loop.run_in_executor(None, self._thread.join)
        await self._loop.run_in_executor(None, self._bus.close)
        self._graph.close()

    def _tick(self) -> None:
        self._bus.poll(0.0)
        self._clockwork = self._loop.call_later(_CLOCKWORK_S, self._tick)

    # What viewers want

    def want(self, channels: FrozenSet[int]) -> None:
        self._want_topics(frozenset(self.channels[number].topic for number in channels if number in self.channels))

    def _want_topics(self, topics: FrozenSet[str]) -> None:
        if self._options.is_simulated_time:
            topics |= {CLOCK_TOPIC}
        if topics != self._wanted:
            self._wanted = topics
            self._wake.set()

    def subscribed(self, recipient: Recipient, channel: int) -> None:
        for stamp, payload in self._latched.get(channel, {}).values():
            recipient.deliver(channel, stamp, payload)

    def watch(self, parameters: bool, graph: bool) -> None:
        if self._graph.watch(parameters, graph):
            self._wake.set()

    def graph(self) -> Optional[SocketFrame]:
        return self._graph.whole_graph()

    async def parameters(self, names: Iterable[str]) -> List[Parameter]:
        return await self._loop.run_in_executor(None, self._graph.parameters, tuple(names))

    async def call(self, service: Service, payload: bytes) -> bytes:
        if self._calls is None:
            raise JakaBagError("services are not called from here; --allow-calls allows it")
        return await self._calls.call(service, payload)

    # Streams, in the server's loop

    def _accept(self, connection: Connection) -> bool:
        """Learn a channel from a publisher's header; return whether its messages are wanted."""
        topic = connection.topic
        if not self._options.accept(connection):
            return False
        known = self._by_topic.get(topic)
        key = (topic, connection.datatype, connection.md5sum, connection.definition)
        number = self._numbers.setdefault(key, len(self._numbers) + 1)
        if known is not None and known.id != number:
            if any(other == topic for _, other, _ in self._bus.links()):
                self._notice_once(topic, "%s is published as %s and as %s: only the first is shown"
                                  % (topic, known.schema_name, connection.datatype))
                return False
            self._forget(topic)
            known = None
        if known is None and self._options.selection.wants(topic):
            if not connection.definition:
                self._notice_once(topic, "%s: its publisher %s tells no definition; viewers may not be able to show it"
                                  % (topic, connection.callerid))
            self._by_topic[topic] = self.channels[number] = channel_of(number, connection)
            self.audience.advertise([self.channels[number]])
        self._wake.set()
        return topic in self._wanted

    def _forget(self, topic: str) -> None:
        channel = self._by_topic.pop(topic, None)
        if channel is not None:
            del self.channels[channel.id]
            self._latched.pop(channel.id, None)
            self.audience.unadvertise([channel.id])

    def _open_stream(self, connection: Connection, publisher: str) -> _Stream:
        channel = self._by_topic.get(connection.topic)
        return _Stream(0 if channel is None else channel.id, connection)

    def _take(self, stream: _Stream, stamp: int, payload: bytes) -> None:
        if self._options.is_simulated_time:
            if stream.connection.topic == CLOCK_TOPIC and len(payload) == _CLOCK.size:
                seconds, nanoseconds = _CLOCK.unpack(payload)
                self._now = seconds * NS_PER_S + nanoseconds
                self.audience.tell_time(self._now)
            stamp = self._now
        if stream.connection.latching:
            self._latched.setdefault(stream.channel, {})[stream.connection.callerid] = (stamp, payload)
        self.audience.deliver(stream.channel, stamp, payload)

    def _notice_once(self, key: str, text: str) -> None:
        if self._noticed.get(key) != text:
            self._noticed[key] = text
            self._notice(text)

    # The watching thread

    def _watch(self) -> None:
        is_lost = False
        with RemoteNode(master_uri(), self._names.node) as master:
            while not self._stop.is_set():
                self._wake.clear()
                try:
                    self._look_at_topics(master)
                    self._graph.look(master, self._tell)
                    if self._calls is not None:
                        self._calls.look(master, self._tell_services)
                    if is_lost:
                        is_lost = False
                        self._notice("the master is back")
                except ConnectionLost as error:
                    if not is_lost:
                        is_lost = True
                        self._notice("%s; waiting for it" % error)
                except ProtocolError as error:
                    self._notice_once("graph", str(error))
                except Exception as error:  # a defect here, or a graph that nobody foresaw: viewers keep what they have
                    self._notice_once("graph", "the graph is not understood: %r" % error)
                self._wake.wait(_WATCH_PERIOD_S)

    def _in_loop(self, act: Callable[..., Any], *arguments: Any) -> None:
        if not self._stop.is_set():
            self._loop.call_soon_threadsafe(act, *arguments)

    def _tell(self, changed: Dict[str, Parameter], graph: Optional[SocketFrame]) -> None:
        if changed:
            self._in_loop(self.audience.tell_parameters, changed)
        if graph is not None:
            self._in_loop(self.audience.tell_graph, graph)

    def _tell_services(self, services: Dict[int, Service], frames: List[SocketFrame]) -> None:
        def tell() -> None:
            self.services = services
            for frame in frames:
                self.audience.tell(frame)
        self._in_loop(tell)

    def _look_at_topics(self, master: RemoteNode) -> None:
        bus, wanted = self._bus, self._wanted
        if time.monotonic() >= self._registration_due:
            self._registration_due = time.monotonic() + REGISTRATION_PERIOD_S
            if bus.resubscribe():
                self._notice("registered again: the master was restarted")
        published = {str(topic) for topic, _ in master.call("getPublishedTopics", "")}
        known = frozenset(self._by_topic)
        for topic in known - published:
            self._in_loop(self._forget, topic)
        shown = {topic for topic in published if self._options.selection.wants(topic)}
        for topic in sorted(shown | wanted | set(self._registered)):
            goal = True if topic in wanted else False if topic in shown - known else None
            if goal is self._registered.get(topic):
                continue
            if topic in self._registered:
                del self._registered[topic]
                bus.unsubscribe(topic)
                self._in_loop(self._forget_latched, topic)
            if goal is not None:
                bus.subscribe(topic, self._accept)
                self._registered[topic] = goal

    def _forget_latched(self, topic: str) -> None:
        """Forget a topic's latched messages: publishers send them again to the next subscription."""
        channel = self._by_topic.get(topic)
        if channel is not None:
            self._latched.pop(channel.id, None)
