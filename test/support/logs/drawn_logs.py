"""Small logs drawn by chance, whose indexes may lie: the records that they are made of are the truth.

The files are made record by record, independently of the writers under test.
"""
import bz2
import random
import struct
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Tuple

import zstandard
from log_samples import START_NS, STATES, message_record
from lz4 import frame
from mcap_variants import (
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    SCHEMA,
    STATISTICS,
    record,
    text,
    text_map,
)

from jaka_bag.containers.bag import records as bag_format

CODECS: Dict[str, Callable[[bytes], bytes]] = {
    "none": bytes, "bz2": bz2.compress, "zstd": zstandard.ZstdCompressor().compress,
    "lz4": lambda data: bytes(frame.compress(data, block_linked=False, content_checksum=True, store_size=False))}
TOPICS = ("/a/states", "/b/states", "/a/states", "/c")
"""Topics by channel: the first has two."""
LIES = ("none", "none", "chunk_time", "chunk_count", "index_time", "index_lacks", "index_offset", "no_index", "total",
        "no_summary", "no_chunks")
"""Places at which a log's index may lie, or what it lacks; the last three are of an MCAP: a bag has no such thing."""


class Entry(NamedTuple):
    """One message of a drawn log; ``time`` is ns, ``value`` unique in its log."""

    channel: int
    time: int
    value: int

    @property
    def data(self) -> bytes:
        return struct.pack("<4h", self.value, 1, 0, 0)

    @property
    def topic(self) -> str:
        return TOPICS[self.channel]


class DrawnLog(NamedTuple):
    """A drawn log.

    Attributes:
        path: The file.
        chunks: Its messages by chunk, in the order of the file.
        lie: One of ``LIES``.
    """

    path: Path
    chunks: List[List[Entry]]
    lie: str

    @property
    def messages(self) -> List[Entry]:
        """All messages, by time; equal times in the order of the file."""
        return sorted((entry for chunk in self.chunks for entry in chunk), key=lambda entry: entry.time)


Index = Dict[int, List[Tuple[int, int]]]
"""Time, ns, and offset, byte, of the messages of a chunk, by channel."""


class _Declared(NamedTuple):
    """The declarations about one chunk."""

    start: int
    end: int
    counts: Dict[int, int]
    index: Index


