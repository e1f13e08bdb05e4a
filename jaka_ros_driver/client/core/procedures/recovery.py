"""The procedure that recovers the arm from a fault or a stop: one act of four steps, none of which moves the arm."""
import enum
from typing import Callable, List

from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.contradictions import standing_cause
from jaka_ros_driver.client.core.motion import event_text
from jaka_ros_driver.client.core.procedures import power
from jaka_ros_driver.client.core.procedures.steps import Now, Procedure, Until
from jaka_ros_driver.client.core.stillness import REST_TIME_S, SURE_REST_S
from jaka_ros_driver.errors import (
    CommandRejected,
    ConnectionLost,
    InvalidCommand,
    JakaError,
    MotionInterrupted,
    StopCause,
)
from jaka_ros_driver.state import RobotState

_REST_TIMEOUT_S = 1.5 + SURE_REST_S
"""Longest time, s, that a recovery waits for an arm that is coming to rest."""
_FEED_DELAY_S = 0.1
"""Longest delay, s, of the status feed behind the reply about the same event."""
_LEAVES_WITH_THE_JOINT = (0x31, 0x32, 0x35, 0x36)
"""Events 0x0n0031 and so on: a joint stands on a soft limit, or a jog leads beyond it.

They end when the joint is moved away, which they do not prevent (docs/controller-protocol.md section 4.4).
"""


class RecoveryStep(enum.Enum):
    """A step of a recovery; the value is its name for users."""

    CLEAR_ERROR = "clear error"
    LEAVE_PROTECTIVE_STOP = "leave protective stop"
    POWER = "power"
    ENABLE = "enable"


class RecoveryInterrupted(JakaError):
    """The error that something else has ended the recovery: nothing more is sent, the arm is left as it is."""


class RecoveryCancelled(RecoveryInterrupted):
    """The error that its caller has ended the recovery."""


def recover(core: ArmCore, on_step: Callable[[RecoveryStep], None] = lambda step: None,
            is_cancelled: Callable[[], bool] = lambda: False) -> Procedure:
    """Clear the error, leave the protective stop, power, enable: each needed step once, each seen to be done.

    It is one act: a stop, an emergency stop, a fault, a lost link, hand guiding or another operator's call ends it.

    Args:
        core: The arm.
        on_step: Called when a step begins, under the client's lock; it must not block.
        is_cancelled: Checked before each step and with every event while the arm is waited for.

    Returns:
        What was done, in words.

    Raises:
        InvalidCommand: Nothing was sent: the emergency stop is pressed, somebody guides the arm by hand, it moves, or
            another recovery is running.
        MotionInterrupted: An alarm still stands after clearing, a step took too long, or the arm was stopped.
        RecoveryInterrupted: Something else, or its caller, has ended it.
        JakaError: As ``Ask``; ConnectionLost where the arm's state is not known.
    """
    if core.is_recovering:
        raise InvalidCommand("refused to recover: another recovery is running")
    core.note_disturbance("a call of recover")
    core.is_recovering = True
    try:
        return (yield from _Recovery(core, on_step, is_cancelled).run())
    finally:
        core.is_recovering = False


