"""Recovery: from each state in which the simulated controller can be to an arm that can move, or the reason why not.

The driver's core and the simulated controller run in virtual time.
"""
import math

import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.contradictions import standing_cause
from jaka_ros_driver.client.core.procedures import power, recovery, settings
from jaka_ros_driver.client.core.procedures.recovery import RecoveryCancelled, RecoveryInterrupted
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.simulation.controller.state import Start

MODEL = load_model("zu7")
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

    def _procedure(self, core):
        return recovery.recover(core, lambda step: self.steps.append(step.value), lambda: self.is_cancelled)

    def begin(self):
        return self.arm.begin("run", self._procedure(self.arm.core))

    def __call__(self):
        return self.arm.does(self._procedure)


def simulated(power_delay=0.1, enable_delay=0.1, **options):
    return SimulatedArm(MODEL, HOME, dialect={"power_delay": power_delay, "enable_delay": enable_delay}, **options)


def execute(arm, command):
    arm.does(lambda core: core.ask(command))


def in_mid_move(arm):
    assert arm.ended(arm.begin("move", c.JointMove((3.0,) + HOME[1:], 0.2, 4.0), False)) is None
    arm.until(lambda: arm.is_moving)


def has_asked_for_power(arm):
    arm.until(lambda: arm.times_of("power_on"))


def sent(arm):
    """Return the names of the commands of recovery that came in, in their order; none may have come that moves the
    arm."""
    names = [request["cmdName"] for _, request in arm.sent]
    assert not moving(arm)
    return [name for name in names if name in WIRE_NAMES.values()]


def moving(arm):
    """Return the names of the commands that came in and move the arm, or would; the parts of a stop do not."""
    return {request["cmdName"] for _, request in arm.sent if request["cmdName"] in MOTION
            and (request["cmdName"], request.get("jog_mode", request.get("relFlag"))) not in STOPPING}


def on_wire(steps):
    return [WIRE_NAMES[step] for step in steps if step in WIRE_NAMES]


def nothing(arm):
    """Leave the state in which the controller starts."""


def disabled(arm):
    arm.does(lambda core: power.set_enabled(core, False))


def pressed(arm):
    arm.controller.state.press_emergency_stop()
    arm.until(lambda: arm.state.emergency_stop)


def pressed_and_released(arm):
    pressed(arm)
    arm.controller.state.release_emergency_stop()
    arm.until(lambda: not arm.state.emergency_stop)


def hit(arm, joint=None):
    execute(arm, c.SetCollisionLevel(1))
    assert arm.controller.state.hit(150.0, joint)
    arm.until(lambda: arm.state.protective_stop)


def hit_in_mid_move(arm):
    execute(arm, c.SetCollisionLevel(1))
    in_mid_move(arm)
    arm.controller.state.hit(150.0)
    arm.until(lambda: arm.state.protective_stop)


def hit_and_then_pressed_and_released(arm):
    hit(arm)
    pressed_and_released(arm)


def event(what):
    def happen(arm):
        arm.controller.state._take_event(what)
        arm.until(lambda: arm.state.error_code == what.code)
    return happen


def rebooted(arm):
    connections = arm.core.links.health().connections
    arm.restart(0.1)
    arm.until(lambda: arm.core.links.health().connections > connections and arm.core.is_ready(arm.now))
    arm.until(lambda: not arm.state.is_powered)


def shown(**fields):
    """Show this in the feed, whatever is done."""
    def show(arm):
        arm.show(**fields)
        arm.until(lambda: arm.state.has_fault or arm.state.protective_stop)
    return show


def guided(arm):
    arm.does(lambda core: settings.set_hand_guiding(core, True))


def guided_into_a_soft_limit(arm):
    guided(arm)
    arm.controller.state.push(2, math.radians(-90.0), 5.0)
    arm.until(lambda: arm.state.error_code == events.HAND_GUIDING_HIT_SOFT_LIMIT.code)


def refused_by_the_controller(arm):
    state = arm.controller.state

    def refuse(*_):
        raise events.TargetRejected(events.NOT_ALLOWED_IN_MODE)
    event(events.LINEAR_MOVE_FAILED)(arm)
    state.alarms.clear = refuse


def without_links(arm):
    arm.cut(Port.COMMAND, 4.0)
    assert not arm.core.is_ready(arm.now)


def silent(arm):
    arm.cut(Port.STATUS, 4.0)
    arm.run(0.6)


