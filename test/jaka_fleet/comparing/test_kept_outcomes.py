"""Results of many runs that a second comparison finds: what it takes over, and what it makes anew."""
import json
import shutil

import pytest
from many_sessions import drift, run_of
from synthetic_session import write_log

from jaka_bag.cli.main import main
from jaka_bag.compare.tolerances import parse_tolerances
from jaka_fleet.comparing.rejudging import needs_logs
from jaka_fleet.comparing.store import stored

ENVELOPE = "envelopes: {/jaka_driver/joint_position: {joint_3: [[0, 0.0005]]}}\n"


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Write a good run, and one that is different."""
    folder = tmp_path_factory.mktemp("kept")
    for name, change in (("a/good", None), ("b/bad", drift(2, 0.0025))):
        (folder / name).parent.mkdir()
        write_log(folder / (name + ".mcap"), run_of(len(name), change))
    return folder


@pytest.fixture
def compare(short_golden, logs, tmp_path):
    """Return a function that compares into one folder, by tolerances given as text; exit code."""
    def compared(*words, tolerances=None, sweep=None):
        more = []
        for option, text in (("--tolerances", tolerances), ("--sweep", sweep)):
            if text is not None:
                (tmp_path / "file.yaml").write_text(text)
                more += [option, str(tmp_path / "file.yaml")]
        return main(["compare", str(short_golden), "--against", str(logs), "--results", str(tmp_path / "results"), "-q",
                     *([] if sweep else ["--jobs", "1"]), *more, *words])
    return compared


def cells(tmp_path):
    return {run.path.rsplit("/", 1)[1]: run.cell for run in stored(tmp_path / "results")[1]}


def test_a_sweep_with_envelopes_is_not_guessed(compare, capsys):
    assert compare() == 1
    assert compare(sweep=ENVELOPE) == 2
    assert "envelopes" in capsys.readouterr().err


def test_results_with_envelopes_are_judged_again_only_with_the_same_ones(compare, capsys):
    assert compare(tolerances=ENVELOPE) == 1
    assert compare(sweep="joints: {position_rad: 0.01}") == 2
    assert "envelopes" in capsys.readouterr().err
    assert compare(sweep=ENVELOPE + "joints: {position_rad: 0.01}") == 1
    assert compare(sweep=ENVELOPE + "joints: {outside_percent: 100}") == 2
    assert compare(tolerances=ENVELOPE + "joints: {position_rad: 0.01}") == 1


@pytest.mark.parametrize("text, name", [
    (ENVELOPE, []), (ENVELOPE + "tcp: {outside_percent: 1}", ["tcp.outside_percent"]), ("", ["envelopes"])])
def test_what_envelopes_decide_is_named(text, name):
    assert needs_logs(parse_tolerances(ENVELOPE), parse_tolerances(text)) == name


@pytest.mark.parametrize("tolerances", ["joints: {per_joint: {joint_1: 0.00005}}", "ignore_topics: [\"it's\"]"])
def test_results_of_odd_tolerances_are_found_again(compare, tolerances):
    code = compare(tolerances=tolerances)
    assert code == 1 and compare(tolerances=tolerances) == code


def test_results_with_tolerances_that_cannot_be_read_are_made_anew(compare, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr("jaka_fleet.comparing.store.as_yaml", lambda _: "joints: {per_joint: {joint_1: 5e-05}}")
        compare()
    assert compare() == 1


def test_a_cell_given_later_is_the_cell_of_kept_outcomes(compare, tmp_path, capsys):
    assert compare("--cell", "one") == 1
    assert cells(tmp_path) == {"good.mcap": "one", "bad.mcap": "one"}
    assert compare("--cell", "two") == 1
    assert cells(tmp_path) == {"good.mcap": "two", "bad.mcap": "two"}
    assert compare() == 1
    assert cells(tmp_path) == {"good.mcap": "a", "bad.mcap": "b"}
    assert compare("--cell-from", "g(oo)d") == 1
    assert cells(tmp_path) == {"good.mcap": "oo", "bad.mcap": "b"}
    assert compare("--cell-from", "b(a)d") == 1
    assert cells(tmp_path) == {"good.mcap": "a", "bad.mcap": "a"}
    capsys.readouterr()
    assert compare("--cell", "three", "--json") == 1
    assert {run["cell"] for run in json.loads(capsys.readouterr().out)["runs"]} == {"three"}


def test_a_new_cell_compares_nothing_again(compare, tmp_path, monkeypatch):
    assert compare("--cell", "one") == 1
    monkeypatch.setattr("jaka_fleet.comparing.task.compare_runs", None)
    monkeypatch.setattr("jaka_fleet.cli.compare._write_run_reports", lambda *_: None)
    assert compare("--cell", "two") == 1 and compare() == 1
    assert cells(tmp_path) == {"good.mcap": "a", "bad.mcap": "b"}


def test_reports_are_of_the_tolerances_in_force(compare, tmp_path):
    assert compare("--cell", "x") == 1
    reports = tmp_path / "results" / "reports"
    before = {path.name: path.read_text(encoding="utf-8") for path in reports.iterdir()}
    assert len(before) == 1 and all("of 0.002 rad" in text for text in before.values())
    assert compare("--cell", "x") == 1
    (reports / "notes.html").write_text("mine")
    assert compare("--cell", "x", tolerances="joints: {position_rad: 0.001}") == 1
    after = {path.name: path.read_text(encoding="utf-8") for path in reports.iterdir()}
    assert after.pop("notes.html") == "mine"
    assert list(after) == list(before) and all("of 0.001 rad" in text for text in after.values())


def test_reports_that_are_of_these_results_stay(compare, tmp_path):
    assert compare() == 1
    report, = (tmp_path / "results" / "reports").iterdir()
    report.write_text("as it was")
    assert compare() == 1 and report.read_text() == "as it was"


def test_reports_without_results_are_of_nobody_knows_what(compare, tmp_path):
    assert compare() == 1
    report, = (tmp_path / "results" / "reports").iterdir()
    report.write_text("as it was")
    (tmp_path / "results" / "runs.parquet").unlink()
    assert compare() == 1 and report.read_text(encoding="utf-8") != "as it was"
    shutil.rmtree(str(report.parent))
    assert compare() == 1 and report.exists()


def test_a_cell_of_any_name_and_length_has_its_report(compare, tmp_path):
    assert compare("--cell", "焊接工位" * 60) == 1
    report, = (tmp_path / "results" / "reports").iterdir()
    assert report.suffix == ".html" and len(report.name.encode()) <= 255
