import json
import os
import struct
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_samples import (
    HEADER,
    JOINTS,
    MODEL,
    START_NS,
    STATES,
    TOOL,
    RawBag,
    Sample,
    connection,
    in_order,
    message_record,
    model,
    read,
    state_log,
    write,
)
from mcap.reader import make_reader
from rosbags_oracle import read_rosbag2

from jaka_bag.cli.main import main
from jaka_bag.containers.bag.writer import BagWriter
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import open_log
from jaka_bag.containers.rosbag2 import Rosbag2Writer
from jaka_bag.engines.conversion import task_of
from jaka_bag.engines.processes import Processes
from jaka_bag.engines.tasks import run_tasks
from jaka_bag.errors import BagFormatError, DefinitionError, OutputExists
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.ros2_types import Ros2Type
from jaka_bag.messages.selection import Selection, TimePoint, TimeSpan
from jaka_bag.operations import convert as conversion
from jaka_bag.operations.convert import Job, convert_file, is_worth_sorting
from jaka_bag.operations.merge import merge
from jaka_bag.operations.recover import recover

SAMPLES = state_log(2.0)


def convert(source, target, **options):
    return convert_file(Job(str(source), str(target), **options))


@pytest.mark.parametrize("codec", ["none", "lz4", "zstd"])
@pytest.mark.parametrize("back", ["none", "lz4", "bz2"])
def test_bag_to_mcap_to_bag_is_identical(tmp_path, codec, back):
    first = write(tmp_path / "first.bag", SAMPLES, "lz4")
    convert(first, tmp_path / "log.mcap", compression=codec)
    with (tmp_path / "log.mcap").open("rb") as stream:
        assert len(list(make_reader(stream, validate_crcs=True).iter_messages())) == len(SAMPLES)
    convert(tmp_path / "log.mcap", tmp_path / "second.bag", compression=back)
    with open_log(first) as a, open_log(tmp_path / "second.bag") as b:
        assert a.connections == b.connections
    assert read(tmp_path / "second.bag") == read(first) == in_order(SAMPLES)


@given(st.lists(st.tuples(st.sampled_from([0, 3, 70000]), st.integers(0, 10**12), st.binary(max_size=30)), min_size=1,
                max_size=40), st.permutations([0, 1, 2]), st.integers(1, 10), st.booleans())
def test_random_irregular_bags_keep_every_message(tmp_path_factory, items, order, chunk_length, has_index):
    folder = tmp_path_factory.mktemp("bag")
    known = {0: STATES, 3: MODEL, 70000: Connection("/odd", "a/B", "d41d8cd98f00b204e9800998ecf8427e", "", None, None,
                                                   (("tcp_nodelay", "1"),))}
    bag = RawBag()
    for begin in range(0, len(items), chunk_length):
        content, index = b"", {}
        part = items[begin:begin + chunk_length]
        for i, (number, time, data) in enumerate(part):
            if has_index or i % 2:
                index.setdefault(number, []).append((time, len(content)))
            content += message_record(number, time, data, order if i % 3 else order[::-1])
        counts = {}
        for number, _, _ in part:
            counts[number] = counts.get(number, 0) + 1
        bag.add_chunk(content, list(index.items()), min(t for _, t, _ in part), max(t for _, t, _ in part))
        bag.infos[-1] = bag.infos[-1]._replace(counts=counts)
    for number, value in known.items():
        bag.add_connection(number, value)
    (folder / "odd.bag").write_bytes(bag.content())
    convert(folder / "odd.bag", folder / "odd.mcap")
    convert(folder / "odd.mcap", folder / "back.bag")
    expected = sorted((Sample(known[n], t, d) for n, t, d in items), key=lambda s: s.time)
    assert read(folder / "odd.bag") == read(folder / "odd.mcap") == read(folder / "back.bag") == expected
    with open_log(folder / "back.bag") as reader:
        assert reader.connections == list(known.values())


