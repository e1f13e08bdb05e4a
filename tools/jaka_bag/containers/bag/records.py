"""The records of ROS bag files, version 2.0 (ROS wiki, Bags/Format/2.0), and the index that they make; no numpy.

What reads raises ``BagFormatError`` where the bytes are damaged or cut off.
"""
import os
import struct
from array import array
from typing import Dict, Iterable, Iterator, List, NamedTuple, Optional, Tuple

from ...errors import BagFormatError
from ...messages.connection import Connection
from ...paths import PathLike
from ...units import NS_PER_S
from ..index import Buffer, ChunkHead, ChunkRef, IndexTotals, LogIndex, codec_totals, extremes, read_at

MAGIC = b"#ROSBAG V2.0\n"
OP_MESSAGE, OP_FILE_HEADER, OP_INDEX, OP_CHUNK, OP_CHUNK_INFO, OP_CONNECTION = range(2, 8)
FILE_HEADER_SIZE = 4096
"""Bytes of the first record's header and padding together."""
INDEX_ENTRY_SIZE = 12
MAX_SECONDS = 0xFFFFFFFF
"""Largest number of seconds of a time, which has 32 bits."""

_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_TIME = struct.Struct("<II")

Header = Dict[str, bytes]


_CUT_OFF = "the recording was cut off, there is no index (jaka_bag recover makes a whole file of it)"
_PROBE = 4096
"""Bytes read for one record's head; a longer header counts as damage here."""
_WINDOW = 4 << 20
"""Bytes read at a time: memory stays bounded, and a disk is read in long pieces."""
_CHUNK_MARK = b"\x04\x00\x00\x00op=" + bytes([OP_CHUNK])
DAMAGED = "the index is damaged (jaka_bag recover makes a whole file of it)"


class Record(NamedTuple):
    """One record in a buffer: its kind, its header's fields, and where its data begins and ends."""

    kind: int
    fields: Header
    begin: int
    end: int


class ChunkInfo(NamedTuple):
    """The index section's entry of one chunk: where it is, byte; its time span, ns; messages by connection id."""

    position: int
    start_time: int
    end_time: int
    counts: Dict[int, int]


def pack_header(fields: Iterable[Tuple[str, bytes]]) -> bytes:
    """Encode header fields, without the length of the whole header."""
    return b"".join(_U32.pack(len(name) + 1 + len(value)) + _encode(name) + b"=" + value for name, value in fields)


def pack_record(fields: Iterable[Tuple[str, bytes]], data: bytes) -> bytes:
    """Encode one whole record."""
    header = pack_header(fields)
    return _U32.pack(len(header)) + header + _U32.pack(len(data)) + data


def pack_time(time_ns: int) -> bytes:
    """Encode a time, ns, as the format's seconds and nanoseconds."""
    return _TIME.pack(*divmod(time_ns, NS_PER_S))


def parse_header(raw: Buffer) -> Header:
    """Parse header fields into a dictionary by name."""
    fields: Header = {}
    data = bytes(raw)
    at = 0
    while at < len(data):
        if at + 4 > len(data):
            raise BagFormatError("a record header is damaged")
        size = _U32.unpack_from(data, at)[0]
        at += 4
        name, separator, value = data[at:at + size].partition(b"=")
        if not separator or at + size > len(data):
            raise BagFormatError("a record header is damaged")
        fields[name.decode("utf-8", "surrogateescape")] = value
        at += size
    return fields


def _field(fields: Header, name: str, form: struct.Struct) -> Tuple[int, ...]:
    value = fields.get(name)
    if value is None or len(value) != form.size:
        raise BagFormatError("a record lacks the field %r" % name)
    return form.unpack(value)


def u32(fields: Header, name: str) -> int:
    """Return a 32-bit field."""
    return _field(fields, name, _U32)[0]


def u64(fields: Header, name: str) -> int:
    """Return a 64-bit field."""
    return _field(fields, name, _U64)[0]


def time_ns(fields: Header, name: str) -> int:
    """Return a time field, ns."""
    seconds, nanoseconds = _field(fields, name, _TIME)
    return seconds * NS_PER_S + nanoseconds


def record_at(raw: Buffer, at: int = 0, stop: Optional[int] = None) -> Optional[Record]:
    """Return the record at a position of a buffer; None where its header does not end before ``stop`` (None: the end).

    Its data may be cut off: ``end`` is then greater than ``stop``.
    """
    stop = len(raw) if stop is None else stop
    if at + 8 > stop:
        return None
    header_end = at + 4 + _U32.unpack_from(raw, at)[0]
    if header_end + 4 > stop:
        return None
    fields = parse_header(raw[at + 4:header_end])
    kind = fields.get("op")
    if kind is None or len(kind) != 1:
        raise BagFormatError("a record lacks its kind")
    begin = header_end + 4
    return Record(kind[0], fields, begin, begin + _U32.unpack_from(raw, header_end)[0])


