"""Power, enabling and alarms."""
import math
import threading

import pytest
from waiting import eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.procedures import power
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, MotionInterrupted, StopCause

HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
QUICK = {"power_delay": 0.1, "enable_delay": 0.1}


def set_power(arm, on):
    arm.run(lambda core: power.set_power(core, on))


def set_enabled(arm, on):
    arm.run(lambda core: power.set_enabled(core, on))


def clear_error(arm):
    return arm.run(power.clear_error)


def test_power_and_enable_return_when_the_arm_reports_it(bench):
    arm = bench(start="off", **QUICK).connect()
    assert power.missing_for_motion(arm.fresh_state()) == ["power", "enable"]
    set_power(arm, True)
    assert arm.fresh_state().is_powered
    set_enabled(arm, True)
    assert arm.fresh_state().is_enabled and power.missing_for_motion(arm.fresh_state()) == []
    set_power(arm, True)
    set_enabled(arm, True)
    set_power(arm, False)
    assert not arm.fresh_state().is_powered and not arm.fresh_state().is_enabled


def test_enabling_without_power_is_refused(bench):
    one = bench(start="off")
    arm = one.connect()
    with pytest.raises(InvalidCommand, match="power first"):
        set_enabled(arm, True)
    assert one.times_of("enable_robot") == []


def test_power_that_does_not_come_is_told(bench):
    arm = bench(start="off").connect(power_timeout=0.3)
    with pytest.raises(MotionInterrupted, match="power on within") as caught:
        set_power(arm, True)
    assert caught.value.cause is StopCause.TIMEOUT


def test_a_reply_that_is_held_back_until_it_is_done_costs_no_link(bench):
    # Real controllers do so: the replies to power_on and enable_robot come seconds later (protocol section 5.1).
    one = bench(start="off", power_delay=1.2, enable_delay=0.8)
    arm = one.connect(reply_timeout=0.3)
    set_power(arm, True)
    set_enabled(arm, True)
    assert arm.fresh_state().is_enabled
    assert one.requests("power_on") == one.requests("enable_robot") == 1
    assert one.requests("get_version") == 1, "the link was made once"


def test_a_stop_is_carried_out_while_power_comes(bench, call):
    one = bench(start="off", power_delay=2.0)
    arm = one.connect(reply_timeout=0.3)
    waiting = call(set_power, arm, True)
    assert eventually(lambda: one.requests("power_on"))
    arm.stop()
    assert eventually(lambda: one.requests("stop_program"))
    assert eventually(lambda: arm.fresh_state().is_powered) and waiting.error is None
    assert one.requests("get_version") == 1


def test_who_waits_for_power_at_shutdown_is_told(bench, call):
    one = bench(start="off", power_delay=60.0)
    arm = one.connect()
    waiting = call(set_power, arm, True)
    assert eventually(lambda: one.requests("power_on"))
    arm.close()
    assert isinstance(waiting.failure(), ConnectionLost) and str(waiting.error) == "driver shut down"


def test_disabling_stops_the_arm_first(bench):
    one = bench(**QUICK)
    arm = one.connect()
    arm.move(c.JointMove((3.0,) + HOME[1:], 0.2, 4.0), wait=False)
    assert eventually(one.is_moving)
    set_enabled(arm, False)
    assert not arm.fresh_state().is_enabled and not one.is_moving()
    assert one.times_of("stop_program")[0] < one.times_of("disable_robot")[0]


def test_the_way_back_after_an_emergency_stop(bench):
    one = bench(**QUICK)
    arm = one.connect()
    one.panel("press_emergency_stop")
    assert eventually(lambda: arm.fresh_state().emergency_stop)
    for act in (set_power, set_enabled):
        with pytest.raises(InvalidCommand, match="emergency stop is pressed"):
            act(arm, True)
    assert clear_error(arm)[0] == "release the emergency stop"
    one.panel("release_emergency_stop")
    assert eventually(lambda: not arm.fresh_state().emergency_stop)
    assert clear_error(arm) == ["power", "enable"]
    set_power(arm, True)
    set_enabled(arm, True)
    arm.move(c.JointMove((0.05,) + HOME[1:], 1.0, 4.0))


