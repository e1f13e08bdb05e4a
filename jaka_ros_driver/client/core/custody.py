"""Custody of a motion: from before its first byte until evidence that the arm rests.

It ends in two ways only. The motion saw its target reached and the arm still (``finish``). Or a stop of this custody
was accepted by the controller and the joints are still on fresh frames after that. No flag of the controller, no
timer and no order of events gives a moving arm away: whatever contradicts the motion sends a stop and keeps custody.
A stop is repeated until it is accepted, through refusals and new connections, and again while the arm moves on.
The phases in which a motion is held, and what leads from one to another, are the table of ``phases``.
"""
import logging
from typing import Callable, Optional

from jaka_ros_driver.client.core.actions import Actions, NotifyGuard
from jaka_ros_driver.client.core.channel import CommandChannel
from jaka_ros_driver.client.core.contradictions import (
    STREAMS,
    ArmEvidence,
    JumpWatch,
    Watch,
    cause_of_stop,
    standing_cause,
)
from jaka_ros_driver.client.core.motion import ArmMotion, MotionOwner
from jaka_ros_driver.client.core.motion_guard.motion_check import MotionCheck
from jaka_ros_driver.client.core.phases import Event, Phase, transition
from jaka_ros_driver.client.core.stillness import ALL_SHOWN, REST_TIME_S, SURE_REST_S, Shown, Stillness
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import SERVO_END_REPLY, STOP_REPLY, SetLinkLoss, whole_stop
from jaka_ros_driver.errors import (
    CommandRejected,
    ConnectionLost,
    JakaError,
    MotionInterrupted,
    ReplyTimeout,
    StopCause,
)
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.state import ProgramState, RobotState

START_WINDOW_S = 1.0
"""Longest time, s, until an accepted motion must be seen to begin; else it is stopped, because it may begin later."""
_UNSEEN_S = 0.2
"""Additional time, s, where no frame comes that would show it: two of the slowest feed."""
_RETRY_PERIOD_S = 0.05
"""Pause, s, from the refusal of a stop to the next one."""
_COASTING_TIME_S = 0.5
"""Time, s, after an accepted stop until an arm that still moves is stopped once more."""
_ANSWER_AFTER_S = 1.0
"""Longest time, s, until callers of a motion whose stop is not accepted are answered."""
_CAUSE_TIME_S = 0.1
"""Time, s, within which the status feed may show why the controller has refused a frame."""
_ORDINARY_ENDS = (StopCause.STOPPED, StopCause.CANCELLED, StopCause.REPLACED, StopCause.SHUTDOWN,
                  StopCause.MOTION_GUARD)
"""Reasons to stop that show nothing of an arm that does not do as it is told."""
_LOG_PERIOD_S = 1.0
"""Shortest period, s, of lines about trouble: a refused stop is repeated twenty times a second."""
_NEVER = float("inf")


