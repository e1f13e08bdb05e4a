"""The records of MCAP files (MCAP specification, version 0), to and from bytes; no numpy, no files."""
import struct
from typing import Dict, List, NamedTuple, Tuple, Union

from ...errors import BagFormatError
from ...messages.connection import Connection
from ..index import AttachmentIndex, MetadataIndex

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)

RECORD_HEAD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
"""Record head, channel id, sequence, log time, publish time; the payload follows."""
FOOTER_SIZE = RECORD_HEAD.size + 20
MAX_CHANNELS = 65535

Buffer = Union[bytes, bytearray, memoryview]


class ChunkIndex(NamedTuple):
    """Where one chunk is and what it holds; times in ns, positions and sizes in byte."""

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


def text(value: str) -> bytes:
    """A string as MCAP stores it; what is not valid Unicode becomes a question mark."""
    raw = value.encode("utf-8", "replace")
    return struct.pack("<I", len(raw)) + raw


def text_map(values: Dict[str, str]) -> bytes:
    """A map of strings as MCAP stores it."""
    raw = b"".join(text(key) + text(value) for key, value in values.items())
    return struct.pack("<I", len(raw)) + raw


def record(opcode: int, body: bytes) -> bytes:
    """One whole record."""
    return RECORD_HEAD.pack(opcode, len(body)) + body


def header_record(profile: str, library: str) -> bytes:
    """The first record of a file."""
    return record(HEADER, text(profile) + text(library))


def schema_record(schema_id: int, connection: Connection) -> bytes:
    """The definition of a connection's type."""
    raw = connection.definition.encode("utf-8", "surrogateescape")
    return record(SCHEMA, struct.pack("<H", schema_id) + text(connection.datatype) + text(connection.schema_encoding)
                  + struct.pack("<I", len(raw)) + raw)


def channel_metadata(connection: Connection) -> Dict[str, str]:
    """What a channel of the ``ros1`` profile says beside topic and type (MCAP profile registry)."""
    values = {}
    if connection.md5sum:
        values["md5sum"] = connection.md5sum
    if connection.callerid is not None:
        values["callerid"] = connection.callerid
    if connection.latching is not None:
        values["latching"] = "true" if connection.latching else "false"
    for key, value in connection.extra:
        values.setdefault(key, value)
    return values


def channel_record(channel_id: int, schema_id: int, connection: Connection) -> bytes:
    """One connection; its type is that of ``schema_id`` (0: none)."""
    return record(CHANNEL, struct.pack("<HH", channel_id, schema_id) + text(connection.topic)
                  + text(connection.encoding) + text_map(channel_metadata(connection)))


def chunk_head(start_time: int, end_time: int, uncompressed_size: int, crc: int, codec: str, stored: int) -> bytes:
    """A chunk record up to its ``stored`` bytes of compressed records; times in ns."""
    name = text("" if codec == "none" else codec)
    body = struct.pack("<QQQI", start_time, end_time, uncompressed_size, crc) + name + struct.pack("<Q", stored)
    return RECORD_HEAD.pack(CHUNK, len(body) + stored) + body


def chunk_index_record(index: ChunkIndex) -> bytes:
    """The summary's entry of one chunk."""
    offsets = b"".join(struct.pack("<HQ", channel, offset) for channel, offset in index.index_offsets.items())
    return record(CHUNK_INDEX, struct.pack("<QQQQI", index.start_time, index.end_time, index.position, index.size,
                                           len(offsets)) + offsets + struct.pack("<Q", index.index_size)
                  + text(index.compression) + struct.pack("<QQ", index.compressed_size, index.uncompressed_size))


def statistics_record(s: Statistics) -> bytes:
    """The summary's totals."""
    counts = b"".join(struct.pack("<HQ", channel, count) for channel, count in s.channel_messages.items())
    return record(STATISTICS, struct.pack("<QHIIIIQQI", s.messages, s.schemas, s.channels, s.attachments, s.metadata,
                                          s.chunks, s.start_time, s.end_time, len(counts)) + counts)


def metadata_record(name: str, values: Dict[str, str]) -> bytes:
    """Named facts about the file."""
    return record(METADATA, text(name) + text_map(values))


def attachment_index_record(index: AttachmentIndex) -> bytes:
    """The summary's entry of one attachment."""
    return record(ATTACHMENT_INDEX, struct.pack("<QQQQQ", index.position, index.size, index.log_time,
                                                index.create_time, index.data_size)
                  + text(index.name) + text(index.media_type))


