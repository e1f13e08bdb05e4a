"""Faults that a comparison of many runs survives: killed workers and callers, damaged and changing logs."""
import json
import os
import shutil
import subprocess
import time
from xml.etree import ElementTree

import pytest
from command_places import command_of
from many_sessions import drift, run_of
from synthetic_session import write_log

from jaka_bag.cli.main import main
from jaka_bag.compare.tolerances import Tolerances
from jaka_bag.engines.tasks import LogTask
from jaka_bag.errors import BagError
from jaka_fleet.comparing.outcome import NOT_COMPARED
from jaka_fleet.comparing.store import NothingStored, Results, Setup, stored
from jaka_fleet.comparing.task import CompareSettings, compare_task, file_hash

COUNT = 30
PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Write runs of which some are different, one is cut off, one is no log and one is a copy of another."""
    folder = tmp_path_factory.mktemp("logs")
    for number in range(COUNT):
        write_log(folder / ("run_%02d.mcap" % number), run_of(number, drift(4, 0.01) if number % 9 == 5 else None))
    whole = (folder / "run_00.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(whole[:len(whole) // 2])
    (folder / "text.bag").write_text("no log")
    shutil.copy(str(folder / "run_03.mcap"), str(folder / "run_03_copy.mcap"))
    return folder


def compare(golden, logs, results, *words):
    return main(["compare", str(golden), "--against", str(logs), "--results", str(results), "-q", *words])


def tables(results):
    return [(results / name).read_bytes() for name in ("runs.parquet", "checks.parquet")]


@pytest.fixture(scope="module")
def serial(short_golden, logs, tmp_path_factory):
    """Return the results of a comparison in one process."""
    results = tmp_path_factory.mktemp("serial")
    assert compare(short_golden, logs, results, "--jobs", "1", "--junit", str(results / "junit.xml")) == 1
    return results


def journal_lines(results):
    journal = results / "journal.jsonl"
    return journal.read_bytes().count(b"\n") if journal.exists() else 0  # a line may be half written


def wait_for_lines(results, count):
    end = time.monotonic() + PATIENCE_S
    while journal_lines(results) < count:
        assert time.monotonic() < end
        time.sleep(0.005)  # between two looks


def test_damaged_logs_are_told_with_their_reason_and_stop_nothing(serial):
    _, outcomes = stored(serial)
    assert len(outcomes) == COUNT + 2
    bad = {os.path.basename(one.path): one.reason for one in outcomes if one.verdict == NOT_COMPARED}
    assert set(bad) == {"cut.mcap", "text.bag"} and all(bad.values())
    suite = ElementTree.fromstring((serial / "junit.xml").read_bytes()).find("testsuite")
    assert suite.get("errors") == "2" and len(suite.findall("testcase[error]")) == 2
    page = (serial / "report.html").read_text(encoding="utf-8")
    assert "cut.mcap" in page.partition('id="left"')[2]


def test_a_comparison_that_was_killed_goes_on_where_it_was(short_golden, logs, serial, tmp_path, root):
    results = tmp_path / "results"
    process = subprocess.Popen([*command_of("jaka_bag"), "compare", str(short_golden), "--against", str(logs),
                                "--results", str(results), "--jobs", "1", "-q"],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_for_lines(results, 8)
    finally:
        process.kill()
        process.wait(PATIENCE_S)
    assert not (results / "runs.parquet").exists()
    with (results / "journal.jsonl").open("ab") as journal:
        journal.write(b'["half a li')
    with Results(results, Setup(str(short_golden), file_hash(str(short_golden)), Tolerances())) as kept:
        assert len(kept.known()) >= 7
    assert compare(short_golden, logs, results, "--jobs", "1") == 1
    assert tables(results) == tables(serial) and journal_lines(results) == 0


def test_other_tolerances_take_nothing_over(short_golden, logs, serial, tmp_path):
    results = tmp_path / "results"
    shutil.copytree(str(serial), str(results))
    wide = tmp_path / "wide.yaml"
    wide.write_text("joints: {position_rad: 0.05}\ntcp: {position_mm: 50, orientation_rad: 0.1}\n")
    other = Setup(str(short_golden), file_hash(str(short_golden)), Tolerances(), 2.0)
    with Results(results, other) as kept:
        assert not kept.known()
    assert compare(short_golden, logs, results, "--jobs", "1", "--tolerances", str(wide)) == 1
    setup, outcomes = stored(results)
    assert setup.tolerances.joints.position_rad == 0.05
    assert {one.verdict for one in outcomes} == {"same", NOT_COMPARED}


def test_tables_of_two_comparisons_are_not_taken_together(short_golden, serial, tmp_path):
    results = tmp_path / "results"
    shutil.copytree(str(serial), str(results))
    setup, outcomes = stored(results)
    runs = (results / "runs.parquet").read_bytes()
    with Results(results, setup) as kept:
        kept.write(outcomes[1:])
    (results / "runs.parquet").write_bytes(runs)
    with pytest.raises(NothingStored, match="two comparisons"):
        stored(results)
    (results / "checks.parquet").write_bytes(b"PAR1")
    with pytest.raises(NothingStored, match="no results"):
        stored(results)


def test_two_processes_do_not_compare_into_one_folder(short_golden, logs, serial, tmp_path, capsys):
    setup, _ = stored(serial)
    with Results(tmp_path / "results", setup):
        assert compare(short_golden, logs, tmp_path / "results", "--jobs", "1") == 2
    assert "another process compares into" in capsys.readouterr().err


def test_a_log_that_changes_while_it_is_read_is_not_compared(short_golden, logs, tmp_path, monkeypatch):
    path = tmp_path / "run.mcap"
    shutil.copy(str(logs / "run_01.mcap"), str(path))
    settings = CompareSettings(str(short_golden), file_hash(str(short_golden)), Tolerances())
    whole = compare_task(LogTask(str(path), settings)).value
    assert whole.verdict == "same" and whole.checks

    def grows(name):
        with path.open("ab") as log:
            log.write(b"more")
        return file_hash(name)

    monkeypatch.setattr("jaka_fleet.comparing.task.file_hash", grows)
    with pytest.raises(BagError, match="changed while it was read"):
        compare_task(LogTask(str(path), settings))


def test_another_golden_log_on_the_worker_is_noticed(short_golden, logs):
    settings = CompareSettings(str(short_golden), "0" * 64, Tolerances())
    outcome = compare_task(LogTask(str(logs / "run_01.mcap"), settings)).value
    assert outcome.verdict == NOT_COMPARED and "another file here" in outcome.reason


def test_outcomes_are_the_same_after_the_journal_and_after_the_tables(serial, tmp_path):
    setup, outcomes = stored(serial)
    with Results(tmp_path / "again", setup) as results:
        assert not results.known()
        for outcome in outcomes:
            results.add(outcome)
    with Results(tmp_path / "again", setup) as results:
        known = results.known()
        assert [known[one.path] for one in outcomes] == outcomes
        results.write(outcomes)
    assert tables(tmp_path / "again") == tables(serial)
    assert json.loads(json.dumps(stored(tmp_path / "again")[0].facts())) == setup.facts()
