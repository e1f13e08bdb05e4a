"""The messages of several logs in the order of time, read ahead by a thread, as they go to the wire."""
import queue
import threading
from typing import Any, Callable, Collection, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..containers.interface import LogReader
from ..containers.registry import open_log
from ..containers.ros1_view import as_ros1_log
from ..containers.time_order import Source, in_time_order
from ..errors import BagError
from ..messages.batch import Array, distinct
from ..messages.connection import Connection
from ..messages.selection import MessageFilter, Selection, unmatched
from .publisher import frame_of

_BATCH = 512
"""Messages in one batch: the reading thread hands over seldom, and the first one is there soon."""
_AHEAD = 32
"""Batches read ahead; with state-size messages this is some seconds of a log."""
_AHEAD_BYTES = 32 << 20
"""Bytes read ahead, where messages are large: of images 32 batches would be gigabytes."""


class Timed(NamedTuple):
    """One message to be played.

    Attributes:
        time: Log time, ns since the epoch.
        connection: Position in ``LogSource.connections``.
        frame: The message as the source's ``frame`` makes it.
    """

    time: int
    connection: int
    frame: bytes


class LogSource:
    """The messages of several logs as if they were one log.

    Args:
        paths: The logs, .bag or .mcap with ROS 1 messages.
        topics: Wanted topics; none for all.
        patterns: Wanted topics as regular expressions for whole names.
        exclude: Unwanted topics as regular expressions for whole names.
        frame: Makes of a message's bytes what goes to the wire; the length in front of them is TCPROS.
        is_any_encoding: Take messages of every kind, not only of ROS 1.

    Attributes:
        connections: The wanted connections of all logs; equal ones are one.
        begin: Earliest log time of the logs, ns; 0 where they are empty.
        end: Latest log time of the logs, ns.

    Raises:
        BagError: A log cannot be read, or holds messages of another kind than ROS 1.
    """

    def __init__(self, paths: Sequence[str], topics: Sequence[str] = (), patterns: Sequence[str] = (),
                 exclude: Sequence[str] = (), frame: Callable[[bytes], bytes] = frame_of,
                 is_any_encoding: bool = False) -> None:
        self._frame = frame
        self._is_any_encoding = is_any_encoding
        self._choice = Selection(tuple(topics), tuple(patterns), tuple(exclude))
        self._readers: List[LogReader] = []
        self.connections: List[Connection] = []
        self._numbers: List[Array] = []
        begins, ends = [], []
        try:
            for path in paths:
                reader = open_log(path) if is_any_encoding else as_ros1_log(open_log(path))
                self._readers.append(reader)
                self._numbers.append(self._number(reader))
                if reader.index.start_time is not None and reader.index.end_time is not None:
                    begins.append(reader.index.start_time)
                    ends.append(reader.index.end_time)
        except BaseException:
            self.close()
            raise
        self.begin = min(begins, default=0)
        self.end = max(ends, default=0)

    def _number(self, reader: LogReader) -> Array:
        numbers = np.zeros(len(reader.connections), np.int32)
        for i, wanted in enumerate(self._choice.wanted(reader.connections).tolist()):
            connection = reader.connections[i]
            if wanted and connection.encoding != "ros1" and not self._is_any_encoding:
                raise BagError("%s: %s is encoded as %s; only ROS 1 messages can be played"
                               % (reader.path, connection.topic, connection.encoding or "nothing known"))
            if wanted and connection not in self.connections:
                self.connections.append(connection)
            numbers[i] = self.connections.index(connection) if wanted else -1
        return numbers

    @property
    def notes(self) -> List[str]:
        """The records that were skipped in the logs, one line each."""
        return ["%s: %s" % (reader.path, note) for reader in self._readers for note in reader.index.notes]

    def unmatched(self) -> List[str]:
        """Return a line for each name that is wanted and that no log has."""
        return unmatched(self._choice, [connection for reader in self._readers for connection in reader.connections])

    def close(self) -> None:
        """Close the logs."""
        for reader in self._readers:
            reader.close()

    def _sources(self, selection: Selection) -> List[Source]:
        return [Source(reader, MessageFilter(selection, reader.connections), numbers)
                for reader, numbers in zip(self._readers, self._numbers)]

    def _batches(self, selection: Selection) -> Iterator[List[Timed]]:
        for batch in in_time_order(self._sources(selection)):
            buffer: Any = batch.data
            data = memoryview(buffer)
            for first in range(0, len(batch), _BATCH):
                part = batch.take(slice(first, first + _BATCH))
                yield [Timed(time, number, self._frame(data[start:start + length].tobytes()))
                       for time, number, start, length in zip(part.log_time.tolist(), part.connection.tolist(),
                                                              part.start.tolist(), part.length.tolist())]

    def last_before(self, time: int) -> List[Timed]:
        """Return the newest message of each latching connection before a log time, ns, in the order of time."""
        return self.newest(time - 1, [number for number, c in enumerate(self.connections) if c.latching])

    def newest(self, time: int, wanted: Collection[int]) -> List[Timed]:
        """Return the newest message of each wanted connection up to a log time, ns, in the order of time.

        Chunks are read from the end on, and only those which, by the index, may hold a message that is not found yet.
        """
        found: Dict[int, Timed] = {}
        parts = [(min(chunk.end_time, time), chunk.position, reader, numbers, chunk)
                 for reader, numbers in zip(self._readers, self._numbers)
                 for chunk in reader.chunks if chunk.start_time <= time]
        for last, _, reader, numbers, chunk in sorted(parts, key=lambda part: part[:2], reverse=True):
            missing = [number for number in wanted if number not in found or found[number].time < last]
            if not missing:
                break
            if chunk.counts and not set(numbers[list(chunk.counts)].tolist()) & set(missing):
                continue
            batch = reader.load(chunk).with_connections(numbers)
            batch = batch.take(np.isin(batch.connection, missing) & (batch.log_time <= time))
            for number in distinct(batch.connection).tolist():
                own = np.flatnonzero(batch.connection == number)[::-1]
                i = int(own[np.argmax(batch.log_time[own])])  # of several at one time the last
                if number not in found or found[number].time < int(batch.log_time[i]):
                    payload = batch.data[batch.start[i]:batch.start[i] + batch.length[i]].tobytes()
                    found[number] = Timed(int(batch.log_time[i]), number, self._frame(payload))
        return sorted(found.values())

    def play(self, begin: Optional[int], end: Optional[int], topics: Collection[str] = ()) -> "ReadAhead":
        """Return the wanted messages from a log time to another, ns, None for the whole; close it after use.

        Args:
            begin: First log time, ns.
            end: Last log time, ns.
            topics: The only topics among the wanted ones; none for all.
        """
        selection = self._choice._replace(start_time=begin, end_time=end)
        if topics:
            selection = selection._replace(topics=tuple(topics), patterns=())
        return ReadAhead(lambda: self._batches(selection))


