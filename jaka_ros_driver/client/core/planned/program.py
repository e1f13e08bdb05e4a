"""A program that is stored in the controller: in custody from before it is played until it is over and the arm rests.

Its motions are not known here. So the program's state in the status feed (``interp_state``, docs/controller-protocol.md
section 6.2) decides that it is over, together with joints at rest; the state alone does not. After a stop the
controller is asked for it besides.
"""
from typing import Callable, Optional, cast

from jaka_ros_driver.client.core.actions import Token
from jaka_ros_driver.client.core.channel import CommandChannel
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import ArmMotion, MotionOwner
from jaka_ros_driver.client.core.motion_guard.feed_watch import FeedWatch
from jaka_ros_driver.client.core.procedures.steps import Ask, Now, Procedure
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.commands import Command, Query, ResumeMotion
from jaka_ros_driver.errors import (
    CommandRejected,
    InvalidCommand,
    JakaError,
    MotionInterrupted,
    ProtocolError,
    StopCause,
)
from jaka_ros_driver.state import PROGRAM_UNDER_WAY, ProgramState, RobotState

SHOWN_WITHIN_S = 2.0
"""Longest time, s, until the status feed must show what was asked of a program."""
_NOT_SEEN_RUNNING = "accepted, but the program was not seen running within %.0f s" % SHOWN_WITHIN_S
_OVER_TIME_S = 0.3
"""Time, s, for which the status feed must show a program as idle, with the arm at rest, until it is over."""
_NEVER = float("inf")


class ProgramMotion(ArmMotion):
    """A running program, in custody until it is over.

    Its caller is answered when the status feed shows it running.
    """

    owner = MotionOwner.PROGRAM

    def __init__(self, custody: Custody, command: Command, call: Token, end: Token) -> None:
        """Set up the motion.

        Args:
            custody: Of this motion.
            command: PlayProgram, or ResumeMotion for one that is paused.
            call: Answered when the program runs.
            end: Answered when custody ends, and not before ``call``; None for nobody.
        """
        self._custody = custody
        self._command = command
        self._call = call
        self._end = end
        self._accepted_at: Optional[float] = None
        self._is_seen = False
        self._over_since: Optional[float] = None
        self._ran_at = -_NEVER
        self._feed_watch = FeedWatch(custody.motion_check.look())
        self._answers = _ProgramAnswers(custody.channel)

    def begin(self, now: float) -> None:
        self._custody.channel.request(self._command, now, self._replied)

    def observe(self, state: RobotState, now: float) -> None:
        if self._accepted_at is None or state.received_at <= self._accepted_at:
            return
        trouble = self._feed_watch.trouble(state)
        if trouble:
            self._custody.stop(MotionInterrupted(StopCause.MOTION_GUARD, trouble), now)
            return
        if state.program_state in PROGRAM_UNDER_WAY:
            if not self._is_seen:
                self._is_seen, self.deadline = True, _NEVER
                self._answer(None)
            self._over_since = None
        elif state.program_state == ProgramState.IDLE and self._is_seen:
            self._look_for_the_end(state.received_at, now)
        else:
            self._over_since = None

    def tick(self, now: float) -> None:
        if now >= self.deadline:
            self._custody.stop(MotionInterrupted(StopCause.TIMEOUT, _NOT_SEEN_RUNNING), now)

    def observe_stop(self, state: RobotState) -> None:
        if state.program_state == ProgramState.RUNNING:
            self._ran_at = state.received_at

    def may_be_left(self, state: RobotState) -> bool:
        return self._is_shown_over(state) and (
            state.program_state == ProgramState.PAUSED or self._answers.are_idle(state.received_at))

    def goes_on(self, state: RobotState) -> bool:
        return not self._is_shown_over(state) or self._answers.newest == ProgramState.RUNNING

    def _is_shown_over(self, state: RobotState) -> bool:
        if state.received_at - self._ran_at < _OVER_TIME_S:  # one frame that shows none may be an old one
            return False
        if state.program_state == ProgramState.PAUSED:  # one that was not to be resumed is still paused
            return isinstance(self._command, ResumeMotion)
        return state.program_state in (None, ProgramState.IDLE)

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        self._answer(outcome)
        self._custody.actions.answer(self._end, None, outcome)

    def resumed(self, require_ready: Callable[[float], RobotState], seen: Callable[..., Procedure]) -> Procedure:
        """Resume the program where it is paused; end when it is seen running.

        Args:
            require_ready: The arm's state where it can be moved, else an error.
            seen: ``ArmCore.seen``.

        Raises:
            InvalidCommand: It is not paused, or ends meanwhile.
            MotionInterrupted: It was accepted, and not seen running in time.
            JakaError: As ``Ask``.
        """
        require_program_state(require_ready((yield Now())), ProgramState.PAUSED)
        yield Ask(ResumeMotion())

        def require_still_under_way() -> None:
            if self._custody.motion is not self or self._custody.is_ending:
                raise InvalidCommand("refused: the program has ended, it cannot be resumed")
        if not (yield from seen(lambda s: s.program_state in PROGRAM_UNDER_WAY, SHOWN_WITHIN_S,
                                require_still_under_way)):
            raise MotionInterrupted(StopCause.TIMEOUT, _NOT_SEEN_RUNNING)

    # ---- inside ----

    def _replied(self, _result: object, error: Optional[JakaError], now: float) -> None:
        if self._custody.motion is not self:
            return
        if error is None:
            self._accepted_at, self.deadline = now, now + SHOWN_WITHIN_S
            return
        self._answer(error)
        self._custody.actions.answer(self._end, None, error)
        self._end = None
        self._custody.not_accepted(error, now)

    def _look_for_the_end(self, shown_at: float, now: float) -> None:
        self._over_since = shown_at if self._over_since is None else self._over_since
        if (shown_at - self._over_since >= _OVER_TIME_S
                and self._custody.rest_since(self._over_since) >= REST_TIME_S):
            self._custody.finish(now)

    def _answer(self, error: Optional[JakaError]) -> None:
        call, self._call = self._call, None
        self._custody.actions.answer(call, None, error)


