"""Servo mode: entered and confirmed, one frame every 8 ms, left when its client leaves or falls silent."""
from typing import Any, Callable, List, Optional, Union

from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import InterruptionWatch, Motion, MotionOwner
from jaka_ros_driver.client.core.procedures.procedure import Ask, Now, Procedure, Running, pause
from jaka_ros_driver.client.core.servo_planner import JointServo, PoseServo
from jaka_ros_driver.client.core.servo_trace import ServoTrace
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.commands import Command, Pose, Query, ServoJoint, ServoPose, SetServoMode
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.limits import SERVO_PERIOD_S
from jaka_ros_driver.state import RobotState

_CONFIRM_TIMEOUT_S = 2.0
_POLL_PERIOD_S = 0.02
_TCP_SPEED_UNKNOWN = 1.0
_MAX_JOINT_DEVIATION = 0.04
"""rad; more than the step of one cycle at 180 deg/s, behind which a controller ignores frames."""
_MAX_LINEAR_DEVIATION = 0.03
"""m, of the tool or of a point beside it."""
_NEVER = float("inf")

Frame = Union[ServoJoint, ServoPose]


class Servo(Motion):
    """Holds the arm where it is until targets come, follows them, and holds again when they stop.

    Late cycles are left out, never caught up in a burst. Whatever goes wrong stops the arm.

    Attributes:
        late_cycles: Cycles that came too late to be sent.
    """

    owner = MotionOwner.SERVO

    def __init__(self, custody: Custody, model: ArmModel, call: Any, state: RobotState,
                 on_mode: Callable[[bool, str], None]) -> None:
        """Prepare.

        Args:
            custody: Of this motion.
            model: Whose limits hold.
            call: Answered when the controller confirms servo mode.
            state: Before the motion.
            on_mode: Told whether servo mode is on and, when it has ended, why.
        """
        self._custody = custody
        self._model = model
        self._calls: List[Any] = [call]
        self._watch = InterruptionWatch(state)
        self._state = state
        self._on_mode = on_mode
        self._stream: Union[JointServo, PoseServo, None] = None
        self._trace = ServoTrace()
        self._next_frame = _NEVER
        self._last_target_at = 0.0
        self._leave_reason: Optional[str] = None
        self._confirming: Optional[Running] = None
        self._is_entered = False
        self._left_at: Optional[float] = None
        self.late_cycles = 0

    # ---- life ----

    def begin(self, now: float) -> None:
        self._confirming = Running(_entered(), self._custody.channel, self._enter_ended)
        self._confirming.begin(now)

    def due(self) -> float:
        return min(self._next_frame, self._confirming.deadline if self._confirming else _NEVER)

    def leave(self, call: Any, reason: str) -> None:
        """Come to rest at the last target, then leave servo mode; ``call`` (None for nobody) is answered then."""
        if call is not None:
            self._calls.append(call)
        self.is_leaving = True
        if self._leave_reason is None:
            self._leave_reason = reason

    def join(self, call: Any) -> None:
        """Somebody else wants to be in servo mode."""
        if self._leave_reason is not None:
            raise InvalidCommand("refused: servo mode is being left")
        if self._is_entered:
            self._custody.actions.answer(call)
        else:
            self._calls.append(call)

    def set_target(self, command: Frame, now: float) -> None:
        """Follow this target from the next cycle on.

        Raises:
            InvalidCommand: It is too far away, outside the limits, or servo mode is not on; nothing moves.
        """
        if self._stream is None or self._leave_reason is not None:
            raise InvalidCommand("refused: servo mode is being %s" % (
                "entered" if self._leave_reason is None else "left: " + self._leave_reason))
        if isinstance(command, ServoJoint):
            joints = self._stream if isinstance(self._stream, JointServo) else self._joint_stream_at_rest()
            joints.set_target(command.joint_position, command.relative)
            self._follow(joints)
        else:
            poses = self._stream if isinstance(self._stream, PoseServo) else self._pose_stream_at_rest()
            poses.set_target(command.target, command.relative)
            self._follow(poses)
        self._last_target_at = now

    def observe(self, state: RobotState, now: float) -> None:
        self._state = state
        cause = self._watch.cause(state)
        if cause is None and self._stream is not None:
            deviation = self._deviation(self._stream, state)
            cause = MotionInterrupted(StopCause.FAULT, deviation) if deviation else None
        if cause is not None:
            self._custody.stop(cause, now)
        elif self._left_at is not None and self._custody.stillness.duration(self._left_at) >= self.rest_time:
            self._custody.finish(now)

    def tick(self, now: float) -> None:
        if self._confirming is not None:
            self._confirming.tick(now)
        if self._stream is None or now < self._next_frame:
            return
        if self._leave_reason is not None and self._stream.is_at_rest:
            self._next_frame = _NEVER
            self._stream = None
            self._confirming = Running(left_servo_mode(), self._custody.channel, self._leave_ended)
            self._confirming.begin(now)
            return
        self._send_frame(self._stream, now)
        timeout = self._custody.settings.servo_timeout
        if now - self._last_target_at > timeout:
            self.leave(None, "no servo target for %.1f s" % timeout)

    def halts(self) -> List[Command]:
        self._next_frame = _NEVER
        self._stream = None
        self._confirming = None
        return [SetServoMode(False)]

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        self._on_mode(False, str(outcome) if outcome is not None else self._leave_reason or "")
        self._custody.actions.answer_all(self._calls, outcome)

    # ---- inside ----

    def _enter_ended(self, _result: Any, error: Optional[JakaError], now: float) -> None:
        if self._custody.motion is not self or self._custody.is_ending:
            return
        self._confirming = None
        if error is None:
            self._is_entered = True
            self._stream = self._joint_stream()
            self._last_target_at = self._next_frame = now
            self._on_mode(True, "")
            self._custody.actions.answer_all(self._calls)
            return
        if isinstance(error, MotionInterrupted):
            self._custody.stop(error, now)
            return
        self._custody.actions.answer_all(self._calls, error)
        if isinstance(error, CommandRejected) and error.command == "servo_move":
            self._custody.settle(now)
        else:
            self._custody.stop(MotionInterrupted(StopCause.FAULT, str(error)), now)

    def _leave_ended(self, _result: Any, error: Optional[JakaError], now: float) -> None:
        if self._custody.motion is not self or self._custody.is_ending:
            return
        self._confirming = None
        if error is None:
            self._left_at = now
            self._on_mode(False, self._leave_reason or "")
        else:
            self._custody.stop(MotionInterrupted(StopCause.FAULT, "servo mode was not left: %s" % error), now)

    def _send_frame(self, stream: Union[JointServo, PoseServo], now: float) -> None:
        frame = stream.next_frame()
        self._trace.sent(stream.point, now)
        self._next_frame += SERVO_PERIOD_S
        late = now - self._next_frame
        if late > 0.0:
            skipped = 1 + int(late / SERVO_PERIOD_S)
            self.late_cycles += skipped
            self._next_frame += SERVO_PERIOD_S * skipped
        self._custody.channel.request(frame, now, self._frame_replied)

    def _frame_replied(self, _result: Any, error: Optional[JakaError], now: float) -> None:
        if error is not None and self._custody.motion is self and self._stream is not None:
            self._custody.stop(MotionInterrupted(StopCause.FAULT, "servo stream ended: %s" % error), now)

    def _deviation(self, stream: Union[JointServo, PoseServo], state: RobotState) -> str:
        """How far the arm is from everything that it was sent lately, in words; "" where it is near something."""
        point = stream.measured_point(state)
        excess = 0.0 if point is None else self._trace.excess(point)
        is_joint = isinstance(stream, JointServo)
        if excess <= (_MAX_JOINT_DEVIATION if is_joint else _MAX_LINEAR_DEVIATION):
            return ""
        return "the arm is %.3f %s from where it was sent" % (excess, "rad" if is_joint else "m")

    def _follow(self, stream: Union[JointServo, PoseServo]) -> None:
        if stream is not self._stream:
            self._stream, self._trace = stream, ServoTrace()

    def _require_rest(self) -> None:
        """A stream of the other kind begins at rest, where the arm is measured: only there do the two agree."""
        if (self._stream is not None and not self._stream.is_at_rest) or (
                self._custody.stillness.duration() < REST_TIME_S):
            raise InvalidCommand("refused: joint and pose targets can be changed over at rest only")

    def _joint_stream_at_rest(self) -> JointServo:
        self._require_rest()
        return self._joint_stream()

    def _joint_stream(self) -> JointServo:
        state, settings = self._state, self._custody.settings
        start = state.joint_position_commanded
        if start is None or max([abs(a - b) for a, b in zip(start, state.joint_position)]) > _MAX_JOINT_DEVIATION:
            start = state.joint_position
        return JointServo(start, self._model, settings.servo_max_joint_jump, settings.servo_ahead, SERVO_PERIOD_S)

    def _pose_stream_at_rest(self) -> PoseServo:
        self._require_rest()
        state, settings = self._state, self._custody.settings
        if state.tcp_position is None or state.tcp_rpy is None:
            raise InvalidCommand("refused: the controller does not report the tool pose")
        return PoseServo(Pose(state.tcp_position, state.tcp_rpy), self._model.tcp_max_speed or _TCP_SPEED_UNKNOWN,
                         settings.servo_max_linear_jump, settings.servo_max_angular_jump, settings.servo_ahead,
                         SERVO_PERIOD_S)


def _entered() -> Procedure:
    yield Ask(SetServoMode(True))
    yield from _confirmed(True)


def left_servo_mode() -> Procedure:
    """Leave servo mode; MotionInterrupted when the controller does not confirm it within 2 s."""
    yield Ask(SetServoMode(False))
    yield from _confirmed(False)


def _confirmed(active: bool) -> Procedure:
    begun = yield Now()
    while bool((yield Ask(Query.SERVO_MODE))) is not active:
        if (yield Now()) - begun > _CONFIRM_TIMEOUT_S:
            raise MotionInterrupted(StopCause.TIMEOUT, "the controller did not %s servo mode"
                                    % ("enter" if active else "leave"))
        yield pause(_POLL_PERIOD_S)
