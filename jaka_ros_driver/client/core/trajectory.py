"""The motion along a joint trajectory: streamed on its audited path, joined by the next one, ended at rest on its last
point.
"""
from typing import List, NamedTuple, Optional, Union

from jaka_ros_driver.clearance.workspace import Workspace
from jaka_ros_driver.client.core.actions import Token
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.servo_trace import ServoTrace
from jaka_ros_driver.client.core.stillness import MOVEMENT, REST_TIME_S
from jaka_ros_driver.client.core.streaming import MAX_JOINT_DEVIATION, OnMode, Streaming, commanded_joints
from jaka_ros_driver.commands import ServoJoint
from jaka_ros_driver.errors import (
    GoalToleranceViolated,
    InvalidCommand,
    JakaError,
    MotionInterrupted,
    PathToleranceViolated,
    StopCause,
)
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.limits import SERVO_PERIOD_S
from jaka_ros_driver.state import RobotState, Vector
from jaka_ros_driver.trajectory.build import PathStart
from jaka_ros_driver.trajectory.clock import PathClock
from jaka_ros_driver.trajectory.clock_trace import ClockTrace
from jaka_ros_driver.trajectory.follower import PointFollower
from jaka_ros_driver.trajectory.path import JointState, Path
from jaka_ros_driver.trajectory.points import TrajectoryTolerances

_LAG_S = 0.2
"""Time, s, of sent positions with which a client's path tolerance is compared.

A controller's queue and the feed take some of it.
"""
_LONGEST_LAG_S = 0.5
"""Longest lag, s, with the filters of a controller.

An arm that is near nothing it was sent since is stopped.
"""
_SAME_START = 1e-4
"""Largest distance, rad, of an arm from the begin of its path that has not moved since."""
_BRAKE_TIME_S = 1.0
"""Longest time, s, from the end of the stream's motion until the arm must be seen at rest."""
_SEEN_LATE_S = 0.3
"""Longest delay, s, with which a working feed shows rest."""
_CATCH_UP = 0.05
"""Share by which the clock runs faster while it makes up for cycles that were late."""
_LONGEST_CATCH_UP_S = 0.1
"""Longest delay, s, that the clock makes up for: at 5 % that takes it 2 s."""
_NOTHING = (0.0,) * JOINT_COUNT


class StartChanged(InvalidCommand):
    """The error that the arm has left the place where the path was built to begin: it must be built anew."""


class TrajectoryStart(NamedTuple):
    """The place where a path may begin.

    Attributes:
        begin: Position and motion there.
        running: The trajectory that is joined; None where the arm rests.
        path: The path that it follows.
        time: On that path, where it is joined, s.
        workspace: What the motion guard keeps, and the path is looked at with.
    """

    begin: PathStart
    running: Optional["Trajectory"] = None
    path: Optional[Path] = None
    time: float = 0.0
    workspace: Optional[Workspace] = None


class Goal(NamedTuple):
    """The tolerances that a client has asked for, and the call that is answered."""

    call: Token
    tolerances: TrajectoryTolerances


class TrajectoryProgress(NamedTuple):
    """The progress of a trajectory.

    Attributes:
        call: Of its goal.
        time: On its path, from the time of its points, s.
        desired: The wanted state of the joints now.
    """

    call: Token
    time: float
    desired: JointState