def test_the_way_back_after_a_protective_stop(bench):
    one = bench(**QUICK)
    arm = one.connect()
    arm.execute(c.SetCollisionLevel(1))
    arm.move(c.JointMove((3.0,) + HOME[1:], 0.2, 4.0), wait=False)
    assert eventually(one.is_moving)
    one.panel("hit")
    assert eventually(lambda: arm.fresh_state().protective_stop)
    with pytest.raises(InvalidCommand, match="clear_err first"):
        set_enabled(arm, True)
    missing = clear_error(arm)
    if missing:
        set_enabled(arm, True)
    arm.move(c.JointMove((0.5,) + HOME[1:], 1.0, 4.0))
    assert len(one.times_of("joint_move")) == 2


def test_auto_enable_acts_once_on_a_healthy_arm(bench):
    one = bench(start="off", **QUICK)
    arm = one.connect()
    arm.auto_enable()
    assert eventually(lambda: arm.fresh_state().is_enabled)
    one.panel("press_emergency_stop")
    one.panel("release_emergency_stop")
    threading.Event().wait(0.5)
    assert len(one.times_of("power_on")) == 1


@pytest.mark.parametrize("illness", ["press_emergency_stop", "hit"])
def test_auto_enable_leaves_a_sick_arm_alone(bench, illness):
    one = bench(start="enabled")
    arm = one.connect()
    arm.execute(c.SetCollisionLevel(1))
    one.panel(illness)
    assert eventually(lambda: power.missing_for_motion(arm.fresh_state()))
    arm.auto_enable()
    threading.Event().wait(0.3)
    assert {request["cmdName"] for _, request in one.received()}.isdisjoint({"power_on", "enable_robot", "clear_error"})


@pytest.mark.parametrize("disturb", [
    lambda one, arm: (one.panel("press_emergency_stop"), one.panel("release_emergency_stop")),
    lambda one, arm: one.panel("reboot", down=0.1),
    lambda one, arm: one.panel("close", port="command"),
    lambda one, arm: one.panel("close", port="status")])
def test_auto_enable_is_one_act_that_whatever_disturbs_it_ends_for_good(bench, disturb):
    one = bench(start="off", power_delay=0.5, enable_delay=0.1)
    arm = one.connect()
    arm.auto_enable()
    assert eventually(lambda: one.requests("power_on"))
    disturb(one, arm)
    threading.Event().wait(0.5)
    assert eventually(lambda: arm.is_ready)
    if not arm.fresh_state().is_powered:
        set_power(arm, True)  # an operator's own call: it powers, and enables nothing
    threading.Event().wait(1.0)
    assert not arm.fresh_state().is_enabled
    assert one.times_of("enable_robot") == []


@pytest.mark.parametrize("operate", [lambda arm: set_power(arm, True), lambda arm: arm.stop(), clear_error])
def test_auto_enable_ends_with_an_operators_call(bench, operate):
    one = bench(start="off", power_delay=0.5, enable_delay=0.1)
    arm = one.connect()
    arm.auto_enable()
    assert eventually(lambda: one.requests("power_on"))
    operate(arm)
    assert eventually(lambda: arm.fresh_state().is_powered)
    threading.Event().wait(0.5)
    assert one.times_of("enable_robot") == []


def test_an_error_is_not_cleared_where_the_arms_state_is_not_known(bench):
    one = bench()
    arm = one.connect(stale_after=0.5)
    one.panel("refuse", port="status", duration_ms=3000)
    one.panel("close", port="status")
    assert eventually(lambda: not arm.is_ready)
    threading.Event().wait(0.6)
    with pytest.raises(ConnectionLost):
        clear_error(arm)
    assert one.times_of("clear_error") == []