@pytest.mark.parametrize("suffix", ["mcap", "bag"])
def test_one_thread_or_two_give_the_same_bytes(tmp_path, monkeypatch, suffix):
    monkeypatch.setattr(conversion, "_SMALL", 1)  # each chunk is one in the output, too
    source = write(tmp_path / "log.bag", state_log(4.0))
    one, two = (tmp_path / ("%s.%s" % (name, suffix)) for name in ("one", "two"))
    convert(source, one, workers=1)
    convert(source, two, workers=2)
    assert one.read_bytes() == two.read_bytes()


def test_an_index_that_tells_of_more_messages_than_there_are_is_not_believed(tmp_path):
    bag = RawBag()
    bag.add_chunk(message_record(0, 9, bytes(8)), [(0, [(9, 0)])], 9, 9)
    bag.infos[0] = bag.infos[0]._replace(counts={0: 2})
    bag.add_connection(0, STATES)
    (tmp_path / "odd.bag").write_bytes(bag.content())
    result = convert(tmp_path / "odd.bag", tmp_path / "odd.mcap")
    assert "it tells of 2 messages in the chunk at byte 4117, the chunk's own index of 1" in result.notes[0]
    assert result.messages == len(read(tmp_path / "odd.mcap")) == 1


def test_an_index_that_names_a_record_twice_in_each_place_costs_a_note(tmp_path):
    bag = RawBag()
    bag.add_chunk(message_record(0, 9, bytes(8)), [(0, [(9, 0), (9, 0)])], 9, 9)
    bag.add_connection(0, STATES)
    (tmp_path / "odd.bag").write_bytes(bag.content())
    result = convert(tmp_path / "odd.bag", tmp_path / "odd.mcap")
    assert result.notes == ("the index tells of 2 messages: there are 1, and all are kept",)
    assert merge([tmp_path / "odd.bag"], tmp_path / "merged.mcap").notes == result.notes


def test_an_index_that_lies_in_each_place_ends_a_command(tmp_path):
    bag = RawBag()
    bag.add_chunk(message_record(0, 9, bytes(8)), [(0, [(5, 0)])], 5, 5)
    bag.add_connection(0, STATES)
    (tmp_path / "odd.bag").write_bytes(bag.content())
    with pytest.raises(BagFormatError, match="at byte 4117 holds messages of times or topics that the index does not"):
        convert(tmp_path / "odd.bag", tmp_path / "odd.mcap")
    recover(tmp_path / "odd.bag", tmp_path / "odd.mcap")
    assert [s.time for s in read(tmp_path / "odd.mcap")] == [9]


def test_topics_types_and_times_are_filtered(tmp_path):
    source = write(tmp_path / "log.bag", SAMPLES)
    convert(source, tmp_path / "a.mcap", selection=Selection(topics=[TOOL.topic]),
            span=TimeSpan(TimePoint(10**9, False), None, 5 * 10**8))
    found = read(tmp_path / "a.mcap")
    first = SAMPLES[0].time
    assert found == [s for s in in_order(SAMPLES) if s.connection == TOOL
                     and first + 10**9 <= s.time <= first + 15 * 10**8] and found
    convert(source, tmp_path / "b.mcap", span=TimeSpan(TimePoint(10**9, False)), keep_latched=True)
    assert read(tmp_path / "b.mcap")[0] == SAMPLES[0]
    with open_log(tmp_path / "a.mcap") as reader:
        assert reader.connections == [TOOL]


def test_what_a_bag_cannot_hold_is_said(tmp_path):
    with McapWriter(tmp_path / "log.mcap") as writer:
        writer.add_metadata("facts", {})
        writer.add_message(writer.add_channel(STATES), START_NS, bytes(8), START_NS - 5, 7)
    notes = convert(tmp_path / "log.mcap", tmp_path / "log.bag").notes
    assert [word for word in ("publish times", "sequence numbers", "attachments and metadata")
            if not any(word in note for note in notes)] == []
    assert convert(tmp_path / "log.mcap", tmp_path / "again.mcap").notes == ()
    with open_log(tmp_path / "again.mcap") as reader:
        assert reader.read_metadata(reader.index.metadata[0]) == {}
        block = next(map(reader.load, reader.chunks))
        assert (block.publish_time[0], block.sequence[0]) == (START_NS - 5, 7)


