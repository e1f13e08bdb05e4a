import os
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest
from log_samples import (
    MODEL,
    START_NS,
    STATES,
    RawBag,
    Sample,
    in_order,
    message_record,
    payload,
    read,
    state_log,
    write,
)
from mcap.writer import CompressionType, Writer

from jaka_bag.containers import time_order as readers
from jaka_bag.containers.bag import records as bag_format
from jaka_bag.containers.mcap import records as mcap_format
from jaka_bag.containers.mcap import writer as mcap_records
from jaka_bag.containers.registry import open_log, read_index
from jaka_bag.containers.time_order import messages_of
from jaka_bag.errors import BagError, BagFormatError
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.selection import Selection, TimePoint, TimeSpan

SAMPLES = state_log(2.0)


@pytest.mark.parametrize("suffix, codec", [(".bag", "none"), (".bag", "lz4"), (".bag", "bz2"), (".mcap", "none"),
                                           (".mcap", "lz4"), (".mcap", "zstd")])
def test_what_was_written_is_read(tmp_path, suffix, codec):
    assert read(write(tmp_path / ("log" + suffix), SAMPLES, codec)) == in_order(SAMPLES)


def test_the_format_is_seen_from_the_content(tmp_path):
    write(tmp_path / "log.bag", SAMPLES).rename(tmp_path / "what.dat")
    with open_log(tmp_path / "what.dat") as reader:
        assert reader.index.format == "bag" and reader.message_count == len(SAMPLES)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_equal_backward_and_overlapping_times_come_in_order(tmp_path, suffix):
    times = [5, 5, 3, 9, 1, 9, 9, 2, 7, 7, 5, 0] * 30
    samples = [Sample(STATES, START_NS + t, struct.pack("<4h", i, 0, 0, 0)) for i, t in enumerate(times)]
    path = write(tmp_path / ("log" + suffix), samples, "none", chunk_size=100)
    assert len(open_log(path).chunks) > 20
    assert read(path) == in_order(samples)


def test_overlapping_chunks_are_read_again_rather_than_held(tmp_path, monkeypatch):
    samples = [Sample(STATES, START_NS + (i * 7919) % 1000, struct.pack("<4h", i, 0, 0, 0)) for i in range(1000)]
    path = write(tmp_path / "log.mcap", samples, chunk_size=200)
    monkeypatch.setattr(readers, "HELD_BYTES", 1000)
    assert read(path) == in_order(samples)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_selection_by_topic_type_and_time(tmp_path, suffix):
    path = write(tmp_path / ("log" + suffix), SAMPLES)
    middle = START_NS + 10**9

    def picked(**wanted):
        with open_log(path) as reader:
            return [Sample(m.connection, m.log_time, m.data) for m in messages_of(reader, Selection(**wanted))]

    assert picked(topics=["/model"]) == SAMPLES[:1]
    assert picked(patterns=[".*position"], exclude=[".*tool.*"]) == [
        s for s in SAMPLES if s.connection.topic.endswith("joint_position")]
    assert picked(types=["jaka_msgs/RobotMsg"]) == [s for s in SAMPLES if s.connection == STATES]
    assert picked(start_time=middle) == [s for s in in_order(SAMPLES) if s.time >= middle]
    assert picked(start_time=middle, end_time=middle + 10**8) == [
        s for s in in_order(SAMPLES) if middle <= s.time <= middle + 10**8]
    with pytest.raises(BagError, match="regular expression"):
        picked(patterns=["("])


def test_times_are_named_from_the_start_the_end_or_the_epoch():
    def span(**named):
        return TimeSpan(**named).apply(Selection(), 1000, 5000)[-2:]

    assert span() == (None, None)
    assert span(start=TimePoint(10, False), end=TimePoint(-10, False)) == (1010, 4990)
    assert span(start=TimePoint(2000, True), duration=5) == (2000, 2005)
    assert span(duration=5) == (None, 1005)
    assert TimeSpan(duration=5).apply(Selection(), None, None) == Selection()


def raw_bag(*chunks, connections=((0, STATES),), broken_index=None):
    bag = RawBag()
    for samples in chunks:
        content, index = b"", {}
        for number, time, data in samples:
            index.setdefault(number, []).append((time, len(content)))
            content += message_record(number, time, data)
        if broken_index:
            index = broken_index(content, index)
        bag.add_chunk(content, list(index.items()), min(s[1] for s in samples), max(s[1] for s in samples))
    for number, connection in connections:
        bag.add_connection(number, connection)
    return bag.content()


