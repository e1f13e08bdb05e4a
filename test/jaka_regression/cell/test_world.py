"""The world of a golden log as events after their causes, and the file that has them."""
import dataclasses
import struct

import pytest
from import_graph import ROOT
from synthetic_session import Step, simulate, write_log

from jaka_bag.compare.runs.loading import load_run
from jaka_regression.cell.history import CellHistory, Doing, read_history
from jaka_regression.cell.sightings import Sighting
from jaka_regression.cell.world import derive_events, write_scenario
from jaka_regression.log_beginning import with_beginning
from jaka_regression.scenario import (
    BEGIN,
    ArmSetup,
    CauseKind,
    ControllerEvent,
    EventCause,
    Scenario,
    parse_scenario,
    scenario_of,
)

GOLDEN = ROOT / "test" / "data" / "golden"
RISES = {"action": "set_input", "index": 3, "value": 1}
PRESSED = {"action": "press_emergency_stop"}


def output(index, at, arm="", nth=0):
    return Sighting(EventCause(CauseKind.OUTPUT, arm, ("cabinet", index, 1), nth), at)


def motion(nth, at):
    return Sighting(EventCause(CauseKind.MOTION, "", (), nth), at)


def answer(service, at, nth=0):
    return Sighting(EventCause(CauseKind.ANSWER, "", (service,), nth), at)


def terminal_input(index, at):
    return Sighting(EventCause(CauseKind.INPUT, "", ("cabinet", index, 1), 0), at)


@pytest.mark.parametrize("request_, seen, cause, delay_s", [
    (RISES, [output(2, 4.6)], output(2, 0), 0.4),
    (RISES, [output(1, 3.0), output(2, 4.6), output(4, 5.2)], output(2, 0), 0.4),
    (RISES, [output(2, 4.6), motion(1, 4.8), answer("set_io", 4.61)], output(2, 0), 0.4),
    (RISES, [output(2, 4.6, "/other"), motion(1, 4.0)], motion(1, 0), 1.0),
    (RISES, [output(2, 4.6 - 10.0), answer("linear_move", 4.5)], answer("linear_move", 0), 0.5),
    (RISES, [answer("linear_move", 4.5), answer("get_io", 4.9), answer("set_io", 4.8)], answer("linear_move", 0), 0.5),
    (RISES, [terminal_input(1, 4.5), terminal_input(3, 5.0)], terminal_input(1, 0), 0.5),
    (PRESSED, [output(2, 4.9), motion(1, 4.3), terminal_input(1, 4.5)], motion(1, 0), 0.7),
    (PRESSED, [motion(1, 4.3), answer("joint_move", 4.9, 1)], answer("joint_move", 0, 1), 0.1),
], ids=["an output", "the newest before it", "an output before a motion", "no other arm's", "no output of long ago",
        "no read", "another input", "a motion for a person", "an answer for a person"])
def test_what_the_world_did_comes_after_its_likeliest_cause(request_, seen, cause, delay_s):
    (event,) = derive_events(CellHistory(tuple(seen), (Doing("", 5.0, request_),), {}, ()))
    assert event == ControllerEvent("", cause.cause, delay_s, request_)


def test_without_any_cause_it_comes_after_the_beginning():
    (event,) = derive_events(CellHistory((motion(0, 6.0),), (Doing("", 5.0, RISES),), {}, ()))
    assert event == ControllerEvent("", BEGIN, 5.0, RISES)


def test_inputs_that_were_on_are_set_before_the_beginning():
    levels = {(CauseKind.INPUT, "tool", 1): 1, (CauseKind.INPUT, "cabinet", 0): 0, (CauseKind.OUTPUT, "cabinet", 2): 1}
    assert derive_events(CellHistory((), (), {"/left": levels}, ())) == (
        ControllerEvent("/left", BEGIN, 0.0, {"action": "set_input", "index": 1, "value": 1, "bank": "tool"}),)


