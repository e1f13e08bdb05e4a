"""The wire log: every byte in and out with its time, and the arm's joints, as an MCAP file that Foxglove opens.

Channels ``/wire/command``, ``/wire/status``, ``/wire/poll`` hold one message for each piece read or sent. Its bytes are
in ``data`` as text, one character for each byte (Latin-1), so that nothing is lost and JSON stays readable. ``/joints``
holds the true joints of a simulated arm. Times are those of the host's monotonic clock, ns; received bytes have the
moment at which the system received them (Linux), sent ones that at which they were handed to it. Therefore a piece may
stand in the file behind one of another connection that is a little later.

A thread of its own writes the log, and flushes it at least once a second and when it is closed. The package ``mcap`` is
imported only when a log is written or read.
"""
import contextlib
import io
import json
import os
import queue
import threading
import time
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Tuple, Union

from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.protocol.ports import PORTS
from jaka_ros_driver.state import Vector

FLUSH_INTERVAL_S = 0.5
"""Longest time, s, until what came is in the file: a recorder that is killed loses no more."""
_QUEUE_LIMIT = 200000
"""Most pieces that wait for the disk: some minutes of a session; beyond it they are lost and counted, as memory would
grow."""
_JOINTS_TOPIC = "/joints"
_CLOCK = "clock"
_OFFSET = "realtime_minus_monotonic_ns"
_MAGIC = b"\x89MCAP0\r\n"

_WIRE_SCHEMA = {
    "type": "object", "title": "jaka.WireBytes", "properties": {
        "time_ns": {"type": "integer", "description": "monotonic clock of the host"},
        "what": {"type": "string", "description": "in, out, open, close, reset, half open"},
        "connection": {"type": "integer", "description": "counts the connections, from 1"},
        "data": {"type": "string", "description": "one character for each byte; peer's address for open, close"}}}
_JOINTS_SCHEMA = {
    "type": "object", "title": "jaka.TrueJoints", "properties": {
        "time_ns": {"type": "integer", "description": "monotonic clock of the host"},
        "simulated_s": {"type": "number", "description": "simulated time since the start, s"},
        "joint_position": {"type": "array", "items": {"type": "number"}, "description": "rad, joint 1 first"}}}


class WireLogError(JakaError):
    """A wire log that cannot be written or read."""


class WireEvent(NamedTuple):
    """One piece of bytes, or the beginning or end of a connection.

    Attributes:
        time_ns: Monotonic clock of the host.
        port: "command", "status" or "poll".
        connection: Counts the connections, from 1.
        what: "in", "out", "open", "close", "reset" or "half open".
        data: The bytes; for the other kinds the peer's address.
    """

    time_ns: int
    port: str
    connection: int
    what: str
    data: bytes


class TrueJoints(NamedTuple):
    """The true joints of a simulated arm.

    Attributes:
        time_ns: Monotonic clock of the host.
        simulated_s: Simulated time since the start, s.
        joint_position: rad (6,).
    """

    time_ns: int
    simulated_s: float
    joint_position: Vector


class WireLog:
    """The writer of a wire log; no method but ``close`` waits for the disk."""

    def __init__(self, path: str) -> None:
        """Create the file; raise WireLogError where mcap is missing, or the file exists or cannot be written."""
        writer = _mcap().writer
        try:
            self._file = open(path, "xb")
        except OSError as error:
            raise WireLogError("cannot write %s: %s" % (path, error)) from error
        self._writer: Any = writer.Writer(self._file, chunk_size=256 * 1024,
                                            compression=writer.CompressionType.LZ4)
        self._writer.start(profile="", library="jaka_ros_driver simulated controller")
        self._writer.add_metadata(_CLOCK, {_OFFSET: str(time.time_ns() - time.monotonic_ns())})
        self._channels = self._register()
        self._queue: queue.Queue[Optional[Tuple[str, int, Any]]] = queue.Queue(_QUEUE_LIMIT)
        self._newest: Dict[int, int] = {}
        self.lost = 0
        self._error: Optional[OSError] = None
        self._thread = threading.Thread(target=self._write, name="wire-log", daemon=True)
        self._thread.start()

    def _register(self) -> Dict[str, int]:
        def schema(definition: Dict[str, Any]) -> int:
            text = json.dumps(definition).encode("utf-8")
            number: int = self._writer.register_schema(definition["title"], "jsonschema", text)
            return number

        wire, joints = schema(_WIRE_SCHEMA), schema(_JOINTS_SCHEMA)
        channels = {"/wire/" + port: self._writer.register_channel("/wire/" + port, "json", wire)
                    for port in (*PORTS, "panel")}
        channels[_JOINTS_TOPIC] = self._writer.register_channel(_JOINTS_TOPIC, "json", joints)
        return channels

    def bytes_in(self, time_ns: int, port: str, connection: int, data: bytes) -> None:
        """Record received bytes."""
        self._note(port, time_ns, connection, "in", data)

    def bytes_out(self, time_ns: int, port: str, connection: int, data: bytes) -> None:
        """Record bytes that the network has taken."""
        self._note(port, time_ns, connection, "out", data)

    def event(self, time_ns: int, port: str, connection: int, what: str, peer: str) -> None:
        """Record that a connection began or ended; ``what`` as in ``WireEvent``."""
        self._note(port, time_ns, connection, what, peer.encode("ascii"))
        if what in ("close", "reset"):
            self._newest.pop(connection, None)

    def joints(self, time_ns: int, simulated_s: float, joint_position: Vector) -> None:
        """Record the true joints of the arm, rad (6,)."""
        self._put(_JOINTS_TOPIC, time_ns, (simulated_s, joint_position))

    def _note(self, port: str, time_ns: int, connection: int, what: str, data: bytes) -> None:
        """Queue an entry, with a time that does not lie before that of its connection's previous entry.

        Bytes that waited to be sent would otherwise be logged before their cause.
        """
        self._newest[connection] = time_ns = max(time_ns, self._newest.get(connection, 0))
        self._put("/wire/" + port, time_ns, (connection, what, data))

    def _put(self, topic: str, time_ns: int, content: Any) -> None:
        try:
            self._queue.put_nowait((topic, time_ns, content))
        except queue.Full:
            self.lost += 1

    def close(self) -> None:
        """Finish the file, with the number of lost messages in its metadata; raise WireLogError where it is not
        complete.
        """
        self._queue.put(None)
        self._thread.join()
        try:
            with self._file:
                if self._error is None:
                    self._writer.add_metadata("wire_log", {"lost_messages": str(self.lost)})
                    self._writer.finish()
        except OSError as error:
            self._error = error
        if self._error is not None:
            raise WireLogError("the wire log is not complete: %s" % self._error) from self._error

    def _write(self) -> None:
        try:
            self._write_all()
        except OSError as error:
            self._error = error
            while self._queue.get() is not None:
                self.lost += 1

    def _write_all(self) -> None:
        flushed_at = time.monotonic()
        while True:
            try:
                entry = self._queue.get(timeout=FLUSH_INTERVAL_S)
            except queue.Empty:
                entry = ("", 0, None)
            if entry is None:
                return
            topic, time_ns, content = entry
            if topic:
                self._writer.add_message(self._channels[topic], time_ns, _text(time_ns, content), time_ns)
            if time.monotonic() - flushed_at >= FLUSH_INTERVAL_S:
                self._writer.flush()
                flushed_at = time.monotonic()


