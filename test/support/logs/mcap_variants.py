"""The same small logs as MCAP files of every variant that the format allows (MCAP specification, version 0).

The variants are those of the conformance data of the format: six contents, each with every combination of features that
make sense for it. The files are made record by record, independently of the writer under test.
"""
import itertools
import struct
import zlib
from typing import Dict, Iterator, List, NamedTuple, Tuple

MAGIC = b"\x89MCAP0\r\n"
(HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT, ATTACHMENT_INDEX, STATISTICS,
 METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END) = range(1, 16)
FEATURES = {
    "ax": "attachments are indexed", "ch": "schemas, channels and messages are in a chunk", "chx": "chunks are indexed",
    "mdx": "metadata is indexed", "mx": "messages of chunks are indexed", "pad": "records have further fields",
    "rch": "the summary repeats channels", "rsh": "the summary repeats schemas", "st": "there are statistics",
    "sum": "there are summary offsets"}
LATER_FIELDS = b"\x01\xff\xff"


class Item(NamedTuple):
    """One message, attachment or metadata record; ``time`` is ns."""

    kind: int
    time: int = 0
    data: bytes = b""
    sequence: int = 0


class Content(NamedTuple):
    """A log's content: a schema and a channel (0: none), and items."""

    schema: int
    channel: int
    items: Tuple[Item, ...]


CONTENTS: Dict[str, Content] = {
    "NoData": Content(0, 0, ()),
    "OneMessage": Content(1, 1, (Item(MESSAGE, 2, b"\x01\x02\x03", 10),)),
    "OneSchemalessMessage": Content(0, 1, (Item(MESSAGE, 2, b"\x01\x02\x03", 10),)),
    "OneAttachment": Content(0, 0, (Item(ATTACHMENT, 2, b"\x04\x05\x06"),)),
    "OneMetadata": Content(0, 0, (Item(METADATA),)),
    "TenMessages": Content(1, 1, tuple(Item(MESSAGE, 9 - i, bytes([i]), i) for i in range(10))),
}
TOPIC, DATATYPE, DEFINITION = "/example", "example_msgs/Example", "uint8 value\n"
FACTS = {"foo": "bar"}


def text(value: str) -> bytes:
    return struct.pack("<I", len(value.encode())) + value.encode()


def text_map(values: Dict[str, str]) -> bytes:
    raw = b"".join(text(key) + text(value) for key, value in values.items())
    return struct.pack("<I", len(raw)) + raw


def record(opcode: int, body: bytes, later: bytes = b"") -> bytes:
    return struct.pack("<BQ", opcode, len(body) + len(later)) + body + later


def features_for(content: Content) -> Iterator[Tuple[str, ...]]:
    """Return the combinations of features that make sense for a content."""
    kinds = {item.kind for item in content.items}
    possible = ["st", "pad", "sum"]
    if ATTACHMENT in kinds:
        possible.append("ax")
    if METADATA in kinds:
        possible.append("mdx")
    if content.schema:
        possible.append("rsh")
    if content.channel:
        possible += ["rch", "ch", "mx", "chx"]
    for count in range(len(possible) + 1):
        for chosen in itertools.combinations(sorted(possible), count):
            if "sum" in chosen and not {"chx", "rsh", "rch", "mdx", "ax", "st"} & set(chosen):
                continue
            if "ch" not in chosen and {"mx", "chx"} & set(chosen):
                continue
            yield chosen


def variants() -> Iterator[Tuple[str, Content, Tuple[str, ...]]]:
    """Return name, content and features of each file."""
    for name, content in CONTENTS.items():
        for features in features_for(content):
            yield "-".join((name,) + features), content, features


def _message(item: Item, channel: int) -> bytes:
    return record(MESSAGE, struct.pack("<HIQQ", channel, item.sequence, item.time, item.time + 1) + item.data)


def _attachment(item: Item, later: bytes) -> bytes:
    body = struct.pack("<QQ", item.time, item.time + 1) + text("file") + text("application/octet-stream")
    body += struct.pack("<Q", len(item.data)) + item.data
    return record(ATTACHMENT, body + struct.pack("<I", zlib.crc32(body)), later)


