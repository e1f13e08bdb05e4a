"""A report of jaka_probe as a simulated controller: what is taken from it, what is refused, how its arm stops."""
import json
import math

import pytest

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S, JogMode, Plant
from jaka_ros_driver.simulation.dialect.like import like_controller
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.simulation.simulated_controller import SimulatedController

REPORT = {"format": 1, "firmware": "1.7.2", "dialect": {"inpos": "late", "servo_queue": 4},
          "facts": {"model": {"value": ["zu12", "pro12"]}, "stop_deceleration": {"value": 40.0}}}


def written(tmp_path, **changes):
    path = tmp_path / "probe.json"
    path.write_text(json.dumps({**REPORT, **changes}))
    return str(path)


def test_a_report_gives_firmware_model_dialect_and_deceleration(tmp_path):
    found = like_controller(written(tmp_path))
    assert (found.firmware, found.model, found.stop_deceleration) == ("1.7.2", "zu12", 40.0)
    assert found.dialect == Dialect.default("1.7.2").replaced(REPORT["dialect"])
    other = like_controller(written(tmp_path, facts={"stop_deceleration": {"value": None}}), "1.5.14")
    assert (other.firmware, other.model, other.stop_deceleration) == ("1.5.14", "", None)


@pytest.mark.parametrize("times, delays", [
    ((0.004, 0.012), (0.004, 0.012)), ((0.004, None), (0.004, 0.004)), ((None, 0.012), (0.0, 0.012)),
    ((0.02, 0.01), (0.02, 0.02)), ((10 ** 400, -1.0), (0.0, 0.0)), ((math.nan, True), (0.0, 0.0)),
    (("1", 3.5), (0.0, 0.0))])
def test_a_report_gives_the_delays_of_replies(tmp_path, times, delays):
    facts = {name: {"value": value} for name, value in zip(("reply_time", "reply_time_p99"), times)}
    assert like_controller(written(tmp_path, facts=facts)).reply_delays == delays


@pytest.mark.parametrize("changes, reason", [
    ({"format": 2}, "no probe.json"), ({"dialect": None}, "no probe.json"),
    ({"dialect": {"inpos": "often"}}, "inpos is"),
    ({"dialect": {"mood": 1}}, "'mood' is no dimension"), ({"firmware": ""}, "does not tell the firmware"),
    ({"firmware": 3}, "does not tell the firmware"), ({"firmware": "9.9"}, "firmware is '9.9'")])
def test_a_report_that_is_none_is_refused_with_the_reason(tmp_path, changes, reason):
    with pytest.raises(InvalidCommand, match=reason):
        like_controller(written(tmp_path, **changes))
    with pytest.raises(InvalidCommand, match="No such file"):
        like_controller(str(tmp_path / "none.json"))


@pytest.mark.parametrize("rate", [10 ** 400, -10 ** 400, math.inf, math.nan, 0, True, "40"])
def test_a_deceleration_that_is_none_is_left_out(tmp_path, rate):
    found = like_controller(written(tmp_path, facts={"stop_deceleration": {"value": rate}}))
    assert found.stop_deceleration is None


def stopped(share, speed=0.3, seconds=1.0, target=None):
    """Return seconds and way, rad, of a stop of joint 6 at this share of the strongest deceleration."""
    plant = Plant(load_model("zu7"))
    plant.queue.braking_share = share
    if target is None:
        plant.jog(JogMode.CONTINUOUS, JogFrame.JOINT, 5, speed)
    else:
        plant.add_joint_move((*plant.joint_position[:5], target), speed, 10.0)
    for _ in range(round(seconds / CYCLE_TIME_S)):
        plant.step()
    begun, cycles = plant.joint_position[5], 0
    plant.stop()
    while not plant.is_in_position:
        plant.step()
        cycles += 1
    return cycles * CYCLE_TIME_S, plant.joint_position[5] - begun


def test_an_arm_stops_as_slowly_as_it_was_seen_to():
    strongest = load_model("zu7").joint_max_acceleration[5]
    for deceleration in (0.5, 1.0, 2.0):
        took, way = stopped(deceleration / strongest)
        assert took == pytest.approx(0.3 / deceleration, abs=0.07)  # its jerk takes time, too
        assert way == pytest.approx(0.3 ** 2 / (2 * deceleration), abs=0.3 * 0.05)
    assert stopped(1.0)[0] < 0.1


def test_a_stop_near_the_end_of_a_move_does_not_pass_it():
    for seconds in (0.5, 0.9, 0.95, 0.98):
        _, way = stopped(0.02, seconds=seconds, target=0.3)
        assert 0.0 <= way <= 0.3 + 1e-6


def test_the_share_is_that_of_joint_6_within_what_the_model_allows():
    strongest = load_model("zu7").joint_max_acceleration[-1]
    for rate, share in ((None, 1.0), (strongest / 4, 0.25), (1e9, 1.0), (math.radians(0.001), 0.01)):
        arm = SimulatedController(stop_deceleration=rate)
        assert arm.server.controller.state.plant.queue.braking_share == pytest.approx(share)
        arm.start()
        arm.close()
