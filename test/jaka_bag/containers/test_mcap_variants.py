"""The variants of MCAP files, each read with the same content, also where records have fields of later versions."""
import json
from collections import Counter

import pytest
from mcap.reader import NonSeekingReader
from mcap_variants import ATTACHMENT, CONTENTS, FACTS, MESSAGE, METADATA, build, variants

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import open_log, read_index
from jaka_bag.containers.time_order import messages_of
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