class _ProgramAnswers:
    """The controller's answers on its program, once a stop was accepted and the feed shows neither program nor motion.

    A feed that is behind shows that, too: how the arm was before. Joints at rest do not tell how old it is.

    Attributes:
        newest: The newest answer; None before the first.
    """

    def __init__(self, channel: CommandChannel) -> None:
        self._channel = channel
        self._is_asking = False
        self._can_tell = True
        self.newest: Optional[ProgramState] = None

    def are_idle(self, now: float) -> bool:
        """Return whether the controller has said that no program runs; else ask.

        True where it does not know the question.
        """
        if not self._can_tell or self.newest == ProgramState.IDLE:
            return True
        if not self._is_asking and self._channel.is_open:
            self._is_asking = True
            self._channel.request(Query.PROGRAM_STATE, now, self._answered)
        return False

    def _answered(self, result: object, error: Optional[JakaError], _now: float) -> None:
        self._is_asking = False
        if isinstance(error, (CommandRejected, ProtocolError)):
            self._can_tell = False
        elif error is None:
            self.newest = cast(ProgramState, result)


def require_program_state(state: RobotState, *wanted: ProgramState) -> None:
    """Check that the controller's program is in one of these states.

    Raises:
        InvalidCommand: It is in another one, or the status feed does not show it.
    """
    if state.program_state is None:
        raise InvalidCommand("refused: this controller does not tell whether a program runs (interp_state)")
    if state.program_state not in tuple(wanted):
        names = {int(one): one.name.lower() for one in ProgramState}
        raise InvalidCommand("refused: the program is %s; it must be %s" % (
            names.get(state.program_state, "in state %d" % state.program_state),
            " or ".join(one.name.lower() for one in wanted)))
