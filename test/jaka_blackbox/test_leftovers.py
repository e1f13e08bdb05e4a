"""Files that a killed black box left: made whole, or kept where it cannot be."""
from types import SimpleNamespace

import pytest
from log_samples import read, state_log, write

from jaka_bag.errors import BagError
from jaka_blackbox.cli import record
from jaka_blackbox.cli.record import Assembly

SAMPLES = state_log(3.0)
NAME = "blackbox_2024-01-01-00-00-00_error.mcap"


def start(folder, key=None):
    """Return what a black box says about the leftovers in a folder when it begins."""
    said = []
    box = Assembly.__new__(Assembly)
    box._folder = folder
    box._console = SimpleNamespace(say=said.append, always=said.append)
    box._recorder = SimpleNamespace(key=key)
    box._make_leftovers_whole()
    return said


def leftover(folder, spoil):
    whole = write(folder / "whole.mcap", SAMPLES, chunk_size=2000)
    raw = bytearray(whole.read_bytes())
    whole.unlink()
    path = folder / (NAME + ".active")
    path.write_bytes(spoil(raw))
    return path


def damaged(raw):
    """Return a log without a piece in its middle."""
    return raw[:len(raw) // 3] + raw[len(raw) // 2:]


def test_a_leftover_that_is_made_whole_is_replaced(tmp_path):
    leftover(tmp_path, bytes)
    (said,) = start(tmp_path)
    assert "made whole: %d messages" % len(SAMPLES) in said
    assert [path.name for path in tmp_path.iterdir()] == [NAME] and len(read(tmp_path / NAME)) == len(SAMPLES)


def test_a_leftover_that_is_not_made_whole_is_kept_and_said(tmp_path):
    raw = leftover(tmp_path, damaged).read_bytes()
    (tmp_path / ("damaged_%s.active" % NAME)).write_bytes(b"of another time")
    (said,) = start(tmp_path)
    assert "made whole" not in said and "recovered, not whole" in said and "lost" in said
    kept = tmp_path / ("damaged_2_%s.active" % NAME)
    assert kept.read_bytes() == raw and str(kept) in said
    assert 0 < len(read(tmp_path / NAME)) < len(SAMPLES)
    before = sorted(path.name for path in tmp_path.iterdir())
    assert not start(tmp_path) and sorted(path.name for path in tmp_path.iterdir()) == before
    assert (tmp_path / ("damaged_%s.active" % NAME)).read_bytes() == b"of another time"


def test_a_leftover_that_cannot_be_signed_ends_nothing(tmp_path, monkeypatch):
    def refuse(path, key):
        raise BagError("cannot write %s.sig" % path)

    leftover(tmp_path, bytes)
    monkeypatch.setattr(record, "sign", refuse)
    said = start(tmp_path, "key")
    assert "made whole" in said[0] and said[1].startswith("error: cannot write") and len(said) == 2


@pytest.mark.parametrize("content", [b"", b"noise" * 100])
def test_what_cannot_be_read_stays_as_it_is(tmp_path, content):
    path = leftover(tmp_path, lambda raw: content)
    assert len(start(tmp_path)) == 1 and path.read_bytes() == content
