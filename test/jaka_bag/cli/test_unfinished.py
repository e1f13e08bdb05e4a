"""A recording that is still being written is read by every command that reads, and is not changed."""
import json

import pytest
from log_samples import STATES, in_order, read, state_log, write

from jaka_bag.cli.main import main

SAMPLES = state_log(2.0)


@pytest.fixture(params=[0.3, 0.77])
def active(tmp_path, request):
    """Return a log as a recording has it on the disk at some moment."""
    whole = write(tmp_path / "whole.mcap", SAMPLES, "zstd")
    path = tmp_path / "run.mcap.active"
    path.write_bytes(whole.read_bytes()[:int(whole.stat().st_size * request.param)])
    return path


def test_each_message_that_is_whole_is_read(active, tmp_path, capsys):
    before = active.read_bytes()
    kept = in_order(read(active))
    assert 0 < len(kept) < len(SAMPLES) and kept == in_order(SAMPLES)[:len(kept)]
    assert main(["info", "--freq", str(active)]) == 0
    out = capsys.readouterr().out
    assert "unfinished" in out and "messages:     %d" % len(kept) in out
    assert main(["info", "--json", "--freq", str(active)]) == 0
    topics = json.loads(capsys.readouterr().out)["topics"]
    assert sum(topic["freq"]["messages"] for topic in topics) == len(kept)
    for words in (["convert", active, tmp_path / "o.bag"], ["filter", active, tmp_path / "o.mcap"],
                  ["merge", active, "-o", tmp_path / "m.mcap"]):
        assert main([*map(str, words), "-q"]) == 0
    assert read(tmp_path / "o.bag") == read(tmp_path / "o.mcap") == read(tmp_path / "m.mcap") == kept
    assert main(["split", str(active), str(tmp_path / "part.mcap"), "--count", "100000", "-q"]) == 0
    assert main(["export", str(active), str(tmp_path / "o.npz"), "-q"]) == 0
    assert main(["plot", str(active), str(tmp_path / "o.png"), "--field", STATES.topic + ":motion_state", "-q"]) == 0
    capsys.readouterr()
    assert main(["doctor", str(active)]) == 0
    assert "note: it is still being written" in capsys.readouterr().out
    assert main(["cat", str(active), "-t", "/model"]) == 0 and capsys.readouterr().out.count("\n") == 1
    assert main(["du", str(active)]) == 0
    assert active.read_bytes() == before


def test_a_file_that_was_cut_off_under_its_final_name_is_still_an_error(active, tmp_path, capsys):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(active.read_bytes())
    assert main(["info", str(cut)]) == 1
    assert "cut off" in capsys.readouterr().err
