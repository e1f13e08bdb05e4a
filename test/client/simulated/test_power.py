"""Power, enabling and alarms, against the simulated controller in virtual time."""
import re

import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.procedures import power
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.simulation.controller.state import Start

MODEL = load_model("zu7")


def simulated(power_delay=0.1, enable_delay=0.1, **options):
    return SimulatedArm(MODEL, HOME, dialect={"power_delay": power_delay, "enable_delay": enable_delay}, **options)


def in_mid_move(arm):
    assert arm.ended(arm.begin("move", c.JointMove((3.0,) + HOME[1:], 0.2, 4.0), False)) is None
    arm.until(lambda: arm.is_moving)


def moved(arm, first, speed=1.0):
    assert arm.ended(arm.begin("move", c.JointMove((first,) + HOME[1:], speed, 4.0), True)) is None


def auto_enable(arm):
    arm.core.run(None, power.auto_enable(arm.core, arm.core.disturbances - arm.core.link_losses), arm.now)


def has_asked_for_power(arm):
    arm.until(lambda: arm.times_of("power_on"))


def set_power(arm, on):
    return arm.does(lambda core: power.set_power(core, on))


def set_enabled(arm, on):
    return arm.does(lambda core: power.set_enabled(core, on))


def clear_error(arm):
    return arm.does(power.clear_error)


def test_power_and_enable_return_when_the_arm_reports_it():
    arm = simulated(start=Start.OFF)
    assert power.missing_for_motion(arm.state) == ["power", "enable"]
    set_power(arm, True)
    assert arm.state.is_powered
    set_enabled(arm, True)
    assert arm.state.is_enabled and power.missing_for_motion(arm.state) == []
    assert set_power(arm, True) == set_enabled(arm, True) == ""
    assert set_power(arm, False) == "the drives were disabled"
    assert not arm.state.is_powered and not arm.state.is_enabled
    assert set_power(arm, False) == ""


def test_enabling_without_power_is_refused():
    arm = simulated(start=Start.OFF)
    with pytest.raises(InvalidCommand, match="power first"):
        set_enabled(arm, True)
    assert arm.times_of("enable_robot") == []


def test_power_that_does_not_come_is_told():
    arm = simulated(power_delay=15.0, start=Start.OFF, power_timeout=0.3)
    with pytest.raises(MotionInterrupted, match="power on within") as caught:
        set_power(arm, True)
    assert caught.value.cause is StopCause.TIMEOUT


def test_a_reply_that_is_held_back_until_it_is_done_costs_no_link():
    # Real controllers do so: the replies to power_on and enable_robot come seconds later (protocol section 5.1).
    arm = simulated(start=Start.OFF, power_delay=1.2, enable_delay=0.8, reply_timeout=0.3)
    set_power(arm, True)
    set_enabled(arm, True)
    assert arm.state.is_enabled
    assert len(arm.times_of("power_on")) == len(arm.times_of("enable_robot")) == 1
    assert len(arm.times_of("get_version")) == 1, "the link was made once"


def test_a_reply_that_does_not_come_with_its_effect_is_told_with_the_time_that_it_had():
    arm = SimulatedArm(MODEL, HOME, dialect={"power_delay": 0.5, "power_reply_delay": 10.0}, start=Start.OFF)
    set_power(arm, True)
    arm.until(lambda: arm.closed_for)
    assert re.fullmatch(r"no reply to power_on within 1\.\d+ s", arm.closed_for[0])


def test_a_stop_is_carried_out_while_power_comes():
    arm = simulated(start=Start.OFF, power_delay=2.0, reply_timeout=0.3)
    waiting = arm.begin("run", power.set_power(arm.core, True))
    has_asked_for_power(arm)
    assert arm.ended(arm.begin("stop")) is None
    assert len(arm.times_of("stop_program")) == 1
    arm.until(lambda: arm.state.is_powered)
    assert waiting.error is None
    assert len(arm.times_of("get_version")) == 1


def test_who_waits_for_power_at_shutdown_is_told():
    arm = simulated(start=Start.OFF, power_delay=15.0)
    waiting = arm.begin("run", power.set_power(arm.core, True))
    has_asked_for_power(arm)
    arm.act(arm.core.close)
    arm.act(arm.core.disconnect)
    assert isinstance(arm.ended(waiting), ConnectionLost) and str(waiting.error) == "driver shut down"


