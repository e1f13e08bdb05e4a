"""The reports that jaka_bag replay leaves: of this run only, also where a replay failed."""
import pytest
from import_graph import ROOT

from jaka_bag.cli.main import main
from jaka_bag.engines.tasks import FAILED, LogResult
from jaka_fleet.cli import replay

GOLDEN = ROOT / "test" / "data" / "golden" / "boot.mcap"
OLD = ("report.html", "report.xml", "report.json", "candidate.mcap")


@pytest.fixture
def reports(tmp_path):
    """Return a folder as an earlier run left it, all of it the same, with a file of the user's."""
    folder = tmp_path / "reports"
    (folder / "boot").mkdir(parents=True)
    for name in (*OLD, "notes.txt"):
        (folder / "boot" / name).write_text("same")
    (folder / "report.html").write_text("same")
    return folder


def test_a_replay_that_fails_leaves_no_report_of_an_earlier_run(reports, monkeypatch, capsys):
    def fails(_function, tasks, _engine, _report, take):
        for task in tasks:
            take(LogResult(task.path, FAILED, "its worker died"))

    monkeypatch.setattr(replay, "work_through", fails)
    assert main(["replay", str(GOLDEN), "--jobs", "1", "-o", str(reports), "--force"]) == 1
    assert "its worker died" in capsys.readouterr().out
    assert [path.name for path in (reports / "boot").iterdir()] == ["notes.txt"]
    assert "its worker died" in (reports / "report.html").read_text(encoding="utf-8")


def test_a_run_that_is_ended_leaves_no_page_of_an_earlier_one(reports, monkeypatch):
    def is_ended(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(replay, "work_through", is_ended)
    assert main(["replay", str(GOLDEN), "--jobs", "1", "-o", str(reports), "--force"]) != 0
    assert not (reports / "report.html").exists()


def test_without_force_nothing_is_removed(reports):
    assert main(["replay", str(GOLDEN), "--jobs", "1", "-o", str(reports)]) != 0
    assert all((reports / "boot" / name).read_text() == "same" for name in OLD)
