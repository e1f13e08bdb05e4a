"""The base class of motions in servo mode: entered and confirmed, one frame every 8 ms, left at rest."""
import logging
import math
from typing import Callable, Optional, Tuple, Union

from jaka_ros_driver.client.core.channel import CommandChannel
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import ArmMotion
from jaka_ros_driver.client.core.motion_guard.frame_guard import FrameGuard
from jaka_ros_driver.client.core.procedures.steps import Ask, Now, Procedure, Running, pause
from jaka_ros_driver.client.core.servo_trace import ServoTrace
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.commands import JogStop, Query, ServoJoint, ServoPose, SetServoMode
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.limits import SERVO_PERIOD_S
from jaka_ros_driver.state import RobotState, Vector

MAX_JOINT_DEVIATION = 0.04
"""Largest deviation, rad, from a frame: more than one cycle's step at 180 deg/s, behind which a controller ignores
frames.
"""
_CONFIRM_TIMEOUT_S = 2.0
"""Longest time, s, until the controller confirms that it has entered or left servo mode."""
_POLL_PERIOD_S = 0.02
"""Pause, s, between two questions for that."""
_BEHIND_STATUS_S = 0.006
"""Delay, s, from a status frame to the frames of a stream.

Both come every 8 ms and are served by one thread, so that a stream whose frames fell due just after a status frame
would stay behind the work for it, with all its hold-ups.
"""
_TAKEN_WITHIN_S = 2.0 * SERVO_PERIOD_S
"""Time, s, from when a frame is due until a controller has taken it: a cycle for the one before it, and one for it."""
_RESTED_WITHIN = 0.02
"""Distance, rad, of a joint from where the arm rested when servo mode was asked for, above which no frame is sent.

It is twice the tolerance of a move's target; a frame that comes late or twice shows a moving arm farther away.
"""
_NEVER = float("inf")
_SAME_POINT = 1e-7
"""Distance, rad or m, of two frames up to which they ask for the same place."""

ServoFrame = Union[ServoJoint, ServoPose]
OnMode = Callable[[bool, str], None]


