import json
import os
import struct
import subprocess
import sys

import pytest
from log_samples import MODEL, START_NS, STATES, Sample, in_order, model, read, state_log, write

from jaka_bag.cli.main import main
from jaka_bag.containers.bag.writer import BagWriter
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import open_log
from jaka_bag.errors import BagError, OutputExists
from jaka_bag.messages.connection import Connection
from jaka_bag.operations.merge import merge
from jaka_bag.operations.split import SplitLimits, _Parts, split

SAMPLES = state_log(3.0)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_logs_are_merged_in_the_order_of_time(tmp_path, suffix):
    parts = [SAMPLES[0::3], SAMPLES[1::3], SAMPLES[2::3]]
    paths = [write(tmp_path / ("part%d%s" % (i, ".mcap" if i else ".bag")), part, chunk_size=700)
             for i, part in enumerate(parts)]
    outcome = merge(paths, tmp_path / ("all" + suffix))
    assert outcome.messages == len(SAMPLES)
    found = read(tmp_path / ("all" + suffix))
    assert found == in_order(sum(parts, []))
    with open_log(tmp_path / ("all" + suffix)) as reader:
        assert sorted(c.topic for c in reader.connections) == sorted({s.connection.topic for s in SAMPLES})


def test_equal_times_keep_the_order_of_the_files(tmp_path):
    other = Connection(STATES.topic, STATES.datatype, STATES.md5sum, STATES.definition, "/second")
    a = write(tmp_path / "a.bag", [Sample(STATES, START_NS, bytes([i] * 8)) for i in range(5)])
    b = write(tmp_path / "b.bag", [Sample(other, START_NS, bytes([9] * 8))])
    merge([b, a], tmp_path / "all.bag")
    assert [s.data[0] for s in read(tmp_path / "all.bag")] == [9, 0, 1, 2, 3, 4]
    with open_log(tmp_path / "all.bag") as reader:
        assert [c.callerid for c in reader.connections] == ["/second", "/jaka_driver"]


def test_metadata_of_all_merged_mcaps_is_kept(tmp_path):
    for name in ("a", "b"):
        with McapWriter(tmp_path / (name + ".mcap")) as writer:
            writer.add_metadata("facts", {"from": name})
            writer.add_message(writer.add_channel(STATES), START_NS, bytes(8))
    merge([tmp_path / "a.mcap", tmp_path / "b.mcap"], tmp_path / "all.mcap")
    with open_log(tmp_path / "all.mcap") as reader:
        assert [reader.read_metadata(m)["from"] for m in reader.index.metadata] == ["a", "b"]


def with_extras(path, samples):
    with McapWriter(path) as writer:
        writer.add_metadata("facts", {"host": "cell"})
        writer.add_attachment("params", b"a: 1", "text/yaml", 5, 6)
        for i, sample in enumerate(samples):
            writer.add_message(writer.add_channel(STATES), START_NS + i, sample)
    return path


def extras(path):
    with open_log(path) as reader:
        return ([(a.name, a.log_time, reader.read_attachment(a)) for a in reader.index.attachments],
                [(m.name, reader.read_metadata(m)) for m in reader.index.metadata])


def test_attachments_go_to_the_first_part_and_metadata_to_each(tmp_path, capsys):
    source = with_extras(tmp_path / "log.mcap", [bytes(8)] * 3)
    parts = [path for path, _ in split(source, tmp_path / "part.mcap", SplitLimits(messages=1)).parts]
    facts, attached = [("facts", {"host": "cell"})], [("params", 5, b"a: 1")]
    assert [extras(part) for part in parts] == [(attached, facts), ([], facts), ([], facts)]
    merge(parts, tmp_path / "again.mcap")
    assert extras(tmp_path / "again.mcap") == (attached, facts)
    assert "2 left out" in split(source, tmp_path / "part.bag", SplitLimits(messages=1)).notes[0]
    assert main(["split", "--help"]) == 0
    assert "attachments of an MCAP go to the first part" in capsys.readouterr().out


def test_a_log_without_messages_keeps_its_attachments_in_one_part(tmp_path):
    source = with_extras(tmp_path / "log.mcap", [])
    (part, messages), = split(source, tmp_path / "part.mcap", SplitLimits(messages=1)).parts
    assert messages == 0 and extras(part) == extras(source)


def test_merging_refuses_what_it_cannot_do(tmp_path):
    a = write(tmp_path / "a.bag", SAMPLES)
    with pytest.raises(BagError, match="is input and output"):
        merge([a, a], a, overwrite=True)
    with McapWriter(tmp_path / "b.mcap", profile="ros2"):
        pass
    with pytest.raises(BagError, match="different profiles.*: ros1, ros2"):
        merge([a, tmp_path / "b.mcap"], tmp_path / "all.mcap")
    assert sorted(os.listdir(str(tmp_path))) == ["a.bag", "b.mcap"]


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
@pytest.mark.parametrize("limits", [SplitLimits(messages=100), SplitLimits(duration=700_000_000),
                                    SplitLimits(size=30000), SplitLimits(size=30000, messages=50)], ids=str)
