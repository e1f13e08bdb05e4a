"""One recording from start to end: search for topics, subscriptions, publishers' statistics, orderly end.

What asks the master raises ``ConnectionLost`` where it does not answer, ``ProtocolError`` where it refuses.
"""
import contextlib
import json
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Set, Tuple

from ..errors import ConnectionLost, JakaBagError, ProtocolError
from ..interrupts import Flag
from ..messages.connection import Connection
from ..units import NS_PER_S
from .bus_statistics import ask_publishers
from .graph import REGISTRATION_PERIOD_S, RemoteNode
from .stream_account import PublisherStream
from .subscriber import Subscriber
from .topic_selection import TopicSelection
from .writer_thread import CLOCK_TOPIC, WriterThread

_WATCH_PERIOD_S = 0.2
"""Period, s, of the looks at the graph: a new publisher's first messages are missed for so long at most."""
_STATISTICS_PERIOD_S = 5.0
"""Period, s, of asking publishers for their counts: each is asked by a call of its own."""
_STATISTICS_WAIT_S = 1.5
"""Longest wait, s, for all of them; what does not answer is left out of the account."""
_DRAIN_S = 0.5
"""Longest wait, s, at the end for messages that publishers say they have sent."""
_POLL_S = 0.1
"""Longest wait, s, for messages: the delay with which an end is seen."""
_LOSS_NOTICE_PERIOD_S = 10.0
"""Least time, s, between two notices of losses, which may go on for hours."""
_ABSENT_NOTICE_S = 5.0
"""Time, s, after which topics that are asked for by name and not published are named."""
_INTERFACE_PERIOD_S = 0.5
"""Time between two looks for a node's topics, s: the master lists the whole graph for it."""
_NO_INTERFACE = ("/rosout", "/rosout_agg", CLOCK_TOPIC)
"""Topics that any node has."""


