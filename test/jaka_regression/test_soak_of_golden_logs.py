"""The judgement of the soak of golden logs: which runs teach, and how many may differ."""
import importlib.util
import sys
from types import SimpleNamespace

import pytest
from import_graph import ROOT


@pytest.fixture
def soak(monkeypatch, tmp_path):
    spec = importlib.util.spec_from_file_location("soak_golden_logs", ROOT / "test" / "soak" / "soak_golden_logs.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setattr(sys, "path", list(sys.path))
    spec.loader.exec_module(module)
    monkeypatch.setattr(module.signal, "signal", lambda *_: None)
    monkeypatch.setattr(module.tempfile, "mkdtemp", lambda prefix: str(tmp_path))
    monkeypatch.setattr(module, "audit", lambda *_: [])
    return module


def ended(soak, monkeypatch, outcomes, *options):
    """Run the soak of one log with runs that are the same, or differ; return its exit code, and what taught."""
    left, teachers = list(outcomes), []

    def replay(golden, folder, tolerances):
        folder.mkdir()
        (folder / "candidate.mcap").write_bytes(b"")
        return SimpleNamespace(same=left.pop(0), summary="it differs", comparison=SimpleNamespace(checks=[]))

    def learn(golden, good, tolerances):
        teachers.extend(good)
        return SimpleNamespace(tolerances=None)

    monkeypatch.setattr(soak, "replay", replay)
    monkeypatch.setattr(soak, "learn", learn)
    monkeypatch.setattr(sys, "argv", ["soak", "--load", "0", *options, "boot"])
    code = soak.main()
    assert not left
    return code, [path.rsplit("/", 1)[-1] for path in teachers]


@pytest.mark.parametrize("differing, code", [(0, 0), (1, 0), (2, 1)])
def test_one_run_may_differ(soak, monkeypatch, capsys, tmp_path, differing, code):
    assert ended(soak, monkeypatch, [True] * 10 + [False] * differing, "--runs", str(10 + differing))[0] == code
    assert "%d different, 0 failed" % differing in capsys.readouterr().out
    assert tmp_path.exists() == bool(differing), "the reports of runs that differed stay"


def test_a_teaching_run_that_differs_teaches_nothing(soak, monkeypatch, capsys):
    code, teachers = ended(soak, monkeypatch, [True, False, True, True, True], "--runs", "2", "--learn", "2")
    assert code == 0 and teachers == ["001_boot.mcap", "003_boot.mcap"]
    assert "2 runs: 2 same" in capsys.readouterr().out


def test_a_log_of_which_no_run_is_good_ends_the_soak(soak, monkeypatch, capsys):
    assert ended(soak, monkeypatch, [False] * 6, "--runs", "2", "--learn", "2")[0] == 1
    assert "0 of 6 teaching runs are good" in capsys.readouterr().out
