"""The interface of every format: a reader and a writer.

A format subclasses both, and states in ``LogWriter.capabilities`` what its files have a place for.
"""
import traceback
from typing import BinaryIO, Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple, Type, TypeVar

import numpy as np

from ..errors import BagError, BagFormatError, LimitReached, NotSupported, WriteFailed
from ..messages.batch import Array, MessageBatch, copy_pieces, distinct, uncovered, windows
from ..messages.connection import Connection
from ..messages.selection import MessageFilter
from ..output_file import OutputFile
from ..paths import PathLike
from ..pipeline import in_order
from .compression import Allowance, check_codec, compressor, is_readable
from .index import AttachmentIndex, Buffer, ChunkRef, LogIndex, MetadataIndex, read_at

Self = TypeVar("Self", bound="LogWriter")
_LOOKUP_LIMIT = 1 << 20
"""Largest connection number for which a table by number is made: a damaged one would take gigabytes."""
_NOT_DESCRIBED = "messages of a connection that the log does not describe"


class Message(NamedTuple):
    """One message as the log holds it; times in ns since the epoch."""

    connection: Connection
    log_time: int
    data: bytes
    publish_time: int
    sequence: int


class ParsedChunk(NamedTuple):
    """The records of a chunk.

    Attributes:
        batch: The messages; ``connection`` holds the file's own ids (int64).
        connections: Connections declared beside them, by the file's id.
        consumed: Bytes understood; fewer than the chunk has where it is damaged or cut off.
        is_misled: The chunk's index leads to other places than its messages.
    """

    batch: MessageBatch
    connections: Dict[int, Connection]
    consumed: int
    is_misled: bool = False


def chunk_of(begin: int, end: int, batch: MessageBatch, is_loose: bool) -> ChunkRef:
    """Return the index entry for messages that were read from bytes ``begin`` to before ``end``."""
    if not len(batch):
        return ChunkRef(begin, end, 0, 0, {}, is_loose)
    numbers = distinct(batch.connection).tolist()
    counts = np.bincount(batch.connection) if numbers[-1] < _LOOKUP_LIMIT else None
    return ChunkRef(begin, end, int(batch.log_time.min()), int(batch.log_time.max()), {
        number: int((batch.connection == number).sum() if counts is None else counts[number]) for number in numbers},
        is_loose, unpacked=int(batch.length.sum()))


def parse_chunk(raw: Buffer, offset: Optional[Array], regular: Callable[[Array, Array], Optional[MessageBatch]],
                scan: Callable[[int, int], ParsedChunk], head_size: Callable[[int], int]) -> ParsedChunk:
    """Parse a chunk's records: many at once where the index leads to regular ones, else one by one and exact.

    Args:
        raw: The uncompressed chunk.
        offset: Positions of messages by the index, ascending, int64; None where there is no index.
        regular: Returns the messages at offsets of the chunk's bytes, uint8; None where one is no regular record.
        scan: Returns the records between two bytes, read one by one, up to the first that is damaged or cut off.
        head_size: Returns the bytes of a message record before its payload, for one that begins at a byte.

    Raises:
        BagFormatError: A record is damaged.
    """
    if offset is not None:
        batch = regular(np.frombuffer(raw, np.uint8), offset)
        gaps = None if batch is None else uncovered(offset, batch.start + batch.length, len(raw))
        if batch is not None and gaps is not None:
            connections: Dict[int, Connection] = {}
            for begin, end in gaps:
                between = scan(begin, end)
                if between.consumed != end or len(between.batch):
                    break
                connections.update(between.connections)
            else:
                return ParsedChunk(batch, connections, len(raw))
    parsed = scan(0, len(raw))
    if parsed.consumed != len(raw):
        raise BagFormatError("a record in a chunk is damaged")
    starts = None if offset is None else [at + head_size(at) for at in offset.tolist()]
    return parsed._replace(is_misled=starts is not None and starts != parsed.batch.start.tolist())


class _Renumbering:
    """The file's ids of connections to this package's numbers, for whole arrays."""

    def __init__(self, numbers: Dict[int, int]) -> None:
        self._numbers = numbers
        self._table: Optional[Array] = None
        if not numbers or max(numbers) < _LOOKUP_LIMIT:
            self._table = np.full(max(numbers, default=0) + 1, -1, np.int32)
            for file_id, number in numbers.items():
                self._table[file_id] = number

    def __call__(self, ids: Array) -> Array:
        """Return the numbers of connections for their ids in the file.

        Raises:
            BagFormatError: An id is of a connection that the log does not describe.
        """
        if not len(ids):
            return ids.astype(np.int32)
        if int(ids.min()) < 0:  # else it counts from the table's end
            raise BagFormatError(_NOT_DESCRIBED)
        if self._table is not None and int(ids.max()) < len(self._table):
            number: Array = self._table[ids]
        else:
            values, inverse = np.unique(ids, return_inverse=True)
            number = np.array([self._numbers.get(v, -1) for v in values.tolist()], np.int32)[inverse]
        if int(number.min()) < 0:
            raise BagFormatError(_NOT_DESCRIBED)
        return number


