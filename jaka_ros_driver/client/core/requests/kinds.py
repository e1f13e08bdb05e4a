"""The kinds of requests for the arm: of each what it needs, which running motion takes it in, and how it begins.

``ArmCore`` makes them and says of each what its caller is answered.
"""
from typing import Callable, NamedTuple, Optional, Sequence, Type, TypeVar, cast

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Actions, Token
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.jog import JogMotion
from jaka_ros_driver.client.core.motion import ArmMotion, MotionOwner
from jaka_ros_driver.client.core.motion_guard.feed_watch import way_ahead
from jaka_ros_driver.client.core.motion_guard.motion_check import StartPlace
from jaka_ros_driver.client.core.move import Move
from jaka_ros_driver.client.core.planned.path_audit import audit
from jaka_ros_driver.client.core.planned.path_move import PathMove, PathProgress
from jaka_ros_driver.client.core.planned.program import ProgramMotion, require_program_state
from jaka_ros_driver.client.core.point_stream import PointGate, PointStream, StreamPoint
from jaka_ros_driver.client.core.procedures.steps import Procedure, in_slices
from jaka_ros_driver.client.core.requests.admission import Admission, ArmRequest
from jaka_ros_driver.client.core.servo import Servo
from jaka_ros_driver.client.core.stillness import MOVEMENT, REST_TIME_S
from jaka_ros_driver.client.core.stops import CarryOut, Stops
from jaka_ros_driver.client.core.streaming import OnMode, commanded_joints
from jaka_ros_driver.client.core.trajectory import (
    Goal,
    StartChanged,
    Trajectory,
    TrajectoryStart,
    require_start,
    start_at_rest,
)
from jaka_ros_driver.errors import InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.state import ProgramState, RobotState
from jaka_ros_driver.trajectory.follower import require_within
from jaka_ros_driver.trajectory.path import Path
from jaka_ros_driver.trajectory.points import TrajectoryTolerances
from jaka_ros_driver.trajectory.segments import SegmentPath

M = TypeVar("M", bound=ArmMotion)


class ArmParts(NamedTuple):
    """The parts of one arm's core that requests use.

    Attributes:
        model: The arm model with the limits.
        actions: Where answers go.
        custody: Who moves the arm.
        admission: Who may move it next.
        stops: How many stops were asked for.
        carry_out: Runs a procedure, and passes its end on.
        on_servo_mode: Called with whether servo mode is on and, when it has ended, why.
    """

    model: ArmModel
    actions: Actions
    custody: Custody
    admission: Admission
    stops: Stops
    carry_out: CarryOut
    on_servo_mode: OnMode

    def running(self, kind: Type[M]) -> Optional[M]:
        """Return the motion in custody where it is of this kind and is not being stopped, else None."""
        motion = self.custody.motion
        return motion if isinstance(motion, kind) and not self.custody.is_ending else None

    def audited(self, command: c.Command) -> c.Command:
        """Return the command, if it keeps the model's limits.

        Raises:
            InvalidCommand: It does not.
        """
        limits.check(command, self.model)
        return command


class _MotionRequest(ArmRequest):
    """A request for a motion, which needs links, drives and a fresh state."""

    def __init__(self, call: Token, arm: ArmParts, asked_at: float) -> None:
        super().__init__(call, arm.admission, asked_at)
        self._arm = arm

    def check(self, now: float) -> None:
        self._state(now)

    def _state(self, now: float) -> RobotState:
        """Return the state of an arm that can be moved now; errors as ``Admission.require_ready_to_move``."""
        return self._arm.admission.require_ready_to_move(self.owner, now)


