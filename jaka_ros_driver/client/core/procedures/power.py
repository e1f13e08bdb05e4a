"""Procedures for power, enabling and alarms: the way to an arm that can move.

Nothing here acts without being called.
"""
import logging
from typing import Callable, List

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.motion import event_text
from jaka_ros_driver.client.core.procedures.steps import Ask, Now, Procedure, SendAhead, Until
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.errors import InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.state import PROGRAM_UNDER_WAY, RobotState

CLEAR_TIMEOUT_S = 3.0
"""Longest time, s, for alarms to clear, and for the arm to come to rest."""
_NEVER = float("inf")


def missing_for_motion(state: RobotState) -> List[str]:
    """Return what must be done before the arm can move, in order; empty when it can."""
    missing = []
    if state.emergency_stop:
        missing.append("release the emergency stop")
    if state.protective_stop or state.has_fault:
        missing.append("clear_err")
    if not state.is_powered:
        missing.append("power")
    if not state.is_enabled:
        missing.append("enable")
    return missing


def set_power(core: ArmCore, on: bool) -> Procedure:
    """Energise the drives, or stop, disable and de-energise them; end when the arm reports it.

    Returns:
        What was done besides, in words; "" for nothing.

    Raises:
        InvalidCommand: The emergency stop or a protective stop stands against it.
        MotionInterrupted: The controller accepted the command and did not follow in time.
        JakaError: As ``Ask``; ConnectionLost where the arm's state is not known.
    """
    core.note_disturbance("a call of power")
    if on:
        _refuse_under_stop((yield from _state(core)), "power on")
        yield from switch_power(core, True)
        return ""
    was_enabled = (yield from _state(core)).is_enabled
    done = yield from _come_to_rest(core)
    yield from switch_drives(core, False)
    yield from switch_power(core, False)
    return "; ".join(filter(None, (done, "the drives were disabled" if was_enabled else "")))


def set_enabled(core: ArmCore, on: bool) -> Procedure:
    """Release the brakes and hold torque, or stop the arm and engage them; end when the arm reports it.

    Returns:
        As ``set_power``.

    Raises:
        As ``set_power``; InvalidCommand when the drives have no power.
    """
    core.note_disturbance("a call of enable")
    if on:
        state = yield from _state(core)
        _refuse_under_stop(state, "enable")
        if not state.is_powered:
            raise InvalidCommand("refused: the drives have no power; power first")
    done = "" if on else (yield from _come_to_rest(core))
    yield from switch_drives(core, on)
    return done


def clear_error(core: ArmCore) -> Procedure:
    """Clear alarms and the protective stop; energises nothing.

    Returns:
        What was cleared, in words, and what is still missing before the arm can move, in order.

    Raises:
        JakaError: As ``Ask``; MotionInterrupted where an alarm stands again at once; ConnectionLost where the arm's
            state is not known: then nothing is sent.
    """
    core.note_disturbance("a call of clear_err")
    before = yield from _state(core)
    cleared = yield from clear_alarms(core, lambda s: not s.protective_stop and not s.has_fault)
    state = yield from _state(core)
    if not cleared and not state.emergency_stop:
        raise alarm_stands(state)
    left = before.protective_stop and not state.protective_stop
    return "alarms cleared" + (", protective stop left" if left else ""), missing_for_motion(state)


def auto_enable(core: ArmCore, since: int) -> Procedure:
    """Power and enable a healthy arm once, as soon as it is seen for the first time; a sick one is left alone.

    It is one act: whatever disturbs it (a stop, a fault, a restart, a lost link, an operator's call) ends it for good,
    also before the arm is seen. Links lost until then do not count: the controller may start later than the driver.

    Args:
        core: Of the arm.
        since: How many disturbances other than lost links there were when the arm's user decided on it.
    """

    def is_called_off() -> bool:
        return core.disturbances - core.link_losses != since
    yield Until(lambda now: is_called_off() or core.is_ready(now), _NEVER)
    if is_called_off():
        core.actions.log(logging.WARNING, "auto_enable: a stop, a call or a fault came before the arm was seen, and it "
                                          "is left as it is")
        return
    disturbances = core.disturbances
    state = yield from _state(core)

    def require_calm() -> None:
        if core.disturbances != disturbances:
            raise MotionInterrupted(StopCause.FAULT, core.last_disturbance)

    if state.emergency_stop or state.protective_stop or state.has_fault:
        core.actions.log(logging.WARNING, "auto_enable: the arm is not healthy and is left as it is; to move it: %s"
                         % ", ".join(missing_for_motion(state)))
        return
    try:
        yield from switch_power(core, True, require_calm)
        yield from switch_drives(core, True, require_calm)
    except JakaError as error:
        core.actions.log(logging.ERROR, "auto_enable: %s; it is not tried again" % error)
        return
    core.actions.log(logging.INFO, "auto_enable: the arm is powered and enabled")


