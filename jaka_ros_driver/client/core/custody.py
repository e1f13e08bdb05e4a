"""Custody of a motion: from before its first byte until evidence that the arm rests.

It ends in two ways only. The motion saw its target reached and the arm still (``finish``). Or a stop of this custody
was accepted by the controller and the joints are still on fresh frames after that. No flag of the controller, no
timer and no order of events gives a moving arm away: whatever contradicts the motion sends a stop and keeps custody.
A stop is repeated until it is accepted, through refusals and new connections, and again while the arm moves on.

``Admission`` decides who may take custody next, and keeps who waits until the arm is free and at rest.
"""
import enum
import logging
from typing import Any, Callable, List, NamedTuple, Optional, Protocol, Sequence

from jaka_ros_driver.client.core.actions import Actions, NotifyGuard
from jaka_ros_driver.client.core.channel import CommandChannel
from jaka_ros_driver.client.core.contradictions import (
    STREAMS,
    ArmEvidence,
    JumpWatch,
    Watch,
    cause_of_stop,
    require_no_wait,
    require_start,
    standing_cause,
)
from jaka_ros_driver.client.core.motion import ArmMotion, MotionOwner
from jaka_ros_driver.client.core.stillness import ALL_SHOWN, REST_TIME_S, Shown, Stillness
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import SERVO_END_REPLY, STOP_REPLY, SetLinkLoss, whole_stop
from jaka_ros_driver.errors import (
    CommandRejected,
    ConnectionLost,
    InvalidCommand,
    JakaError,
    MotionInterrupted,
    ReplyTimeout,
    StopCause,
)
from jaka_ros_driver.state import RobotState

_RETRY_PERIOD_S = 0.05
"""Pause, s, from the refusal of a stop to the next one."""
_COASTING_TIME_S = 0.5
"""Time, s, after an accepted stop until an arm that still moves is stopped once more."""
_ANSWER_AFTER_S = 1.0
"""Longest time, s, until callers of a motion whose stop is not accepted are answered."""
_CAUSE_TIME_S = 0.1
"""Time, s, within which the status feed may show why the controller has refused a frame."""
_LOG_PERIOD_S = 1.0
_WAIT_FOR_REST_S = 1.5
"""Longest time, s, that a motion waits for the arm to come to rest from an earlier one."""
_NEVER = float("inf")

Enter = Callable[[float], None]
"""A function that begins a call at a time, s, and is tried again while the call waits; its error is the call's answer.
"""


class _Phase(enum.Enum):
    FREE = "nobody moves the arm"
    HELD = "a motion is under way"
    SETTLING = "the controller refused the motion: the arm is watched until it is seen at rest"
    STOPPING = "a stop is sent until it is accepted and the arm rests"


