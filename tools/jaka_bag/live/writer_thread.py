"""The writer of log files: a bounded buffer between the thread that receives messages and one that writes them."""
import collections
import math
import struct
import threading
import time
from pathlib import Path
from typing import Callable, Deque, Dict, List, Optional, Protocol, Set, Tuple

from ..messages.connection import Connection
from ..units import NS_PER_S
from .stream_account import PublisherStream

_HEADER = struct.Struct("<III")
_TIME = struct.Struct("<II")
_TICK_S = 0.02
"""Period, s, with which the queue is written: a shorter one costs processor time, a longer one memory and lines at a
crash."""
_EARLIEST_NS = 1
"""Log time of messages under simulated time when no clock ever came (rosbag refuses 0)."""
_UNKNOWN_NS = 0
"""Log time, in the buffer, of messages that wait for the first ``/clock``."""
CLOCK_WAIT_S = 60.0
"""Longest wait of messages for the first ``/clock``, s; they are not on the disk meanwhile. Gazebo starts slowly."""

CLOCK_TOPIC = "/clock"

_Item = Tuple[PublisherStream, int, int, bytes]


class MessageFiles(Protocol):
    """The receiver of the writing thread's messages: ``RollingFiles``, or a black box, which keeps some of them."""

    messages: int
    finished: List[Path]

    @property
    def is_large_enough(self) -> bool:
        """True where no more is wanted."""

    def add(self, stream: PublisherStream, log_time: int, publish_time: int, payload: bytes) -> None:
        """Take one message; times in ns."""

    def tick(self) -> None:
        """Do what is due; called often."""

    def lose_chunk(self) -> None:
        """Count the messages of a chunk that could not be written as unwritten; where there is none do nothing."""

    def close(self) -> None:
        """Finish what is being written."""


