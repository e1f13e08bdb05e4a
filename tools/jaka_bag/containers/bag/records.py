"""The records of ROS bag files, version 2.0 (ROS wiki, Bags/Format/2.0), to and from bytes; no numpy, no files."""
import struct
from typing import Dict, Iterable, NamedTuple, Optional, Tuple, Union

from ...errors import BagFormatError
from ...messages.connection import Connection
from ...units import NS_PER_S

MAGIC = b"#ROSBAG V2.0\n"
OP_MESSAGE, OP_FILE_HEADER, OP_INDEX, OP_CHUNK, OP_CHUNK_INFO, OP_CONNECTION = range(2, 8)
FILE_HEADER_SIZE = 4096
"""Bytes of the first record's header and padding together."""
MAX_SECONDS = 0xFFFFFFFF

_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_TIME = struct.Struct("<II")

Buffer = Union[bytes, bytearray, memoryview]
Header = Dict[str, bytes]


class ChunkInfo(NamedTuple):
    """The index section's entry of one chunk: where it is, byte; its time span, ns; messages by connection id."""

    position: int
    start_time: int
    end_time: int
    counts: Dict[int, int]


def pack_header(fields: Iterable[Tuple[str, bytes]]) -> bytes:
    """Header fields as the format stores them, without the length in front of all."""
    return b"".join(_U32.pack(len(name) + 1 + len(value)) + _encode(name) + b"=" + value for name, value in fields)


def pack_record(fields: Iterable[Tuple[str, bytes]], data: bytes) -> bytes:
    """One whole record."""
    header = pack_header(fields)
    return _U32.pack(len(header)) + header + _U32.pack(len(data)) + data


def pack_time(time_ns: int) -> bytes:
    """Nanoseconds to the format's seconds and nanoseconds."""
    return _TIME.pack(*divmod(time_ns, NS_PER_S))


def parse_header(raw: Buffer) -> Header:
    """Header fields by name.

    Raises:
        BagFormatError: They are damaged.
    """
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


def u32(fields: Header, name: str) -> int:
    """A 32-bit field.

    Raises:
        BagFormatError: It is absent or not 4 bytes.
    """
    value = fields.get(name)
    if value is None or len(value) != 4:
        raise BagFormatError("a record lacks the field %r" % name)
    return int(_U32.unpack(value)[0])


def u64(fields: Header, name: str) -> int:
    """A 64-bit field.

    Raises:
        BagFormatError: It is absent or not 8 bytes.
    """
    value = fields.get(name)
    if value is None or len(value) != 8:
        raise BagFormatError("a record lacks the field %r" % name)
    return int(_U64.unpack(value)[0])


def time_ns(fields: Header, name: str) -> int:
    """A time field, ns.

    Raises:
        BagFormatError: It is absent or not 8 bytes.
    """
    raw = u64(fields, name)
    return (raw & 0xFFFFFFFF) * NS_PER_S + (raw >> 32)


def opcode(fields: Header) -> int:
    """The kind of a record.

    Raises:
        BagFormatError: It is absent.
    """
    value = fields.get("op")
    if value is None or len(value) != 1:
        raise BagFormatError("a record lacks its kind")
    return value[0]


def file_header(index_position: int, connections: int, chunks: int) -> bytes:
    """The first record, padded to its fixed size."""
    fields = [("chunk_count", _U32.pack(chunks)), ("conn_count", _U32.pack(connections)),
              ("index_pos", _U64.pack(index_position)), ("op", bytes([OP_FILE_HEADER]))]
    return pack_record(fields, b" " * (FILE_HEADER_SIZE - len(pack_header(fields))))


def connection_record(number: int, connection: Connection) -> bytes:
    """One connection as record, its connection header inside."""
    extra = dict(connection.extra)
    fields = {"topic": extra.pop("topic", connection.topic), "type": connection.datatype,
              "md5sum": connection.md5sum, "message_definition": connection.definition}
    if connection.callerid is not None:
        fields["callerid"] = connection.callerid
    if connection.latching is not None:
        fields["latching"] = "1" if connection.latching else "0"
    for name, value in extra.items():
        fields.setdefault(name, value)
    return pack_record(
        [("conn", _U32.pack(number)), ("op", bytes([OP_CONNECTION])), ("topic", _encode(connection.topic))],
        pack_header((name, _encode(value)) for name, value in sorted(fields.items())))


def _encode(value: str) -> bytes:
    return value.encode("utf-8", "surrogateescape")


def parse_connection(fields: Header, data: Buffer) -> Tuple[int, Connection]:
    """Id and connection of a connection record.

    Raises:
        BagFormatError: It is damaged.
    """
    number = u32(fields, "conn")
    raw_topic = fields.get("topic")
    if raw_topic is None:
        raise BagFormatError("a connection lacks its topic")
    topic = raw_topic.decode("utf-8", "surrogateescape")
    inner = {name: value.decode("utf-8", "surrogateescape") for name, value in parse_header(data).items()}
    own_topic: Optional[str] = inner.pop("topic", topic)
    datatype, md5sum = inner.pop("type", ""), inner.pop("md5sum", "")
    definition, callerid = inner.pop("message_definition", ""), inner.pop("callerid", None)
    latching = inner.get("latching")
    if latching in ("0", "1"):
        del inner["latching"]
    if own_topic is not None and own_topic != topic:  # remapped while recording
        inner["topic"] = own_topic
    return number, Connection(topic, datatype, md5sum, definition, callerid,
                              latching == "1" if latching in ("0", "1") else None, tuple(sorted(inner.items())))


def index_record(number: int, count: int, entries: bytes) -> bytes:
    """The index of one connection's messages in the chunk before: ``count`` x (s, ns, offset)."""
    return pack_record([("conn", _U32.pack(number)), ("count", _U32.pack(count)), ("op", bytes([OP_INDEX])),
                        ("ver", _U32.pack(1))], entries)


def chunk_info_record(info: ChunkInfo) -> bytes:
    """The index section's entry of one chunk."""
    data = b"".join(_TIME.pack(number, count) for number, count in info.counts.items())
    return pack_record([("chunk_pos", _U64.pack(info.position)), ("count", _U32.pack(len(info.counts))),
                        ("end_time", pack_time(info.end_time)), ("op", bytes([OP_CHUNK_INFO])),
                        ("start_time", pack_time(info.start_time)), ("ver", _U32.pack(1))], data)


def parse_chunk_info(fields: Header, data: Buffer) -> ChunkInfo:
    """A chunk info record.

    Raises:
        BagFormatError: It is damaged.
    """
    if len(data) % 8:
        raise BagFormatError("the index is damaged")
    return ChunkInfo(u64(fields, "chunk_pos"), time_ns(fields, "start_time"), time_ns(fields, "end_time"),
                     dict(_TIME.iter_unpack(data)))


def chunk_head(codec: str, uncompressed_size: int, stored: int) -> bytes:
    """A chunk record up to its ``stored`` bytes of compressed records."""
    header = pack_header([("compression", codec.encode()), ("op", bytes([OP_CHUNK])),
                          ("size", _U32.pack(uncompressed_size))])
    return _U32.pack(len(header)) + header + _U32.pack(stored)
