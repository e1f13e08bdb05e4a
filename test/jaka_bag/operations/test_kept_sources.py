"""Sources stay as they are, also where the name is the one that the output has while it is written."""
import os
import shutil

import pytest
from log_samples import in_order, read, state_log, write

from jaka_bag.cli.main import main
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.rosbag2 import Rosbag2Writer
from jaka_bag.operations.recover import recover
from jaka_bag.operations.split import SplitLimits, split
from jaka_bag.output_file import OutputFile

SAMPLES = state_log(1.0)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
@pytest.mark.parametrize("words", [
    ["recover", "{0}"], ["convert", "{0}", "-o", "{1}"], ["filter", "{0}", "{1}", "--topics", "/none", "{topic}"],
    ["merge", "{0}", "{other}", "-o", "{1}"], ["merge", "{other}", "{0}", "-o", "{1}"]],
    ids=["recover", "convert", "filter", "merge", "merge as second"])
def test_a_source_that_has_the_working_name_of_the_output_is_kept(tmp_path, suffix, words):
    source = write(tmp_path / ("r" + suffix), SAMPLES)
    source = source.rename(tmp_path / ("r%s.part" % suffix))
    other = write(tmp_path / "other.mcap", SAMPLES[:1])
    before = source.read_bytes()
    assert main([word.format(source, tmp_path / ("r" + suffix), other=other, topic=SAMPLES[-1].connection.topic)
                 for word in words]) == 0
    assert source.read_bytes() == before
    assert read(tmp_path / ("r" + suffix))[-1] == in_order(SAMPLES)[-1]
    assert sorted(os.listdir(str(tmp_path))) == sorted(["other.mcap", source.name, "r" + suffix])


def test_a_part_is_no_place_for_a_source(tmp_path):
    source = write(tmp_path / "r_0.bag", SAMPLES).rename(tmp_path / "r_0.bag.part")
    before = source.read_bytes()
    parts = split(source, tmp_path / "r.bag", SplitLimits(messages=100)).parts
    assert sum((read(path) for path, _ in parts), []) == in_order(SAMPLES) and source.read_bytes() == before


def test_an_attached_file_is_kept(tmp_path):
    source = write(tmp_path / "r.mcap", SAMPLES)
    notes = tmp_path / "o.mcap.part"
    notes.write_bytes(b"notes")
    assert main(["attach", str(source), str(notes), "-o", str(tmp_path / "o.mcap")]) == 0
    assert notes.read_bytes() == b"notes" and read(tmp_path / "o.mcap") == in_order(SAMPLES)


@pytest.mark.parametrize("link", [os.link, os.symlink])
def test_a_link_to_the_source_is_no_working_file(tmp_path, link):
    source = write(tmp_path / "r.bag", SAMPLES)
    before = source.read_bytes()
    link(str(source), str(tmp_path / "o.bag.part"))
    assert main(["convert", str(source), "-o", str(tmp_path / "o.bag")]) == 0
    assert source.read_bytes() == before and read(tmp_path / "o.bag") == in_order(SAMPLES)
    assert not (tmp_path / "o.bag").is_symlink()


def test_a_link_is_nobodys_leftover(tmp_path):
    (tmp_path / "precious").write_bytes(b"precious")
    (tmp_path / "log.part").symlink_to("precious")
    with OutputFile(tmp_path / "log") as output:
        output.write(b"content")
    assert (tmp_path / "precious").read_bytes() == b"precious" and (tmp_path / "log").read_bytes() == b"content"


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("act", [
    lambda source, target: main(["convert", str(source / (source.stem + ".mcap")), "-o", str(target),
                                 "--profile", "ros2"]),
    lambda source, target: recover(source, target)], ids=["convert", "recover"])
def test_a_source_that_is_the_working_folder_of_the_output_is_kept(tmp_path, act):
    with Rosbag2Writer(tmp_path / "run") as writer:
        for sample in SAMPLES:
            writer.add_message(writer.add_channel(sample.connection), sample.time, sample.data)
    source = (tmp_path / "run").rename(tmp_path / "run.part")
    before = contents(source)
    act(source, tmp_path / "run")
    assert contents(source) == before and set(contents(tmp_path / "run")) == set(before)
    assert sorted(os.listdir(str(tmp_path))) == ["run", "run.part"]


def test_a_folder_that_is_no_leftover_of_ours_is_left_alone(tmp_path):
    source = write(tmp_path / "good.bag", SAMPLES)
    (tmp_path / "run.part").mkdir()
    (tmp_path / "run.part" / "notes.txt").write_text("precious")
    assert main(["convert", str(source), "-o", str(tmp_path / "run"), "--profile", "ros2"]) == 0
    assert contents(tmp_path / "run.part") == {"notes.txt": b"precious"}
    assert sorted(contents(tmp_path / "run")) == ["metadata.yaml", "run.mcap"]


def test_a_folder_left_by_a_killed_program_is_taken_over(tmp_path):
    source = write(tmp_path / "good.bag", SAMPLES)
    (tmp_path / "run.part").mkdir()
    shutil.copy(str(source), str(tmp_path / "run.part" / "run.mcap.part"))
    assert main(["convert", str(source), "-o", str(tmp_path / "run"), "--profile", "ros2"]) == 0
    assert sorted(os.listdir(str(tmp_path))) == ["good.bag", "run"]
    assert sorted(contents(tmp_path / "run")) == ["metadata.yaml", "run.mcap"]


def test_an_output_that_is_the_source_is_refused(tmp_path, capsys):
    with McapWriter(tmp_path / "log.csv.mcap") as writer:
        writer.add_attachment("log.csv", b"attached")
        for sample in SAMPLES:
            writer.add_message(writer.add_channel(sample.connection), sample.time, sample.data)
    log = (tmp_path / "log.csv.mcap").rename(tmp_path / "log.csv")
    before = contents(tmp_path)
    for words in ["extract", log, "-o", tmp_path], ["export", log, "-o", log, "-t", SAMPLES[-1].connection.topic]:
        assert main([*map(str, words), "--force"]) == 1
        assert "is input and output" in capsys.readouterr().err
        assert contents(tmp_path) == before
