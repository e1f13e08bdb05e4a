"""A cell's own nodes, started by their own launch file, against the golden log of its first run."""
import dataclasses
import html
import os
import shutil
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from import_graph import ROOT

from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import load_tolerances
from jaka_bag.containers.registry import read_index
from jaka_bag.errors import BagError
from jaka_regression.cell import stage as stage_of_a_cell
from jaka_regression.cell.history import read_history
from jaka_regression.cell.launch_file import LaunchFileError, check_launch_file
from jaka_regression.cell.run import run_cell
from jaka_regression.cell.stage import CellLaunch, CellStage
from jaka_regression.command_lines import DRIVER
from jaka_regression.processes import ChildProcesses
from jaka_regression.replay import replay
from jaka_regression.scenario import CauseKind, Scenario, parse_scenario
from jaka_regression.stage import Script

CELL = ROOT / "test" / "data" / "cell"
BUSY_HOST = ROOT / "test" / "data" / "busy_host.yaml"
TOPICS = ("tool_position", "joint_position", "robot_states", "service_calls", "io_states")
GRIPPER = """
events:  # the gripper, whose switch is input 2
- {after_output: {index: 1, value: 1}, delay_s: 0.6, action: set_input, index: 2, value: 1}
- {after_output: {index: 1, value: 0}, delay_s: 0.4, action: set_input, index: 2, value: 0}
"""
WITHOUT_DRIVER = ("driver:=false",)
FIRST_RUNS = 3
HANGS_S = 30.0
"""Limit of a node that hangs, s: its calls before that take 4 s, and 15 s on a busy host; then nothing comes."""


class Cell:
    """A folder with the cell's package; its node can be changed."""

    def __init__(self, folder):
        self.folder = folder
        self.golden = folder / "golden.mcap"
        self.launch = folder / "my_cell" / "cell.launch"
        self.program = folder / "my_cell" / "pick_and_place.py"
        shutil.copytree(str(CELL), str(folder / "my_cell"))
        self.change()

    def change(self, *changes):
        text = (CELL / "pick_and_place.py").read_text(encoding="utf-8")
        for old, new in changes:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        self.program.write_text(text, encoding="utf-8")
        self.program.chmod(0o755)

    def run(self, folder, tolerances=None, limit_s=None, golden=None):
        return run_cell(self.launch, golden or self.golden, folder, WITHOUT_DRIVER,
                        tolerances or load_tolerances(BUSY_HOST), limit_s)


def recorded(cell, text, golden):
    """Record a first run of the program, in the world of a scenario, as a golden log: one without a refused call.

    Where the computer gives the driver no time, it refuses to read an input of which it knows nothing new.
    """
    program = CellLaunch(cell.launch, WITHOUT_DRIVER, (), 0.0, 0.0)
    scenario = parse_scenario(text, "gripper")
    topics = tuple("%s/jaka_driver/%s" % (arm.namespace, name) for arm in scenario.arms for name in TOPICS)
    for number in range(FIRST_RUNS):
        place = golden.with_suffix(".first%d" % number)
        place.mkdir()
        with ChildProcesses() as programs:
            stage = CellStage(programs, place, Script(None, (), 0.0, topics), scenario)
            assert stage.run_cell(golden, DRIVER, program) == ""
        refused = [call.error for call in load_run(golden).calls if not call.success]
        if not refused:
            return
    raise AssertionError("no good first run: %s" % refused)


@pytest.fixture(scope="module")
def package_path(tmp_path_factory):
    """Return a folder in which roslaunch looks for packages."""
    folder = tmp_path_factory.mktemp("cell")
    before = os.environ["ROS_PACKAGE_PATH"]
    os.environ["ROS_PACKAGE_PATH"] = "%s:%s" % (folder, before)
    yield folder
    os.environ["ROS_PACKAGE_PATH"] = before


@pytest.fixture(scope="module")
def golden_cell(package_path):
    """Return the cell with its golden log, which no scenario stands beside."""
    made = Cell(package_path)
    recorded(made, GRIPPER, made.golden)
    return made


@pytest.fixture
def cell(golden_cell):
    """Return the cell with its node unchanged."""
    golden_cell.change()
    return golden_cell


def topics_of(result):
    return {check.topic for check in result.comparison.differences}


def report_has(result, words):
    return words in result.report.read_text(encoding="utf-8")


