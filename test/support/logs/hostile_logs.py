"""Small logs that ask for much: a reader must refuse them, or read them in bounded memory and time.

All of them are written by

    PYTHONPATH=tools build/venv/bin/python3 test/support/logs/hostile_logs.py FOLDER
"""
import bz2
import json
import struct
import sys
from functools import lru_cache
from pathlib import Path
from typing import Callable, Dict, Iterable, List

import zstandard
from log_samples import BREAK, START_NS, STATES, RawBag, Sample, connection, message_record, states, write
from lz4 import frame
from mcap_variants import CHUNK, DATA_END, FOOTER, HEADER, MAGIC, record, text

from jaka_bag.containers.bag import records as bag_format
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.messages.connection import Connection

BOMB = bytes(64 << 20)
HEAVY = ("bz2_claims_4_gb.bag", "empty_payloads.mcap", "overlapping.mcap", "zstd_many.mcap")
"""Logs on which all commands together take long."""
MOST_BYTES = 500 << 20
MOST_CPU_S = 30
RUN_ALL = """
# ru_maxrss would not do: at its start a process takes over the peak of the process that started it.
import json, sys, time
from jaka_bag.cli.main import main
results = []
for words in json.loads(sys.argv[1]):
    begin = time.process_time()
    code = main(words)
    seconds = time.process_time() - begin
    most = int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0]) << 10
    results.append((code, seconds, most))
print()
print(json.dumps(results))
"""
"""A script that runs commands, given as JSON, and prints of each exit code, processor time, s, and memory, byte."""


@lru_cache(maxsize=1)
def _bz2_bomb() -> bytes:
    return bz2.compress(BOMB)


def zstd(data: bytes, has_size: bool = True) -> bytes:
    return zstandard.ZstdCompressor(level=3, write_content_size=has_size).compress(data)


def _bag_with_chunk(codec: str, stored: bytes, claimed: int) -> bytes:
    bag = RawBag()
    bag.body += bag_format.chunk_head(codec, claimed, len(stored)) + stored
    bag.infos.append(bag_format.ChunkInfo(bag.begin, START_NS, START_NS, {0: 1}))
    bag.add_connection(0, STATES)
    return bag.content()


def mcap_with_chunks(codec: str, chunks: List[bytes], claimed: int) -> bytes:
    out = MAGIC + record(HEADER, text("ros1") + text(""))
    for stored in chunks:
        out += record(CHUNK, struct.pack("<QQQI", 0, 0, claimed, 0) + text(codec)
                      + struct.pack("<Q", len(stored)) + stored)
    return out + record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC


def _bag_of(path: Path, kind: Connection, data: bytes, count: int = 3) -> None:
    write(path, [Sample(kind, START_NS + i, data) for i in range(count)])


def doubling(md5sum: str = "") -> Connection:
    """Return a type that holds two of a type that holds two ..., 40 times."""
    parts = ["test_msgs/T%d" % i for i in range(41)]
    definition = "\n".join("%s %s" % (parts[1], field) for field in "ab") + "\n"
    for i in range(1, 41):
        body = "\n".join("%s %s" % (parts[i + 1], field) for field in "ab") if i < 40 else "uint8 A=1"
        definition += BREAK + "MSG: %s\n%s\n" % (parts[i], body)
    return Connection("/doubling", parts[0], md5sum, definition)


def deep(levels: int = 3000) -> Connection:
    definition = "test_msgs/T1 a\n" + "".join(
        BREAK + "MSG: test_msgs/T%d\ntest_msgs/T%d a\n" % (i, i + 1) for i in range(1, levels))
    return Connection("/deep", "test_msgs/T0", "", definition + BREAK + "MSG: test_msgs/T%d\nuint8 a\n" % levels)


def _empty_messages(path: Path) -> None:
    kind = Connection("/many", "test_msgs/Many", "0" * 32, "test_msgs/E[4000000000] many\ntest_msgs/E[] some\n" + BREAK
                      + "MSG: test_msgs/E\nuint8 A=1\n")
    _bag_of(path, kind, struct.pack("<I", 4000000000))


def _many_damages(path: Path) -> None:
    content = b""
    for i in range(6000):
        content += message_record(0, START_NS + i, struct.pack("<II", i, i)) if i % 2 else b"\xff" * 30
    described = bag_format.connection_record(0, STATES)
    path.write_bytes(bag_format.MAGIC + bag_format.file_header(0, 1, 1) + bag_format.chunk_head("none", 0, 0)
                     + described + content)