class WriterThread:
    """A buffer that takes messages in the receiving thread and writes them in another.

    Args:
        open_files: Makes the receiver of messages; called in ``start``.
        buffer_bytes: Payload bytes that may wait for the writer; further ones are dropped and counted; 0 for no limit.
        is_simulated_time: Log times are those of ``/clock``, not the host's.
        limit: Messages to record of each topic; 0 for all.
        item_bytes: Cost of a waiting message besides its payload, byte.
        clock_wait_s: Longest wait of messages for the first ``/clock``; it ends, too, when half the buffer is used.
        notice: Takes a line for the user.
        on_stop: Called from the writing thread, with the reason, when recording cannot or need not go on.

    Attributes:
        failure: The error that ended the recording; None while it goes on or when a limit was reached.
        full_topics: Topics of which ``limit`` messages were taken.
        messages: Messages in finished files.
        finished_paths: Finished files, oldest first.
        clock: Newest time of ``/clock``, ns; None before the first.
        untimed: Messages that came before the first ``/clock``; they got its time, or the earliest where it came
            too late.
    """

    _files: MessageFiles

    def __init__(self, open_files: Callable[[], MessageFiles], buffer_bytes: int, notice: Callable[[str], None],
                 on_stop: Callable[[str], None], is_simulated_time: bool = False, limit: int = 0,
                 item_bytes: int = 0, clock_wait_s: float = CLOCK_WAIT_S) -> None:
        self._open_files = open_files
        self._buffer_bytes = buffer_bytes
        self._notice = notice
        self._on_stop = on_stop
        self._limit = limit
        self._item_bytes = item_bytes
        self._clock_wait_s = clock_wait_s
        self.is_simulated_time = is_simulated_time
        self.clock: Optional[int] = None
        self._first_clock: Optional[int] = None
        self._clock_wait_end: Optional[float] = None
        self._is_clock_missed = False
        self._streams: Dict[Tuple[Connection, str], PublisherStream] = {}
        self._newest_streams: Dict[Tuple[str, str], PublisherStream] = {}
        self._queue: Deque[_Item] = collections.deque()
        self._taken_bytes = 0
        self._passed_bytes = 0
        self._topic_counts: Dict[str, int] = {}
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="log-writer")
        self.failure: Optional[Exception] = None
        self.full_topics: Set[str] = set()
        self.untimed = 0
        self.finished_paths: List[str] = []
        self.messages = 0

    def start(self) -> None:
        """Create the first file and begin to write.

        Raises:
            BagError: The file cannot be created, or there is no room for it.
        """
        self._files = self._open_files()
        self._thread.start()

    def streams(self) -> List[PublisherStream]:
        """Return all streams seen so far."""
        return list(self._streams.values())

    def newest_streams(self) -> Dict[Tuple[str, str], PublisherStream]:
        """Return the stream opened last by (publisher's URI, topic): a node may advertise a topic with another type."""
        return dict(self._newest_streams)

    # The receiving thread

    def open_stream(self, connection: Connection, publisher: str, is_wanted: bool = True) -> PublisherStream:
        """Return the account of a new link; a publisher that comes back continues its own."""
        stream = self._streams.get((connection, publisher))
        if stream is not None:
            stream.reopen()
            self._newest_streams[publisher, connection.topic] = stream
            return stream
        for other in self.streams():
            if other.connection.topic == connection.topic and other.connection.md5sum != connection.md5sum:
                self._notice("%s: %s sends %s (md5 %s), %s sends %s (md5 %s); both are recorded" % (
                    connection.topic, other.connection.callerid, other.connection.datatype, other.connection.md5sum,
                    connection.callerid, connection.datatype, connection.md5sum))
                break
        stream = self._streams[connection, publisher] = PublisherStream(connection, publisher, is_wanted)
        self._newest_streams[publisher, connection.topic] = stream
        return stream

    def take(self, stream: PublisherStream, stamp: int, data: bytes) -> None:
        """Take one message.

        Args:
            stream: Stream from ``open_stream``.
            stamp: Host time of receipt, ns since the epoch.
            data: The serialised message.
        """
        stream.received += 1
        published = stamp
        if stream.has_header and len(data) >= 12:
            sequence, seconds, nanoseconds = _HEADER.unpack_from(data)
            if sequence != stream.next_sequence:
                stream.note_sequence(sequence)
            stream.next_sequence = sequence + 1
            published = seconds * NS_PER_S + nanoseconds
        if self.is_simulated_time:
            self._take_simulated(stream, published if stream.has_header else None, data)
        elif self._has_room(stream, len(data)):
            self._queue.append((stream, stamp, published, data))

    def _has_room(self, stream: PublisherStream, size: int) -> bool:
        size += self._item_bytes
        if self._buffer_bytes and self._taken_bytes - self._passed_bytes + size > self._buffer_bytes:
            stream.overflowed += 1
            return False
        self._taken_bytes += size
        return True

    def _take_simulated(self, stream: PublisherStream, published: Optional[int], data: bytes) -> None:
        if stream.connection.topic == CLOCK_TOPIC and len(data) == _TIME.size:
            seconds, nanoseconds = _TIME.unpack(data)
            clock = max(seconds * NS_PER_S + nanoseconds, _EARLIEST_NS)
            if self._first_clock is None:
                self._first_clock = clock
            self.clock = clock
        if not stream.is_wanted or not self._has_room(stream, len(data)):
            return
        if self.clock is None:
            self._queue.append((stream, _UNKNOWN_NS, published or 0, data))
            self.untimed += 1
        else:
            self._queue.append((stream, self.clock, self.clock if published is None else published, data))

    def finish(self) -> None:
        """Write everything taken so far and finish the file; no message may be taken any more.

        Raises:
            BagError: Why recording ended early or the file could not be finished.
        """
        self._ending.set()
        self._thread.join()
        if self.failure is not None:
            raise self.failure

    # The writing thread

    def _run(self) -> None:
        try:
            is_last = False
            while not is_last:
                is_last = self._ending.wait(_TICK_S)
                self._write_queue()
                self._files.tick()
                if self._files.is_large_enough:
                    self._on_stop("the file has the size asked for")
        except Exception as error:  # kept for finish(), which raises it: a recording must not end unnoticed
            self._fail(error)
        self._close_files()

    def _fail(self, error: Exception) -> None:
        self.failure = error
        self._files.lose_chunk()
        self._on_stop(str(error))
        self._ending.wait()
        while self._queue:
            self._queue.popleft()[0].unwritten += 1

    def _close_files(self) -> None:
        try:
            self._files.close()
        except Exception as error:
            self.failure = self.failure or error
        self.messages = self._files.messages
        self.finished_paths = [str(path) for path in self._files.finished]

    def _write_queue(self) -> None:
        queue, files, limit = self._queue, self._files, self._limit
        for _ in range(len(queue)):
            is_untimed = self.is_simulated_time and queue[0][1] == _UNKNOWN_NS
            if is_untimed and self._waits_for_clock():
                return
            stream, stamp, published, data = queue.popleft()
            if is_untimed:
                stamp = self._first_clock or _EARLIEST_NS
                published = published or stamp
            self._passed_bytes += len(data) + self._item_bytes
            if limit and not self._is_within_limit(stream.connection.topic):
                continue
            files.add(stream, stamp, published, data)

    def _waits_for_clock(self) -> bool:
        """Return whether messages are still held back for the first ``/clock``; what comes after them waits, too."""
        if self._first_clock is not None or self._is_clock_missed or self._ending.is_set():
            return False
        now = time.monotonic()
        if self._clock_wait_end is None:
            self._clock_wait_end = now + self._clock_wait_s
        waiting = self._taken_bytes - self._passed_bytes
        if now < self._clock_wait_end and 2 * waiting <= (self._buffer_bytes or math.inf):
            return True
        self._is_clock_missed = True
        self._notice("no /clock comes, though /use_sim_time is true: messages are stored with the earliest log time, "
                     "1 ns, until it does")
        return False

    def _is_within_limit(self, topic: str) -> bool:
        count = self._topic_counts[topic] = self._topic_counts.get(topic, 0) + 1
        if count >= self._limit and topic not in self.full_topics:
            self.full_topics.add(topic)
        return count <= self._limit
