"""The stops of this driver's motion, and of an arm that somebody else may move. Their callers wait for nothing else."""
from typing import Callable, Optional

from jaka_ros_driver.client.core.actions import Actions, Token
from jaka_ros_driver.client.core.channel import CommandChannel
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.links import Links
from jaka_ros_driver.client.core.procedures.steps import Ask, Now, OnEnd, Procedure, Until, pause
from jaka_ros_driver.client.core.requests.admission import Admission
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import STOP_REPLY, Query, whole_stop
from jaka_ros_driver.errors import (
    CommandRejected,
    ConnectionLost,
    JakaError,
    MotionInterrupted,
    ReplyTimeout,
    StopCause,
    StopNotSeen,
)
from jaka_ros_driver.state import PROGRAM_UNDER_WAY

_COASTING_TIME_S = 0.5
"""Time, s, after a stop was sent until an arm that still moves is stopped once more."""
_REPEATED_FOR_S = 10.0
"""Time, s, for which an arm that this driver does not move is stopped again: somebody may move it on purpose."""

_SERVO_MODE_LASTS_S, _POLL_PERIOD_S = 2.0, 0.02
"""Longest time, s, after a stop for which servo mode is asked for until it is left, and the period of that."""

CarryOut = Callable[[Procedure, OnEnd, float], None]


class Stops:
    """The sender of stops, which ends what waits to begin.

    Attributes:
        count: The number of stops that were asked for.
        of_trajectories: The number of these, and of the ends of trajectories alone.
    """

    def __init__(self, actions: Actions, channel: CommandChannel, custody: Custody, links: Links, admission: Admission,
                 settings: ClientSettings, carry_out: CarryOut) -> None:
        """Set up without a stop.

        carry_out: Runs a procedure, and passes its end on.
        """
        self.count = self.of_trajectories = 0
        self._actions = actions
        self._channel = channel
        self._custody = custody
        self._links = links
        self._admission = admission
        self._patience = settings.reply_timeout
        self._carry_out = carry_out
        self._newest: Optional[_FreeStop] = None

    def stop(self, call: Token, now: float) -> None:
        """Stop for a caller, who is answered once; errors as ``ArmCore.stop``."""
        self._end_waiting()
        self._stop(call, now)

    def stop_own(self, now: float) -> None:
        """Send a stop for which nobody is answered."""
        self._end_waiting()
        if self._custody.is_free:
            self._stop(None, now)
        else:
            self._custody.stop(MotionInterrupted(StopCause.STOPPED), now)

    def require_none_since(self, count: int) -> None:
        """Raise MotionInterrupted where a stop came since ``count`` was taken."""
        if self.count != count:
            raise MotionInterrupted(StopCause.STOPPED, "it was asked for before the stop")

    def end_trajectories(self) -> None:
        """Let no trajectory begin that was asked for before."""
        self.of_trajectories += 1

    def require_no_end_since(self, of_trajectories: int) -> None:
        """Raise MotionInterrupted where a stop, or the end of all trajectories, came since the number was taken."""
        if self.of_trajectories != of_trajectories:
            raise MotionInterrupted(StopCause.STOPPED, "it was asked for before the stop")

    def _end_waiting(self) -> None:
        self.count += 1
        self.of_trajectories += 1
        self._admission.end_waiting(MotionInterrupted(StopCause.STOPPED))

    def _stop(self, call: Token, now: float) -> None:
        """Send the stop at once; where the port was left to another client, on the connection that is made for it."""
        answer = _Once(self._actions, call)
        if not self._channel.is_open and self._links.take_port(now):
            self._carry_out(self._sent_when_connected(answer),
                            lambda _, error, _at: answer(error) if error else None, now)
        else:
            self._send(answer, self._patience, now)

    def _sent_when_connected(self, answer: "_Once") -> Procedure:
        asked = yield Now()
        yield Until(lambda _now: self._channel.is_open, self._patience)
        now = yield Now()
        self._send(answer, max(0.0, asked + self._patience - now), now)

    def _send(self, answer: "_Once", patience: float, now: float) -> None:
        """Send the stop; ``patience``: the time that is left to its answer, s."""
        if self._custody.is_free:
            self._stop_free_arm(answer, patience, now)
            return
        # its reply may come late, behind power_on or as it went out late itself; its caller does not wait for that
        may_be_late = self._channel.is_held_up or patience < self._patience
        self._custody.stop_for(answer, now)
        if may_be_late:
            self._carry_out(self._until(lambda: answer.is_given, patience),
                            lambda _, error, _at: answer(error or self._timeout()), now)

    def _stop_free_arm(self, answer: "_Once", patience: float, now: float) -> None:
        """Stop an arm that this driver does not move: a program, a jog, or servo mode of somebody else."""
        stop = _FreeStop(self._channel, self._custody, self._links, self._admission, self._patience, answer,
                         self._see_servo_mode_left)
        try:
            stop.send(now)
        except JakaError as error:
            answer(error)
            return
        self._newest = stop
        self._carry_out(self._watched(stop, patience), lambda _, error, _at: answer(error), now)

    def _watched(self, stop: "_FreeStop", patience: float) -> Procedure:
        """Answer when the arm is seen at rest, or in time with what is known; and stop it again while it moves on."""
        if (yield Until(lambda now: stop.look(now, self._newest is stop), patience)):
            return
        stop.answer(stop.trouble((yield Now())))
        yield Until(lambda now: self._newest is not stop or stop.look(now, True), _REPEATED_FOR_S)

    def _see_servo_mode_left(self, now: float) -> None:
        self._carry_out(self._servo_mode_left(), lambda _, _error, _at: None, now)

    def _servo_mode_left(self) -> Procedure:
        """Ask until the controller has left servo mode: the next motion waits for that, the stop's caller does not."""
        begun = yield Now()
        while (yield Now()) - begun <= _SERVO_MODE_LASTS_S:
            is_active = bool((yield Ask(Query.SERVO_MODE)))
            if not self._custody.is_free:
                return
            self._links.is_servo_active = is_active
            if not is_active:
                return
            yield pause(_POLL_PERIOD_S)

    @staticmethod
    def _until(holds: Callable[[], bool], patience: float) -> Procedure:
        return (yield Until(lambda _now: holds(), patience))

    def _timeout(self) -> ReplyTimeout:
        return ReplyTimeout("stop_program", self._patience)


