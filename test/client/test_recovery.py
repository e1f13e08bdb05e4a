"""Recovery: from each state in which the simulated controller can be to an arm that can move, or the reason why not.

Requests are judged by the controller's own log.
"""
import threading

import pytest
from waiting import eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.contradictions import standing_cause
from jaka_ros_driver.client.core.procedures import power, recovery, settings
from jaka_ros_driver.client.core.procedures.recovery import RecoveryCancelled, RecoveryInterrupted
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.simulation.arm import events

HOME = (0.0, 1.5707963, -1.5707963, 1.5707963, 1.5707963, 0.0)
QUICK = {"power_delay": 0.1, "enable_delay": 0.1}
CLEAR, LEAVE, POWER, ENABLE = "clear error", "leave protective stop", "power", "enable"
WIRE_NAMES = {CLEAR: "clear_error", POWER: "power_on", ENABLE: "enable_robot"}
MOTION = {"joint_move", "moveL", "movc", "jog", "servo_move", "servo_j", "servo_p", "play_program", "resume_program",
          "end_move"}
STOPPING = {("jog", 0), ("servo_move", 0)}


class Recovering:
    """A recovery's observer: its questions and its reports."""

    def __init__(self, arm):
        self.arm = arm
        self.steps = []
        self.is_cancelled = False

    def __call__(self):
        return self.arm.run(lambda core: recovery.recover(
            core, lambda step: self.steps.append(step.value), lambda: self.is_cancelled))


def sent(one):
    """Return the names of the commands of recovery that came in, in their order; none may have come that moves the
    arm."""
    names = [request["cmdName"] for _, request in one.received()]
    assert not moving(one)
    return [name for name in names if name in WIRE_NAMES.values()]


def moving(one):
    """Return the names of the commands that came in and move the arm, or would; the parts of a stop do not."""
    return {request["cmdName"] for _, request in one.received() if request["cmdName"] in MOTION
            and (request["cmdName"], request.get("jog_mode", request.get("relFlag"))) not in STOPPING}


def on_wire(steps):
    return [WIRE_NAMES[step] for step in steps if step in WIRE_NAMES]


def nothing(one, arm):
    """Leave the state in which the controller starts."""


def disabled(one, arm):
    arm.run(lambda core: power.set_enabled(core, False))


def pressed(one, arm):
    one.panel("press_emergency_stop")
    assert eventually(lambda: arm.fresh_state().emergency_stop)


def pressed_and_released(one, arm):
    pressed(one, arm)
    one.panel("release_emergency_stop")
    assert eventually(lambda: not arm.fresh_state().emergency_stop)


def hit(one, arm, **joint):
    arm.execute(c.SetCollisionLevel(1))
    assert one.panel("hit", **joint)["noticed"]
    assert eventually(lambda: arm.fresh_state().protective_stop)


def hit_in_mid_move(one, arm):
    arm.execute(c.SetCollisionLevel(1))
    arm.move(c.JointMove((3.0,) + HOME[1:], 0.2, 4.0), wait=False)
    assert eventually(one.is_moving)
    one.panel("hit")
    assert eventually(lambda: arm.fresh_state().protective_stop)


def hit_and_then_pressed_and_released(one, arm):
    hit(one, arm)
    pressed_and_released(one, arm)


def event(what):
    def happen(one, arm):
        state = one.controller.server.controller.state
        one.controller.server.call(lambda: state._take_event(what))
        assert eventually(lambda: arm.fresh_state().error_code == what.code)
    return happen


def rebooted(one, arm):
    connections = arm.link_health.connections
    one.panel("reboot", down=0.1)
    assert eventually(lambda: arm.link_health.connections > connections and arm.is_ready)
    assert eventually(lambda: not arm.fresh_state().is_powered)


def shown(**fields):
    """Show this in the feed, whatever is done."""
    def show(one, arm):
        one.panel("fields", add=fields)
        assert eventually(lambda: arm.fresh_state().has_fault or arm.fresh_state().protective_stop)
    return show