class MoveRequest(_MotionRequest):
    """The request for a move to one target, queued behind a running move where its caller does not wait for the end."""

    owner = MotionOwner.MOVE

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, command: c.MoveCommand, wait: bool,
                 end: Token) -> None:
        super().__init__(call, arm, asked_at)
        self._command, self._wait, self._end = command, wait, end
        self._stops = arm.stops.count
        self._looked_from: Optional[StartPlace] = None
        self._end_place = StartPlace.unknown()

    def audit(self) -> None:
        limits.check(self._command, self._arm.model)

    def join(self, now: float) -> bool:
        running = self._arm.running(Move)
        if self._wait or running is None:
            return False
        if self._arm.admission.busy_with is not None:  # another move is looked at: the queue keeps their order
            self._arm.admission.wait(self, now)
        elif self._is_looked_at(running.place, now):
            running.add(self._command, self.call, now, self._end_place, self._end)
        return True

    def begin(self, now: float) -> None:
        custody, state = self._arm.custody, self._state(now)
        if self._is_looked_at(custody.motion_check.place_of(state), now):
            custody.begin(Move(custody, self._command, self.call, self._wait, state, self._end_place, self._end), now)

    def _is_looked_at(self, start: StartPlace, now: float) -> bool:
        """Return whether the way from there was looked at; else look, and enter again behind that."""
        if self._looked_from is not None and self._looked_from.is_near(start):
            return True
        self._looked_from, self._arm.admission.busy_with = start, MotionOwner.LOOK
        self._arm.carry_out(in_slices(self._arm.custody.motion_check.after_move(self._command, start),
                                      lambda: self._arm.stops.require_none_since(self._stops)), self._looked, now)
        return False

    def _looked(self, place: object, error: Optional[JakaError], now: float) -> None:
        self._arm.admission.busy_with = None
        try:
            if error is not None:
                raise error
            self._end_place = cast(StartPlace, place)
            self.enter(now)
        except JakaError as refusal:
            self._arm.actions.answer(self.call, None, refusal)
        self._looked_from = None  # where it waits now, it is looked at again
        self._arm.admission.retry(now)


class PathRequest(_MotionRequest):
    """The request for a path, which is audited as a whole on the arm at rest; nothing moves the arm meanwhile."""

    owner = MotionOwner.PATH

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, commands: Sequence[c.PathCommand],
                 is_cancelled: Callable[[], bool], on_begun: Callable[[], None]) -> None:
        super().__init__(call, arm, asked_at)
        self._commands, self._is_cancelled, self._on_begun = commands, is_cancelled, on_begun
        self._stops = arm.stops.count

    def check(self, now: float) -> None:
        self._require_wanted()
        super().check(now)

    def begin(self, now: float) -> None:
        self._arm.admission.busy_with = MotionOwner.AUDIT
        self._arm.carry_out(audit(self._commands, self._state(now), self._arm.audited, self._require_wanted,
                                  self._arm.custody.motion_check),
                            self._audited, now)

    def _require_wanted(self) -> None:
        """Raise MotionInterrupted where the path was cancelled, or a stop came since it was asked for."""
        if self._is_cancelled():
            raise MotionInterrupted(StopCause.CANCELLED, "nothing was sent")
        self._arm.stops.require_none_since(self._stops)

    def _audited(self, path: object, error: Optional[JakaError], now: float) -> None:
        self._arm.admission.busy_with = None
        try:
            if error is not None:
                raise error
            self._require_wanted()
            self._begin_path(cast(SegmentPath, path), now)
        except JakaError as refusal:
            self._arm.actions.answer(self.call, None, refusal)
        self._arm.admission.retry(now)

    def _begin_path(self, path: SegmentPath, now: float) -> None:
        state, custody = self._state(now), self._arm.custody
        if custody.stillness.duration() < REST_TIME_S or max([abs(a - b) for a, b in zip(
                state.joint_position, path.start.joints)]) > MOVEMENT:
            raise InvalidCommand("refused: the arm has moved since its path was audited")
        if all(segment.is_nowhere for segment in path.segments):
            count = len(path.segments)
            self._arm.actions.answer(self.call, PathProgress(self.call, count, count, 1.0))
        else:
            custody.begin(PathMove(custody, path, self.call, self._on_begun, state, now), now)