def test_parts_together_are_the_log(tmp_path, suffix, limits):
    source = write(tmp_path / "log.bag", SAMPLES)
    result = split(source, tmp_path / ("part" + suffix), limits)
    parts = [read(path) for path, _ in result.parts]
    assert sum(parts, []) == in_order(SAMPLES) and len(parts) > 2
    assert [count for _, count in result.parts] == [len(part) for part in parts]
    for part, (path, _) in list(zip(parts, result.parts))[:-1]:
        if limits.messages:
            assert len(part) <= limits.messages
        if limits.duration:
            assert part[-1].time - part[0].time < limits.duration
        if limits.size:
            assert os.path.getsize(path) < 2 * limits.size + 8192
    assert result.parts[0][0] == str(tmp_path / ("part_0" + suffix))


def test_latched_messages_are_repeated_with_their_flag(tmp_path):
    late = model(START_NS + 15 * 10**8, "zu12")
    source = write(tmp_path / "log.bag", in_order(SAMPLES + [late]))
    result = split(source, tmp_path / "part.bag", SplitLimits(duration=10**9), repeat_latched=True)
    heads = [read(path)[0] for path, _ in result.parts]
    assert [(h.connection, h.data) for h in heads] == [(MODEL, SAMPLES[0].data), (MODEL, SAMPLES[0].data),
                                                      (MODEL, late.data)]
    assert heads[1].time == read(result.parts[1][0])[1].time
    plain = split(source, tmp_path / "plain.bag", SplitLimits(duration=10**9))
    assert [read(path)[0].connection == MODEL for path, _ in plain.parts] == [True, False, False]


@pytest.mark.parametrize("count", [1, 2, 3])
def test_repeated_messages_leave_room_for_a_parts_own(tmp_path, monkeypatch, count):
    latched = [Connection(topic, "std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1", "string data", "/n", True)
               for topic in ("/a", "/b")]
    text = struct.pack("<I", 1) + b"x"
    samples = [Sample(latched[0], START_NS, text), Sample(latched[1], START_NS + 1, text)] + [
        Sample(STATES, START_NS + 10 + i, bytes([i] * 8)) for i in range(6)]
    source = write(tmp_path / "source.bag", samples)
    begin = _Parts.begin
    begun = []

    def guarded(parts, time):
        begun.append(time)
        assert len(begun) <= 20, "the split goes on without end"
        return begin(parts, time)
    monkeypatch.setattr(_Parts, "begin", guarded)
    result = split(source, tmp_path / "part.bag", SplitLimits(messages=count), repeat_latched=True)
    assert len(result.parts) == -(-len(samples) // count)
    merge([path for path, _ in result.parts], tmp_path / "all.bag")
    found = read(tmp_path / "all.bag")
    assert [found.count(sample) for sample in samples] == [1] * len(samples)
    assert len(found) == sum(messages for _, messages in result.parts)


def test_a_failed_split_leaves_no_parts(tmp_path, monkeypatch):
    source = write(tmp_path / "log.bag", SAMPLES)
    (tmp_path / "part_2.bag").write_bytes(b"precious")
    with pytest.raises(OutputExists):
        split(source, tmp_path / "part.bag", SplitLimits(messages=50))
    assert sorted(os.listdir(str(tmp_path))) == ["log.bag", "part_2.bag"]
    with pytest.raises(BagError, match="where to split"):
        split(source, tmp_path / "part.bag", SplitLimits())


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def fail_at_the_end(monkeypatch):
    def fail(function):
        def late(*args):
            if args[-1].name.endswith("_2.bag"):
                raise OSError("no space")
            return function(*args)
        return late

    monkeypatch.setattr(BagWriter, "_finish", fail(BagWriter._finish))


def refuse_the_last_name(monkeypatch):
    rename = os.rename

    def refuse(source, target):
        if os.path.basename(str(target)) == "part_2.bag" and os.path.dirname(str(source)).endswith(".part"):
            monkeypatch.setattr(os, "rename", rename)
            raise OSError("refused")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refuse)


@pytest.mark.parametrize("spoil", [fail_at_the_end, refuse_the_last_name])
def test_a_failed_split_leaves_the_old_parts(tmp_path, monkeypatch, spoil):
    source = write(tmp_path / "log.bag", SAMPLES)
    split(source, tmp_path / "part.bag", SplitLimits(messages=300))
    before = contents(tmp_path)
    spoil(monkeypatch)
    with pytest.raises(OSError, match="no space|refused"):
        split(source, tmp_path / "part.bag", SplitLimits(messages=100), overwrite=True)
    assert contents(tmp_path) == before and len(before) > 3


