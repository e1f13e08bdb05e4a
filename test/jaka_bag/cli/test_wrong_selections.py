"""Selections that match nothing in the log: an error with the nearest name or the true range, and no success."""
import os
import subprocess

import pytest
from command_places import command_of
from log_samples import JOINTS, MODEL, STATES, in_order, read, state_log, states, write

from jaka_bag import __version__
from jaka_bag.cli.main import main
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.messages.connection import Connection

SAMPLES = state_log(2.0)


@pytest.fixture
def log(tmp_path):
    return write(tmp_path / "run.mcap", SAMPLES)


def said(capsys):
    out, err = capsys.readouterr()
    assert not out and err.count("\n") == 1 and err.startswith("jaka_bag"), err
    return err


@pytest.mark.parametrize("options, words", [
    (["-t", "/nosuch"], ["no topic /nosuch"]),
    (["-t", "jaka_driver/joint_position"], ["no topic jaka_driver/joint_position",
                                            "mean /jaka_driver/joint_position?"]),
    (["-t", "/jaka_driver/joint_positions"], ["did you mean /jaka_driver/joint_position?"]),
    (["-e", "/jaka_drivr/joint.*"], ["no topic whose whole name matches '/jaka_drivr/joint.*'"]),
    (["--types", "RobotMsg"], ["no type RobotMsg", "did you mean jaka_msgs/RobotMsg?"]),
    (["-x", ".*"], ["none of its topics is selected", "/model"]),
    (["-s", "1:00"], ["starts behind the log's end", "the log is from 1700000000.000000000 to 17"]),
    (["--until", "1600000000"], ["ends before the log's start"]),
    (["-s", "@42.5", "--until", "@41"], ["is before its start"]),
    (["-t", "/model", "-s", "1"], ["no message is selected"])], ids=" ".join)
@pytest.mark.parametrize("command", ["filter", "convert"])
def test_an_output_that_would_be_empty_by_mistake_is_refused(log, tmp_path, capsys, command, options, words):
    assert main([command, str(log), str(tmp_path / "o.bag"), *options]) == 2
    text = said(capsys)
    assert all(word in text for word in words), text
    assert os.listdir(str(tmp_path)) == ["run.mcap"]


@pytest.mark.parametrize("words", [["export", "o.csv"], ["plot", "o.svg"]], ids=" ".join)
def test_exports_and_pictures_of_nothing_are_refused(log, tmp_path, capsys, words):
    assert main([words[0], str(log), str(tmp_path / words[1]), "-t", "joint_position"]) == 2
    assert "did you mean /jaka_driver/joint_position?" in said(capsys)
    assert os.listdir(str(tmp_path)) == ["run.mcap"]


def test_a_part_of_a_selection_that_is_missing_is_noted(log, tmp_path, capsys):
    assert main(["filter", str(log), str(tmp_path / "o.mcap"), "-t", MODEL.topic, "/nosuch"]) == 0
    assert "note: %s has no topic /nosuch" % log in capsys.readouterr().err
    assert [sample.connection for sample in read(tmp_path / "o.mcap")] == [MODEL]


def test_a_log_without_messages_is_no_mistake(tmp_path):
    write(tmp_path / "none.bag", [])
    assert main(["convert", str(tmp_path / "none.bag"), str(tmp_path / "none.mcap"), "-s", "5", "-q"]) == 0


@pytest.mark.parametrize("words", [
    ["filter", "-t", JOINTS.topic, STATES.topic, "run.mcap", "-o", "o.mcap"],
    ["filter", "run.mcap", "o.mcap", "-t", JOINTS.topic, STATES.topic],
    ["convert", "-t", JOINTS.topic, STATES.topic, "run.mcap", "o.mcap"],
    ["filter", "-o", "o.mcap", "--types", "sensor_msgs/JointState", "jaka_msgs/RobotMsg", "run.mcap"]], ids=" ".join)
