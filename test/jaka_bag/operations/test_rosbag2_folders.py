"""Conversion of rosbag2 folders, with MCAP and sqlite3 storage, to logs of ROS 1 messages."""
import contextlib
import json
import struct
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from log_samples import JOINTS, MODEL, TOOL, in_order, read, state_log, write

from jaka_bag.cli.main import main
from jaka_bag.containers.rosbag2_folder import Rosbag2Folder

SAMPLES = state_log(0.5)


def without_seq(samples):
    """Return samples without header.seq, which ROS 2 lacks."""
    return [(s.connection.topic, s.connection.md5sum, s.time,
             bytes(4) + s.data[4:] if s.connection in (JOINTS, TOOL) else s.data) for s in samples]


@pytest.fixture
def folder(tmp_path):
    source = write(tmp_path / "source.bag", SAMPLES)
    assert main(["convert", str(source), str(tmp_path / "run"), "--profile", "ros2", "-q"]) == 0
    return tmp_path / "run"


@pytest.fixture
def sqlite_folder(folder):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    if not hasattr(rosbag2, "StoragePlugin"):
        pytest.skip("this rosbags writes no sqlite3 of these types")
    with rosbag2.Reader(folder) as reader, rosbag2.Writer(
            folder.parent / "sql", version=9, storage_plugin=rosbag2.StoragePlugin.SQLITE3) as writer:
        new = {c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, rihs01=c.digest,
                                           offered_qos_profiles=c.ext.offered_qos_profiles)
               for c in reader.connections}
        for connection, log_time, raw in reader.messages():
            writer.write(new[connection.id], log_time, raw)
    return folder.parent / "sql"


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_a_folder_becomes_a_log(request, storage, suffix, tmp_path, capsys):
    source = request.getfixturevalue("folder" if storage == "mcap" else "sqlite_folder")
    target = tmp_path / ("back" + suffix)
    assert main(["convert", str(source), str(target)]) == 0
    assert "%d messages" % len(SAMPLES) in capsys.readouterr().out
    back = read(target)
    assert without_seq(back) == without_seq(in_order(SAMPLES))
    assert {s.connection.topic for s in back if s.connection.latching} == {MODEL.topic}


def test_a_part_of_a_folder_and_its_default_name(folder, capsys):
    assert main(["convert", str(folder), "-t", MODEL.topic, "-q"]) == 0
    assert [s.connection.topic for s in read(folder.with_suffix(".mcap"))] == [MODEL.topic]
    assert main(["convert", str(folder), "o.bag", "-t", "model"]) == 2
    assert "did you mean /model?" in capsys.readouterr().err
    assert main(["convert", str(folder), "o.bag", "-s", "1:00"]) == 2
    assert main(["convert", str(folder), "--profile", "ros2"]) == 2


def test_info_tells_the_facts_of_a_folder(folder, capsys):
    assert main(["info", str(folder)]) == 0
    out = capsys.readouterr().out
    assert "rosbag2 8, profile ros2, written by mcap" in out and "sensor_msgs/msg/JointState" in out
    assert main(["info", "--json", str(folder)]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["messages"] == len(SAMPLES) and facts["start_ns"] == in_order(SAMPLES)[0].time
    assert main(["info", "--freq", str(folder)]) == 0
    assert "/jaka_driver/joint_position        62 msgs" in capsys.readouterr().out
    assert main(["info", "--seq", str(folder)]) == 2


def test_types_that_ros1_cannot_have_are_left_out(tmp_path, capsys):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    if not hasattr(rosbag2, "StoragePlugin"):
        pytest.skip("this rosbags writes no MCAP")
    with rosbag2.Writer(tmp_path / "run", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        for topic, text, raw in (("/odd", "string<=5 a\n", struct.pack("<I3s", 3, b"ab\0")),
                                 ("/plain", "int32 a\n", struct.pack("<i", 5))):
            kind = writer.add_connection(topic, "pkg/msg/T" + topic[1:], msgdef=text, rihs01="RIHS01_" + "0" * 64)
            writer.write(kind, 10**9, b"\x00\x01\x00\x00" + raw)
    assert main(["convert", str(tmp_path / "run"), str(tmp_path / "o.bag")]) == 1
    assert "note: /odd is left out: pkg/msg/Todd has no ROS 1 form" in capsys.readouterr().err
    assert [(s.connection.datatype, s.data) for s in read(tmp_path / "o.bag")] == [
        ("pkg/Tplain", struct.pack("<i", 5))]
    for words in (["cat"], ["export", "-o", str(tmp_path / "e.csv")], ["merge", "-o", str(tmp_path / "m.bag")],
                  ["split", "-o", str(tmp_path / "s.bag"), "--count", "1"]):
        assert main([words[0], str(tmp_path / "run"), *words[1:]]) == 1
        assert "/odd is left out: pkg/msg/Todd has no ROS 1 form" in capsys.readouterr().err


_ENDLESS = """rosbag2_bagfile_information: {version: 5, storage_identifier: mcap, relative_file_paths: [run.mcap],
  message_count: .inf, duration: {nanoseconds: .inf}, starting_time: {nanoseconds_since_epoch: 1},
  topics_with_message_count: []}"""


@pytest.mark.parametrize("text", ["", "x: 1\n", "rosbag2_bagfile_information: {version: 99}\n", "a: [\n", _ENDLESS,
                                  "a: " + "[" * 3000])
def test_a_damaged_folder_is_one_line(tmp_path, capsys, text):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "metadata.yaml").write_text(text)
    for command in ("info", "convert"):
        assert main([command, str(tmp_path / "run")]) == 1
        err = capsys.readouterr().err
        assert "metadata.yaml cannot be read" in err and err.count("\n") == 1


def test_threads_read_one_at_a_time_as_the_library_needs_it(folder, monkeypatch):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    inside = []

    @contextlib.contextmanager
    def alone():
        inside.append(None)
        time.sleep(2e-4)
        assert len(inside) == 1, "the decompressor of rosbags 0.10 is in use"
        yield
        inside.pop()

    class Reader(rosbag2.Reader):
        def open(self):
            with alone():
                super().open()

        def messages(self, *args, **options):
            for message in super().messages(*args, **options):
                with alone():
                    pass
                yield message

    monkeypatch.setattr(rosbag2, "Reader", Reader)
    with ThreadPoolExecutor(4) as pool:
        first, *others = pool.map(lambda _: list(Rosbag2Folder(folder).messages()), range(4))
    assert len(first) == len(SAMPLES) and others == [first] * 3
