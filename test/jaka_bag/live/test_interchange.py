"""Debian's rosbag reads, checks, plays and reindexes what jaka_bag writes, and finds no more than jaka_bag does."""
import importlib
import os
import subprocess

import genpy.dynamic
import pytest
import rosbag
import rospy
from log_samples import JOINTS, MODEL, STATES, TOOL, in_order, read, state_log, write

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import open_log
from jaka_bag.messages.definitions import definition_md5

SAMPLES = state_log(1.0)
CODECS = ["none", "lz4", "bz2"]


def rosbag_program(*words, environment=None):
    done = subprocess.run(["rosbag", *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          env=environment, timeout=120)
    return done.returncode, done.stdout.decode()


@pytest.mark.parametrize("codec", CODECS)
def test_rosbag_reads_what_was_converted_from_mcap(tmp_path, codec):
    source = write(tmp_path / "log.mcap", SAMPLES)
    path = tmp_path / "log.bag"
    assert main(["convert", str(source), "-o", str(path), "-c", codec, "-q"]) == 0
    with rosbag.Bag(str(path)) as bag:
        found = [(topic, raw[0], raw[1], raw[2], time.to_nsec())
                 for topic, raw, time in bag.read_messages(raw=True)]
        headers = {c.topic: (c.header["callerid"], c.header["latching"]) for c in bag._get_connections()}
    assert found == [(s.connection.topic, s.connection.datatype, s.data, s.connection.md5sum, s.time)
                     for s in in_order(SAMPLES)]
    assert headers[MODEL.topic] == (b"/launch", b"1") and headers[TOOL.topic] == (b"/jaka_driver", b"0")
    code, out = rosbag_program("info", path)
    facts = dict(line.split(":", 1) for line in out.splitlines() if line[:1].strip() and ":" in line)
    assert code == 0 and int(facts["messages"]) == len(SAMPLES) and facts["compression"].split()[0] == codec
    assert rosbag_program("check", path)[0] == 0


@pytest.mark.parametrize("codec", CODECS)
def test_rosbag_reindexes_what_lost_its_index(tmp_path, codec):
    path = write(tmp_path / "log.bag", SAMPLES, codec)
    raw = path.read_bytes()
    at = raw.index(b"index_pos=") + 10
    end = int.from_bytes(raw[at:at + 8], "little")
    for cut in (end, end * 3 // 4, end // 2):
        damaged = tmp_path / "damaged.bag"
        damaged.write_bytes((raw[:at] + bytes(8) + raw[at + 8:])[:cut])
        ours = tmp_path / "ours.bag"
        assert main(["recover", str(damaged), str(ours), "-q", "--force"]) in (0, 1)
        assert rosbag_program("reindex", "-f", damaged)[0] == 0
        with open_log(ours) as reader, rosbag.Bag(str(damaged)) as theirs:
            assert reader.message_count >= theirs.get_message_count() > 0


def test_an_empty_bag_that_rosbag_reindexed_is_read(tmp_path, capsys):
    path = tmp_path / "empty.bag"
    with rosbag.Bag(str(path), "w"):
        pass
    assert rosbag_program("reindex", "-f", path)[0] == 0
    for words in (["info"], ["doctor"], ["convert", "-o", str(tmp_path / "out.mcap")],
                  ["recover", "-o", str(tmp_path / "kept.bag")]):
        assert main([words[0], str(path), *words[1:]]) == 0, capsys.readouterr().err
    assert read(tmp_path / "out.mcap") == read(tmp_path / "kept.bag") == []


def test_rosbags_own_bags_go_to_mcap_and_back_unchanged(tmp_path):
    from sensor_msgs.msg import JointState
    from std_msgs.msg import String
    path = tmp_path / "theirs.bag"
    with rosbag.Bag(str(path), "w", chunk_threshold=2000, compression="bz2") as bag:
        for i in range(200):
            message = JointState(name=["a"] * (i % 3), position=[float(i)] * (i % 3))
            message.header.seq = i
            bag.write("/joints", message, rospy.Time(1000 + i // 10, i % 10 * 1000))
            bag.write("/words", String("x" * i), rospy.Time(1000, i))
    assert main(["convert", str(path), "-o", str(tmp_path / "log.mcap"), "-q"]) == 0
    assert main(["convert", str(tmp_path / "log.mcap"), "-o", str(tmp_path / "back.bag"), "-q"]) == 0
    assert read(tmp_path / "back.bag") == read(path)
    with open_log(path) as a, open_log(tmp_path / "back.bag") as b:
        assert a.connections == b.connections
    with rosbag.Bag(str(path)) as a, rosbag.Bag(str(tmp_path / "back.bag")) as b:
        for x, y in zip(a.read_messages(), b.read_messages()):
            assert (x.topic, x.message, x.timestamp) == (y.topic, y.message, y.timestamp)


def test_rosbag_plays_a_converted_bag(tmp_path, graph):
    source = write(tmp_path / "log.mcap", [s for s in SAMPLES if s.connection in (STATES, JOINTS)][:100])
    path = tmp_path / "log.bag"
    assert main(["convert", str(source), "-o", str(path), "-q"]) == 0
    code, out = rosbag_program("play", "--rate", "5", "--quiet", path, environment=dict(os.environ))
    assert code == 0, out


def test_definitions_and_md5_are_those_of_genpy():
    for connection in (TOOL, JOINTS, STATES, MODEL):
        made = genpy.dynamic.generate_dynamic(connection.datatype, connection.definition)[connection.datatype]
        assert made._md5sum == connection.md5sum == definition_md5(connection.datatype, connection.definition)


def test_every_installed_message_has_its_md5():
    packages = ("std_msgs", "geometry_msgs", "sensor_msgs", "nav_msgs", "diagnostic_msgs", "tf2_msgs", "actionlib_msgs",
                "visualization_msgs", "shape_msgs", "trajectory_msgs", "stereo_msgs", "rosgraph_msgs")
    count = 0
    for package in packages:
        try:
            module = importlib.import_module(package + ".msg")
        except ImportError:
            continue
        for name in dir(module):
            kind = getattr(module, name)
            if hasattr(kind, "_md5sum"):
                assert definition_md5(kind._type, kind._full_text) == kind._md5sum, kind._type
                count += 1
    assert count > 60