class Trajectory(Streaming):
    """A motion along one path, and on to those that replace it. Any contradiction stops the arm; nothing resumes.

    Attributes:
        is_paused: It brakes on its path, and stays there until this is False again.
    """

    owner = MotionOwner.TRAJECTORY
    has_reserve = True

    def __init__(self, custody: Custody, model: ArmModel, goal: Goal, path: Path, state: RobotState,
                 on_mode: OnMode) -> None:
        """Set up the motion; the goal is answered with ``Path.led`` when the arm rests at the path's end, and servo
        mode is left.

        Args:
            custody: Of this motion.
            model: The arm model with the limits.
            goal: The goal that the path serves.
            path: Audited; begins where the arm is commanded.
            state: Before the motion.
            on_mode: Called with whether servo mode is on and, when it has ended, why.
        """
        super().__init__(custody, state, on_mode)
        self._goal = goal
        self._path_clock = PathClock(path, model)
        self._clock: Union[PathClock, PointFollower] = self._path_clock
        self._end = path.at(path.end).position
        self._trace = ServoTrace(_LONGEST_LAG_S + self._lead, 0.1 * _LONGEST_LAG_S)
        self._near = ServoTrace(_LAG_S + self._lead, 0.1 * _LAG_S)
        self._built_at = state.received_at
        self._past = ClockTrace(self._built_at, self._clock.time)
        self._lag = 0.0
        self._rests_since: Optional[float] = None
        self._is_begun = False
        self._is_cancelled = False
        self._held_since: Optional[float] = None
        self.is_paused = False

    # ---- calls ----

    @property
    def can_be_joined(self) -> bool:
        """True where another trajectory can take over from here, also while this one is braked by a cancel."""
        return not self.is_leaving or (self._is_cancelled and self._rests_since is None and not self._custody.is_ending)

    @property
    def progress(self) -> TrajectoryProgress:
        """The progress of the trajectory: of the frame that was sent last; with a reserve, of the one that is due."""
        moment = self._past.at(self._observed_at, self._path_clock.rate) if self._lead > 0.0 else None
        if moment is None:
            return TrajectoryProgress(self._goal.call, self._clock.time, self._clock.state())
        return TrajectoryProgress(self._goal.call, moment.time, self._path_clock.state_at(moment.time, moment.rate))

    def desired_at(self, at: float) -> JointState:
        """Return where the joints are wanted at this moment, s; a later one assumes that the clock keeps its rate.

        Raises:
            InvalidCommand: The arm was not on the running path then, it is too long ago to be known, or a stop ends it.
        """
        if self._custody.is_ending:
            raise InvalidCommand("the arm is being stopped; where it comes to rest is not planned")
        moment = self._past.at(at, self._clock.rate if self._is_begun else self._wanted)
        if moment is None:
            raise InvalidCommand("it is %.3f s before the running trajectory was begun or joined"
                                 % (self._past.since - at))
        return self._path_clock.state_at(moment.time, moment.rate)

    @property
    def is_held(self) -> bool:
        """True while it is paused, its stream has come to rest, and the controller has no frame of a motion left.

        A stall on the link leaves a queue of frames at the controller, which then lags behind the stream for good: an
        arm that rests has not begun yet, unless it is where the stream holds it.
        """
        if not self.is_paused or self._held_since is None:
            return False
        away = max([abs(a - b) for a, b in zip(self._state.joint_position, self._clock.position)])
        return away <= MOVEMENT or self._observed_at - self._held_since > _LONGEST_LAG_S

    def start_after(self, lead: float) -> TrajectoryStart:
        """Return the place where another trajectory can join this one, ``lead`` s ahead on the path."""
        clock = self._path_clock
        time = clock.time + lead
        return TrajectoryStart(PathStart(clock.path.at(time), False), self, clock.path, time)

    def replace(self, goal: Goal, path: Path, start: TrajectoryStart) -> None:
        """Change to another path where it starts on the present one; the running goal is answered at once.

        Raises:
            StartChanged: The arm has come further than that, or is on another path.
        """
        clock = self._path_clock
        if not self.can_be_joined or clock.path is not start.path or clock.time > start.time:
            raise StartChanged("the arm has passed the point where the new trajectory was to join; send it again")
        clock.join(start.time, path)
        before, self._goal = self._goal, goal
        self._end = path.at(path.end).position
        cause = StopCause.CANCELLED if self._is_cancelled else StopCause.REPLACED
        self._is_cancelled = self.is_leaving = False
        self._custody.actions.answer(before.call, None, MotionInterrupted(cause))

    def cancel(self, call: Token) -> bool:
        """Brake on the path, and end at rest; return False where that goal does not run.

        call: Whose goal, None for any.
        """
        if self._leave_reason is not None or (call is not None and call is not self._goal.call):
            return False
        self._is_cancelled = self.is_leaving = True
        return True

    # ---- life ----

    def begin(self, now: float) -> None:
        self._built_at = now
        self._past = ClockTrace(now, self._clock.time)
        super().begin(now)

    def prepare(self) -> None:
        if self._is_begun and self.is_streaming:
            self._custody.channel.prepare(ServoJoint(self._path_clock.look_ahead(self._wanted)))

    def observe(self, state: RobotState, now: float) -> None:
        super().observe(state, now)
        if self._rests_since is not None and self._leave_reason is None and not self._custody.is_ending:
            self._look_for_the_end(state, now)

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        if outcome is None and self._is_cancelled:
            outcome = MotionInterrupted(StopCause.CANCELLED)
        elif outcome is None and self._far_from_goal(self._state):
            outcome = MotionInterrupted(StopCause.STOPPED, "the arm was moved away when servo mode had been left")
        self._on_mode(False, str(outcome) if outcome is not None else "the trajectory is completed")
        self._answer(outcome)

    def _entered(self, now: float) -> None:
        if not is_at(self._clock.position, self._state):
            self._custody.stop(MotionInterrupted(StopCause.FAULT, "the arm moved before its trajectory began"), now)
        else:  # entering servo mode has taken some of the time until a trajectory that starts later
            self._path_clock.pass_rest(self._next_frame - self._built_at)

    def _not_entered(self, error: JakaError) -> None:
        self._answer(error)

    def _frame(self, now: float) -> ServoJoint:
        clock, scale = self._clock, self._scale
        if not self._is_begun:  # a stream begins where the arm is (docs/controller-protocol.md section 5.6.5)
            self._is_begun = True
            self._past.note(self._next_frame, clock.time)
            return ServoJoint(clock.position)
        wanted, path = self._wanted, self._path_clock.path
        frame = ServoJoint(clock.step(wanted))
        if self._path_clock.path is path:
            self._past.note(self._next_frame, clock.time)
        else:
            self._past = ClockTrace(self._next_frame, clock.time)
        if self._lag > 0.0:
            self._lag = 0.0 if wanted == 0.0 else self._lag - max(0.0, clock.rate - scale) * SERVO_PERIOD_S
        self._near.sent(clock.position, now)
        if not (self.is_paused and clock.is_still and clock.rate == 0.0):
            self._held_since = None
        elif self._held_since is None:
            self._held_since = now + self._lead
        is_over = clock.is_still and (clock.is_at_end or (self._is_cancelled and clock.rate == 0.0))
        if is_over and self._rests_since is None:
            self._rests_since = now + self._lead
            self.is_leaving = True
        return frame

    def _sent_point(self) -> Vector:
        return self._clock.position

    def _is_over(self) -> bool:
        return self._leave_reason is not None

    def _skipped(self, cycles: int) -> None:
        self._lag = min(self._lag + cycles * SERVO_PERIOD_S * self._clock.rate, _LONGEST_CATCH_UP_S)

    def _contradiction(self, state: RobotState) -> Optional[MotionInterrupted]:
        excess = self._trace.excess(state.joint_position)
        if excess > MAX_JOINT_DEVIATION:
            return PathToleranceViolated("the arm is %.3f rad from where it was sent" % excess)
        for joint, (away, tolerance) in enumerate(zip(self._near.excesses(state.joint_position),
                                                      self._goal.tolerances.path), 1):
            if tolerance is not None and away > tolerance:
                return PathToleranceViolated("joint %d is %.4f rad from its trajectory; allowed: %.4f rad" % (
                    joint, away, tolerance))
        return None

    # ---- inside ----

    @property
    def _scale(self) -> float:
        rate = self._state.rapid_rate
        return 1.0 if rate is None else min(max(rate, 0.0), 1.0)

    @property
    def _wanted(self) -> float:
        """The rate at which the clock is to run."""
        wanted = 0.0 if self.is_paused or self._is_cancelled else self._scale
        return wanted * (1.0 + _CATCH_UP) if self._lag > 0.0 else wanted

    def _look_for_the_end(self, state: RobotState, now: float) -> None:
        """End the motion when the arm rests near enough to the last point; stop it where it does not in time."""
        assert self._rests_since is not None
        is_still = self._custody.rest_since(self._rests_since) >= REST_TIME_S
        waited = now - self._rests_since
        if self._is_cancelled:
            if is_still:
                self._leave_reason = "cancelled"
            elif waited > _BRAKE_TIME_S:
                self._custody.stop(MotionInterrupted(StopCause.CANCELLED), now)
            return
        tolerances = self._goal.tolerances
        far = self._far_from_goal(state)
        if is_still and not far:
            self._leave_reason = "the trajectory is completed"
        elif tolerances.goal_time is not None and waited > tolerances.goal_time + _SEEN_LATE_S and (
                far or self._custody.stillness.duration(self._rests_since) < REST_TIME_S):
            self._custody.stop(GoalToleranceViolated("%.3f s after the end of the trajectory %s" % (
                waited, "; ".join(far) or "the arm is not at rest")), now)

    def _far_from_goal(self, state: RobotState) -> List[str]:
        return ["joint %d is %.4f rad from its last point, allowed: %.4f rad" % (joint, abs(at - end), tolerance)
                for joint, (at, end, tolerance) in enumerate(
                    zip(state.joint_position, self._end, self._goal.tolerances.goal), 1)
                if tolerance is not None and abs(at - end) > tolerance]

    def _answer(self, error: Optional[JakaError]) -> None:
        goal, self._goal = self._goal, self._goal._replace(call=None)
        self._custody.actions.answer(goal.call, self._path_clock.path.led, error)


def start_at_rest(state: RobotState) -> TrajectoryStart:
    """Return the begin of a path for an arm that rests: its commanded position."""
    return TrajectoryStart(PathStart(JointState(commanded_joints(state), _NOTHING, _NOTHING), True))


def require_start(path: Path, state: RobotState) -> None:
    """Check that the arm is where the path begins.

    Raises:
        StartChanged: It is not.
    """
    if not is_at(path.at(path.begin).position, state):
        raise StartChanged("the arm has moved since its trajectory was audited; send it again")


def is_at(joints: Vector, state: RobotState) -> bool:
    """Return whether the controller commands the arm to these joints, rad (6,)."""
    return max([abs(a - b) for a, b in zip(commanded_joints(state), joints)]) <= _SAME_START