def _times(dice: random.Random, count: int) -> List[int]:
    """Return times, ns: regular, equal, drawn at random, backwards, or all 0."""
    kind = dice.choice(("regular", "regular", "equal", "random", "backwards", "zero"))
    times = [START_NS + i * 100_000_000 for i in range(count)]
    if kind == "equal":
        times = [START_NS + i // 3 * 100_000_000 for i in range(count)]
    elif kind == "random":
        times = [START_NS + dice.randrange(count * 100_000_000) for _ in range(count)]
    elif kind == "backwards":
        times.reverse()
    elif kind == "zero":
        times = [0] * count
    return times


def _drawn_chunks(dice: random.Random) -> List[List[Entry]]:
    count = dice.randrange(1, 40)
    channels = dice.randrange(1, len(TOPICS) + 1)
    entries = [Entry(dice.randrange(channels), time, i) for i, time in enumerate(_times(dice, count))]
    chunks: List[List[Entry]] = [[] for _ in range(dice.randrange(1, 6))]
    overlap = dice.random() < 0.4
    for i, entry in enumerate(entries):
        chunks[dice.randrange(len(chunks)) if overlap else i * len(chunks) // count].append(entry)
    return [chunk for chunk in chunks if chunk]


def _declared(dice: random.Random, chunk: List[Entry], offsets: List[int], lie: str) -> _Declared:
    """Return the declarations about a chunk, which lie as asked for."""
    index: Index = {}
    for entry, offset in zip(chunk, offsets):
        index.setdefault(entry.channel, []).append((entry.time, offset))
    index = {channel: sorted(entries) for channel, entries in index.items()}
    times = [entry.time for entry in chunk]
    start, end = min(times), max(times)
    counts = {channel: len(entries) for channel, entries in index.items()}
    victim = dice.choice(sorted(index))
    which = dice.randrange(len(index[victim]))
    if lie == "chunk_time":
        start, end = dice.choice((
            (start, start), (end, end), (0, 0), (start + 10**9, end + 10**9), (times[0], times[-1]),
            (max(start - 10**10, 0), max(start - 10**9, 0)), (end, start)))
    elif lie == "chunk_count":
        counts[victim] = dice.choice((0, counts[victim] + 1, max(counts[victim] - 1, 0)))
    elif lie == "index_time":
        index[victim][which] = (dice.choice((1, START_NS - 10**9, START_NS + 10**12)), index[victim][which][1])
    elif lie == "index_lacks":
        del index[victim][which]
    elif lie == "index_offset":
        index[victim][which] = (index[victim][which][0], dice.choice((1, 7, 1 << 30)))
    elif lie == "no_index":
        del index[victim]
    return _Declared(start, end, counts, index)


def _bag(dice: random.Random, chunks: List[List[Entry]], codec: str, lie: str) -> bytes:
    out = bag_format.MAGIC + bag_format.file_header(0, 0, 0)
    infos = []
    victim = dice.randrange(len(chunks))
    described: List[int] = []
    for number, chunk in enumerate(chunks):
        raw, offsets = b"", []
        for entry in chunk:
            if entry.channel not in described:
                described.append(entry.channel)
                raw += _bag_connection(entry.channel)
            offsets.append(len(raw))
            raw += message_record(entry.channel, entry.time, entry.data)
        said = _declared(dice, chunk, offsets, lie if number == victim else "none")
        infos.append(bag_format.ChunkInfo(len(out), said.start, said.end, said.counts))
        stored = CODECS[codec](raw)
        out += bag_format.chunk_head(codec, len(raw), len(stored)) + stored
        for channel, entries in said.index.items():
            out += bag_format.index_record(channel, len(entries), b"".join(
                bag_format.pack_time(time) + struct.pack("<I", offset) for time, offset in entries))
    head = bag_format.MAGIC + bag_format.file_header(len(out), len(described), len(infos))
    return (head + out[len(head):] + b"".join(map(_bag_connection, described))
            + b"".join(map(bag_format.chunk_info_record, infos)))


def _bag_connection(channel: int) -> bytes:
    return bag_format.connection_record(channel, STATES._replace(topic=TOPICS[channel], callerid="/n%d" % channel))


def _map_of_numbers(values: Dict[int, int]) -> bytes:
    return struct.pack("<I", 10 * len(values)) + b"".join(struct.pack("<HQ", *pair) for pair in values.items())


def _mcap(dice: random.Random, chunks: List[List[Entry]], codec: str, lie: str) -> bytes:
    described = sorted({entry.channel for chunk in chunks for entry in chunk})
    records = record(SCHEMA, struct.pack("<H", 1) + text(STATES.datatype) + text("ros1msg") + text(STATES.definition))
    for channel in described:
        facts = {"callerid": "/n%d" % channel, "md5sum": STATES.md5sum}
        records += record(CHANNEL, struct.pack("<HH", channel, 1) + text(TOPICS[channel]) + text("ros1")
                          + text_map(facts))
    out = MAGIC + record(HEADER, text("ros1") + text("drawn")) + records
    indexes = b""
    name = text("" if codec == "none" else codec)
    victim = dice.randrange(len(chunks))
    for number, chunk in enumerate(chunks):
        raw, offsets = b"", []
        for entry in chunk:
            offsets.append(len(raw))
            head = struct.pack("<HIQQ", entry.channel, entry.value, entry.time, entry.time)
            raw += record(MESSAGE, head + entry.data)
        if lie == "no_chunks":
            out += raw
            continue
        said = _declared(dice, chunk, offsets, lie if number == victim else "none")
        stored = CODECS[codec](raw)
        begin, places = len(out), {}
        span = struct.pack("<QQ", said.start, said.end)
        out += record(CHUNK, span + struct.pack("<QI", len(raw), 0) + name + struct.pack("<Q", len(stored)) + stored)
        end = len(out)
        for channel, entries in said.index.items():
            places[channel] = len(out)
            out += record(MESSAGE_INDEX, struct.pack("<HI", channel, 16 * len(entries)) + b"".join(
                struct.pack("<QQ", *entry) for entry in entries))
        indexes += record(CHUNK_INDEX, span + struct.pack("<QQ", begin, end - begin) + _map_of_numbers(places)
                          + struct.pack("<Q", len(out) - end) + name + struct.pack("<QQ", len(stored), len(raw)))
    if lie in ("no_chunks", "no_summary"):
        return out + record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC
    entries = [entry for chunk in chunks for entry in chunk]
    counts = {channel: sum(entry.channel == channel for entry in entries) for channel in described}
    times = [entry.time for entry in entries]
    span = struct.pack("<QQ", min(times), max(times))
    if lie in ("chunk_count", "total"):
        counts[dice.choice(described)] += dice.choice((-1, 1))
    elif lie == "chunk_time":
        span = struct.pack("<QQ", *dice.choice(((0, 0), (times[0], times[-1]), (START_NS + 10**12, START_NS))))
    statistics = struct.pack("<QHIIII", sum(counts.values()), 1, len(described), 0, 0, len(chunks))
    out += record(DATA_END, bytes(4))
    start = len(out)
    out += records + record(STATISTICS, statistics + span + _map_of_numbers(counts)) + indexes
    return out + record(FOOTER, struct.pack("<QQI", start, 0, 0)) + MAGIC


def draw(seed: int, folder: Path) -> DrawnLog:
    """Write the log of a seed into a folder."""
    dice = random.Random(seed)
    is_bag = dice.random() < 0.5
    codec = dice.choice(("none", "lz4", "bz2") if is_bag else ("none", "lz4", "zstd"))
    chunks, lie = _drawn_chunks(dice), dice.choice(LIES)
    if is_bag and lie in LIES[-3:]:
        lie = "chunk_count"
    path = folder / ("drawn_%d.%s" % (seed, "bag" if is_bag else "mcap"))
    path.write_bytes((_bag if is_bag else _mcap)(dice, chunks, codec, lie))
    return DrawnLog(path, chunks, lie)