class _FreeStop:
    """One stop of an arm that this driver does not move, until the arm has been seen at rest.

    Attributes:
        answer: Ends the call that asked for it.
    """

    def __init__(self, channel: CommandChannel, custody: Custody, links: Links, admission: Admission, patience: float,
                 answer: "_Once", on_accepted: Callable[[float], None]) -> None:
        """Set up the stop.

        patience: The longest time to its answer, s.
        """
        self._on_accepted = on_accepted
        self.answer = answer
        self._channel = channel
        self._custody = custody
        self._links = links
        self._admission = admission
        self._patience = patience
        self._is_held_up = channel.is_held_up
        self._sent_at: Optional[float] = None
        self._accepted_at: Optional[float] = None
        self._is_over = False

    def send(self, now: float) -> None:
        """Send the stop, or send it again; raise as ``CommandChannel.request`` does."""
        is_repeated = self._sent_at is not None
        self._channel.request_all(whole_stop(None, is_repeated), now, self._replied, STOP_REPLY)
        self._sent_at = now
        self._admission.stops_under_way += 1

    def look(self, now: float, may_repeat: bool) -> bool:
        """Check what is known now, and send the stop again where needed; return whether it is done."""
        assert self._sent_at is not None
        if self._is_over:
            return True
        if not self._custody.is_free or self._is_seen_at_rest(now):  # nothing is moved by this driver before rest
            self.answer(None)
            return True
        if may_repeat and self._accepted_at is not None and self._moves_on(now):
            try:
                self.send(now)
            except JakaError as error:
                self.answer(error)
                return True
        return False

    def trouble(self, now: float) -> JakaError:
        """Return the error for an arm that was not seen at rest in time."""
        if self._accepted_at is None:
            return ReplyTimeout("stop_program", self._patience)
        try:
            state = self._links.fresh_state(now)
        except ConnectionLost as error:
            return StopNotSeen("the controller accepted the stop; whether the arm rests is not known: %s" % error)
        if state.program_state in PROGRAM_UNDER_WAY:
            return StopNotSeen("the controller accepted the stop, and within %.1f s its program has not ended"
                               % self._patience)
        if self._custody.stillness.duration(self._accepted_at) >= REST_TIME_S:
            return StopNotSeen("the controller accepted the stop, and the status feed shows the arm at rest; within "
                               "%.1f s it has not said that it is where the feed shows it" % self._patience)
        return StopNotSeen("the controller accepted the stop, and within %.1f s %s" % (
            self._patience, self._custody.unrest(self._accepted_at)))

    def _is_seen_at_rest(self, now: float) -> bool:
        """Return whether the arm was seen at rest after the stop was accepted.

        Where the stop's reply may have to wait for power_on or enable_robot, rest alone counts.
        """
        stillness = self._custody.stillness
        try:
            state = self._links.fresh_state(now)
        except ConnectionLost:
            return False
        if state.program_state in PROGRAM_UNDER_WAY:
            return False
        if self._accepted_at is not None:
            return (state.received_at > self._accepted_at and self._custody.is_shown_since(self._accepted_at)
                    and stillness.duration() >= REST_TIME_S)
        return self._is_held_up and stillness.duration(self._sent_at or now) >= REST_TIME_S

    def _moves_on(self, now: float) -> bool:
        """Return whether the arm, or a program, goes on though the stop was accepted.

        No stop ends what a hand moves.
        """
        try:
            state = self._links.fresh_state(now)
        except ConnectionLost:
            return False
        coasts_until = (self._sent_at or now) + _COASTING_TIME_S
        return not self._admission.is_guided_in(state) and state.received_at > coasts_until and (
            self._custody.stillness.has_moved_since(coasts_until) or state.program_state in PROGRAM_UNDER_WAY)

    def _replied(self, _result: object, error: Optional[JakaError], now: float) -> None:
        self._admission.stops_under_way -= 1
        if error is None and self._accepted_at is None:
            self._accepted_at = now
            self._on_accepted(now)
        elif error is not None and (self._accepted_at is None or not isinstance(error, CommandRejected)):
            self._is_over = True
            self.answer(error)
        self._admission.retry(now)


class _Once:
    """The answer of a call, of which only the first counts.

    Attributes:
        is_given: True once the call is answered.
    """

    def __init__(self, actions: Actions, call: Token) -> None:
        self._actions = actions
        self._call = call
        self.is_given = False

    def __call__(self, error: Optional[JakaError]) -> None:
        if not self.is_given:
            self.is_given = True
            self._actions.answer(self._call, None, error)