class _Recovery:
    def __init__(self, core: ArmCore, on_step: Callable[[RecoveryStep], None],
                 is_cancelled: Callable[[], bool]) -> None:
        self._core = core
        self._on_step = on_step
        self._is_cancelled = is_cancelled
        self._disturbances = core.disturbances
        self._done: List[RecoveryStep] = []

    def run(self) -> Procedure:
        core = self._core
        state = yield from self._state()
        self._refuse_where_a_person_must_act(state)
        self._check()
        if _needs_clearing(state) or standing_cause(state) is not None:
            yield from self._await_rest()
            try:
                yield from self._steps()
            except CommandRejected:
                yield from core.seen(lambda s: False, _FEED_DELAY_S, self._check)  # it may show why: an emergency stop
                raise
        state = yield from self._state()
        self._check()
        cause = standing_cause(state)
        if cause is not None:
            raise cause
        text = "the arm is ready: " + (", ".join(step.value for step in self._done) or "nothing was to be done")
        if state.has_fault:
            text += "; %s stands until the joint is moved away from its limit" % event_text(state)
        return text

    def _steps(self) -> Procedure:
        yield from self._clear((yield from self._state()))
        if not (yield from self._state()).is_powered:
            self._begin(RecoveryStep.POWER)
            yield from power.switch_power(self._core, True, self._check)
        if not (yield from self._state()).is_enabled:
            self._begin(RecoveryStep.ENABLE)
            yield from power.switch_drives(self._core, True, self._check)

    def _clear(self, state: RobotState) -> Procedure:
        """Clear errors and protective stops.

        The controller has one command for both (docs/controller-protocol.md section 5.10).
        """
        if not _needs_clearing(state):
            return
        self._begin(RecoveryStep.CLEAR_ERROR)
        had_protective_stop = state.protective_stop
        if not (yield from power.clear_alarms(self._core, _has_no_alarm, self._check)):
            raise power.alarm_stands((yield from self._state()))
        if had_protective_stop:
            self._begin(RecoveryStep.LEAVE_PROTECTIVE_STOP)
            if not (yield from self._core.seen(lambda s: not s.protective_stop, power.CLEAR_TIMEOUT_S, self._check)):
                raise MotionInterrupted(StopCause.PROTECTIVE_STOP, "it still stands %.0f s after clear_error (%s)" % (
                    power.CLEAR_TIMEOUT_S, event_text((yield from self._state())) or "no event"))

    def _await_rest(self) -> Procedure:
        """Wait until the arm rests and what an earlier call has begun has ended.

        So power_on is not sent a second time.
        """
        core, begun_at = self._core, (yield Now())
        held_up_at = -_FEED_DELAY_S

        def rests(now: float) -> bool:
            nonlocal held_up_at
            self._check()
            if core.channel.is_held_up:
                held_up_at = now
            state = core.state
            return (core.custody.is_free and core.custody.stillness.duration() >= REST_TIME_S
                    and state is not None and state.received_at > held_up_at + _FEED_DELAY_S)
        if not (yield Until(rests, _REST_TIMEOUT_S)):
            yield from self._state()
            if core.channel.is_held_up:
                raise InvalidCommand("refused to recover: power_on or enable_robot of an earlier call is running")
            motion = core.custody.motion
            if motion is not None and not core.custody.is_ending:
                raise InvalidCommand("refused to recover: %s owns the arm's motion; stop it first"
                                     % motion.owner.value)
            raise InvalidCommand("refused to recover: within %.1f s %s" % (
                _REST_TIMEOUT_S, core.custody.unrest(begun_at)))

    def _begin(self, step: RecoveryStep) -> None:
        self._check()
        self._done.append(step)
        self._on_step(step)

    def _state(self) -> Procedure:
        now = yield Now()
        state = self._core.fresh_state(now)
        if not self._core.links.is_up:
            raise ConnectionLost("no link to the controller: " + self._core.links.last_error)
        return state

    def _check(self) -> None:
        """Raise what has ended this act, if anything has."""
        where = "at the step \"%s\"" % self._done[-1].value if self._done else "before its first step"
        if self._is_cancelled():
            raise RecoveryCancelled("the recovery was cancelled " + where)
        state = self._core.state
        if state is not None and state.emergency_stop:
            raise MotionInterrupted(StopCause.EMERGENCY_STOP, "it ended the recovery " + where)
        if state is not None and self._core.is_hand_guided(state):
            raise RecoveryInterrupted("the recovery was ended %s: somebody guides the arm by hand" % where)
        if self._core.disturbances != self._disturbances:
            event = "" if state is None else event_text(state)
            raise RecoveryInterrupted("the recovery was ended %s: %s%s" % (
                where, self._core.last_disturbance, " (%s)" % event if event else ""))

    def _refuse_where_a_person_must_act(self, state: RobotState) -> None:
        if state.emergency_stop:
            raise InvalidCommand("refused to recover: the emergency stop is pressed; release it first")
        if self._core.is_hand_guided(state):
            raise InvalidCommand("refused to recover: somebody guides the arm by hand; switch drag_mode off first")


def _needs_clearing(state: RobotState) -> bool:
    return state.protective_stop or (state.has_fault and not state.has_warning)


def _has_no_alarm(state: RobotState) -> bool:
    is_of_a_limit = state.error_code & 0xFFFF in _LEAVES_WITH_THE_JOINT and 0 <= state.error_code >> 16 <= 5
    return not state.has_fault or state.has_warning or is_of_a_limit
