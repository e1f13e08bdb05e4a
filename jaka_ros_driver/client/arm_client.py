"""One arm, as the driver sees it: what moves it, what stops it, and what stands against moving it.

The way of a move: audit against the model's limits, the arm's condition, ownership, then the wire; "accepted" is the
controller's reply, the end is seen in the status feed. A stop waits for nobody: it needs no ownership, and what was
asked before it and is not yet on the wire is dropped.
"""
import logging
import threading
import time
from typing import Any, Callable, List, Optional, Tuple, Union

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_links import ArmLinks, LinkHealth
from jaka_ros_driver.client.jog_watchdog import JogWatchdog
from jaka_ros_driver.client.motion_owner import MotionOwner, Ownership
from jaka_ros_driver.client.motion_waiter import MotionWaiter, standing_cause
from jaka_ros_driver.client.servo_stream import ServoStream
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.client.status_monitor import StatusMonitor
from jaka_ros_driver.client.transport import CommandLink, Pending
from jaka_ros_driver.errors import (
    CommandRejected,
    ConnectionLost,
    InvalidCommand,
    JakaError,
    MotionInterrupted,
    ProtocolError,
    StopCause,
)
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.state import RobotState

_LOG = logging.getLogger(__name__)

_REST_TIMEOUT = 1.0
_SERVO_TIMEOUT = 2.0
_POLL_PERIOD = 0.02
_RETRY_PERIOD = 0.2
_FRAME_COMMANDS = (c.SetToolFrame, c.SelectTool, c.SetUserFrame, c.SelectUserFrame)
"""They change what the numbers of a Cartesian servo frame mean."""