class Streaming(ArmMotion):
    """A motion that sends a frame each cycle. Late cycles are left out, never caught up in a burst.

    Any failure stops the arm. A child class makes the frames and decides when the stream is over. A motion with a
    reserve sends each frame ``stream_ahead`` cycles before it is due, so that a driver that is late by no more than
    that leaves the controller with frames; what was used of the reserve is then sent at once.

    Attributes:
        has_reserve: Frames are sent ahead where the settings say so.
        late_cycles: Cycles that came too late to be sent.
        frame_guard: Passes frames on, or brakes; None where nobody looks at them one by one.
    """

    has_reserve = False
    frame_guard: Optional[FrameGuard] = None

    def __init__(self, custody: Custody, state: RobotState, on_mode: OnMode) -> None:
        """Set up the motion.

        Args:
            custody: Of this motion.
            state: Before the motion.
            on_mode: Called with whether servo mode is on and, when it has ended, why.
        """
        self._custody = custody
        self._state = self._begun_from = state
        self._observed_at = state.received_at
        self._on_mode = on_mode
        self._trace = ServoTrace()
        self._look = custody.motion_check.look()
        self._cycles_ahead = custody.settings.stream_ahead if self.has_reserve else 0
        self._lead = custody.settings.stream_lead if self.has_reserve else 0.0
        self._next_frame = _NEVER  # when the controller is to follow it; it is sent this much earlier: _lead
        self._point: Vector = ()
        self._moved_at = -math.inf
        self._leave_reason: Optional[str] = None
        self._confirming: Optional[Running] = None
        self._is_entered = False
        self._entered_at = _NEVER
        self._left_at: Optional[float] = None
        self._leaving = _Leaving(custody.channel)
        self.late_cycles = 0

    # ---- called by a subclass ----

    def _entered(self, now: float) -> None:
        """Start the stream, because servo mode is on: the frames begin within one cycle, at ``_next_frame``."""
        raise NotImplementedError

    def _not_entered(self, error: JakaError) -> None:
        """Handle that servo mode could not be entered; nothing has moved."""
        raise NotImplementedError

    def _frame(self, now: float) -> ServoFrame:
        """Return the frame of this cycle."""
        raise NotImplementedError

    def _sent_point(self) -> Vector:
        """Return the target of that frame, in the coordinates that ``_contradiction`` compares."""
        raise NotImplementedError

    def _is_over(self) -> bool:
        """Return whether nothing is left to be sent, so that servo mode can be left."""
        raise NotImplementedError

    def _contradiction(self, state: RobotState) -> Optional[MotionInterrupted]:
        """Return what in this state contradicts the stream; None where nothing does."""
        raise NotImplementedError

    def _joints_of(self, frame: ServoFrame) -> Tuple[Optional[Vector], str]:
        """Return the joints of a frame, rad (6,), None where nobody knows them, and why it ends the stream, or ""."""
        return (frame.joint_position if isinstance(frame, ServoJoint) else None), ""

    def _frame_at(self, joints: Vector) -> Tuple[ServoFrame, Vector]:
        """Return a frame of the brake, at these joints, rad (6,), and its target as ``_sent_point`` has it."""
        return ServoJoint(joints), joints

    def _skipped(self, cycles: int) -> None:
        """Handle that so many cycles came too late."""

    def _is_guarded(self, joints: Vector) -> None:
        """Have the motion guard look at each frame from now on.

        joints: Where the stream begins, at rest, rad (6,).
        """
        self.frame_guard = FrameGuard(self._look, joints)

    def _require_unbraked(self) -> None:
        """Check that the motion guard does not brake the stream, which then follows nothing more.

        Raises:
            InvalidCommand: It does; the message has the reason.
        """
        if self.frame_guard is not None and self.frame_guard.trouble:
            raise InvalidCommand("refused: the motion guard brakes this stream: %s" % self.frame_guard.trouble)

    def _brakes(self, trouble: str) -> None:
        """Log that the motion guard has the stream brake, for this trouble; no frame of the stream's own follows."""
        self._custody.actions.log(logging.WARNING, "the motion guard brakes %s: %s" % (self.name, trouble))

    # ---- life ----

    @property
    def is_streaming(self) -> bool:
        """True while frames are being sent."""
        return self._next_frame != _NEVER

    @property
    def is_moving(self) -> Optional[bool]:
        """True while the stream moves the arm; None while no frames are sent.

        It does from the first frame that leads elsewhere until the arm is seen at rest after the last such frame: what
        the controller says of itself between two frames depends on when it got them.
        """
        if not self.is_streaming:
            return None
        return self._moved_at > -math.inf and self._custody.rest_since(self._moved_at) < REST_TIME_S

    def begin(self, now: float) -> None:
        self._confirming = Running(_entered(), self._custody.channel, self._enter_ended)
        self._confirming.begin(now)

    def wants_servo_mode(self, since: float) -> Optional[bool]:
        return True if self.is_streaming and since > self._entered_at else None

    def due(self) -> float:
        return min(self._next_frame - self._lead, self._confirming.deadline if self._confirming else _NEVER)

    def observe(self, state: RobotState, now: float) -> None:
        self._state, self._observed_at = state, now
        cause = self._contradiction(state) if self.is_streaming else self._motion_before_the_stream(state)
        if cause is not None:
            self._custody.stop(cause, now)
        elif self._left_at is not None and self._custody.rest_since(self._left_at) >= self.rest_time:
            self._custody.finish(now)

    def _motion_before_the_stream(self, state: RobotState) -> Optional[MotionInterrupted]:
        """Return why no frame may be sent: the arm rested when this began, and is elsewhere before the first one."""
        if self._is_entered or self._left_at is not None:
            return None
        away = max([abs(a - b) for a, b in zip(state.joint_position, self._begun_from.joint_position)])
        return None if away <= _RESTED_WITHIN else MotionInterrupted(
            StopCause.FAULT, "a joint is %.3f rad from where the arm rested before servo mode" % away)

    def tick(self, now: float) -> None:
        if self._confirming is not None:
            self._confirming.tick(now)
        for _ in range(1 + self._cycles_ahead):
            if now < self._next_frame - self._lead:
                return
            self._cycle(now)

    def _cycle(self, now: float) -> None:
        has_run_out = not self._lead or now >= self._moved_at + _TAKEN_WITHIN_S  # the reserve leads nowhere any more
        if has_run_out and self._is_over():
            self._next_frame = _NEVER
            self._confirming = Running(left_servo_mode(), self._custody.channel, self._leave_ended)
            self._confirming.begin(now)
            return
        held_up = now - (self._next_frame - self._lead)
        if held_up > self._custody.settings.stale_after:  # the arm may have been moved meanwhile
            self._custody.stop(MotionInterrupted(
                StopCause.LINK_LOST, "the driver was held up for %.2f s" % held_up), now)
            return
        if has_run_out and self.frame_guard is not None and self.frame_guard.is_standing:
            self._custody.stop(MotionInterrupted(StopCause.MOTION_GUARD, self.frame_guard.trouble), now)
            return
        self._send_frame(now)

    def observe_stop(self, state: RobotState) -> None:
        if self._leaving.observe(state.received_at):
            self._on_mode(False, "")

    def may_be_left(self, state: RobotState) -> bool:
        """Return whether servo mode is left after a stop, or was not within 2 s.

        In servo mode the next motion would be refused.
        """
        return self._leaving.is_over

    def goes_on(self, state: RobotState) -> bool:
        return self._leaving.is_answered_on

    def halt(self) -> Optional[JogStop]:
        self._next_frame = _NEVER
        self._confirming = None
        self._leaving.begin()
        return None

    # ---- inside ----

    def _enter_ended(self, _result: object, error: Optional[JakaError], now: float) -> None:
        if self._custody.motion is not self or self._custody.is_ending:
            return
        self._confirming = None
        if error is None:
            self._is_entered, self._entered_at = True, now
            self._next_frame = now + (self._observed_at + _BEHIND_STATUS_S - now) % SERVO_PERIOD_S
            self._on_mode(True, "")
            self._entered(now)
            return
        if isinstance(error, MotionInterrupted):
            self._custody.stop(error, now)
            return
        self._not_entered(error)
        if isinstance(error, CommandRejected) and error.command == "servo_move":
            self._custody.settle(now)
        else:
            self._custody.stop(MotionInterrupted(StopCause.FAULT, str(error)), now)

    def _leave_ended(self, _result: object, error: Optional[JakaError], now: float) -> None:
        if self._custody.motion is not self or self._custody.is_ending:
            return
        self._confirming = None
        if error is None:
            self._left_at = now
            self._on_mode(False, self._leave_reason or "")
        else:
            self._custody.stop(MotionInterrupted(StopCause.FAULT, "servo mode was not left: %s" % error), now)

    def _send_frame(self, now: float) -> None:
        guard = self.frame_guard
        if guard is not None and guard.trouble:
            frame, point = self._frame_at(guard.braked())
        else:
            frame, point = self._frame(now), self._sent_point()
            joints, trouble = (None, "") if guard is None else self._joints_of(frame)
            if guard is not None and (trouble or joints is not None):
                sent = guard.brakes_for(trouble) if joints is None else guard.admitted(joints)
                if guard.trouble:
                    frame, point = self._frame_at(sent)
                    self._brakes(guard.trouble)
        before, self._point = self._point, point
        if len(before) == len(point) and math.dist(before, point) > _SAME_POINT:
            self._moved_at = now + self._lead
        self._trace.sent(point, now)
        self._next_frame += SERVO_PERIOD_S
        late = now - self._next_frame
        if late > 0.0:
            skipped = 1 + int(late / SERVO_PERIOD_S)
            self.late_cycles += skipped
            self._next_frame += SERVO_PERIOD_S * skipped
            self._skipped(skipped)
        self._custody.channel.request(frame, now, self._frame_replied)

    def _frame_replied(self, _result: object, error: Optional[JakaError], now: float) -> None:
        if error is not None and self._custody.motion is self and self.is_streaming:
            self._custody.stop(MotionInterrupted(StopCause.FAULT, "servo stream ended: %s" % error), now, is_guess=True)


