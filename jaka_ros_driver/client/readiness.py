"""Power, enabling and alarms: the way to an arm that can move. Nothing here acts without being called."""
import logging
import threading
from typing import Callable, List

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.errors import InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.state import RobotState

_LOG = logging.getLogger(__name__)

_CLEAR_TIMEOUT = 3.0
_POLL_PERIOD = 0.2
_REST_MOVEMENT = 1e-5
_REST_TIME = 0.05


def missing_for_motion(state: RobotState) -> List[str]:
    """What must be done before the arm can move, in order; empty when it can."""
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


def set_power(arm: ArmClient, on: bool) -> None:
    """Energise the drives, or stop, disable and de-energise them; returns when the arm reports it.

    Raises:
        InvalidCommand: The emergency stop or a protective stop stands against it.
        MotionInterrupted: The controller took the command and did not follow in time.
        JakaError: As ``ArmClient.execute``.
    """
    state = arm.fresh_state()
    if on:
        _refuse_under_stop(state, "power on")
    else:
        _come_to_rest(arm)
        if state.is_enabled:
            set_enabled(arm, False)
    if state.is_powered is not on:
        arm.execute(c.SetPower(on))
        _await(arm, lambda s: s.is_powered is on, arm.settings.power_timeout, "power on" if on else "power off")


def set_enabled(arm: ArmClient, on: bool) -> None:
    """Release the brakes and hold torque, or the reverse; returns when the arm reports it.

    Raises:
        As ``set_power``; InvalidCommand when the drives have no power.
    """
    state = arm.fresh_state()
    if on:
        _refuse_under_stop(state, "enable")
        if not state.is_powered:
            raise InvalidCommand("refused: the drives have no power; power first")
    else:
        _come_to_rest(arm)
    if state.is_enabled is not on:
        arm.execute(c.SetEnabled(on))
        _await(arm, lambda s: s.is_enabled is on, arm.settings.enable_timeout, "enable" if on else "disable")


def clear_error(arm: ArmClient) -> List[str]:
    """Clear alarms and the protective stop; energises nothing.

    Returns:
        What is still missing before the arm can move, in order.

    Raises:
        JakaError: As ``ArmClient.execute``; MotionInterrupted where an alarm stands again at once.
    """
    arm.execute(c.ClearError())
    after = arm.status.wait_for(lambda s: not s.protective_stop and not s.has_fault, _CLEAR_TIMEOUT)
    state = after if after is not None else arm.fresh_state()
    if after is None and not state.emergency_stop:
        raise MotionInterrupted(StopCause.FAULT, "an alarm still stands: 0x%X %s" % (state.error_code,
                                                                                   state.error_message))
    return missing_for_motion(state)


def enable_once(arm: ArmClient, is_closing: threading.Event) -> None:
    """Power and enable a healthy arm once, as soon as it is seen for the first time; a sick one is left alone.

    Blocks until then; run it in a thread of its own.
    """
    while not arm.is_ready:
        if is_closing.wait(_POLL_PERIOD):
            return
    try:
        state = arm.fresh_state()
        if state.emergency_stop or state.protective_stop or state.has_fault:
            _LOG.warning("auto_enable: the arm is not healthy and is left as it is; to move it: %s",
                         ", ".join(missing_for_motion(state)))
            return
        set_power(arm, True)
        set_enabled(arm, True)
        _LOG.info("auto_enable: the arm is powered and enabled")
    except JakaError as error:
        _LOG.error("auto_enable: %s; it is not tried again", error)


def _refuse_under_stop(state: RobotState, what: str) -> None:
    if state.emergency_stop:
        raise InvalidCommand("refused to %s: the emergency stop is pressed" % what)
    if state.protective_stop:
        raise InvalidCommand("refused to %s: protective stop; clear_err first" % what)


def _come_to_rest(arm: ArmClient) -> None:
    """The controller disables an arm at rest only (controller protocol 5.1)."""
    before = arm.fresh_state()
    if not before.is_in_position or arm.motion_owner is not None:
        arm.stop()
    last_moving = before

    def is_at_rest(state: RobotState) -> bool:
        nonlocal last_moving
        moved = max(abs(a - b) for a, b in zip(state.joint_position, last_moving.joint_position))
        if moved > _REST_MOVEMENT or not state.is_in_position:
            last_moving = state
        return state.received_at - last_moving.received_at > _REST_TIME

    _await(arm, is_at_rest, _CLEAR_TIMEOUT, "come to rest")


def _await(arm: ArmClient, predicate: Callable[[RobotState], bool], timeout: float, what: str) -> None:
    if arm.status.wait_for(predicate, timeout) is None:
        state = arm.status.state
        event = "event 0x%X %s" % (state.error_code, state.error_message) if state is not None else "no status"
        raise MotionInterrupted(StopCause.TIMEOUT, "the arm did not %s within %.0f s (%s)" % (what, timeout, event))