def clear_alarms(core: ArmCore, is_done: Callable[[RobotState], bool],
                 check: Callable[[], None] = lambda: None) -> Procedure:
    """Send ``clear_error`` and wait until ``is_done``, 3 s at most; return whether it came.

    ``check`` may end it by raising; further errors as ``Ask``.
    """
    check()
    yield Ask(c.ClearError())
    return (yield from core.seen(is_done, CLEAR_TIMEOUT_S, check))


def alarm_stands(state: RobotState) -> MotionInterrupted:
    """Return the error for an alarm that clearing did not remove."""
    return MotionInterrupted(StopCause.FAULT, "an alarm still stands: 0x%X %s" % (state.error_code,
                                                                                state.error_message))


def switch_power(core: ArmCore, on: bool, check: Callable[[], None] = lambda: None) -> Procedure:
    """Switch the power of the drives unless it is so already, and wait until the arm reports it; raise as ``Ask`` does.

    ``check`` may end it by raising, before the command and while the arm is waited for. MotionInterrupted: not in time.
    """
    return _switch(core, c.SetPower(on), on, lambda s: s.is_powered is on, core.settings.power_timeout,
                   "power on" if on else "power off", check)


def switch_drives(core: ArmCore, on: bool, check: Callable[[], None] = lambda: None) -> Procedure:
    """Release or engage the brakes, with arguments and errors as ``switch_power``."""
    return _switch(core, c.SetEnabled(on), on, lambda s: s.is_enabled is on, core.settings.enable_timeout,
                   "enable" if on else "disable", check)


def _switch(core: ArmCore, command: c.Command, on: bool, is_done: Callable[[RobotState], bool], timeout: float,
            what: str, check: Callable[[], None]) -> Procedure:
    """Send the command unless the state has it already, and wait until it has; ``check`` may raise before each step.

    Drives that are off while an earlier call is switching them on are switched off all the same: they would come on.
    Only the feed shows when it is done: the reply comes at once or not before that (docs/controller-protocol.md section
    5.1).
    """
    check()
    begun, kind = (yield Now()), type(command)
    comes_on = begun - core.switched_on_at.get(kind, -_NEVER) < timeout
    if is_done((yield from _state(core))) and (on or not comes_on):
        core.switched_on_at.pop(kind, None)
        return
    core.switched_on_at.pop(kind, None)
    if on:
        core.switched_on_at[kind] = begun
    yield SendAhead(command)
    if (yield from core.seen(is_done, timeout, check)):
        core.switched_on_at.pop(kind, None)
        core.channel.done(command, (yield Now()))
        return
    state = core.state
    raise MotionInterrupted(StopCause.TIMEOUT, "the arm did not %s within %.0f s (%s)" % (
        what, timeout, "no status" if state is None else event_text(state) or "no event"))


def _refuse_under_stop(state: RobotState, what: str) -> None:
    if state.emergency_stop:
        raise InvalidCommand("refused to %s: the emergency stop is pressed" % what)
    if state.protective_stop:
        raise InvalidCommand("refused to %s: protective stop; clear_err first" % what)


def _come_to_rest(core: ArmCore) -> Procedure:
    """Stop the arm where it moves, and wait until it rests; return in words that it was stopped, "" where not.

    The controller disables an arm at rest only (docs/controller-protocol.md section 5.1).
    """
    def rests(_now: float) -> bool:
        return core.custody.is_free and core.custody.stillness.duration() >= REST_TIME_S
    state = yield from _state(core)
    now = yield Now()
    moves = not rests(now) or not state.is_in_position or state.program_state in PROGRAM_UNDER_WAY
    if moves:
        core.stop_own(now)
    if not (yield Until(rests, CLEAR_TIMEOUT_S)):
        raise MotionInterrupted(StopCause.TIMEOUT, "within %.0f s %s" % (CLEAR_TIMEOUT_S, core.custody.unrest(now)))
    return "all motion was stopped" if moves else ""


def _state(core: ArmCore) -> Procedure:
    return core.fresh_state((yield Now()))
