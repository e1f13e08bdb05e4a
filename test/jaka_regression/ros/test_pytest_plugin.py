"""The pytest plugin as a team uses it: in a folder of their own, in a pytest of its own."""
import json
import os
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import pytest
import yaml
from import_graph import ROOT

from jaka_bag.operations.convert import Job, convert_file
from jaka_regression.pytest_plugin import file_name

GOLDEN = ROOT / "test" / "data" / "golden"
BUSY_HOST = ROOT / "test" / "data" / "busy_host.yaml"
WAIT = 250


@pytest.fixture
def cell(tmp_path):
    """Return a folder with a golden log, and a function that runs pytest there."""
    shutil.copy(str(GOLDEN / "io_sequence.mcap"), str(tmp_path / "golden.mcap"))
    scenario = yaml.safe_load((GOLDEN / "io_sequence.yaml").read_text(encoding="utf-8"))
    scenario["tolerances"] = yaml.safe_load(BUSY_HOST.read_text(encoding="utf-8"))
    (tmp_path / "golden.yaml").write_text(yaml.safe_dump(scenario), encoding="utf-8")

    def run(text, *options):
        (tmp_path / "test_cell.py").write_text(text)
        environment = dict(os.environ, PYTHONPATH=os.pathsep.join(path for path in sys.path if path))
        for name in ("ROS_MASTER_URI", "PYTEST_ADDOPTS"):
            environment.pop(name, None)
        done = subprocess.run([sys.executable, "-m", "pytest", "-p", "jaka_regression.pytest_plugin", "-q",
                               "-p", "no:cacheprovider", *options], cwd=str(tmp_path), env=environment,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=WAIT)
        return done.returncode, done.stdout

    return tmp_path, run


PLAIN = """
def test_cell(jaka_replay):
    result = jaka_replay("golden.mcap")
    assert result.same, result.summary
"""
STRICT = """
def test_cell(jaka_replay):
    result = jaka_replay("golden.mcap", "strict.yaml")
    assert result.same, result.summary
"""


def test_a_bad_run_fails_with_the_summary_and_leaves_the_golden_log(cell):
    folder, run = cell
    before = (folder / "golden.mcap").read_bytes()
    # No run is as exact as that. Nothing can become a golden log from which an unchanged run differs: test_update.py.
    (folder / "strict.yaml").write_text("calls: {duration_s: 0, duration_percent: 0}\n")
    code, said = run(STRICT, "--jaka-time-scale=2")
    assert code == 1
    assert "DIFFERENT" in said and "durations" in said and "report.html" in said
    assert (folder / "golden.mcap").read_bytes() == before


def test_a_run_that_was_changed_on_purpose_becomes_the_golden_one_in_its_format(cell):
    folder, run = cell
    convert_file(Job(str(folder / "golden.mcap"), str(folder / "golden.bag")))
    (folder / "golden.mcap").unlink()
    scenario = yaml.safe_load((folder / "golden.yaml").read_text(encoding="utf-8"))
    scenario["events"][0]["value"] = 0  # the input stays as it is, so that get_io answers something else
    (folder / "golden.yaml").write_text(yaml.safe_dump(scenario), encoding="utf-8")
    text = PLAIN.replace("golden.mcap", "golden.bag")
    code, said = run(text, "--jaka-update")
    assert code == 1 and "responses" in said and "golden.bag is the new log: an unchanged run is the same" in said
    assert (folder / "golden.bag").read_bytes().startswith(b"#ROSBAG V2.0\n")
    assert run(text, "--jaka-time-scale=2")[0] == 0


def test_what_cannot_be_replayed_is_an_error_with_its_reason(cell):
    _, run = cell
    code, said = run(PLAIN.replace("golden.mcap", "nothing.mcap"))
    assert code == 1 and "cannot read" in said and "nothing.mcap" in said


def test_a_driver_that_does_not_start_is_an_error_with_its_last_words(cell):
    _, run = cell
    other = '"golden.mcap", driver=["-c", "raise SystemExit(\'no driver here\')"]'
    code, said = run(PLAIN.replace('"golden.mcap"', other))
    assert code == 1 and "no driver here" in said


def test_a_good_run_leaves_its_report_beside_the_results_which_never_stands_for_a_later_one_that_failed(cell):
    folder, run = cell
    report = folder / "out" / "jaka_reports" / "test_cell.py_test_cell"
    code, said = run(PLAIN, "--junitxml=out/results.xml", "--jaka-time-scale=2")
    assert code == 0, said
    assert (report / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert ElementTree.parse(str(report / "report.xml")).getroot().find("testsuite").get("failures") == "0"
    assert json.loads((report / "report.json").read_text(encoding="utf-8"))["same"] is True
    (folder / "golden.yaml").write_text("arms: [{simulation: []}]\n")  # nobody enables the arm: its calls are refused
    code, said = run(PLAIN, "--junitxml=out/results.xml")
    assert code == 1 and "the calls could not be made again" in said
    told = json.loads((report / "report.json").read_text(encoding="utf-8"))
    assert told["same"] is False and "the calls could not be made again" in told["error"]
    page = (report / "report.html").read_text(encoding="utf-8")
    assert "not compared" in page and "the calls could not be made again" in page and "calls.log" in page
    assert ElementTree.parse(str(report / "report.xml")).getroot().find("testsuite").get("errors") == "1"


def test_report_folders_have_names_that_every_file_system_takes():
    assert file_name("test/a.py::test_b[x/y z]") == "test_a.py_test_b_x_y_z"