def test_disabling_stops_the_arm_first():
    arm = simulated()
    in_mid_move(arm)
    assert set_enabled(arm, False) == "all motion was stopped"
    assert not arm.state.is_enabled and not arm.is_moving
    assert arm.times_of("stop_program")[0] < arm.times_of("disable_robot")[0]


def test_the_way_back_after_an_emergency_stop():
    arm = simulated()
    arm.controller.state.press_emergency_stop()
    arm.until(lambda: arm.state.emergency_stop)
    for act in (set_power, set_enabled):
        with pytest.raises(InvalidCommand, match="emergency stop is pressed"):
            act(arm, True)
    assert clear_error(arm)[1][0] == "release the emergency stop"
    arm.controller.state.release_emergency_stop()
    arm.until(lambda: not arm.state.emergency_stop)
    assert clear_error(arm) == ("alarms cleared", ["power", "enable"])
    set_power(arm, True)
    set_enabled(arm, True)
    moved(arm, 0.05)


def test_the_way_back_after_a_protective_stop():
    arm = simulated()
    arm.does(lambda core: core.ask(c.SetCollisionLevel(1)))
    in_mid_move(arm)
    arm.controller.state.hit(150.0)
    arm.until(lambda: arm.state.protective_stop)
    with pytest.raises(InvalidCommand, match="clear_err first"):
        set_enabled(arm, True)
    cleared, missing = clear_error(arm)
    assert cleared == "alarms cleared, protective stop left"
    if missing:
        set_enabled(arm, True)
    moved(arm, 0.5)
    assert len(arm.times_of("joint_move")) == 2


def test_auto_enable_acts_once_on_a_healthy_arm():
    arm = simulated(start=Start.OFF)
    auto_enable(arm)
    arm.until(lambda: arm.state.is_enabled)
    arm.controller.state.press_emergency_stop()
    arm.controller.state.release_emergency_stop()
    arm.run(0.5)
    assert len(arm.times_of("power_on")) == 1


@pytest.mark.parametrize("illness", [lambda state: state.press_emergency_stop(), lambda state: state.hit(150.0)],
                         ids=["emergency stop", "hit"])
def test_auto_enable_leaves_a_sick_arm_alone(illness):
    arm = simulated(start=Start.ENABLED)
    arm.does(lambda core: core.ask(c.SetCollisionLevel(1)))
    illness(arm.controller.state)
    arm.until(lambda: power.missing_for_motion(arm.state))
    auto_enable(arm)
    arm.run(0.3)
    assert {request["cmdName"] for _, request in arm.sent}.isdisjoint({"power_on", "enable_robot", "clear_error"})


@pytest.mark.parametrize("disturb", [
    lambda arm: (arm.controller.state.press_emergency_stop(), arm.controller.state.release_emergency_stop()),
    lambda arm: arm.restart(0.1),
    lambda arm: arm.cut(Port.COMMAND),
    lambda arm: arm.cut(Port.STATUS)])
def test_auto_enable_is_one_act_that_whatever_disturbs_it_ends_for_good(disturb):
    arm = simulated(start=Start.OFF, power_delay=0.5, enable_delay=0.1)
    auto_enable(arm)
    has_asked_for_power(arm)
    disturb(arm)
    arm.run(0.5)
    arm.until(lambda: arm.core.is_ready(arm.now))
    if not arm.state.is_powered:
        set_power(arm, True)  # an operator's own call: it powers, and enables nothing
    arm.run(1.0)
    assert not arm.state.is_enabled
    assert arm.times_of("enable_robot") == []


@pytest.mark.parametrize("operate", [lambda arm: set_power(arm, True), lambda arm: arm.begin("stop"), clear_error])
def test_auto_enable_ends_with_an_operators_call(operate):
    arm = simulated(start=Start.OFF, power_delay=0.5, enable_delay=0.1)
    auto_enable(arm)
    has_asked_for_power(arm)
    operate(arm)
    arm.until(lambda: arm.state.is_powered)
    arm.run(0.5)
    assert arm.times_of("enable_robot") == []


def test_an_error_is_not_cleared_where_the_arms_state_is_not_known():
    arm = simulated(stale_after=0.5)
    arm.cut(Port.STATUS, 3.0)
    arm.until(lambda: not arm.core.is_ready(arm.now))
    arm.run(0.6)
    with pytest.raises(ConnectionLost):
        clear_error(arm)
    assert arm.times_of("clear_error") == []