def _text(time_ns: int, content: Any) -> bytes:
    if len(content) == 2:
        fields = {"time_ns": time_ns, "simulated_s": round(content[0], 6), "joint_position": content[1]}
    else:
        connection, what, data = content
        fields = {"time_ns": time_ns, "what": what, "connection": connection, "data": data.decode("latin-1")}
    return json.dumps(fields).encode("ascii")


def clock_offset_ns(path: str) -> int:
    """Return the offset from a log's times to real time, ns; 0 where the log has none. Errors are those of
    ``read_log``.
    """
    kinds = _mcap().records
    with _reading(path) as records:
        for record in records:
            if isinstance(record, kinds.Metadata) and record.name == _CLOCK:
                return int(record.metadata[_OFFSET])
            if isinstance(record, kinds.Message):
                break
    return 0


def read_log(path: str) -> List[Union[WireEvent, TrueJoints]]:
    """Return the messages of a wire log in the order of time; an unfinished log is read as far as it goes.

    Raises:
        WireLogError: The package mcap is missing, or the file cannot be read or is no wire log.
    """
    kinds = _mcap().records
    topics: Dict[int, str] = {}
    found: List[Union[WireEvent, TrueJoints]] = []
    with _reading(path) as records:
        for record in records:
            if isinstance(record, kinds.Channel):
                topics[record.id] = record.topic
            elif isinstance(record, kinds.Message):
                found.append(_parsed(topics[record.channel_id], json.loads(record.data)))
    return sorted(found, key=lambda entry: entry.time_ns)  # each connection's stay in the order of the file


def _mcap() -> Any:
    try:
        import mcap.stream_reader  # and with it exceptions and records
        import mcap.writer
    except ImportError as error:
        raise WireLogError("a wire log needs the Python package mcap: %s" % error) from error
    return mcap


class _WholeReads(io.BufferedReader):
    """A file whose reads return all the bytes asked for, or raise EOFError: an unfinished log may end at any byte."""

    def __init__(self, path: str) -> None:
        super().__init__(io.FileIO(path))
        self._size = os.fstat(self.fileno()).st_size

    def read(self, size: Optional[int] = -1) -> bytes:
        if size is not None and size > self._size - self.tell():
            raise EOFError
        return super().read(size)


@contextlib.contextmanager
def _reading(path: str) -> Iterator[Iterator[Any]]:
    """Open a log and yield its records, up to where an unfinished log ends; errors become WireLogErrors."""
    reader = _mcap().stream_reader
    try:
        with _WholeReads(path) as file:
            if not _MAGIC.startswith(file.peek(len(_MAGIC))[:len(_MAGIC)]):
                raise ValueError("it does not begin as an MCAP file")
            yield reader.StreamReader(file).records
    except EOFError:
        return
    except Exception as error:  # the library raises whatever its parser meets in damaged bytes
        raise WireLogError("cannot read %s as a wire log: %s: %s" % (path, type(error).__name__, error)) from error


def _parsed(topic: str, fields: Dict[str, Any]) -> Union[WireEvent, TrueJoints]:
    if topic == _JOINTS_TOPIC:
        return TrueJoints(fields["time_ns"], fields["simulated_s"], tuple(fields["joint_position"]))
    return WireEvent(fields["time_ns"], topic.rsplit("/", 1)[-1], fields["connection"], fields["what"],
                     fields["data"].encode("latin-1"))
