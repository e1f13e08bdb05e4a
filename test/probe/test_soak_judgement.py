"""The judgement of the soaks of the probe: by the arm's own path, also of a run that ended early, and by dimension."""
import importlib.util
import itertools
import math
import signal
from pathlib import Path
from types import SimpleNamespace

import pytest
from import_graph import ROOT
from probe_bench import DimensionTable, judged
from virtual_probe import probed

from jaka_ros_driver.probe.facts import Fact, ProbeStage
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.simulation.dialect.table import Dialect


def soak_named(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "test" / "soak" / (name + ".py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def soak():
    return soak_named("soak_probe_move")


def test_each_dimension_is_counted_as_right_wrong_or_not_settled_where_it_can_be_seen():
    found = {"inpos": Fact("late", ""), "error_code": Fact(None, "why"), "start_delay": Fact(1.0, "")}
    names = ["error_code", "start_delay", "move_jerk_time", "inpos", "link_loss_notice"]
    slow = Dialect.default("1.7.2").replaced({"feed_period": 0.1})
    deaf = slow.replaced({"feed_period": 0.03, "missing_commands": ["set_network_exception_handle"]})
    table = DimensionTable()
    for dialect, mistakes in ((slow, []), (deaf, [("start_delay", 1.0, 5.0), "the arm moved"])):
        verdicts = judged(found, mistakes, names, dialect)
        table.add(verdicts)
    assert verdicts == {"inpos": "right", "error_code": "open", "start_delay": "wrong", "move_jerk_time": "open",
                        "link_loss_notice": "unseen"}
    assert table.lines()[2:] == [
        "| ask | `error_code` | 2 | 0 | 0 | 2 |", "| move | `start_delay` | 2 | 1 | 1 | 0 |",
        "| move | `move_jerk_time` | 1 | 0 | 0 | 1 |", "| move | `inpos` | 2 | 2 | 0 | 0 |",
        "| move | `link_loss_notice` | 1 | 0 | 0 | 1 |", "| ask | all 1 | 2 | 0 | 0 | 2 |",
        "| move | all 4 | 6 | 3 | 1 | 2 |", "| all | all 5 | 8 | 3 | 1 | 4 |"]


def test_what_an_arm_must_not_do_in_virtual_time_is_found():
    soak = soak_named("soak_probe_virtual")
    bench, _ = probed(Dialect.default("1.7.2"), "1.7.2", ProbeStage.MOVE, 3)
    assert soak.complaints(bench) == [] and bench.furthest > 2.0, "it has moved"
    path = list(bench.path)
    bench.path[5] = turned(5, 0.1, 0.0)[1]
    assert soak.complaints(bench) == ["the arm moved before the stage move"]
    bench.path[:] = path
    bench.path[bench.before_move + 5] = turned(0, 0.3, 0.0)[1]
    assert soak.complaints(bench) == ["joint 1 went 0.30 deg"]
    bench.path[:], bench.sent = path, [(ProbeStage.LOOK, "get_version"), (ProbeStage.MOVE, "power_on")]
    assert soak.complaints(bench) == ["in look was sent get_version, which no list has",
                                      "in move was sent power_on, which no list has"]
    bench.sent, bench.stages[:] = [], [ProbeStage.LOOK]
    bench.controller.state.enable()
    bench.sleep(20.0)
    bench.controller.state.plant.add_joint_move((*path[0][:5], path[0][5] + 0.02), 0.05)
    assert soak.complaints(bench) == [
        "the arm moved before the stage move", "the stage move was left out", "the arm moved after the end"]


class Probe:
    """A probe that has printed this, and then ends by itself or not."""

    def __init__(self, text, ends):
        self.text, self._polls = text, itertools.chain([None] * (0 if ends else 10 ** 6), itertools.repeat(1))
        self.process = SimpleNamespace(poll=lambda: next(self._polls), kill=lambda: None, send_signal=self._take)

    def _take(self, number):
        self._polls = itertools.repeat(None if number == signal.SIGSTOP else -number)

    def end(self):
        return 1


def run(soak, monkeypatch, path, sent=("joint_move", "malformed"), ends=(True,)):
    """Return what ``killed`` says of runs whose arm moved so, (s, joints), after these requests.

    ends: Of each run, whether it ends by itself before its moment.
    """
    arm = SimpleNamespace(log="none", ports=dict.fromkeys(("command_port", "status_port", "poll_port"), 1),
                          close=lambda: None, sent=lambda: list(sent))
    probes = itertools.chain(ends, itertools.repeat(ends[-1]))
    monkeypatch.setattr(soak, "start", lambda folder, seed: (arm, Dialect.default("1.7.2")))
    monkeypatch.setattr(soak, "ProbeOnTerminal", lambda words, arm: Probe(
        "jaka_probe: look: 2 s\njaka_probe:      step 7 of 15 moves it", next(probes)))
    passed = [0.0]
    monkeypatch.setattr(soak, "time", SimpleNamespace(monotonic=lambda: 100.0 + sum(passed), sleep=passed.append))

    class Verdict(soak.WireVerdict):
        def __init__(self, log):
            pass

        def joints(self):
            return path
    monkeypatch.setattr(soak, "WireVerdict", Verdict)
    return soak.killed(Path("none"), 3, 10.0)


def turned(joint, degrees, at):
    return at, tuple(angle + (math.radians(degrees) if n == joint else 0.0) for n, angle in enumerate(HOME))


STILL = [turned(5, 0.0, 50.0), turned(5, 2.0, 60.0), turned(5, 2.0, 200.0)]


@pytest.mark.parametrize("ends, place, repeated", [
    ([False], "step 7", 0), ([True, False], "step 7", 1), ([True, True, False], "step 7", 2), ([True], "", 3)])
def test_a_run_that_ended_early_is_repeated_and_at_last_a_failure(soak, monkeypatch, capsys, ends, place, repeated):
    why, where, early = run(soak, monkeypatch, STILL, ends=ends)
    assert (where, early) == (place, repeated)
    assert [line for line in why if "too busy" not in line] == [] and bool(why) == (not place), why
    told = capsys.readouterr().out
    assert told.count("ended early: ") == repeated and told.count("in step 7: at rest") == bool(place)
    assert soak.place_of("") == "before look" and soak.place_of("jaka_probe: set: these\n") == "set"


def test_a_request_that_no_list_has_is_a_complaint(soak, monkeypatch):
    why, place, _ = run(soak, monkeypatch, STILL, ["power_on"], ends=[False])
    assert len(why) == 1 and "was sent power_on, which no list has" in why[0] and place == "step 7"


@pytest.mark.parametrize("path, reason", [
    ([turned(5, 0.0, 50.0), turned(5, 3.6, 60.0), turned(5, 3.6, 106.0)], "joint 6 went 3.60 deg"),
    ([turned(5, 0.0, 50.0), turned(5, 1.0, 99.0), turned(5, 2.0, 105.0)], "moved until 5.0 s after the end"),
    ([turned(5, 0.0, 50.0), turned(0, 30.0, 60.0), turned(5, 0.0, 70.0), turned(5, 0.0, 106.0)], "the flange was")])
def test_where_its_arm_does_not_rest_in_its_room_a_run_that_ended_early_has_failed(soak, monkeypatch, path, reason):
    why, _, _ = run(soak, monkeypatch, path)
    assert any(reason in line and "ended early" in line for line in why)


def test_a_probe_that_a_signal_does_not_end_is_a_complaint(soak, monkeypatch):
    monkeypatch.setattr(soak, "ENDINGS", (signal.SIGTERM,))
    monkeypatch.setattr(Probe, "_take", lambda probe, number: None)
    why, _, _ = run(soak, monkeypatch, STILL, ends=[False])
    assert len(why) == 1 and "had not ended after 60 s" in why[0]


def test_the_error_of_each_twin_is_told(soak):
    found = {"twin_angle": Fact(0.0204, ""), "twin_time": Fact(0.0171, "")}
    assert soak.twin_error(3, found) == "dialect 3: twin within 0.020 deg and 17 ms"
    assert soak.twin_error(3, {"twin_angle": Fact(None, "it moves otherwise")}) == (
        "dialect 3: twin not settled, it moves otherwise")
    assert "the stage did not run" in soak.twin_error(3, {})
