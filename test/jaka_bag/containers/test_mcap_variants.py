"""The variants of MCAP files, each read with the same content, also where records have fields of later versions."""
import json
import struct
from collections import Counter

import pytest
from mcap.reader import NonSeekingReader
from mcap_variants import (
    ATTACHMENT,
    CHANNEL,
    CONTENTS,
    FACTS,
    MAGIC,
    MESSAGE,
    METADATA,
    build,
    record,
    text,
    text_map,
    variants,
)

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import open_log, read_index
from jaka_bag.containers.time_order import messages_of
from jaka_bag.errors import BagFormatError
from jaka_bag.operations.convert import Job, convert_file
from jaka_bag.operations.merge import merge
from jaka_bag.operations.recover import recover


def expected(content):
    """Return messages in the order of time, attachments, metadata."""
    messages = sorted((item.time, item.data, item.sequence) for item in content.items if item.kind == MESSAGE)
    return (messages, [item.data for item in content.items if item.kind == ATTACHMENT],
            [FACTS for item in content.items if item.kind == METADATA])


def found(path):
    with open_log(path) as reader:
        messages = [(m.log_time, m.data, m.sequence) for m in messages_of(reader)]
        assert reader.message_count == len(messages)
        return (messages, [reader.read_attachment(entry) for entry in reader.index.attachments],
                [reader.read_metadata(entry) for entry in reader.index.metadata])


def test_every_variant_is_read_with_the_same_content(tmp_path):
    path, copy = tmp_path / "variant.mcap", tmp_path / "copy.mcap"
    tally = Counter()
    for name, content, features in variants():
        path.write_bytes(build(content, features))
        truth = expected(content)
        assert found(path) == truth, name
        if content.schema and not {"ch", "pad"} <= set(features):  # its library reads no padding in chunks
            with path.open("rb") as stream:
                oracle = NonSeekingReader(stream).iter_messages()
                assert sorted((m.log_time, m.data) for _, _, m in oracle) == [m[:2] for m in truth[0]]
        if "pad" in features and "sum" not in features:
            convert_file(Job(str(path), str(copy), overwrite=True))
            assert found(copy) == truth, name
            merge([path], copy, overwrite=True)
            assert found(copy) == truth, name
            if content.items:
                recovered = recover(path, copy, overwrite=True)
                assert recovered.is_whole and found(copy) == truth, (name, recovered.losses)
        tally[name.split("-")[0]] += 1
    assert sum(tally.values()) == 416, tally


@pytest.mark.parametrize("features", [("ch", "mx", "pad"), ("ch", "chx", "mx", "pad", "rch", "rsh", "st")])
def test_further_fields_are_skipped_by_every_command(tmp_path, capsys, features):
    path = tmp_path / "padded.mcap"
    path.write_bytes(build(CONTENTS["TenMessages"], features))
    for words in (["info", "--freq", path], ["convert", path, "-o", tmp_path / "a.bag"],
                  ["filter", path, "-o", tmp_path / "b.mcap", "-t", "/example"],
                  ["merge", path, "-o", tmp_path / "c.mcap"], ["split", path, "--count", "4"],
                  ["recover", path, tmp_path / "d.mcap"]):
        assert main([str(word) for word in words]) == 0, capsys.readouterr().err
    assert [len(found(tmp_path / name)[0]) for name in ("a.bag", "b.mcap", "c.mcap", "d.mcap")] == [10] * 4


def test_what_the_statistics_count_and_no_index_names_is_kept(tmp_path, capsys):
    for name in ("OneAttachment", "OneMetadata"):
        path = tmp_path / (name + ".mcap")
        path.write_bytes(build(CONTENTS[name], ("st",)))
        assert main(["info", "--json", str(path)]) == 0
        document = json.loads(capsys.readouterr().out)
        assert len(document["attachments"]) + len(document["metadata"]) == 1
        assert main(["convert", str(path), "-o", str(tmp_path / "copy.mcap"), "--force", "-q"]) == 0
        assert found(tmp_path / "copy.mcap") == expected(CONTENTS[name])