def try_record_at(raw: Buffer, at: int = 0) -> Optional[Record]:
    """Return the record at a position as ``record_at`` does; None also where there is no valid record."""
    try:
        return record_at(raw, at)
    except BagFormatError:
        return None


def whole_records(raw: bytes, begin: int = 0, problem: str = DAMAGED) -> Iterator[Record]:
    """Return the records from a position to the end of a buffer."""
    while begin < len(raw):
        record = record_at(raw, begin)
        if record is None or record.end > len(raw):
            raise BagFormatError(problem)
        yield record
        begin = record.end


def file_header(index_position: int, connections: int, chunks: int) -> bytes:
    """Encode the first record, padded to its fixed size."""
    fields = [("chunk_count", _U32.pack(chunks)), ("conn_count", _U32.pack(connections)),
              ("index_pos", _U64.pack(index_position)), ("op", bytes([OP_FILE_HEADER]))]
    return pack_record(fields, b" " * (FILE_HEADER_SIZE - len(pack_header(fields))))


def connection_record(number: int, connection: Connection) -> bytes:
    """Encode one connection as a record, with its connection header inside."""
    fields = {"topic": connection.topic, **dict(connection.extra), "type": connection.datatype,
              "md5sum": connection.md5sum, "message_definition": connection.definition}
    if connection.callerid is not None:
        fields["callerid"] = connection.callerid
    if connection.latching is not None:
        fields["latching"] = "1" if connection.latching else "0"
    return pack_record(
        [("conn", _U32.pack(number)), ("op", bytes([OP_CONNECTION])), ("topic", _encode(connection.topic))],
        pack_header((name, _encode(value)) for name, value in sorted(fields.items())))


def _encode(value: str) -> bytes:
    return value.encode("utf-8", "surrogateescape")


def parse_connection(record: Record, raw: Buffer) -> Tuple[int, Connection]:
    """Parse a connection record of a buffer into its id and connection."""
    number = u32(record.fields, "conn")
    raw_topic = record.fields.get("topic")
    if raw_topic is None:
        raise BagFormatError("a connection lacks its topic")
    topic = raw_topic.decode("utf-8", "surrogateescape")
    inner = {name: value.decode("utf-8", "surrogateescape")
             for name, value in parse_header(raw[record.begin:record.end]).items()}
    if inner.get("topic") == topic:  # else it was remapped while recording
        del inner["topic"]
    datatype, md5sum = inner.pop("type", ""), inner.pop("md5sum", "")
    definition, callerid = inner.pop("message_definition", ""), inner.pop("callerid", None)
    latching = {"0": False, "1": True}.get(inner.get("latching", ""))
    if latching is not None:
        del inner["latching"]
    return number, Connection(topic, datatype, md5sum, definition, callerid, latching, tuple(sorted(inner.items())))


def difference(number: int, inside: Connection, indexed: Connection) -> str:
    """Return how the index section describes a connection otherwise than a chunk does; empty where it does not.

    Only what says what the messages are is compared: topic, type, md5 and definition.
    """
    for name, ours, theirs in (("topic", inside.topic, indexed.topic), ("type", inside.datatype, indexed.datatype),
                               ("md5", inside.md5sum, indexed.md5sum)):
        if ours != theirs:
            return "the %s of connection %d is %.90r in the chunk and %.90r in the index" % (name, number, ours, theirs)
    if inside.definition != indexed.definition:
        return "the definition of connection %d in the chunk is not that in the index" % number
    return ""


def index_record(number: int, count: int, entries: bytes) -> bytes:
    """Encode the index of one connection's messages in the chunk before: ``count`` x (s, ns, offset)."""
    return pack_record([("conn", _U32.pack(number)), ("count", _U32.pack(count)), ("op", bytes([OP_INDEX])),
                        ("ver", _U32.pack(1))], entries)


def chunk_info_record(info: ChunkInfo) -> bytes:
    """Encode the index section's entry of one chunk."""
    data = b"".join(_TIME.pack(number, count) for number, count in info.counts.items())
    return pack_record([("chunk_pos", _U64.pack(info.position)), ("count", _U32.pack(len(info.counts))),
                        ("end_time", pack_time(info.end_time)), ("op", bytes([OP_CHUNK_INFO])),
                        ("start_time", pack_time(info.start_time)), ("ver", _U32.pack(1))], data)