class ProgramRequest(_MotionRequest):
    """The request that the controller's program runs, from its begin or from where it is paused."""

    owner = MotionOwner.PROGRAM

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, command: c.Command, wanted: ProgramState,
                 end: Token) -> None:
        """Set up the request.

        wanted: The state in which the program must be found on a free arm.
        """
        super().__init__(call, arm, asked_at)
        self._command, self._wanted, self._end = command, wanted, end

    def check(self, now: float) -> None:
        state = self._state(now)
        if self._arm.admission.owner is None:
            require_program_state(state, self._wanted)

    def begin(self, now: float) -> None:
        custody = self._arm.custody
        custody.begin(ProgramMotion(custody, self._command, self.call, self._end), now)


class JogRequest(_MotionRequest):
    """The request for a jog: the same one is kept going, another one is stopped and replaced."""

    owner = MotionOwner.JOG

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, command: c.Jog) -> None:
        super().__init__(call, arm, asked_at)
        self._command = command

    def audit(self) -> None:
        limits.check(self._command, self._arm.model)

    def join(self, now: float) -> bool:
        running = self._arm.running(JogMotion)
        if running is not None and running.command == self._command:
            running.again(self.call, self.asked_at)
            return True
        if running is not None:
            self._arm.custody.stop(MotionInterrupted(StopCause.STOPPED, "another jog replaces it"), now)
        return False

    def begin(self, now: float) -> None:
        custody, state = self._arm.custody, self._state(now)
        if now - self.asked_at >= custody.settings.jog_timeout:
            raise InvalidCommand("refused: the arm has come to rest %.1f s after the call of the jog, too late for it"
                                 % (now - self.asked_at))
        look, speeds = custody.motion_check.look(), custody.motion_check.jog_speeds(self._command, state)
        trouble = "" if speeds is None else look(way_ahead(state.joint_position, speeds))
        if trouble:
            raise InvalidCommand("refused: where the jog would lead, " + trouble)
        custody.begin(JogMotion(custody, self._command, self.call, self.asked_at, look), now)


class ServoModeRequest(_MotionRequest):
    """The request that servo mode is entered."""

    owner = MotionOwner.SERVO

    def check(self, now: float) -> None:
        if self._arm.running(Servo) is None:  # who joins a running stream needs no more than that
            super().check(now)

    def join(self, now: float) -> bool:
        running = self._arm.running(Servo)
        if running is not None:
            running.join(self.call)
        return running is not None

    def begin(self, now: float) -> None:
        custody = self._arm.custody
        custody.begin(Servo(custody, self._arm.model, self.call, self._state(now), self._arm.on_servo_mode), now)


class LeaveServoRequest(_MotionRequest):
    """The request that servo mode is left, also one that no stream of this driver is in."""

    owner = MotionOwner.SERVO

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, left: Callable[[], Procedure]) -> None:
        """Set up the request.

        left: Makes the procedure that leaves a servo mode of nobody's.
        """
        super().__init__(call, arm, asked_at)
        self._left = left

    def check(self, now: float) -> None:
        """Forbid nothing: leaving moves nothing."""

    def join(self, now: float) -> bool:
        running = self._arm.running(Servo)
        if running is not None:
            running.leave(self.call, "its client left")
        return running is not None

    def begin(self, now: float) -> None:
        self._arm.carry_out(self._left(), lambda result, error, _at: self._arm.actions.answer(
            self.call, result, error), now)


class _TrajectoryRequest(_MotionRequest):
    """A request of a trajectory, which a stop ends that came after the trajectory was asked for."""

    owner = MotionOwner.TRAJECTORY

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, stops: int) -> None:
        """Set up the request.

        stops: The number of stops when the trajectory was asked for.
        """
        super().__init__(call, arm, asked_at)
        self._stops = stops

    def check(self, now: float) -> None:
        self._arm.stops.require_no_end_since(self._stops)
        super().check(now)