def guided(one, arm):
    arm.run(lambda core: settings.set_hand_guiding(core, True))


def guided_into_a_soft_limit(one, arm):
    guided(one, arm)
    one.panel("push", joint=3, velocity=-90.0, duration=5.0)
    assert eventually(lambda: arm.fresh_state().error_code == events.HAND_GUIDING_HIT_SOFT_LIMIT.code)


def refused_by_the_controller(one, arm):
    state = one.controller.server.controller.state

    def refuse(*_):
        raise events.TargetRejected(events.NOT_ALLOWED_IN_MODE)
    event(events.LINEAR_MOVE_FAILED)(one, arm)
    state.alarms.clear = refuse


def without_links(one, arm):
    one.panel("refuse", port="command", duration_ms=4000)
    one.panel("close", port="command")
    assert eventually(lambda: not arm.is_ready)


def silent(one, arm):
    one.panel("refuse", port="status", duration_ms=4000)
    one.panel("close", port="status")
    threading.Event().wait(0.6)


READY = [
    ("drives off", "off", nothing, [POWER, ENABLE]),
    ("powered", "powered", nothing, [ENABLE]),
    ("ready", "enabled", nothing, []),
    ("disabled", "enabled", disabled, [ENABLE]),
    ("emergency stop released", "enabled", pressed_and_released, [CLEAR, POWER, ENABLE]),
    ("collision", "enabled", hit, [CLEAR, LEAVE]),
    ("collision of a joint", "enabled", lambda one, arm: hit(one, arm, joint=3), [CLEAR, LEAVE]),
    ("collision in mid move", "enabled", hit_in_mid_move, [CLEAR, LEAVE]),
    ("collision, then emergency stop", "enabled", hit_and_then_pressed_and_released, [CLEAR, LEAVE, POWER, ENABLE]),
    ("singularity, protective stop", "enabled", event(events.SINGULARITY_PROTECTIVE_STOP), [CLEAR, LEAVE]),
    ("a line that failed", "enabled", event(events.LINEAR_MOVE_FAILED), [CLEAR]),
    ("drives off, and a fault", "off", event(events.SINGULARITY), [CLEAR, POWER, ENABLE]),
    ("restarted", "enabled", rebooted, [POWER, ENABLE]),
    ("guided into a soft limit", "enabled", guided_into_a_soft_limit, [CLEAR]),
]


@pytest.mark.parametrize("start, fault, steps", [row[1:] for row in READY], ids=[row[0] for row in READY])
def test_from_each_fault_state_to_an_arm_that_can_move(bench, start, fault, steps):
    one = bench(start=start, **QUICK)
    arm = one.connect()
    fault(one, arm)
    assert eventually(lambda: not one.is_moving())
    before = one.controller.state()["joint_position"]
    recover = Recovering(arm)
    said = recover()
    state = arm.fresh_state()
    assert standing_cause(state) is None and not state.protective_stop and not state.emergency_stop
    assert recover.steps == steps
    assert one.controller.state()["joint_position"] == before, "the arm has moved"
    assert said.startswith("the arm is ready: " + (", ".join(steps) or "nothing was to be done"))
    assert ("until the joint is moved away" in said) is (fault is guided_into_a_soft_limit)
    if fault is not guided_into_a_soft_limit:
        assert recover() == "the arm is ready: nothing was to be done"
    names = [request["cmdName"] for _, request in one.received()]
    assert [name for name in names if name in WIRE_NAMES.values()] == on_wire(steps)
    assert len(moving(one)) == (1 if fault is hit_in_mid_move else 0)


