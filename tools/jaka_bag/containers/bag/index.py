"""The index section of a .bag: connections and chunk infos."""
import os
import struct
from typing import Dict, List, NamedTuple, Tuple

from ...errors import BagFormatError
from ...messages.connection import Connection
from ...paths import PathLike
from ..index import ChunkRef, LogIndex, open_for_reading, read_at
from . import records as fmt

_U32 = struct.Struct("<I")
_CUT_OFF = "the recording was cut off, there is no index (jaka_bag recover makes a whole file of it)"
_DAMAGED = "the index is damaged (jaka_bag recover makes a whole file of it)"


class ChunkHead(NamedTuple):
    """A chunk record up to its data: codec, uncompressed size, where the data starts and how long it is."""

    codec: str
    size: int
    data_start: int
    data_size: int


def parse_chunk_head(raw: bytes) -> ChunkHead:
    """The head of a chunk record.

    Raises:
        BagFormatError: It is damaged or cut off.
    """
    if len(raw) < 8 or _U32.unpack_from(raw)[0] > len(raw) - 8:
        raise BagFormatError("a chunk record is cut off or damaged")
    header_end = 4 + _U32.unpack_from(raw)[0]
    fields = fmt.parse_header(raw[4:header_end])
    if fmt.opcode(fields) != fmt.OP_CHUNK:
        raise BagFormatError("there is no chunk record")
    codec = fields.get("compression", b"").decode("ascii", "replace")
    return ChunkHead(codec, fmt.u32(fields, "size"), header_end + 4, int(_U32.unpack_from(raw, header_end)[0]))


def read_file_header(descriptor: int) -> Tuple[fmt.Header, int]:
    """Fields of the first record, and the position behind it.

    Raises:
        BagFormatError: It is cut off, damaged or says that the bag is encrypted.
    """
    raw = read_at(descriptor, len(fmt.MAGIC), 4 + fmt.FILE_HEADER_SIZE + 4)
    if len(raw) < 8:
        raise BagFormatError("the file is cut off in its first record")
    size = _U32.unpack_from(raw)[0]
    if size > len(raw) - 8:
        raise BagFormatError("the first record is cut off or damaged")
    fields = fmt.parse_header(raw[4:4 + size])
    if fmt.opcode(fields) != fmt.OP_FILE_HEADER:
        raise BagFormatError("the first record is not a file header")
    encryptor = fields.get("encryptor", b"")
    if encryptor:
        raise BagFormatError("the bag is encrypted (%s); 'rosbag decrypt' first" % encryptor.decode("utf-8", "replace"))
    return fields, len(fmt.MAGIC) + 8 + size + int(_U32.unpack_from(raw, 4 + size)[0])


def _read_section(data: bytes) -> Tuple[Dict[int, Connection], List[fmt.ChunkInfo]]:
    connections: Dict[int, Connection] = {}
    infos: List[fmt.ChunkInfo] = []
    at = 0
    unpack = _U32.unpack_from
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


def read_codecs(path: PathLike, index: LogIndex) -> Tuple[Tuple[str, int, int, int], ...]:
    """Per codec: chunks, stored bytes, uncompressed bytes; from the heads of the chunks.

    Raises:
        BagFormatError: A chunk's head is damaged.
    """
    descriptor = open_for_reading(path)
    codecs: Dict[str, Tuple[int, int, int]] = {}
    try:
        for chunk in index.chunks:
            head = parse_chunk_head(read_at(descriptor, chunk.position, 256))
            count, stored, full = codecs.get(head.codec, (0, 0, 0))
            codecs[head.codec] = (count + 1, stored + head.data_size, full + head.size)
    except BagFormatError as error:
        raise BagFormatError("%s: %s" % (path, error)) from error
    finally:
        os.close(descriptor)
    return tuple((name, *values) for name, values in codecs.items())