@pytest.mark.parametrize("name, doings, delays", [
    ("emergency_stop", ["press_emergency_stop", "release_emergency_stop"], [0.7, 2.0]), ("collision", ["hit"], [0.7]),
    ("joint_moves", [], []), ("two_arms", [], [])])
def test_the_people_of_the_golden_logs_are_found(name, doings, delays):
    arms = ["/left", "/right"] if name == "two_arms" else [""]
    path = GOLDEN / (name + ".mcap")
    history = read_history(path, arms)
    events = derive_events(history)
    assert [event.request["action"] for event in events] == doings
    motions = [one.at for one in history.sightings if one.cause.kind is CauseKind.MOTION]
    # they were done 0.7 and 2 s after the first call, whose motion begins soon after it; states come 10 times a second
    assert [doing.at - motions[0] for doing in history.doings] == pytest.approx(delays, abs=0.25)
    begun = with_beginning(scenario_of(path), load_run(path))
    assert len(motions) >= 2 and [arm.namespace for arm in begun.arms if "joints" in dict(arm.state)] == arms
    assert bool(history.notes) == (name == "collision")


def test_the_programs_that_a_log_loads_are_stored_when_it_begins():
    path = GOLDEN / "joint_moves.mcap"
    run = load_run(path)

    def loads(name, success=True):
        return run.calls[0]._replace(service="/jaka_driver/program/load", success=success,
                                     request=struct.pack("<I", len(name)) + name.encode())
    calls = (*run.calls, loads("pick.jks"), loads("no_such", success=False), loads("pick"), loads("a b.ngc"))
    begun = with_beginning(scenario_of(path), dataclasses.replace(run, calls=calls))
    assert dict(begun.arms[0].state)["programs"] == ["a b", "pick"]
    assert "programs" not in dict(with_beginning(scenario_of(path), run).arms[0].state)


def test_a_log_without_calls_and_terminals_has_no_events(tmp_path):
    history = read_history(write_log(tmp_path / "one.mcap", simulate([Step(1.0)])), [""])
    assert derive_events(history) == () and not history.begins_with


EVENTS = (
    ControllerEvent("/left", BEGIN, 0.0, {**RISES, "bank": "tool"}),
    ControllerEvent("/right", EventCause(CauseKind.OUTPUT, "/right", ("cabinet", 2, 1), 0), 0.412, RISES),
    ControllerEvent("/left", EventCause(CauseKind.OUTPUT, "/left", ("extension", 2, 0), 3), 0.4, RISES),
    ControllerEvent("/left", EventCause(CauseKind.INPUT, "/left", ("cabinet", 0, 1), 1), 0.4, RISES),
    ControllerEvent("/left", EventCause(CauseKind.MOTION, "/left", (), 4), 0.2, PRESSED),
    ControllerEvent("/left", EventCause(CauseKind.ANSWER, "/left", ("linear_move",), 1), 0.2, {"action": "hit"}),
    ControllerEvent("/left", EventCause(CauseKind.CALL, "", (), 5), 0.2, {"action": "hit", "force": 30}))


@pytest.mark.parametrize("text", ["", "arms: [{namespace: /left}, {namespace: /right, model: zu5}]\n# mine"])
@pytest.mark.parametrize("events", [(), EVENTS])
def test_the_file_says_what_was_derived(tmp_path, events, text):
    arms = (ArmSetup("/left"), ArmSetup("/right", "zu5", ("--start", "off"), (("blocking", False),)))
    if text:
        arms = parse_scenario(text, "").arms
    scenario = Scenario(arms=arms, events=events, has_events=True)
    write_scenario(tmp_path / "scenario.yaml", scenario, text, ["the force"])
    written = (tmp_path / "scenario.yaml").read_text(encoding="utf-8")
    assert parse_scenario(written, "scenario.yaml") == scenario
    assert text in written and "# Not in here: the force." in written
    assert dataclasses.replace(scenario, events=EVENTS[:1]) != parse_scenario(written, "scenario.yaml")