NOT_READY = [
    ("emergency stop pressed", pressed, InvalidCommand, "emergency stop is pressed; release it first", []),
    ("guided by hand", guided, InvalidCommand, "somebody guides the arm by hand", []),
    ("an alarm that stays", shown(errcode="0xF0001", errmsg="a fault"), MotionInterrupted,
     "an alarm still stands: 0xF0001 a fault", [CLEAR]),
    ("a protective stop that stays", shown(protective_stop=1), MotionInterrupted,
     "protective stop: it still stands 3 s after clear_error", [CLEAR, LEAVE]),
    ("clearing is refused", refused_by_the_controller, CommandRejected, "rejected clear_error", [CLEAR]),
    ("no link", without_links, ConnectionLost, "no link to the controller", []),
    ("no status", silent, ConnectionLost, "no fresh status", []),
]


@pytest.mark.parametrize("fault, error, reason, steps", [row[1:] for row in NOT_READY],
                         ids=[row[0] for row in NOT_READY])
def test_where_it_cannot_succeed_it_says_precisely_why(bench, fault, error, reason, steps):
    one = bench(**QUICK)
    arm = one.connect(stale_after=0.5)
    fault(one, arm)
    recover = Recovering(arm)
    with pytest.raises(error, match=reason):
        recover()
    assert recover.steps == steps
    assert sent(one) == on_wire(steps)


@pytest.mark.parametrize("slow, reason, steps", [
    ({"power_delay": 60.0}, "the arm did not power on within 0 s", [POWER]),
    ({"power_delay": 0.1, "enable_delay": 60.0}, "the arm did not enable within 0 s", [POWER, ENABLE])])
def test_a_step_that_takes_too_long_is_told(bench, slow, reason, steps):
    one = bench(start="off", **slow)
    recover = Recovering(one.connect(power_timeout=0.4, enable_timeout=0.4))
    with pytest.raises(MotionInterrupted, match=reason) as caught:
        recover()
    assert caught.value.cause is StopCause.TIMEOUT and recover.steps == steps
    assert sent(one) == on_wire(steps)


def test_the_emergency_stop_ends_it_at_once_and_then_it_is_refused(bench, call):
    one = bench(start="off", power_delay=5.0)
    arm = one.connect()
    recover = Recovering(arm)
    waiting = call(recover)
    assert eventually(lambda: one.requests("power_on"))
    pressed(one, arm)
    assert "emergency stop: it ended the recovery at the step \"power\"" in str(waiting.failure())
    with pytest.raises(InvalidCommand, match="release it first"):
        recover()
    assert sent(one) == ["power_on"]


@pytest.mark.parametrize("disturb, reason", [
    (lambda one, arm: (one.panel("press_emergency_stop"), one.panel("release_emergency_stop")),
     "the arm was stopped|emergency stop"),  # pressed so shortly, a frame may show it or not
    (lambda one, arm: one.panel("reboot", down=0.1), "link|closed|connection|status"),
    (lambda one, arm: one.panel("close", port="command"), "link|closed"),
    (lambda one, arm: one.panel("close", port="status"), "status feed was lost"),
    (lambda one, arm: arm.stop(), "a stop"),
    (lambda one, arm: arm.run(power.clear_error), "a call of clear_err"),
    (lambda one, arm: arm.run(lambda core: settings.set_hand_guiding(core, False)), "a call of drag_mode")],
    ids=["emergency stop", "restart", "command port", "status port", "stop", "clear_err", "drag_mode"])
def test_it_is_one_act_that_whatever_disturbs_it_ends(bench, call, disturb, reason):
    one = bench(start="off", power_delay=0.8, enable_delay=0.1)
    arm = one.connect()
    waiting = call(Recovering(arm))
    assert eventually(lambda: one.requests("power_on"))
    disturb(one, arm)
    assert isinstance(waiting.failure(), (RecoveryInterrupted, MotionInterrupted, ConnectionLost)), waiting.error
    assert any(word in str(waiting.error) for word in reason.split("|")), waiting.error
    threading.Event().wait(1.0)
    assert one.times_of("enable_robot") == [] and len(one.times_of("power_on")) == 1


@pytest.mark.parametrize("slow, fault, step", [
    ({}, shown(errcode="0xF0001", errmsg="a fault"), CLEAR), ({}, shown(protective_stop=1), LEAVE),
    ({"start": "off", "power_delay": 60.0}, nothing, POWER), ({"start": "powered", "enable_delay": 60.0}, nothing,
                                                             ENABLE)], ids=[CLEAR, LEAVE, POWER, ENABLE])
