"""Servo mode for a client that streams targets; the arm is held before they come, and when they stop."""
import logging
from typing import List, Optional, Tuple, Union

from jaka_ros_driver.client.core.actions import Token
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.motion_guard.pose_guard import PoseGuard
from jaka_ros_driver.client.core.servo_planner import JointServo, PoseServo
from jaka_ros_driver.client.core.servo_trace import ServoTrace
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.client.core.streaming import MAX_JOINT_DEVIATION, OnMode, ServoFrame, Streaming, commanded_joints
from jaka_ros_driver.commands import Pose, ServoJoint, ServoPose
from jaka_ros_driver.errors import InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.limits import SERVO_PERIOD_S
from jaka_ros_driver.state import RobotState, Vector

_TCP_SPEED_UNKNOWN = 1.0
"""Highest tool speed, m/s, for models without tcp_max_speed: below that of any full-size arm (``limits``)."""
_MAX_LINEAR_DEVIATION = 0.03
"""Largest distance, m, of the tool, or of a point beside it, from what was sent lately."""


class Servo(Streaming):
    """The motion that follows a client's targets; servo mode is left when the client leaves or falls silent."""

    owner = MotionOwner.SERVO

    def __init__(self, custody: Custody, model: ArmModel, call: Token, state: RobotState, on_mode: OnMode) -> None:
        """Set up the motion.

        Args:
            custody: Of this motion.
            model: The arm model with the limits.
            call: Answered when the controller confirms servo mode.
            state: Before the motion.
            on_mode: Called with whether servo mode is on and, when it has ended, why.
        """
        super().__init__(custody, state, on_mode)
        self._model = model
        self._calls: List[Token] = [call]
        self._stream: Union[JointServo, PoseServo, None] = None
        self._pose_guard: Optional[PoseGuard] = None
        self._last_target_at = 0.0
        self._was_led = False

    # ---- calls ----

    def leave(self, call: Token, reason: str) -> None:
        """Stop at the last target, then leave servo mode; ``call`` (None for nobody) is answered then."""
        if call is not None:
            self._calls.append(call)
        self.is_leaving = True
        if self._leave_reason is None:
            self._leave_reason = reason

    def join(self, call: Token) -> None:
        """Answer another caller of servo mode when it is on."""
        if self._leave_reason is not None:
            raise InvalidCommand("refused: servo mode is being left")
        if self._is_entered:
            self._custody.actions.answer(call)
        else:
            self._calls.append(call)

    def set_target(self, command: ServoFrame, now: float) -> str:
        """Follow this target from the next cycle on.

        Returns:
            Which joint is led elsewhere, because its target is too near to a limit, in words; "" for none.

        Raises:
            InvalidCommand: It is too far away, outside the limits, the motion guard brakes, or servo mode is not on;
                nothing moves.
        """
        if self._stream is None or self._leave_reason is not None:
            raise InvalidCommand("refused: servo mode is being %s" % (
                "entered" if self._leave_reason is None else "left: " + self._leave_reason))
        self._require_unbraked()
        led = ""
        if isinstance(command, ServoJoint):
            joints = self._stream if isinstance(self._stream, JointServo) else self._joint_stream_at_rest()
            led = joints.set_target(command.joint_position, command.relative)
            self._follow(joints)
        else:
            poses = self._stream if isinstance(self._stream, PoseServo) else self._pose_stream_at_rest()
            poses.set_target(command.target, command.relative)
            self._follow(poses)
        self._last_target_at = now
        if led and not self._was_led:
            self._custody.actions.log(logging.WARNING, "servo targets: %s" % led)
        self._was_led = bool(led)
        return led

    # ---- life ----

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        self._on_mode(False, str(outcome) if outcome is not None else self._leave_reason or "")
        self._custody.actions.answer_all(self._calls, outcome)

    def _entered(self, now: float) -> None:
        self._follow(self._joint_stream())
        self._last_target_at = now
        self._custody.actions.answer_all(self._calls)

    def _not_entered(self, error: JakaError) -> None:
        self._custody.actions.answer_all(self._calls, error)

    def _frame(self, now: float) -> ServoFrame:
        assert self._stream is not None
        timeout = self._custody.settings.servo_timeout
        if now - self._last_target_at > timeout:
            self.leave(None, "no servo target for %.1f s" % timeout)
        return self._stream.next_frame()

    def _sent_point(self) -> Vector:
        assert self._stream is not None
        return self._stream.point

    def _is_over(self) -> bool:
        if self._leave_reason is None or self._stream is None or not self._stream.is_at_rest:
            return False
        self._stream = None
        return True

    def _contradiction(self, state: RobotState) -> Optional[MotionInterrupted]:
        """Return a fault where the arm is far from everything that it was sent lately; None where it is not."""
        stream = self._stream
        point = None if stream is None else stream.measured_point(state)
        excess = 0.0 if point is None else self._trace.excess(point)
        is_joint = isinstance(stream, JointServo)
        if excess <= (MAX_JOINT_DEVIATION if is_joint else _MAX_LINEAR_DEVIATION):
            return None
        return MotionInterrupted(StopCause.FAULT, "the arm is %.3f %s from where it was sent" % (
            excess, "rad" if is_joint else "m"))

    # ---- streams ----

    def _joints_of(self, frame: ServoFrame) -> Tuple[Optional[Vector], str]:
        if isinstance(frame, ServoJoint) or self._pose_guard is None:
            return super()._joints_of(frame)
        return self._pose_guard.joints_of(frame.target)

    def _frame_at(self, joints: Vector) -> Tuple[ServoFrame, Vector]:
        if not isinstance(self._stream, PoseServo) or self._pose_guard is None:
            return super()._frame_at(joints)
        pose = self._pose_guard.pose_at(joints)
        return ServoPose(pose), PoseServo.point_at(pose)

    def _follow(self, stream: Union[JointServo, PoseServo]) -> None:
        if stream is self._stream:
            return
        self._stream, self._trace = stream, ServoTrace()
        if isinstance(stream, JointServo):
            self._is_guarded(stream.point)
        else:
            self.frame_guard = None if self._pose_guard is None else self._pose_guard.frames

    def _require_rest(self) -> None:
        """Refuse a change of the kind of stream unless the arm rests.

        Only there do commanded joints and measured pose agree.
        """
        if (self._stream is not None and not self._stream.is_at_rest) or (
                self._custody.rest_since(self._moved_at) < REST_TIME_S):
            raise InvalidCommand("refused: joint and pose targets can be changed over at rest only")

    def _joint_stream_at_rest(self) -> JointServo:
        self._require_rest()
        return self._joint_stream()

    def _joint_stream(self) -> JointServo:
        settings = self._custody.settings
        return JointServo(commanded_joints(self._state), self._model, settings.servo_max_joint_jump,
                          settings.servo_ahead, SERVO_PERIOD_S, self._look)

    def _pose_stream_at_rest(self) -> PoseServo:
        self._require_rest()
        state, settings = self._state, self._custody.settings
        if state.tcp_position is None or state.tcp_rpy is None:
            raise InvalidCommand("refused: the controller does not report the tool pose")
        self._pose_guard = guard = self._custody.motion_check.pose_guard(state, self._look)
        return PoseServo(Pose(state.tcp_position, state.tcp_rpy), self._model.tcp_max_speed or _TCP_SPEED_UNKNOWN,
                         settings.servo_max_linear_jump, settings.servo_max_angular_jump, settings.servo_ahead,
                         SERVO_PERIOD_S, *(() if guard is None else (guard.target_trouble,)))