class LogReader:
    """A log open for reading; ``load`` may be called by several threads at once. ``open_log`` makes it.

    What reads raises ``BagFormatError`` where a chunk, its index, an attachment or metadata is damaged.

    Args:
        file: The open file; it is closed with the reader.
        index: Index of the log.

    Attributes:
        index: Index of the log.
        connections: Its connections; batches refer to them by position.
        chunks: Its chunks in the order of the file.
        advice: Returns the text of an error without the advice to recover the log where that finds no message.
    """

    def __init__(self, file: BinaryIO, index: LogIndex) -> None:
        self.advice: Callable[[str], str] = str
        self._file = file
        self.index = index
        self.path = index.path
        self.connections: List[Connection] = index.connections
        self.chunks: List[ChunkRef] = index.chunks
        self._renumber = _Renumbering(index.numbers)
        self._allowance = Allowance(index.size)

    @property
    def message_count(self) -> int:
        """Messages in the log, by its index."""
        return sum(self.index.counts)

    def load(self, chunk: ChunkRef) -> MessageBatch:
        """Return the messages of one chunk, in the order of the file.

        Raises:
            BagFormatError: The chunk is damaged, or holds messages where by the index there are none.
        """
        batch = self._load(chunk)
        found = chunk_of(chunk.position, chunk.end, batch, chunk.is_loose)
        if found.counts and not (chunk.start_time <= found.start_time and found.end_time <= chunk.end_time
                                 and found.counts.keys() <= chunk.counts.keys()):
            raise BagFormatError("%s: the chunk at byte %d holds messages of times or topics that the index does not "
                                 "name (jaka_bag recover makes a log with a true index)" % (self.path, chunk.position))
        return batch

    def decode_only(self, wanted: Array) -> None:
        """Take a mask of connections; messages of the others need no form of ROS 1, and may be missing from chunks."""

    def _load(self, chunk: ChunkRef) -> MessageBatch:
        raw = read_at(self._file.fileno(), chunk.position, chunk.end - chunk.position)
        try:
            batch = self._parse(chunk, raw)
            return batch.replace(connection=self._renumber(batch.connection))
        except (LimitReached, NotSupported) as error:
            raise type(error)("%s: chunk at byte %d: %s" % (self.path, chunk.position, error)) from error
        except BagFormatError as error:
            traceback.clear_frames(error.__traceback__)  # they hold the chunk, and the advice may unpack it once more
            raise BagFormatError(self.advice("%s: chunk at byte %d: %s (jaka_bag recover keeps the rest)" % (
                self.path, chunk.position, error))) from error

    def index_of_records(self) -> LogIndex:
        """Return the index with the counts and times of the records, which are all read.

        Raises:
            BagFormatError: A chunk is damaged.
        """
        chunks = list(in_order(lambda chunk: chunk_of(
            chunk.position, chunk.end, self._load(chunk), chunk.is_loose), self.chunks))
        filled = [chunk for chunk in chunks if chunk.counts]
        return self.index._replace(
            chunks=chunks, counts=[sum(chunk.counts.get(number, 0) for chunk in filled)
                                   for number in range(len(self.connections))],
            start_time=min((chunk.start_time for chunk in filled), default=None),
            end_time=max((chunk.end_time for chunk in filled), default=None))

    def _parse(self, chunk: ChunkRef, raw: bytes) -> MessageBatch:
        raise NotImplementedError

    def _spend(self, chunk: ChunkRef, size: int, batch: MessageBatch) -> None:
        """Count what a chunk unpacked to, byte, against what it gave."""
        self._allowance.spend(chunk.position, size, len(batch), int(batch.length.sum()))

    def wanted_chunks(self, message_filter: MessageFilter) -> List[ChunkRef]:
        """Return the chunks that may hold a wanted message, in the order of the file."""
        return [chunk for chunk in self.chunks
                if message_filter.may_be_in(chunk.start_time, chunk.end_time, chunk.counts)]

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """Return the content of one of ``index.attachments``."""
        raise NotImplementedError

    def read_metadata(self, entry: MetadataIndex) -> Dict[str, str]:
        """Return the content of one of ``index.metadata``."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> "LogReader":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


class Capabilities(NamedTuple):
    """The features that a format has a place for besides connections, log times and payloads."""

    attachments: bool
    metadata: bool
    sequences: bool
    publish_times: bool


class EncodedChunk(NamedTuple):
    """One chunk ready to be written.

    Attributes:
        head: Its record up to the data.
        body: Its data, compressed.
        indexes: (the file's id of a connection, index record) for each connection in it.
        counts: Messages by the file's id of the connection.
        start_time: Earliest log time, ns.
        end_time: Latest log time, ns.
        codec: Compression of the body.
        size: Bytes of the data, uncompressed.
        declared: Connections, by the file's id, whose records it carries.
    """

    head: bytes
    body: Buffer
    indexes: List[Tuple[int, bytes]]
    counts: Dict[int, int]
    start_time: int
    end_time: int
    codec: str
    size: int
    declared: Tuple[int, ...] = ()


def message_records(batch: MessageBatch, heads: Array, prefix: bytes = b"") -> Tuple[Array, Array]:
    """Return consecutive message records, uint8, and the start of each, int64.

    Args:
        batch: Messages with the payloads.
        heads: Bytes before each payload, a structured array.
        prefix: Bytes before all records.
    """
    width = heads.dtype.itemsize
    size = batch.length + width
    offset = np.cumsum(size) - size + len(prefix)
    data = np.empty(len(prefix) + int(size.sum()), np.uint8)
    data[:len(prefix)] = np.frombuffer(prefix, np.uint8)
    windows(data, width)[offset] = heads.view("V%d" % width)
    copy_pieces(batch.data, batch.start, data, offset + width, batch.length)
    return data, offset


def by_connection(number: Array, times: Array) -> Iterator[Tuple[int, Array]]:
    """Yield (connection, positions of its messages in the order of time) for each connection."""
    for connection in distinct(number).tolist():
        which = np.flatnonzero(number == connection)
        own = times[which]
        if (own[1:] < own[:-1]).any():
            which = which[np.argsort(own, kind="stable")]
        yield connection, which


class LogWriter:
    """A log being written; nothing of the final name exists before ``close``.

    What writes raises ``WriteFailed`` where the system refuses; the file is whole up to the record before.

    Args:
        target: Final path.
        compression: One of ``codecs``; None for ``usual_codec``.
        level: The codec's level; None for its default.
        chunk_size: Single messages are collected up to this many bytes before a chunk is closed; None for
            ``usual_chunk_size``.
        overwrite: Replace an existing file.
        suffix: Suffix of the working name.
        keep_leftover: Refuse to take over the working file of a killed process.
        profile: MCAP profile, ``ros1`` or ``ros2``; a .bag has no place for it.

    Attributes:
        format_name: Name of the format for users.
        capabilities: Features that the format has a place for.
        codecs: Compressions of its chunks; ``usual_codec`` is the default.
        usual_chunk_size: Default chunk size, byte.
        name: The final name, for messages.
        position: Bytes written to the file so far.
        message_count: Messages in closed chunks so far.
        pending_bytes: Bytes of payload collected for the chunk that is not closed yet.

    Raises:
        BagError: The compression is not the format's, or the output cannot be created.
    """

    format_name = ""
    capabilities = Capabilities(False, False, False, False)
    codecs: Tuple[str, ...] = ()
    usual_codec = "none"
    usual_chunk_size = 1 << 20
    """Bytes of a chunk before compression: a larger one compresses little better, and is lost as a whole."""
    is_for_ros1 = False
    """The flag that ROS 1's own tools must be able to decompress the chunks."""

    def __init__(self, target: PathLike, compression: Optional[str] = None, level: Optional[int] = None,
                 chunk_size: Optional[int] = None, overwrite: bool = False, suffix: str = ".part",
                 keep_leftover: bool = False, profile: str = "ros1") -> None:
        self._codec = compression or self.usual_codec
        check_codec(self._codec, self.codecs, self.format_name)
        self._compress = compressor(self._codec, level, self.is_for_ros1)
        self._output = OutputFile(target, overwrite, suffix, keep_leftover)
        self.name = str(target)
        self.chunk_size = self.usual_chunk_size if chunk_size is None else chunk_size
        self.position = 0
        self.message_count = 0
        self._closed = False
        self._reset_pending()
        self._begin(profile)

    def _begin(self, profile: str) -> None:
        """Set up what the format needs besides, and write what precedes the first chunk."""
        raise NotImplementedError

    def _reset_pending(self) -> None:
        self._payloads: List[bytes] = []
        self._channels_pending: List[int] = []
        self._log_times: List[int] = []
        self._publish_times: List[int] = []
        self._sequences: List[int] = []
        self.pending_bytes = 0

    @property
    def pending_messages(self) -> int:
        """Messages collected for the chunk that is not closed yet."""
        return len(self._payloads)

    def fileno(self) -> int:
        """Return the file descriptor, for ``fsync``."""
        return self._output.file.fileno()

    def _write(self, *pieces: Buffer) -> int:
        """Write records; return the position of the first. On failure the file is truncated to its former size."""
        begin = self.position
        try:
            for piece in pieces:
                self._output.write(piece)
                self.position += len(piece)
        except OSError as error:
            self.position = begin
            self._output.file.truncate(begin)
            self._output.file.seek(begin)
            raise WriteFailed(self.name, error) from error
        return begin

    def _rewrite(self, at: int, data: bytes) -> None:
        """Replace bytes at a position of the file."""
        try:
            self._output.file.seek(at)
            self._output.write(data)
            self._output.file.seek(self.position)
        except OSError as error:
            raise WriteFailed(self.name, error) from error

    def add_channel(self, connection: Connection) -> int:
        """Return the number of a connection in this file; an equal connection gets the same number.

        Raises:
            BagError: The format cannot hold it.
        """
        raise NotImplementedError

    def encode(self, batch: MessageBatch, channel_ids: Array) -> Optional[EncodedChunk]:
        """Make a chunk of a batch; changes nothing of the writer, so several threads may encode at once.

        Args:
            batch: The messages.
            channel_ids: Number in this file of each of the batch's connections, by their number there.

        Returns:
            The chunk; None where there is no message.

        Raises:
            BagError: A time or the size of the batch does not fit into the format.
        """
        raise NotImplementedError

    def _packed(self, data: Array) -> Tuple[str, Buffer]:
        """Return the codec and the stored bytes of a chunk: none where readers would not unpack them."""
        if self._codec != "none" and is_readable(len(data)):
            return self._codec, self._compress(data.data)
        return "none", data.data

    def append(self, chunk: Optional[EncodedChunk]) -> None:
        """Write a chunk that ``encode`` made (None: nothing) after what was written so far."""
        raise NotImplementedError

    def add_attachment(self, name: str, data: bytes, media_type: str = "application/octet-stream",
                       log_time: int = 0, create_time: int = 0) -> None:
        """Add a file beside the messages; times in ns.

        Raises:
            BagError: The format has no place for it.
        """
        raise BagError("%s has no place for attachments" % self.format_name)

    def add_metadata(self, name: str, values: Dict[str, str]) -> None:
        """Add named facts about the file.

        Raises:
            BagError: The format has no place for them.
        """
        raise BagError("%s has no place for metadata" % self.format_name)

    def add_message(self, channel_id: int, log_time: int, payload: bytes, publish_time: Optional[int] = None,
                    sequence: int = 0) -> None:
        """Add one message; the chunk is closed when it has ``chunk_size`` bytes.

        Args:
            channel_id: Number from ``add_channel``.
            log_time: Time of recording, ns since the epoch.
            payload: The serialised message.
            publish_time: ns; None for ``log_time``. Kept where the format has a place for it.
            sequence: Message number, 0 where there is none. Kept where the format has a place for it.
        """
        self._payloads.append(payload)
        self._channels_pending.append(channel_id)
        self._log_times.append(log_time)
        self._publish_times.append(log_time if publish_time is None else publish_time)
        self._sequences.append(sequence)
        self.pending_bytes += len(payload)
        if self.pending_bytes >= self.chunk_size:
            self.flush()

    def flush(self) -> None:
        """Close the chunk of the single messages added so far and hand it to the system.

        Raises:
            WriteFailed: The system refused; the messages of this chunk are lost, the file before it is whole.
        """
        if not self._payloads:
            return
        length = np.array(list(map(len, self._payloads)), np.int64)
        channel = np.array(self._channels_pending, np.int32)
        batch = MessageBatch(np.frombuffer(b"".join(self._payloads), np.uint8), np.cumsum(length) - length, length,
                             channel, np.array(self._log_times, np.uint64).view(np.int64),
                             np.array(self._publish_times, np.uint64).view(np.int64),
                             np.array(self._sequences, np.uint64).astype(np.uint32))
        self._reset_pending()
        self.append(self.encode(batch, np.arange(int(channel.max()) + 1)))

    def _finish(self) -> None:
        """Write what follows the last chunk."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the last chunk, finish the file and give it its name.

        Raises:
            WriteFailed: The system refused; the working file stays, readable up to its last whole record.
            OutputExists: The final name was taken meanwhile; the working file stays.
        """
        if self._closed:
            return
        self.flush()
        self._finish()
        self._closed = True
        try:
            self._output.commit()
        except OSError as error:
            raise WriteFailed(self.name, error) from error

    def abort(self) -> None:
        """Give up: remove the working file."""
        self._closed = True
        self._output.abort()

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], *error: object) -> None:
        if kind is None:
            self.close()
        else:
            self.abort()