def test_it_can_be_cancelled_at_every_step(bench, call, slow, fault, step):
    one = bench(**slow)
    arm = one.connect()
    fault(one, arm)
    recover = Recovering(arm)
    waiting = call(recover)
    assert eventually(lambda: recover.steps and recover.steps[-1] == step)
    recover.is_cancelled = True
    assert isinstance(waiting.failure(), RecoveryCancelled)
    assert str(waiting.error) == "the recovery was cancelled at the step \"%s\"" % step
    assert arm.fresh_state() is not None and sent(one) == on_wire(recover.steps)


def test_a_recovery_that_is_cancelled_before_it_begins_sends_nothing(bench):
    one = bench(start="off")
    recover = Recovering(one.connect())
    recover.is_cancelled = True
    with pytest.raises(RecoveryCancelled, match="before its first step"):
        recover()
    assert sent(one) == []


def test_a_second_recovery_is_refused_while_one_is_under_way_and_repeats_nothing(bench, call):
    one = bench(start="off", power_delay=0.8, enable_delay=0.1)
    arm = one.connect()
    first = call(Recovering(arm))
    assert eventually(lambda: one.requests("power_on"))
    with pytest.raises(InvalidCommand, match="another recovery is under way"):
        Recovering(arm)()
    first.wait()
    assert first.result == "the arm is ready: power, enable"
    assert sent(one) == ["power_on", "enable_robot"]


def test_what_an_earlier_call_has_begun_is_not_sent_again(bench, call):
    # The reply to power_on comes when the drives have power: until then the request is known to be outstanding.
    one = bench(start="off", power_delay=3.0, enable_delay=0.1)
    arm = one.connect()
    earlier = call(Recovering(arm))
    assert eventually(lambda: one.requests("power_on"))
    arm.stop()
    earlier.wait()
    with pytest.raises(InvalidCommand, match="of an earlier call is under way"):
        Recovering(arm)()
    assert eventually(lambda: arm.fresh_state().is_powered)
    assert Recovering(arm)() == "the arm is ready: enable"
    assert sent(one) == ["power_on", "enable_robot"]


def test_it_ends_auto_enable_and_is_not_ended_by_it(bench):
    one = bench(start="off", power_delay=0.5, enable_delay=0.1)
    arm = one.connect()
    arm.auto_enable()
    assert eventually(lambda: one.requests("power_on"))
    assert Recovering(arm)() == "the arm is ready: enable"
    assert sent(one) == ["power_on", "enable_robot"]


def test_an_arm_that_this_driver_moves_is_not_recovered_but_left_alone(bench):
    one = bench()
    arm = one.connect()
    arm.move(c.JointMove((3.0,) + HOME[1:], 0.2, 4.0), wait=False)
    assert eventually(one.is_moving)
    assert Recovering(arm)() == "the arm is ready: nothing was to be done"
    assert one.is_moving()


def test_an_alarm_is_not_cleared_while_this_driver_moves_the_arm(bench):
    one = bench()
    arm = one.connect()
    event(events.LINEAR_MOVE_FAILED)(one, arm)
    arm.move(c.JointMove((3.0,) + HOME[1:], 0.2, 4.0), wait=False)
    assert eventually(one.is_moving)
    with pytest.raises(InvalidCommand, match="refused to recover: a move owns the arm's motion; stop it first"):
        Recovering(arm)()
    assert one.is_moving() and one.requests("clear_error") == 0


def test_shutdown_ends_it(bench, call):
    one = bench(start="off", power_delay=60.0)
    arm = one.connect()
    waiting = call(Recovering(arm))
    assert eventually(lambda: one.requests("power_on"))
    arm.close()
    assert isinstance(waiting.failure(), ConnectionLost) and str(waiting.error) == "driver shut down"
