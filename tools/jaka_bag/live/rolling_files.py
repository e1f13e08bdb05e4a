"""The file or files that a recording writes: names, chunks closed by age, splits, latched messages, a full disk."""
import itertools
import os
import resource
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple

from ..containers.interface import LogWriter
from ..containers.registry import create_log
from ..errors import BagError, WriteFailed
from ..log_records import DROPS, RECORDING
from ..units import NS_PER_S
from .stream_account import PublisherStream, TopicDrops, drops_as_metadata, drops_by_topic

WORKING_SUFFIX = ".active"
_SUMMARY_RESERVE = 64 * 1024
_SUMMARY_SHARE = 64
"""Room kept for the end of the file: a fixed part, byte, and a share of what was written."""
_SET_BACK_NS = NS_PER_S
"""Log times go back by less, ns, where messages of several links are read one after the other."""
_file_numbers = itertools.count(1)


class Attachment(NamedTuple):
    """A file to go into each log: name, content, media type."""

    name: str
    data: bytes
    media_type: str


@dataclass(frozen=True)
class FileSettings:
    """The settings for the files of a recording.

    Attributes:
        stem: Path of the log without number and suffix.
        container: ``mcap`` or ``bag``.
        compression: ``none``, ``lz4``, ``zstd`` (mcap) or ``bz2`` (bag).
        level: The codec's own level; None for the fast default.
        chunk_bytes: A chunk is closed at this size, byte.
        chunk_age_s: A chunk is closed when its first message came this long ago, s.
        fsync_s: Period, s, at which written data are forced to the disk; 0 leaves it to the system.
        split_bytes: A new file is begun at this size, byte, or the only one is large enough; None for never.
        split_s: A new file is begun after this log time, s; None for never. Where the clock is set back, the time from
            then on is added to the time before.
        is_split: Files are numbered.
        max_splits: Number of files that are kept, the oldest is removed; 0 keeps all.
        min_space: Recording stops when the disk has less than this left, byte.
        repeat_latched: Begin each further file with the newest message of each latched stream.
        overwrite: Replace files of the same name.
    """

    stem: Path
    container: str = "mcap"
    compression: str = "zstd"
    level: Optional[int] = None
    chunk_bytes: int = 1 << 20
    chunk_age_s: float = 1.0
    fsync_s: float = 1.0
    split_bytes: Optional[int] = None
    split_s: Optional[float] = None
    is_split: bool = False
    max_splits: int = 0
    min_space: int = 0
    repeat_latched: bool = False
    overwrite: bool = False

    def path(self, number: int) -> Path:
        """Return the final name of the file with this number, from 0."""
        return self.stem.with_name("%s%s.%s" % (self.stem.name, "_%d" % number if self.is_split else "",
                                                self.container))


class DiskFull(BagError):
    """The disk has no room for more; what was written before is whole."""