def test_a_foreign_mcap_without_md5_gets_it_from_its_definition(tmp_path):
    with McapWriter(tmp_path / "log.mcap") as writer:
        bare = Connection(STATES.topic, STATES.datatype, "", STATES.definition)
        writer.add_message(writer.add_channel(bare), START_NS, bytes(8))
    convert(tmp_path / "log.mcap", tmp_path / "log.bag")
    with open_log(tmp_path / "log.bag") as reader:
        assert reader.connections[0].md5sum == STATES.md5sum


@pytest.mark.parametrize("codec", ["none", "lz4", "zstd"])
def test_a_rosbag2_folder_is_read_by_rosbags(tmp_path, codec):
    source = write(tmp_path / "log.bag", SAMPLES)
    convert(source, tmp_path / "run", profile="ros2", compression=codec)
    kinds = {c: Ros2Type(c) for c in (TOOL, JOINTS, STATES, MODEL)}
    expected = [(s.connection.topic, kinds[s.connection].name, s.time, kinds[s.connection].to_cdr(s.data))
                for s in in_order(SAMPLES)]
    assert read_rosbag2(tmp_path / "run") == expected
    assert sorted(os.listdir(str(tmp_path / "run"))) == ["metadata.yaml", "run.mcap"]
    with (tmp_path / "run" / "run.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        assert "serialized_metadata" in next(reader.iter_metadata()).metadata
        channels = {c.topic: c.metadata["offered_qos_profiles"] for c in reader.get_summary().channels.values()}
    assert "durability: 1" in channels["/model"] and channels[TOOL.topic] == ""


def test_a_rosbag2_folder_is_replaced_only_when_it_is_one(tmp_path):
    source = write(tmp_path / "log.bag", SAMPLES)
    (tmp_path / "precious").mkdir()
    with pytest.raises(OutputExists, match="no rosbag2 folder"):
        convert(source, tmp_path / "precious", profile="ros2", overwrite=True)
    convert(source, tmp_path / "run", profile="ros2")
    with pytest.raises(OutputExists):
        convert(source, tmp_path / "run", profile="ros2")
    convert(source, tmp_path / "run", profile="ros2", overwrite=True, selection=Selection(topics=["/model"]))
    assert len(read_rosbag2(tmp_path / "run")) == 1
    assert sorted(os.listdir(str(tmp_path))) == ["log.bag", "precious", "run"]


def test_a_type_without_ros2_form_leaves_nothing(tmp_path):
    odd = Connection("/odd", "a/B", "0" * 32, "no definition at all")
    source = write(tmp_path / "log.bag", [Sample(odd, START_NS, b"x")])
    with pytest.raises(DefinitionError, match="/odd"):
        convert(source, tmp_path / "run", profile="ros2")
    assert os.listdir(str(tmp_path)) == ["log.bag"]


def test_a_cdr_mcap_becomes_a_bag_and_stays_cdr_as_an_mcap(tmp_path):
    convert(write(tmp_path / "log.bag", SAMPLES), tmp_path / "run", profile="ros2")
    convert(tmp_path / "run" / "run.mcap", tmp_path / "back.bag")
    assert [(s.connection.topic, s.connection.md5sum, s.time) for s in read(tmp_path / "back.bag")] == [
        (s.connection.topic, s.connection.md5sum, s.time) for s in in_order(SAMPLES)]
    convert(tmp_path / "run" / "run.mcap", tmp_path / "copy.mcap", selection=Selection(types=["std_msgs/msg/String"]))
    with open_log(tmp_path / "copy.mcap") as reader:
        assert reader.index.profile == "ros2" and reader.message_count == 1


def test_large_chunks_are_cut_and_small_ones_joined(tmp_path):
    image = connection("/image", "a/Image", "uint8[] data\n")
    big = [Sample(image, START_NS + i, struct.pack("<I", 900000) + bytes([i]) * 900000) for i in range(12)]
    source = tmp_path / "big.bag"
    with BagWriter(source, chunk_size=1 << 30) as writer:
        number = writer.add_channel(image)
        for sample in big:
            writer.add_message(number, sample.time, sample.data)
    convert(source, tmp_path / "big.mcap")
    with open_log(tmp_path / "big.mcap") as reader:
        assert len(reader.chunks) == 3
    assert read(tmp_path / "big.mcap") == big
    convert(write(tmp_path / "small.bag", SAMPLES, chunk_size=200), tmp_path / "small.mcap")
    with open_log(tmp_path / "small.mcap") as reader, open_log(tmp_path / "small.bag") as before:
        assert len(reader.chunks) < len(before.chunks) / 20
    assert read(tmp_path / "small.mcap") == in_order(SAMPLES)


def folder_of_logs(tmp_path):
    folder = tmp_path / "logs"
    (folder / "deep").mkdir(parents=True)
    write(folder / "a.bag", SAMPLES)
    write(folder / "deep" / "b.bag", SAMPLES[:10])
    (folder / "broken.bag").write_bytes(b"#ROSBAG V2.0\nrubbish")
    return folder


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_folder_is_converted_and_a_failed_file_stops_nothing(tmp_path, jobs, capfd):
    folder = folder_of_logs(tmp_path)
    assert main(["convert", str(folder), "-o", str(tmp_path / "out"), "--jobs", jobs, "--json"]) == 1
    out, err = capfd.readouterr()
    document = json.loads(out)
    assert document["failed"] == 1 and len(document["files"]) == 3
    assert "broken.bag" in err and "Traceback" not in err and "1 of 3 files failed" in err
    assert read(tmp_path / "out" / "a.mcap") == in_order(SAMPLES)
    assert read(tmp_path / "out" / "deep" / "b.mcap") == in_order(SAMPLES[:10])
    assert not (tmp_path / "out" / "broken.mcap").exists()


def test_a_killed_process_is_a_failed_file(tmp_path):
    outcomes = []
    run_tasks(kill_own_process, [task_of(Job("a.bag", "a.mcap"))], Processes(1), outcomes.append)
    assert [(o.status, o.reason) for o in outcomes] == [("failed", "a.bag: its process was killed")]


def kill_own_process(task):
    os._exit(9)


def test_a_folder_without_logs_is_an_error(tmp_path, capsys):
    assert main(["convert", str(tmp_path)]) == 1
    assert "holds no .bag file" in capsys.readouterr().err
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    assert main(["convert", str(tmp_path)]) == 1
    assert "rosbag2 folder" in capsys.readouterr().err


def test_progress_is_told(tmp_path):
    source = write(tmp_path / "log.bag", state_log(4.0))
    told = []
    convert_file(Job(str(source), str(tmp_path / "log.mcap")), lambda size, count: told.append((size, count)))
    assert sum(count for _, count in told) == 1501 and 0.8 < sum(size for size, _ in told) / source.stat().st_size <= 1


def test_an_interrupted_conversion_leaves_nothing(tmp_path):
    source = write(tmp_path / "log.bag", [model(START_NS + i, "x" * 500) for i in range(40000)], chunk_size=1 << 16)
    code = ("import os, signal, sys; sys.path.insert(0, %r)\n"
            "from jaka_bag.operations import convert\n"
            "from jaka_bag.cli.main import main\n"
            "real = convert.LossNotes.look\n"
            "def look(self, block):\n"
            "    convert.LossNotes.look = real\n"
            "    os.kill(os.getpid(), signal.%s)\n"
            "    return real(self, block)\n"
            "convert.LossNotes.look = look\n"
            "sys.exit(main(['convert', %r, '-o', %r]))")
    for name in ("SIGINT", "SIGTERM"):
        done = subprocess.run([sys.executable, "-c", code % (os.getcwd(), name, str(source), str(tmp_path / "o.mcap"))],
                              stderr=subprocess.PIPE)
        assert done.returncode == 1
        assert done.stderr.decode() == "jaka_bag: interrupted, no half file is left\n"
        assert os.listdir(str(tmp_path)) == ["log.bag"]


def test_a_second_interruption_does_not_disturb_the_end_that_the_first_began(tmp_path):
    source = write(tmp_path / "log.bag", [model(START_NS + i, "x" * 500) for i in range(4000)], chunk_size=1 << 16)
    code = ("import os, pathlib, signal, sys; sys.path.insert(0, %r)\n"
            "from jaka_bag.operations import convert\n"
            "from jaka_bag.cli.main import main\n"
            "def interrupted(function):\n"
            "    def interrupt(*args, **kwargs):\n"
            "        os.kill(os.getpid(), signal.%s)\n"
            "        return function(*args, **kwargs)\n"
            "    return interrupt\n"
            "convert.LossNotes.look = interrupted(convert.LossNotes.look)\n"
            "for name in ('unlink', 'remove'):\n"
            "    setattr(os, name, interrupted(getattr(os, name)))\n"
            "sys.exit(main(['convert', %r, '-o', %r]))")
    for name in ("SIGINT", "SIGTERM"):
        done = subprocess.run([sys.executable, "-c", code % (os.getcwd(), name, str(source), str(tmp_path / "o.mcap"))],
                              stderr=subprocess.PIPE)
        assert done.stderr.decode() == "jaka_bag: interrupted, no half file is left\n"
        assert done.returncode == 1 and os.listdir(str(tmp_path)) == ["log.bag"]


@pytest.mark.parametrize("function, left", [("open", {"log.bag"}), ("replace", {"log.bag", "o.mcap"})])
def test_an_interruption_beside_the_creation_or_the_naming_of_the_output_leaves_no_half_file(tmp_path, function, left):
    source = write(tmp_path / "log.bag", SAMPLES)
    code = ("import os, signal, sys; sys.path.insert(0, %r)\n"
            "from jaka_bag.cli.main import main\n"
            "real = os.%s\n"
            "def interrupted(path, *args):\n"
            "    result = real(path, *args) if %r else None\n"
            "    if str(path).endswith('.part'):\n"
            "        os.kill(os.getpid(), signal.%s)\n"
            "    return real(path, *args) if result is None else result\n"
            "os.%s = interrupted\n"
            "sys.exit(main(['convert', %r, '-o', %r, '--force']))")
    for name in ("SIGINT", "SIGTERM"):
        done = subprocess.run([sys.executable, "-c", code % (os.getcwd(), function, function == "open", name, function,
                                                             str(source), str(tmp_path / "o.mcap"))],
                              stderr=subprocess.PIPE)
        assert done.stderr.decode() == "jaka_bag: interrupted, no half file is left\n" and done.returncode == 1
        assert set(os.listdir(str(tmp_path))) == left


@pytest.mark.parametrize("module, owner, function, left", [
    ("pathlib", "Path", "mkdir", {"log.bag"}), ("os", "", "rename", {"log.bag", "run"})])
def test_an_interruption_beside_the_creation_or_the_naming_of_a_rosbag2_folder_leaves_no_half_one(
        tmp_path, module, owner, function, left):
    source = write(tmp_path / "log.bag", SAMPLES)
    code = ("import os, signal, sys, %s; sys.path.insert(0, %r)\n"
            "from jaka_bag.cli.main import main\n"
            "owner = %s\n"
            "real = owner.%s\n"
            "def interrupted(path, *args, **kwargs):\n"
            "    result = real(path, *args, **kwargs)\n"
            "    if str(path).endswith('.part'):\n"
            "        os.kill(os.getpid(), signal.%s)\n"
            "    return result\n"
            "owner.%s = interrupted\n"
            "sys.exit(main(['convert', %r, '-o', %r, '--profile', 'ros2', '--force', '-q']))")
    for name in ("SIGINT", "SIGTERM"):
        done = subprocess.run([sys.executable, "-c", code % (
            module, os.getcwd(), ".".join(filter(None, (module, owner))), function, name, function, str(source),
            str(tmp_path / "run"))], stderr=subprocess.PIPE)
        assert done.stderr.decode() == "jaka_bag: interrupted, no half file is left\n" and done.returncode == 1
        assert set(os.listdir(str(tmp_path))) == left


def test_a_rosbag2_folder_that_another_program_writes_is_left_alone(tmp_path):
    with Rosbag2Writer(tmp_path / "run") as writer:
        with pytest.raises(OutputExists, match="is being written by another process"):
            Rosbag2Writer(tmp_path / "run")
        for sample in SAMPLES:
            writer.add_message(writer.add_channel(sample.connection), sample.time, sample.data)
    assert os.listdir(str(tmp_path)) == ["run"]


@pytest.mark.parametrize("again", [False, True])
def test_an_interrupted_folder_leaves_whole_files_only(tmp_path, again):
    """Press Ctrl-C once, or ``again`` while the workers are being ended."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for i in range(6):
        write(folder / ("%d.bag" % i), SAMPLES)
    code = ("import os, signal, sys; sys.path.insert(0, %r)\n"
            "from jaka_bag.operations import convert\n"
            "from jaka_bag.cli.main import main\n"
            "real = convert.LossNotes.look\n"
            "def look(self, block):\n"
            "    os.killpg(os.getpgid(0), signal.SIGINT)\n"
            "    signal.pause()\n"
            "convert.LossNotes.look = look\n"
            "from multiprocessing.process import BaseProcess\n"
            "terminate = BaseProcess.terminate\n"
            "def terminated(process):\n"
            "    if %r:\n"
            "        os.kill(os.getpid(), signal.SIGINT)\n"
            "    terminate(process)\n"
            "BaseProcess.terminate = terminated\n"
            "sys.exit(main(['convert', %r, '--jobs', '2']))")
    done = subprocess.run([sys.executable, "-c", code % (os.getcwd(), again, str(folder))], stderr=subprocess.PIPE,
                          start_new_session=True, timeout=120)
    assert done.returncode == 1
    assert done.stderr.decode() == "jaka_bag: interrupted, no half file is left\n"
    assert sorted(os.listdir(str(folder))) == ["%d.bag" % i for i in range(6)]


def test_a_definition_with_a_header_in_it_keeps_its_text(tmp_path):
    kind = connection("/h", "a/B", "Header header\n" + HEADER)
    sample = Sample(kind, START_NS, bytes(16))
    convert(write(tmp_path / "a.bag", [sample]), tmp_path / "b.mcap")
    assert read(tmp_path / "b.mcap") == [sample]


def test_chunks_that_overlap_in_time_are_cut_anew(tmp_path):
    import random
    samples = [Sample(STATES, START_NS + (i * 7919) % 4001 * 1000, struct.pack("<4h", i % 1000, 0, 0, 0))
               for i in range(4001)]
    tangled = write(tmp_path / "tangled.bag", samples, "none", chunk_size=2000)
    assert convert_file(Job(str(tangled), str(tmp_path / "sorted.bag"), compression="bz2")).messages == 4001
    assert read(tmp_path / "sorted.bag") == in_order(samples)
    with open_log(tmp_path / "sorted.bag") as reader:
        assert all(a.end_time <= b.start_time for a, b in zip(reader.chunks, reader.chunks[1:]))
        assert sum(len(reader.load(chunk)) for chunk in reader.chunks) == 4001
    few = [sample for sample in samples if sample.time < START_NS + 500 * 1000]
    random.Random(1).shuffle(few)
    straight = write(tmp_path / "straight.bag", in_order(few), "none", chunk_size=200)
    with open_log(straight) as reader:
        assert not is_worth_sorting(reader.chunks, 1.0)
    with open_log(tangled) as reader:
        assert is_worth_sorting(reader.chunks, 1.0) and not is_worth_sorting(reader.chunks, 1e6)
