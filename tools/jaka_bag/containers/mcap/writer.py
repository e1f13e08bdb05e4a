"""The writer of MCAP files, chunk by chunk with flat memory: single messages (the recorder) or batches (conversion)."""
import struct
import zlib
from typing import Dict, List, Optional, Tuple

import numpy as np

from ...errors import BagError
from ...messages.batch import Array, MessageBatch
from ...messages.connection import Connection
from ..compression import MCAP_CODECS
from ..index import Buffer
from ..interface import Capabilities, EncodedChunk, LogWriter, by_connection, message_records
from . import records as fmt
from .reader import HEAD_TYPE

LIBRARY = "jaka_ros_driver"


def text(value: str) -> bytes:
    """Encode a string for MCAP; a character that is not valid Unicode becomes a question mark."""
    raw = value.encode("utf-8", "replace")
    return struct.pack("<I", len(raw)) + raw


def text_map(values: Dict[str, str]) -> bytes:
    """Encode a map of strings for MCAP."""
    raw = b"".join(text(key) + text(value) for key, value in values.items())
    return struct.pack("<I", len(raw)) + raw


def record(opcode: int, body: bytes) -> bytes:
    """Encode one whole record."""
    return fmt.RECORD_HEAD.pack(opcode, len(body)) + body


def header_record(profile: str, library: str) -> bytes:
    """Encode the first record of a file."""
    return record(fmt.HEADER, text(profile) + text(library))


def schema_record(schema_id: int, connection: Connection) -> bytes:
    """Encode the definition of a connection's type."""
    raw = connection.definition.encode("utf-8", "surrogateescape")
    return record(fmt.SCHEMA, struct.pack("<H", schema_id) + text(connection.datatype)
                  + text(connection.schema_encoding) + struct.pack("<I", len(raw)) + raw)


def channel_metadata(connection: Connection) -> Dict[str, str]:
    """Return a channel's metadata besides topic and type in the ``ros1`` profile (MCAP profile registry)."""
    values = {}
    if connection.md5sum:
        values["md5sum"] = connection.md5sum
    if connection.callerid is not None:
        values["callerid"] = connection.callerid
    if connection.latching is not None:
        values["latching"] = "true" if connection.latching else "false"
    for key, value in connection.extra:
        values.setdefault(key, value)
    return values


def channel_record(channel_id: int, schema_id: int, connection: Connection) -> bytes:
    """Encode one connection; its type is that of ``schema_id`` (0: none)."""
    return record(fmt.CHANNEL, struct.pack("<HH", channel_id, schema_id) + text(connection.topic)
                  + text(connection.encoding) + text_map(channel_metadata(connection)))


def chunk_head(start_time: int, end_time: int, uncompressed_size: int, crc: int, codec: str, stored: int) -> bytes:
    """Encode a chunk record up to its ``stored`` bytes of compressed records; times in ns."""
    name = text("" if codec == "none" else codec)
    body = struct.pack("<QQQI", start_time, end_time, uncompressed_size, crc) + name + struct.pack("<Q", stored)
    return fmt.RECORD_HEAD.pack(fmt.CHUNK, len(body) + stored) + body


def _number_map(values: Dict[int, int]) -> bytes:
    """Encode a map of uint16 to uint64 for MCAP."""
    return struct.pack("<I", 10 * len(values)) + b"".join(struct.pack("<HQ", *pair) for pair in values.items())