class Custody:
    """The custody of one motion at a time; the module's first lines describe it.

    Attributes:
        motion: The motion in custody; None while it is free.
        stillness: Evidence of rest, fed with every fresh frame.
        channel: The command port.
        actions: Where actions go.
        settings: Times.
        question_due: Somebody waits for evidence that the feed tells of this moment, s: the controller is asked.
    """

    def __init__(self, actions: Actions, channel: CommandChannel, settings: ClientSettings,
                 joint_max_speed: Sequence[float], on_free: Callable[[float], None]) -> None:
        """Set up while nobody moves the arm; ``on_free`` is called when that is so again.

        joint_max_speed: rad/s, base first.
        """
        self.actions = actions
        self.channel = channel
        self.settings = settings
        self.stillness = Stillness()
        self.motion: Optional[ArmMotion] = None
        self._on_free = on_free
        self._jumps = JumpWatch(joint_max_speed)
        self._state: Optional[RobotState] = None
        self._shown = ALL_SHOWN
        self.question_due = 0.0
        self._watch = Watch(MotionOwner.MOVE, None)
        self._phase = _Phase.FREE
        self._number = 0
        self._outcome: Optional[MotionInterrupted] = None
        self._is_answered = False
        self._is_guess = False
        self._held_since = 0.0
        self._began_at = 0.0
        self._sent_at = 0.0
        self._outstanding = 0
        self._accepted_at: Optional[float] = None
        self._moves_on = False
        self._retry_at = _NEVER
        self._logged_at = -_NEVER
        self._knows_link_loss = True

    # ---- what is known ----

    @property
    def is_free(self) -> bool:
        """True while nobody moves the arm."""
        return self._phase is _Phase.FREE

    @property
    def is_ending(self) -> bool:
        """True while custody ends as soon as the arm is seen at rest."""
        return self._phase in (_Phase.STOPPING, _Phase.SETTLING)

    @property
    def ending_reason(self) -> str:
        """The reason for which the motion is being stopped, in words; "" where it is not."""
        return str(self._outcome) if self.is_ending and self._outcome is not None else ""

    def describe(self) -> str:
        """Return phase, motion and outcome in words, as evidence."""
        return "%s; %s; outcome: %s; stop accepted at %s" % (
            self._phase.value, "no motion" if self.motion is None else self.motion.owner.value, self._outcome,
            self._accepted_at)

    @property
    def must_stop(self) -> bool:
        """True while a stop is still to be accepted."""
        return self._phase is _Phase.STOPPING and self._accepted_at is None

    @property
    def deadline(self) -> float:
        """The time at which ``tick`` is due, s."""
        if self.motion is None:
            return _NEVER
        if self._phase is _Phase.HELD:
            return self.motion.due()
        return min(self._retry_at, _NEVER if self._is_answered else self._began_at + _ANSWER_AFTER_S)

    def rest_since(self, moment: float) -> float:
        """Return for how long the arm has been seen at rest since then (monotonic, s), in s.

        It is 0 where the frames may be older than that moment.
        """
        resting = self.stillness.duration(moment)
        if resting <= 0.0:
            return 0.0
        return resting if self.is_shown_since(max(moment, self.stillness.since)) else 0.0

    def is_shown_since(self, moment: float) -> bool:
        """Return whether the feed has certainly shown what there was to be seen at that moment, s."""
        return self._is_seen(self._shown.until, moment)

    def is_answered_since(self, moment: float) -> bool:
        """Return whether the feed shows what the controller answered to a question of ``moment``, s, or later.

        True also where the controller cannot be asked.
        """
        return self._is_seen(self._shown.answered_until, moment)

    def _is_seen(self, until: float, moment: float) -> bool:
        """Return whether what was seen until then covers a moment; where it does not, have the controller asked."""
        if until < moment < _NEVER:
            self.question_due = max(self.question_due, moment)
        return until >= moment

    # ---- the life of a motion ----

    def begin(self, motion: ArmMotion, now: float) -> None:
        """Take custody, notify the guard, and let the motion send its first command.

        Raises:
            JakaError: Nothing was sent; nobody moves the arm.
        """
        self._take(motion, _Phase.HELD, now)
        self._set_link_loss(self.settings.link_loss_stop, now)
        try:
            motion.begin(now)
        except JakaError:
            self._is_answered = True
            self._release(now)
            raise

    def take_over(self, motion: ArmMotion, now: float) -> None:
        """Take custody of a motion that was left running: it is stopped, as the first message on the next link."""
        self._take(motion, _Phase.STOPPING, now)
        self._began_at = now
        self._is_answered = True

    def finish(self, now: float) -> None:
        """End the custody of a completed motion: the target is reached and the arm is still."""
        if self._phase is _Phase.HELD:
            self._release(now)

    def settle(self, now: float) -> None:
        """Watch a motion that the controller refused: nobody moves the arm once it is seen at rest."""
        if self._phase is _Phase.HELD:
            self._phase, self._began_at = _Phase.SETTLING, now
            self._is_answered = True

    def not_accepted(self, error: JakaError, now: float) -> None:
        """Handle the failure of the motion's command; unless the controller refused it, its effect is not known."""
        if isinstance(error, CommandRejected):
            self.settle(now)
        elif not isinstance(error, (ConnectionLost, ReplyTimeout)):  # with these the link goes, and ``link_lost`` acts
            self.stop(MotionInterrupted(StopCause.FAULT, str(error)), now)

    def stop(self, outcome: Optional[MotionInterrupted], now: float, is_guess: bool = False) -> None:
        """Stop the motion; its callers receive this outcome when the stop is accepted. The first one counts.

        ``is_guess``: the status feed may soon show the cause; then that is reported.
        """
        if self._phase in (_Phase.HELD, _Phase.SETTLING):
            self._phase = _Phase.STOPPING
            self._outcome, self._began_at, self._is_guess = outcome, now, is_guess
            if outcome is not None and outcome.cause is not StopCause.STOPPED:
                self.actions.log(logging.WARNING, "stopping the arm: %s" % outcome)
            self._send_stop(now)

    def stop_for(self, answer: Callable[[Optional[JakaError]], None], now: float) -> None:
        """Stop the motion for a caller: ``answer`` receives the error of this very stop, None where it was accepted."""
        if self._phase is not _Phase.STOPPING:
            self._phase = _Phase.STOPPING
            self._outcome, self._began_at = MotionInterrupted(StopCause.STOPPED), now
        self._send_stop(now, answer)

    # ---- events ----

    def observe(self, state: RobotState, now: float, shown: Shown = ALL_SHOWN) -> None:
        """Take a fresh state into account; ``shown`` says until when the feed has shown what there was to be seen."""
        self._shown = shown
        self.stillness.observe(state)
        self._state = state
        motion = self.motion
        if motion is None:
            return
        if self._phase is _Phase.HELD:
            cause = self._watch.cause(state)
            if cause is None:
                motion.observe(state, now)
            else:
                self.stop(cause, now)
        elif self._phase is _Phase.SETTLING:
            if self.stillness.has_moved_since(self._began_at):
                self.stop(MotionInterrupted(StopCause.FAULT, "the arm moves though the motion was refused"), now)
            elif self.rest_since(self._began_at) >= REST_TIME_S:
                if motion.may_be_left(state):
                    self._release(now)
                else:
                    self.stop(MotionInterrupted(StopCause.FAULT, "it is under way though it was refused"), now)
            return
        if self._phase is _Phase.STOPPING and self._is_guess:
            self._look_for_the_cause(state, now)
        if self._phase is _Phase.STOPPING:
            motion.observe_stop(state)
        if self._phase is _Phase.STOPPING and self._accepted_at is not None:
            coasts_until = self._sent_at + max(_COASTING_TIME_S, motion.rest_time)
            goes_on = now >= coasts_until and motion.goes_on(state)
            if self.rest_since(self._accepted_at) >= motion.rest_time and motion.may_be_left(state):
                self._release(now)
            elif self.stillness.has_moved_since(coasts_until) or goes_on:
                self._log(logging.ERROR, "the arm %s after an accepted stop; stopping it again" % (
                    "moves on" if self.stillness.has_moved_since(coasts_until) else "rests, and %s goes on"
                    % motion.name), now)
                self._accepted_at, self._moves_on = None, True
                self._send_stop(now)

    def notice_jump(self, state: RobotState, now: float) -> str:
        """Check a state that has come in time for a jump; return which joint has jumped, in words: then it may not be
        believed.

        A motion is stopped; what the arm did before the jump proves nothing of what it does now.
        """
        jump = self._jumps.jump(state)
        if jump:
            self.stillness.lose_sight()
            cause = self._watch.cause(state, jump)
            if cause is not None and self._phase is _Phase.HELD:
                self.stop(cause, now)
        return jump

    def note_servo_mode(self, is_active: bool, asked_at: float, now: float) -> None:
        """Take the controller's answer to a question of ``asked_at``, s: whether it is in servo mode."""
        if self._phase is _Phase.HELD and self.motion is not None and self._state is not None and (
                asked_at > self._held_since):
            cause = cause_of_stop(self.motion.owner, ArmEvidence(
                self._state, False, is_active, self.motion.wants_servo_mode(asked_at)))
            if cause is not None:
                self.stop(cause, now, is_guess=True)

    def tick(self, now: float) -> None:
        motion = self.motion
        if motion is None:
            return
        if self._phase is _Phase.HELD:
            motion.tick(now)
        elif self._phase is _Phase.STOPPING:
            if now >= self._retry_at and not self._outstanding:
                self._send_stop(now)
            if now - self._began_at >= _ANSWER_AFTER_S and not self._is_answered:
                if not self._waits_for_rest:
                    self._outcome = MotionInterrupted(StopCause.TIMEOUT, "the stop is not accepted; it is sent again "
                                                      "and again (%s)" % (self._outcome or "at the end"))
                self._answer_end()

    def prepare(self) -> None:
        """Compute in idle time what the motion sends next; nothing is sent."""
        if self.motion is not None and self._phase is _Phase.HELD:
            self.motion.prepare()

    def sight_lost(self, reason: str, now: float) -> None:
        """Stop a motion after the status feed is lost or unreadable: it would go on unseen."""
        self.stillness.lose_sight()
        self._jumps.lose_sight()
        if self._phase in (_Phase.HELD, _Phase.SETTLING):
            self.stop(MotionInterrupted(StopCause.LINK_LOST, reason), now)

    def link_lost(self, reason: str, now: float) -> None:
        """Take note that the command port is lost: the stop is the first message on the next connection."""
        self._outstanding = 0
        if self._phase in (_Phase.HELD, _Phase.SETTLING):
            self._phase, self._began_at = _Phase.STOPPING, now
        if self._phase is _Phase.STOPPING and not self._is_answered:
            if not self._waits_for_rest:
                self._outcome = MotionInterrupted(StopCause.LINK_LOST, reason)
            self._answer_end()

    def link_up(self, now: float) -> None:
        """Send the stop that is still owed, before anything else, on a command port that was connected."""
        self._knows_link_loss = True
        if self.must_stop:
            self.actions.log(logging.WARNING, "stopping the motion that was under way when the link went down")
            self._send_stop(now)

    # ---- inside ----

    def _take(self, motion: ArmMotion, phase: _Phase, now: float) -> None:
        assert self.is_free
        self._number += 1
        self.motion, self._phase = motion, phase
        self._outcome, self._is_answered, self._is_guess = None, False, False
        self._accepted_at, self._retry_at, self._outstanding, self._moves_on = None, _NEVER, 0, False
        self._watch = Watch(motion.owner, self._state)
        self._held_since = now
        self.actions.add(NotifyGuard(True, motion.name, motion.jog_stop))

    def _send_stop(self, now: float, answer: Callable[[Optional[JakaError]], None] = lambda error: None) -> None:
        """Send the stop of this motion now; without a connection the call fails and ``link_up`` sends it."""
        assert self.motion is not None
        number = self._number

        def replied(_result: Any, error: Optional[JakaError], at: float) -> None:
            answer(error)
            if number == self._number and self._phase is _Phase.STOPPING:
                self._stop_replied(error, at)

        def own_end_replied(_result: Any, error: Optional[JakaError], at: float) -> None:
            """Send the stop again, where its end of this very jog or servo mode was refused, until the arm rests."""
            if number == self._number and self._phase is _Phase.STOPPING and isinstance(error, CommandRejected):
                self._retry_at = at + _RETRY_PERIOD_S

        jog = self.motion.halt()
        own_ends = {}
        if self.motion.owner in STREAMS:
            own_ends = {SERVO_END_REPLY: own_end_replied}
        elif jog is not None and not self._moves_on:
            own_ends = {STOP_REPLY + 1: own_end_replied}
        try:
            self.channel.request_all(whole_stop(jog, self._moves_on), now, replied, STOP_REPLY, own_ends)
        except JakaError as error:
            self._retry_at = _NEVER
            self._log(logging.ERROR, "the arm could not be stopped: %s" % error, now)
            answer(error)
            return
        self._outstanding += 1
        self._retry_at = _NEVER
        if self._accepted_at is None:
            self._sent_at = now

    def _stop_replied(self, error: Optional[JakaError], now: float) -> None:
        self._outstanding = max(0, self._outstanding - 1)
        if error is None:
            self._accepted_at = now if self._accepted_at is None else self._accepted_at
            if not self._is_guess and not self._waits_for_rest:
                self._answer_end()
        elif not isinstance(error, ConnectionLost) and self._accepted_at is None:
            self._retry_at = now + _RETRY_PERIOD_S
            self._log(logging.ERROR, "the stop was not accepted, sending it again: %s" % error, now)

    def _look_for_the_cause(self, state: RobotState, now: float) -> None:
        cause = standing_cause(state)
        if cause is not None:
            self._outcome = cause
        if cause is not None or now - self._began_at >= _CAUSE_TIME_S:
            self._is_guess = False
            if self._accepted_at is not None and not self._waits_for_rest:
                self._answer_end()

    @property
    def _waits_for_rest(self) -> bool:
        """True where the stop is accepted, and its callers are answered only where the arm has come to rest."""
        return self._accepted_at is not None and self.motion is not None and self.motion.is_answered_at_rest

    def _log(self, level: int, text: str, now: float) -> None:
        """Log a text, but not the same trouble at every repetition."""
        if now - self._logged_at >= _LOG_PERIOD_S:
            self._logged_at = now
            self.actions.log(level, text)

    def _answer_end(self) -> None:
        if not self._is_answered and self.motion is not None:
            self._is_answered = True
            self.motion.ended(self._outcome)

    def _release(self, now: float) -> None:
        """Release the arm, which rests.

        Callers of the motion are answered last, so that the next motion finds the arm free.
        """
        motion, self.motion = self.motion, None
        self._phase = _Phase.FREE
        self._retry_at = _NEVER
        self._set_link_loss(0.0, now)
        self.actions.add(NotifyGuard(False))
        if not self._is_answered and motion is not None:
            motion.ended(self._outcome)
        self._on_free(now)

    def _set_link_loss(self, seconds: float, now: float) -> None:
        """Have the controller itself stop the arm where this client is lost in custody; not every firmware can."""
        if not self.settings.link_loss_stop or not self._knows_link_loss or not self.channel.is_open:
            return

        def replied(_result: Any, error: Optional[JakaError], _at: float) -> None:
            if isinstance(error, CommandRejected) and self._knows_link_loss:
                self._knows_link_loss = False
                self.actions.log(logging.WARNING, "this controller does not stop the arm by itself when it loses its "
                                                  "client: %s" % error)
        self.channel.request(SetLinkLoss(seconds), now, replied)


