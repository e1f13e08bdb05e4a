"""The reader of an indexed .bag: many records at once where they are regular, else one by one and exact.

Functions that read raise ``BagFormatError`` where the bytes are damaged or cut off.
"""
import functools
import struct
from typing import Any, Dict, List, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import Array, MessageBatch, RowStore, windows
from ...messages.connection import Connection
from ...units import NS_PER_S
from .. import interface
from ..compression import decompress
from ..index import Buffer, ChunkRef
from ..interface import LogReader, ParsedChunk
from . import records as fmt

_HEAD = 46
"""Bytes in front of a payload: header length, 38 bytes of header, data length."""
ENTRY_TYPE = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
"""An index record's entry for one message."""
_U32 = struct.Struct("<I")


def _bag_layout(head: bytes) -> Optional[Tuple[int, int]]:
    """Return the positions of connection and time in a message record's first bytes; None for an irregular record."""
    if len(head) < _HEAD or _U32.unpack_from(head)[0] != _HEAD - 8:
        return None
    places = {}
    at = 4
    while at + 4 <= _HEAD - 4:
        size = _U32.unpack_from(head, at)[0]
        name = head[at + 4:at + 4 + size].split(b"=")[0]
        places[name] = (at + 4 + len(name) + 1, size - len(name) - 1)
        at += 4 + size
    op = places.get(b"op")
    if at != _HEAD - 4 or len(places) != 3 or op is None or op[1] != 1 or head[op[0]] != fmt.OP_MESSAGE:
        return None
    connection, time = places.get(b"conn", (0, 0)), places.get(b"time", (0, 0))
    return (connection[0], time[0]) if (connection[1], time[1]) == (4, 8) else None


def _regular_bag(data: Array, offset: Array) -> Optional[MessageBatch]:
    """Return the messages at the index's offsets; None where their headers differ in layout."""
    if not len(offset) or int(offset[-1]) + _HEAD > len(data):
        return None
    taken = windows(data, _HEAD)[offset]
    layout = _bag_layout(taken[0].tobytes())
    if layout is None:
        return None
    heads = taken.view(_head_type(*layout))
    if any((heads[name] != heads[name][0]).any() for name in (heads.dtype.names or ())[4:]):
        return None
    time = heads["seconds"].astype(np.int64) * NS_PER_S + heads["nanoseconds"]
    return MessageBatch(data, offset + _HEAD, heads["length"].astype(np.int64), heads["connection"].astype(np.int64),
                 time)


@functools.lru_cache(maxsize=8)
def _head_type(connection_at: int, time_at: int) -> "np.dtype[Any]":
    """Return a record head's type: four fields that vary, and all other bytes in words, equal in every record."""
    places = [("connection", "<u4", connection_at), ("seconds", "<u4", time_at), ("nanoseconds", "<u4", time_at + 4),
              ("length", "<u4", _HEAD - 4)]
    varying = sorted((at, at + 4) for _, _, at in places)
    begins = [0] + [end for _, end in varying]
    for begin, end in zip(begins, [at for at, _ in varying]):
        while begin < end:
            size = next(size for size in (8, 4, 2, 1) if begin + size <= end)
            places.append(("fixed%d" % begin, "<u%d" % size, begin))
            begin += size
    names, formats, offsets = zip(*places)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": _HEAD})


def scan(raw: Buffer, begin: int = 0, end: Optional[int] = None, is_open: bool = False) -> ParsedChunk:
    """Read the records of a bag chunk's bytes, one by one, up to the first that is damaged or cut off.

    Args:
        raw: The bytes.
        begin: The first one.
        end: The one behind the last; None for all.
        is_open: The chunk's end is not known: it is at the latest where another one begins.
    """
    rows = RowStore(has_publish=False)
    connections: Dict[int, Connection] = {}
    at = begin
    stop = len(raw) if end is None else end
    while True:
        try:
            record = fmt.record_at(raw, at, stop)
            if record is None or record.end > stop or (is_open and record.kind == fmt.OP_CHUNK):
                break
            if record.kind == fmt.OP_MESSAGE:
                rows.append((record.begin, record.end - record.begin, fmt.u32(record.fields, "conn"),
                             fmt.time_ns(record.fields, "time")))
            elif record.kind == fmt.OP_CONNECTION:
                connections.update([fmt.parse_connection(record, raw)])
        except BagFormatError:
            break
        at = record.end
    return ParsedChunk(rows.batch(np.frombuffer(raw, np.uint8)), connections, at)


def parse_chunk(raw: Buffer, offset: Optional[Array]) -> ParsedChunk:
    """Return the records of a bag chunk; see ``interface.parse_chunk``."""
    def head_size(at: int) -> int:
        return 8 + int(_U32.unpack_from(raw, at)[0]) if at + 4 <= len(raw) else 0

    return interface.parse_chunk(raw, offset, _regular_bag, lambda begin, end: scan(raw, begin, end), head_size)


def index_entries(raw: bytes, begin: int) -> List[Tuple[int, Array]]:
    """Return (connection id, entries) of each index record that follows a chunk."""
    result = []
    for record in fmt.whole_records(raw, begin, "the index of a chunk is cut off"):
        if record.kind == fmt.OP_INDEX:
            result.append((fmt.u32(record.fields, "conn"),
                           np.frombuffer(raw, ENTRY_TYPE, fmt.index_entries(record), record.begin)))
    return result


def offsets_in(entries: List[Tuple[int, Array]]) -> Array:
    """Return the positions of messages from a chunk's index entries, ascending, int64."""
    offset = np.concatenate([entry["offset"] for _, entry in entries] or [np.zeros(0)]).astype(np.int64)
    return np.sort(offset, kind="stable")  # which merges what is in order for each connection


class BagReader(LogReader):
    """A .bag open for reading; see ``LogReader``."""

    def _parse(self, chunk: ChunkRef, raw: bytes) -> MessageBatch:
        head = fmt.parse_chunk_head(raw)
        data_end = head.data_start + head.data_size
        if data_end > len(raw):
            raise BagFormatError("the chunk is cut off")
        self._allowance.check()
        data = decompress(head.codec, memoryview(raw)[head.data_start:data_end], head.size)
        try:
            offset: Optional[Array] = offsets_in(index_entries(raw, data_end))
        except BagFormatError:  # the index only helps: the chunk's own records count
            offset = None
        parsed = parse_chunk(data, offset)
        self._spend(chunk, head.size, parsed.batch)
        for file_id, inside in parsed.connections.items():
            number = self.index.numbers.get(file_id)
            differs = "" if number is None else fmt.difference(file_id, inside, self.connections[number])
            if differs:
                raise BagFormatError(differs)
        return parsed.batch
