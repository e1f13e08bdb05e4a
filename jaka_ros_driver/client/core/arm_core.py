"""The core of one arm: it routes events of the links and calls of users, and decides who may move the arm.

The way of a move: audit against the model's limits, the arm's condition, custody, then the wire; "accepted" is the
controller's reply, the end is evidence in the status feed. A stop waits for nobody. It ends what was asked before it,
and only that: a motion asked after it begins when the arm has come to rest.
"""
import logging
from typing import Callable, Dict, List, Optional, Sequence, Union

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Actions, CoreAction, Port, Token
from jaka_ros_driver.client.core.channel import CommandChannel
from jaka_ros_driver.client.core.contradictions import require_no_wait
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.foreign_motion import ForeignMotion, LeftBehind, LeftMotion
from jaka_ros_driver.client.core.links import Links
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.planned.path_move import PathMove, PathProgress
from jaka_ros_driver.client.core.planned.program import ProgramMotion
from jaka_ros_driver.client.core.point_stream import PointGate, StreamPoint
from jaka_ros_driver.client.core.procedures.steps import Ask, Now, OnEnd, Procedure, Running, Until
from jaka_ros_driver.client.core.requests.admission import Admission, ArmRequest
from jaka_ros_driver.client.core.requests.kinds import (
    ArmParts,
    FollowRequest,
    JogRequest,
    LeaveServoRequest,
    MoveRequest,
    PathRequest,
    PointRequest,
    ProcedureRequest,
    ProgramRequest,
    ServoModeRequest,
    StartRequest,
)
from jaka_ros_driver.client.core.servo import Servo
from jaka_ros_driver.client.core.stops import Stops
from jaka_ros_driver.client.core.streaming import Streaming, left_servo_mode
from jaka_ros_driver.client.core.trajectory import Trajectory, TrajectoryProgress, TrajectoryStart
from jaka_ros_driver.client.core.velocity_jog.dead_man import DeadMan, JogMessage
from jaka_ros_driver.client.core.velocity_jog.motion import JogReport, VelocityJog
from jaka_ros_driver.client.core.velocity_jog.ramp import require_possible
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import (
    ConnectionLost,
    InvalidCommand,
    JakaError,
    MotionInterrupted,
    StopCause,
)
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.state import ProgramState, RobotState
from jaka_ros_driver.trajectory.path import JointState, Path
from jaka_ros_driver.trajectory.points import TrajectoryTolerances

_AT_REST_ONLY = (c.SetToolFrame, c.SelectTool, c.SetUserFrame, c.SelectUserFrame, c.SetPayload, c.SetHandGuiding)
"""Commands that change the meaning of a running motion, or what the arm carries."""


def exclusive_use(command: c.Command) -> Optional[MotionOwner]:
    """Return what a command is that is carried out only while nothing moves the arm; None for any other."""
    return MotionOwner.SETTING if isinstance(command, _AT_REST_ONLY) else None