class RecordingSession:
    """A recording session, which joins a transport, a selection and a recorder.

    Args:
        recorder: Receiver of the messages; not started yet.
        selection: The topics wanted.
        accept: Returns whether a publisher's stream on a wanted topic belongs to the log.
        notice: Takes a line for the user.
        duration_s: Recording ends after this time, s; None for never. Log time where that is simulated.
        new_publishers: Called when publishers have been connected, with the master that knows them.

    Attributes:
        stop: Set to end the recording.
        end_reason: Reason of the end, for the user.
    """

    def __init__(self, recorder: WriterThread, selection: TopicSelection, accept: Callable[[Connection], bool],
                 notice: Callable[[str], None], duration_s: Optional[float] = None,
                 new_publishers: Callable[[RemoteNode], None] = lambda master: None) -> None:
        self._recorder = recorder
        self._new_publishers = new_publishers
        self._links = 0
        self._selection = selection
        self._accept = accept
        self._notice = notice
        self._duration_s = duration_s
        self._subscribed: Set[str] = set()
        self._interface_due = self._registration_due = 0.0
        self._is_master_lost = False
        self._noticed: Dict[str, str] = {}
        self._watcher = threading.Thread(target=self._watch, name="graph-watch", daemon=True)
        self._transport: Optional[Subscriber] = None
        self.stop = Flag()
        self.end_reason = ""

    def open_stream(self, connection: Connection, publisher: str) -> PublisherStream:
        """Return the account of a new link; called by the transport."""
        is_wanted = self._selection.node is not None or not self._is_clock_only(connection.topic)
        return self._recorder.open_stream(connection, publisher, is_wanted)

    def end(self, reason: str) -> None:
        """End the recording; may be called from any thread or a signal handler."""
        if self.stop.is_set():
            return
        self.end_reason = reason
        self.stop.set()
        if self._transport is not None:
            self._transport.wake()

    def run(self, connect: Callable[[], Subscriber], use_clock: bool) -> None:
        """Record until stopped.

        Args:
            connect: Makes the transport, which delivers to the recorder; called when there is a file to write to.
            use_clock: Listen to ``/clock`` for log times.

        Raises:
            BagError: Why recording ended early or the file could not be finished.
        """
        self._recorder.start()
        try:
            self._transport = connect()
        except BaseException:
            self._recorder.finish()
            raise
        self._record(self._transport, use_clock)

    def _record(self, transport: Subscriber, use_clock: bool) -> None:
        try:
            if use_clock:
                self._subscribe(CLOCK_TOPIC)
            self._watcher.start()
            begin: Optional[float] = None
            newest = 0.0
            while not self.stop.is_set():
                now = time.monotonic()
                if use_clock:
                    now = (self._recorder.clock or 0) / NS_PER_S
                if begin is None and now:
                    begin = now
                if begin is not None and now < newest:  # a simulation starts anew: what has passed counts
                    begin -= newest - now
                newest = now
                if self._duration_s is not None and begin is not None and now - begin >= self._duration_s:
                    self.end("the time is over")
                else:
                    transport.poll(_POLL_S)
            self._drain(transport)
        finally:
            self.stop.set()
            if self._watcher.ident is not None:
                self._watcher.join()
            with contextlib.suppress(ConnectionLost, ProtocolError):
                self._look_for_publishers(transport)  # one may have been connected while messages in flight arrived
            transport.close()
            self._recorder.finish()

    def _drain(self, transport: Subscriber) -> None:
        """Compare with the publishers' own counts, once all messages in flight have arrived."""
        if self._recorder.failure is not None:
            return
        answer: List[Any] = []
        asker = threading.Thread(target=lambda: answer.append(self._ask_publishers(transport)), daemon=True)
        asker.start()
        while asker.is_alive():
            transport.poll(0.01)
        sent = answer[0] if answer else {}
        late = self._counted(sent)
        deadline = time.monotonic() + _DRAIN_S
        while time.monotonic() < deadline and any(s.received - s.link_start < count for s, count in late):
            transport.poll(0.01)
        for stream, count in late:
            stream.note_sent(count, is_final=True)

    def _counted(self, sent: Dict[Tuple[str, str], int]) -> List[Tuple[PublisherStream, int]]:
        """Return the streams that publishers count, with these counts; they are of the present links."""
        streams = self._recorder.newest_streams() if sent else {}
        return [(streams[key], count) for key, count in sent.items() if key in streams]

    def _ask_publishers(self, transport: Subscriber) -> Dict[Any, int]:
        return ask_publishers({uri for _, _, uri in transport.links()}, transport.names.node, _STATISTICS_WAIT_S)

    # The watching thread

    def _watch(self) -> None:
        assert self._transport is not None
        statistics_at = time.monotonic() + _STATISTICS_PERIOD_S
        loss_notice_at = 0.0
        absent_notice_at = time.monotonic() + _ABSENT_NOTICE_S
        while True:
            try:
                self._look_at_graph(self._transport)
                self._look_for_publishers(self._transport)
                if self._is_master_lost:
                    self._is_master_lost = False
                    self._notice("the master is back")
            except ConnectionLost as error:
                if not self._is_master_lost:
                    self._is_master_lost = True
                    self._notice("%s; recording goes on, waiting for it" % error)
            except ProtocolError as error:
                self._notice_once("graph", str(error))
            except Exception as error:  # a defect here, or a graph that nobody foresaw: recording goes on
                self._notice_once("graph", "the graph is not understood: %r" % error)
            try:
                now = time.monotonic()
                if now >= statistics_at:
                    statistics_at = now + _STATISTICS_PERIOD_S
                    for stream, count in self._counted(self._ask_publishers(self._transport)):
                        stream.note_sent(count)
                if now >= loss_notice_at:
                    loss_notice_at = now + _LOSS_NOTICE_PERIOD_S
                    self._notice_overflow()
                if now >= absent_notice_at:
                    absent_notice_at = float("inf")
                    self._notice_absent()
            except Exception as error:  # neither does this end the watch, or the watch this
                self._notice_once("account", "the publishers' counts are not understood: %r" % error)
            if self.stop.wait(_WATCH_PERIOD_S):
                return

    def _look_for_publishers(self, transport: Subscriber) -> None:
        links = len(transport.links())
        if links > self._links:
            self._new_publishers(transport.master)
        self._links = links

    def _look_at_graph(self, transport: Subscriber) -> None:
        master = transport.master
        if time.monotonic() >= self._registration_due:
            self._registration_due = time.monotonic() + REGISTRATION_PERIOD_S
            if transport.resubscribe():
                self._notice("registered again: the master was restarted")
        for topic in self._selection.names:
            if not self._selection.is_excluded(topic):
                self._subscribe(topic)
        if self._selection.everything or self._selection.patterns:
            for topic, _ in master.call("getPublishedTopics", ""):
                if self._selection.wants(topic):
                    self._subscribe(topic)
        if self._selection.node is not None:
            self._subscribe_as(self._selection.node, master)
        if self._selection.interface_of is not None and time.monotonic() >= self._interface_due:
            self._interface_due = time.monotonic() + _INTERFACE_PERIOD_S
            self._subscribe_interface(self._selection.interface_of, master)
        full = self._recorder.full_topics
        for topic in full & self._subscribed:
            if topic not in self._noticed:
                self._noticed[topic] = "full"
                transport.unsubscribe(topic)
        if full and {t for t in self._subscribed if not self._is_clock_only(t)} <= full:
            self.end("each topic has reached its limit")

    def _subscribe_interface(self, node: str, master: RemoteNode) -> None:
        """Subscribe to what a node publishes and listens to; who sends to it is in any namespace."""
        publishers, subscribers, _ = master.call("getSystemState")
        for topic, nodes in [*publishers, *subscribers]:
            if node in nodes and topic not in _NO_INTERFACE and not self._selection.is_excluded(topic):
                self._subscribe(topic, lambda connection: True)

    def _subscribe_as(self, node: str, master: RemoteNode) -> None:
        try:
            uri = str(master.call("lookupNode", node))
            with RemoteNode(uri, node) as peer:
                for topic, _ in peer.call("getSubscriptions"):
                    if not self._selection.is_excluded(topic):
                        self._subscribe(topic)
        except (ConnectionLost, ProtocolError) as error:
            self._notice_once("node", "waiting for node %s: %s" % (node, error))

    def _subscribe(self, topic: str, accept: Optional[Callable[[Connection], bool]] = None) -> None:
        if topic not in self._subscribed:
            assert self._transport is not None
            self._transport.subscribe(topic, accept or self._accept)
            self._subscribed.add(topic)

    def _is_clock_only(self, topic: str) -> bool:
        return topic == CLOCK_TOPIC and not self._selection.wants(topic)

    def _notice_once(self, key: str, text: str) -> None:
        if self._noticed.get(key) != text:
            self._noticed[key] = text
            self._notice(text)

    def _notice_absent(self) -> None:
        there = {stream.connection.topic for stream in self._recorder.streams()}
        absent = [topic for topic in self._selection.names if topic not in there]
        if absent and self._selection.interface_of is None:
            self._notice("nobody publishes %s yet" % ", ".join(absent))

    def _notice_overflow(self) -> None:
        lost = sum(stream.overflowed for stream in self._recorder.streams())
        if lost:
            self._notice_once("overflow", "the buffer is full: %d messages thrown away so far" % lost)


def read_parameter(master: RemoteNode, name: str) -> Any:
    """Return a parameter of the master's server; None where it is not set."""
    try:
        return master.call("getParam", name)
    except ProtocolError:
        return None


def parameter_dump(master: RemoteNode) -> bytes:
    """Return all parameters as ``as_yaml`` has them."""
    return as_yaml(master.call("getParam", "/"))


def as_yaml(parameters: Any) -> bytes:
    """Return parameters as JSON, which ``rosparam load`` reads as YAML; values that JSON lacks become text."""
    return json.dumps(parameters, indent=1, sort_keys=True, default=str).encode() + b"\n"


def wait_for_master(master: RemoteNode, stop: Flag, notice: Callable[[str], None]) -> bool:
    """Wait until the master answers; return False when stopped before."""
    is_noticed = False
    while not stop.is_set():
        try:
            master.call("getPid")
            return True
        except JakaBagError as error:
            if not is_noticed:
                is_noticed = True
                notice("%s; waiting for the master" % error)
            stop.wait(1.0)
    return False