class ArmClient:
    """The driver's grip on one arm. Every method may be called from any thread."""

    def __init__(self, settings: ClientSettings, model: ArmModel,
                 on_moving: Callable[[bool], None] = lambda is_moving: None) -> None:
        """Prepare; ``start`` begins.

        Args:
            settings: Address and time limits.
            model: Whose limits every command is held against.
            on_moving: Told, before anything is sent, when this driver begins to move the arm, and when it has ended.
                A motion that a lost link left unstopped has not.
        """
        self.settings = settings
        self.model = model
        self.status = StatusMonitor(settings.silence_timeout)
        self.status.add_listener(self._observe)
        self._links = ArmLinks(settings, self.status, self._command_lost, self._status_lost, self._check_sight)
        self._ownership = Ownership(lambda is_owned: on_moving(
            is_owned or self._links.must_stop_first or self._posted_stop is not None))
        self._dispatch = threading.Lock()
        self._jog_calls = threading.Lock()
        self._servo_calls = threading.Lock()
        self._stops = 0
        self._last_stop = StopCause.STOPPED
        self._is_closing = False
        self._posted_stop: Optional[Tuple[CommandLink, Pending]] = None
        self._waiter: Optional[MotionWaiter] = None
        self._stream: Optional[ServoStream] = None
        self._servo_end = ""
        self._jog_watchdog = JogWatchdog(settings.jog_timeout, self._jog_expired)

    # ---- life ----

    def start(self) -> None:
        """Begin to connect; returns at once, and the links are kept up until ``close``."""
        self._links.start()

    def close(self) -> None:
        """Stop what this driver moves, end every pending call, disconnect."""
        self._is_closing = True
        with self._dispatch:
            self._drop_unsent(StopCause.SHUTDOWN)
        if self._ownership.owner is not None:
            try:
                self._stop(StopCause.SHUTDOWN)
            except JakaError as error:
                _LOG.error("the arm could not be stopped at shut-down: %s", error)
                self._links.must_stop_first = True
        self._end_motion(MotionInterrupted(StopCause.SHUTDOWN))
        self._jog_watchdog.close()
        self._links.close()

    # ---- what is known ----

    @property
    def link_health(self) -> LinkHealth:
        """How the links to the controller do."""
        return self._links.health()

    @property
    def is_ready(self) -> bool:
        """Both links are up and the state is fresh."""
        return self._links.is_up and self.status.fresh_state(self.settings.stale_after) is not None

    @property
    def is_servo_active(self) -> bool:
        """The controller is in servo mode."""
        return self._links.is_servo_active

    @property
    def motion_owner(self) -> Optional[MotionOwner]:
        """What moves the arm on behalf of this driver."""
        return self._ownership.owner

    @property
    def late_servo_cycles(self) -> int:
        """Cycles of the present servo stream that came too late to be sent."""
        stream = self._stream
        return stream.late_cycles if stream is not None else 0

    def fresh_state(self) -> RobotState:
        """The newest state.

        Raises:
            ConnectionLost: It is stale, or there is none.
        """
        state = self.status.fresh_state(self.settings.stale_after)
        if state is None:
            raise ConnectionLost("no fresh status of the arm: " + (
                self.link_health.last_error or "the status feed is silent"))
        return state

    # ---- asking and setting ----

    def execute(self, command: c.Command) -> Any:
        """Audit a command that moves nothing, send it, and return the controller's answer.

        Raises:
            InvalidCommand: It breaks a limit; nothing was sent.
            CommandRejected: The controller refused it.
            ReplyTimeout: No reply in time.
            ConnectionLost: The link is down.
            ProtocolError: The reply does not hold the answer.
        """
        limits.check(command, self.model)
        stream = self._stream
        if stream is not None and isinstance(command, _FRAME_COMMANDS):
            stream.hold_joints()
        return self._links.command.request(command)

    def require_free(self) -> RobotState:
        """See that the arm could move, and that nobody moves it.

        Raises:
            InvalidCommand: Otherwise.
            ConnectionLost: That is not known.
        """
        state = self._require_ready_to_move()
        if self._ownership.owner is not None:
            raise InvalidCommand("refused: %s owns the arm's motion" % self._ownership.owner.value)
        return state

    # ---- motion ----

    def move(self, command: c.Motion, wait: bool = True) -> None:
        """Move to the command's target; with ``wait`` until the arm is there, else until the controller accepts.

        Raises:
            InvalidCommand: Outside the limits, or the arm cannot move now; nothing was sent.
            CommandRejected: The controller refused it.
            MotionInterrupted: It was accepted and did not complete.
            ReplyTimeout, ConnectionLost: As ``execute``.
        """
        stops = self._stops
        limits.check(command, self.model)
        state = self._require_ready_to_move()
        self._ownership.claim(MotionOwner.MOVE, may_share=not wait)
        waiter = self._begin_motion(command, MotionOwner.MOVE, stops, state, self.settings.motion_timeout)
        if wait:
            waiter.wait()

    def jog(self, command: c.Jog) -> None:
        """Begin a jog, or keep the same one going; it ends ``jog_timeout`` after the last call.

        Raises:
            As ``move``.
        """
        with self._jog_calls:
            stops = self._stops
            limits.check(command, self.model)
            state = self._require_ready_to_move()
            if self._jog_watchdog.keep_going(command):
                return
            running = self._jog_watchdog.end()
            if running is not None:
                self._stop_jog(running)
                if self.status.wait_for(lambda s: s.is_in_position, _REST_TIMEOUT) is None:
                    raise MotionInterrupted(StopCause.TIMEOUT, "the jog before did not come to rest")
                self._end_motion(None)
            self._ownership.claim(MotionOwner.JOG)
            self._jog_watchdog.begin(command)
            self._begin_motion(command, MotionOwner.JOG, stops, state, float("inf"))

    def set_servo_mode(self, active: bool) -> None:
        """Enter servo mode and hold the arm there, or leave it; returns when the controller confirms.

        Raises:
            As ``move``; MotionInterrupted when the controller does not follow within 2 s.
        """
        with self._servo_calls:
            if active:
                self._enter_servo_mode()
            else:
                self._leave_servo_mode()

    def servo_target(self, command: Union[c.ServoJoint, c.ServoPose]) -> None:
        """Take one target into the servo stream.

        Raises:
            InvalidCommand: Not in servo mode, outside the limits, or too far from the last target; nothing moves.
        """
        stream = self._stream
        if stream is None:
            raise InvalidCommand("refused: not in servo mode; servo_move_enable first" + (
                " (it ended: %s)" % self._servo_end if self._servo_end else ""))
        limits.check(command, self.model, self.status.state)
        stream.set_target(command)

    def stop(self) -> None:
        """Stop all motion, queued motion and programs; leaves servo mode.

        Raises:
            ConnectionLost, ReplyTimeout: The stop could not be delivered.
            CommandRejected: The controller refused it.
        """
        self._stop(StopCause.STOPPED)

    # ---- inside ----

    def _require_ready_to_move(self) -> RobotState:
        if self._is_closing:
            raise ConnectionLost("the driver is shutting down")
        state = self.fresh_state()
        cause = standing_cause(state)
        if cause is not None:
            raise InvalidCommand("refused, the arm cannot move: %s" % cause)
        if state.is_hand_guided:
            raise InvalidCommand("refused: hand guiding owns the arm's motion; switch it off first")
        if not self._links.is_up:
            raise ConnectionLost("no link to the controller: " + self.link_health.last_error)
        return state

    def _begin_motion(self, command: c.Command, owner: MotionOwner, stops: int, state: RobotState,
                      timeout: float) -> MotionWaiter:
        """Send a motion that its owner has claimed; it is given back where the controller does not take it.

        Where the link goes down before the reply, the arm may be moving: the owner keeps it for ``_command_lost``.
        """
        link, pending = self._send_claimed(command, owner, stops)
        try:
            link.finish(pending)
            waiter = MotionWaiter(command, timeout, time.monotonic(), state,
                                  lambda ended: self._motion_ended(ended, owner))
            with self._dispatch:
                self._require_no_stop_since(stops)
                self._waiter = waiter
            return waiter
        except (CommandRejected, MotionInterrupted, ProtocolError) as error:
            if isinstance(error, ProtocolError):
                self._post_stop(StopCause.FAULT)
            self._give_back(owner)
            raise

    def _send_claimed(self, command: c.Command, owner: MotionOwner, stops: int) -> Tuple[CommandLink, Pending]:
        try:
            with self._dispatch:
                self._require_no_stop_since(stops)
                link = self._links.command
                return link, link.begin([command])[0]
        except JakaError:
            self._give_back(owner)
            raise

    def _give_back(self, owner: MotionOwner) -> None:
        if self._waiter is None:
            self._motion_over(owner)

    def _require_no_stop_since(self, stops: int) -> None:
        if self._stops != stops:
            raise MotionInterrupted(self._last_stop)

    def _motion_ended(self, waiter: MotionWaiter, owner: MotionOwner) -> None:
        if self._waiter is not waiter:
            return
        self._waiter = None
        if waiter.is_over_time:
            self._post_stop(StopCause.TIMEOUT)
        self._motion_over(owner)

    def _motion_over(self, owner: MotionOwner) -> None:
        if owner is MotionOwner.JOG:
            self._jog_watchdog.end()
        self._ownership.release(owner)

    def _end_motion(self, outcome: Optional[MotionInterrupted]) -> None:
        waiter = self._waiter
        if waiter is not None:
            waiter.end(outcome)

    def _stop(self, cause: StopCause) -> None:
        with self._dispatch:
            self._drop_unsent(cause)
            jog = self._jog_watchdog.running
            halts = self._take_halts()
            link = self._links.command
            pendings = link.begin(halts)
        for pending in pendings[:-1]:
            self._finish_quietly(link.finish, pending)
        try:
            link.finish(pendings[-1])
        except CommandRejected:
            if jog is not None:
                self._jog_watchdog.begin(jog, within=_RETRY_PERIOD)
            raise
        self._end_motion(MotionInterrupted(cause))
        self._ownership.release(MotionOwner.SERVO)

    def _post_stop(self, cause: StopCause) -> None:
        """Send a stop from a thread that must not wait; ``_check_posted_stop`` sees to its reply."""
        with self._dispatch:
            self._drop_unsent(cause)
            try:
                link = self._links.command
                self._posted_stop = link, link.begin(self._take_halts())[-1]
            except JakaError as error:
                _LOG.error("the arm could not be stopped: %s", error)
                self._links.must_stop_first = True

    def _check_posted_stop(self) -> None:
        posted = self._posted_stop
        if posted is not None and posted[1].reply is not None:
            self._posted_stop = None
            try:
                posted[0].finish(posted[1])
            except JakaError as error:
                _LOG.error("the arm could not be stopped: %s", error)

    def _drop_unsent(self, cause: StopCause) -> None:
        """What was asked for before is not sent any more; the dispatch lock is held."""
        self._stops += 1
        self._last_stop = cause

    def _take_halts(self) -> List[c.Command]:
        """What ends the motion under way, in order; nothing sends any more of it. The dispatch lock is held."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.stop()
        halts: List[c.Command] = []
        if self.is_servo_active or self._ownership.owner is MotionOwner.SERVO:
            halts.append(c.SetServoMode(False))
        jog = self._jog_watchdog.end()
        if jog is not None:
            halts.append(c.JogStop(jog.frame, jog.axis))
        return halts + [c.Stop()]

    @staticmethod
    def _finish_quietly(finish: Callable[[Pending], Any], pending: Pending) -> None:
        try:
            finish(pending)
        except CommandRejected as rejection:
            _LOG.info("%s", rejection)

    def _jog_expired(self, jog: c.Jog) -> None:
        _LOG.info("jog watchdog: no jog call for %.1f s, stopping", self.settings.jog_timeout)
        try:
            self._stop_jog(jog)
        except JakaError as error:
            _LOG.error("the jog could not be stopped, trying again: %s", error)

    def _stop_jog(self, jog: c.Jog) -> None:
        """Stop this jog; where the controller does not, the watchdog tries again until it does or the link is down."""
        try:
            with self._dispatch:
                link = self._links.command
                pendings = link.begin([c.JogStop(jog.frame, jog.axis), c.Stop()])
            self._finish_quietly(link.finish, pendings[0])
            link.finish(pendings[1])
        except (CommandRejected, ProtocolError):
            self._jog_watchdog.begin(jog, within=_RETRY_PERIOD)
            raise

    def _enter_servo_mode(self) -> None:
        if self._stream is not None:
            return
        stops = self._stops
        state = self.require_free()
        if not state.is_in_position:
            raise InvalidCommand("refused: the arm is moving; servo mode can be entered at rest only")
        self._ownership.claim(MotionOwner.SERVO)
        link, pending = self._send_claimed(c.SetServoMode(True), MotionOwner.SERVO, stops)
        try:
            link.finish(pending)
            self._await_servo_mode(True)
            stream = ServoStream(self.model, self.settings, lambda frame: self._send_frame(stream, frame),
                                 lambda: self.status.fresh_state(self.settings.stale_after),
                                 lambda reason: self._servo_ended(stream, reason))
            with self._dispatch:
                self._require_no_stop_since(stops)
                self._stream = stream
                self._servo_end = ""
            stream.start(self.fresh_state())
        except JakaError:
            self._stream = None
            try:
                self._leave_servo_mode()
            except JakaError as error:
                _LOG.warning("servo mode: %s", error)
            raise

    def _leave_servo_mode(self) -> None:
        with self._dispatch:
            stream, self._stream = self._stream, None
        if stream is not None:
            stream.stop()
            stream.join()
        try:
            self._links.command.request(c.SetServoMode(False))
            self._await_servo_mode(False)
        except (CommandRejected, MotionInterrupted, ProtocolError):
            self._ownership.release(MotionOwner.SERVO)
            raise
        self._ownership.release(MotionOwner.SERVO)

    def _await_servo_mode(self, active: bool) -> None:
        deadline = time.monotonic() + _SERVO_TIMEOUT
        while bool(self._links.command.request(c.Query.SERVO_MODE)) is not active:
            if time.monotonic() > deadline:
                raise MotionInterrupted(StopCause.TIMEOUT, "the controller did not %s servo mode"
                                        % ("enter" if active else "leave"))
            time.sleep(_POLL_PERIOD)
        self._links.is_servo_active = active

    def _send_frame(self, stream: ServoStream, frame: Union[c.ServoJoint, c.ServoPose]) -> bool:
        with self._dispatch:
            if self._stream is not stream:
                return False
            self._links.command.post(frame, stream.rejected)
            return True

    def _servo_ended(self, stream: ServoStream, reason: str) -> None:
        with self._dispatch:
            if self._stream is not stream:
                return
            self._stream = None
        self._servo_end = reason
        try:
            self._leave_servo_mode()
        except CommandRejected as rejection:
            _LOG.warning("%s", rejection)
        except JakaError as error:
            _LOG.error("servo mode could not be left: %s", error)

    def _observe(self, state: RobotState, is_new: bool) -> None:
        waiter = self._waiter
        if waiter is not None:
            waiter.observe(state)
        stream = self._stream
        if stream is not None:
            cause, deviation = standing_cause(state), stream.deviation(state)
            if cause is not None:
                stream.rejected(CommandRejected("servo", "none", str(cause)))
            elif deviation:
                self._servo_end = deviation
                _LOG.error("%s: stopping it", deviation)
                self._post_stop(StopCause.FAULT)
                self._ownership.release(MotionOwner.SERVO)

    def _command_lost(self, reason: str) -> None:
        posted, self._posted_stop = self._posted_stop, None
        if self._ownership.owner is not None or (posted is not None and posted[1].reply is None):
            self._links.must_stop_first = True
        self._drop_motion(reason)

    def _status_lost(self, reason: str) -> None:
        if self._ownership.owner is not None and not self._is_closing:
            _LOG.error("the arm moves unseen, stopping it: %s", reason)
            self._post_stop(StopCause.LINK_LOST)
            self._drop_motion(reason)

    def _check_sight(self) -> None:
        """Called regularly: a feed of which nothing can be read is as good as none."""
        self._check_posted_stop()
        self._ownership.tell()
        if self._ownership.owner is not None and self.status.fresh_state(self.settings.silence_timeout) is None:
            self._status_lost("no readable status frame for %.1f s" % self.settings.silence_timeout)

    def _drop_motion(self, reason: str) -> None:
        with self._dispatch:
            self._drop_unsent(StopCause.LINK_LOST)
            self._take_halts()
        self._end_motion(MotionInterrupted(StopCause.LINK_LOST, reason))
        owner = self._ownership.owner
        if owner is not None:
            self._ownership.release(owner)
