"""One bad topic costs that topic: a note and exit code 1, and the others whole."""
import json

import pytest
from log_samples import JOINTS, START_NS, STATES, Sample, connection, in_order, read, state_log, write
from mcap.writer import Writer

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import open_log

BROKEN = connection("/broken", "test_msgs/Known", "uint8 v\n")._replace(definition="test_msgs/Missing inner\n")
SAMPLES = state_log(0.5)
BAD = {"its definition": [Sample(BROKEN, START_NS, b"\1")],
       "its last message": [Sample(STATES._replace(topic="/broken"), START_NS + i, bytes(8 + i // 9))
                            for i in range(10)]}
"""Messages of a topic that is not understood, by what is wrong with it."""


@pytest.fixture(params=list(BAD))
def log(request, tmp_path):
    return write(tmp_path / "logs" / "log.bag", in_order(SAMPLES + BAD[request.param]))


@pytest.fixture(autouse=True)
def folder_of_logs(tmp_path):
    (tmp_path / "logs").mkdir()


def counts(path):
    with open_log(path) as reader:
        found = {}
        for each, count in zip(reader.connections, reader.index.counts):
            found[each.topic] = found.get(each.topic, 0) + count
        return found


GOOD = {topic: sum(one.connection.topic == topic for one in SAMPLES) for topic in {s.connection.topic for s in SAMPLES}}


@pytest.mark.parametrize("words", [["log.bag"], ["."]], ids=["one log", "a folder of logs"])
def test_a_rosbag2_folder_is_made_without_it(tmp_path, log, monkeypatch, capsys, words):
    monkeypatch.chdir(log.parent)
    assert main(["convert", *words, "--profile", "ros2"]) == 1
    told = capsys.readouterr()
    assert told.err.count("/broken is left out: ") == 1 and "error" not in told.err
    assert counts(log.with_suffix("")) == GOOD
    assert sorted(path.name for path in log.parent.iterdir()) == ["log", "log.bag"]


def test_it_is_told_in_json_and_refused_where_nothing_else_is_left(tmp_path, log, capsys):
    words = ["convert", str(log), "--profile", "ros2", "-o"]
    assert main([*words, str(tmp_path / "all"), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["left_out"] == 1
    assert main([*words, str(tmp_path / "some"), "-x", "/broken"]) == 0
    assert main([*words, str(tmp_path / "none"), "-t", "/broken"]) == 1
    assert "left out" not in capsys.readouterr().err and not (tmp_path / "none").exists()


def foreign(path):
    """Write an MCAP of ROS 2 with a topic that ROS 1 can have and one that it cannot."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="foreign")
        for topic, kind, text, data in (("/wide", "pkg/msg/T", "wstring wide\n", b"\1\0\0\0a\0\0\0"),
                                        ("/n", "pkg/msg/N", "int32 n\n", b"\5\0\0\0"),
                                        ("/long", "pkg/msg/L", "int32 n\n", b"\5")):
            channel = writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", text.encode()))
            writer.add_message(channel, START_NS, b"\0\1\0\0" + data, START_NS)
        writer.finish()
    return path


@pytest.mark.parametrize("command", ["convert", "filter"])
def test_a_lone_mcap_of_ros2_becomes_a_bag_without_it(tmp_path, capsys, command):
    path = foreign(tmp_path / "lone.mcap")
    assert main([command, str(path), str(tmp_path / "out.bag")]) == 1
    told = capsys.readouterr().err
    assert "note: /wide is left out: /wide (pkg/msg/T): pkg/msg/T has no ROS 1 form" in told
    assert "note: /long is left out: " in told
    assert [(s.connection.topic, s.data) for s in read(tmp_path / "out.bag")] == [("/n", b"\5\0\0\0")]
    assert main([command, str(path), str(tmp_path / "none.bag"), "-t", "/wide"]) == 1
    assert "has no ROS 1 form" in capsys.readouterr().err and not (tmp_path / "none.bag").exists()


@pytest.mark.parametrize("words", [["merge", "IN", "-o"], ["split", "IN", "--count", "1", "-o"],
                                   ["recover", "IN", "-o"]])
def test_commands_that_decode_nothing_hint_at_convert(tmp_path, capsys, words):
    path = foreign(tmp_path / "lone.mcap")
    assert main([*(str(path) if word == "IN" else word for word in words), str(tmp_path / "out.bag")]) == 1
    assert "a .bag holds ROS 1 messages only (jaka_bag convert" in capsys.readouterr().err


def test_a_plot_is_drawn_without_it(tmp_path, capsys):
    twice = [Sample(JOINTS._replace(topic="/broken"), START_NS, b"\1")]
    path = write(tmp_path / "log.bag", in_order(SAMPLES + twice))
    assert main(["plot", str(path), str(tmp_path / "log.svg")]) == 1
    assert "note: /broken is left out: " in capsys.readouterr().err and (tmp_path / "log.svg").exists()
    assert main(["plot", str(path), str(tmp_path / "some.svg"), "-x", "/broken"]) == 0


def test_a_data_set_has_the_others(tmp_path, log, capsys):
    pytest.importorskip("pyarrow")
    assert main(["dataset", "add", str(log), "--to", str(tmp_path / "set"), "--cell", "a"]) == 1
    assert "/broken is left out: " in capsys.readouterr().err
    assert len(list((tmp_path / "set").glob("topic=*"))) == len(GOOD)