def test_an_unchanged_program_is_the_same(cell, tmp_path):
    result = cell.run(tmp_path)
    assert result.same, result.summary
    checked = {check.topic for check in result.comparison.checks}
    assert {"/jaka_driver/joint_move", "/jaka_driver/set_io", "/jaka_driver/io_states", "/jaka_driver/tool_position"} \
        <= checked
    derived = yaml.safe_load((tmp_path / "scenario.yaml").read_text(encoding="utf-8"))["events"]
    delays = [event.pop("delay_s") for event in derived]
    assert delays == pytest.approx([0.6, 0.4], abs=0.3)
    expected = yaml.safe_load(GRIPPER)["events"]
    assert derived == [{key: value for key, value in event.items() if key != "delay_s"} for event in expected]


ONE_LOOK = ("    while read(\"digital\", 0, 0, GRIPPED).value != level:\n        rospy.sleep(0.05)\n",
            "    read(\"digital\", 0, 0, GRIPPED)\n")
"""A change by which the node goes on where the world waits for an output that never comes."""
CHANGES = {  # one that is 5 mm off, and one without its last calls, are among the last tests of this file
    "another output": ([("GRIP = 1 ", "GRIP = 3 "), ONE_LOOK], {"/jaka_driver/set_io", "/jaka_driver/io_states"}, None),
    "a wait dropped": ([("grip(1)\nwait_for(1)\n", "grip(1)\n")], {"/jaka_driver/get_io"}, "is missing"),
}


@pytest.mark.parametrize("changes, topics, words", CHANGES.values(), ids=CHANGES)
def test_a_changed_program_is_different_and_the_report_names_where(cell, tmp_path, changes, topics, words):
    cell.change(*changes)
    result = cell.run(tmp_path)
    assert not result.same and topics <= topics_of(result), result.summary
    assert "DIFFERENT" in result.summary and all(report_has(result, topic) for topic in topics)
    assert words is None or words in result.summary


def test_a_call_after_the_end_of_the_golden_log_is_different(cell, tmp_path):
    cell.change(("wait_for(0)\n", "wait_for(0)\nrospy.sleep(5)\njoints(ABOVE)\n"))
    limits = load_tolerances(BUSY_HOST)
    result = cell.run(tmp_path, dataclasses.replace(limits, calls=dataclasses.replace(limits.calls, timing_s=0.8)))
    found = [check for check in result.comparison.differences if check.field == "after the end"]
    assert [check.topic for check in found] == ["/jaka_driver/joint_move"], result.summary
    assert "is new: the golden log has ended" in result.summary


def test_a_node_that_dies_is_an_error_with_its_last_words(cell, tmp_path):
    cell.change(("line(UP)\n", "raise RuntimeError('the gripper is empty')\n"))
    result = cell.run(tmp_path)
    assert not result.same and "died with exit code 1" in result.summary, result.summary
    assert "the gripper is empty" in result.summary and report_has(result, "the gripper is empty")


def test_a_node_that_cannot_be_started_is_an_error(cell, tmp_path):
    cell.program.chmod(0o644)
    result = cell.run(tmp_path)
    assert not result.same
    assert "cannot launch node of type [my_cell/pick_and_place.py]" in result.summary, result.summary


def test_a_node_that_never_ends_is_an_error_that_says_what_is_missing(cell, tmp_path, monkeypatch):
    hangs, seen = threading.Event(), CellStage._seen

    def noted(stage, event):
        seen(stage, event)
        if stage._answered == 5:
            hangs.set()
    # from then on nothing happens until the limit: the clock is put forward by it
    monkeypatch.setattr(CellStage, "_seen", noted)
    monkeypatch.setattr(stage_of_a_cell, "time", SimpleNamespace(
        sleep=time.sleep, monotonic=lambda: time.monotonic() + HANGS_S * hangs.is_set()))
    cell.change(("line(UP)\n", "rospy.spin()\n"))
    result = cell.run(tmp_path, limit_s=HANGS_S)
    assert not result.same, result.summary
    for words in ("did not end within 30 s", "5 of the golden log's 10 calls have been answered",
                  "the next one there is linear_move(", "its cause never came",
                  "{'after_output': {'index': 1, 'value': 0}, 'delay_s': "):
        assert words in result.summary and report_has(result, html.escape(words)), result.summary


def test_a_node_that_goes_on_is_over_when_all_is_done(cell, tmp_path, monkeypatch):
    monkeypatch.setattr(stage_of_a_cell, "_QUIET_S", 2.0)  # all is done before it begins
    cell.change(("wait_for(0)\n", "wait_for(0)\nrospy.spin()\n"))
    result = cell.run(tmp_path)
    assert result.same, result.summary