def test_connection_numbers_may_be_anything_and_topics_have_several(tmp_path):
    other = Connection(STATES.topic, STATES.datatype, STATES.md5sum, STATES.definition, "/second")
    path = tmp_path / "odd.bag"
    path.write_bytes(raw_bag([(0xFFFFFFFF, 5, bytes(8)), (70000, 6, b"x" * 8)], [(0, 7, b"y" * 8)],
                             connections=[(0, STATES), (70000, other), (0xFFFFFFFF, MODEL)]))
    assert read(path) == [Sample(MODEL, 5, bytes(8)), Sample(other, 6, b"x" * 8), Sample(STATES, 7, b"y" * 8)]


def test_an_index_that_points_at_a_connection_record_misleads_nobody(tmp_path):
    bag = RawBag()
    content = bag_format.connection_record(0, STATES)
    offset = len(content)
    content += message_record(0, 9, bytes(8))
    bag.add_chunk(content, [(0, [(9, 0), (9, offset)])], 9, 9)
    bag.add_connection(0, STATES)
    (tmp_path / "odd.bag").write_bytes(bag.content())
    with open_log(tmp_path / "odd.bag") as reader:
        assert [m.log_time for m in messages_of(reader)] == [9]


def test_late_times_are_not_negative(tmp_path):
    late = 0xF0000000 * 10**9 + 5
    for name in ("late.bag", "late.mcap"):
        path = write(tmp_path / name, [Sample(STATES, late, bytes(8))])
        assert read(path) == [Sample(STATES, late, bytes(8))]
        assert read_index(path).start_time == late


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_empty_logs_and_connections_without_messages(tmp_path, suffix):
    write(tmp_path / ("none" + suffix), [])
    assert read(tmp_path / ("none" + suffix)) == []
    assert read_index(tmp_path / ("none" + suffix)).start_time is None


