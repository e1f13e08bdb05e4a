"""Chunk contents to blocks: many records at once where they are regular, one by one and exact where not."""
import functools
import struct
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from . import bag_format, mcap_format
from .blocks import Array, Block, windows
from .compression import Buffer
from .connection import Connection
from .errors import BagFormatError

_BAG_HEAD = 46
"""Bytes in front of a payload in a .bag: header length, 38 bytes of header, data length."""
_MCAP_HEAD = mcap_format.MESSAGE_HEAD.size
_MAX_GAPS = 64
_U32 = struct.Struct("<I")


class Parsed(NamedTuple):
    """The records of a chunk.

    Attributes:
        block: The messages; ``connection`` holds the file's own ids (int64).
        connections: Connections declared beside them, by the file's id.
        schemas: MCAP schemas declared beside them.
        consumed: Bytes understood; fewer than the chunk has where it is damaged or cut off.
    """

    block: Block
    connections: Dict[int, Connection]
    schemas: Dict[int, mcap_format.Schema]
    consumed: int


def _gaps(start: Array, end: Array, total: int) -> Optional[List[Tuple[int, int]]]:
    """The stretches that no message covers; None where messages overlap or there are too many of them."""
    begins = np.concatenate([[0], end])
    ends = np.concatenate([start, [total]])
    if (ends < begins).any():
        return None
    which = np.flatnonzero(ends != begins)
    if len(which) > _MAX_GAPS:
        return None
    return list(zip(begins[which].tolist(), ends[which].tolist()))


def _build(data: Array, columns: List[Tuple[int, ...]], has_publish: bool) -> Block:
    """A block from (start, length, connection, log time[, publish time, sequence]) of each message."""
    if not columns:
        columns_array = np.zeros((6 if has_publish else 4, 0), np.uint64)
    else:
        columns_array = np.array(columns, np.uint64).T
    signed = columns_array.view(np.int64) if columns_array.flags.c_contiguous else np.ascontiguousarray(
        columns_array).view(np.int64)
    return Block(data, signed[0], signed[1], signed[2], signed[3], signed[4] if has_publish else None,
                 signed[5].astype(np.uint32) if has_publish else None)


def _bag_layout(head: bytes) -> Optional[Tuple[int, int]]:
    """Where connection and time stand in a regular message record's first bytes; None where it is irregular."""
    if len(head) < _BAG_HEAD or _U32.unpack_from(head)[0] != _BAG_HEAD - 8:
        return None
    places = {}
    at = 4
    while at + 4 <= _BAG_HEAD - 4:
        size = _U32.unpack_from(head, at)[0]
        name = head[at + 4:at + 4 + size].split(b"=")[0]
        places[name] = (at + 4 + len(name) + 1, size - len(name) - 1)
        at += 4 + size
    op = places.get(b"op")
    if at != _BAG_HEAD - 4 or len(places) != 3 or op is None or op[1] != 1 or head[op[0]] != bag_format.OP_MESSAGE:
        return None
    connection, time = places.get(b"conn", (0, 0)), places.get(b"time", (0, 0))
    return (connection[0], time[0]) if (connection[1], time[1]) == (4, 8) else None


def _regular_bag(data: Array, offset: Array) -> Optional[Block]:
    """The messages at the index's offsets, where all have the same layout of header; None else."""
    if not len(offset) or int(offset[-1]) + _BAG_HEAD > len(data):
        return None
    taken = windows(data, _BAG_HEAD)[offset]
    layout = _bag_layout(taken[0].tobytes())
    if layout is None:
        return None
    heads = taken.view(_head_type(*layout))
    if any((heads[name] != heads[name][0]).any() for name in (heads.dtype.names or ())[4:]):
        return None
    time = heads["seconds"].astype(np.int64) * bag_format.NS_PER_S + heads["nanoseconds"]
    return Block(data, offset + _BAG_HEAD, heads["length"].astype(np.int64), heads["connection"].astype(np.int64),
                 time)


@functools.lru_cache(maxsize=8)
def _head_type(connection_at: int, time_at: int) -> "np.dtype[Any]":
    """A record's head as fields: four that vary, and all other bytes in words, which must be those of every record."""
    places = [("connection", "<u4", connection_at), ("seconds", "<u4", time_at), ("nanoseconds", "<u4", time_at + 4),
              ("length", "<u4", _BAG_HEAD - 4)]
    varying = sorted((at, at + 4) for _, _, at in places)
    begins = [0] + [end for _, end in varying]
    for begin, end in zip(begins, [at for at, _ in varying]):
        while begin < end:
            size = next(size for size in (8, 4, 2, 1) if begin + size <= end)
            places.append(("fixed%d" % begin, "<u%d" % size, begin))
            begin += size
    names, formats, offsets = zip(*places)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": _BAG_HEAD})


