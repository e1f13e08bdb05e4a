"""The contents of a bag's chunk as a block: many records at once where they are regular, else one by one and exact."""
import functools
import struct
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import Array, Block, block_of_rows, uncovered, windows
from ...messages.connection import Connection
from ...units import NS_PER_S
from ..compression import Buffer
from . import records as fmt

_HEAD = 46
"""Bytes in front of a payload: header length, 38 bytes of header, data length."""
_U32 = struct.Struct("<I")


class Parsed(NamedTuple):
    """The records of a chunk.

    Attributes:
        block: The messages; ``connection`` holds the file's own ids (int64).
        connections: Connections declared beside them, by the file's id.
        consumed: Bytes understood; fewer than the chunk has where it is damaged or cut off.
    """

    block: Block
    connections: Dict[int, Connection]
    consumed: int


def _bag_layout(head: bytes) -> Optional[Tuple[int, int]]:
    """Where connection and time stand in a regular message record's first bytes; None where it is irregular."""
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


def _regular_bag(data: Array, offset: Array) -> Optional[Block]:
    """The messages at the index's offsets, where all have the same layout of header; None else."""
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
    return Block(data, offset + _HEAD, heads["length"].astype(np.int64), heads["connection"].astype(np.int64),
                 time)


@functools.lru_cache(maxsize=8)
def _head_type(connection_at: int, time_at: int) -> "np.dtype[Any]":
    """A record's head as fields: four that vary, and all other bytes in words, which must be those of every record."""
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


def scan(raw: Buffer, begin: int = 0, end: Optional[int] = None) -> Parsed:
    """The records of a bag chunk's bytes, one by one, up to the first that is damaged or cut off."""
    columns: List[Tuple[int, ...]] = []
    connections: Dict[int, Connection] = {}
    at = begin
    stop = len(raw) if end is None else end
    while at + 8 <= stop:
        header_end = at + 4 + _U32.unpack_from(raw, at)[0]
        if header_end + 4 > stop:
            break
        payload = header_end + 4
        size = _U32.unpack_from(raw, header_end)[0]
        if payload + size > stop:
            break
        try:
            fields = fmt.parse_header(raw[at + 4:header_end])
            kind = fmt.opcode(fields)
            if kind == fmt.OP_MESSAGE:
                columns.append((payload, size, fmt.u32(fields, "conn"), fmt.time_ns(fields, "time")))
            elif kind == fmt.OP_CONNECTION:
                number, connection = fmt.parse_connection(fields, raw[payload:payload + size])
                connections[number] = connection
        except BagFormatError:
            break
        at = payload + size
    return Parsed(block_of_rows(np.frombuffer(raw, np.uint8), columns, False), connections, at)


def parse_chunk(raw: Buffer, offset: Optional[Array]) -> Parsed:
    """The records of a bag chunk.

    Args:
        raw: The uncompressed chunk.
        offset: Where the index says that messages start, ascending, int64; None where there is no index.

    Raises:
        BagFormatError: A record is damaged.
    """
    if offset is not None:
        data = np.frombuffer(raw, np.uint8)
        block = _regular_bag(data, offset)
        gaps = None if block is None else uncovered(offset, block.start + block.length, len(data))
        if block is not None and gaps is not None:
            connections: Dict[int, Connection] = {}
            for begin, end in gaps:
                between = scan(raw, begin, end)
                if between.consumed != end or len(between.block):
                    break
                connections.update(between.connections)
            else:
                return Parsed(block, connections, len(raw))
    parsed = scan(raw)
    if parsed.consumed != len(raw):
        raise BagFormatError("a record in a chunk is damaged")
    return parsed
