"""The index section of a .bag: connections and chunk infos."""
import os
import struct
from typing import Dict, List, Tuple

from . import bag_format as fmt
from .definitions import Connection
from .errors import BagFormatError
from .log_index import ChunkRef, LogIndex, read_at
from .output_file import PathLike

_CUT_OFF = "the recording was cut off, there is no index (jaka_bag recover makes a whole file of it)"
_DAMAGED = "the index is damaged (jaka_bag recover makes a whole file of it)"


def read_file_header(descriptor: int) -> Tuple[fmt.Header, int]:
    """Fields of the first record, and the position behind it.

    Raises:
        BagFormatError: It is cut off, damaged or says that the bag is encrypted.
    """
    raw = read_at(descriptor, len(fmt.MAGIC), 4 + fmt.FILE_HEADER_SIZE + 4)
    if len(raw) < 8:
        raise BagFormatError("the file is cut off in its first record")
    size = struct.unpack_from("<I", raw)[0]
    if size > len(raw) - 8:
        raise BagFormatError("the first record is cut off or damaged")
    fields = fmt.parse_header(raw[4:4 + size])
    if fmt.opcode(fields) != fmt.OP_FILE_HEADER:
        raise BagFormatError("the first record is not a file header")
    encryptor = fields.get("encryptor", b"")
    if encryptor:
        raise BagFormatError("the bag is encrypted (%s); 'rosbag decrypt' first" % encryptor.decode("utf-8", "replace"))
    return fields, len(fmt.MAGIC) + 8 + size + int(struct.unpack_from("<I", raw, 4 + size)[0])


def _read_section(data: bytes) -> Tuple[Dict[int, Connection], List[fmt.ChunkInfo]]:
    connections: Dict[int, Connection] = {}
    infos: List[fmt.ChunkInfo] = []
    at = 0
    unpack = struct.Struct("<I").unpack_from
    while at < len(data):
        if at + 4 > len(data):
            raise BagFormatError(_DAMAGED)
        header_end = at + 4 + unpack(data, at)[0]
        if header_end + 4 > len(data):
            raise BagFormatError(_DAMAGED)
        fields = fmt.parse_header(data[at + 4:header_end])
        at = header_end + 4 + unpack(data, header_end)[0]
        if at > len(data):
            raise BagFormatError(_DAMAGED)
        kind = fmt.opcode(fields)
        if kind == fmt.OP_CONNECTION:
            number, connection = fmt.parse_connection(fields, data[header_end + 4:at])
            connections[number] = connection
        elif kind == fmt.OP_CHUNK_INFO:
            infos.append(fmt.parse_chunk_info(fields, data[header_end + 4:at]))
    return connections, infos


def read_bag_index(path: PathLike, descriptor: int) -> LogIndex:
    """The index of a bag, version 2.0.

    Raises:
        BagFormatError: It has none, or it is damaged.
    """
    size = os.fstat(descriptor).st_size
    fields, first_chunk = read_file_header(descriptor)
    index_position = fmt.u64(fields, "index_pos")
    if index_position == 0:
        raise BagFormatError(_CUT_OFF)
    if index_position > size:
        raise BagFormatError("the file is cut off, its index is missing (jaka_bag recover keeps the rest)")
    by_id, infos = _read_section(read_at(descriptor, index_position, size - index_position))
    if len(by_id) != fmt.u32(fields, "conn_count") or len(infos) != fmt.u32(fields, "chunk_count"):
        raise BagFormatError(_DAMAGED)
    numbers = {file_id: number for number, file_id in enumerate(by_id)}
    infos.sort(key=lambda info: info.position)
    ends = [info.position for info in infos[1:]] + [index_position]
    chunks = []
    counts = [0] * len(numbers)
    for info, end in zip(infos, ends):
        if not first_chunk <= info.position < end or not numbers.keys() >= info.counts.keys():
            raise BagFormatError(_DAMAGED)
        by_number = {numbers[file_id]: count for file_id, count in info.counts.items()}
        for number, count in by_number.items():
            counts[number] += count
        chunks.append(ChunkRef(info.position, end, info.start_time, info.end_time, by_number))
    filled = [chunk for chunk in chunks if any(chunk.counts.values())]
    return LogIndex("bag", "2.0", str(path), size, list(by_id.values()), numbers, chunks, counts,
                    min((c.start_time for c in filled), default=None),
                    max((c.end_time for c in filled), default=None))
