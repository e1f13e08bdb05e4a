"""The summary section of an MCAP; where there is none, the same facts from a walk over the file's records."""
import os
import struct
import zlib
from typing import Dict, List, NamedTuple, Optional, Tuple

from ...errors import BagFormatError
from ...messages.connection import Connection
from ...paths import PathLike
from ..index import AttachmentIndex, ChunkRef, LogIndex, MetadataIndex, read_at
from . import records as fmt

_CUT_OFF = "the file is cut off, its summary is missing (jaka_bag recover keeps the rest)"
_DAMAGED = "the summary is damaged (jaka_bag recover makes a whole file of it)"


class Summary(NamedTuple):
    """The records of a summary section, parsed."""

    schemas: Dict[int, fmt.Schema]
    channels: Dict[int, Connection]
    chunks: List[fmt.ChunkIndex]
    statistics: Optional[fmt.Statistics]
    attachments: List[AttachmentIndex]
    metadata: List[MetadataIndex]


def parse_summary(data: bytes) -> Summary:
    """The records of a summary section.

    Raises:
        BagFormatError: One is damaged.
    """
    summary = Summary({}, {}, [], None, [], [])
    bodies: Dict[int, List[bytes]] = {}
    for opcode, begin, end in fmt.split_records(data):
        bodies.setdefault(opcode, []).append(data[begin:end])
    for body in bodies.get(fmt.SCHEMA, []):
        schema_id, schema = fmt.parse_schema(body)
        summary.schemas[schema_id] = schema
    for body in bodies.get(fmt.CHANNEL, []):
        channel_id, connection = fmt.parse_channel(body, summary.schemas)
        summary.channels[channel_id] = connection
    summary.chunks.extend(map(fmt.parse_chunk_index, bodies.get(fmt.CHUNK_INDEX, [])))
    summary.attachments.extend(map(fmt.parse_attachment_index, bodies.get(fmt.ATTACHMENT_INDEX, [])))
    summary.metadata.extend(map(fmt.parse_metadata_index, bodies.get(fmt.METADATA_INDEX, [])))
    for body in bodies.get(fmt.STATISTICS, []):
        return summary._replace(statistics=fmt.parse_statistics(body))
    return summary


def read_file_head(descriptor: int) -> Tuple[str, str, int]:
    """Profile, library, and the position behind the first record.

    Raises:
        BagFormatError: It is cut off or damaged, or the format's version is not 0.
    """
    raw = read_at(descriptor, 0, len(fmt.MAGIC) + fmt.RECORD_HEAD.size + 1024)
    if raw[:len(fmt.MAGIC)] != fmt.MAGIC:
        raise BagFormatError("the file is cut off in its first bytes, or of an MCAP version that is not supported")
    if len(raw) < len(fmt.MAGIC) + fmt.RECORD_HEAD.size:
        raise BagFormatError("the file is cut off in its first record")
    opcode, size = fmt.RECORD_HEAD.unpack_from(raw, len(fmt.MAGIC))
    begin = len(fmt.MAGIC) + fmt.RECORD_HEAD.size
    if opcode != fmt.HEADER or size > len(raw) - begin:
        raise BagFormatError("the first record is cut off or damaged")
    cursor = fmt.Cursor(raw[begin:begin + size])
    profile = cursor.text()
    return profile, cursor.text(), begin + size


def read_footer(descriptor: int, size: int) -> Tuple[int, int]:
    """Start of the summary (0: the file has none) and its CRC (0: not given).

    Raises:
        BagFormatError: The file does not end as an MCAP does.
    """
    tail_size = fmt.FOOTER_SIZE + len(fmt.MAGIC)
    tail = read_at(descriptor, max(size - tail_size, 0), tail_size)
    if len(tail) < tail_size or not tail.endswith(fmt.MAGIC) or fmt.RECORD_HEAD.unpack_from(tail) != (fmt.FOOTER, 20):
        raise BagFormatError(_CUT_OFF)
    start, _, crc = struct.unpack_from("<QQI", tail, fmt.RECORD_HEAD.size)
    return start, crc


def read_summary(descriptor: int, size: int) -> Optional[Summary]:
    """The summary; None where the file was written without one.

    Raises:
        BagFormatError: The file is cut off or the summary is damaged.
    """
    start, crc = read_footer(descriptor, size)
    if start == 0:
        return None
    end = size - fmt.FOOTER_SIZE - len(fmt.MAGIC)
    if not len(fmt.MAGIC) <= start <= end:
        raise BagFormatError(_DAMAGED)
    data = read_at(descriptor, start, end - start + fmt.FOOTER_SIZE - 4)
    if crc and zlib.crc32(data) != crc:
        raise BagFormatError(_DAMAGED)
    return parse_summary(data[:end - start])


def _is_complete(summary: Summary) -> bool:
    statistics = summary.statistics
    if statistics is None or statistics[1:3] + statistics[5:6] != (
            len(summary.schemas), len(summary.channels), len(summary.chunks)):
        return False
    if not all(chunk.index_offsets for chunk in summary.chunks) and statistics.messages:
        return False
    return bool(summary.chunks) or not statistics.messages


def read_mcap_index(path: PathLike, descriptor: int) -> LogIndex:
    """The index of an MCAP.

    Raises:
        BagFormatError: The file is cut off or damaged.
    """
    size = os.fstat(descriptor).st_size
    profile, library, data_start = read_file_head(descriptor)
    summary = read_summary(descriptor, size)
    if summary is None or not _is_complete(summary):
        from .walk import walk_index
        return walk_index(path, descriptor, size, profile, library, data_start)
    assert summary.statistics is not None
    numbers = {channel_id: number for number, channel_id in enumerate(summary.channels)}
    chunks: List[ChunkRef] = []
    codecs: Dict[str, Tuple[int, int, int]] = {}
    for chunk in sorted(summary.chunks, key=lambda c: c.position):
        end = chunk.position + chunk.size + chunk.index_size
        if chunk.position < data_start or end > size or not numbers.keys() >= chunk.index_offsets.keys():
            raise BagFormatError(_DAMAGED)
        chunks.append(ChunkRef(chunk.position, end, chunk.start_time, chunk.end_time,
                               {numbers[c]: 0 for c in chunk.index_offsets}))
        count, stored, full = codecs.get(chunk.compression or "none", (0, 0, 0))
        codecs[chunk.compression or "none"] = (count + 1, stored + chunk.compressed_size,
                                               full + chunk.uncompressed_size)
    statistics = summary.statistics
    counts = [statistics.channel_messages.get(channel_id, 0) for channel_id in summary.channels]
    if sum(counts) != statistics.messages:
        raise BagFormatError(_DAMAGED)
    has_messages = statistics.messages > 0
    return LogIndex("mcap", "0", str(path), size, list(summary.channels.values()), numbers, chunks, counts,
                    statistics.start_time if has_messages else None, statistics.end_time if has_messages else None,
                    profile, library, tuple(summary.attachments), tuple(summary.metadata),
                    tuple((name, *values) for name, values in codecs.items()))
