"""The parsers of MCAP's records (MCAP specification, version 0) and of the summary that they form; no numpy.

Functions that read raise ``BagFormatError`` where the bytes are damaged or cut off.
"""
import os
import struct
import zlib
from array import array
from typing import Counter, Dict, Iterator, List, NamedTuple, Optional, Tuple

from ...errors import BagFormatError
from ...messages.connection import Connection
from ...paths import PathLike
from ..compression import unknown_codec
from ..index import (
    AttachmentIndex,
    Buffer,
    ChunkHead,
    ChunkRef,
    IndexTotals,
    LogIndex,
    MetadataIndex,
    codec_totals,
    extremes,
    read_at,
)

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)

RECORD_HEAD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
"""Record head, channel id, sequence, log time, publish time; the payload follows."""
FOOTER_SIZE = RECORD_HEAD.size + 20
MAX_CHANNELS = 65535
"""Largest number of a channel: it has 16 bits."""

_LATEST = (1 << 63) - 1
"""Latest time, ns, that this package can hold."""
_WINDOW = 4 << 20
"""Bytes read at a time: memory stays bounded, and a disk is read in long pieces."""
_LONGEST_HEADER = 1 << 20
"""Bytes of the first record, at most: with more its length counts as damaged."""
MAX_UNKNOWN = 4096
"""Bytes after a chunk record's data, for fields of later versions; with more its length counts as damaged."""
DEFINED_AGAIN = "channel %d is defined again with another topic or type"
_CODECS = {"": "none", "lz4": "lz4", "zstd": "zstd"}
_CUT_OFF = "the file is cut off, its summary is missing (jaka_bag recover keeps the rest)"
_DAMAGED = "the summary is damaged (jaka_bag recover makes a whole file of it)"


class ChunkIndex(NamedTuple):
    """The location and content of one chunk; times in ns, positions and sizes in byte."""

    start_time: int
    end_time: int
    position: int
    size: int
    index_offsets: Dict[int, int]
    index_size: int
    compression: str
    compressed_size: int
    uncompressed_size: int


class Statistics(NamedTuple):
    """Totals of a file; times in ns."""

    messages: int
    schemas: int
    channels: int
    attachments: int
    metadata: int
    chunks: int
    start_time: int
    end_time: int
    channel_messages: Dict[int, int]


class Cursor:
    """A cursor that reads the fields of one record's body in order."""

    def __init__(self, body: Buffer, at: int = 0) -> None:
        self.body = body
        self.at = at

    def unpack(self, layout: str) -> Tuple[int, ...]:
        """Read integers of a little-endian ``struct`` layout."""
        form = struct.Struct("<" + layout)
        if self.at + form.size > len(self.body):
            raise BagFormatError("an MCAP record ends too early")
        values = form.unpack_from(self.body, self.at)
        self.at += form.size
        return values

    def number(self, layout: str) -> int:
        """Read one integer."""
        return self.unpack(layout)[0]

    def raw(self, size: int) -> bytes:
        """Read ``size`` bytes."""
        if size > len(self.body) - self.at:
            raise BagFormatError("an MCAP record ends too early")
        value = bytes(self.body[self.at:self.at + size])
        self.at += size
        return value

    def text(self) -> str:
        """Read a string; bytes that are not UTF-8 are kept as surrogates."""
        return self.raw(self.number("I")).decode("utf-8", "surrogateescape")

    def text_map(self) -> Dict[str, str]:
        """Read a map of strings."""
        inner = Cursor(self.raw(self.number("I")))
        values: Dict[str, str] = {}
        while inner.at < len(inner.body):
            key = inner.text()
            values[key] = inner.text()
        return values

    def number_map(self) -> Dict[int, int]:
        """Read a map of uint16 to uint64."""
        raw = self.raw(self.number("I"))
        if len(raw) % 10:
            raise BagFormatError("a map in an MCAP record is damaged")
        return dict(struct.iter_unpack("<HQ", raw))


class Schema(NamedTuple):
    """A type as MCAP stores it."""

    name: str
    encoding: str
    text: str


def parse_schema(body: Buffer) -> Tuple[int, Schema]:
    """Parse a schema record's body into its id and content."""
    c = Cursor(body)
    schema_id = c.number("H")
    return schema_id, Schema(c.text(), c.text(), c.text())


