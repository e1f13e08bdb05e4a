"""The judgement of the soak of the stage that moves: by the arm's own log, also of a run that ended early."""
import importlib.util
import math
from pathlib import Path
from types import SimpleNamespace

import pytest
from import_graph import ROOT
from probe_bench import DimensionTable, judged

from jaka_ros_driver.probe.facts import Fact
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.simulation.dialect.table import Dialect


@pytest.fixture
def soak(monkeypatch):
    spec = importlib.util.spec_from_file_location("soak_probe_move", ROOT / "test" / "soak" / "soak_probe_move.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "WATCHED_S", 0.0)
    return module


def test_each_dimension_is_counted_as_right_not_settled_or_wrong(soak):
    found = {"inpos": Fact("late", ""), "error_code": Fact(None, "why"), "start_delay": Fact(1.0, "")}
    names = ["inpos", "error_code", "start_delay", "stop_ends_jog"]
    table = DimensionTable()
    for mistakes in ([], [("start_delay", 1.0, 5.0), "the arm moved"]):
        verdicts = judged(found, mistakes, names)
        table.add(verdicts)
    assert verdicts == {"inpos": "right", "error_code": "unknown", "start_delay": "wrong", "stop_ends_jog": "unknown"}
    assert table.lines()[2:] == [
        "| `start_delay` | 1 | 0 | 1 |", "| `inpos` | 2 | 0 | 0 |", "| `stop_ends_jog` | 0 | 2 | 0 |",
        "| `error_code` | 0 | 2 | 0 |", "| all | 3 | 4 | 1 |"]


def test_the_error_of_each_twin_is_told(soak):
    found = {"twin_angle": Fact(0.0204, ""), "twin_time": Fact(0.0171, "")}
    assert soak.twin_error(3, found) == "dialect 3: twin within 0.020 deg and 17 ms"
    assert soak.twin_error(3, {"twin_angle": Fact(None, "it moves otherwise")}) == (
        "dialect 3: twin not settled, it moves otherwise")
    assert "the stage did not run" in soak.twin_error(3, {})


class EndedEarly:
    """A probe that has ended before the step that was waited for."""

    process = SimpleNamespace(send_signal=lambda number: pytest.fail("there is nothing to end"))

    def __init__(self, command, arm=None):
        pass

    def wait_for(self, text):
        raise AssertionError("ended, the guard process does not answer")

    def end(self):
        return 1


def run(soak, monkeypatch, path, sent=("joint_move", "malformed")):
    """Return the complaints about a run that ended early, and whose arm moved so, (s, joints), after these requests."""
    arm = SimpleNamespace(log="none", ports=dict.fromkeys(("command_port", "status_port", "poll_port"), 1),
                          close=lambda: None, sent=lambda: list(sent))
    monkeypatch.setattr(soak, "start", lambda folder, seed: (arm, Dialect.default("1.7.2")))
    monkeypatch.setattr(soak, "ProbeOnTerminal", EndedEarly)
    monkeypatch.setattr(soak, "time", SimpleNamespace(monotonic=lambda: 100.0, sleep=lambda seconds: None))

    class Verdict(soak.WireVerdict):
        def __init__(self, log):
            pass

        def joints(self):
            return path
    monkeypatch.setattr(soak, "WireVerdict", Verdict)
    return soak.killed(Path("none"), 3)


def turned(joint, degrees, at):
    return at, tuple(angle + (math.radians(degrees) if n == joint else 0.0) for n, angle in enumerate(HOME))


def test_a_run_that_ended_early_has_not_failed_where_its_arm_rests_in_its_room(soak, monkeypatch, capsys):
    assert run(soak, monkeypatch, [turned(5, 0.0, 50.0), turned(5, 2.0, 60.0), turned(5, 2.0, 106.0)]) == []
    assert "dialect 3 ended early, before step" in capsys.readouterr().out


def test_a_request_that_no_list_has_is_a_complaint(soak, monkeypatch):
    path = [turned(5, 0.0, 50.0), turned(5, 0.0, 106.0)]
    assert ["was sent power_on, which no list has" in why for why in run(soak, monkeypatch, path, ["power_on"])] == [
        True]


@pytest.mark.parametrize("path, reason", [
    ([turned(5, 0.0, 50.0), turned(5, 3.6, 60.0), turned(5, 3.6, 106.0)], "a joint went 3.60 deg"),
    ([turned(5, 0.0, 50.0), turned(5, 1.0, 99.0), turned(5, 2.0, 105.0)], "moved until 5.0 s after the end"),
    ([turned(5, 0.0, 50.0), turned(0, 30.0, 60.0), turned(5, 0.0, 70.0), turned(5, 0.0, 106.0)], "the flange was")])
def test_where_its_arm_does_not_it_has(soak, monkeypatch, path, reason):
    found = run(soak, monkeypatch, path)
    assert found and all("ended early" in why for why in found) and any(reason in why for why in found)
