"""The motion behind a stream of single trajectory points, as MoveIt Servo publishes them on the topic ``command``.

A stream that a stop, a fault or a refusal has ended is closed: its sender may not know, and goes on. It is taken again
when it has paused, so that nothing resumes by itself.
"""
import logging
from typing import NamedTuple, Optional

from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.streaming import OnMode, commanded_joints
from jaka_ros_driver.client.core.trajectory import Goal, Trajectory, is_at
from jaka_ros_driver.commands import ServoJoint
from jaka_ros_driver.errors import InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.state import RobotState, Vector
from jaka_ros_driver.trajectory.follower import HOLD_S, PointFollower
from jaka_ros_driver.trajectory.path import JointState, Path
from jaka_ros_driver.trajectory.points import TrajectoryTolerances

_UNWATCHED = TrajectoryTolerances((None,) * JOINT_COUNT, (None,) * JOINT_COUNT, None)


class StreamPoint(NamedTuple):
    """One point: joints, rad (6,), and when the arm is to be there, monotonic time, s."""

    position: Vector
    due: float


class PointGate:
    """The gate of the stream of points: closed after its stream has been ended, open again after a pause."""

    def __init__(self) -> None:
        self._closed_by = ""
        self._came_at = -HOLD_S

    def pass_through(self, now: float) -> None:
        """Let a point pass.

        Raises:
            InvalidCommand: The gate is closed; the message has the reason.
        """
        paused, self._came_at = now - self._came_at, now
        if paused >= HOLD_S:
            self._closed_by = ""
        self.require_open()

    def require_open(self) -> None:
        """Check that nothing has closed the gate; errors as ``pass_through``."""
        if self._closed_by:
            raise InvalidCommand("refused: the stream was ended (%s); it is taken again after a pause of %g s" % (
                self._closed_by, HOLD_S))

    def close(self, reason: str) -> None:
        """Close the gate, for this reason; the first one counts."""
        self._closed_by = self._closed_by or reason


class PointStream(Trajectory):
    """The motion that follows points as they come, and ends at rest on the last one.

    It has no reserve: to be frames ahead it would have to follow each point so much later.
    """

    has_reserve = False

    def __init__(self, custody: Custody, model: ArmModel, gate: PointGate, first: StreamPoint, state: RobotState,
                 on_mode: OnMode) -> None:
        """Set up the motion.

        Args:
            custody: Of this motion.
            model: The arm model with the limits.
            gate: Closed when the motion is ended by anything but the end of its points.
            first: The first point.
            state: Before the motion.
            on_mode: Called with whether servo mode is on and, when it has ended, why.
        """
        at = commanded_joints(state)
        super().__init__(custody, model, Goal(None, _UNWATCHED), Path.resting(at), state, on_mode)
        self._model, self._gate = model, gate
        self._newest = first
        self._was_led = False
        self._clock = self._follower = PointFollower(at, model, state.received_at)

    @property
    def can_be_joined(self) -> bool:
        """False: a trajectory waits until the stream is braked."""
        return False

    def desired_at(self, at: float) -> JointState:
        """Raise InvalidCommand: nobody has planned where the arm is to be at another moment."""
        raise InvalidCommand("the arm follows a stream of points, which has no plan")

    def take(self, point: StreamPoint, now: float) -> None:
        """Follow the next point, from the next cycle on.

        Raises:
            InvalidCommand: The stream is being ended, a joint cannot follow, or the way to the point is not clear; the
                points before are kept.
        """
        if self.is_leaving:
            raise InvalidCommand("refused: the stream before this point is being ended; send it again")
        self._require_unbraked()
        if self._is_entered:
            trouble = self._look((self._end, point.position))
            if trouble:
                raise InvalidCommand("refused: on the way to the point %s" % trouble)
            led = self._follower.add(point.position, point.due, now)
            if led and not self._was_led:
                self._custody.actions.log(logging.WARNING, "the stream of points: %s" % led)
            self._was_led = bool(led)
            self._end = point.position
        else:
            self._newest = point

    def cancel(self, call: object) -> bool:
        """Brake, and end at rest; return False where a goal is meant, for a stream has none."""
        if call is not None or not super().cancel(None):
            return False
        self._gate.close("cancelled")
        return True

    # ---- life ----

    def prepare(self) -> None:
        """Prepare nothing: a point that comes later may change the next frame."""

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        if outcome is not None:
            self._gate.close(str(outcome))
        super().ended(outcome)
        self._custody.actions.log(logging.INFO, "the stream of points has ended%s" % (
            "" if outcome is None else ": %s" % outcome))

    def _entered(self, now: float) -> None:
        if not is_at(self._follower.position, self._state):
            self._custody.stop(MotionInterrupted(StopCause.FAULT, "the arm moved before its stream began"), now)
            return
        self._clock = self._follower = PointFollower(self._follower.position, self._model, now)
        self._is_guarded(self._follower.position)
        point = self._newest
        try:
            self.take(point._replace(due=max(point.due, now)), now)
        except InvalidCommand as error:
            self._custody.actions.log(logging.WARNING, "the stream of points is not followed: %s" % error)
            self.cancel(None)

    def _not_entered(self, error: JakaError) -> None:
        self._gate.close(str(error))
        self._custody.actions.log(logging.WARNING, "the stream of points is not followed: %s" % error)

    def _frame(self, now: float) -> ServoJoint:
        self._follower.now = now
        return super()._frame(now)