def test_a_list_of_topics_does_not_swallow_files(log, monkeypatch, words):
    monkeypatch.chdir(log.parent)
    assert main([*words, "-q"]) == 0
    assert {sample.connection for sample in read(log.parent / "o.mcap")} == {JOINTS, STATES}


def test_times_of_simulated_time_are_given_as_info_prints_them(tmp_path, capsys):
    path = write(tmp_path / "sim.bag", [states(i * 10**9, i, 0, 0, 0) for i in range(5000, 5100)])
    assert main(["info", str(path)]) == 0
    assert "(5000.000000000)" in capsys.readouterr().out
    for i, start in enumerate(("5090.000000000", "(5090.000000000)", "@5090", "1:30", "-9")):
        assert main(["filter", str(path), str(tmp_path / ("%d.bag" % i)), "-s", start, "-q"]) == 0
        assert len(read(tmp_path / ("%d.bag" % i))) == 10
    assert main(["filter", str(path), str(tmp_path / "o.bag"), "-s", "5090"]) == 2  # an offset, from 1e8 on absolute
    assert "the log is from 5000.000000000 to 5099.000000000 (99.000 s)" in said(capsys)


def test_letters_that_mean_something_else_in_other_commands_are_refused(log, tmp_path, capsys):
    for words in (["filter", str(log), str(tmp_path / "a.bag"), "-u", "1"],
                  ["filter", str(log), str(tmp_path / "a.bag"), "-d", "0.5s"],
                  ["compare", str(log), str(log), "-t", "tolerances.yaml"],
                  ["compare", str(log), str(log), "--json", str(tmp_path / "a.json")]):
        assert main(words) == 2
        assert "unrecognized arguments" in capsys.readouterr().err
    assert not list(tmp_path.glob("a.*"))


def test_compare_prints_json_wherever_the_option_stands(log, tmp_path, capsys):
    paths = [str(log), str(log)]
    for words in ([*paths, "--json"], ["--json", *paths]):
        assert main(["compare", *words]) == 0
        assert capsys.readouterr().out.startswith("{")
    assert main(["compare", *paths, "--report", str(tmp_path / "b.json"), "-q"]) == 0
    assert (tmp_path / "b.json").read_text().startswith("{")


def test_two_outputs_or_none_are_refused(log, tmp_path, capsys):
    assert main(["filter", str(log), "a.bag", "-o", "b.bag"]) == 2
    assert "two outputs" in said(capsys)
    assert main(["filter", str(log)]) == 2
    assert "an output is needed" in said(capsys)


def test_an_error_of_one_file_does_not_hide_the_others(log, tmp_path, capsys):
    (tmp_path / "text.bag").write_text("hello")
    words = [str(tmp_path / "text.bag"), str(log), str(tmp_path / "missing.bag")]
    for options in ([], ["--freq"], ["-k", "messages"]):
        assert main(["info", *words, *options]) == 1
        out, err = capsys.readouterr()
        assert str(len(SAMPLES)) in out and "text.bag" in err and "missing.bag" in err
    assert main(["merge", *words, "-o", str(tmp_path / "o.bag")]) == 1
    text = said(capsys)
    assert "text.bag" in text and "missing.bag" in text


def test_a_split_in_fewer_parts_leaves_none_of_the_former(log, tmp_path, capsys):
    assert main(["split", str(log), "--count", "100", "-q"]) == 0
    assert main(["split", str(log), "--count", "500"]) == 1  # the parts of before are there
    (tmp_path / "run_40.mcap").write_bytes(log.read_bytes())
    capsys.readouterr()
    assert main(["split", str(log), "--count", "500", "--force", "-q"]) == 0
    assert "run_40.mcap is no part of this split" in capsys.readouterr().err
    (tmp_path / "run_40.mcap").unlink()
    parts = sorted(str(path) for path in tmp_path.glob("run_*.mcap"))
    assert len(parts) == 2
    assert main(["merge", *parts, "-o", str(tmp_path / "all.mcap"), "-q"]) == 0
    assert read(tmp_path / "all.mcap") == in_order(SAMPLES)


