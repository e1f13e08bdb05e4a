"""MCAP files whose records do not say what they are: nothing is dropped, made up or called whole without a word."""
import io
import struct
import time
import zlib

import pytest
import zstandard
from log_samples import START_NS, STATES, read, states, write
from lz4 import frame
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_variants import (
    ATTACHMENT,
    ATTACHMENT_INDEX,
    CHANNEL,
    CHUNK,
    DATA_END,
    FOOTER,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    METADATA,
    SCHEMA,
    record,
    text,
    text_map,
)

from jaka_bag.cli.main import main
from jaka_bag.containers.mcap.records import records_in
from jaka_bag.containers.mcap.recovery import McapRecovery
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import open_log
from jaka_bag.operations.diagnosis import diagnose
from jaka_bag.operations.recover import recover

SAMPLES = [states(START_NS + i * 1000000, i, 1, 0, 0) for i in range(60)]


def positions(raw, kind):
    """Return where the records of a kind begin."""
    return [body - 9 for opcode, body, _ in records_in(raw, len(MAGIC)) if opcode == kind]


def flipped(raw, at, bit):
    return raw[:at] + bytes([raw[at] ^ 1 << bit]) + raw[at + 1:]


@pytest.mark.parametrize("name", ["whole.mcap", "cut.mcap", "cut.mcap.active"])
def test_a_message_index_that_became_an_end_of_the_data_hides_no_message(tmp_path, name):
    whole = write(tmp_path / "log.mcap", SAMPLES, "zstd", chunk_size=100).read_bytes()
    indexes = positions(whole, MESSAGE_INDEX)
    assert len(indexes) > 3
    path, kept = tmp_path / name, tmp_path / "kept.mcap"
    for at in indexes:
        raw = flipped(whole, at, 3)
        assert raw[at] == DATA_END
        path.write_bytes(raw if name == "whole.mcap" else raw[:positions(whole, DATA_END)[0]])
        if main(["cat", str(path)]) == 0:
            assert read(path) == SAMPLES
        assert diagnose(path).verdict == "damaged" or name != "cut.mcap" and at == indexes[-1]
        result = recover(path, kept, overwrite=True)
        assert read(kept) == SAMPLES
        assert any(loss.begin == at for loss in result.losses), (at, result.losses)


def test_messages_behind_an_end_of_the_data_are_found(tmp_path):
    described = (record(SCHEMA, struct.pack("<H", 1) + text("std_msgs/String") + text("ros1msg")
                        + text("string data\n"))
                 + record(CHANNEL, struct.pack("<HH", 1, 1) + text("/x") + text("ros1") + text_map({})))

    def chunk(time):
        data = described + b"".join(record(MESSAGE, struct.pack("<HIQQ", 1, i, time + i, time + i) + text("abcd"))
                                    for i in range(20))
        return record(CHUNK, struct.pack("<QQQI", time, time + 19, len(data), 0) + text("")
                      + struct.pack("<Q", len(data)) + data)

    end = record(DATA_END, bytes(4))
    path = tmp_path / "hidden.mcap"
    path.write_bytes(MAGIC + record(HEADER, text("ros1") + text("")) + chunk(START_NS) + end + described
                     + chunk(START_NS + 100) + end + record(FOOTER, bytes(20)) + MAGIC)
    assert diagnose(path).verdict == "damaged"
    assert main(["cat", str(path)]) == 1
    result = recover(path, tmp_path / "kept.mcap")
    assert result.messages == 40 and not result.is_whole


STRING = ("std_msgs/String", "ros1msg", b"string data\n")


def foreign(payloads, topic="/real", encoding="ros1", schema=STRING, **options):
    """Return an MCAP that the format's own library writes."""
    out = io.BytesIO()
    writer = Writer(out, compression=CompressionType.NONE, **options)
    writer.start("ros1", "foreign")
    channel = writer.register_channel(topic, encoding, writer.register_schema(*schema))
    for number, payload in enumerate(payloads):
        writer.add_message(channel, START_NS + number, payload, START_NS + number, number)
    writer.finish()
    return out.getvalue()


