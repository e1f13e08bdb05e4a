"""The sensor at the flange: the feed's values for a load, and zeroing."""
import json

import pytest

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.force_sensor import BIAS, ZEROING_TIME_S
from jaka_ros_driver.simulation.controller.state import Options

LOAD = (10.0, -5.0, 2.5, 0.5, 0.25, -0.125)
NOTHING = (0.0,) * 6


def controller(firmware="1.5.14", **options):
    return Controller(load_model("zu7"), FIRMWARES[firmware], Options(**options))


def readings(simulated):
    return json.loads(simulated.feed_frame.text())["torqsensor"][1][2:]


def wrench(simulated):
    return parse_status(json.loads(simulated.feed_frame.text()), 0.0).wrench


@pytest.mark.parametrize("firmware, rows", [("1.5.14", 2), ("1.7", 3)])
def test_without_a_sensor_each_reading_is_zero(firmware, rows):
    simulated = controller(firmware)
    assert readings(simulated) == [list(NOTHING)] * rows and wrench(simulated) is None
    assert simulated.execute({"cmdName": "zero_end_sensor"}).command == "zero_end_sensor"
    simulated.step(1.0)
    assert wrench(simulated) is None


@pytest.mark.parametrize("firmware", ["1.5.14", "1.7"])
def test_the_feed_tells_the_load_and_the_raw_reading_is_never_zero(firmware):
    simulated = controller(firmware, has_force_sensor=True)
    assert wrench(simulated) == NOTHING and readings(simulated)[1] == list(BIAS)
    simulated.state.force_sensor.load(LOAD)
    assert wrench(simulated) == LOAD
    assert readings(simulated)[1] == pytest.approx([load + bias for load, bias in zip(LOAD, BIAS)])


def test_zeroing_takes_its_time_and_takes_the_load_of_its_end_as_nothing():
    simulated = controller(has_force_sensor=True)
    simulated.execute({"cmdName": "zero_end_sensor"})
    simulated.state.force_sensor.load(LOAD)
    simulated.step(0.5 * ZEROING_TIME_S)
    assert wrench(simulated) == LOAD
    simulated.step(ZEROING_TIME_S)
    assert wrench(simulated) == NOTHING
    simulated.state.force_sensor.load(NOTHING)
    assert wrench(simulated) == pytest.approx([-value for value in LOAD])


def test_the_command_tells_the_reading_of_each_kind():
    simulated = controller(has_force_sensor=True)
    simulated.state.force_sensor.load(LOAD)
    told = [json.loads(simulated.execute({"cmdName": "get_torque_sensor_data", "type": kind}).reply)
            ["torque_sensor_data"] for kind in (1, 2, 3)]
    assert told[0] == told[2] == list(LOAD) and told[1] == readings(simulated)[1]


def test_the_load_stays_when_the_cabinet_is_turned_off_and_on():
    simulated = controller(has_force_sensor=True)
    simulated.state.force_sensor.load(LOAD)
    simulated.restart()
    assert wrench(simulated) == LOAD