def parse_channel(body: Buffer, schemas: Dict[int, Schema]) -> Tuple[int, Connection]:
    """Parse a channel record's body into its id and connection."""
    c = Cursor(body)
    channel_id, schema_id = c.unpack("HH")
    topic, encoding, metadata = c.text(), c.text(), c.text_map()
    schema = schemas.get(schema_id, Schema("", "", ""))
    md5sum = metadata.pop("md5sum", "")
    callerid = metadata.pop("callerid", None)
    latching = metadata.pop("latching", None)
    return channel_id, Connection(
        topic, schema.name, md5sum, schema.text, callerid, None if latching is None else latching in ("true", "1"),
        tuple(metadata.items()), encoding, schema.encoding)


def is_described(channel: Connection) -> bool:
    """Return whether the schema of a channel is known."""
    return any((channel.datatype, channel.schema_encoding, channel.definition))


def is_same_channel(first: Connection, second: Connection) -> bool:
    """Return whether two definitions have the same topic and encoding, and the same type where both have one."""
    if (first.topic, first.encoding) != (second.topic, second.encoding):
        return False
    return not is_described(first) or not is_described(second) or (
        first.datatype, first.schema_encoding, first.definition) == (
            second.datatype, second.schema_encoding, second.definition)


def parse_chunk_index(body: Buffer) -> ChunkIndex:
    """Parse a chunk index record's body."""
    c = Cursor(body)
    start, end, position, size = c.unpack("QQQQ")
    return ChunkIndex(start, end, position, size, c.number_map(), c.number("Q"), c.text(), c.number("Q"), c.number("Q"))


def parse_statistics(body: Buffer) -> Statistics:
    """Parse a statistics record's body."""
    c = Cursor(body)
    return Statistics(*c.unpack("QHIIIIQQ"), c.number_map())  # type: ignore[call-arg, arg-type]


def parse_attachment_index(body: Buffer) -> AttachmentIndex:
    """Parse an attachment index record's body."""
    c = Cursor(body)
    position, size, log_time, create_time, data_size = c.unpack("QQQQQ")
    return AttachmentIndex(position, size, log_time, create_time, data_size, c.text(), c.text())


def parse_metadata_index(body: Buffer) -> MetadataIndex:
    """Parse a metadata index record's body."""
    c = Cursor(body)
    position, size = c.unpack("QQ")
    return MetadataIndex(position, size, c.text())


def read_metadata(descriptor: int, entry: MetadataIndex) -> Dict[str, str]:
    """Read the content of a metadata record."""
    c = Cursor(read_at(descriptor, entry.position, entry.size), RECORD_HEAD.size)
    c.text()
    return c.text_map()


def read_attachment(descriptor: int, entry: AttachmentIndex) -> bytes:
    """Read the content of an attachment record."""
    raw = read_at(descriptor, entry.position, entry.size)
    c = Cursor(raw, RECORD_HEAD.size)
    c.unpack("QQ")
    c.text(), c.text()
    data = c.raw(c.number("Q"))
    covered = c.at
    crc = c.number("I")
    if len(data) != entry.data_size or (crc and zlib.crc32(raw[RECORD_HEAD.size:covered]) != crc):
        raise BagFormatError("the CRC of the attachment %s is wrong" % entry.name)
    return data


def parse_attachment(raw: bytes, position: int) -> AttachmentIndex:
    """Parse an attachment record at a position of the file into an index entry."""
    c = Cursor(raw, RECORD_HEAD.size)
    log_time, create_time = c.unpack("QQ")
    name, media_type = c.text(), c.text()
    return AttachmentIndex(position, len(raw), log_time, create_time, c.number("Q"), name, media_type)


def parse_metadata(raw: bytes, position: int) -> MetadataIndex:
    """Parse a metadata record at a position of the file into an index entry."""
    c = Cursor(raw, RECORD_HEAD.size)
    entry = MetadataIndex(position, len(raw), c.text())
    c.text_map()
    return entry


def parse_chunk_head(raw: bytes) -> ChunkHead:
    """Parse the head of a chunk record; its data may be cut off. Fields of later versions may follow the data."""
    cursor = Cursor(raw)
    if cursor.number("B") != CHUNK:
        raise BagFormatError("there is no chunk record")
    end = cursor.number("Q") + RECORD_HEAD.size
    _, _, size, crc = cursor.unpack("QQQI")
    codec = cursor.text()
    stored = cursor.number("Q")
    if codec not in _CODECS:
        raise unknown_codec(codec)
    if not 0 <= end - cursor.at - stored <= MAX_UNKNOWN:
        raise BagFormatError("a chunk record is damaged")
    return ChunkHead(_CODECS[codec], size, crc, cursor.at, stored, end)