@pytest.mark.parametrize("chunked", [False, True])
def test_messages_that_only_a_wrong_checksum_covers_are_kept_as_doubtful(tmp_path, capsys, chunked):
    raw = foreign([text("force %d" % (100 + i)) for i in range(5)], use_chunking=chunked, enable_data_crcs=True,
                  enable_crcs=not chunked)
    path, kept = tmp_path / "log.mcap", tmp_path / "kept.mcap"
    path.write_bytes(raw)
    assert recover(path, kept).is_whole
    path.write_bytes(flipped(raw, raw.index(b"force 102") + 6, 3))
    assert diagnose(path).verdict == "damaged"
    assert main(["recover", str(path), "-o", str(kept), "-f"]) == 1
    assert "PARTIAL" in capsys.readouterr().out
    with open_log(kept) as log:
        assert log.message_count == 5
        account = [log.read_metadata(entry) for entry in log.index.metadata if entry.name == "jaka_bag.recovery"]
    assert len(account) == 1 and "the data section's CRC is wrong" in str(account)


def with_summary(raw, old, new):
    """Return an MCAP in whose summary some bytes are others, under a right checksum."""
    start = struct.unpack_from("<Q", raw, len(raw) - 28)[0]
    summary = raw[start:-12].replace(old, new)
    assert summary != raw[start:-12]
    return raw[:start] + summary + struct.pack("<I", zlib.crc32(summary)) + raw[-8:]


@pytest.mark.parametrize("use_own_writer", [False, True])
def test_a_summary_that_swaps_two_fields_shows_no_swapped_values(tmp_path, capsys, use_own_writer):
    path, kept = tmp_path / "log.mcap", tmp_path / "kept.mcap"
    path.write_bytes(foreign([struct.pack("<dd", 1.0, 222.0)] * 3, "/pair", "ros1", (
        "my/Pair", "ros1msg", b"float64 force_limit\nfloat64 force_real_\n")))
    if use_own_writer:  # it keeps schemas outside of chunks
        assert main(["convert", str(path), "-o", str(tmp_path / "own.mcap"), "-f", "-q"]) == 0
        path = tmp_path / "own.mcap"
    assert main(["cat", str(path)]) == 0
    truth = capsys.readouterr().out
    assert diagnose(path).verdict == "whole"
    path.write_bytes(with_summary(path.read_bytes(), b"float64 force_limit\nfloat64 force_real_\n",
                                  b"float64 force_real_\nfloat64 force_limit\n"))
    if main(["cat", str(path)]) == 0:
        assert capsys.readouterr().out == truth
    else:
        assert "defined again with another topic or type" in capsys.readouterr().err
    assert diagnose(path).verdict == "damaged"
    recover(path, kept)
    assert main(["cat", str(kept)]) == 0
    assert capsys.readouterr().out == truth


@pytest.mark.parametrize("schema, encoding, is_legal", [
    (("std_msgs/String", "ros1msg", "string data\n"), "ros1", True),
    (("std_msgs/UInt64", "ros1msg", "string data\n"), "ros1", False),
    (("std_msgs/String", "ros1msg", "uint64 data\n"), "ros1", False),
    (("std_msgs/String", "ros2msg", "string data\n"), "ros1", False),
    (("std_msgs/String", "ros1msg", "string data\n"), "cdr", False)])
@pytest.mark.parametrize("chunked", [False, True])
def test_a_channel_is_defined_again_only_with_the_same_type(tmp_path, capsys, schema, encoding, is_legal, chunked):
    def described(number, name, kind, definition, encoding):
        return (record(SCHEMA, struct.pack("<H", number) + text(name) + text(kind) + text(definition))
                + record(CHANNEL, struct.pack("<HH", 1, number) + text("/x") + text(encoding) + text_map({})))

    def said(number):
        return record(MESSAGE, struct.pack("<HIQQ", 1, number, START_NS + number, START_NS + number) + text("abcd"))

    data = (described(1, "std_msgs/String", "ros1msg", "string data\n", "ros1") + said(0)
            + described(2, *schema, encoding) + said(1))
    chunk = record(CHUNK, struct.pack("<QQQI", START_NS, START_NS + 1, len(data), 0) + text("")
                   + struct.pack("<Q", len(data)) + data)
    path = tmp_path / "again.mcap"
    path.write_bytes(MAGIC + record(HEADER, text("ros1") + text("")) + (chunk if chunked else data)
                     + record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC)
    assert main(["cat", str(path)]) == (0 if is_legal else 1)
    assert is_legal or "channel 1 is defined again with another topic or type" in capsys.readouterr().err
    assert (diagnose(path).verdict == "whole") == is_legal
    result = recover(path, tmp_path / "kept.mcap")
    assert result.messages == 2
    with open_log(tmp_path / "kept.mcap") as log:
        assert len(log.connections) == 2 - is_legal


