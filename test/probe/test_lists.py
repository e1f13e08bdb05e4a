"""The lists of what each stage of jaka_probe may send: on no controller that can be drawn is anything else sent."""
import pytest
from probe_bench import MAY_SEND, drawn, wrong
from virtual_probe import NO_REQUEST, probed

from jaka_ros_driver.commands import SetPower
from jaka_ros_driver.probe import ask, look, set_same
from jaka_ros_driver.probe.facts import ProbeStage
from jaka_ros_driver.probe.move import MOVES, STEPS, Moving
from jaka_ros_driver.probe.set_same import READ_BACK, SETTINGS
from jaka_ros_driver.protocol.framing import encode_object
from jaka_ros_driver.simulation.dialect.dimension import FIRMWARE_NAMES
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS, Dialect

SEEDS = 4  # each takes 2 s; the soaks hold hundreds to the same lists


def unlisted(bench):
    """Return the stages and names of what was sent and is on no list."""
    return sorted({(stage.value, name) for stage, name in bench.sent if name not in MAY_SEND[stage]})


def controllers(name):
    """Return (firmware, dialect) for each value of a dimension; each firmware has its turn."""
    found = []
    for number, value in enumerate(DIMENSIONS[name].samples()):
        firmware = FIRMWARE_NAMES[number % len(FIRMWARE_NAMES)]
        found.append((firmware, Dialect.default(firmware).replaced({name: value})))
    return found


def run(firmware, dialect, **options):
    """Run all stages; return the bench after all that is true of each run."""
    bench, facts = probed(dialect, firmware, ProbeStage.MOVE, 3, **options)
    assert not unlisted(bench), (firmware, dialect)
    assert not wrong(facts, dialect), (firmware, dialect)
    return bench


@pytest.mark.parametrize("name", DIMENSIONS)
def test_with_no_value_of_a_dimension_a_stage_sends_what_it_does_not_list(name):
    for firmware, dialect in controllers(name):
        assert {stage for stage, _ in run(firmware, dialect).sent} == set(ProbeStage) - {ProbeStage.LOOK}


@pytest.mark.parametrize("seed", range(SEEDS))
def test_no_stage_sends_to_a_drawn_controller_what_it_does_not_list(seed):
    assert run(*drawn(seed)).sent


def test_all_that_is_listed_is_sent_and_no_output_is_switched_that_nobody_named(capsys):
    bench = run("1.7.2", Dialect.default("1.7.2"))
    names = {name for _, name in bench.sent}
    assert names >= MAY_SEND[ProbeStage.SET] | {"joint_move", "jog", "stop_program", "servo_move", "servo_j"}
    assert "clear_error" not in names, "there was no fault"
    assert "%" not in capsys.readouterr().out.replace("100 %", ""), "what is sent is told in whole sentences"
    unnamed, facts = probed(Dialect.default("1.7.2"), "1.7.2", ProbeStage.SET)
    assert "set_digital_output" not in {name for _, name in unnamed.sent} and "io_index_base" not in facts
    assert set(SETTINGS) - {name for _, name in unnamed.sent} == {"set_digital_output"}
    assert set(READ_BACK) and not set(MOVES) & set(SETTINGS)


def _on_the_status_port(monkeypatch):
    def ends(facts, first, *others, before=look._second_client):
        first.connection.send(encode_object({"cmdName": "get_version"}))
        return before(facts, first, *others)
    monkeypatch.setattr(look, "_second_client", ends)


def _among_the_questions(monkeypatch):
    def asks(asked, feed, before=ask._polling_facts):
        asked.ask("power_on")
        return before(asked, feed)
    monkeypatch.setattr(ask, "_polling_facts", asks)


def _where_a_setting_is_refused(monkeypatch):
    def same(desk, setter, back, before=set_same._same):
        desk.ask("enable_robot")
        return before(desk, setter, back)
    monkeypatch.setattr(set_same, "_same", same)


def _in_a_step(monkeypatch):
    def back(it, before=Moving.back):
        it.arm.is_taken(SetPower(True))
        before(it)
    monkeypatch.setattr(Moving, "back", back)


@pytest.mark.parametrize("plant, found", [
    (_on_the_status_port, [("look", "bytes on port status"), ("look", "get_version")]),
    (_among_the_questions, [("ask", "power_on")]), (_where_a_setting_is_refused, [("set", "enable_robot")]),
    (_in_a_step, [("move", "power_on")])])
def test_a_request_that_is_on_no_list_is_found(monkeypatch, plant, found):
    plant(monkeypatch)
    bench, _ = probed(Dialect.default("1.5.14"), "1.5.14", ProbeStage.MOVE, 3)
    assert unlisted(bench) == found
    assert NO_REQUEST not in MAY_SEND[ProbeStage.MOVE] and len(STEPS) >= 10