def metadata_index_record(index: MetadataIndex) -> bytes:
    """The summary's entry of one metadata record."""
    return record(METADATA_INDEX, struct.pack("<QQ", index.position, index.size) + text(index.name))


class Cursor:
    """Reads the fields of one record's body in order.

    Raises:
        BagFormatError: From every method, where the body ends too early.
    """

    def __init__(self, body: Buffer, at: int = 0) -> None:
        self.body = body
        self.at = at

    def unpack(self, layout: str) -> Tuple[int, ...]:
        """Integers of a little-endian ``struct`` layout."""
        form = struct.Struct("<" + layout)
        if self.at + form.size > len(self.body):
            raise BagFormatError("an MCAP record ends too early")
        values = form.unpack_from(self.body, self.at)
        self.at += form.size
        return values

    def number(self, layout: str) -> int:
        """One integer."""
        return self.unpack(layout)[0]

    def raw(self, size: int) -> bytes:
        """``size`` bytes."""
        if size > len(self.body) - self.at:
            raise BagFormatError("an MCAP record ends too early")
        value = bytes(self.body[self.at:self.at + size])
        self.at += size
        return value

    def text(self) -> str:
        """A string; bytes that are not UTF-8 are kept as surrogates."""
        return self.raw(self.number("I")).decode("utf-8", "surrogateescape")

    def text_map(self) -> Dict[str, str]:
        """A map of strings."""
        inner = Cursor(self.raw(self.number("I")))
        values: Dict[str, str] = {}
        while inner.at < len(inner.body):
            key = inner.text()
            values[key] = inner.text()
        return values

    def number_map(self) -> Dict[int, int]:
        """A map of uint16 to uint64."""
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
    """Id and content of a schema record's body.

    Raises:
        BagFormatError: It is damaged.
    """
    c = Cursor(body)
    schema_id = c.number("H")
    name, encoding = c.text(), c.text()
    return schema_id, Schema(name, encoding, c.raw(c.number("I")).decode("utf-8", "surrogateescape"))


def parse_channel(body: Buffer, schemas: Dict[int, Schema]) -> Tuple[int, Connection]:
    """Id and connection of a channel record's body.

    Raises:
        BagFormatError: It is damaged.
    """
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


def parse_chunk_index(body: Buffer) -> ChunkIndex:
    """A chunk index record's body.

    Raises:
        BagFormatError: It is damaged.
    """
    c = Cursor(body)
    start, end, position, size = c.unpack("QQQQ")
    offsets = c.number_map()
    index_size = c.number("Q")
    compression = c.text()
    compressed, uncompressed = c.unpack("QQ")
    return ChunkIndex(start, end, position, size, offsets, index_size, compression, compressed, uncompressed)


def parse_statistics(body: Buffer) -> Statistics:
    """A statistics record's body.

    Raises:
        BagFormatError: It is damaged.
    """
    c = Cursor(body)
    numbers = c.unpack("QHIIIIQQ")
    return Statistics(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5], numbers[6], numbers[7],
                      c.number_map())


def parse_attachment_index(body: Buffer) -> AttachmentIndex:
    """An attachment index record's body.

    Raises:
        BagFormatError: It is damaged.
    """
    c = Cursor(body)
    position, size, log_time, create_time, data_size = c.unpack("QQQQQ")
    name = c.text()
    return AttachmentIndex(position, size, log_time, create_time, data_size, name, c.text())


def parse_metadata_index(body: Buffer) -> MetadataIndex:
    """A metadata index record's body.

    Raises:
        BagFormatError: It is damaged.
    """
    c = Cursor(body)
    position, size = c.unpack("QQ")
    return MetadataIndex(position, size, c.text())


def parse_metadata(raw: Buffer) -> Tuple[str, Dict[str, str]]:
    """Name and content of a whole metadata record.

    Raises:
        BagFormatError: It is damaged.
    """
    c = Cursor(raw, RECORD_HEAD.size)
    name = c.text()
    return name, c.text_map()


def split_records(data: Buffer) -> List[Tuple[int, int, int]]:
    """(opcode, start, end) of the body of each record in ``data``.

    Raises:
        BagFormatError: The last record is cut off.
    """
    result = []
    at = 0
    while at < len(data):
        if at + RECORD_HEAD.size > len(data):
            raise BagFormatError("the last MCAP record is cut off")
        opcode, size = RECORD_HEAD.unpack_from(data, at)
        begin = at + RECORD_HEAD.size
        at = begin + size
        if at > len(data):
            raise BagFormatError("the last MCAP record is cut off")
        result.append((opcode, begin, at))
    return result
