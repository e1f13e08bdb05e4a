"""The driver with the report of a probe, on the controller that the report describes: its whole day, once."""
import contextlib
import json
import math

import pytest
from driver_bench import HOME, Arm, DriverProcess, SimulatorProcess, on
from import_graph import ROOT
from waiting import eventually

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


def joint(arm):
    return arm.simulator.state()["joint_position"][0]


@contextlib.contextmanager
def probed_arm(folder, facts):
    """Yield the arm of a driver with this report, on a simulated controller that is like it and off at first."""
    path = written(folder, facts)
    firmware = report.firmware_of({"version": Fact(facts.get("version"), "")}) or "1.7.2"
    with contextlib.closing(SimulatorProcess("--like", path, "--firmware", firmware)) as simulator:
        with DriverProcess(controller_profile=path, auto_enable=False, **on(simulator, guard=False)):
            arm = Arm(simulator)
            arm.wait_until_seen()
            yield arm


@pytest.mark.parametrize("facts", [*(json.loads(path.read_text(encoding="utf-8"))["facts"] for path in RECORDS),
                                   *DRAWN.values()], ids=[*(path.stem for path in RECORDS), *DRAWN])
def test_power_move_jog_servo_stop_outputs_and_recovery(ros_node, tmp_path, facts):
    with probed_arm(tmp_path, facts) as arm:
        assert arm.call("power", data=True).success and arm.call("enable", data=True).success
        arm.go_home()
        assert arm.call("joint_move", pose=[0.1] + HOME[1:], mvvelo=1.0, mvacc=6.0).ret == 1
        assert joint(arm) == pytest.approx(math.degrees(0.1), abs=0.01)

        assert arm.call("jog", mvvelo=0.2, coord_mode=0, index=0).ret == 1
        assert eventually(lambda: joint(arm) > math.degrees(0.12))
        arm.call("stop_move")
        assert eventually(lambda: not arm.simulator.is_moving())

        assert arm.call("servo_move_enable", enable=True).ret == 1
        begun = arm.listen("joint_position", 1)[0].position
        for step in range(1, 6):
            assert arm.call("servo_j", pose=[begun[0] + 0.001 * step, *begun[1:]]).ret == 1
        assert eventually(lambda: joint(arm) > math.degrees(begun[0] + 0.003))
        assert arm.call("servo_move_enable", enable=False).ret == 1

        assert arm.call("set_io", signal="digital", type=0, index=2, value=1.0).ret == 1
        assert eventually(lambda: arm.simulator.state()["digital_outputs"][:4] == [0, 0, 1, 0])

        arm.simulator.operate("press_emergency_stop")
        assert eventually(lambda: arm.listen("robot_states", 1)[0].motion_state == 2)
        arm.simulator.operate("release_emergency_stop")
        assert eventually(lambda: arm.listen("robot_states", 1)[0].motion_state != 2)
        recovered = arm.call("recover")
        assert recovered.success, recovered.message
        assert arm.call("joint_move", pose=HOME, mvvelo=1.0, mvacc=6.0).ret == 1
