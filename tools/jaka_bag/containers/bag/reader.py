"""Reads the chunks of an indexed .bag."""
import struct
from typing import List, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import Array, Block, concatenate
from ...units import NS_PER_S
from ..compression import decompress
from ..index import ChunkRef, read_at
from ..reader import LogReader
from . import records as fmt
from .chunk import parse_chunk
from .index import parse_chunk_head

_ENTRY_TYPE = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
_U32 = struct.Struct("<I")


def index_entries(raw: bytes, begin: int) -> List[Tuple[int, Array]]:
    """(connection id, entries) of the index records that follow a chunk.

    Raises:
        BagFormatError: One is damaged or cut off.
    """
    result = []
    at = begin
    while at < len(raw):
        if at + 4 > len(raw):
            raise BagFormatError("the index of a chunk is cut off")
        header_end = at + 4 + _U32.unpack_from(raw, at)[0]
        if header_end + 4 > len(raw):
            raise BagFormatError("the index of a chunk is cut off")
        fields = fmt.parse_header(raw[at + 4:header_end])
        data = header_end + 4
        at = data + _U32.unpack_from(raw, header_end)[0]
        if at > len(raw):
            raise BagFormatError("the index of a chunk is cut off")
        if fmt.opcode(fields) == fmt.OP_INDEX:
            if (at - data) % _ENTRY_TYPE.itemsize or fmt.u32(fields, "ver") != 1:
                raise BagFormatError("the index of a chunk is damaged")
            result.append((fmt.u32(fields, "conn"), np.frombuffer(raw, _ENTRY_TYPE,
                                                                  (at - data) // _ENTRY_TYPE.itemsize, data)))
    return result


class BagReader(LogReader):
    """A .bag open for reading; see ``LogReader``."""

    def _parse(self, chunk: ChunkRef, raw: bytes) -> Block:
        head = parse_chunk_head(raw)
        data_end = head.data_start + head.data_size
        if data_end > len(raw):
            raise BagFormatError("the chunk is cut off")
        data = decompress(head.codec, memoryview(raw)[head.data_start:data_end], head.size)
        entries = index_entries(raw, data_end)
        offset = np.zeros(0, np.int64)
        if entries:
            offset = np.sort(np.concatenate([entry["offset"] for _, entry in entries]).astype(np.int64))
        return parse_chunk(data, offset).block

    def load_times(self, chunk: ChunkRef) -> Block:
        """As ``load``, from the chunk's index records alone: only connection and log time are right."""
        head_raw = read_at(self._descriptor, chunk.position, 4096)
        head = parse_chunk_head(head_raw)
        begin = chunk.position + head.data_start + head.data_size
        entries = index_entries(read_at(self._descriptor, begin, chunk.end - begin), 0)
        blocks = []
        for number, entry in entries:
            none = np.zeros(len(entry), np.int64)
            time = entry["seconds"].astype(np.int64) * NS_PER_S + entry["nanoseconds"]
            blocks.append(Block(np.zeros(0, np.uint8), none, none, np.full(len(entry), number, np.int64), time))
        return self._renumber(concatenate(blocks))