def parse_chunk_info(record: Record, raw: Buffer) -> ChunkInfo:
    """Parse a chunk info record of a buffer."""
    if (record.end - record.begin) % _TIME.size:
        raise BagFormatError("the index is damaged")
    return ChunkInfo(u64(record.fields, "chunk_pos"), time_ns(record.fields, "start_time"),
                     time_ns(record.fields, "end_time"), dict(_TIME.iter_unpack(raw[record.begin:record.end])))


def chunk_head(codec: str, uncompressed_size: int, stored: int) -> bytes:
    """Encode a chunk record up to its ``stored`` bytes of compressed records."""
    header = pack_header([("compression", codec.encode()), ("op", bytes([OP_CHUNK])),
                          ("size", _U32.pack(uncompressed_size))])
    return _U32.pack(len(header)) + header + _U32.pack(stored)


def parse_chunk_head(raw: bytes) -> ChunkHead:
    """Parse the head of a chunk record."""
    record = record_at(raw)
    if record is None:
        raise BagFormatError("a chunk record is cut off or damaged")
    if record.kind != OP_CHUNK:
        raise BagFormatError("there is no chunk record")
    codec = record.fields.get("compression", b"").decode("ascii", "replace")
    return ChunkHead(codec, u32(record.fields, "size"), 0, record.begin, record.end - record.begin, record.end)


def read_file_header(descriptor: int) -> Tuple[Header, int]:
    """Read the first record; return its fields and its end."""
    record = record_at(read_at(descriptor, len(MAGIC), 4 + FILE_HEADER_SIZE + 4))
    if record is None:
        raise BagFormatError("the first record is cut off or damaged")
    if record.kind != OP_FILE_HEADER:
        raise BagFormatError("the first record is not a file header")
    encryptor = record.fields.get("encryptor", b"")
    if encryptor:
        raise BagFormatError("the bag is encrypted (%s); 'rosbag decrypt' first" % encryptor.decode("utf-8", "replace"))
    return record.fields, len(MAGIC) + record.end


def record_end(record: Record) -> int:
    """Return a record's end; for an index computed from its entries, as its length may claim more than there are."""
    count = record.fields.get("count", b"")
    if record.kind == OP_INDEX and len(count) == 4:
        return record.begin + INDEX_ENTRY_SIZE * int.from_bytes(count, "little")
    return record.end


def _unnamed(at: int) -> BagFormatError:
    return BagFormatError("the index does not name the chunk at byte %d (jaka_bag recover reads it)" % at)


def _no_records(descriptor: int, begin: int, end: int) -> str:
    """Return a note about bytes that are no records."""
    is_zero, at = True, begin
    while at < end:
        raw = read_at(descriptor, at, min(_WINDOW, end - at))
        mark = raw.find(_CHUNK_MARK)
        if mark >= 0 and end - at - mark > 64:
            raise _unnamed(at + mark)
        is_zero = is_zero and not any(raw)
        if at + len(raw) >= end:
            break
        at += len(raw) - len(_CHUNK_MARK)
    return "%d bytes at byte %d %s skipped" % (end - begin, begin, "are zero and were" if is_zero
                                              else "are no records and were")


def look_between(descriptor: int, begin: int, end: int) -> Optional[str]:
    """Return a note about bytes between two positions that are no records; None where there are only indexes.

    Raises:
        BagFormatError: There is a chunk that the index does not name.
    """
    while begin < end:
        record = try_record_at(read_at(descriptor, begin, min(_PROBE, end - begin)))
        if record is None or not OP_MESSAGE <= record.kind <= OP_CONNECTION:
            return _no_records(descriptor, begin, end)
        if record.kind in (OP_CHUNK, OP_MESSAGE):
            raise _unnamed(begin)
        begin += record_end(record)
    return None


def index_entries(record: Record) -> int:
    """Return how many messages an index record names.

    Raises:
        BagFormatError: It is of another version, or its length does not fit.
    """
    count, rest = divmod(record.end - record.begin, INDEX_ENTRY_SIZE)
    if rest or u32(record.fields, "ver") != 1 or u32(record.fields, "count") != count:
        raise BagFormatError("the index of a chunk is damaged")
    return count