class ArmCore:
    """The state machine of one arm; ``core/actions`` has the actions that it returns to the shell.

    Attributes:
        actions: Collects the actions for the shell.
        custody: Who moves the arm.
        links: To the controller.
        disturbances: Counts what ends an act that was begun without a call: stops, faults, lost links, calls.
        link_losses: How many of these were lost links.
        last_disturbance: The last one, in words.
        is_recovering: True while a recovery runs.
        dead_man: Who holds a velocity jog.
        switched_on_at: By SetPower or SetEnabled, when a call began to switch it on that was not seen done yet, s.
    """

    def __init__(self, settings: ClientSettings, model: ArmModel) -> None:
        """Set up without links; ``start`` connects them."""
        self.settings = settings
        self.model = model
        self.actions = Actions()
        self.channel = CommandChannel(self.actions, settings)
        self.custody = Custody(self.actions, self.channel, settings, model,
                               lambda now: self._admission.retry(now))
        self.links = Links(settings, self.actions, self.channel, self.custody, self.note_disturbance,
                           self._note_link_loss)
        self._admission = Admission(self.actions, self.custody, self.links)
        self._stops = Stops(self.actions, self.channel, self.custody, self.links, self._admission, settings,
                            self._carry_out)
        self._arm = ArmParts(model, self.actions, self.custody, self._admission, self._stops, self._carry_out,
                             self._servo_mode_is)
        self._foreign = ForeignMotion(self.actions)
        self._running: List[Running] = []
        self._is_closing = False
        self._servo_end = ""
        self._point_gate = PointGate()
        self._point: Optional[PointRequest] = None
        self.disturbances = self.link_losses = 0
        self.last_disturbance = ""
        self.is_recovering = False
        self.dead_man = DeadMan()
        self.switched_on_at: Dict[type, float] = {}

    # ---- what is known ----

    @property
    def state(self) -> Optional[RobotState]:
        """The newest state, however old; None before the first."""
        return self.links.state

    @property
    def stops(self) -> int:
        """The number of stops that were asked for, those of trajectories alone included."""
        return self._stops.of_trajectories

    def require_no_stop_since(self, count: int) -> None:
        """Raise MotionInterrupted where a stop came since ``count`` was taken from ``stops``."""
        self._stops.require_no_end_since(count)

    @property
    def is_free(self) -> bool:
        """True while nobody has custody of the arm."""
        return self.custody.is_free

    @property
    def motion_owner(self) -> Optional[MotionOwner]:
        """The kind of motion that moves the arm on behalf of this driver; None for none."""
        return self._admission.owner

    @property
    def foreign_motion(self) -> str:
        """The motion that this driver has not begun, in words; "" where there is none."""
        motion = self.custody.motion
        return str(motion) if isinstance(motion, LeftBehind) else self._foreign.text

    @property
    def velocity_jog(self) -> JogReport:
        """The velocity jog: who holds it, and where it stands."""
        motion = self.custody.motion
        return JogReport(self.dead_man.source, self.dead_man.last_end,
                         motion.obstacle if isinstance(motion, VelocityJog) else "")

    @property
    def late_servo_cycles(self) -> int:
        """The number of cycles of the present servo stream whose targets came too late to be sent."""
        motion = self.custody.motion
        return motion.late_cycles if isinstance(motion, Streaming) else 0

    @property
    def is_stream_moving(self) -> Optional[bool]:
        """True while this driver's stream moves the arm; None where it has none (``Streaming.is_moving``)."""
        motion = self.custody.motion
        return motion.is_moving if isinstance(motion, Streaming) and not self.custody.is_ending else None

    @property
    def trajectory(self) -> Optional[TrajectoryProgress]:
        """The progress of the running trajectory; None without one."""
        motion = self.custody.motion
        return motion.progress if isinstance(motion, Trajectory) else None

    def desired_at(self, at: float) -> Optional[JointState]:
        """Return where the running trajectory wants the joints at this moment, s; None without one.

        Raises:
            InvalidCommand: The arm was not on it then.
        """
        motion = self.custody.motion
        return motion.desired_at(at) if isinstance(motion, Trajectory) else None

    @property
    def path(self) -> Optional[PathProgress]:
        """The progress of the running path; None without one."""
        motion = self.custody.motion
        return motion.progress if isinstance(motion, PathMove) else None

    def is_ready(self, now: float) -> bool:
        """Return whether both links are up and the state is fresh."""
        state = self.links.state
        return self.links.is_up and state is not None and now - state.received_at <= self.settings.stale_after

    def fresh_state(self, now: float) -> RobotState:
        """Return the newest state.

        Raises:
            ConnectionLost: It is stale, or there is none.
        """
        return self.links.fresh_state(now)

    def is_hand_guided(self, state: RobotState) -> bool:
        """Return whether somebody guides the arm by hand in this state."""
        return self._admission.is_guided_in(state)

    def is_motion_possible(self, now: float) -> bool:
        """Return whether this driver can move the arm, or moves it.

        Links, drives and stops allow it, and nobody else has the arm.
        """
        try:
            state = self._admission.require_ready_to_move(MotionOwner.MOVE, now)
            if self.motion_owner is None:
                require_no_wait(MotionOwner.MOVE, self._admission.evidence(MotionOwner.MOVE, state))
        except JakaError:
            return False
        return self.motion_owner is not MotionOwner.LEFT

    def take_actions(self) -> List[CoreAction]:
        """Return the actions for the shell since its last call, in order."""
        return self.actions.take()

    def next_deadline(self) -> float:
        """Return when ``tick`` is due, s."""
        due = min(self.custody.deadline, self.links.deadline, self._admission.deadline)
        for running in self._running:
            due = min(due, running.deadline)
        return due

    # ---- events of the shell ----

    def start(self, now: float, left: Optional[LeftMotion] = None) -> None:
        """Begin to connect.

        left: The motion that a dead driver left, which is stopped first of all.
        """
        if left is not None:
            self.custody.take_over(LeftBehind(left), now)
            self.actions.log(logging.WARNING, self.foreign_motion)
        self.links.start(now)
        self.links.tick(now)

    def opened(self, port: Port, now: float) -> None:
        """Take note that the port is connected."""
        self.links.note_time(now)
        self.links.opened(port, now)

    def failed(self, port: Port, reason: str, now: float) -> None:
        """Take note that the port could not be connected."""
        self.links.note_time(now)
        self.links.failed(port, reason, now)

    def closed(self, port: Port, reason: str, now: float) -> None:
        """Take note that the connection has ended."""
        self.links.note_time(now)
        self.links.closed(port, reason, now)
        self._tick_running(now)

    def received(self, port: Port, data: bytes, now: float) -> None:
        """Take bytes that have arrived."""
        self.links.note_time(now)
        self.links.received(port, data, now)
        state = self.links.state
        if port is Port.STATUS and state is not None:
            self._foreign.observe(state, self.custody.stillness.duration(),
                                  not self.custody.is_free or self._admission.is_guided_in(state))
        self._tick_running(now)
        self._admission.retry(now)

    def tick(self, now: float) -> None:
        """Let time pass."""
        self.links.note_time(now)
        self.links.tick(now)
        self.custody.tick(now)
        self._tick_running(now)
        self._admission.retry(now)

    def prepare(self) -> None:
        """Compute in idle time what is sent next, so that it need not be computed when it is due; nothing is sent."""
        self.custody.prepare()

    # ---- calls: each is answered once ----

    def move(self, call: Token, command: c.MoveCommand, wait: bool, now: float, end: Token = None) -> None:
        """Move to the command's target; answered with ``wait`` when the arm is there, else on acceptance.

        ``end``: answered when the target is reached (of a queue: passed), or with what ended the move; not where
        ``call`` gets an error before anything was sent. Errors: InvalidCommand (outside the limits, or the arm cannot
        move now; nothing was sent), CommandRejected, MotionInterrupted (accepted, and not completed), ReplyTimeout,
        ConnectionLost.
        """
        self._enter(MoveRequest(call, self._arm, now, command, wait, end), now)

    def move_path(self, call: Token, commands: Sequence[c.PathCommand], is_cancelled: Callable[[], bool],
                  on_begun: Callable[[], None], now: float) -> None:
        """Run segments as one queue of the controller, after an audit of the whole; answered with its PathProgress.

        ``is_cancelled`` is looked at during the audit; ``on_begun`` is called when the first segment was accepted.

        Errors as ``move``, and before it has begun: a MotionInterrupted of cause CANCELLED or STOPPED. Once it has
        begun, each MotionInterrupted is a PathInterrupted.
        """
        self._enter(PathRequest(call, self._arm, now, commands, is_cancelled, on_begun), now)

    def cancel_path(self, call: Token, now: float) -> bool:
        """Stop the path that answers this call; return False where it does not run (yet, or any more)."""
        self.links.note_time(now)
        running = self._arm.running(PathMove)
        if running is None or running.progress.call is not call:
            return False
        self.custody.stop(MotionInterrupted(StopCause.CANCELLED), now)
        return True

    def play(self, call: Token, end: Token, now: float) -> None:
        """Play the loaded program: it has the arm until it is over, or is stopped. Answered when it is seen running.

        ``end``: answered when it is over, or with what ended it; not where ``call`` gets an error before it was sent.

        Errors as ``move``.
        """
        self._enter(ProgramRequest(call, self._arm, now, c.PlayProgram(), ProgramState.IDLE, end), now)

    def resume_program(self, call: Token, end: Token, now: float) -> None:
        """Resume the paused program, also one that was begun at the pendant: it has the arm from now on.

        ``end`` as for ``play``; where this driver plays it already, nobody is answered by it. Errors as ``move``.
        """
        running = self._arm.running(ProgramMotion)
        if running is not None:
            self.run(call, running.resumed(
                lambda at: self._admission.require_ready_to_move(MotionOwner.PROGRAM, at), self.seen), now)
        else:
            self._enter(ProgramRequest(call, self._arm, now, c.ResumeMotion(), ProgramState.PAUSED, end), now)

    def jog(self, call: Token, command: c.Jog, now: float) -> None:
        """Begin a jog, or keep the same one going; answered on acceptance. Errors as ``move``."""
        self._enter(JogRequest(call, self._arm, now, command), now)

    def servo_mode(self, call: Token, active: bool, now: float) -> None:
        """Enter servo mode and hold the arm there, or leave it; answered when the controller confirms.

        Errors as ``move``.
        """
        self._enter(ServoModeRequest(call, self._arm, now) if active
                    else LeaveServoRequest(call, self._arm, now, self._leave_servo_mode), now)

    def set_servo_target(self, command: Union[c.ServoJoint, c.ServoPose], now: float) -> str:
        """Add one target to the servo stream; no call, because nothing is sent at once.

        Returns:
            As ``Servo.set_target``.

        Raises:
            InvalidCommand: Not in servo mode, outside the limits, or too far away; nothing moves.
        """
        self.links.note_time(now)
        running = self._arm.running(Servo)
        if running is None:
            reason = self.custody.ending_reason or self._servo_end
            raise InvalidCommand("refused: not in servo mode; servo_move_enable first" + (
                " (it ended: %s)" % reason if reason else ""))
        limits.check(command, self.model, self.state)
        return running.set_target(command, now)

    def jog_velocity(self, message: JogMessage, now: float) -> None:
        """Jog at the velocity of one message of a stream, until it is not fresh any more; no call, as nobody waits for
        it.

        Raises:
            InvalidCommand: It does not count (``DeadMan.take``), the arm does not have that speed, or cannot be moved
                now.
            ConnectionLost: There is no link.
        """
        self.links.note_time(now)
        if message.wish is not None:
            try:
                require_possible(message.wish, self.model)
            except InvalidCommand as error:
                message = message._replace(wish=None, problem=str(error))
        wish = self.dead_man.take(message, now)
        running = self._arm.running(VelocityJog)
        if (running is not None and not running.is_leaving) or wish.is_zero:
            return
        try:
            self._begin_velocity_jog(now)
        except JakaError as error:
            self.dead_man.release(str(error))
            raise

    def _begin_velocity_jog(self, now: float) -> None:
        """Begin a velocity jog, unless the arm still comes to rest from an earlier motion.

        Then a later message tries again.
        """
        if self._is_closing:
            raise ConnectionLost("the driver is shutting down")
        owner = MotionOwner.VELOCITY_JOG
        state = self._admission.require_ready_to_move(owner, now)
        if self.motion_owner is None:
            require_no_wait(owner, self._admission.evidence(owner, state))
        if self._admission.is_free_at_rest(owner, now):
            self.custody.begin(VelocityJog(self.custody, self.model, self.dead_man, state, self._servo_mode_is), now)

    def trajectory_start(self, call: Token, lead: float, stops: int, now: float) -> None:
        """Answer with a ``TrajectoryStart``: the running trajectory ``lead`` s ahead, or the arm, once it rests.

        ``stops``: the number of stops when the trajectory was asked for; a later one ends it. Errors: InvalidCommand,
        ConnectionLost: the arm cannot be moved now. MotionInterrupted: a stop came between.
        """
        self._enter(StartRequest(call, self._arm, now, stops, lead), now)

    def follow(self, call: Token, path: Path, start: TrajectoryStart, tolerances: TrajectoryTolerances, stops: int,
               now: float) -> None:
        """Follow an audited path from its start on; answered when the arm rests at its end, and servo mode is left.

        The answer is ``Path.led``.

        ``stops`` as for ``trajectory_start``. Errors as ``move``, and: StartChanged (the arm is not there any more,
        nothing was sent), PathToleranceViolated, GoalToleranceViolated.
        """
        self._enter(FollowRequest(call, self._arm, now, stops, path, start, tolerances), now)

    def follow_point(self, call: Token, point: StreamPoint, stops: int, now: float) -> None:
        """Follow one point of a stream of points; answered when it is taken.

        A point that waits for the arm to come to rest is replaced by the next one. Errors: InvalidCommand (also: the
        stream was ended, and must pause first), ConnectionLost, MotionInterrupted (a newer point came, or a stop).
        """
        request, waiting = PointRequest(call, self._arm, now, stops, point, self._point_gate), self._point
        self.links.note_time(now)
        try:
            self._point_gate.pass_through(now)  # of each point, or one that waits would count as a pause
            if self._is_closing:
                raise ConnectionLost("the driver is shutting down")
            request.audit()
            if waiting is not None and self._admission.is_waiting(waiting):
                self.actions.answer(waiting.call, None, MotionInterrupted(StopCause.REPLACED))
                waiting.call, waiting.point = call, point
                return
            self._point = request
            request.enter(now)
        except JakaError as error:
            self._point_gate.close(str(error))
            self.actions.answer(call, None, error)

    def cancel_trajectory(self, call: Token, now: float) -> bool:
        """Brake the trajectory that answers ``call`` (None: any) on its path; return False where it does not run."""
        self.links.note_time(now)
        running = self._arm.running(Trajectory)
        return running is not None and running.cancel(call)

    def end_trajectories(self, now: float) -> bool:
        """Brake the running trajectory as ``cancel_trajectory``; none begins that was asked for before."""
        self._stops.end_trajectories()
        return self.cancel_trajectory(None, now)

    def stop(self, call: Token, now: float) -> None:
        """Stop all motion, queued motion and programs, and leave servo mode; answered with the controller's reply.

        Errors: ConnectionLost, ReplyTimeout, CommandRejected: it could not be delivered. Where this driver moves the
        arm the stop is repeated all the same until the arm rests.
        """
        self.links.note_time(now)
        self.note_disturbance("a stop")
        self._stops.stop(call, now)

    def run(self, call: Token, procedure: Procedure, now: float,
            exclusive: Optional[MotionOwner] = None) -> None:
        """Run a procedure; answered with its result or its error. A ``call`` of None is not answered.

        ``exclusive``: what it is that begins only while nothing moves the arm, and lets nothing move it meanwhile.
        """
        self._enter(ProcedureRequest(call, self._arm, now, procedure, exclusive), now)

    def ask(self, command: c.Command) -> Procedure:
        """Run a procedure of one command that moves nothing, after its audit."""
        return (yield Ask(self.audited(command)))

    def close(self, now: float) -> None:
        """Stop what this driver moves, and answer every call; ``is_free`` becomes true when the arm rests."""
        self.links.note_time(now)
        self._is_closing = True
        self.links.close()
        ended = MotionInterrupted(StopCause.SHUTDOWN)
        self.dead_man.release(str(ended))
        self._admission.end_waiting(ended)
        self.custody.stop(ended, now)
        for running in list(self._running):
            running.throw(ConnectionLost(StopCause.SHUTDOWN.value), now)

    def disconnect(self, now: float) -> None:
        """Close both connections for good, and end the calls that still wait."""
        self.links.disconnect(now)

    # ---- what procedures use ----

    def audited(self, command: c.Command) -> c.Command:
        """Return the command, if it keeps the model's limits.

        Raises:
            InvalidCommand: It does not.
        """
        return self._arm.audited(command)

    def stop_own(self, now: float) -> None:
        """Send a stop for which nobody is answered."""
        self.dead_man.release("a stop")
        self._stops.stop_own(now)

    def seen(self, holds: Callable[[RobotState], bool], timeout: float,
             check: Callable[[], None] = lambda: None) -> Procedure:
        """Wait at most ``timeout`` s for a state of later than now for which ``holds``; return whether it came.

        ``check`` is called each time before a state is looked at; what it raises is raised in the procedure.
        """
        begun = yield Now()

        def is_seen(_now: float) -> bool:
            check()
            state = self.state
            return state is not None and state.received_at > begun and holds(state)
        return (yield Until(is_seen, timeout))

    def note_disturbance(self, what: str) -> None:
        """Record a disturbance, which ends what was begun without a call: auto_enable, a velocity jog."""
        self.disturbances += 1
        self.last_disturbance = what
        self.dead_man.release(what)
        self._point_gate.close(what)

    def _note_link_loss(self, what: str) -> None:
        """Record a disturbance that nobody asked for and that shows no trouble of the arm's."""
        self.link_losses += 1
        self.note_disturbance(what)

    def hand_guiding_was_set(self, active: bool) -> None:
        """Record that the controller accepted a change of hand guiding; not every feed has that."""
        self._admission.is_guided = active

    # ---- inside: calls ----

    def _enter(self, request: ArmRequest, now: float) -> None:
        self.links.note_time(now)
        try:
            if self._is_closing:
                raise ConnectionLost("the driver is shutting down")
            request.audit()
            request.enter(now)
        except JakaError as error:
            self.actions.answer(request.call, None, error)

    def _carry_out(self, procedure: Procedure, on_end: OnEnd, now: float) -> None:
        running = Running(procedure, self.channel, on_end, gate=self.channel)
        running.begin(now)
        if not running.has_ended:
            self._running.append(running)

    def _tick_running(self, now: float) -> None:
        if self._running:
            for running in list(self._running):
                running.tick(now)
            self._running = [running for running in self._running if not running.has_ended]

    def _servo_mode_is(self, active: bool, reason: str) -> None:
        was_active, self.links.is_servo_active = self.links.is_servo_active, active
        self._servo_end = reason
        if reason and was_active:
            self.actions.log(logging.INFO, "servo mode has ended: %s" % reason)

    def _leave_servo_mode(self) -> Procedure:
        """Leave a servo mode that no stream of this driver is in."""
        yield from left_servo_mode()
        self.links.is_servo_active = False