def records_in(data: Buffer, begin: int = 0, end: Optional[int] = None) -> Iterator[Tuple[int, int, int]]:
    """Yield (opcode, start, end) of the body of each whole record between two bytes."""
    stop = len(data) if end is None else end
    while begin + RECORD_HEAD.size <= stop:
        opcode, size = RECORD_HEAD.unpack_from(data, begin)
        start = begin + RECORD_HEAD.size
        begin = start + size
        if begin > stop:
            return
        yield opcode, start, begin


def whole_records(data: Buffer, begin: int = 0) -> List[Tuple[int, int, int]]:
    """Return (opcode, start, end) of the body of each record in ``data``."""
    found = list(records_in(data, begin))
    if (found[-1][2] if found else begin) != len(data):
        raise BagFormatError("the last MCAP record is cut off")
    return found


class _Summary(NamedTuple):
    """The records of a summary section, parsed."""

    schemas: Dict[int, Schema]
    channels: Dict[int, Connection]
    chunks: List[ChunkIndex]
    statistics: Optional[Statistics]
    attachments: List[AttachmentIndex]
    metadata: List[MetadataIndex]


def parse_summary(data: bytes) -> _Summary:
    """Parse the records of a summary section."""
    summary = _Summary({}, {}, [], None, [], [])
    bodies: Dict[int, List[bytes]] = {}
    for opcode, begin, end in whole_records(data):
        bodies.setdefault(opcode, []).append(data[begin:end])
    for body in bodies.get(SCHEMA, []):
        summary.schemas.update([parse_schema(body)])
    for body in bodies.get(CHANNEL, []):
        summary.channels.update([parse_channel(body, summary.schemas)])
    summary.chunks.extend(map(parse_chunk_index, bodies.get(CHUNK_INDEX, [])))
    summary.attachments.extend(map(parse_attachment_index, bodies.get(ATTACHMENT_INDEX, [])))
    summary.metadata.extend(map(parse_metadata_index, bodies.get(METADATA_INDEX, [])))
    return summary._replace(statistics=next(map(parse_statistics, bodies.get(STATISTICS, [])), None))


def read_file_head(descriptor: int) -> Tuple[str, str, int]:
    """Read the file's head; return profile, library, and the end of the first record."""
    raw = read_at(descriptor, 0, len(MAGIC) + RECORD_HEAD.size + 1024)
    if raw[:len(MAGIC)] != MAGIC:
        raise BagFormatError("the file is cut off in its first bytes, or of an MCAP version that is not supported")
    if len(raw) < len(MAGIC) + RECORD_HEAD.size:
        raise BagFormatError("the file is cut off in its first record")
    opcode, size = RECORD_HEAD.unpack_from(raw, len(MAGIC))
    begin = len(MAGIC) + RECORD_HEAD.size
    if len(raw) - begin < size <= _LONGEST_HEADER:
        raw = read_at(descriptor, 0, begin + size)
    if opcode != HEADER or size > len(raw) - begin:
        raise BagFormatError("the first record is cut off or damaged")
    cursor = Cursor(raw[begin:begin + size])
    return cursor.text(), cursor.text(), begin + size


def end_of_records(descriptor: int, size: int) -> int:
    """Return the end of a file without the zeros behind its last magic bytes; its size where there are none."""
    end = size
    while end > 0:
        begin = max(end - _WINDOW, 0)
        kept = read_at(descriptor, begin, end - begin).rstrip(b"\0")
        if kept:
            end = begin + len(kept)
            break
        end = begin
    return end if read_at(descriptor, max(end - len(MAGIC), 0), len(MAGIC)) == MAGIC else size


def zeros_behind(end: int, size: int) -> List[str]:
    """Return the note on the zeros between ``end_of_records`` and a file's end, if there are any."""
    return ["%d bytes at byte %d are zero and were skipped" % (size - end, end)] if end < size else []


def read_footer(descriptor: int, size: int) -> Tuple[int, int]:
    """Start of the summary (0: the file has none) and its CRC (0: not given)."""
    tail_size = FOOTER_SIZE + len(MAGIC)
    tail = read_at(descriptor, max(size - tail_size, 0), tail_size)
    if len(tail) < tail_size or not tail.endswith(MAGIC) or RECORD_HEAD.unpack_from(tail) != (FOOTER, 20):
        raise BagFormatError(_CUT_OFF)
    start, _, crc = struct.unpack_from("<QQI", tail, RECORD_HEAD.size)
    return start, crc