def _time_extremes(entries: bytes) -> Tuple[int, int]:
    """Return the least and the greatest time, ns, of an index record's entries, of at least one."""
    words = array("I", entries)
    times = array("I", bytes(len(words) // 3 * 8))
    times[::2], times[1::2] = words[1::3], words[::3]  # nanoseconds and seconds, as one number of a little-endian host
    first, last = ((time >> 32) * NS_PER_S + (time & 0xFFFFFFFF) for time in extremes(array("Q", times.tobytes())))
    return first, last


def _index_behind(raw: bytes) -> Tuple[IndexTotals, int]:
    """Return what the index records at the start of a buffer name, and where those end that are in order."""
    totals = IndexTotals()
    at = 0
    while at < len(raw):
        record = try_record_at(raw, at)
        if record is None or record.kind != OP_INDEX or record.end > len(raw):
            break
        try:
            count = index_entries(record)
            if count:
                totals.add(u32(record.fields, "conn"), count, *_time_extremes(raw[record.begin:record.end]))
        except BagFormatError:
            break
        at = record.end
    return totals, at


def _contradiction(info: ChunkInfo, totals: IndexTotals) -> str:
    """Return how a chunk's entry in the index section differs from the chunk's own index; empty where it does not."""
    declared = {file_id: count for file_id, count in info.counts.items() if count}
    if declared != totals.counts:
        return "it tells of %d messages in the chunk at byte %d, the chunk's own index of %d" % (
            sum(declared.values()), info.position, sum(totals.counts.values()))
    if totals.contradicts(info.start_time, info.end_time):
        return "the times of the chunk at byte %d are not those in the chunk's own index" % info.position
    return ""


def _look_at_chunks(descriptor: int, infos: List[ChunkInfo], first: int, index_position: int
                    ) -> Tuple[List[ChunkHead], List[Tuple[int, int]], List[str]]:
    """Return the heads of chunks, the byte ranges outside of the chunks and their indexes, and contradictions."""
    heads: List[ChunkHead] = []
    contradictions = []
    stretches = [(first, infos[0].position if infos else index_position)]
    for info, end in zip(infos, [info.position for info in infos[1:]] + [index_position]):
        try:
            head = parse_chunk_head(read_at(descriptor, info.position, 256))
        except BagFormatError:  # whoever reads the chunk is told
            continue
        heads.append(head)
        behind = info.position + head.end
        totals, size = _index_behind(read_at(descriptor, behind, end - behind))
        if behind + size != end:
            stretches.append((behind + size, end))
        contradictions.append(_contradiction(info, totals))
    return heads, stretches, contradictions


def read_index(path: PathLike, descriptor: int) -> LogIndex:
    """Read the index of a bag."""
    size = os.fstat(descriptor).st_size
    fields, first_chunk = read_file_header(descriptor)
    index_position = u64(fields, "index_pos")
    if index_position == 0:
        raise BagFormatError(_CUT_OFF)
    if index_position > size:
        raise BagFormatError("the file is cut off, its index is missing (jaka_bag recover keeps the rest)")
    by_id: Dict[int, Connection] = {}
    infos: List[ChunkInfo] = []
    section = read_at(descriptor, index_position, size - index_position)
    promised = u32(fields, "conn_count"), u32(fields, "chunk_count")
    index_end = index_position
    for record in whole_records(section) if any(promised) else ():
        if record.kind == OP_CONNECTION:
            by_id.update([parse_connection(record, section)])
        elif record.kind == OP_CHUNK_INFO:
            infos.append(parse_chunk_info(record, section))
        index_end = index_position + record.end
        if (len(by_id), len(infos)) == promised:
            break
    if (len(by_id), len(infos)) != promised:
        raise BagFormatError(DAMAGED)
    numbers = {file_id: number for number, file_id in enumerate(by_id)}
    infos.sort(key=lambda info: info.position)
    ends = [info.position for info in infos[1:]] + [index_position]
    chunks = []
    counts = [0] * len(numbers)
    for info, end in zip(infos, ends):
        if not first_chunk <= info.position < end or not numbers.keys() >= info.counts.keys():
            raise BagFormatError(DAMAGED)
        by_number = {numbers[file_id]: count for file_id, count in info.counts.items() if count}
        for number, count in by_number.items():
            counts[number] += count
        span = (info.start_time, info.end_time) if by_number else (0, 0)
        chunks.append(ChunkRef(info.position, end, *span, by_number))
    heads, stretches, contradictions = _look_at_chunks(descriptor, infos, first_chunk, index_position)
    if len(heads) == len(chunks):
        chunks = [chunk._replace(unpacked=head.size) for chunk, head in zip(chunks, heads)]
    notes = [look_between(descriptor, begin, end) for begin, end in stretches + [(index_end, size)]]
    filled = [chunk for chunk in chunks if chunk.counts]
    return LogIndex("bag", "2.0", str(path), size, list(by_id.values()), numbers, chunks, counts,
                    min((c.start_time for c in filled), default=None),
                    max((c.end_time for c in filled), default=None), codecs=codec_totals(
                        (head.codec, head.data_size, head.size) for head in heads) if len(heads) == len(chunks) else (),
                    notes=tuple(note for note in notes if note), contradiction=next(filter(None, contradictions), ""))
