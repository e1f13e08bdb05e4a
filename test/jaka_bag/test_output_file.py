import fcntl
import os

import pytest

from jaka_bag.errors import BagError, OutputExists
from jaka_bag.output_file import OutputFile, OutputFolder, check_output


def test_the_output_appears_when_it_is_whole(tmp_path):
    target = tmp_path / "log"
    with OutputFile(target) as output:
        output.write(b"content")
        assert os.listdir(str(tmp_path)) == ["log.part"]
    assert os.listdir(str(tmp_path)) == ["log"] and target.read_bytes() == b"content"


def test_a_failure_leaves_nothing(tmp_path):
    with pytest.raises(ValueError), OutputFile(tmp_path / "log") as output:
        output.write(b"half")
        raise ValueError
    assert not os.listdir(str(tmp_path))


def test_an_output_closed_by_its_user_is_still_put_in_place(tmp_path):
    with OutputFile(tmp_path / "log") as output:
        output.write(b"content")
        output.file.close()
    assert (tmp_path / "log").read_bytes() == b"content"


def test_an_existing_output_is_kept_unless_asked(tmp_path):
    target = tmp_path / "log"
    target.write_bytes(b"old")
    with pytest.raises(OutputExists, match="--force"):
        OutputFile(target)
    with OutputFile(target, overwrite=True) as output:
        output.write(b"new")
        assert target.read_bytes() == b"old"
    assert target.read_bytes() == b"new"


def test_an_output_that_appears_meanwhile_is_kept(tmp_path):
    target = tmp_path / "log"
    output = OutputFile(target)
    output.write(b"ours")
    target.write_bytes(b"theirs")
    with pytest.raises(OutputExists):
        output.commit()
    assert target.read_bytes() == b"theirs" and output.working_path.read_bytes() == b"ours"


def test_a_working_file_in_use_is_refused_and_a_leftover_is_taken_over(tmp_path):
    first = OutputFile(tmp_path / "log")
    with pytest.raises(OutputExists, match="another process"):
        OutputFile(tmp_path / "log")
    first.file.close()  # as after a kill: the lock is gone, the file is there
    with OutputFile(tmp_path / "log") as second:
        second.write(b"b")
    assert (tmp_path / "log").read_bytes() == b"b"


def test_a_leftover_that_may_be_evidence_is_kept(tmp_path):
    (tmp_path / "log.active").write_bytes(b"evidence")
    with pytest.raises(OutputExists, match="recover"):
        OutputFile(tmp_path / "log", suffix=".active", keep_leftover=True)
    assert (tmp_path / "log.active").read_bytes() == b"evidence"


def test_impossible_places_are_refused_before_any_work(tmp_path):
    with pytest.raises(BagError, match="is a folder"):
        check_output(tmp_path)
    with pytest.raises(BagError, match="there is no folder"):
        check_output(tmp_path / "missing" / "log")


def folder_of(path, text, is_leftover=lambda name: False):
    output = OutputFolder(path, is_leftover)
    (output.working_path / "log").write_text(text)
    return output


@pytest.mark.parametrize("is_there", [False, True])
def test_a_folder_replaces_that_of_its_name_and_no_other(tmp_path, is_there):
    if is_there:
        folder_of(tmp_path / "run", "old").commit()
    (tmp_path / "run.old").mkdir()
    (tmp_path / "run.old" / "notes").write_text("precious")
    folder_of(tmp_path / "run", "new").commit()
    assert (tmp_path / "run" / "log").read_text() == "new"
    assert (tmp_path / "run.old" / "notes").read_text() == "precious"
    assert sorted(os.listdir(str(tmp_path))) == ["run", "run.old"]


def test_a_folder_that_gets_no_name_leaves_the_old_one(tmp_path, monkeypatch):
    folder_of(tmp_path / "run", "old").commit()
    output = folder_of(tmp_path / "run", "new")
    rename = os.rename

    def refuse(source, target):
        if str(source).endswith(".part"):
            raise OSError("refused")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refuse)
    with pytest.raises(OSError, match="refused"):
        output.commit()
    assert (tmp_path / "run" / "log").read_text() == "old" and (output.working_path / "log").read_text() == "new"


def test_a_link_to_a_folder_is_replaced_and_what_it_leads_to_stays(tmp_path):
    folder_of(tmp_path / "elsewhere", "old").commit()
    (tmp_path / "run").symlink_to("elsewhere")
    folder_of(tmp_path / "run", "new").commit()
    assert (tmp_path / "run" / "log").read_text() == "new" and (tmp_path / "elsewhere" / "log").read_text() == "old"
    assert sorted(os.listdir(str(tmp_path))) == ["elsewhere", "run"]


def before_the_lock(monkeypatch, act):
    """Have something happen between the opening of a working file and its lock."""
    lock = fcntl.flock

    def late(descriptor, operation):
        monkeypatch.setattr(fcntl, "flock", lock)
        act()
        lock(descriptor, operation)

    monkeypatch.setattr(fcntl, "flock", late)


@pytest.mark.parametrize("end", ["commit", "abort"])
def test_a_file_that_another_finished_before_the_lock_stays_whole(tmp_path, monkeypatch, end):
    first = OutputFile(tmp_path / "log")
    first.write(b"first")
    before_the_lock(monkeypatch, getattr(first, end))
    with OutputFile(tmp_path / "log", overwrite=True) as second:
        assert (tmp_path / "log").exists() == (end == "commit")
        assert not first.path.exists() or first.path.read_bytes() == b"first"
        second.write(b"second")
    assert (tmp_path / "log").read_bytes() == b"second" and os.listdir(str(tmp_path)) == ["log"]


@pytest.mark.parametrize("end", ["commit", "abort"])
def test_a_folder_that_another_finished_before_the_lock_stays_whole(tmp_path, monkeypatch, end):
    first = folder_of(tmp_path / "run", "first")
    before_the_lock(monkeypatch, getattr(first, end))
    second = folder_of(tmp_path / "run", "second", lambda name: True)
    assert (tmp_path / "run").exists() == (end == "commit")
    assert not first.path.exists() or (first.path / "log").read_text() == "first"
    second.commit()
    assert (tmp_path / "run" / "log").read_text() == "second" and os.listdir(str(tmp_path)) == ["run"]


def test_a_folder_is_locked_until_it_has_its_name(tmp_path, monkeypatch):
    output = folder_of(tmp_path / "run", "first")
    rename = os.rename

    def interfere(source, target):
        with pytest.raises(OutputExists, match="another process"):
            OutputFolder(tmp_path / "run", lambda name: True)
        rename(source, target)

    monkeypatch.setattr(os, "rename", interfere)
    output.commit()
    assert (tmp_path / "run" / "log").read_text() == "first"