class Custody:
    """The custody of one motion at a time; the module's first lines describe it.

    Attributes:
        motion: The motion in custody; None while it is free.
        stillness: Evidence of rest, fed with every fresh frame.
        channel: The command port.
        actions: Where actions go.
        settings: Times.
        motion_check: What is asked before a motion begins, and while it lasts.
        question_due: Somebody waits for evidence that the feed tells of this moment, s: the controller is asked.
    """

    def __init__(self, actions: Actions, channel: CommandChannel, settings: ClientSettings,
                 model: ArmModel, on_free: Callable[[float], None]) -> None:
        """Set up while nobody moves the arm; ``on_free`` is called when that is so again."""
        self.actions = actions
        self.channel = channel
        self.settings = settings
        self.motion_check = MotionCheck(model, settings, actions)
        self.stillness = Stillness()
        self.motion: Optional[ArmMotion] = None
        self._on_free = on_free
        self._jumps = JumpWatch(model.joint_max_speed)
        self._state: Optional[RobotState] = None
        self._shown = ALL_SHOWN
        self.question_due = 0.0
        self._watch = Watch(MotionOwner.MOVE, None)
        self._phase = Phase.FREE
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
        self._is_in_doubt = False
        self._retry_at = _NEVER
        self._logged_at = -_NEVER
        self._knows_link_loss = True

    # ---- what is known ----

    @property
    def is_free(self) -> bool:
        """True while nobody moves the arm."""
        return self._phase is Phase.FREE

    @property
    def is_ending(self) -> bool:
        """True while custody ends as soon as the arm is seen at rest."""
        return self._phase in (Phase.STOPPING, Phase.SETTLING)

    @property
    def ending_reason(self) -> str:
        """The reason for which the motion is being stopped, in words; "" where it is not."""
        return str(self._outcome) if self.is_ending and self._outcome is not None else ""

    def start_window(self, rest_time: float) -> float:
        """Return how long after its acceptance a motion may begin, s; ``rest_time``: the stillness that is rest, s."""
        return max(START_WINDOW_S, rest_time) + self.settings.start_delay

    def unseen_start(self, rest_time: float) -> float:
        """Return the same where no frame shows whether it has begun."""
        return self.start_window(rest_time) + _UNSEEN_S

    def describe(self) -> str:
        """Return phase, motion and outcome in words, as evidence."""
        return "%s; %s; outcome: %s; stop accepted at %s" % (
            self._phase.value, "no motion" if self.motion is None else self.motion.owner.value, self._outcome,
            self._accepted_at)

    @property
    def must_stop(self) -> bool:
        """True while a stop is still to be accepted."""
        return self._phase is Phase.STOPPING and self._accepted_at is None

    @property
    def deadline(self) -> float:
        """The time at which ``tick`` is due, s."""
        if self.motion is None:
            return _NEVER
        if self._phase is Phase.HELD:
            return self.motion.due()
        retry_at = _NEVER if self._outstanding else self._retry_at  # the retry comes with the last of the replies
        return min(retry_at, _NEVER if self._is_answered else self._began_at + _ANSWER_AFTER_S)

    def rest_since(self, moment: float) -> float:
        """Return for how long the arm has been seen at rest since then (monotonic, s), in s.

        It is 0 where the frames may be older than that moment and the time of rest behind it: what has just begun to
        move is still near to where it rested.
        """
        resting = self.stillness.duration(moment)
        if resting <= 0.0:
            return 0.0
        return resting if self.is_shown_since(max(moment, self.stillness.since) + REST_TIME_S) else 0.0

    def unrest(self, since: float) -> str:
        """Return why the arm does not count as at rest, in words that follow a time; ``since``: it is asked for since
        then, s.
        """
        if self.motion is not None:
            return ("the stop of %s has not been accepted" if self.must_stop else "%s has not come to its end"
                    ) % self.motion.owner.value
        if self.stillness.has_moved_since(since):
            return "the arm has not come to rest; it moves, and not by this driver"
        return "the status feed has not shown that the arm rests"

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
        self._take(motion, Event.BEGIN, now)
        self._set_link_loss(self.settings.link_loss_stop, now)
        try:
            motion.begin(now)
        except JakaError:
            self._is_answered = True
            self._enter(Event.NOT_SENT)
            self._release(now)
            raise

    def take_over(self, motion: ArmMotion, now: float) -> None:
        """Take custody of a motion that was left running: it is stopped, as the first message on the next link."""
        self._take(motion, Event.TAKE_OVER, now)
        self._began_at = now
        self._is_answered = self._is_in_doubt = True  # its speed is not known

    def finish(self, now: float) -> None:
        """End the custody of a completed motion: the target is reached and the arm is still."""
        if self._enter(Event.FINISH):
            self._release(now)

    def settle(self, now: float) -> None:
        """Watch a motion that the controller refused: nobody moves the arm once it is seen at rest."""
        if self._enter(Event.REFUSED):
            self._began_at, self._is_answered = now, True

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
        if self._enter(Event.STOP):
            self._begin_stop(outcome, now, is_guess)

    def stop_for(self, answer: Callable[[Optional[JakaError]], None], now: float) -> None:
        """Stop the motion for a caller: ``answer`` receives the error of this very stop, None where it was accepted."""
        if self._phase is not Phase.STOPPING:
            self._outcome, self._began_at = MotionInterrupted(StopCause.STOPPED), now
        self._enter(Event.STOP_CALL)
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
        if self._phase is Phase.HELD:
            cause = self._watch.cause(state)
            if cause is None:
                motion.observe(state, now)
            else:
                self.stop(cause, now)
        elif self._phase is Phase.SETTLING:
            if self.stillness.has_moved_since(self._began_at):
                self._enter(Event.MOVES_ON)
                self._begin_stop(MotionInterrupted(StopCause.FAULT, "the arm moves though the motion was refused"), now)
            elif self.rest_since(self._began_at) >= self._rest_time:
                if motion.may_be_left(state):
                    self._enter(Event.AT_REST)
                    self._release(now)
                elif motion.goes_on(state):
                    self._enter(Event.MOVES_ON)
                    self._begin_stop(MotionInterrupted(StopCause.FAULT, "it runs though it was refused"), now)
            return
        if self._phase is Phase.STOPPING and self._is_guess:
            self._look_for_the_cause(state, now)
        if self._phase is Phase.STOPPING:
            motion.observe_stop(state)
        if self._phase is Phase.STOPPING and self._outcome is None and self.stillness.has_moved_since(self._began_at):
            self._outcome = MotionInterrupted(StopCause.STOPPED, "the arm moved when it was taken to be at the end")
            if self._accepted_at is not None and not self._waits_for_rest:
                self._answer_end()
        if self._phase is Phase.STOPPING and self._accepted_at is not None:
            coasts_until = self._sent_at + max(_COASTING_TIME_S, motion.rest_time)
            goes_on = now >= coasts_until and motion.goes_on(state)
            if self.rest_since(self._accepted_at) >= motion.rest_time and motion.may_be_left(state):
                if self._outcome is not None:
                    self._answer_end()
                if self.rest_since(self._accepted_at) >= self._rest_time:
                    self._enter(Event.AT_REST)
                    self._release(now)
            elif self.stillness.has_moved_since(coasts_until) or goes_on:
                self._log(logging.ERROR, "the arm %s after an accepted stop; stopping it again" % (
                    "moves on" if self.stillness.has_moved_since(coasts_until) else "rests, and %s goes on"
                    % motion.name), now)
                self._enter(Event.MOVES_ON)
                self._is_in_doubt = self._is_in_doubt or self.stillness.has_moved_since(coasts_until)
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
            if cause is not None and self._phase is Phase.HELD:
                self.stop(cause, now)
        return jump

    def note_servo_mode(self, is_active: bool, asked_at: float, now: float) -> None:
        """Take the controller's answer to a question of ``asked_at``, s: whether it is in servo mode."""
        if self._phase is Phase.HELD and self.motion is not None and self._state is not None and (
                asked_at > self._held_since):
            cause = cause_of_stop(self.motion.owner, ArmEvidence(
                self._state, False, is_active, self.motion.wants_servo_mode(asked_at)))
            if cause is not None:
                self.stop(cause, now, is_guess=True)

    def tick(self, now: float) -> None:
        motion = self.motion
        if motion is None:
            return
        if self._phase is Phase.HELD:
            motion.tick(now)
        elif self._phase is Phase.STOPPING:
            if now >= self._retry_at and not self._outstanding:
                self._send_stop(now)
            if now - self._began_at >= _ANSWER_AFTER_S and not self._is_answered:
                if self._accepted_at is None:
                    self._outcome = MotionInterrupted(StopCause.TIMEOUT, "the stop is not accepted; it is sent again "
                                                      "and again (%s)" % (self._outcome or "at the end"))
                elif self._outcome is None:
                    self._outcome = MotionInterrupted(StopCause.TIMEOUT, "the arm is not seen at rest at its end")
                self._answer_end()

    def prepare(self) -> None:
        """Compute in idle time what the motion sends next; nothing is sent."""
        if self.motion is not None and self._phase is Phase.HELD:
            self.motion.prepare()

    def sight_lost(self, reason: str, now: float) -> None:
        """Stop a motion after the status feed is lost or unreadable: it would go on unseen."""
        self.stillness.lose_sight()
        self._jumps.lose_sight()
        self._is_in_doubt = True
        self.stop(MotionInterrupted(StopCause.LINK_LOST, reason), now)

    def link_lost(self, reason: str, now: float) -> None:
        """Take note that the command port is lost: the stop is the first message on the next connection."""
        self._outstanding = 0
        self._is_in_doubt = True
        if self._phase in (Phase.HELD, Phase.SETTLING):
            self._began_at = now
        if self._enter(Event.LINK_LOST) and not self._is_answered:
            if not self._waits_for_rest or self._outcome is None:
                self._outcome = MotionInterrupted(StopCause.LINK_LOST, reason)
            self._answer_end()

    def link_up(self, now: float) -> None:
        """Send the stop that is still owed, before anything else, on a command port that was connected."""
        self._knows_link_loss = True
        if self.must_stop:
            self.actions.log(logging.WARNING, "stopping the motion that ran when the link went down")
            self._send_stop(now)

    # ---- inside ----

    def _enter(self, event: Event) -> bool:
        """Enter the phase to which an event leads; return False where the present phase ignores the event."""
        row = transition(self._phase, event)
        self._phase = row.to
        return not row.is_ignored

    def _take(self, motion: ArmMotion, event: Event, now: float) -> None:
        self._enter(event)
        self._number += 1
        self.motion = motion
        self._outcome, self._is_answered, self._is_guess = None, False, False
        self._accepted_at, self._retry_at, self._outstanding, self._moves_on = None, _NEVER, 0, False
        self._is_in_doubt = False
        self._watch = Watch(motion.owner, self._state)
        self._held_since = now
        motion.is_beside_program = self._state is not None and self._state.program_state == ProgramState.PAUSED
        self.actions.add(NotifyGuard(True, motion.name, motion.jog_stop))

    def _begin_stop(self, outcome: Optional[MotionInterrupted], now: float, is_guess: bool = False) -> None:
        """Send the first stop of this motion, which ends with this outcome."""
        self._outcome, self._began_at, self._is_guess = outcome, now, is_guess
        self._is_in_doubt = self._is_in_doubt or (outcome is not None and outcome.cause not in _ORDINARY_ENDS)
        if outcome is not None and outcome.cause is not StopCause.STOPPED:
            self.actions.log(logging.WARNING, "stopping the arm: %s" % outcome)
        self._send_stop(now)

    def _send_stop(self, now: float, answer: Callable[[Optional[JakaError]], None] = lambda error: None) -> None:
        """Send the stop of this motion now; without a connection the call fails and ``link_up`` sends it."""
        assert self.motion is not None
        number = self._number

        def replied(_result: object, error: Optional[JakaError], at: float) -> None:
            answer(error)
            if number == self._number and self._phase is Phase.STOPPING:
                self._stop_replied(error, at)

        def own_end_replied(_result: object, error: Optional[JakaError], at: float) -> None:
            """Send the stop again, where its end of this very jog or servo mode was refused, until the arm rests."""
            if number == self._number and self._phase is Phase.STOPPING and isinstance(error, CommandRejected):
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
            self._retry_at, self._is_in_doubt = now + _RETRY_PERIOD_S, True
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
    def _rest_time(self) -> float:
        """The stillness, s, that ends custody: one in which any arm that creeps is seen, where that may be one.

        At the usual end of a motion its own time suffices, for the next one waits for it.
        """
        assert self.motion is not None
        return max(self.motion.rest_time, SURE_REST_S) if self._is_in_doubt else self.motion.rest_time

    @property
    def _waits_for_rest(self) -> bool:
        """True where the stop is accepted, and its callers are answered only where the arm has come to rest.

        A motion that was completed is one: what begins late may begin in that very moment.
        """
        return self._accepted_at is not None and self.motion is not None and (
            self._outcome is None or self.motion.is_answered_at_rest)

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
        """Release the motion, which has just entered FREE.

        Callers of the motion are answered last, so that the next motion finds the arm free.
        """
        motion, self.motion = self.motion, None
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

        def replied(_result: object, error: Optional[JakaError], _at: float) -> None:
            if isinstance(error, CommandRejected) and self._knows_link_loss:
                self._knows_link_loss = False
                self.actions.log(logging.WARNING, "this controller does not stop the arm by itself when it loses its "
                                                  "client: %s" % error)
        self.channel.request(SetLinkLoss(seconds), now, replied)