def schemas_of(path):
    """Return what the format's own library reads: the schema of each message."""
    with path.open("rb") as stream:
        return [(schema and (schema.name, schema.encoding, schema.data), channel.message_encoding, message.data)
                for schema, channel, message in make_reader(stream).iter_messages()]


@pytest.mark.parametrize("words", [["convert"], ["filter", "-t", "/j"], ["recover"], ["merge"]])
def test_a_schema_without_a_name_is_kept(tmp_path, words):
    path, out = tmp_path / "json.mcap", tmp_path / "out.mcap"
    path.write_bytes(foreign([b'{"a":1}'], "/j", "json", ("", "jsonschema", b'{"type":"object"}')))
    assert main([words[0], str(path), "-o", str(out), *words[1:]]) == 0
    assert schemas_of(out) == schemas_of(path) == [(("", "jsonschema", b'{"type":"object"}'), "json", b'{"a":1}')]


def without_summary(raw):
    """Return an MCAP without its summary."""
    end = positions(raw, DATA_END)[0] + 13
    return raw[:end] + record(FOOTER, bytes(20)) + MAGIC


@pytest.mark.parametrize("crc", [False, True])
@pytest.mark.parametrize("form", ["whole", "without_summary", "active"])
def test_a_payload_that_is_a_file_of_the_format_is_a_payload(tmp_path, crc, form):
    inner = foreign([text("embedded %d" % i) for i in range(3)], "/fake")
    files = [struct.pack("<I", len(part)) + part for part in (inner, inner[:400])]
    payloads = [text("real%d" % i) for i in range(3)] + [files[0], text("last"), files[1], text("very last")]
    raw = foreign(payloads, use_chunking=False, enable_data_crcs=crc)
    if form == "without_summary":
        raw = without_summary(raw)
    path, kept = tmp_path / "log.mcap", tmp_path / "kept.mcap"
    if form == "active":
        raw, path = raw[:positions(raw, DATA_END)[0]], tmp_path / "log.mcap.active"
    path.write_bytes(raw)
    assert [sample.data for sample in read(path)] == payloads
    assert diagnose(path).verdict == "whole"
    assert recover(path, kept).is_whole
    assert [(s.connection.topic, s.data) for s in read(kept)] == [("/real", payload) for payload in payloads]


@pytest.mark.parametrize("crc, summary", [(False, True), (True, True), (False, False), (True, False)])
def test_a_record_that_swallows_a_real_chunk_is_damage(tmp_path, crc, summary):
    raw = foreign([text("said %d" % i) for i in range(40)], chunk_size=300, enable_data_crcs=crc)
    raw = raw if summary else without_summary(raw)
    index = positions(raw, MESSAGE_INDEX)[1]
    chunks = [at for at in positions(raw, CHUNK) if at > index]
    path = tmp_path / "log.mcap"
    for stop in chunks[1:]:  # the length that leads exactly to a later chunk
        path.write_bytes(raw[:index + 1] + struct.pack("<Q", stop - index - 9) + raw[index + 9:])
        result = recover(path, tmp_path / "kept.mcap", overwrite=True)
        assert result.messages == 40 and not result.is_whole


def test_a_long_first_record_is_read(tmp_path):
    path = tmp_path / "log.mcap"
    raw = foreign([text("abcd")])
    begin = 17 + struct.unpack_from("<Q", raw, 9)[0]
    path.write_bytes(without_summary(MAGIC + record(HEADER, text("ros2") + text("x" * 3000)) + raw[begin:]))
    with open_log(path) as log:
        assert (log.index.profile, log.index.library) == ("ros2", "x" * 3000)
    assert recover(path, tmp_path / "kept.mcap").is_whole


def packed_chunk(codec, stored, data):
    return record(CHUNK, struct.pack("<QQQI", START_NS, START_NS, len(data), zlib.crc32(data)) + text(codec)
                  + struct.pack("<Q", len(stored)) + stored)