def read_summary(descriptor: int, size: int) -> Optional[_Summary]:
    """Read the summary; return None where the file was written without one."""
    start, crc = read_footer(descriptor, size)
    if start == 0:
        return None
    end = size - FOOTER_SIZE - len(MAGIC)
    if not len(MAGIC) <= start <= end:
        raise BagFormatError(_DAMAGED)
    data = read_at(descriptor, start, end - start + FOOTER_SIZE - 4)
    if crc and zlib.crc32(data) != crc:
        raise BagFormatError(_DAMAGED)
    return parse_summary(data[:end - start])


def _is_complete(summary: _Summary) -> bool:
    statistics = summary.statistics
    if statistics is None or statistics[1:3] + statistics[5:6] != (
            len(summary.schemas), len(summary.channels), len(summary.chunks)):
        return False
    if not all(chunk.index_offsets for chunk in summary.chunks) and statistics.messages:
        return False
    return bool(summary.chunks) or not statistics.messages


def _find_extras(descriptor: int, begin: int, size: int) -> Tuple[List[AttachmentIndex], List[MetadataIndex]]:
    """Find all attachments and metadata records of a whole data section, whether or not the summary names them."""
    attachments: List[AttachmentIndex] = []
    metadata: List[MetadataIndex] = []
    opcode = 0
    while opcode != DATA_END:
        head = read_at(descriptor, begin, RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            raise BagFormatError(_DAMAGED)
        opcode, length = RECORD_HEAD.unpack(head)
        length += RECORD_HEAD.size
        if begin + length > size:
            raise BagFormatError(_DAMAGED)
        if opcode == ATTACHMENT:
            attachments.append(parse_attachment(read_at(descriptor, begin, length), begin))
        elif opcode == METADATA:
            metadata.append(parse_metadata(read_at(descriptor, begin, length), begin))
        begin += length
    return attachments, metadata


def _index_behind(raw: bytes) -> IndexTotals:
    """Return what the message indexes in a buffer name; less than declared where one is damaged."""
    totals = IndexTotals()
    for opcode, begin, end in records_in(raw):
        if opcode != MESSAGE_INDEX or end - begin < 6:
            continue
        channel, size = struct.unpack_from("<HI", raw, begin)
        count = min(size, end - begin - 6) // 16
        times = array("Q", raw[begin + 6:begin + 6 + 16 * count])[::2]
        if times:
            totals.add(channel, len(times), *extremes(times))
    return totals


def _is_named(descriptor: int, begin: int, end: int, channels: Dict[int, Connection],
              schemas: Dict[int, Schema]) -> bool:
    """Return whether the data section between two bytes, outside of named chunks, holds nothing but what is known.

    That is no message, no bytes that are no records, and no channel of another topic or type than the summary has.

    Args:
        descriptor: The file.
        begin: First byte.
        end: Byte to stop at.
        channels: Those of the summary.
        schemas: Those of the data section outside of chunks so far; it grows.
    """
    while begin < end:
        head = read_at(descriptor, begin, RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)
        begin += RECORD_HEAD.size + length
        if opcode in (0, CHUNK, MESSAGE) or begin > end:
            return False
        if opcode == SCHEMA:
            schemas.update([parse_schema(read_at(descriptor, begin - length, length))])
        elif opcode == CHANNEL:
            number, channel = parse_channel(read_at(descriptor, begin - length, length), schemas)
            if number not in channels or not is_same_channel(channels[number], channel):
                return False
    return True


def find_data_end(descriptor: int, size: int) -> int:
    """Return where the last record of the data section begins, which the footer leads to; 0 where it does not."""
    try:
        start = read_footer(descriptor, size)[0] or size - FOOTER_SIZE - len(MAGIC)
    except BagFormatError:
        return 0
    at = start - RECORD_HEAD.size - 4
    is_there = at > 0 and read_at(descriptor, at, RECORD_HEAD.size) == RECORD_HEAD.pack(DATA_END, 4)
    return at if is_there else 0


def has_right_crc(descriptor: int, end: int) -> Optional[bool]:
    """Return whether the data section, whose last record begins at ``end``, has the CRC that it names; None if none."""
    raw = read_at(descriptor, end, RECORD_HEAD.size + 4)
    expected = int.from_bytes(raw[RECORD_HEAD.size:], "little") if raw[:1] == bytes([DATA_END]) else 0
    crc, at = 0, 0
    while expected and at < end:
        crc = zlib.crc32(read_at(descriptor, at, min(_WINDOW, end - at)), crc)
        at += _WINDOW
    return crc == expected if expected else None


def _contradiction(descriptor: int, summary: _Summary, begin: int, end: int) -> Tuple[str, Dict[int, IndexTotals]]:
    """Compare a summary with the message indexes in the data section, from byte ``begin`` to before ``end``.

    Returns:
        Where they differ first, empty where they do not; and what the indexes name, by position of the chunk.
    """
    found: Dict[int, IndexTotals] = {}
    counts: Counter[int] = Counter()
    schemas: Dict[int, Schema] = {}
    for chunk in summary.chunks:
        if not _is_named(descriptor, begin, chunk.position, summary.channels, schemas):
            return "it does not name all that lies before byte %d" % chunk.position, found
        behind = chunk.position + chunk.size
        totals = found[chunk.position] = _index_behind(read_at(descriptor, behind, chunk.index_size))
        begin = behind + chunk.index_size
        counts.update(totals.counts)
        if not chunk.index_offsets.keys() >= totals.counts.keys() or totals.contradicts(
                chunk.start_time, chunk.end_time) or chunk.end_time > _LATEST:
            return "channels or times of the chunk at byte %d are not those of its messages" % chunk.position, found
    if not _is_named(descriptor, begin, end, summary.channels, schemas):
        return "it does not name all that lies behind byte %d" % begin, found
    statistics = summary.statistics
    assert statistics is not None
    if statistics.messages != sum(counts.values()) or any(
            counts[channel] != count for channel, count in statistics.channel_messages.items()):
        return "it tells of %d messages, the chunks' own indexes of %d" % (
            statistics.messages, sum(counts.values())), found
    return "", found


def read_index(path: PathLike, descriptor: int) -> Optional[LogIndex]:
    """Read the index of an MCAP; return None for a whole file without a usable summary."""
    file_size = os.fstat(descriptor).st_size
    size = end_of_records(descriptor, file_size)
    profile, library, data_start = read_file_head(descriptor)
    summary = read_summary(descriptor, size)
    if summary is None or not _is_complete(summary):
        return None
    numbers = {channel_id: number for number, channel_id in enumerate(summary.channels)}
    summary.chunks.sort(key=lambda chunk: chunk.position)
    earliest = data_start
    for chunk in summary.chunks:
        if chunk.position < earliest or not numbers.keys() >= chunk.index_offsets.keys():
            raise BagFormatError(_DAMAGED)
        earliest = chunk.position + chunk.size + chunk.index_size
    if earliest > size:
        raise BagFormatError(_DAMAGED)
    data_end = read_footer(descriptor, size)[0]
    contradiction, found = _contradiction(descriptor, summary, data_start, data_end)
    chunks = [ChunkRef(c.position, c.position + c.size + c.index_size, *(
        (c.start_time, c.end_time) if found[c.position].counts else (0, 0)), {
            numbers[channel]: count for channel, count in found[c.position].counts.items()},
        unpacked=c.uncompressed_size)
        for c in (() if contradiction else summary.chunks)]
    filled = [chunk for chunk in chunks if chunk.counts]
    statistics = summary.statistics
    assert statistics is not None
    attachments, metadata = summary.attachments, summary.metadata
    if statistics[3:5] != (len(attachments), len(metadata)):
        attachments, metadata = _find_extras(descriptor, data_start, size)
    first, last = min((c.start_time for c in filled), default=None), max((c.end_time for c in filled), default=None)
    if filled and (first, last) != (statistics.start_time, statistics.end_time):
        contradiction = contradiction or "its times are not those of the messages"
    counts = [statistics.channel_messages.get(channel, 0) for channel in numbers]
    return LogIndex("mcap", "0", str(path), file_size, list(summary.channels.values()), numbers, chunks, counts, first,
                    last, profile, library, tuple(attachments), tuple(metadata),
                    codec_totals((c.compression or "none", c.compressed_size, c.uncompressed_size)
                                 for c in summary.chunks), tuple(zeros_behind(size, file_size)), contradiction)
