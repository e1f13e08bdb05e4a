"""A golden log is replaced by a new one in its own format, once an unchanged run was the same as the new one."""
import os
import shutil
from types import SimpleNamespace

import pytest
from import_graph import ROOT

from jaka_bag.containers.registry import read_index
from jaka_bag.operations.convert import Job, convert_file
from jaka_regression.update import update_golden

LOGS = ROOT / "test" / "data" / "golden"
MAGIC = {"mcap": b"\x89MCAP0\r\n", "bag": b"#ROSBAG V2.0\n"}


@pytest.fixture
def candidate(tmp_path):
    shutil.copy(str(LOGS / "boot.mcap"), str(tmp_path / "candidate.mcap"))
    return tmp_path / "candidate.mcap"


@pytest.fixture(params=["mcap", "bag"])
def golden(request, tmp_path):
    path = tmp_path / ("golden." + request.param)
    convert_file(Job(str(LOGS / "io_sequence.mcap"), str(path)))
    return path


def test_the_new_log_is_replayed_and_then_takes_the_golden_ones_place(golden, candidate, tmp_path):
    replayed = []

    def again(new, folder):
        replayed.append((new.name, sum(read_index(new).counts), golden.read_bytes() == before))
        return SimpleNamespace(same=True, summary="")

    before = golden.read_bytes()
    said = update_golden(golden, candidate, tmp_path / "update", again)
    count = sum(read_index(candidate).counts)
    assert said == "%s is the new log: an unchanged run is the same" % golden
    assert replayed == [(golden.name, count, True)] and sum(read_index(golden).counts) == count
    assert golden.read_bytes().startswith(MAGIC[golden.suffix[1:]])


def test_where_an_unchanged_run_differs_the_golden_log_stays(golden, candidate, tmp_path):
    before = golden.read_bytes()
    said = update_golden(golden, candidate, tmp_path / "update",
                         lambda new, folder: SimpleNamespace(same=False, summary="the arm is late"))
    assert said == "%s stays as it was: an unchanged run differs from the new log\nthe arm is late" % golden
    assert golden.read_bytes() == before


def test_a_run_that_fails_leaves_the_golden_log(golden, candidate, tmp_path):
    def again(new, folder):
        raise OSError("no driver")

    before = golden.read_bytes()
    with pytest.raises(OSError, match="no driver"):
        update_golden(golden, candidate, tmp_path / "update", again)
    assert golden.read_bytes() == before


def test_a_golden_log_behind_a_link_is_replaced_where_it_lies(golden, candidate, tmp_path):
    (tmp_path / "tests").mkdir()
    link = tmp_path / "tests" / golden.name
    link.symlink_to(golden)
    update_golden(link, candidate, tmp_path / "update", lambda new, folder: SimpleNamespace(same=True, summary=""))
    assert link.is_symlink() and sum(read_index(golden).counts) == sum(read_index(candidate).counts)


def test_the_new_log_is_on_the_disk_before_it_takes_the_golden_ones_place(golden, candidate, tmp_path, monkeypatch):
    done = []
    for name, call in (("fsync", os.fsync), ("replace", os.replace)):
        monkeypatch.setattr("jaka_regression.update.os." + name, lambda *words, name=name, call=call: (
            done.append(name), call(*words)))
    update_golden(golden, candidate, tmp_path / "update", lambda new, folder: SimpleNamespace(same=True, summary=""))
    assert done[-2:] == ["fsync", "replace"]


def test_a_golden_log_may_be_called_as_what_a_replay_records(candidate, tmp_path):
    golden = tmp_path / "cell" / "candidate.mcap"
    golden.parent.mkdir()
    shutil.copy(str(LOGS / "io_sequence.mcap"), str(golden))
    (golden.parent / "candidate.mcap.new").write_text("of the user")

    def again(new, folder):
        (folder / "candidate.mcap").write_bytes(b"what the second run recorded")
        return SimpleNamespace(same=True, summary=str(sum(read_index(new).counts)))

    update_golden(golden, candidate, tmp_path / "update", again)
    assert golden.read_bytes() == candidate.read_bytes()
    assert (golden.parent / "candidate.mcap.new").read_text() == "of the user"