class _Leaving:
    """The watch over a stop that ends servo mode, with a question after each frame of the status feed; it delays
    nothing.

    Attributes:
        is_over: Servo mode is left, was not in time, or no stop has begun.
        is_answered_on: The controller has answered, since the last stop, that servo mode is on.
    """

    def __init__(self, channel: CommandChannel) -> None:
        self._channel = channel
        self._began_at: Optional[float] = None
        self._stop = 0
        self._is_asking = False
        self._is_left = False
        self.is_over = True
        self.is_answered_on = False

    def begin(self) -> None:
        """Begin with a stop that is about to be sent: earlier questions prove nothing."""
        self._stop += 1
        self._is_asking = False
        self.is_over = self.is_answered_on = self._is_left = False

    def observe(self, now: float) -> bool:
        """Ask anew where that is due; return, once, whether servo mode has been left."""
        if self.is_over:
            return False
        self._began_at = now if self._began_at is None else self._began_at
        self.is_over = self._is_left or now - self._began_at > _CONFIRM_TIMEOUT_S
        self.is_answered_on = self.is_answered_on and not self.is_over
        if not self.is_over and not self._is_asking and self._channel.is_open:
            self._is_asking, number = True, self._stop

            def replied(result: object, error: Optional[JakaError], _now: float) -> None:
                if number == self._stop:
                    self._is_asking = False
                    self._is_left = error is None and not result
                    self.is_answered_on = error is None and bool(result)
            self._channel.request(Query.SERVO_MODE, now, replied)
        return self._is_left


def commanded_joints(state: RobotState) -> Vector:
    """Return the begin of a stream of joint frames, rad (6,).

    It is the commanded position where the arm is near to that, else the measured one.
    """
    start = state.joint_position_commanded
    if start is None or max([abs(a - b) for a, b in zip(start, state.joint_position)]) > MAX_JOINT_DEVIATION:
        return state.joint_position
    return start


def _entered() -> Procedure:
    yield Ask(SetServoMode(True))
    yield from _confirmed(True)


def left_servo_mode() -> Procedure:
    """Leave servo mode; raise MotionInterrupted when the controller does not confirm it within 2 s."""
    yield Ask(SetServoMode(False))
    yield from _confirmed(False)


def _confirmed(active: bool) -> Procedure:
    begun = yield Now()
    while bool((yield Ask(Query.SERVO_MODE))) is not active:
        if (yield Now()) - begun > _CONFIRM_TIMEOUT_S:
            raise MotionInterrupted(StopCause.TIMEOUT, "the controller did not %s servo mode"
                                    % ("enter" if active else "leave"))
        yield pause(_POLL_PERIOD_S)
