"""Writes MCAP files, chunk by chunk with flat memory: single messages (the recorder) or blocks (conversion)."""
import struct
import zlib
from typing import BinaryIO, Dict, List, NamedTuple, Optional, Tuple, Union

import numpy as np

from ...errors import BagError
from ...messages.batch import Array, Block, copy_pieces, distinct, windows
from ...messages.connection import Connection
from ...paths import PathLike
from ..compression import MCAP_CODECS, check_codec, compressor
from ..index import AttachmentIndex, MetadataIndex
from ..writer import ChunkWriter
from . import records as fmt

LIBRARY = "jaka_ros_driver"
_HEAD_SIZE = fmt.MESSAGE_HEAD.size
_HEAD_TYPE = np.dtype([("op", "u1"), ("size", "<u8"), ("channel", "<u2"), ("sequence", "<u4"),
                       ("log_time", "<u8"), ("publish_time", "<u8")])


class EncodedChunk(NamedTuple):
    """One chunk ready to be written: its record in two parts, its message indexes, and its totals.

    ``indexes`` holds (channel, record); ``counts`` messages by channel; times are ns.
    """

    head: bytes
    body: bytes
    indexes: List[Tuple[int, bytes]]
    counts: Dict[int, int]
    start_time: int
    end_time: int
    uncompressed_size: int


def _message_indexes(channel: Array, log_time: Array,
                     offset: Array) -> Tuple[List[Tuple[int, bytes]], Dict[int, int]]:
    indexes: List[Tuple[int, bytes]] = []
    counts: Dict[int, int] = {}
    for number in distinct(channel).tolist():
        which = np.flatnonzero(channel == number)
        times = log_time[which]
        if (times[1:] < times[:-1]).any():
            which = which[np.argsort(times, kind="stable")]
        entries = np.empty((len(which), 2), "<u8")
        entries[:, 0] = log_time[which]
        entries[:, 1] = offset[which]
        raw = entries.tobytes()
        indexes.append((number, fmt.record(fmt.MESSAGE_INDEX, struct.pack("<HI", number, len(raw)) + raw)))
        counts[number] = len(which)
    return indexes, counts


def _records_of(block: Block, channel: Array) -> Tuple[Array, Array]:
    """Message records of a block, and where each starts."""
    size = block.length + _HEAD_SIZE
    offset = np.cumsum(size) - size
    data = np.empty(int(size.sum()), np.uint8)
    heads = np.empty(len(block), _HEAD_TYPE)
    heads["op"] = fmt.MESSAGE
    heads["size"] = size - fmt.RECORD_HEAD.size
    heads["channel"] = channel
    heads["sequence"] = block.sequence
    heads["log_time"] = block.log_time
    heads["publish_time"] = block.publish_time
    windows(data, _HEAD_SIZE)[offset] = heads.view("V%d" % _HEAD_SIZE)
    copy_pieces(block.data, block.start, data, offset + _HEAD_SIZE, block.length)
    return data, offset


