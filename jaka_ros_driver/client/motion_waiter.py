"""Follows one motion that the controller accepted, until it is completed or known to be interrupted.

"Accepted" is the controller's reply, "completed" is seen in the status feed (controller protocol 2 and 7).
"""
import math
import threading
from typing import Callable, Optional

from jaka_ros_driver.commands import JointMove, LinearMove, Pose
from jaka_ros_driver.errors import MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between
from jaka_ros_driver.state import RobotState

START_WINDOW = 1.0
"""A motion that is accepted but not seen to begin within this time has not happened, s."""
_SETTLE_TIME = 0.3
_JOINT_TOLERANCE = 0.01
_POSITION_TOLERANCE = 0.002
_ANGLE_TOLERANCE = 0.02


def standing_cause(state: RobotState) -> Optional[MotionInterrupted]:
    """Why the arm cannot move in this state, None when nothing stands against it."""
    if state.emergency_stop:
        return MotionInterrupted(StopCause.EMERGENCY_STOP)
    if state.protective_stop:
        return MotionInterrupted(StopCause.PROTECTIVE_STOP, _event(state))
    if not state.is_powered:
        return MotionInterrupted(StopCause.NOT_ENABLED, "the drives have no power")
    if not state.is_enabled:
        return MotionInterrupted(StopCause.NOT_ENABLED, _event(state))
    return None


def _event(state: RobotState) -> str:
    if not state.error_code:
        return ""
    return ("event 0x%X %s" % (state.error_code, state.error_message)).rstrip()


class MotionWaiter:
    """One motion from its acceptance to its end; fed with every state, asked from any thread.

    Moves too short to be seen, and moves to where the arm already is, count as completed when the arm is in position
    at the target.
    """

    def __init__(self, command: object, timeout: float, accepted_at: float, state: RobotState,
                 on_ended: Callable[["MotionWaiter"], None]) -> None:
        """Begin to follow.

        Args:
            command: A JointMove or LinearMove has a target to be reached; anything else ends when the arm rests.
            timeout: The motion is over time so long after its acceptance, s.
            accepted_at: Monotonic time at which the controller took it, s.
            state: Of before: events that stand in it are not this motion's.
            on_ended: Called once, in the thread that learns of the end.
        """
        self._command = command
        self._timeout = timeout
        self._accepted_at = accepted_at
        self._known_event = state.error_code
        self._on_ended = on_ended
        self._lock = threading.Lock()
        self._has_ended = False
        self._told = threading.Event()
        self._outcome: Optional[MotionInterrupted] = None
        self._has_started = False
        self._rest_since: Optional[float] = None

    @property
    def is_over_time(self) -> bool:
        """It ended because it took too long; the arm may still move."""
        return self._outcome is not None and self._outcome.cause is StopCause.TIMEOUT

    def observe(self, state: RobotState) -> None:
        """Take one state of the feed into account."""
        accepted_at = self._accepted_at
        if self._has_ended or state.received_at <= accepted_at:
            return
        cause = standing_cause(state)
        if cause is None and state.has_fault and state.error_code != self._known_event:
            cause = MotionInterrupted(StopCause.FAULT, _event(state))
        if cause is None and state.received_at - accepted_at > self._timeout:
            cause = MotionInterrupted(StopCause.TIMEOUT, "not completed after %.0f s" % self._timeout)
        if cause is not None:
            self.end(cause)
        elif state.is_in_position:
            self._observe_rest(state, accepted_at)
        else:
            self._has_started = True
            self._rest_since = None

    def end(self, outcome: Optional[MotionInterrupted]) -> None:
        """The motion is over: completed (None), or interrupted. Only the first word counts.

        Who waits for it is told last, so that the next motion finds the arm free.
        """
        with self._lock:
            if self._has_ended:
                return
            self._outcome = outcome
            self._has_ended = True
        try:
            self._on_ended(self)
        finally:
            self._told.set()

    def wait(self) -> None:
        """Block until the motion is completed.

        Raises:
            MotionInterrupted: It ended otherwise.
        """
        self._told.wait()
        if self._outcome is not None:
            raise self._outcome

    def _observe_rest(self, state: RobotState, accepted_at: float) -> None:
        if self._rest_since is None:
            self._rest_since = state.received_at
        remaining = remaining_distance(self._command, state)
        if remaining == "":
            self.end(None)
        elif self._has_started:
            if remaining is None:
                self.end(None)
            elif state.received_at - self._rest_since > _SETTLE_TIME:
                self.end(MotionInterrupted(StopCause.STOPPED, "the arm came to rest %s from the target" % remaining))
        elif state.received_at - accepted_at > START_WINDOW:
            self.end(None if remaining is None else MotionInterrupted(
                StopCause.FAULT, "accepted, but the arm did not move; it is %s from the target" % remaining))


def remaining_distance(command: object, state: RobotState) -> Optional[str]:
    """How far the arm is from the command's target, in words; "" when it is there, None when that cannot be told."""
    if isinstance(command, JointMove):
        away = max(abs(a - b) for a, b in zip(command.joint_position, state.joint_position))
        return "%.4f rad" % away if away > _JOINT_TOLERANCE else ""
    if isinstance(command, LinearMove) and state.tcp_position is not None and state.tcp_rpy is not None:
        return _pose_distance(command.target, Pose(state.tcp_position, state.tcp_rpy), command.tolerance)
    return None


def _pose_distance(target: Pose, actual: Pose, tolerance: float) -> str:
    away = math.sqrt(sum((a - b) ** 2 for a, b in zip(target.position, actual.position)))
    angle = rotation_angle_between(matrix_from_rpy(target.rpy), matrix_from_rpy(actual.rpy))
    if away > max(_POSITION_TOLERANCE, tolerance):
        return "%.4f m" % away
    return "%.4f rad" % angle if angle > _ANGLE_TOLERANCE else ""
