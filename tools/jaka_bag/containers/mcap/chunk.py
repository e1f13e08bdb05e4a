"""The contents of an MCAP chunk as a block: many records at once where they are regular, else one by one and exact."""
from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import Array, Block, block_of_rows, uncovered, windows
from ...messages.connection import Connection
from ..compression import Buffer
from . import records as fmt

_HEAD = fmt.MESSAGE_HEAD.size
_HEAD_TYPE = np.dtype([("op", "u1"), ("size", "<u8"), ("channel", "<u2"), ("sequence", "<u4"),
                       ("log_time", "<u8"), ("publish_time", "<u8")])


class Parsed(NamedTuple):
    """The records of a chunk.

    Attributes:
        block: The messages; ``connection`` holds the file's own ids (int64).
        connections: Connections declared beside them, by the file's id.
        schemas: Those declared before and beside them.
        consumed: Bytes understood; fewer than the chunk has where it is damaged or cut off.
    """

    block: Block
    connections: Dict[int, Connection]
    schemas: Dict[int, fmt.Schema]
    consumed: int


def _regular_mcap(data: Array, offset: Array) -> Optional[Block]:
    """The messages at the index's offsets; None where one of them is not a message."""
    if not len(offset) or int(offset[0]) < 0 or int(offset[-1]) + _HEAD > len(data):
        return None
    heads = windows(data, _HEAD)[offset].view(_HEAD_TYPE)
    length = heads["size"].view(np.int64) - (_HEAD - fmt.RECORD_HEAD.size)
    if (heads["op"] != fmt.MESSAGE).any() or int(length.min()) < 0 or int(length.max()) > len(data):
        return None
    return Block(data, offset + _HEAD, length, heads["channel"].astype(np.int64),
                 heads["log_time"].astype(np.uint64).view(np.int64),
                 heads["publish_time"].astype(np.uint64).view(np.int64), heads["sequence"].astype(np.uint32))


def scan(raw: Buffer, schemas: Dict[int, fmt.Schema], begin: int = 0, end: Optional[int] = None,
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
    head_size = fmt.RECORD_HEAD.size
    while at + head_size <= stop:
        opcode, size = fmt.RECORD_HEAD.unpack_from(raw, at)
        body = at + head_size
        if body + size > stop:
            break
        try:
            if opcode == fmt.MESSAGE:
                if size < _HEAD - head_size:
                    break
                channel, sequence, log_time, publish_time = fmt.MESSAGE_HEAD.unpack_from(raw, at)[2:]
                columns.append((at + _HEAD, size - _HEAD + head_size, channel, log_time, publish_time,
                                sequence))
            elif opcode == fmt.SCHEMA:
                schema_id, schema = fmt.parse_schema(raw[body:body + size])
                known[schema_id] = schema
            elif opcode == fmt.CHANNEL:
                channel, connection = fmt.parse_channel(raw[body:body + size], known)
                connections[channel] = connection
            elif opcode == 0 or is_loose:
                break
        except BagFormatError:
            break
        at = body + size
    return Parsed(block_of_rows(np.frombuffer(raw, np.uint8), columns, True), connections, known, at)


def parse_chunk(raw: Buffer, offset: Optional[Array], schemas: Dict[int, fmt.Schema]) -> Parsed:
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
        gaps = None if block is None else uncovered(offset, block.start + block.length, len(data))
        if block is not None and gaps is not None:
            connections: Dict[int, Connection] = {}
            known = schemas
            for begin, end in gaps:
                between = scan(raw, known, begin, end)
                if between.consumed != end or len(between.block):
                    break
                connections.update(between.connections)
                known = between.schemas
            else:
                return Parsed(block, connections, known, len(raw))
    parsed = scan(raw, schemas)
    if parsed.consumed != len(raw):
        raise BagFormatError("a record in a chunk is damaged")
    return parsed