class Sight(Protocol):
    """The interface to the present knowledge of the arm, which ``Links`` implements."""

    @property
    def is_up(self) -> bool:
        """True while both connections are up."""

    @property
    def last_error(self) -> str:
        """The reason for which a connection is down; empty when both are up."""

    @property
    def is_servo_active(self) -> bool:
        """True while the controller is in servo mode; False while that is not known."""

    @property
    def is_in_question(self) -> bool:
        """True while the feed has not shown what the controller answered, and may show it."""

    def fresh_state(self, now: float) -> RobotState:
        """Return the newest state; raise ConnectionLost where it is stale."""


class _Waiting(NamedTuple):
    call: Any
    enter: Enter
    deadline: float


class Admission:
    """The queue of calls that want the arm, of which one at a time is admitted.

    Attributes:
        is_setting: A change that needs the arm at rest is being made.
        is_guided: Hand guiding was switched on by this driver; not every feed has that.
        stops_under_way: Stops that were sent while nobody had custody, and are not answered yet.
    """

    def __init__(self, actions: Actions, custody: Custody, sight: Sight) -> None:
        self._actions = actions
        self._custody = custody
        self._sight = sight
        self._waiting: List[_Waiting] = []
        self.is_setting = False
        self.is_guided = False
        self.stops_under_way = 0

    @property
    def owner(self) -> Optional[MotionOwner]:
        """The kind of motion that has the arm on behalf of this driver; None for none."""
        if self._custody.motion is not None:
            return self._custody.motion.owner
        return MotionOwner.SETTING if self.is_setting else None

    @property
    def deadline(self) -> float:
        """The time at which ``retry`` is due, s."""
        return min([waiting.deadline for waiting in self._waiting], default=float("inf"))

    def require_ready_to_move(self, owner: MotionOwner, now: float) -> RobotState:
        """Check that nothing forbids a motion of this kind now; return the arm's state.

        Raises:
            InvalidCommand: Something does (``contradictions``).
            ConnectionLost: There is no fresh state, or no link.
        """
        state = self._sight.fresh_state(now)
        require_start(owner, self.evidence(owner, state))
        self._custody.channel.require_prompt(owner.value)
        if not self._sight.is_up:
            raise ConnectionLost("no link to the controller: " + self._sight.last_error)
        return state

    def is_guided_in(self, state: RobotState) -> bool:
        """Return whether somebody guides the arm by hand; where the feed lacks that, what this driver switched on
        counts.
        """
        return self.is_guided if state.is_hand_guided is None else state.is_hand_guided

    def evidence(self, owner: MotionOwner, state: RobotState) -> ArmEvidence:
        """Return what is known before a motion of this kind."""
        is_free = self.owner is None  # else servo mode is this driver's own
        return ArmEvidence(state, self.is_guided_in(state), self._sight.is_servo_active if is_free else None,
                           None if owner in STREAMS else False)

    def may_begin(self, call: Any, enter: Enter, asked_at: float, now: float,
                  owner: MotionOwner = MotionOwner.SETTING) -> bool:
        """Return whether a new motion may begin; otherwise the call waits for the present one to come to rest.

        Raises:
            InvalidCommand: Somebody else has the arm, and keeps it.
            ConnectionLost: Whether the arm rests is not known.
        """
        if self.is_free_at_rest(owner, now):
            return True
        if now - asked_at >= _WAIT_FOR_REST_S:
            holder = self.owner
            if holder is None:
                require_no_wait(owner, self.evidence(owner, self._sight.fresh_state(now)))
            raise InvalidCommand("refused: the arm has not come to rest within %.1f s; %s" % (
                _WAIT_FOR_REST_S, "it moves, and not by this driver" if holder is None
                else "%s is still being ended" % holder.value))
        self._waiting.append(_Waiting(call, enter, asked_at + _WAIT_FOR_REST_S))
        return False

    def is_free_at_rest(self, owner: MotionOwner, now: float) -> bool:
        """Return whether a new motion may begin now; False while the arm comes to rest from an earlier one.

        Raises:
            InvalidCommand: Somebody else has the arm, and keeps it.
            ConnectionLost: Whether the arm rests is not known.
        """
        motion = self._custody.motion
        if motion is not None and not self._custody.is_ending and not motion.is_leaving:
            raise InvalidCommand("refused: %s owns the arm's motion; wait for its end or stop it first"
                                 % motion.owner.value)
        if not self._custody.is_free or self.is_setting or self.stops_under_way:
            return False
        state = self._sight.fresh_state(now)
        try:
            require_no_wait(owner, self.evidence(owner, state))
        except InvalidCommand:
            return False
        return self._custody.stillness.duration() >= REST_TIME_S and not self._sight.is_in_question

    def retry(self, now: float) -> None:
        """Try again to begin the waiting calls."""
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        for one in waiting:
            try:
                one.enter(now)
            except JakaError as error:
                self._actions.answer(one.call, None, error)

    def end_waiting(self, error: JakaError) -> None:
        """Answer every waiting call with this error."""
        self._actions.answer_all([one.call for one in self._waiting], error)
        self._waiting = []
