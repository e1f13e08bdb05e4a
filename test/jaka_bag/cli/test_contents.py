"""The content of a log, piece by piece: cat, du, doctor, attach, extract."""
import json
import struct

import pytest
from log_samples import (
    JOINTS,
    MODEL,
    START_NS,
    STATES,
    connection,
    in_order,
    joints,
    read,
    state_log,
    states,
    text,
    write,
)

from jaka_bag.cli.main import main
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import create_log, open_log
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.decoding import Decoder, pick

SAMPLES = state_log(1.0)


@pytest.fixture(params=["run.bag", "run.mcap"])
def log(tmp_path, request):
    return write(tmp_path / request.param, SAMPLES)


def call(capsys, *words, code=0):
    assert main(list(map(str, words))) == code
    return capsys.readouterr()


def lines(capsys, *words):
    return [json.loads(line) for line in call(capsys, "cat", *words).out.splitlines()]


def test_cat_prints_every_message_in_the_order_of_time(log, capsys):
    printed = lines(capsys, log)
    ordered = in_order(SAMPLES)
    assert [(line["topic"], line["log_time_ns"]) for line in printed] == [(s.connection.topic, s.time) for s in ordered]
    assert printed[0]["message"] == {"data": "zu7"} and printed[0]["type"] == "std_msgs/String"
    first = next(line["message"] for line in printed if line["topic"] == JOINTS.topic)
    assert first["name"] == ["joint_%d" % i for i in range(1, 7)] and len(first["position"]) == 6
    assert first["header"]["stamp"] == {"secs": START_NS // 10**9, "nsecs": first["header"]["stamp"]["nsecs"]}
    assert first["velocity"] == []


def test_cat_keeps_fields_topics_times_and_a_few(log, capsys):
    printed = lines(capsys, log, "--field", JOINTS.topic + ":position[5]", "--field", "motion_state", "-l", "3",
                    "-s", "0.1")
    assert [line["topic"] for line in printed].count(JOINTS.topic) == 3 and len(printed) == 6
    assert {tuple(line["message"]) for line in printed} == {("position[5]",), ("motion_state",)}
    assert "no selected message has a field no.such" in call(capsys, "cat", log, "--field", "no.such", code=2).err
    assert "did you mean /model?" in call(capsys, "cat", log, "-t", "model", code=2).err


def test_messages_as_data_of_every_kind():
    definition = ("bool flag\nint64[2] pair\nuint8[] raw\nfloat32 single\nfloat64[] many\nstring[] words\ntime at\n"
                  "duration[1] span\nInner[] inner\n" + "=" * 80 + "\nMSG: pkg/Inner\nint8 a\nstring b\n")
    kind = connection("/x", "pkg/Outer", definition)
    raw = struct.pack("<?2q", True, -1, 1 << 62) + struct.pack("<I3s", 3, b"\x00\xff\x01")
    raw += struct.pack("<f", float("nan")) + struct.pack("<I2d", 2, float("-inf"), 0.5)
    raw += struct.pack("<I", 2) + text("ä") + text("") + struct.pack("<IIii", 1, 2, -3, 4)
    raw += struct.pack("<I", 2) + b"\x07" + text("p") + b"\xf9" + text("q")
    value = Decoder(kind).decode(raw)
    assert value == {"flag": True, "pair": [-1, 1 << 62], "raw": "AP8B", "single": "NaN", "many": ["-Infinity", 0.5],
                     "words": ["ä", ""], "at": {"secs": 1, "nsecs": 2}, "span": [{"secs": -3, "nsecs": 4}],
                     "inner": [{"a": 7, "b": "p"}, {"a": -7, "b": "q"}]}
    assert pick(value, "inner.b") == ["p", "q"] and pick(value, "inner[1].a") == -7 and pick(value, "at.secs") == 1
    for path in ("nope", "pair[2]", "flag.x", "inner[x]"):
        with pytest.raises(KeyError):
            pick(value, path)


def test_messages_that_are_json_are_taken_as_they_are_and_others_are_refused(tmp_path, capsys):
    with McapWriter(tmp_path / "j.mcap", profile="") as writer:
        channel = writer.add_channel(Connection("/j", "J", encoding="json", schema_encoding="jsonschema"))
        writer.add_message(channel, 5, b'{"a": [1]}')
        writer.add_message(writer.add_channel(Connection("/p", "P", encoding="protobuf", schema_encoding="protobuf")),
                           6, b"\x08\x01")
    assert lines(capsys, tmp_path / "j.mcap", "-t", "/j")[0]["message"] == {"a": [1]}
    assert "/p (P): the descriptors of P cannot be read" in call(
        capsys, "cat", tmp_path / "j.mcap", "-t", "/p", code=1).err


def test_cat_goes_on_behind_a_file_that_it_cannot_read(log, capsys):
    out, err = call(capsys, "cat", log.with_name("missing.bag"), log, "-t", MODEL.topic, code=1)
    assert json.loads(out)["message"] == {"data": "zu7"} and "missing.bag" in err


def test_du_accounts_for_every_byte(log, capsys):
    document = json.loads(call(capsys, "du", log, "--json").out)["files"][0]
    assert document["size"] == log.stat().st_size
    assert sum(t["stored_bytes"] for t in document["topics"]) + document["other_bytes"] == document["size"]
    assert 0 < document["other_bytes"] < document["size"]
    by_topic = {t["topic"]: t for t in document["topics"]}
    assert by_topic[STATES.topic]["payload_bytes"] == 125 * 8 and by_topic[STATES.topic]["messages"] == 125
    assert document["topics"][0]["topic"] == JOINTS.topic
    assert JOINTS.topic in call(capsys, "du", log).out


def test_a_whole_log_is_whole(log, capsys):
    assert call(capsys, "doctor", log).out == "%s: whole: %d messages\n" % (log, len(SAMPLES))


def test_the_doctor_names_what_is_damaged(log, capsys):
    raw = bytearray(log.read_bytes())
    cut = log.with_name("cut" + log.suffix)
    cut.write_bytes(raw[:len(raw) * 2 // 3])
    out = call(capsys, "doctor", cut, log, code=1).out
    assert "%s: error: it has no usable index" % cut in out and "%s: damaged: jaka_bag recover keeps" % cut in out
    assert "%s: whole" % log in out
    with open_log(log) as reader:
        chunk = reader.chunks[2]
    for i in range(chunk.position + 200, chunk.position + 260):
        raw[i] ^= 0x5A
    log.write_bytes(raw)
    document = json.loads(call(capsys, "doctor", log, "--json", code=1).out)["files"][0]
    assert document["verdict"] == "damaged" and document["findings"][0]["level"] == "error"


def test_the_doctor_warns_of_what_programs_stumble_over(tmp_path, capsys):
    path = tmp_path / "odd.bag"
    with create_log(path) as writer:
        for i, odd in enumerate((STATES._replace(md5sum="0" * 32), MODEL._replace(definition="nonsense\n"),
                                 JOINTS._replace(topic="/two"), STATES._replace(topic="/two"))):
            sample = joints(0, START_NS, [0.0]) if i == 2 else states(START_NS, 1, 2, 3, 4)
            writer.add_message(writer.add_channel(odd), 0 if i == 3 else START_NS - i, sample.data)
    out = call(capsys, "doctor", path).out
    for words in ("warning: /jaka_driver/robot_states: the md5 is 000", "warning: /model: the definition of",
                  "warning: /two has messages of 2 types", "1 messages have the log time 0",
                  "note: 3 messages are older than the one before", "whole, with warnings: 4 messages"):
        assert words in out, out


def test_attachments_and_metadata_go_in_and_come_out(tmp_path, capsys):
    source = write(tmp_path / "run.mcap", SAMPLES, "lz4")
    (tmp_path / "notes.txt").write_text("hello")
    one, two, folder = tmp_path / "one.mcap", tmp_path / "two.mcap", tmp_path / "out"
    call(capsys, "attach", source, tmp_path / "notes.txt", "-o", one, "--metadata", "cell", "operator=Li", "order=7=8")
    call(capsys, "attach", one, tmp_path / "notes.txt", "-o", two, "--name", "../../evil.txt", "--media-type", "a/b")
    assert read(two) == in_order(SAMPLES)
    with open_log(two) as reader:
        assert reader.index.codecs[0][0] == "lz4"
        assert {(a.name, a.media_type) for a in reader.index.attachments} == {
            ("notes.txt", "text/plain"), ("../../evil.txt", "a/b")}
    assert "evil.txt" in call(capsys, "extract", two).out
    call(capsys, "extract", two, "-o", folder)
    assert sorted(path.name for path in folder.iterdir()) == ["cell.json", "evil.txt", "notes.txt"]
    assert json.loads((folder / "cell.json").read_text()) == {"operator": "Li", "order": "7=8"}
    assert (folder / "evil.txt").read_text() == "hello"
    assert "--force overwrites" in call(capsys, "extract", two, "notes.txt", "-o", folder, code=1).err
    call(capsys, "extract", two, "notes.txt", "-o", folder, "-f")
    assert "did you mean notes.txt?" in call(capsys, "extract", two, "note.txt", code=2).err


@pytest.mark.parametrize("force", [[], ["-f"]])
def test_attachments_of_one_name_are_all_written(tmp_path, capsys, force):
    with McapWriter(tmp_path / "run.mcap") as writer:
        for number, name in enumerate(["a", "a", "2_a", "2_a", "a"]):
            writer.add_attachment(name, b"%d" % number)
    call(capsys, "extract", tmp_path / "run.mcap", "-o", tmp_path / "out", *force)
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == {
        "a": b"0", "2_a": b"1", "2_2_a": b"2", "3_2_a": b"3", "3_a": b"4"}


@pytest.mark.parametrize("words, reason", [
    (["attach", "run.mcap", "-o", "o.mcap"], "nothing to attach"),
    (["attach", "run.mcap", "-o", "o.mcap", "--metadata", "a", "b"], "'b' is not KEY=VALUE"),
    (["attach", "run.mcap", "-o", "o.mcap", "--metadata", "a"], "give KEY=VALUE"),
    (["attach", "run.mcap", "a.txt", "b.txt", "-o", "o.mcap", "--name", "x"], "--name is for one FILE"),
    (["attach", "run.mcap", "a.txt", "a.txt", "-o", "o.mcap"], "has an attachment a.txt already")])
def test_wrong_attachments_are_refused(tmp_path, monkeypatch, capsys, words, reason):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "run.mcap", SAMPLES[:5])
    (tmp_path / "a.txt").write_text("a")
    assert reason in call(capsys, *words, code=2).err
    assert not (tmp_path / "o.mcap").exists()


def test_a_bag_has_no_place_for_attachments(tmp_path, capsys):
    source = write(tmp_path / "run.bag", SAMPLES[:5])
    assert "no place for attachments" in call(capsys, "attach", source, source, "-o", tmp_path / "o.bag", code=1).err