READY = [
    ("drives off", Start.OFF, nothing, [POWER, ENABLE]),
    ("powered", Start.POWERED, nothing, [ENABLE]),
    ("ready", Start.ENABLED, nothing, []),
    ("disabled", Start.ENABLED, disabled, [ENABLE]),
    ("emergency stop released", Start.ENABLED, pressed_and_released, [CLEAR, POWER, ENABLE]),
    ("collision", Start.ENABLED, hit, [CLEAR, LEAVE]),
    ("collision of a joint", Start.ENABLED, lambda arm: hit(arm, 2), [CLEAR, LEAVE]),
    ("collision in mid move", Start.ENABLED, hit_in_mid_move, [CLEAR, LEAVE]),
    ("collision, then emergency stop", Start.ENABLED, hit_and_then_pressed_and_released, [CLEAR, LEAVE, POWER, ENABLE]),
    ("singularity, protective stop", Start.ENABLED, event(events.SINGULARITY_PROTECTIVE_STOP), [CLEAR, LEAVE]),
    ("a line that failed", Start.ENABLED, event(events.LINEAR_MOVE_FAILED), [CLEAR]),
    ("drives off, and a fault", Start.OFF, event(events.SINGULARITY), [CLEAR, POWER, ENABLE]),
    ("restarted", Start.ENABLED, rebooted, [POWER, ENABLE]),
    ("guided into a soft limit", Start.ENABLED, guided_into_a_soft_limit, [CLEAR]),
]


@pytest.mark.parametrize("start, fault, steps", [row[1:] for row in READY], ids=[row[0] for row in READY])
def test_from_each_fault_state_to_an_arm_that_can_move(start, fault, steps):
    arm = simulated(start=start)
    fault(arm)
    arm.until(lambda: not arm.is_moving)
    before = arm.joints
    recover = Recovering(arm)
    said = recover()
    state = arm.state
    assert standing_cause(state) is None and not state.protective_stop and not state.emergency_stop
    assert recover.steps == steps
    assert arm.joints == before, "the arm has moved"
    assert said.startswith("the arm is ready: " + (", ".join(steps) or "nothing was to be done"))
    assert ("until the joint is moved away" in said) is (fault is guided_into_a_soft_limit)
    if fault is not guided_into_a_soft_limit:
        assert recover() == "the arm is ready: nothing was to be done"
    names = [request["cmdName"] for _, request in arm.sent]
    assert [name for name in names if name in WIRE_NAMES.values()] == on_wire(steps)
    assert len(moving(arm)) == (1 if fault is hit_in_mid_move else 0)


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
def test_where_it_cannot_succeed_it_says_precisely_why(fault, error, reason, steps):
    arm = simulated(stale_after=0.5)
    fault(arm)
    recover = Recovering(arm)
    with pytest.raises(error, match=reason):
        recover()
    assert recover.steps == steps
    assert sent(arm) == on_wire(steps)


@pytest.mark.parametrize("slow, reason, steps", [
    ({"power_delay": 15.0}, "the arm did not power on within 0 s", [POWER]),
    ({"power_delay": 0.1, "enable_delay": 15.0}, "the arm did not enable within 0 s", [POWER, ENABLE])])
def test_a_step_that_takes_too_long_is_told(slow, reason, steps):
    arm = simulated(start=Start.OFF, power_timeout=0.4, enable_timeout=0.4, **slow)
    recover = Recovering(arm)
    with pytest.raises(MotionInterrupted, match=reason) as caught:
        recover()
    assert caught.value.cause is StopCause.TIMEOUT and recover.steps == steps
    assert sent(arm) == on_wire(steps)


def test_the_emergency_stop_ends_it_at_once_and_then_it_is_refused():
    arm = simulated(start=Start.OFF, power_delay=5.0)
    recover = Recovering(arm)
    waiting = recover.begin()
    has_asked_for_power(arm)
    pressed(arm)
    assert "emergency stop: it ended the recovery at the step \"power\"" in str(arm.ended(waiting))
    with pytest.raises(InvalidCommand, match="release it first"):
        recover()
    assert sent(arm) == ["power_on"]


@pytest.mark.parametrize("disturb, reason", [
    (lambda arm: (arm.controller.state.press_emergency_stop(), arm.controller.state.release_emergency_stop()),
     "the arm was stopped|emergency stop"),  # pressed so shortly, a frame may show it or not
    (lambda arm: arm.restart(0.1), "link|closed|connection|status"),
    (lambda arm: arm.cut(Port.COMMAND), "link|closed"),
    (lambda arm: arm.cut(Port.STATUS), "status feed was lost"),
    (lambda arm: arm.begin("stop"), "a stop"),
    (lambda arm: arm.does(power.clear_error), "a call of clear_err"),
    (lambda arm: arm.does(lambda core: settings.set_hand_guiding(core, False)), "a call of drag_mode")],
    ids=["emergency stop", "restart", "command port", "status port", "stop", "clear_err", "drag_mode"])