def test_what_the_statistics_count_is_found_without_reading_messages(tmp_path, monkeypatch):
    from log_samples import START_NS, STATES

    from jaka_bag.containers.mcap import records, writer
    with writer.McapWriter(tmp_path / "log.mcap") as log:
        log.add_metadata("facts", FACTS)
        log.add_message(log.add_channel(STATES), START_NS, bytes(8))
        monkeypatch.setitem(log._summary, records.METADATA_INDEX, [])
        monkeypatch.setattr(log, "_statistics", lambda: writer.record(
            records.STATISTICS, b"".join([(1).to_bytes(8, "little"), b"\1\0", b"\1\0\0\0", bytes(4), b"\1\0\0\0",
                                          b"\1\0\0\0", START_NS.to_bytes(8, "little") * 2, b"\x0a\0\0\0\1\0",
                                          (1).to_bytes(8, "little")])))
    index = read_index(tmp_path / "log.mcap")
    assert [entry.name for entry in index.metadata] == ["facts"] and sum(index.counts) == 1
    assert index.codecs, "the summary was used, the chunks were not read"


def two_topics():
    """Return an MCAP of ten messages whose channel is defined again, as /late, before the last five."""
    content = CONTENTS["TenMessages"]
    raw = build(content, ())
    again = record(CHANNEL, struct.pack("<HH", 1, 1) + text("/late") + text("ros1") + text_map({}))
    message = record(MESSAGE, struct.pack("<HIQQ", 1, 5, content.items[5].time, content.items[5].time + 1))[9:]
    at = raw.index(message) - 9
    return raw[:at] + again + raw[at:]


def test_a_channel_that_is_defined_again_with_another_topic_is_refused_and_recovered(tmp_path, capsys):
    path = tmp_path / "again.mcap"
    path.write_bytes(two_topics())
    for words in (["info", path], ["convert", path, "-o", tmp_path / "out.bag"], ["cat", path]):
        assert main(list(map(str, words))) == 1
        assert "channel 1 is defined again with another topic" in capsys.readouterr().err
    assert main(["doctor", str(path)]) == 1
    assert "is defined again with another topic" in capsys.readouterr().out
    assert recover(path, tmp_path / "out.mcap").messages == 10
    with open_log(tmp_path / "out.mcap") as reader:
        assert Counter(m.connection.topic for m in messages_of(reader)) == {"/example": 5, "/late": 5}


def test_a_channel_that_another_chunk_defines_with_another_topic_is_refused(tmp_path):
    whole = build(CONTENTS["TenMessages"], ("ch", "chx", "mx", "rch", "rsh", "st"))
    at = whole.rindex(b"/example")  # in the summary
    path = tmp_path / "other.mcap"
    path.write_bytes(whole[:at] + b"/elsewhe" + whole[at + 8:-12] + bytes(4) + whole[-8:])
    with open_log(path) as reader, pytest.raises(BagFormatError, match="channel 1 is defined again with another topic"):
        list(messages_of(reader))


def test_a_record_of_a_kind_that_the_format_may_yet_define_is_skipped(tmp_path, capsys):
    raw = build(CONTENTS["TenMessages"], ())
    at = len(MAGIC) + 9 + struct.unpack_from("<Q", raw, len(MAGIC) + 1)[0]
    path = tmp_path / "later.mcap"
    path.write_bytes(raw[:at] + record(0x20, b"of a later version") + raw[at:])
    assert found(path) == expected(CONTENTS["TenMessages"])
    note = "a record of the unknown kind 32 at byte %d was skipped" % at
    assert read_index(path).notes == (note,)
    assert main(["doctor", str(path)]) == 0 and note in capsys.readouterr().out
    result = recover(path, tmp_path / "out.mcap")
    assert result.is_whole and result.messages == 10 and result.notes == (note,)


@pytest.mark.parametrize("features", [(), ("ch", "chx", "mx", "rch", "rsh", "st")])
def test_zeros_behind_the_file_are_skipped_and_told(tmp_path, capsys, features):
    path = tmp_path / "padded.mcap"
    raw = build(CONTENTS["TenMessages"], features)
    path.write_bytes(raw + bytes(5000))
    note = "5000 bytes at byte %d are zero and were skipped" % len(raw)
    assert found(path) == expected(CONTENTS["TenMessages"])
    assert read_index(path).notes == (note,)
    assert main(["doctor", str(path)]) == 0 and note in capsys.readouterr().out
    result = recover(path, tmp_path / "out.mcap")
    assert result.is_whole and result.messages == 10 and result.notes == (note,)