def test_a_folder_with_the_name_of_a_part_costs_no_old_one(tmp_path):
    source = write(tmp_path / "log.bag", SAMPLES)
    split(source, tmp_path / "part.bag", SplitLimits(messages=1000))
    (tmp_path / "part_2.bag").mkdir()
    before = (tmp_path / "part_0.bag").read_bytes()
    with pytest.raises(BagError, match="is a folder"):
        split(source, tmp_path / "part.bag", SplitLimits(messages=100), overwrite=True)
    assert (tmp_path / "part_0.bag").read_bytes() == before
    assert sorted(os.listdir(str(tmp_path))) == ["log.bag", "part_0.bag", "part_1.bag", "part_2.bag"]


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("call", [0, 1, 2])
@pytest.mark.parametrize("function", ["replace", "rename"])
def test_an_interruption_beside_a_name_leaves_all_parts_or_none(tmp_path, function, call, name):
    source = write(tmp_path / "log.bag", SAMPLES)
    code = ("import os, signal, sys\n"
            "from jaka_bag.cli.main import main\n"
            "real, calls = os.%s, []\n"
            "def interrupted(*args):\n"
            "    real(*args)\n"
            "    calls.append(args)\n"
            "    if len(calls) == %d:\n"
            "        os.kill(os.getpid(), signal.%s)\n"
            "os.%s = interrupted\n"
            "sys.exit(main(['split', %r, '--count', '200', '-q']))")
    done = subprocess.run([sys.executable, "-c", code % (function, call + 1, name, function, str(source))],
                          stderr=subprocess.PIPE)
    assert done.stderr.decode() == "jaka_bag: interrupted, no half file is left\n" and done.returncode == 1
    parts = sorted(set(os.listdir(str(tmp_path))) - {"log.bag"})
    assert not parts or sum((read(tmp_path / part) for part in parts), []) == in_order(SAMPLES)


@pytest.mark.parametrize("old", ["r_1.mcap", "r_2.mcap"])
def test_a_source_that_is_called_as_a_part_is_kept(tmp_path, old):
    source = write(tmp_path / old, SAMPLES)
    (tmp_path / "r_0.mcap").write_bytes(b"old")
    (tmp_path / "r_1.mcap").touch()
    before = contents(tmp_path)
    with pytest.raises(BagError, match="is input and output"):
        split(source, tmp_path / "r.mcap", SplitLimits(messages=len(SAMPLES) // 2 + 1), overwrite=True)
    assert contents(tmp_path) == before


def test_the_programs(tmp_path, capsys):
    source = write(tmp_path / "log.mcap", SAMPLES)
    assert main(["split", str(source), "--count", "500", "--json"]) == 0
    parts = [part["target"] for part in json.loads(capsys.readouterr().out)["parts"]]
    assert parts == [str(tmp_path / ("log_%d.mcap" % i)) for i in range(3)]
    assert main(["merge", *reversed(parts), "-o", str(tmp_path / "all.bag")]) == 0
    assert "1126 messages of 3 files" in capsys.readouterr().out
    assert read(tmp_path / "all.bag") == in_order(SAMPLES)
    assert main(["filter", str(source), "-o", str(tmp_path / "few.bag"), "-t", STATES.topic, "--duration", "1s",
                 "--keep-latched", "-q"]) == 0
    assert {s.connection for s in read(tmp_path / "few.bag")} == {STATES}
    assert main(["split", str(source)]) == 2
    assert main(["filter", str(source), "-o", "x.bag", "--until", "1", "--duration", "1"]) == 2


def test_what_the_parts_cannot_hold_is_said(tmp_path):
    with McapWriter(tmp_path / "log.mcap") as writer:
        writer.add_message(writer.add_channel(STATES), START_NS, bytes(8), START_NS - 1)
    assert "publish times" in split(tmp_path / "log.mcap", tmp_path / "p.bag", SplitLimits(messages=1)).notes[0]
    assert "publish times" in merge([tmp_path / "log.mcap"], tmp_path / "m.bag").notes[0]


def test_an_empty_log_has_no_parts_and_merges_to_an_empty_one(tmp_path):
    with BagWriter(tmp_path / "none.bag") as writer:
        writer.add_channel(STATES)
    assert split(tmp_path / "none.bag", tmp_path / "p.bag", SplitLimits(messages=1)).parts == ()
    merge([tmp_path / "none.bag"], tmp_path / "all.mcap")
    with open_log(tmp_path / "all.mcap") as reader:
        assert reader.connections == [STATES] and reader.message_count == 0
