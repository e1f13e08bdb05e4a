"""The files of a black box in their folder, which others may take out of it at any moment."""
import os
from pathlib import Path

import pytest

from jaka_blackbox.files import Keep, finished_files, remove_old


@pytest.fixture
def folder(tmp_path):
    for number in range(4):
        path = tmp_path / ("blackbox_%d.mcap" % number)
        path.write_bytes(b"x" * 10)
        os.utime(str(path), (number, number))
    return tmp_path


@pytest.mark.parametrize("keep", [Keep(files=2), Keep(size=20)], ids=str)
def test_the_oldest_files_go_with_their_signatures(folder, keep):
    (folder / "blackbox_0.mcap.sig").touch()
    said = []
    remove_old(folder, keep, said.append)
    assert sorted(path.name for path in folder.iterdir()) == ["blackbox_2.mcap", "blackbox_3.mcap"]
    assert said == ["removed %s" % (folder / ("blackbox_%d.mcap" % number)) for number in (0, 1)]


@pytest.mark.parametrize("method", ["stat", "unlink"])
def test_a_file_that_is_moved_away_meanwhile_costs_nothing(folder, monkeypatch, method):
    real = getattr(Path, method)

    def late(path, *arguments, **options):
        if path.name == "blackbox_0.mcap" and path.parent.joinpath("blackbox_0.mcap") in dict(found):
            found.clear()
            os.rename(str(path), str(folder / "mine"))
        return real(path, *arguments, **options)

    found = finished_files(folder)
    monkeypatch.setattr(Path, method, late)
    remove_old(folder, Keep(files=2), print)
    assert sorted(path.name for path in folder.iterdir()) == ["blackbox_2.mcap", "blackbox_3.mcap", "mine"]