def test_it_is_one_act_that_whatever_disturbs_it_ends(disturb, reason):
    arm = simulated(start=Start.OFF, power_delay=0.8, enable_delay=0.1)
    waiting = Recovering(arm).begin()
    has_asked_for_power(arm)
    disturb(arm)
    assert isinstance(arm.ended(waiting), (RecoveryInterrupted, MotionInterrupted, ConnectionLost)), waiting.error
    assert any(word in str(waiting.error) for word in reason.split("|")), waiting.error
    assert "()" not in str(waiting.error)
    arm.run(1.0)
    assert arm.times_of("enable_robot") == [] and len(arm.times_of("power_on")) == 1


def test_what_ends_it_is_named_with_the_event_that_stands_meanwhile():
    arm = simulated()
    shown(errcode="0xF0001", errmsg="a fault")(arm)
    recover = Recovering(arm)
    waiting = recover.begin()
    arm.until(lambda: recover.steps)
    arm.begin("stop")
    assert str(arm.ended(waiting)).endswith("at the step \"clear error\": a stop (event 0xF0001 a fault)")


@pytest.mark.parametrize("slow, fault, step", [
    ({}, shown(errcode="0xF0001", errmsg="a fault"), CLEAR), ({}, shown(protective_stop=1), LEAVE),
    ({"start": Start.OFF, "power_delay": 15.0}, nothing, POWER),
    ({"start": Start.POWERED, "enable_delay": 15.0}, nothing, ENABLE)], ids=[CLEAR, LEAVE, POWER, ENABLE])
def test_it_can_be_cancelled_at_every_step(slow, fault, step):
    arm = simulated(**slow)
    fault(arm)
    recover = Recovering(arm)
    waiting = recover.begin()
    arm.until(lambda: recover.steps and recover.steps[-1] == step)
    recover.is_cancelled = True
    assert isinstance(arm.ended(waiting), RecoveryCancelled)
    assert str(waiting.error) == "the recovery was cancelled at the step \"%s\"" % step
    assert arm.state is not None and sent(arm) == on_wire(recover.steps)


def test_a_recovery_that_is_cancelled_before_it_begins_sends_nothing():
    arm = simulated(start=Start.OFF)
    recover = Recovering(arm)
    recover.is_cancelled = True
    with pytest.raises(RecoveryCancelled, match="before its first step"):
        recover()
    assert sent(arm) == []


def test_a_second_recovery_is_refused_while_one_is_under_way_and_repeats_nothing():
    arm = simulated(start=Start.OFF, power_delay=0.8, enable_delay=0.1)
    first = Recovering(arm).begin()
    has_asked_for_power(arm)
    with pytest.raises(InvalidCommand, match="another recovery is running"):
        Recovering(arm)()
    assert arm.ended(first) is None
    assert first.result == "the arm is ready: power, enable"
    assert sent(arm) == ["power_on", "enable_robot"]


def test_what_an_earlier_call_has_begun_is_not_sent_again():
    # The reply to power_on comes when the drives have power: until then the request is known to be outstanding.
    arm = simulated(start=Start.OFF, power_delay=3.0, enable_delay=0.1)
    earlier = Recovering(arm).begin()
    has_asked_for_power(arm)
    assert arm.ended(arm.begin("stop")) is None
    arm.ended(earlier)
    with pytest.raises(InvalidCommand, match="of an earlier call is running"):
        Recovering(arm)()
    arm.until(lambda: arm.state.is_powered)
    assert Recovering(arm)() == "the arm is ready: enable"
    assert sent(arm) == ["power_on", "enable_robot"]


def test_it_ends_auto_enable_and_is_not_ended_by_it():
    arm = simulated(start=Start.OFF, power_delay=0.5, enable_delay=0.1)
    arm.core.run(None, power.auto_enable(arm.core, arm.core.disturbances - arm.core.link_losses), arm.now)
    has_asked_for_power(arm)
    assert Recovering(arm)() == "the arm is ready: enable"
    assert sent(arm) == ["power_on", "enable_robot"]


def test_an_arm_that_this_driver_moves_is_not_recovered_but_left_alone():
    arm = simulated()
    in_mid_move(arm)
    assert Recovering(arm)() == "the arm is ready: nothing was to be done"
    assert arm.is_moving


def test_an_alarm_is_not_cleared_while_this_driver_moves_the_arm():
    arm = simulated()
    event(events.LINEAR_MOVE_FAILED)(arm)
    in_mid_move(arm)
    with pytest.raises(InvalidCommand, match="refused to recover: a move owns the arm's motion; stop it first"):
        Recovering(arm)()
    assert arm.is_moving and len(arm.times_of("clear_error")) == 0


def test_shutdown_ends_it():
    arm = simulated(start=Start.OFF, power_delay=15.0)
    waiting = Recovering(arm).begin()
    has_asked_for_power(arm)
    arm.act(arm.core.close)
    arm.act(arm.core.disconnect)
    assert isinstance(arm.ended(waiting), ConnectionLost) and str(waiting.error) == "driver shut down"
