"""The thread-safe client of one arm: a lock around ``core``, and one thread for its sockets and timers."""
import contextlib
import logging
import math
import threading
import time
import weakref
from concurrent.futures import Future
from typing import Any, Callable, Iterator, List, Optional, Sequence, Union, cast

from jaka_ros_driver import commands as c
from jaka_ros_driver.client import fail_stop
from jaka_ros_driver.client.core.actions import Answer, Close, Log, NotifyGuard, Open, Port, PublishState, Send
from jaka_ros_driver.client.core.arm_core import ArmCore, exclusive_use
from jaka_ros_driver.client.core.feed import FeedHealth
from jaka_ros_driver.client.core.links import LinkHealth
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.planned.path_move import PathProgress
from jaka_ros_driver.client.core.point_stream import StreamPoint
from jaka_ros_driver.client.core.procedures import power
from jaka_ros_driver.client.core.procedures.steps import Procedure
from jaka_ros_driver.client.core.trajectory import StartChanged, TrajectoryProgress, TrajectoryStart
from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage
from jaka_ros_driver.client.core.velocity_jog.motion import JogReport
from jaka_ros_driver.client.custody_file import CustodyFile, CustodyKeeper
from jaka_ros_driver.client.followed_path import LONGEST_LEAD_S, followed_path, lead_of
from jaka_ros_driver.client.guard import Guard
from jaka_ros_driver.client.loop_task import LoopTask
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.client.stop_timer import StopTimer
from jaka_ros_driver.client.transport import Closed, Failed, Opened, Received, Transport
from jaka_ros_driver.errors import ConnectionLost, JakaError
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import Transform
from jaka_ros_driver.state import RobotState, Vector
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryTolerances

_LOG = logging.getLogger(__name__)

_LONGEST_WAIT_S = 0.02
"""Longest pause, s, of the thread: the guard's heartbeat period, and the core notices longer ones."""
_REST_TIMEOUT_S = 2.0
"""Longest time, s, that ``close`` waits for the arm to come to rest."""

StateListener = Callable[[RobotState, bool], None]
CustodyListener = Callable[[NotifyGuard], None]


