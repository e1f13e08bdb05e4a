"""A controller is recorded with its driver at work, and played to a driver again: what is published is the same."""
from dataclasses import replace

import pytest
from import_graph import ROOT

from jaka_bag.cli.main import main
from jaka_bag.compare.runs.loading import load_run
from jaka_regression.replay import record_script
from jaka_regression.scenario import scenario_of
from jaka_regression.stage import script_of

GOLDEN = ROOT / "test" / "data" / "golden"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Record a collision, as a state log and as the controller's bytes."""
    folder = tmp_path_factory.mktemp("recorded")
    golden = GOLDEN / "collision.mcap"
    scenario = scenario_of(golden)
    wire = folder / "wire.mcap"
    arm = replace(scenario.arms[0], simulation=scenario.arms[0].simulation + ("--log", str(wire)))
    state = record_script(script_of(load_run(golden)), folder, replace(scenario, arms=(arm,)))
    return wire, state


@pytest.mark.parametrize("speed", ["1", "4"])
def test_a_fault_seen_once_happens_again(recorded, speed, tmp_path, capsys):
    wire, state = recorded
    code = main(["replay-wire", str(wire), "--golden", str(state), "-o", str(tmp_path / "out"), "--speed", speed,
                 "--tolerances", str(ROOT / "test" / "data" / "busy_host.yaml")])
    told, complaints = capsys.readouterr()
    assert code == 0, told + complaints
    assert "same: " in told and "without an answer" not in told
    collided = load_run(tmp_path / "out" / "candidate.mcap").states["/jaka_driver/robot_states"]
    assert collided.value[:, collided.names.index("collision_state")].max() == 1


def test_without_a_golden_log_it_only_records(recorded, tmp_path, capsys):
    wire, _ = recorded
    assert main(["replay-wire", str(wire), "-o", str(tmp_path / "out"), "--speed", "10"]) == 0
    assert "requests answered as recorded" in capsys.readouterr().out
    assert load_run(tmp_path / "out" / "candidate.mcap").streams["/jaka_driver/robot_states"]


def test_an_output_is_not_overwritten_unasked(recorded, tmp_path, capsys):
    (tmp_path / "candidate.mcap").write_bytes(b"evidence")
    assert main(["replay-wire", str(recorded[0]), "-o", str(tmp_path)]) == 1
    assert "exists" in capsys.readouterr().err
    assert (tmp_path / "candidate.mcap").read_bytes() == b"evidence"
