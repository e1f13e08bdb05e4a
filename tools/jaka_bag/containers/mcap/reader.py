"""The reader of an MCAP's chunks: many records at once where they are regular, else one by one and exact.

Functions that read raise ``BagFormatError`` where the bytes are damaged or cut off.
"""
import struct
import zlib
from typing import Dict, List, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import Array, MessageBatch, RowStore, windows
from ...messages.connection import Connection
from .. import interface
from ..compression import decompress
from ..index import AttachmentIndex, Buffer, ChunkRef, MetadataIndex
from ..interface import LogReader, ParsedChunk
from ..packed_messages import may_be_packed, plain
from . import records as fmt

_HEAD = fmt.MESSAGE_HEAD.size
HEAD_TYPE = np.dtype([("op", "u1"), ("size", "<u8"), ("channel", "<u2"), ("sequence", "<u4"),
                      ("log_time", "<u8"), ("publish_time", "<u8")])
"""The bytes of a message record before its payload."""

class Channels:
    """The schemas and channels declared so far in the order of a file.

    A channel id that is defined again with another topic or type stands for another connection from there on, under a
    number that no channel of a file can have.

    Args:
        known: Connections by the file's id; it grows.

    Attributes:
        schemas: Schemas by id.
        known: Connections by number.
        renamed: Numbers of the connections for which ids stand that were defined again.
    """

    def __init__(self, known: Optional[Dict[int, Connection]] = None) -> None:
        self.schemas: Dict[int, fmt.Schema] = {}
        self.renamed: Dict[int, int] = {}
        self.known = {} if known is None else known

    def define(self, body: Buffer) -> Tuple[int, Connection]:
        """Return the number and the connection of a channel record's body."""
        number, connection = fmt.parse_channel(body, self.schemas)
        file_id = number
        while not fmt.is_same_channel(self.known.setdefault(number, connection), connection):
            number += fmt.MAX_CHANNELS + 1
        if not fmt.is_described(self.known[number]):
            self.known[number] = connection
        self.renamed.pop(file_id, None)
        if number != file_id:
            self.renamed[file_id] = number
        return number, connection


def _regular_mcap(data: Array, offset: Array) -> Optional[MessageBatch]:
    """Return the messages at the index's offsets; None where one of them is not a message."""
    if not len(offset) or int(offset[0]) < 0 or int(offset[-1]) + _HEAD > len(data):
        return None
    heads = windows(data, _HEAD)[offset].view(HEAD_TYPE)
    length = heads["size"].view(np.int64) - (_HEAD - fmt.RECORD_HEAD.size)
    if (heads["op"] != fmt.MESSAGE).any() or int(length.min()) < 0 or int(length.max()) > len(data):
        return None
    return MessageBatch(data, offset + _HEAD, length, heads["channel"].astype(np.int64),
                 heads["log_time"].astype(np.uint64).view(np.int64),
                 heads["publish_time"].astype(np.uint64).view(np.int64), heads["sequence"].astype(np.uint32))


def scan(raw: Buffer, channels: Channels, begin: int = 0, end: Optional[int] = None,
         is_loose: bool = False) -> ParsedChunk:
    """Read the records of an MCAP chunk's bytes, one by one, up to the first that is damaged or cut off.

    Args:
        raw: The uncompressed chunk.
        channels: Declarations before the chunk; those in it are added.
        begin: First byte to read.
        end: Byte to stop at; None for the end.
        is_loose: The bytes are not a chunk's but the file's own: stop at a record that belongs in no chunk.
    """
    rows = RowStore(has_publish=True)
    connections: Dict[int, Connection] = {}
    at = begin
    for opcode, body, body_end in fmt.records_in(raw, begin, end):
        try:
            if opcode == fmt.MESSAGE:
                if body + _HEAD - fmt.RECORD_HEAD.size > body_end:
                    break
                channel, sequence, log_time, publish_time = fmt.MESSAGE_HEAD.unpack_from(raw, at)[2:]
                rows.append((at + _HEAD, body_end - at - _HEAD, channels.renamed.get(channel, channel), log_time,
                             publish_time, sequence))
            elif opcode == fmt.SCHEMA:
                channels.schemas.update([fmt.parse_schema(raw[body:body_end])])
            elif opcode == fmt.CHANNEL:
                connections.update([channels.define(raw[body:body_end])])
            elif opcode == 0 or is_loose:
                break
        except BagFormatError:
            break
        at = body_end
    return ParsedChunk(rows.batch(np.frombuffer(raw, np.uint8)), connections, at)


