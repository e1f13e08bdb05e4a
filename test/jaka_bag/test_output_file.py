import os

import pytest

from jaka_bag.errors import BagError, OutputExists
from jaka_bag.output_file import OutputFile, check_output


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
    with pytest.raises(OutputExists, match="another program"):
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