class McapWriter(ChunkWriter):
    """An MCAP file being written; nothing of the final name exists before ``close``.

    Schemas and channels go to the data section ahead of their first message, so that a file that was cut off
    can be read to its last whole chunk.

    Args:
        target: Final path, or an open binary file (which is neither renamed nor closed).
        compression: ``none``, ``lz4`` or ``zstd``.
        level: The codec's level; None for the fast default.
        chunk_size: Single messages are collected up to this many bytes before a chunk is closed.
        overwrite: Replace an existing file.
        suffix: What the working name has more than the final one.
        keep_leftover: Refuse to take over the working file of a killed program.
        profile: MCAP profile; ``ros1`` or ``ros2``.

    Raises:
        BagError: The compression is not MCAP's, or the output cannot be created.
    """

    def __init__(self, target: Union[PathLike, BinaryIO], compression: str = "zstd", level: Optional[int] = None,
                 chunk_size: int = 1 << 20, overwrite: bool = False, suffix: str = ".part",
                 keep_leftover: bool = False, profile: str = "ros1") -> None:
        check_codec(compression, MCAP_CODECS, "MCAP")
        self._codec = compression
        self._compress = compressor(compression, level)
        self._schemas: Dict[Tuple[str, str, str], int] = {}
        self._schema_records: List[bytes] = []
        self._channels: Dict[Connection, int] = {}
        self._channel_records: List[bytes] = []
        self._channel_counts: Dict[int, int] = {}
        self._chunk_records: List[bytes] = []
        self._attachment_indexes: List[bytes] = []
        self._metadata_indexes: List[bytes] = []
        self._start_time: Optional[int] = None
        self._end_time = 0
        self._crc = 0
        super().__init__(target, chunk_size, overwrite, suffix, keep_leftover)
        self._write(fmt.MAGIC, fmt.header_record(profile, LIBRARY))

    def _write(self, *pieces: bytes) -> int:
        begin = super()._write(*pieces)
        for piece in pieces:
            self._crc = zlib.crc32(piece, self._crc)
        return begin

    def add_channel(self, connection: Connection) -> int:
        """Channel id of a connection; an equal connection gets the same id.

        Raises:
            BagError: More channels or types than MCAP can number.
            WriteFailed: The system refused.
        """
        known = self._channels.get(connection)
        if known is not None:
            return known
        if len(self._channels) >= fmt.MAX_CHANNELS:
            raise BagError("MCAP holds at most %d connections" % fmt.MAX_CHANNELS)
        key = (connection.datatype, connection.schema_encoding, connection.definition)
        pieces = []
        schema_id = self._schemas.get(key, 0)
        if not schema_id and connection.datatype:
            schema_id = len(self._schemas) + 1  # 0 stands for "no schema"
            pieces.append(fmt.schema_record(schema_id, connection))
        channel_id = len(self._channels) + 1
        pieces.append(fmt.channel_record(channel_id, schema_id, connection))
        self._write(*pieces)
        if len(pieces) == 2:
            self._schemas[key] = schema_id
            self._schema_records.append(pieces[0])
        self._channel_records.append(pieces[-1])
        self._channels[connection] = channel_id
        return channel_id

    def encode(self, block: Block, channel_ids: Array) -> Optional[EncodedChunk]:
        """Make a chunk of a block (None where it has no message); see ``ChunkWriter.encode``."""
        if not len(block):
            return None
        channel = channel_ids[block.connection]
        data, offset = _records_of(block, channel)
        indexes, counts = _message_indexes(channel, block.log_time, offset)
        body = self._compress(data.data)
        unsigned = block.log_time.view(np.uint64)
        start, end = int(unsigned.min()), int(unsigned.max())
        head = fmt.chunk_head(start, end, len(data), zlib.crc32(data.data), self._codec, len(body))
        return EncodedChunk(head, body, indexes, counts, start, end, len(data))

    def append(self, chunk: Optional[EncodedChunk]) -> None:
        """Write an encoded chunk (None: nothing) after what was written so far.

        Raises:
            WriteFailed: The system refused.
        """
        if chunk is None:
            return
        index_offsets = {}
        begin = self.position
        at = begin + len(chunk.head) + len(chunk.body)
        chunk_end = at
        for channel, raw in chunk.indexes:
            index_offsets[channel] = at
            at += len(raw)
        self._write(chunk.head, chunk.body, b"".join(raw for _, raw in chunk.indexes))
        self._chunk_records.append(fmt.chunk_index_record(fmt.ChunkIndex(
            chunk.start_time, chunk.end_time, begin, chunk_end - begin, index_offsets, at - chunk_end,
            "" if self._codec == "none" else self._codec, len(chunk.body), chunk.uncompressed_size)))
        for channel, count in chunk.counts.items():
            self._channel_counts[channel] = self._channel_counts.get(channel, 0) + count
            self.message_count += count
        self._start_time = chunk.start_time if self._start_time is None else min(self._start_time, chunk.start_time)
        self._end_time = max(self._end_time, chunk.end_time)

    def add_metadata(self, name: str, values: Dict[str, str]) -> None:
        """Add named facts about the file.

        Raises:
            WriteFailed: The system refused.
        """
        raw = fmt.metadata_record(name, values)
        begin = self._write(raw)
        self._metadata_indexes.append(fmt.metadata_index_record(MetadataIndex(begin, len(raw), name)))

    def add_attachment(self, name: str, data: bytes, media_type: str = "application/octet-stream",
                       log_time: int = 0, create_time: int = 0) -> None:
        """Add a file beside the messages; times in ns.

        Raises:
            WriteFailed: The system refused.
        """
        body = (struct.pack("<QQ", log_time, create_time) + fmt.text(name) + fmt.text(media_type)
                + struct.pack("<Q", len(data)) + data)
        raw = fmt.record(fmt.ATTACHMENT, body + struct.pack("<I", zlib.crc32(body)))
        begin = self._write(raw)
        self._attachment_indexes.append(fmt.attachment_index_record(AttachmentIndex(
            begin, len(raw), log_time, create_time, len(data), name, media_type)))

    def _statistics(self) -> bytes:
        return fmt.statistics_record(fmt.Statistics(
            self.message_count, len(self._schema_records), len(self._channel_records),
            len(self._attachment_indexes), len(self._metadata_indexes), len(self._chunk_records),
            self._start_time or 0, self._end_time, dict(sorted(self._channel_counts.items()))))

    def _finish(self) -> None:
        self._write(fmt.record(fmt.DATA_END, struct.pack("<I", self._crc)))
        summary_start = self.position
        self._crc = 0
        groups = ((fmt.SCHEMA, self._schema_records), (fmt.CHANNEL, self._channel_records),
                  (fmt.STATISTICS, [self._statistics()]), (fmt.CHUNK_INDEX, self._chunk_records),
                  (fmt.ATTACHMENT_INDEX, self._attachment_indexes), (fmt.METADATA_INDEX, self._metadata_indexes))
        offsets = []
        for opcode, records in groups:
            if records:
                begin = self._write(*records)
                offsets.append(fmt.record(fmt.SUMMARY_OFFSET, struct.pack("<BQQ", opcode, begin,
                                                                          self.position - begin)))
        offset_start = self._write(*offsets)
        self._write(fmt.RECORD_HEAD.pack(fmt.FOOTER, 20) + struct.pack("<QQ", summary_start, offset_start))
        self._write(struct.pack("<I", self._crc), fmt.MAGIC)