def test_a_format_that_contradicts_the_name_is_refused(capsys):
    assert main(["record", "-a", "--format", "bag", "-O", "k.mcap"]) == 2
    assert "--format bag contradicts -O k.mcap" in said(capsys)


@pytest.mark.parametrize("name, word", [("compress", "convert"), ("reindex", "recover"), ("check", "doctor"),
                                        ("diff", "compare"), ("decompress", "-c none")])
def test_commands_of_other_tools_lead_somewhere(name, word, capsys):
    assert main([name, "run.bag"]) == 2
    text = capsys.readouterr().err
    assert "no command %r: " % name in text and word in text


def test_the_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("jaka_bag 0.")


def test_what_cannot_be_made_is_said_without_the_definition(tmp_path, capsys):
    for encoding, schema, why in (("json", "jsonschema", "the JSON Schema of Kind cannot be read"),
                                  ("protobuf", "protobuf", "the descriptors of Kind cannot be read"),
                                  ("cbor", "cddl", "messages encoded as cbor, described by cddl, cannot be decoded")):
        with McapWriter(tmp_path / (encoding + ".mcap"), profile="") as writer:
            channel = writer.add_channel(Connection("/x", "Kind", definition="{}" * 1000, encoding=encoding,
                                                    schema_encoding=schema))
            writer.add_message(channel, 5, b"{}")
        assert main(["convert", str(tmp_path / (encoding + ".mcap")), str(tmp_path / "o"), "--profile", "ros2"]) == 1
        text = said(capsys)
        assert "/x (Kind): %s" % why in text
        assert len(text) < 300


@pytest.mark.parametrize("words", [["export", "none.bag", "o.csv"], ["plot", "none.bag", "o.svg"],
                                   ["compare", "none.bag", "none.bag"]], ids=" ".join)
def test_a_log_without_messages_is_named_as_such(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "none.bag", [])
    assert main(words) in (1, 2)
    assert "none.bag has no messages" in said(capsys)


def test_programs_end_with_the_codes_that_are_told(log, root, tmp_path):
    def code(*words):
        done = subprocess.run([*command_of("jaka_bag"), *map(str, words)], cwd=str(root),
                              capture_output=True)
        assert b"Traceback" not in done.stderr
        return done.returncode, done.stdout, done.stderr

    assert code("filter", "-t", "/nosuch", log, tmp_path / "o.bag")[0] == 2
    status, out, err = code("cat", log, tmp_path / "missing.bag", "--types", MODEL.datatype)
    assert status == 1 and out.count(b"\n") == 1 and b"missing.bag" in err
    assert code("reindex", log)[0] == 2 and code("--version")[:2] == (0, b"jaka_bag %s\n" % __version__.encode())


def test_what_cannot_be_read_is_named_for_what_it_is(tmp_path, capsys):
    folder = tmp_path / "talk"
    folder.mkdir()
    (folder / "talk_0.db3").write_bytes(b"SQLite format 3\0")
    assert main(["info", str(folder)]) == 1
    assert "without its metadata.yaml (jaka_bag recover makes one that has it)" in capsys.readouterr().err
    log = write(tmp_path / "log.mcap", SAMPLES, "zstd")
    raw = log.read_bytes().replace(b"\x04\0\0\0zstd", b"\x04\0\0\0zstx")
    (tmp_path / "odd.mcap").write_bytes(raw[:-12] + bytes(4) + raw[-8:])  # without the summary's CRC
    assert main(["cat", str(tmp_path / "odd.mcap")]) == 1
    told = capsys.readouterr().err
    assert "the compression 'zstx' is not supported; the log is not damaged" in told and "recover" not in told
    os.symlink("loop.html", str(tmp_path / "loop.html"))
    assert main(["compare", str(log), str(log), "--html", str(tmp_path / "loop.html")]) == 2
    assert main(["report", str(log), "-o", str(tmp_path / "loop.html")]) in (1, 2)
    assert "Traceback" not in capsys.readouterr().err