class ArmClient:
    """The driver's access to one arm. Every method may be called from any thread; errors are JakaErrors."""

    def __init__(self, settings: ClientSettings, model: ArmModel, guard: Optional[Guard] = None,
                 custody_file: Optional[CustodyFile] = None) -> None:
        """Set up the client; ``start`` connects it.

        Args:
            settings: Address and time limits.
            model: The arm model whose limits every command is checked against.
            guard: Is notified when this driver begins to move the arm (before anything is sent), when that has ended,
                and every 20 ms that the driver lives. None for no guard.
            custody_file: Records for a later driver what this one moves, and for this one what an earlier one left.
                None: none.
        """
        self.settings = settings
        self.model = model
        self._guard = guard
        self._custody_file = custody_file
        self._keeper = CustodyKeeper(custody_file) if custody_file is not None else None
        self._core = ArmCore(settings, model)
        ports = {Port.COMMAND: settings.command_port, Port.STATUS: settings.status_port}
        self._transport = Transport(settings.host, ports, settings.connect_timeout, settings.reply_timeout)
        self._lock = threading.Lock()
        self._wakes_at = math.inf
        self._listeners: List[StateListener] = []
        self._custody_listeners: List[CustodyListener] = []
        self.stop_timer = StopTimer()
        self._tasks: List[LoopTask] = []
        self._shows: List[PublishState] = []
        self._is_closing = self._is_closed = self._has_failed = False
        self._defect: Optional[Exception] = None
        self._calls: weakref.WeakSet[Future[Any]] = weakref.WeakSet()
        self._thread = threading.Thread(target=self._run, name="arm loop", daemon=True)

    # ---- life ----

    def start(self) -> None:
        """Start to connect; return at once. Lost links are connected again until ``close``.

        Where a dead driver left the arm moving, stopping it is the first thing that is sent.
        """
        found = self._custody_file.read() if self._custody_file is not None else None
        if found is not None and found.is_alive:
            _LOG.warning("%s of this controller is in the custody of another driver, process %d, which is alive; it "
                         "is not stopped unasked", found.left.name, found.left.process)
        if self._keeper is not None:
            self._keeper.start()
        with self._lock:
            self._core.start(time.monotonic(), None if found is None or found.is_alive else found.left)
            self._perform()
        self._thread.start()

    def auto_enable(self) -> None:
        """Power and enable the arm once, when it is first seen without fault; any call or stop before ends that."""
        with self._in_core():
            self._core.run(None, power.auto_enable(self._core, 0), time.monotonic())
            self._perform()

    def close(self) -> None:
        """Stop what this driver moves, end every pending call, disconnect. It waits at most 2 s for the arm to rest."""
        if self._is_closing:
            return
        with contextlib.suppress(Exception), self._in_core():  # a defect there ends the loop, which logs it
            if not self._is_closed:
                self._core.close(time.monotonic())
                self._perform()
        deadline = time.monotonic() + _REST_TIMEOUT_S
        while self._thread.is_alive() and not self._core.is_free and time.monotonic() < deadline:
            time.sleep(0.002)
        if not self._core.is_free:
            _LOG.error("the arm was not seen at rest at shut-down")
        has_failed, self._is_closing = self.has_failed, True
        self._transport.wake()
        if self._thread.is_alive():
            self._thread.join()
        with self._lock:
            if not has_failed:
                self._core.disconnect(time.monotonic())
                self._perform()
            self._is_closed = True
            self._transport.shut()
        if self._keeper is not None:
            self._keeper.close()

    def add_listener(self, listener: StateListener) -> None:
        """Call ``listener(state, is_new)`` for every status frame in the client's thread; it must not block.

        ``is_new`` is False for a frame that was delayed and shows an earlier time.
        """
        self._listeners.append(listener)

    def add_custody_listener(self, listener: CustodyListener) -> None:
        """Call ``listener`` whenever this driver begins to move the arm, and when that has ended; it must not block."""
        self._custody_listeners.append(listener)

    def add_task(self, task: LoopTask) -> None:
        """Have the client's thread run a task from now on."""
        self._tasks.append(task)

    # ---- what is known ----

    @property
    def state(self) -> Optional[RobotState]:
        """The newest state, however old; None before the first."""
        return self._core.state

    def fresh_state(self) -> RobotState:
        """Return the newest state; raise ConnectionLost where it is stale, or there is none."""
        return self._core.fresh_state(time.monotonic())

    @property
    def is_ready(self) -> bool:
        """True while both links are up and the state is fresh."""
        return self._core.is_ready(time.monotonic())

    @property
    def link_health(self) -> LinkHealth:
        """The state of the links to the controller."""
        with self._lock:
            return self._core.links.health()

    @property
    def feed_health(self) -> FeedHealth:
        """The state of the status feed."""
        with self._lock:
            return self._core.links.feed_health(time.monotonic())

    @property
    def is_simulated(self) -> Optional[bool]:
        """True where the controller is a simulated one; None before that is known."""
        return self._core.links.about.is_simulated

    @property
    def is_servo_active(self) -> bool:
        """True while the controller is in servo mode; False while that is not known."""
        return self._core.links.is_servo_active

    @property
    def is_stream_moving(self) -> Optional[bool]:
        """True while this driver's stream moves the arm; None where it has none (``Streaming.is_moving``)."""
        return self._core.is_stream_moving

    @property
    def motion_owner(self) -> Optional[MotionOwner]:
        """The kind of motion in which this driver moves the arm, until the arm is seen at rest; None for none."""
        return self._core.motion_owner

    @property
    def foreign_motion(self) -> str:
        """The motion that this driver has not begun, in words; "" where there is none."""
        return self._core.foreign_motion

    @property
    def is_motion_possible(self) -> bool:
        """True where this driver can move the arm, or moves it: nothing forbids it, and nobody else has the arm."""
        return self._core.is_motion_possible(time.monotonic())

    def is_hand_guided(self, state: RobotState) -> bool:
        """Return whether somebody guides the arm by hand in this state; not every feed has that."""
        return self._core.is_hand_guided(state)

    def has_moved_since(self, moment: float) -> bool:
        """Return whether fresh frames after this moment (monotonic, s) show the joints somewhere else than before."""
        return self._core.custody.stillness.has_moved_since(moment)

    @property
    def has_failed(self) -> bool:
        """True where the thread has ended by a defect; nothing works any more."""
        return self._has_failed

    @property
    def guard(self) -> Optional[Guard]:
        """The guard; None where there is none."""
        return self._guard

    @property
    def late_servo_cycles(self) -> int:
        """Number of cycles of the present servo stream whose targets came too late to be sent."""
        return self._core.late_servo_cycles

    # ---- calls ----

    def execute(self, command: c.Command) -> Any:
        """Check a command that does not move the arm, send it, and return the controller's answer.

        Raises:
            InvalidCommand: It breaks a limit; nothing was sent.
            CommandRejected: The controller refused it.
            ReplyTimeout, ConnectionLost: No reply in time; the link is down.
            ProtocolError: The reply does not hold the answer.
        """
        return self.run(lambda core: core.ask(command), exclusive_use(command))

    def run(self, procedure: Callable[[ArmCore], Procedure], exclusive: Optional[MotionOwner] = None) -> Any:
        """Run a procedure of ``core/procedures``, and return its result; raise what the procedure names.

        ``exclusive``: what it is, where it is refused while anything moves the arm, and nothing begins meanwhile.
        """
        return self._call(lambda call, now: self._core.run(call, procedure(self._core), now, exclusive))

    def begin(self, procedure: Callable[[ArmCore], Procedure]) -> "Future[Any]":
        """Begin a procedure and return at once; the future receives its result, or the error that it names."""
        return self._begin(lambda call, now: self._core.run(call, procedure(self._core), now))

    def move(self, command: c.MoveCommand, wait: bool = True) -> None:
        """Move to the command's target; return when the arm is there or, without ``wait``, when it is accepted.

        Raises:
            InvalidCommand: Outside the limits, or the arm cannot move now; nothing was sent.
            CommandRejected: The controller refused it.
            MotionInterrupted: It was accepted and did not complete.
            ReplyTimeout, ConnectionLost: As ``execute``.
        """
        self._call(lambda call, now: self._core.move(call, command, wait, now))

    def queue(self, command: c.MoveCommand) -> "Future[None]":
        """Begin a move, or queue it behind the running ones; return when the controller has accepted it.

        Returns:
            Ends when the target is reached (of a queue: passed), or with a MotionInterrupted.

        Raises:
            As ``move``.
        """
        end = self._future()
        self._call(lambda call, now: self._core.move(call, command, False, now, end))
        return end

    def begin_path(self, commands: Sequence[c.PathCommand], is_cancelled: Callable[[], bool],
                   on_begun: Callable[[], None]) -> "Future[PathProgress]":
        """Begin to run segments as one queue of the controller, after an audit of the whole.

        Args:
            commands: The segments.
            is_cancelled: Checked while nothing was sent yet; ``cancel_path`` ends it later.
            on_begun: Called in the client's thread, when the first segment was accepted; it must not block.

        Returns:
            Ends when the arm rests at the last target, or with an error: as ``move``; after ``on_begun`` with a
            PathInterrupted, when the arm rests after the stop.
        """
        return self._begin(lambda call, now: self._core.move_path(call, commands, is_cancelled, on_begun, now))

    def cancel_path(self, path: "Future[PathProgress]") -> bool:
        """Stop the path of this future; return False where it does not run (yet, or any more)."""
        with self._in_core():
            is_cancelled = not self._is_closed and self._core.cancel_path(path, time.monotonic())
            self._perform()
        return is_cancelled

    @property
    def path(self) -> Optional[PathProgress]:
        """The progress of the running path; None without one."""
        with self._lock:
            return self._core.path

    def play_program(self) -> "Future[None]":
        """Play the loaded program; return when it is seen running, and then nobody else can move the arm.

        Returns:
            Ends when it is over, or with a MotionInterrupted.

        Raises:
            As ``move``.
        """
        end = self._future()
        self._call(lambda call, now: self._core.play(call, end, now))
        return end

    def resume_program(self) -> "Future[None]":
        """Resume the paused program as ``play_program`` plays one; of one that this driver plays, the first ends."""
        end = self._future()
        self._call(lambda call, now: self._core.resume_program(call, end, now))
        return end

    def jog(self, command: c.Jog) -> None:
        """Begin a jog, or keep it going for another ``jog_timeout``. Raise what ``move`` raises."""
        self._call(lambda call, now: self._core.jog(call, command, now))

    def set_servo_mode(self, active: bool) -> None:
        """Enter servo mode and hold the arm there, or leave it; return when the controller confirms.

        Raises as ``move``, and MotionInterrupted when the controller does not follow within 2 s.
        """
        self._call(lambda call, now: self._core.servo_mode(call, active, now))

    def servo_target(self, command: Union[c.ServoJoint, c.ServoPose]) -> str:
        """Add one target to the servo stream; return which joint is led elsewhere, in words (``Servo.set_target``).

        Raises:
            InvalidCommand: Outside servo mode, outside the limits, or too far from the last target; nothing moves.
        """
        with self._in_core(needs_arm=True):
            return self._core.set_servo_target(command, time.monotonic())

    def jog_velocity(self, message: JogMessage) -> None:
        """Jog at the velocity of one message of a stream, until the message is not fresh any more.

        Raises InvalidCommand or ConnectionLost where it moves nothing; see ``ArmCore.jog_velocity``.
        """
        with self._in_core(needs_arm=True):
            try:
                self._core.jog_velocity(message, time.monotonic())
            finally:
                self._perform()
                if self._core.next_deadline() < self._wakes_at:
                    self._transport.wake()

    @property
    def velocity_jog(self) -> JogReport:
        """The velocity jog: who holds it, and where it stands."""
        return self._core.velocity_jog

    def know_tools(self, tools: Optional[Sequence[Transform]]) -> None:
        """Note the controller's tools for the motion guard: ``flange_t_tool`` by id; None while not known."""
        with self._lock:
            self._core.custody.motion_check.tools = tools

    @property
    def stops(self) -> int:
        """The number of stops that were asked for; see ``follow``."""
        return self._core.stops

    def follow(self, trajectory: JointTrajectory, tolerances: TrajectoryTolerances,
               stops: Optional[int] = None) -> "Future[str]":
        """Begin to follow a trajectory; a running one is replaced, and joined at the arm's position of that moment.

        Args:
            trajectory: The points to follow.
            tolerances: The deviations that are allowed.
            stops: The number of stops when it was asked for; a stop since then ends it. None: it is asked for now.

        Returns:
            Ends with ``Path.led`` when the arm rests at the last point and servo mode is left; or with a
            MotionInterrupted: CANCELLED, REPLACED, what stopped the arm, Path- or GoalToleranceViolated.

        Raises:
            InvalidTrajectory: It is malformed, breaks a limit, or begins elsewhere; nothing was sent.
            InvalidCommand, ConnectionLost: The arm cannot be moved now; nothing was sent.
            MotionInterrupted: A stop came after it was asked for; nothing was sent.
        """
        asked_with, lead = self.stops if stops is None else stops, lead_of(trajectory)
        while True:
            done = self._try_to_follow(trajectory, tolerances, asked_with, lead)
            error = done.exception() if done.done() else None
            if isinstance(error, StartChanged) and lead <= LONGEST_LEAD_S:
                lead *= 2.0
            elif error is not None:
                raise error
            else:
                return done

    def follow_point(self, position: Vector, due: float) -> "Future[None]":
        """Follow one point of a stream: ``position``, rad (6,), where the arm is to be at ``due``, monotonic time, s.

        Returns:
            Ends when it is taken, or with its refusal: InvalidCommand (also: the stream was ended, and must pause
            first), ConnectionLost, MotionInterrupted.
        """
        point = StreamPoint(position, due)
        return self._begin(lambda call, now: self._core.follow_point(call, point, self._core.stops, now))

    def _try_to_follow(self, trajectory: JointTrajectory, tolerances: TrajectoryTolerances, stops: int,
                       lead: float) -> "Future[str]":
        """Build and audit the path without the lock, and begin it; meanwhile the arm may have moved on."""
        starts_at, elapsed, reserve = trajectory.starts_at, 0.0, self._core.settings.stream_lead
        ahead = lead if starts_at is None else max(lead, starts_at - time.monotonic() - reserve)
        start: TrajectoryStart = self._call(lambda call, now: self._core.trajectory_start(call, ahead, stops, now))
        if starts_at is not None:
            elapsed = time.monotonic() - starts_at + (ahead + reserve if start.running is not None else 0.0)
        path = followed_path(start, trajectory, elapsed, self.model, self._core, stops)
        return self._begin(lambda call, now: self._core.follow(call, path, start, tolerances, stops, now))

    def cancel_trajectory(self, goal: "Optional[Future[str]]" = None) -> bool:
        """Brake a trajectory on its path, that of ``follow``'s future or any; return False where it does not run."""
        with self._in_core():
            return not self._is_closed and self._core.cancel_trajectory(goal, time.monotonic())

    def end_trajectories(self) -> bool:
        """Brake any trajectory as ``cancel_trajectory`` does; none begins that was asked for before."""
        with self._in_core():
            return not self._is_closed and self._core.end_trajectories(time.monotonic())

    @property
    def trajectory(self) -> Optional[TrajectoryProgress]:
        """The progress of the running trajectory; None without one."""
        with self._lock:
            return self._core.trajectory

    def desired_at(self, at: float) -> Optional[JointState]:
        """Return ``ArmCore.desired_at``: where the running trajectory wants the joints at a moment, monotonic s."""
        with self._lock:
            return self._core.desired_at(at)

    def stop(self, when_sent: Callable[[], object] = lambda: None) -> None:
        """Stop all motion, queued motion and programs, and leave servo mode; call ``when_sent`` once it is on its way.

        Raises:
            ConnectionLost, ReplyTimeout: The stop could not be delivered.
            CommandRejected: The controller refused it. What this driver moves is stopped again until it rests.
        """
        with self.stop_timer.measured():
            answer = self._begin(self._core.stop)
            when_sent()
            answer.result()

    # ---- inside ----

    def _call(self, enter: Callable[["Future[Any]", float], None]) -> Any:
        return self._begin(enter).result()

    def _begin(self, enter: Callable[["Future[Any]", float], None]) -> "Future[Any]":
        call = self._future()
        with self._in_core(needs_arm=True):
            enter(call, time.monotonic())
            self._perform()
            if self._core.next_deadline() < self._wakes_at:
                self._transport.wake()
        return call

    def _future(self) -> "Future[Any]":
        """Return a new future for a caller; it ends at the latest when this client ends."""
        call: Future[Any] = Future()
        self._calls.add(call)
        return call

    @contextlib.contextmanager
    def _in_core(self, needs_arm: bool = False) -> Iterator[None]:
        """Hold the lock for a caller's event of the core, which may need the arm; a defect in it ends the client."""
        with self._lock:
            if needs_arm and self._is_closed:
                raise ConnectionLost("driver shut down")
            try:
                yield
            except JakaError:
                raise
            except Exception as defect:
                self._defect = self._defect or defect
                self._transport.wake()
                raise

    def _perform(self) -> None:
        """Execute the core's actions; the caller holds the lock. Listeners receive states later, without the lock."""
        piece: List[bytes] = []
        for action in self._core.take_actions():
            kind = type(action)
            if kind is PublishState:
                self._shows.append(action)  # type: ignore[arg-type]
                continue
            if kind is Send:
                piece.append(action.data)  # type: ignore[union-attr]
                continue
            if piece:  # sent first, so that what follows, a close for instance, does not overtake it
                self._transport.send(b"".join(piece))
                piece = []
            if isinstance(action, Answer):
                _end(action)
            elif isinstance(action, NotifyGuard):
                if self._guard is not None:
                    self._guard.notify(action.is_moving)
                if self._keeper is not None:
                    self._keeper.note(action)
                for listener in self._custody_listeners:
                    listener(action)
            elif isinstance(action, Open):
                self._transport.open(action.port)
            elif isinstance(action, Close):
                self._transport.close(action.port)
            elif isinstance(action, Log):
                _LOG.log(action.level, "%s", action.text)
        if piece:
            self._transport.send(b"".join(piece))

    def _run(self) -> None:
        try:
            while not self._is_closing:
                self._turn()
        except Exception as defect:
            self._fail_stop(defect)

    def _fail_stop(self, defect: Exception) -> None:
        """Stop the arm without the core, keep the evidence, and end every call.

        The guard receives no further heartbeat: where the arm is in custody it takes the silence for a failure, and
        stops the arm until it is seen at rest.
        """
        with self._lock:
            self._has_failed = self._is_closed = True
            stop = fail_stop.last_stop(self._core)
            self._transport.send(stop)
        fail_stop.report(self._core, defect)
        for _ in range(fail_stop.LAST_STOPS - 1):
            time.sleep(fail_stop.LAST_STOP_PERIOD_S)
            with self._lock:
                self._transport.send(stop)
        with self._lock:
            for port in Port:
                self._transport.close(port)
            waiting = [call for call in self._calls if not call.done()]
        for call in waiting:
            call.set_exception(ConnectionLost("the driver has failed: %s" % defect))

    def _turn(self) -> None:
        now = time.monotonic()
        due = min([now + _LONGEST_WAIT_S] + [at for at in (task.due() for task in self._tasks) if at is not None])
        with self._lock:
            self._wakes_at = due = min(due, self._core.next_deadline())
        self._transport.wait(due - now)
        with self._lock:
            if self._defect is not None:
                raise self._defect
            now = time.monotonic()
            for event in self._transport.read():
                if isinstance(event, Received):
                    self._core.received(event.port, event.data, now)
                elif isinstance(event, Opened):
                    self._core.opened(event.port, now)
                elif isinstance(event, Failed):
                    self._core.failed(event.port, event.reason, now)
                elif isinstance(event, Closed):
                    self._core.closed(event.port, event.reason, now)
            self._core.tick(now)
            self._perform()
            self._core.prepare()
            shows, self._shows = self._shows, []
        if self._guard is not None:
            self._guard.beat(now)
        try:
            self._pass_on(shows, now)
        except Exception:  # a defect of a listener must not end the thread that stops the arm
            _LOG.exception("a listener of the arm's state failed")

    def _pass_on(self, shows: List[PublishState], now: float) -> None:
        for show in shows:
            for listener in self._listeners:
                listener(show.state, show.is_new)
        for task in self._tasks:
            due = task.due()
            if due is not None and now >= due:
                task.run(now)


def _end(answer: Answer) -> None:
    """Complete the future of a call, so that the waiting thread continues."""
    call = cast("Future[Any]", answer.call)  # the only tokens that this client gives the core
    if answer.error is None:
        call.set_result(answer.result)
    else:
        call.set_exception(answer.error)