@pytest.mark.parametrize("codec", ["zstd", "lz4"])
@pytest.mark.parametrize("has_size", [True, False])
def test_chunks_of_several_frames_and_of_none_are_read(tmp_path, codec, has_size):
    def pack(part):
        if codec == "lz4":
            return frame.compress(part, store_size=has_size)
        return zstandard.ZstdCompressor(write_content_size=has_size).compress(part)

    data = (record(SCHEMA, struct.pack("<H", 1) + text("std_msgs/String") + text("ros1msg") + text("string data\n"))
            + record(CHANNEL, struct.pack("<HH", 1, 1) + text("/x") + text("ros1") + text_map({}))
            + b"".join(record(MESSAGE, struct.pack("<HIQQ", 1, i, START_NS, START_NS) + text("abcd"))
                       for i in range(20)))
    several = pack(data[:300]) + pack(data[300:350]) + pack(data[350:])
    path = tmp_path / "log.mcap"
    path.write_bytes(MAGIC + record(HEADER, text("ros1") + text("")) + packed_chunk(codec, b"", b"")
                     + packed_chunk(codec, several, data) + record(DATA_END, bytes(4)) + record(FOOTER, bytes(20))
                     + MAGIC)
    assert len(read(path)) == 20 and diagnose(path).verdict == "whole"
    assert recover(path, tmp_path / "kept.mcap").is_whole
    path.write_bytes(path.read_bytes().replace(several, several[:-6] + bytes(6)))
    assert not recover(path, tmp_path / "kept.mcap", overwrite=True).is_whole


@pytest.mark.parametrize("crc, kind, is_whole", [(False, 0x90, True), (False, 0x85, False), (True, 0x85, True)])
def test_a_private_record_may_begin_as_a_message_does(tmp_path, crc, kind, is_whole):
    raw = without_summary(foreign([text("abcd"), text("abce")], use_chunking=False))
    at = positions(raw, MESSAGE)[1]
    data = (raw[:at] + record(kind, struct.pack("<HIQQ", 1, 7, START_NS, START_NS) + b"private")
            + raw[at:positions(raw, DATA_END)[0]])
    path = tmp_path / "log.mcap"
    path.write_bytes(data + record(DATA_END, struct.pack("<I", zlib.crc32(data) if crc else 0))
                     + record(FOOTER, bytes(20)) + MAGIC)
    assert (diagnose(path).verdict == "whole") == is_whole
    result = recover(path, tmp_path / "kept.mcap")
    assert result.is_whole == is_whole and result.messages == 2


def test_an_attachment_whose_kind_is_damaged_is_told_as_lost(tmp_path):
    path = tmp_path / "log.mcap"
    with McapWriter(path) as log:
        log.add_message(log.add_channel(STATES), START_NS, bytes(8))
        log.add_attachment("notes", b"abc")
        log.add_metadata("facts", {"a": "b"})
    raw = path.read_bytes()
    assert recover(path, tmp_path / "kept.mcap").is_whole
    for kind in (ATTACHMENT, METADATA):
        for at in positions(raw, kind):
            for bit in range(8):
                path.write_bytes(flipped(raw, at, bit))
                losses = recover(path, tmp_path / "kept.mcap", overwrite=True).losses
                assert any(loss.begin == at for loss in losses), (kind, bit, losses)


def test_a_summary_that_names_very_many_attachments_that_are_not_there_is_told_soon(tmp_path):
    path = tmp_path / "log.mcap"
    begin = MAGIC + record(HEADER, text("ros1") + text("test")) + record(DATA_END, bytes(4))
    entries = b"".join(record(ATTACHMENT_INDEX, struct.pack("<5Q", len(begin) + 7 * i, 7, 0, 0, 0) + text("a%d" % i)
                                                  + text("")) for i in range(20000))
    path.write_bytes(begin + entries + record(FOOTER, struct.pack("<QQI", len(begin), 0, 0)) + MAGIC)
    begun = time.process_time()
    with path.open("rb") as file:
        walk = McapRecovery(file.fileno(), path.stat().st_size)
        assert not list(walk.stretches())
    assert time.process_time() - begun < 5.0
    assert len([loss for loss in walk.losses if "of which the summary tells" in loss.reason]) == 20000


def test_a_message_index_that_became_a_message_is_none(tmp_path):
    whole = write(tmp_path / "log.mcap", SAMPLES, "zstd", chunk_size=100).read_bytes()
    path, kept = tmp_path / "cut.mcap", tmp_path / "kept.mcap"
    for at in positions(whole, MESSAGE_INDEX):
        raw = flipped(whole, at, 1)
        assert raw[at] == MESSAGE
        for end in (len(whole), positions(whole, DATA_END)[0]):
            path.write_bytes(raw[:end])
            result = recover(path, kept, overwrite=True)
            assert read(kept) == SAMPLES and not result.is_whole