def test_the_world_is_the_files_where_it_has_events(cell, tmp_path):
    golden = tmp_path / "golden.mcap"
    shutil.copy(str(cell.golden), str(golden))
    never = "events: [{after_motion: 0, delay_s: 0.2, action: press_emergency_stop}]\n"
    golden.with_suffix(".yaml").write_text(never)
    result = cell.run(tmp_path / "report", golden=golden)
    assert not result.same and "/jaka_driver/robot_states" in topics_of(result), result.summary
    assert "emergency stop" in result.summary and "died with exit code" in result.summary
    assert not (tmp_path / "report" / "scenario.yaml").exists()
    golden.with_suffix(".yaml").write_text("events: [{after_call: 0, action: hit}]\n")
    with pytest.raises(BagError, match="after_call is for replays"):
        cell.run(tmp_path / "report", golden=golden)


def test_the_arm_and_the_outputs_begin_as_in_the_golden_log(cell, tmp_path):
    cell.change(("line(DOWN)\ngrip(1)\nwait_for(1)\nline(UP)\njoints(BESIDE)\ngrip(0)\nwait_for(0)\n", ""))
    start = (-0.2, 1.4, -1.4, 1.5, 1.6, 0.1)
    outputs = {(CauseKind.OUTPUT, "cabinet", 5): 1, (CauseKind.OUTPUT, "cabinet", 4): 0}
    inputs = {(CauseKind.INPUT, "cabinet", 3): 1}
    golden = tmp_path / "golden.mcap"
    recorded(cell, "arms: [{state: {joints: [%s], terminals: {cabinet: {digital_outputs: {5: 1}}}}}]\n"
             "events: [{action: set_input, index: 3, value: 1}]" % ", ".join(map(str, start)), golden)
    result = cell.run(tmp_path / "report", golden=golden)
    assert result.same, result.summary
    ours, theirs = (read_history(log, [""]) for log in (golden, result.candidate))
    for log in (golden, result.candidate):
        joints = load_run(log).joints["/jaka_driver/joint_position"]
        assert joints.at(np.array([joints.facts.first]))[0] == pytest.approx(start, abs=0.002)
    assert ours.begins_with == theirs.begins_with
    assert {key: ours.begins_with[""][key] for key in (*outputs, *inputs)} == {**outputs, **inputs}


def test_two_arms_have_their_own_worlds(cell, tmp_path):
    # the left arm picks and places, the right one moves and hands its part over by an output of its own
    left = [(text, text.replace('"/jaka_driver/', '"/left/jaka_driver/')) for text in (
        'wait_for_service("/jaka_driver/" + name)', 'ServiceProxy("/jaka_driver/" + name, kind)',
        'ServiceProxy("/jaka_driver/get_io", GetIO)')]
    right = ('line(DOWN)\n', 'line(DOWN)\nrospy.ServiceProxy("/right/jaka_driver/joint_move", Move)'
                             '(ABOVE, False, [], 0.8, 2.0, 0.0, 0.0, 0, 0)\n'
                             'rospy.ServiceProxy("/right/jaka_driver/set_io", SetIO)("digital", 0, 1, 1)\n')
    cell.change(*left, right)
    golden = tmp_path / "golden.mcap"
    arms = "arms: [{namespace: /left}, {namespace: /right}]\n"
    text = GRIPPER.replace("{after", "{arm: /left, after") + (
        "- {arm: /right, after_output: {index: 1}, delay_s: 0.2, action: set_input, index: 4, value: 1}\n")
    recorded(cell, arms + text, golden)
    result = cell.run(tmp_path / "report", golden=golden)
    assert result.same, result.summary
    derived = parse_scenario((tmp_path / "report" / "scenario.yaml").read_text(encoding="utf-8"), "scenario.yaml")
    told = parse_scenario(arms + text, "gripper")
    assert {(event.arm, event.after) for event in derived.events} == {(event.arm, event.after) for event in told.events}


def test_a_replay_plays_the_same_world(cell, tmp_path):
    golden = tmp_path / "golden.mcap"
    shutil.copy(str(cell.golden), str(golden))
    tolerances = yaml.safe_load(BUSY_HOST.read_text(encoding="utf-8"))
    tolerances["calls"]["response"] = "ignore"  # a read at the moment of the change may be answered either way
    golden.with_suffix(".yaml").write_text(GRIPPER + yaml.safe_dump({"tolerances": tolerances}))
    result = replay(golden, tmp_path / "report")
    # how often the terminals are published is chance; what they show is compared below
    assert topics_of(result) <= {"/jaka_driver/io_states"}, result.summary
    inputs = [[doing.request for doing in read_history(log, [""]).doings] for log in (golden, result.candidate)]
    assert inputs[0] == inputs[1] and len(inputs[0]) == 2


