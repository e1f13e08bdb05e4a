"""The status frame against one captured from a real controller, and against the two firmwares' field lists."""
import json
from pathlib import Path

import pytest

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.protocol.status import encode_frame, parse_status
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start
from jaka_ros_driver.simulation.controller.status_frame import MAX_POLLED_BYTES, all_field_names

CAPTURED = json.loads((Path(__file__).parents[2] / "data" / "frames" / "zu5s_1.5.14.json").read_text())


def controller(firmware="1.5.14"):
    return Controller(load_model("zu7"), FIRMWARES[firmware], Options(start=Start.ENABLED))


def shape(value):
    """Return types and lengths: bool apart from int, int and float alike."""
    if isinstance(value, list):
        return [shape(item) for item in value]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return type(value).__name__
    return "number"


def test_fields_of_the_1_5_14_frame_are_those_of_the_captured_one_in_its_order():
    frame = json.loads(controller().feed_frame.text())
    assert list(frame) == list(CAPTURED)
    assert {key: shape(value) for key, value in frame.items()} == {key: shape(value) for key, value in CAPTURED.items()}


def test_modern_frame_has_the_modern_fields():
    frame = json.loads(controller("1.7").feed_frame.text())
    names = list(frame)
    assert names[:10] == ["len", "drag_status", "errcode", "errmsg", "monitor_data", "torqsensor",
                          "joint_actual_position", "joint_position", "actual_position", "position"]
    lengths = {"din": 144, "dout": 144, "ain": 66, "aout": 66, "tio_ain": 1, "tio_key": 3, "instVel": 6, "relay_io": 2,
               "mb_slave_din": 128, "mb_slave_aout": 64, "pn_dev_ain": 64, "eip_adpt_din": 64, "eip_adpt_aout": 48}
    assert {name: len(frame[name]) for name in lengths} == lengths
    assert frame["tio_rs_signals"] == []
    assert frame["motion_line"] == 0 and frame["err_add_line"] == 0
    assert set(frame["extio"]) == {"status", "setup", "num", "pinmap", "mode"}


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("kind", ["feed_frame", "polled_frame"])
def test_text_is_what_python_writes_and_len_is_exact(firmware, kind):
    simulated = controller(firmware)
    frame = getattr(simulated, kind)
    for step in range(40):
        if step == 5:
            simulated.execute({"cmdName": "joint_move", "jointPosition": [20, 90, -90, 90, 90, 0], "speed": 90})
        if step == 20:
            simulated.state.io.set("digital", True, 0, 3, 1)
            simulated.state.hit(500.0)
        simulated.step(0.008)
        text = frame.text()
        assert json.loads(text)["len"] == len(text)
        assert text == encode_frame(frame.fields())
        assert len(text) <= MAX_POLLED_BYTES


@pytest.mark.parametrize("extra", range(0, 1200, 7))
def test_len_counts_its_own_digits(extra):
    simulated = controller()
    keep = "errmsg"
    simulated.change_fields({"pad": "x" * extra}, tuple(
        name for name in all_field_names(FIRMWARES["1.5.14"]) if name != keep))
    text = simulated.feed_frame.text()
    assert json.loads(text)["len"] == len(text)


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_numbers_are_rounded_to_5_decimals(firmware):
    simulated = controller(firmware)
    simulated.execute({"cmdName": "joint_move", "jointPosition": [20, 80, -70, 90, 60, 30], "speed": 33.3})
    for _ in range(20):
        simulated.step(0.008)
    frame = json.loads(simulated.feed_frame.text())
    for value in frame["joint_actual_position"] + frame["actual_position"]:
        assert len(repr(value).partition(".")[2]) <= 5
    assert "-0.0" not in map(repr, frame["joint_actual_position"])


def test_frame_reads_as_the_state_it_tells():
    simulated = controller("1.7")
    state = parse_status(json.loads(simulated.feed_frame.text()), 1.0)
    assert state.is_enabled and state.is_powered and state.is_in_position and not state.has_fault
    assert state.joint_position == pytest.approx(simulated.state.plant.joint_position, abs=1e-7)
    assert state.tcp_position == pytest.approx(simulated.state.plant.tcp_pose().position, abs=1e-7)
    assert state.joint_temperature == (31.0,) * 6