def scan_bag(raw: Buffer, begin: int = 0, end: Optional[int] = None) -> Parsed:
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
            fields = bag_format.parse_header(raw[at + 4:header_end])
            kind = bag_format.opcode(fields)
            if kind == bag_format.OP_MESSAGE:
                columns.append((payload, size, bag_format.u32(fields, "conn"), bag_format.time_ns(fields, "time")))
            elif kind == bag_format.OP_CONNECTION:
                number, connection = bag_format.parse_connection(fields, raw[payload:payload + size])
                connections[number] = connection
        except BagFormatError:
            break
        at = payload + size
    return Parsed(_build(np.frombuffer(raw, np.uint8), columns, False), connections, {}, at)


def parse_bag_chunk(raw: Buffer, offset: Optional[Array]) -> Parsed:
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
        gaps = None if block is None else _gaps(offset, block.start + block.length, len(data))
        if block is not None and gaps is not None:
            connections: Dict[int, Connection] = {}
            for begin, end in gaps:
                between = scan_bag(raw, begin, end)
                if between.consumed != end or len(between.block):
                    break
                connections.update(between.connections)
            else:
                return Parsed(block, connections, {}, len(raw))
    parsed = scan_bag(raw)
    if parsed.consumed != len(raw):
        raise BagFormatError("a record in a chunk is damaged")
    return parsed


def _regular_mcap(data: Array, offset: Array) -> Optional[Block]:
    """The messages at the index's offsets; None where one of them is not a message."""
    if not len(offset) or int(offset[0]) < 0 or int(offset[-1]) + _MCAP_HEAD > len(data):
        return None
    heads = windows(data, _MCAP_HEAD)[offset].view(_MCAP_TYPE)
    length = heads["size"].view(np.int64) - (_MCAP_HEAD - mcap_format.RECORD_HEAD.size)
    if (heads["op"] != mcap_format.MESSAGE).any() or int(length.min()) < 0 or int(length.max()) > len(data):
        return None
    return Block(data, offset + _MCAP_HEAD, length, heads["channel"].astype(np.int64),
                 heads["log_time"].astype(np.uint64).view(np.int64),
                 heads["publish_time"].astype(np.uint64).view(np.int64), heads["sequence"].astype(np.uint32))


_MCAP_TYPE = np.dtype([("op", "u1"), ("size", "<u8"), ("channel", "<u2"), ("sequence", "<u4"),
                       ("log_time", "<u8"), ("publish_time", "<u8")])


def scan_mcap(raw: Buffer, schemas: Dict[int, mcap_format.Schema], begin: int = 0, end: Optional[int] = None,
              is_loose: bool = False) -> Parsed:
    """The records of an MCAP chunk's bytes, one by one, up to the first that is damaged or cut off.

    Args:
        raw: The uncompressed chunk.
        schemas: Those declared before it.
        begin: First byte to read.
        end: Byte to stop at; None for the end.
        is_loose: The bytes are not a chunk's but the file's own: stop at what belongs in no chunk.
    """
    columns: List[Tuple[int, ...]] = []
    connections: Dict[int, Connection] = {}
    known = dict(schemas)
    at = begin
    stop = len(raw) if end is None else end
    head_size = mcap_format.RECORD_HEAD.size
    while at + head_size <= stop:
        opcode, size = mcap_format.RECORD_HEAD.unpack_from(raw, at)
        body = at + head_size
        if body + size > stop:
            break
        try:
            if opcode == mcap_format.MESSAGE:
                if size < _MCAP_HEAD - head_size:
                    break
                channel, sequence, log_time, publish_time = mcap_format.MESSAGE_HEAD.unpack_from(raw, at)[2:]
                columns.append((at + _MCAP_HEAD, size - _MCAP_HEAD + head_size, channel, log_time, publish_time,
                                sequence))
            elif opcode == mcap_format.SCHEMA:
                schema_id, schema = mcap_format.parse_schema(raw[body:body + size])
                known[schema_id] = schema
            elif opcode == mcap_format.CHANNEL:
                channel, connection = mcap_format.parse_channel(raw[body:body + size], known)
                connections[channel] = connection
            elif opcode == 0 or is_loose:
                break
        except BagFormatError:
            break
        at = body + size
    return Parsed(_build(np.frombuffer(raw, np.uint8), columns, True), connections, known, at)


def parse_mcap_chunk(raw: Buffer, offset: Optional[Array], schemas: Dict[int, mcap_format.Schema]) -> Parsed:
    """The records of an MCAP chunk.

    Args:
        raw: The uncompressed chunk.
        offset: Where the message indexes say that messages start, ascending, int64; None where there are none.
        schemas: Those declared before it.

    Raises:
        BagFormatError: A record is damaged.
    """
    if offset is not None:
        data = np.frombuffer(raw, np.uint8)
        block = _regular_mcap(data, offset)
        gaps = None if block is None else _gaps(offset, block.start + block.length, len(data))
        if block is not None and gaps is not None:
            connections: Dict[int, Connection] = {}
            known = schemas
            for begin, end in gaps:
                between = scan_mcap(raw, known, begin, end)
                if between.consumed != end or len(between.block):
                    break
                connections.update(between.connections)
                known = between.schemas
            else:
                return Parsed(block, connections, known, len(raw))
    parsed = scan_mcap(raw, schemas)
    if parsed.consumed != len(raw):
        raise BagFormatError("a record in a chunk is damaged")
    return parsed