def parse_chunk(raw: Buffer, offset: Optional[Array], channels: Channels) -> ParsedChunk:
    """Return the records of an MCAP chunk; see ``interface.parse_chunk`` and, for ``channels``, ``scan``."""
    before = dict(channels.renamed)
    parsed = interface.parse_chunk(raw, None if before else offset, _regular_mcap,
                                  lambda begin, end: scan(raw, channels, begin, end), lambda at: _HEAD)
    if channels.renamed != before:  # within the chunk: which definition holds depends on the place
        channels.renamed = before
        parsed = scan(raw, channels)
    return parsed


def index_entries(raw: bytes, begin: int) -> List[Tuple[int, Array]]:
    """Return (channel id, (time, offset) uint64 of shape (n, 2)) of each message index that follows a chunk."""
    result = []
    for opcode, start, end in fmt.whole_records(raw, begin):
        if opcode == fmt.MESSAGE_INDEX:
            if end - start < 6:
                raise BagFormatError("a message index is damaged")
            channel, size = struct.unpack_from("<HI", raw, start)
            if size > end - start - 6 or size % 16:
                raise BagFormatError("a message index is damaged")
            result.append((channel, np.frombuffer(raw, "<u8", size // 8, start + 6).reshape(-1, 2)))
    return result


def offsets_in(entries: List[Tuple[int, Array]]) -> Optional[Array]:
    """Return the positions of messages from a chunk's message indexes, ascending, int64; None where there are none."""
    if not entries:
        return None
    offset = np.concatenate([entry[:, 1] for _, entry in entries]).view(np.int64)
    return np.sort(offset, kind="stable")  # which merges what is in order for each channel


class McapReader(LogReader):
    """An MCAP open for reading; see ``LogReader``."""

    def _parse(self, chunk: ChunkRef, raw: bytes) -> MessageBatch:
        channels = Channels(dict(zip(self.index.numbers, self.connections)))
        batch = self._messages(chunk, raw, channels)
        if channels.renamed:
            raise BagFormatError(fmt.DEFINED_AGAIN % min(channels.renamed))
        is_cdr = self.index.profile == "ros2" and all(each.encoding == "cdr" for each in self.connections)
        return plain(batch) if is_cdr and may_be_packed(batch) else batch

    def _messages(self, chunk: ChunkRef, raw: bytes, channels: Channels) -> MessageBatch:
        if chunk.is_loose:
            return parse_chunk(raw, None, channels).batch
        head = fmt.parse_chunk_head(raw)
        end = head.data_start + head.data_size
        if head.end > len(raw):
            raise BagFormatError("the chunk is cut off")
        self._allowance.check()
        data = decompress(head.codec, memoryview(raw)[head.data_start:end], head.size)
        if head.crc and zlib.crc32(data) != head.crc:
            raise BagFormatError("the chunk's CRC is wrong")
        try:
            offset = offsets_in(index_entries(raw, head.end))
        except BagFormatError:  # the index only helps: the chunk's own records count
            offset = None
        batch = parse_chunk(data, offset, channels).batch
        self._spend(chunk, head.size, batch)
        return batch

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """See ``LogReader``; checks the attachment's CRC."""
        try:
            return fmt.read_attachment(self._file.fileno(), entry)
        except BagFormatError as error:
            raise BagFormatError("%s: %s" % (self.path, error)) from error

    def read_metadata(self, entry: MetadataIndex) -> Dict[str, str]:
        """See ``LogReader``."""
        try:
            return fmt.read_metadata(self._file.fileno(), entry)
        except BagFormatError as error:
            raise BagFormatError("%s: %s" % (self.path, error)) from error