def foreign(path, **options):
    """Write an MCAP with the mcap library, schemas and channels inside its chunks."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start("ros1", "another library")
        channels = {}
        for sample in SAMPLES:
            c = sample.connection
            if c not in channels:
                schema = writer.register_schema(c.datatype, "ros1msg", c.definition.encode())
                metadata = {"md5sum": c.md5sum, "callerid": c.callerid, "latching": str(c.latching).lower()}
                channels[c] = writer.register_channel(c.topic, "ros1", schema, metadata)
            writer.add_message(channels[c], sample.time, sample.data, sample.time)
        writer.finish()
    return path


@pytest.mark.parametrize("options", [
    {"compression": CompressionType.ZSTD, "chunk_size": 5000}, {"compression": CompressionType.LZ4},
    {"compression": CompressionType.NONE}, {"use_chunking": False}, {"use_statistics": False},
    {"use_summary_offsets": False}, {"repeat_channels": False, "chunk_size": 5000}, {"repeat_schemas": False},
    {"use_chunking": False, "repeat_channels": False, "use_statistics": False},
    {"enable_crcs": False}, {"enable_data_crcs": True}], ids=str)
def test_mcaps_of_others_are_read(tmp_path, options):
    from mcap.writer import IndexType
    path = foreign(tmp_path / "foreign.mcap", **options)
    assert read(path) == in_order(SAMPLES)
    bare = foreign(tmp_path / "bare.mcap", index_types=IndexType.NONE, **options)
    assert read(bare) == in_order(SAMPLES)


def test_names_that_are_not_utf8_are_read_where_the_library_mcap_gives_up(tmp_path):
    from mcap.stream_reader import StreamReader
    path = tmp_path / "latin.mcap"
    topic = b"/caf\xe9"
    channel = struct.pack("<HHI", 3, 1, len(topic)) + topic + mcap_records.text("ros1") + mcap_records.text_map({})
    message = mcap_format.MESSAGE_HEAD.pack(mcap_format.MESSAGE, 30, 3, 0, 9, 9) + bytes(8)
    path.write_bytes(b"".join([
        mcap_format.MAGIC, mcap_records.header_record("ros1", ""), mcap_records.schema_record(1, STATES),
        mcap_records.record(mcap_format.CHANNEL, channel), message, mcap_records.record(mcap_format.DATA_END, bytes(4)),
        mcap_records.record(mcap_format.FOOTER, bytes(20)), mcap_format.MAGIC]))
    with open_log(path) as reader:
        assert [(m.connection.topic, m.log_time) for m in messages_of(reader)] == [("/caf\udce9", 9)]
    with path.open("rb") as stream, pytest.raises(UnicodeDecodeError):
        list(StreamReader(stream).records)


def test_channel_0_is_a_channel(tmp_path):
    path = tmp_path / "zero.mcap"
    head = mcap_format.MAGIC + mcap_records.header_record("ros1", "")
    body = mcap_records.schema_record(1, STATES) + mcap_records.channel_record(0, 1, STATES)
    body += mcap_format.MESSAGE_HEAD.pack(mcap_format.MESSAGE, 30, 0, 0, 9, 9) + bytes(8)
    chunk = mcap_records.chunk_head(9, 9, len(body), zlib.crc32(body), "none", len(body)) + body
    end = mcap_records.record(mcap_format.DATA_END, bytes(4))
    footer = mcap_records.record(mcap_format.FOOTER, bytes(20)) + mcap_format.MAGIC
    path.write_bytes(head + chunk + end + footer)
    assert read(path) == [Sample(STATES, 9, bytes(8))]


def test_memory_of_reading_does_not_grow_with_the_log(tmp_path):
    import tracemalloc
    path = write(tmp_path / "log.mcap", state_log(20.0), chunk_size=1 << 15)
    with open_log(path) as reader:
        tracemalloc.start()
        count = sum(len(block) for block in map(reader.load, reader.chunks))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert count == 7501 and peak < 1500000


def test_what_is_no_log_is_refused_in_one_line(tmp_path):
    (tmp_path / "empty").write_bytes(b"")
    (tmp_path / "text").write_text("hello, this is no log")
    (tmp_path / "old.bag").write_bytes(b"#ROSRECORD V1.1\n" + bytes(100))
    os.mkfifo(str(tmp_path / "pipe"))
    for name, reason in (("empty", "is empty"), ("text", r"is no \.bag, \.mcap or \.db3 file"),
                         ("old.bag", "version 1.1"), (".", "folder"), ("missing", "No such file"),
                         ("pipe", "no plain file")):
        with pytest.raises(BagError, match=reason):
            open_log(tmp_path / name)


def test_an_encrypted_bag_is_named_as_such(tmp_path):
    fields = [("chunk_count", bytes(4)), ("conn_count", bytes(4)), ("encryptor", b"rosbag/AesCbcEncryptor"),
              ("index_pos", struct.pack("<Q", 5000)), ("op", b"\x03")]
    header = bag_format.pack_record(fields, b" " * 3000)
    (tmp_path / "secret.bag").write_bytes(bag_format.MAGIC + header + bytes(3000))
    with pytest.raises(BagFormatError, match="encrypted.*decrypt"):
        open_log(tmp_path / "secret.bag")


def test_an_unindexed_bag_says_what_to_do(tmp_path):
    path = write(tmp_path / "log.bag", SAMPLES)
    raw = path.read_bytes()
    at = raw.index(b"index_pos=") + 10
    path.write_bytes(raw[:at] + bytes(8) + raw[at + 8:])
    with pytest.raises(BagFormatError, match="cut off.*recover"):
        open_log(path)


def test_a_wrong_chunk_crc_is_found(tmp_path):
    path = write(tmp_path / "log.mcap", SAMPLES, "none")
    raw = bytearray(path.read_bytes())
    at = bytes(raw).index(SAMPLES[50].data)
    raw[at + 20] ^= 1
    path.write_bytes(bytes(raw))
    with open_log(path) as reader, pytest.raises(BagFormatError, match="CRC.*recover"):
        list(map(reader.load, reader.chunks))


def test_a_file_without_permission_is_refused(tmp_path):
    path, readable = write(tmp_path / "log.bag", SAMPLES), write(tmp_path / "readable.bag", SAMPLES)
    code = ("import os, sys; sys.path.insert(0, %r)\n"
            "from jaka_bag.cli.main import main\n"
            "assert main(['info', %r]) == 0\n"  # imports all that it needs
            "os.getuid() == 0 and os.setuid(65534)\n"
            "sys.exit(main(['info', %r]))" % (os.getcwd(), str(readable), str(path)))
    path.chmod(0)
    os.chmod(str(tmp_path), 0o755)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True)
    assert done.returncode == 1
    lines = done.stderr.decode().splitlines()
    assert len(lines) == 1 and "Permission denied" in lines[0]


def test_blocks_share_their_chunk_and_renumber():
    from jaka_bag.messages.batch import MessageBatch, concatenate, pieces_of
    data = np.arange(40, dtype=np.uint8)
    start, length = np.array([0, 10, 20]), np.array([10, 5, 20])
    block = MessageBatch(data, start, length, np.array([0, 1, 0], np.int32), np.array([5, 6, 7]))
    taken = block.take(np.array([2, 0]))
    assert taken.data is data and payload(taken, 0) == bytes(range(20, 40))
    joined = concatenate([taken, block])
    assert [payload(joined, i) for i in range(5)] == [payload(taken, 0), payload(taken, 1)] + [
        payload(block, i) for i in range(3)]
    assert [len(p) for p in pieces_of(joined, 30)] == [2, 2, 1]
    assert block.with_connections(np.array([7, 9])).connection.tolist() == [7, 9, 7]
