"""Golden logs replayed: the driver of this checkout against simulated controllers."""
import contextlib
import dataclasses
import json

import pytest
import yaml
from import_graph import ROOT
from probe_bench import Controller, probe

from jaka_bag.compare.tolerances import load_tolerances
from jaka_bag.compare.verdict import Aspect
from jaka_bag.containers.registry import read_index
from jaka_bag.errors import JakaBagError
from jaka_regression import command_lines
from jaka_regression.pytest_plugin import jaka_replay  # noqa: F401 - a fixture
from jaka_regression.replay import replay, takes_time_scale
from jaka_regression.scenario import scenario_of

FOLDER = ROOT / "test" / "data" / "golden"
BUSY_HOST = ROOT / "test" / "data" / "busy_host.yaml"
NAMES = sorted(path.stem for path in FOLDER.glob("*.mcap"))
SESSIONS = {"boot", "joint_moves", "linear_moves", "jog_watchdog", "servo_stream", "stop_in_mid_move", "collision",
            "emergency_stop", "reconnect", "io_sequence", "two_arms"}


def test_the_library_is_whole_small_and_says_where_it_comes_from():
    assert set(NAMES) == SESSIONS
    for name in NAMES:
        text = yaml.safe_load((FOLDER / (name + ".yaml")).read_text(encoding="utf-8"))
        assert len(text["about"]) > 40 and text["licence"].startswith("CC0")
        assert (FOLDER / (name + ".mcap")).stat().st_size < 500000
        assert sum(read_index(FOLDER / (name + ".mcap")).counts) > 1000


@pytest.mark.parametrize("name, time_scale", [
    *((name, 1.0) for name in NAMES if name != "collision"),  # test_replay_wire.py makes it at its own speed
    ("collision", 4.0), ("joint_moves", 4.0)])
def test_it_happens_again(name, time_scale, jaka_replay):  # noqa: F811
    result = jaka_replay(FOLDER / (name + ".mcap"), BUSY_HOST, time_scale)
    assert result.same, result.summary


def test_nothing_is_asked_of_the_driver_before_the_recorder_hears_it(tmp_path, monkeypatch):
    late = ("import sys, time\nfrom jaka_bag.live.session import RecordingSession as S\nlook = S._look_at_graph\n"
            "S._look_at_graph = lambda *given: (time.sleep(4.0), look(*given))\n"
            "from jaka_bag.cli.main import main\nsys.exit(main())")
    monkeypatch.setattr(command_lines, "JAKA_BAG", ("-c", late))
    result = replay(FOLDER / "io_sequence.mcap", tmp_path, load_tolerances(BUSY_HOST), 4.0)
    assert result.same, result.summary


def test_what_depends_on_the_drivers_own_clock_keeps_its_speed(tmp_path):
    jog = FOLDER / "jog_watchdog.mcap"
    cut = FOLDER / "reconnect.mcap"
    assert not takes_time_scale(jog) and not takes_time_scale(cut) and takes_time_scale(FOLDER / "joint_moves.mcap")
    assert takes_time_scale(FOLDER / "emergency_stop.mcap")
    with pytest.raises(JakaBagError, match="jog, whose course depends on the driver's own clock"):
        replay(jog, tmp_path, time_scale=2.0)
    with pytest.raises(JakaBagError, match=r"the link disturbed \(close, refuse\), whose course depends"):
        replay(cut, tmp_path, time_scale=2.0)
    with pytest.raises(JakaBagError, match="it must be 0.1 to 10"):
        replay(FOLDER / "joint_moves.mcap", tmp_path, time_scale=11.0)


def changed(name, **arm):
    """Return the scenario of a golden log with something wrong at its first arm."""
    scenario = scenario_of(FOLDER / (name + ".mcap"))
    return dataclasses.replace(scenario, arms=(dataclasses.replace(scenario.arms[0], **arm),) + scenario.arms[1:])


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Return the path of the report of a probe of the usual simulated controller, which sets and moves nothing."""
    folder = tmp_path_factory.mktemp("probed")
    with contextlib.closing(Controller(folder)) as arm:
        assert probe(folder / "probe", arm.ports).returncode == 0
    return folder / "probe" / "probe.json"


@pytest.mark.parametrize("name", ["joint_moves", "emergency_stop", "io_sequence"])
def test_it_happens_again_on_a_twin_of_the_arm(name, report, tmp_path):
    before = scenario_of(FOLDER / (name + ".mcap")).arms[0].simulation
    on_twin = changed(name, simulation=(*before, "--like", str(report)))
    result = replay(FOLDER / (name + ".mcap"), tmp_path, load_tolerances(BUSY_HOST), 4.0, on_twin)
    assert result.same, result.summary
    assert "like %s" % report in (tmp_path / "simulation0.log").read_text()


def test_a_twin_of_another_arm_is_found(report, tmp_path):
    content = json.loads(report.read_text())
    content["dialect"]["move_acceleration"] = 0.2
    other = tmp_path / "other.json"
    other.write_text(json.dumps(content))
    on_twin = changed("joint_moves", simulation=("--start", "enabled", "--like", str(other)))
    result = replay(FOLDER / "joint_moves.mcap", tmp_path, time_scale=4.0, scenario=on_twin)
    assert Aspect.PACE in {check.aspect for check in result.comparison.differences}, result.summary


@pytest.mark.parametrize("name, arm, time_scale, stages", [
    ("joint_moves", {"simulation": ("--start", "enabled", "--time-scale", "0.97")}, 1.0, {Aspect.PACE}),
    ("joint_moves", {"parameters": (("interface", "vendor"),)}, 4.0, {Aspect.POSITION, Aspect.ORIENTATION}),
    ("joint_moves", {"model": "zu12"}, 4.0, {Aspect.POSITION}),
    ("io_sequence", {"simulation": ("--start", "off"), "parameters": (("auto_enable", False),)}, 4.0, {Aspect.STATES}),
], ids=["3 % slower", "maker's units", "another arm", "not powered"])
def test_a_driver_or_an_arm_that_does_something_else_is_found(name, arm, time_scale, stages, tmp_path):
    result = replay(FOLDER / (name + ".mcap"), tmp_path, time_scale=time_scale, scenario=changed(name, **arm))
    assert stages <= {check.aspect for check in result.comparison.differences}, result.summary