def _odd_account(text_of_account: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        with McapWriter(path) as writer:
            writer.add_metadata("jaka_bag.drops", {STATES.topic: text_of_account})
            writer.add_message(writer.add_channel(STATES), START_NS, bytes(8))
    return make


def _overlapping(path: Path) -> None:
    """Write chunks of 2 MB of the same time, which compress to little."""
    with McapWriter(path) as writer:
        writer.chunk_size = 1 << 30
        number = writer.add_channel(connection("/zeros", "std_msgs/String", "string data\n"))
        for _ in range(50):
            for time in range(8):
                writer.add_message(number, START_NS + 1000 * time, struct.pack("<I", 1 << 18) + bytes(1 << 18))
            writer.flush()


def _escapes(path: Path) -> None:
    odd = STATES._replace(topic="/x\x1b]0;owned\x07\x1b[2J\x9b31m", callerid="\x1b[1m")
    write(path, [Sample(odd, START_NS, bytes(8))])


def _empty_payloads(path: Path) -> None:
    raw = b"".join(record(5, struct.pack("<HIQQ", 1, 0, 5, 5)) for _ in range(1000)) * 1000
    path.write_bytes(mcap_with_chunks("zstd", [zstd(raw)] * 12, len(raw)))


def _extras_elsewhere(position: int, size: int) -> Callable[[Path], None]:
    """Return an attachment and metadata whose indexes name this position and size."""
    def make(path: Path) -> None:
        with McapWriter(path) as writer:
            writer.add_message(writer.add_channel(STATES), START_NS, bytes(8))
            writer.flush()
            begin = writer.position
            writer.add_attachment("notes.txt", b"notes")
            middle = writer.position
            writer.add_metadata("facts", {"a": "b"})
            end = writer.position
        raw = path.read_bytes()
        for at, until in ((begin, middle), (middle, end)):
            assert raw.count(struct.pack("<QQ", at, until - at)) == 1
            raw = raw.replace(struct.pack("<QQ", at, until - at), struct.pack("<QQ", position, size))
        path.write_bytes(raw[:-12] + bytes(4) + raw[-8:])  # without the summary's CRC
    return make


def _two_names_of_one_chunk(path: Path) -> None:
    raw = write(path, [states(START_NS + i, 1, 1, 0, 0) for i in range(20)], chunk_size=10**6).read_bytes()
    at = struct.unpack_from("<Q", raw, raw.index(b"index_pos=") + 10)[0]
    records = list(bag_format.whole_records(raw[at:]))
    info = raw[at + records[-2].end:]
    head = bag_format.file_header(at, 1, 1000)
    begin = len(bag_format.MAGIC) + len(head)
    path.write_bytes(bag_format.MAGIC + head + raw[begin:at + records[-2].end] + info * 1000)


HOSTILE: Dict[str, Callable[[Path], object]] = {
    "bz2_claims_1000.bag": lambda path: path.write_bytes(_bag_with_chunk("bz2", _bz2_bomb(), 1000)),
    "lz4_claims_1000.bag": lambda path: path.write_bytes(_bag_with_chunk("lz4", frame.compress(BOMB), 1000)),
    "zstd_claims_1000.mcap": lambda path: path.write_bytes(mcap_with_chunks("zstd", [zstd(BOMB)], 1000)),
    "zstd_unsized.mcap": lambda path: path.write_bytes(mcap_with_chunks("zstd", [zstd(BOMB, False)], 1000)),
    "zstd_claims_all.mcap": lambda path: path.write_bytes(mcap_with_chunks("zstd", [zstd(BOMB)], len(BOMB))),
    "bz2_claims_4_gb.bag": lambda path: path.write_bytes(_bag_with_chunk("bz2", _bz2_bomb(), 0xFFFFFFFF)),
    "bz2_many.bag": lambda path: path.write_bytes(_bag_with_chunk("bz2", bz2.compress(b"") * 1000, 1000)),
    "zstd_many.mcap": lambda path: path.write_bytes(mcap_with_chunks("zstd", [zstd(BOMB[:30 << 20])] * 40, 30 << 20)),
    "empty_payloads.mcap": _empty_payloads,
    "doubling.bag": lambda path: _bag_of(path, doubling(), b""),
    "doubling_with_md5.bag": lambda path: _bag_of(path, doubling("0" * 32), b""),
    "deep.bag": lambda path: _bag_of(path, deep(), b"x"),
    "empty_messages.bag": _empty_messages,
    "damages.bag.active": _many_damages,
    "account_list.mcap": _odd_account("[1, 2]"),
    "account_number.mcap": _odd_account("7"),
    "account_texts.mcap": _odd_account(json.dumps({"missing": "\x1b[2J"})),
    "account_deep.mcap": _odd_account("[" * 100000),
    "overlapping.mcap": _overlapping,
    "escapes.bag": _escapes,
    "two_names.bag": _two_names_of_one_chunk,
    "extras_of_4_eb.mcap": _extras_elsewhere(50, 1 << 62),
    "extras_of_60_gb.mcap": _extras_elsewhere(50, 60 << 30),
    "extras_behind_all.mcap": _extras_elsewhere((1 << 64) - 1, 100),
}


def make(folder: Path, names: Iterable[str] = HOSTILE) -> None:
    """Write some, or all, of the logs."""
    for name in names:
        HOSTILE[name](folder / name)


if __name__ == "__main__":
    make(Path(sys.argv[1]))