def _chunk(content: Content, messages: List[Item], described: bytes, later: bytes
           ) -> Tuple[bytes, bytes, bytes, bytes]:
    """Return a chunk, its message index, and the times and the sizes that its chunk index states."""
    raw, entries = described, []
    for item in messages:
        entries.append((item.time, len(raw)))
        raw += _message(item, content.channel)
    begin = min((item.time for item in messages), default=0)
    end = max((item.time for item in messages), default=0)
    chunk = record(CHUNK, struct.pack("<QQQI", begin, end, len(raw), zlib.crc32(raw)) + text("")
                   + struct.pack("<Q", len(raw)) + raw, later)
    packed = b"".join(struct.pack("<QQ", *entry) for entry in sorted(entries))
    index = record(MESSAGE_INDEX, struct.pack("<HI", content.channel, len(packed)) + packed, later)
    return chunk, index, struct.pack("<QQ", begin, end), text("") + struct.pack("<QQ", len(raw), len(raw))


def build(content: Content, features: Tuple[str, ...]) -> bytes:
    """Return the bytes of one variant."""
    later = LATER_FIELDS if "pad" in features else b""
    out = MAGIC + record(HEADER, text("ros1") + text("variants"), later)
    schemas = record(SCHEMA, struct.pack("<H", content.schema) + text(DATATYPE) + text("ros1msg")
                     + text(DEFINITION), later) if content.schema else b""
    channels = record(CHANNEL, struct.pack("<HH", content.channel, content.schema) + text(TOPIC) + text("ros1")
                      + text_map({}), later) if content.channel else b""
    messages = [item for item in content.items if item.kind == MESSAGE]
    chunk_indexes = attachment_indexes = metadata_indexes = b""
    if "ch" not in features:
        out += schemas + channels + b"".join(_message(item, content.channel) for item in messages)
    for item in content.items:
        if item.kind == ATTACHMENT:
            raw = _attachment(item, later)
            attachment_indexes += record(ATTACHMENT_INDEX, struct.pack(
                "<QQQQQ", len(out), len(raw), item.time, item.time + 1, len(item.data)) + text("file")
                + text("application/octet-stream"), later)
            out += raw
        elif item.kind == METADATA:
            raw = record(METADATA, text("facts") + text_map(FACTS), later)
            metadata_indexes += record(METADATA_INDEX, struct.pack("<QQ", len(out), len(raw)) + text("facts"), later)
            out += raw
    if "ch" in features:
        chunk, index, times, sizes = _chunk(content, messages, schemas + channels, later)
        begin, index_begin = len(out), len(out) + len(chunk)
        has_index = "mx" in features and messages
        out += chunk + (index if has_index else b"")
        offsets = struct.pack("<HQ", content.channel, index_begin) if has_index else b""
        chunk_indexes = record(CHUNK_INDEX, times + struct.pack("<QQ", begin, len(chunk))
                               + struct.pack("<I", len(offsets)) + offsets
                               + struct.pack("<Q", len(out) - index_begin) + sizes, later)
    out += record(DATA_END, struct.pack("<I", 0), later)
    return out + _summary(content, features, len(out), later, schemas, channels, messages, chunk_indexes,
                          attachment_indexes, metadata_indexes)


def _summary(content: Content, features: Tuple[str, ...], start: int, later: bytes, schemas: bytes, channels: bytes,
             messages: List[Item], chunk_indexes: bytes, attachment_indexes: bytes, metadata_indexes: bytes) -> bytes:
    kinds = [item.kind for item in content.items]
    counts = struct.pack("<HQ", content.channel, len(messages)) if messages else b""
    times = [item.time for item in messages] or [0]
    statistics = struct.pack("<QHIIIIQQ", len(messages), bool(schemas), bool(channels), kinds.count(ATTACHMENT),
                             kinds.count(METADATA), "ch" in features, min(times), max(times))
    groups = [(SCHEMA, schemas if "rsh" in features else b""), (CHANNEL, channels if "rch" in features else b""),
              (STATISTICS, record(STATISTICS, statistics + struct.pack("<I", len(counts)) + counts, later)
               if "st" in features else b""),
              (CHUNK_INDEX, chunk_indexes if "chx" in features else b""),
              (ATTACHMENT_INDEX, attachment_indexes if "ax" in features else b""),
              (METADATA_INDEX, metadata_indexes if "mdx" in features else b"")]
    out = offsets = b""
    for opcode, raw in groups:
        if raw and "sum" in features:
            offsets += record(SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start + len(out), len(raw)), later)
        out += raw
    footer = struct.pack("<QQI", start if out else 0, start + len(out) if offsets else 0, 0)
    return out + offsets + record(FOOTER, footer) + MAGIC