class ReadAhead:
    """Batches that a thread prepares ahead of their use.

    Args:
        batches: Gives the batches; called in the thread.
    """

    def __init__(self, batches: Callable[[], Iterator[List[Timed]]]) -> None:
        self._queue: queue.Queue[Tuple[List[Timed], Optional[BaseException]]] = queue.Queue(_AHEAD)
        self._ahead_bytes = 0
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._fill, args=(batches,), name="read-ahead", daemon=True)
        self._thread.start()

    def _fill(self, batches: Callable[[], Iterator[List[Timed]]]) -> None:
        failure: Optional[BaseException] = None
        try:
            for batch in batches():
                size = sum(len(message.frame) for message in batch)
                while self._ahead_bytes + size > _AHEAD_BYTES and not self._queue.empty():
                    if self._closed.wait(0.01):
                        return
                self._ahead_bytes += size
                if not self._put((batch, None)):
                    return
        except BaseException as error:  # raised in the thread that plays
            failure = error
        self._put(([], failure))

    def _put(self, item: Tuple[List[Timed], Optional[BaseException]]) -> bool:
        while not self._closed.is_set():
            try:
                self._queue.put(item, timeout=0.1)
                return True
            except queue.Full:
                pass
        return False

    def __iter__(self) -> Iterator[Timed]:
        while True:
            batch, failure = self._queue.get()
            if failure is not None:
                raise failure
            if not batch:
                return
            self._ahead_bytes -= sum(len(message.frame) for message in batch)
            yield from batch

    def poll(self) -> Optional[List[Timed]]:
        """Return the next batch, an empty one at the end, None while none is ready; not to be mixed with iterating.

        Raises:
            BagError: The log cannot be read on.
        """
        try:
            batch, failure = self._queue.get_nowait()
        except queue.Empty:
            return None
        if failure is not None:
            raise failure
        self._ahead_bytes -= sum(len(message.frame) for message in batch)
        return batch

    def close(self) -> None:
        """Stop reading."""
        self._closed.set()
        self._thread.join()
