"""Reads the chunks of an MCAP."""
import struct
import zlib
from typing import Dict, List, NamedTuple, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import Array, Block, concatenate
from ..compression import Buffer, decompress
from ..index import AttachmentIndex, ChunkRef, MetadataIndex, read_at
from ..reader import LogReader
from . import records as fmt
from .chunk import Parsed, parse_chunk

CODECS = {"": "none", "lz4": "lz4", "zstd": "zstd"}


class ChunkHead(NamedTuple):
    """A chunk record up to its data: codec, uncompressed size and CRC, where the data starts, how long it is."""

    codec: str
    size: int
    crc: int
    data_start: int
    data_size: int
    start_time: int
    end_time: int


def parse_chunk_head(raw: bytes) -> ChunkHead:
    """The head of a chunk record; the data may be cut off.

    Raises:
        BagFormatError: It is damaged or cut off.
    """
    cursor = fmt.Cursor(raw)
    if cursor.number("B") != fmt.CHUNK:
        raise BagFormatError("there is no chunk record")
    record_size = cursor.number("Q")
    start, end, size, crc = cursor.unpack("QQQI")
    codec = cursor.text()
    stored = cursor.number("Q")
    if codec not in CODECS:
        raise BagFormatError("compression %r is not known" % codec[:20])
    if cursor.at + stored != record_size + fmt.RECORD_HEAD.size:
        raise BagFormatError("a chunk record is damaged")
    return ChunkHead(CODECS[codec], size, crc, cursor.at, stored, start, end)


def index_entries(raw: bytes, begin: int) -> List[Tuple[int, Array]]:
    """(channel id, (time, offset) uint64 of shape (n, 2)) of the message indexes that follow a chunk.

    Raises:
        BagFormatError: One is damaged or cut off.
    """
    result = []
    for opcode, start, end in fmt.split_records(memoryview(raw)[begin:]):
        if opcode == fmt.MESSAGE_INDEX:
            if end - start < 6:
                raise BagFormatError("a message index is damaged")
            channel, size = struct.unpack_from("<HI", raw, begin + start)
            if size != end - start - 6 or size % 16:
                raise BagFormatError("a message index is damaged")
            result.append((channel, np.frombuffer(raw, "<u8", size // 8, begin + start + 6).reshape(-1, 2)))
    return result


def checked_records(head: ChunkHead, raw: bytes) -> Buffer:
    """The uncompressed records of a chunk.

    Raises:
        BagFormatError: They are damaged or cut off.
    """
    end = head.data_start + head.data_size
    if end > len(raw):
        raise BagFormatError("the chunk is cut off")
    data = decompress(head.codec, memoryview(raw)[head.data_start:end], head.size)
    if head.crc and zlib.crc32(data) != head.crc:
        raise BagFormatError("the chunk's CRC is wrong")
    return data


def read_chunk(raw: bytes, schemas: Dict[int, fmt.Schema]) -> Parsed:
    """The records of a chunk, given with the message indexes behind it.

    Raises:
        BagFormatError: It is damaged.
    """
    head = parse_chunk_head(raw)
    data = checked_records(head, raw)
    entries = [entry for _, entry in index_entries(raw, head.data_start + head.data_size)]
    offset = np.sort(np.concatenate([entry[:, 1] for entry in entries]).view(np.int64)) if entries else None
    return parse_chunk(data, offset, schemas)


class McapReader(LogReader):
    """An MCAP open for reading; see ``LogReader``."""

    _NO_SCHEMAS: Dict[int, fmt.Schema] = {}

    def _parse(self, chunk: ChunkRef, raw: bytes) -> Block:
        if chunk.is_loose:
            return parse_chunk(raw, None, self._NO_SCHEMAS).block
        return read_chunk(raw, self._NO_SCHEMAS).block

    def load_times(self, chunk: ChunkRef) -> Block:
        """As ``load``, from the chunk's message indexes where it has them: only connection and log time are right."""
        if chunk.is_loose:
            return self.load(chunk)
        head = parse_chunk_head(read_at(self._descriptor, chunk.position, 256))
        begin = chunk.position + head.data_start + head.data_size
        if begin == chunk.end:
            return self.load(chunk)
        blocks = []
        for channel, entry in index_entries(read_at(self._descriptor, begin, chunk.end - begin), 0):
            none = np.zeros(len(entry), np.int64)
            blocks.append(Block(np.zeros(0, np.uint8), none, none, np.full(len(entry), channel, np.int64),
                                entry[:, 0].copy().view(np.int64)))
        return self._renumber(concatenate(blocks))

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """See ``LogReader``; checks the attachment's CRC."""
        raw = read_at(self._descriptor, entry.position, entry.size)
        cursor = fmt.Cursor(raw, fmt.RECORD_HEAD.size + 16)
        cursor.text()
        cursor.text()
        data = cursor.raw(cursor.number("Q"))
        crc = cursor.number("I")
        if crc and zlib.crc32(raw[fmt.RECORD_HEAD.size:cursor.at - 4]) != crc:
            raise BagFormatError("%s: the CRC of the attachment %s is wrong" % (self.path, entry.name))
        return data

    def read_metadata(self, entry: MetadataIndex) -> Tuple[str, Dict[str, str]]:
        """See ``LogReader``."""
        return fmt.parse_metadata(read_at(self._descriptor, entry.position, entry.size))
