"""The driver with the report of a probe, on the controller that the report describes: its whole day, once."""
import json

import pytest
from arm_day import live_a_day, probed_arm
from import_graph import ROOT

from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.facts import Fact, ProbeStage

RECORDS = sorted((ROOT / "test" / "data" / "playback").glob("*.json"))
DRAWN = {"index 0, its axis": {"io_index_base": 0, "jog_stop_ends": "its axis", "stop_ends_jog": False},
         "numbers, slow": {"error_code": "number", "move_acceleration": 0.5, "start_delay": 0.3, "inpos": "late"}}
"""Facts of controllers that no record has, beside those of a record."""


def written(folder, facts):
    """Write the report of a probe that found these values; return its path."""
    content = report.as_json({name: Fact(value, "as recorded") for name, value in facts.items()},
                             [ProbeStage.LOOK, ProbeStage.ASK], True)
    (folder / "probe.json").write_text(json.dumps(content))
    return str(folder / "probe.json")


@pytest.mark.parametrize("facts", [*(json.loads(path.read_text(encoding="utf-8"))["facts"] for path in RECORDS),
                                   *DRAWN.values()], ids=[*(path.stem for path in RECORDS), *DRAWN])
def test_power_move_jog_servo_stop_outputs_and_recovery(ros_node, tmp_path, facts):
    path = written(tmp_path, facts)
    firmware = report.firmware_of({"version": Fact(facts.get("version"), "")}) or "1.7.2"
    with probed_arm(path, "--like", path, "--firmware", firmware, guard=False) as arm:
        live_a_day(arm)