@pytest.mark.parametrize("arguments, words", [
    ((), r"starts a simulated controller \(node /jaka_sim\), a driver \(node /jaka_driver\): .*driver:=false"),
    (("driver:=maybe",), "cell.launch: .*maybe"),
])
def test_a_launch_file_that_starts_the_driver_is_refused(package_path, golden_cell, arguments, words):
    with pytest.raises(LaunchFileError, match=words):
        check_launch_file(golden_cell.launch, arguments, Scenario())


@pytest.mark.parametrize("text, words", [
    ("<launch/>", "starts no node"), ("<launch>", "no element found|not well-formed"),
    ('<launch><node name="jaka_driver" pkg="other" type="x"/></launch>', "a node of the driver's name, /jaka_driver"),
    ('<launch><arg name="speed"/><node name="a" pkg="b" type="c" args="$(arg speed)"/></launch>', "speed"),
])
def test_a_launch_file_that_cannot_be_the_cells_is_refused(tmp_path, text, words):
    (tmp_path / "cell.launch").write_text(text)
    with pytest.raises(LaunchFileError, match=words):
        check_launch_file(tmp_path / "cell.launch", (), Scenario())


def test_a_launch_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(LaunchFileError, match="there is no launch file"):
        check_launch_file(tmp_path / "none.launch", (), Scenario())


def test_the_rostest_of_a_changed_node_has_another_exit_code_than_0(cell, tmp_path):
    # that of an unchanged one has 0: test/ros/pages/test_regression_documentation.py
    cell.change(("grip(0)\nwait_for(0)\n", ""))
    done = subprocess.run(
        ["rostest", str(ROOT / "launch" / "cell_golden.test"), "golden:=%s" % cell.golden, "launch:=%s" % cell.launch,
         "arguments:=driver=false", "options:=--tolerances %s" % BUSY_HOST], cwd=str(tmp_path),
        env=dict(os.environ, ROS_HOME=str(tmp_path / "ros")), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, timeout=250)
    assert done.returncode != 0 and "DIFFERENT" in done.stdout and "is missing" in done.stdout, done.stdout
    pages = list(tmp_path.rglob("report.html"))
    assert len(pages) == 1, done.stdout
    assert all("/jaka_driver/" + name in pages[0].read_text(encoding="utf-8") for name in ("set_io", "io_states"))


@pytest.fixture
def run_pytest(cell, tmp_path):
    """Return a function that runs pytest in a folder with a test of the cell, and returns exit code and output."""
    shutil.copy(str(cell.golden), str(tmp_path / "golden.mcap"))
    (tmp_path / "test_it.py").write_text(
        "def test_it(jaka_cell):\n    result = jaka_cell(%r, golden='golden.mcap', arguments=['driver:=false'],\n"
        "                       tolerances=%r)\n    assert result.same, result.summary\n"
        % (str(cell.launch), str(BUSY_HOST)))
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join(path for path in sys.path if path))
    environment.pop("PYTEST_ADDOPTS", None)

    def run(*options):
        done = subprocess.run([sys.executable, "-m", "pytest", "-p", "jaka_regression.pytest_plugin", "-q",
                               "-p", "no:cacheprovider", "--junitxml=results.xml", *options], cwd=str(tmp_path),
                              env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=250)
        return done.returncode, done.stdout

    return run


def test_a_node_changed_on_purpose_makes_the_new_golden_log_and_a_report_is_left(cell, run_pytest, tmp_path):
    cell.change(("DOWN = (364.4, 233.1, 313.1", "DOWN = (364.4, 233.1, 308.1"))
    before = cell.golden.read_bytes()
    code, said = run_pytest("--jaka-update")
    assert code == 1 and "golden.mcap is the new log: an unchanged run is the same" in said, said
    assert "DIFFERENT" in said and "/jaka_driver/linear_move" in said and "/jaka_driver/tool_position" in said, said
    assert (tmp_path / "golden.mcap").read_bytes() != before == cell.golden.read_bytes()
    report = tmp_path / "jaka_reports" / "test_it.py_test_it"
    assert {"report.html", "report.xml", "report.json", "candidate.mcap", "scenario.yaml", "cell.log"} <= {
        path.name for path in report.iterdir()}
    assert sum(read_index(report / "candidate.mcap").counts) > 500