class RollingFiles:
    """The writer of messages into one file after the other, in one thread.

    Args:
        settings: Settings for the files.
        facts: Facts of the recording, stored in each MCAP file.
        attachments: Files stored in each MCAP file; those added since it began are stored when it is closed.
        streams: Gives all streams so far, for the account stored in each MCAP file.
        notice: Takes a line for the user.
        drops: Gives that account, where it is not that of all streams since they were opened.

    Attributes:
        finished: Final paths of whole files, oldest first.
        messages: Messages written into all files.

    Raises:
        BagError: The first file cannot be created, or the disk has no room for it.
    """

    def __init__(self, settings: FileSettings, facts: Dict[str, str], attachments: List[Attachment],
                 streams: Callable[[], List[PublisherStream]], notice: Callable[[str], None],
                 drops: Optional[Callable[[], Dict[str, TopicDrops]]] = None) -> None:
        self.settings = settings
        self._drops = drops or (lambda: drops_by_topic(streams()))
        self._facts = facts
        self._attachments = attachments
        self._attached: List[Attachment] = []
        self._notice = notice
        self.finished: List[Path] = []
        self.messages = 0
        self._serial = 0
        self._writer: Optional[LogWriter] = None
        self._begin_time: Optional[int] = None
        self._newest_time = 0
        self._chunk_born: Optional[float] = None
        self._latched: Dict[PublisherStream, Tuple[bytes, int]] = {}
        self._chunk_streams: Dict[PublisherStream, int] = {}
        self._largest_chunk = settings.chunk_bytes
        self._synced_at = time.monotonic()
        self._synced_position = 0
        self._open()

    def _open(self) -> None:
        s = self.settings
        path = s.path(self._serial)
        writer = create_log(path, s.compression, s.level, s.overwrite, chunk_size=s.chunk_bytes,
                            suffix=WORKING_SUFFIX, keep_leftover=not s.overwrite)
        self._writer = writer
        self._serial += 1
        self._file_number = next(_file_numbers)
        self._begin_time = None
        self._chunk_born = None
        self._synced_position = 0
        try:
            self._check_space(writer)
            self.add_metadata(RECORDING, self._facts)
            self._attached = list(self._attachments)
            for item in self._attached:
                self.add_attachment(item)
        except Exception:
            writer.abort()
            self._writer = None
            raise

    def add(self, stream: PublisherStream, log_time: int, publish_time: int, payload: bytes,
            sequence: Optional[int] = None) -> None:
        """Write one message; begin a new file where the settings demand it.

        Args:
            stream: Stream of the message.
            log_time: ns.
            publish_time: ns.
            payload: The serialised message.
            sequence: Its number among its publisher's; None for the stream's own count.
        """
        try:
            self._make_ready(log_time, len(payload))
            self._number(stream)
        except Exception:
            stream.unwritten += 1
            raise
        self.messages += 1
        stream.written += 1
        self._chunk_streams[stream] = self._chunk_streams.get(stream, 0) + 1
        self._put(stream, log_time, publish_time, payload, sequence)
        if stream.connection.latching:
            self._latched.pop(stream, None)  # in the order of messages, not of publishers
            self._latched[stream] = (payload, publish_time)

    def _make_ready(self, log_time: int, size: int) -> None:
        """Split, or close the chunk, where a message of that size asks for it."""
        if self._begin_time is None:
            self._begin_time = self._newest_time = log_time
        elif self._is_time_to_split(log_time):
            self._split(log_time)
        writer = self._writer
        assert writer is not None
        if writer.pending_bytes + size >= self.settings.chunk_bytes:
            self._flush(writer)
            self._check_space(writer, size)

    def _flush(self, writer: LogWriter) -> None:
        begin = writer.position
        writer.flush()
        self._largest_chunk = max(self._largest_chunk, writer.position - begin)
        self._chunk_done()

    def _number(self, stream: PublisherStream) -> None:
        """Have the stream numbered in the file that is being written."""
        if stream.channel_file != self._file_number:
            assert self._writer is not None
            stream.channel = self._writer.add_channel(stream.connection)
            stream.channel_file = self._file_number

    def _put(self, stream: PublisherStream, log_time: int, publish_time: int, payload: bytes,
             sequence: Optional[int] = None) -> None:
        writer = self._writer
        assert writer is not None
        if self._chunk_born is None:
            self._chunk_born = time.monotonic()
        number = stream.position if sequence is None else sequence
        writer.add_message(stream.channel, log_time, payload, publish_time, number & 0xFFFFFFFF)
        if not writer.pending_bytes:
            self._chunk_done()

    def _chunk_done(self) -> None:
        self._chunk_born = None
        self._chunk_streams.clear()

    def _has_split_size(self) -> bool:
        limit, writer = self.settings.split_bytes, self._writer
        return limit is not None and writer is not None and writer.position + writer.pending_bytes >= limit

    @property
    def is_large_enough(self) -> bool:
        """True where the only file wanted has reached its size."""
        return not self.settings.is_split and self._has_split_size()

    def _is_time_to_split(self, log_time: int) -> bool:
        s = self.settings
        assert self._begin_time is not None
        if log_time < self._newest_time - _SET_BACK_NS:
            self._begin_time -= self._newest_time - log_time
            self._newest_time = log_time
        self._newest_time = max(self._newest_time, log_time)
        has_split_age = s.split_s is not None and log_time - self._begin_time >= s.split_s * NS_PER_S
        return s.is_split and (has_split_age or self._has_split_size())

    def _split(self, log_time: int) -> None:
        self.close()
        if self.settings.max_splits and len(self.finished) >= self.settings.max_splits:
            self._remove(self.finished.pop(0))
        self._open()
        self._begin_time = log_time
        if self.settings.repeat_latched:
            for stream, (payload, publish_time) in self._latched.items():
                self._number(stream)
                self._put(stream, log_time, publish_time, payload)

    def _remove(self, path: Path) -> None:
        try:
            path.unlink()
        except FileNotFoundError:  # somebody has moved it away: it is theirs
            return
        except OSError as error:
            self._notice("cannot remove %s: %s" % (path, error.strerror))
            return
        self._notice("removed %s" % path)

    def tick(self) -> None:
        """Close an old chunk, force what is due to the disk, look at the room left; to be called often.

        Raises:
            DiskFull: Less room is left than asked for.
            WriteFailed: The system refused.
        """
        writer = self._writer
        assert writer is not None
        now = time.monotonic()
        if self._chunk_born is not None and now - self._chunk_born >= self.settings.chunk_age_s:
            self._flush(writer)
            self._check_space(writer)
        if self.settings.fsync_s and now - self._synced_at >= self.settings.fsync_s:
            self._synced_at = now
            if writer.position != self._synced_position:
                self._synced_position = writer.position
                self._sync(writer)
                self._check_space(writer)

    @property
    def size(self) -> int:
        """Bytes of the file that is being written, those of its unfinished chunk as they came."""
        return 0 if self._writer is None else self._writer.position + self._writer.pending_bytes

    def add_metadata(self, name: str, values: Dict[str, str]) -> None:
        """Add named facts to the file that is being written, where its format has a place for them."""
        if self._writer is not None and self._writer.capabilities.metadata:
            self._writer.add_metadata(name, values)

    def add_attachment(self, item: Attachment) -> None:
        """Add a file to the one that is being written, where its format has a place for it."""
        if self._writer is not None and self._writer.capabilities.attachments:
            self._writer.add_attachment(item.name, item.data, item.media_type, time.time_ns(), time.time_ns())

    def force(self) -> None:
        """Close the chunk and force all that was added to the disk.

        Raises:
            WriteFailed: The system refused.
        """
        writer = self._writer
        if writer is not None:
            self._flush(writer)
            self._sync(writer)

    def _sync(self, writer: LogWriter) -> None:
        try:
            os.fdatasync(writer.fileno())
        except OSError as error:
            raise WriteFailed(writer.name, error) from error

    def _check_space(self, writer: LogWriter, coming: int = 0) -> None:
        """Check that one more chunk with ``coming`` more bytes, and the end of the file, have room."""
        reserve = _SUMMARY_RESERVE + writer.position // _SUMMARY_SHARE + self._largest_chunk + coming
        disk = os.fstatvfs(writer.fileno())
        free = disk.f_bavail * disk.f_frsize
        if free < self.settings.min_space + reserve:
            raise DiskFull("the disk of %s is full: %.1f MB left" % (self.settings.stem, free / 1e6))
        limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
        if limit != resource.RLIM_INFINITY and limit - writer.position < reserve:
            raise DiskFull("%s is at the largest size that this process may write" % self.settings.stem)

    def lose_chunk(self) -> None:
        """Count the messages of the last chunk as unwritten, where it could not be written."""
        if self._writer is not None and self._writer.pending_messages:
            return
        for stream, count in self._chunk_streams.items():
            stream.unwritten += count
            stream.written -= count
            self.messages -= count
        self._chunk_done()

    def close(self) -> None:
        """Finish the file that is being written and give it its name.

        Raises:
            BagError: It could not be finished; what it holds stays under its working name.
        """
        writer = self._writer
        if writer is None:
            return
        try:
            self._flush(writer)
        except Exception as error:  # the file before this chunk is whole
            self.lose_chunk()
            self._notice("a chunk could not be written: %s" % error)
        for item in [item for item in self._attachments if item not in self._attached]:
            self.add_attachment(item)
        self.add_metadata(DROPS, drops_as_metadata(self._drops()))
        if self.settings.fsync_s:
            self._sync(writer)
        writer.close()
        self._writer = None
        self.finished.append(self.settings.path(self._serial - 1))