class McapWriter(LogWriter):
    """An MCAP file being written; see ``LogWriter``.

    Schemas and channels go to the data section ahead of their first message, so that a file that was cut off
    can be read to its last whole chunk.
    """

    format_name = "MCAP"
    capabilities = Capabilities(True, True, True, True)
    codecs = MCAP_CODECS
    usual_codec = "zstd"

    def _begin(self, profile: str) -> None:
        self._schemas: Dict[Tuple[str, str, str], int] = {}
        self._channels: Dict[Connection, int] = {}
        self._channel_counts: Dict[int, int] = {}
        self._summary: Dict[int, List[bytes]] = {opcode: [] for opcode in (
            fmt.SCHEMA, fmt.CHANNEL, fmt.STATISTICS, fmt.CHUNK_INDEX, fmt.ATTACHMENT_INDEX, fmt.METADATA_INDEX)}
        self._start_time: Optional[int] = None
        self._end_time = 0
        self._crc = 0
        self._write(fmt.MAGIC, header_record(profile, LIBRARY))

    def _write(self, *pieces: Buffer) -> int:
        begin = super()._write(*pieces)
        for piece in pieces:
            self._crc = zlib.crc32(piece, self._crc)
        return begin

    def add_channel(self, connection: Connection) -> int:
        """Return the number of a connection; see ``LogWriter.add_channel``. MCAP's numbers are limited."""
        known = self._channels.get(connection)
        if known is not None:
            return known
        if len(self._channels) >= fmt.MAX_CHANNELS:
            raise BagError("MCAP holds at most %d connections" % fmt.MAX_CHANNELS)
        key = (connection.datatype, connection.schema_encoding, connection.definition)
        pieces = []
        schema_id = self._schemas.get(key, 0)
        is_told = connection.datatype or connection.definition or connection.schema_encoding not in ("", "ros1msg")
        if not schema_id and is_told:  # a schema of JSON may have no name
            schema_id = len(self._schemas) + 1  # 0 stands for "no schema"
            pieces.append(schema_record(schema_id, connection))
        channel_id = len(self._channels) + 1
        pieces.append(channel_record(channel_id, schema_id, connection))
        self._write(*pieces)
        if len(pieces) == 2:
            self._schemas[key] = schema_id
            self._summary[fmt.SCHEMA].append(pieces[0])
        self._summary[fmt.CHANNEL].append(pieces[-1])
        self._channels[connection] = channel_id
        return channel_id

    def encode(self, batch: MessageBatch, channel_ids: Array) -> Optional[EncodedChunk]:
        """Make a chunk of a batch (None where it has no message); see ``LogWriter.encode``."""
        if not len(batch):
            return None
        channel = channel_ids[batch.connection]
        heads = np.empty(len(batch), HEAD_TYPE)
        heads["op"] = fmt.MESSAGE
        heads["size"] = batch.length + (heads.dtype.itemsize - fmt.RECORD_HEAD.size)
        heads["channel"] = channel
        heads["sequence"] = batch.sequence
        heads["log_time"] = batch.log_time
        heads["publish_time"] = batch.publish_time
        data, offset = message_records(batch, heads)
        indexes, counts = [], {}
        for number, which in by_connection(channel, batch.log_time):
            entries = np.empty((len(which), 2), "<u8")
            entries[:, 0] = batch.log_time[which]
            entries[:, 1] = offset[which]
            raw = entries.tobytes()
            indexes.append((number, record(fmt.MESSAGE_INDEX, struct.pack("<HI", number, len(raw)) + raw)))
            counts[number] = len(which)
        codec, body = self._packed(data)
        unsigned = batch.log_time.view(np.uint64)
        start, end = int(unsigned.min()), int(unsigned.max())
        head = chunk_head(start, end, len(data), zlib.crc32(data.data), codec, len(body))
        return EncodedChunk(head, body, indexes, counts, start, end, codec, len(data))

    def append(self, chunk: Optional[EncodedChunk]) -> None:
        """Write a chunk; see ``LogWriter.append``."""
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
        self._summary[fmt.CHUNK_INDEX].append(record(
            fmt.CHUNK_INDEX, struct.pack("<QQQQ", chunk.start_time, chunk.end_time, begin, chunk_end - begin)
            + _number_map(index_offsets) + struct.pack("<Q", at - chunk_end)
            + text("" if chunk.codec == "none" else chunk.codec) + struct.pack("<QQ", len(chunk.body), chunk.size)))
        for channel, count in chunk.counts.items():
            self._channel_counts[channel] = self._channel_counts.get(channel, 0) + count
            self.message_count += count
        self._start_time = chunk.start_time if self._start_time is None else min(self._start_time, chunk.start_time)
        self._end_time = max(self._end_time, chunk.end_time)

    def add_metadata(self, name: str, values: Dict[str, str]) -> None:
        """Add named facts; see ``LogWriter.add_metadata``."""
        raw = record(fmt.METADATA, text(name) + text_map(values))
        begin = self._write(raw)
        self._summary[fmt.METADATA_INDEX].append(
            record(fmt.METADATA_INDEX, struct.pack("<QQ", begin, len(raw)) + text(name)))

    def add_attachment(self, name: str, data: bytes, media_type: str = "application/octet-stream",
                       log_time: int = 0, create_time: int = 0) -> None:
        """Add a file; see ``LogWriter.add_attachment``."""
        body = (struct.pack("<QQ", log_time, create_time) + text(name) + text(media_type)
                + struct.pack("<Q", len(data)) + data)
        raw = record(fmt.ATTACHMENT, body + struct.pack("<I", zlib.crc32(body)))
        begin = self._write(raw)
        self._summary[fmt.ATTACHMENT_INDEX].append(record(
            fmt.ATTACHMENT_INDEX, struct.pack("<QQQQQ", begin, len(raw), log_time, create_time, len(data))
            + text(name) + text(media_type)))

    def _statistics(self) -> bytes:
        counts = (len(self._summary[opcode]) for opcode in (
            fmt.SCHEMA, fmt.CHANNEL, fmt.ATTACHMENT_INDEX, fmt.METADATA_INDEX, fmt.CHUNK_INDEX))
        return record(fmt.STATISTICS, struct.pack(
            "<QHIIIIQQ", self.message_count, *counts, self._start_time or 0, self._end_time)
            + _number_map(dict(sorted(self._channel_counts.items()))))

    def _finish(self) -> None:
        self._write(record(fmt.DATA_END, struct.pack("<I", self._crc)))
        summary_start = self.position
        self._crc = 0
        self._summary[fmt.STATISTICS].append(self._statistics())
        offsets = []
        for opcode, records in self._summary.items():
            if records:
                begin = self._write(*records)
                size = self.position - begin
                offsets.append(record(fmt.SUMMARY_OFFSET, struct.pack("<BQQ", opcode, begin, size)))
        offset_start = self._write(*offsets)
        self._write(fmt.RECORD_HEAD.pack(fmt.FOOTER, 20) + struct.pack("<QQ", summary_start, offset_start))
        self._write(struct.pack("<I", self._crc), fmt.MAGIC)