class PointRequest(_TrajectoryRequest):
    """The request to follow one point of a stream; a trajectory that is running is braked for it."""

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, stops: int, point: StreamPoint,
                 gate: PointGate) -> None:
        super().__init__(call, arm, asked_at, stops)
        self.point = point
        self._gate = gate

    def audit(self) -> None:
        require_within(self.point.position, self._arm.model)

    def check(self, now: float) -> None:
        self._gate.require_open()  # also of a point that waits: what came meanwhile has ended its stream
        super().check(now)

    def join(self, now: float) -> bool:
        stream = self._arm.running(PointStream)
        if stream is not None and not stream.is_leaving:
            stream.take(self.point, now)
            self._arm.actions.answer(self.call)
            return True
        running = self._arm.running(Trajectory)
        if running is not None and stream is None:
            running.cancel(None)
        return False

    def begin(self, now: float) -> None:
        state, custody = self._state(now), self._arm.custody
        require_within(commanded_joints(state), self._arm.model)
        custody.begin(PointStream(custody, self._arm.model, self._gate, self.point, state, self._arm.on_servo_mode),
                      now)
        self._arm.actions.answer(self.call)


class StartRequest(_TrajectoryRequest):
    """The request for the place where a trajectory may begin: on the running one, or where the arm rests."""

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, stops: int, lead: float) -> None:
        """Set up the request.

        lead: How far ahead on the running trajectory, s.
        """
        super().__init__(call, arm, asked_at, stops)
        self._lead = lead

    def join(self, now: float) -> bool:
        running = self._arm.running(Trajectory)
        if isinstance(running, PointStream):
            running.cancel(None)
        if running is None or not running.can_be_joined:
            return False
        self._answer(running.start_after(self._lead))
        return True

    def begin(self, now: float) -> None:
        self._answer(start_at_rest(self._state(now)))

    def _answer(self, start: TrajectoryStart) -> None:
        self._arm.actions.answer(self.call, start._replace(workspace=self._arm.custody.motion_check.workspace))


class FollowRequest(_TrajectoryRequest):
    """The request that an audited path is followed, from the place that a ``StartRequest`` has found."""

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, stops: int, path: Path, start: TrajectoryStart,
                 tolerances: TrajectoryTolerances) -> None:
        super().__init__(call, arm, asked_at, stops)
        self._path, self._start, self._goal = path, start, Goal(call, tolerances)

    def join(self, now: float) -> bool:
        running = self._arm.running(Trajectory)
        if running is None or running is not self._start.running:
            return False
        running.replace(self._goal, self._path, self._start)
        return True

    def begin(self, now: float) -> None:
        state, custody = self._state(now), self._arm.custody
        require_start(self._path, state)
        if self._start.workspace is not custody.motion_check.workspace:
            raise StartChanged("the zones have changed since the trajectory was looked at; send it again")
        custody.begin(Trajectory(custody, self._arm.model, self._goal, self._path, state, self._arm.on_servo_mode), now)


class ProcedureRequest(ArmRequest):
    """The request to run a procedure, on its own while nothing moves the arm, or beside whatever does."""

    def __init__(self, call: Token, arm: ArmParts, asked_at: float, procedure: Procedure,
                 exclusive: Optional[MotionOwner]) -> None:
        """Set up the request.

        exclusive: What it is, where nothing may move the arm meanwhile; None where it is carried out beside a motion.
        """
        super().__init__(call, arm.admission, asked_at)
        self._arm, self._procedure, self._exclusive = arm, procedure, exclusive

    def join(self, now: float) -> bool:
        if self._exclusive is None:
            self._arm.carry_out(self._procedure, self._answer, now)
        return self._exclusive is None

    def begin(self, now: float) -> None:
        self._arm.admission.busy_with = self._exclusive
        self._arm.carry_out(self._procedure, self._ended, now)

    def _answer(self, result: object, error: Optional[JakaError], _now: float) -> None:
        self._arm.actions.answer(self.call, result, error)

    def _ended(self, result: object, error: Optional[JakaError], now: float) -> None:
        self._arm.admission.busy_with = None
        self._answer(result, error, now)
        self._arm.admission.retry(now)
