"""The arm while a stage moves it: what is sent and seen, the room that it must not leave, and how it is stopped.

Before the first byte of a motion the guard process of the driver is informed, and it is informed every 20 ms that this
process lives: it stops the arm where that ends. Here the arm is stopped as the guard stops it, by ``Stopping``, until
it is seen at rest. Every frame of the feed is held against the room; leaving it, a feed that ends and Ctrl-C stop it.
"""
import math
import select
import time
from typing import Callable, List, NamedTuple, Optional

from jaka_ros_driver.client.driver_pipe import STARVED_TIMEOUT_S
from jaka_ros_driver.client.guard import Guard
from jaka_ros_driver.client.stopping import DriverCondition, Step, Stopping
from jaka_ros_driver.commands import Command, ServoJoint
from jaka_ros_driver.errors import FramingError, JakaError
from jaka_ros_driver.probe.look import HeardFeed
from jaka_ros_driver.probe.recorded import ConnectionLog, KeptConnection
from jaka_ros_driver.probe.set_same import SetBack, is_interrupted, uninterrupted
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.framing import JsonObject, ObjectStream, encode_object
from jaka_ros_driver.state import RobotState, Vector
from jaka_ros_driver.units import deg_to_rad

ROOM_RAD = deg_to_rad(3.5)
"""Largest distance of a joint from where the stage began: 3 deg that are commanded, and what a stop takes."""
OTHERS_RAD = deg_to_rad(0.2)
"""The same for a joint that does not move. Where the feed has no position of the tool, these two bound its way: 2 m of
reach and five joints make 35 mm, and the joint that moves swings a tool by 20 mm at most.
"""
ROOM_M = 0.06
"""Radius of the sphere around the start that the tool must not leave."""
CYCLE_S = 0.008
"""The controller's cycle, s (docs/controller-protocol.md)."""
FASTEST = deg_to_rad(6.5)
"""Highest speed of a servo frame, rad/s."""
REST_RAD = 1e-4
"""Largest change, rad, of a joint at rest."""
_SILENT_S = 0.5
"""Age, s, of the newest frame at which an arm that moves is stopped."""
_TURN_S = 0.004
"""Longest wait, s, before the next look whether the arm must be stopped: half a cycle."""
_ANSWER_S = 3.0
"""Longest wait, s, for an answer while nothing moves."""
_GUARD_S = 10.0
"""Longest wait, s, for the guard's first answer."""
_UNSEEN = "the arm was not seen at rest: use the emergency stop"


class MotionEnded(JakaError):
    """The reason why a motion was ended before its time."""


class Seen(NamedTuple):
    """One frame: its time, monotonic s; the joint that moves, rad; ``inpos``; whether a fault stands."""

    at: float
    position: float
    is_in_position: bool
    has_fault: bool


class Mover:
    """The arm, its command port, and the guard.

    Attributes:
        back: Takes what could not be set back.
        start: Joints at the beginning, rad (6,).
        seen: What the feed has shown since ``begin``, oldest first.
        furthest_m: Largest distance of the tool from its start, m.
        furthest_rad: Largest distance of a joint from its start, rad.
        put_back: A setting, sent when the arm rests after the step that has changed it; None for none.
        needs_drives: The arm is stopped where it is not powered and enabled.
    """

    def __init__(self, record: ConnectionLog, command_port: int, feed: HeardFeed, guard: Guard, axis: int,
                 log: Callable[[str], None], back: Optional[SetBack] = None) -> None:
        """Take the arm as the newest frame shows it.

        Args:
            record: Has the connections.
            command_port: TCP port.
            feed: The status feed, with at least one state.
            guard: Is informed of each motion.
            axis: The joint that moves, 0 to 5.
            log: Takes what a stop says.
            back: Takes that the arm was not seen at rest, also where a signal or a defect ends the step.
        """
        self.back = SetBack() if back is None else back
        self._record, self._port, self._feed, self._guard, self._log = record, command_port, feed, guard, log
        self._axis = axis
        self._begun = feed.states[-1]
        self.start: Vector = self._begun.joint_position
        self.seen: List[Seen] = []
        self.furthest_m = self.furthest_rad = 0.0
        self.put_back: Optional[Command] = None
        self.needs_drives = True
        self._trouble = ""
        self._turned_at, self._guard_trouble = time.monotonic(), guard.health().last_trouble
        self._stopping: Optional[Stopping] = None
        self._command: Optional[KeptConnection] = None
        self._stream = ObjectStream()
        self._items: List[JsonObject] = []
        feed.on_state = self._take

    def close(self) -> None:
        """Close the command port, and take no more frames."""
        self._feed.on_state = None
        self.hang_up()

    # ---- what is seen ----

    @property
    def state(self) -> RobotState:
        """The newest state."""
        return self._feed.states[-1]

    @property
    def position(self) -> float:
        """The joint that moves, rad, in the newest state."""
        return self.state.joint_position[self._axis]

    def _take(self, state: RobotState) -> None:
        self.seen.append(Seen(state.received_at, state.joint_position[self._axis], state.is_in_position,
                              state.has_fault))
        if self._stopping is not None:
            self._stopping.saw(state, state.received_at)
        self._trouble = self._trouble or self._why_outside(state)

    def _why_outside(self, state: RobotState) -> str:
        """Return why a state is not in the room, or not that of an arm in good order; "" where it is."""
        ways = [abs(a - b) for a, b in zip(state.joint_position, self.start)]
        self.furthest_rad = max([self.furthest_rad, *ways])
        for joint, way in enumerate(ways):
            if way > (ROOM_RAD if joint == self._axis else OTHERS_RAD):
                return "joint %d was %.1f deg from its start" % (joint + 1, math.degrees(way))
        begun = self._begun
        if (state.tool_id, state.user_frame_id) != (begun.tool_id, begun.user_frame_id):
            return "somebody changed the tool or the user frame"
        if begun.tcp_position is not None:
            if state.tcp_position is None:
                return "the feed has no position of the tool any more"
            self.furthest_m = max(self.furthest_m, math.dist(state.tcp_position, begun.tcp_position))
        if self.furthest_m > ROOM_M:
            return "the tool was %.0f mm from its start" % (1000.0 * self.furthest_m)
        if self.needs_drives and (
                not state.is_powered or not state.is_enabled or state.emergency_stop or state.protective_stop):
            return "the arm is not enabled any more"
        return ""

    # ---- time ----

    def turn(self, seconds: float = _TURN_S) -> None:
        """Read what comes within this time, s; raise MotionEnded where the arm must stop."""
        held_up, self._turned_at = time.monotonic() - self._turned_at, time.monotonic()
        self._read(seconds)
        if self._trouble:
            raise MotionEnded(self._trouble)
        if is_interrupted():
            raise MotionEnded("Ctrl-C, or another signal")
        trouble = self._guard.health().last_trouble
        if trouble != self._guard_trouble:
            raise MotionEnded("the guard process: " + trouble)
        if held_up > STARVED_TIMEOUT_S:
            raise MotionEnded("this process was held up for %.1f s" % held_up)
        if time.monotonic() - self.state.received_at > _SILENT_S:
            raise MotionEnded("no frame came for %.1f s" % _SILENT_S)

    def idle(self) -> None:
        """Read what has come while nothing moves."""
        self._read(_TURN_S)
        self.seen = self.seen[-1:]

    def _read(self, seconds: float) -> None:
        self._guard.beat(time.monotonic())
        wanted = [one for one in (self._feed.connection, self._command) if one is not None and not one.is_closed]
        ready, _, _ = select.select(wanted, [], [], seconds)
        if self._feed.connection in ready:
            self._feed.read()
        if self._command is not None and self._command in ready:
            for item in self._stream.feed(self._command.receive_now()):
                if self._stopping is not None:
                    self._stopping.replied(item, time.monotonic())
                elif not isinstance(item, FramingError):
                    self._items.append(item)

    def wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Wait until something is true, at most this long, s; return whether it is."""
        deadline = time.monotonic() + seconds
        while not until():
            left = deadline - time.monotonic()
            if left <= 0.0:
                return False
            self.turn(min(left, _TURN_S))
        return True

    def has_rested(self, seconds: float, after: float = -math.inf) -> bool:
        """Return whether all frames of the last time, s, and of at least two, show the joint at one place."""
        newest = self.seen[-1].at
        places = [one.position for one in self.seen if one.at >= max(after, newest - seconds)]
        return len(places) > 2 and max(places) - min(places) <= REST_RAD and newest - seconds >= after

    # ---- what is sent ----

    def ask(self, command: Command, patience: float = _ANSWER_S) -> Optional[JsonObject]:
        """Send a command and wait for its reply; None where none comes."""
        name = codec.command_name(command)
        self._items = [item for item in self._items if item.get("cmdName") != name]
        self.send(encode_object(codec.encode(command)))
        found: List[JsonObject] = []

        def answered() -> bool:
            found.extend(item for item in self._items if item.get("cmdName", name) == name)
            self._items = []
            return bool(found)
        return found[0] if self.wait(patience, answered) else None

    def require(self, command: Command) -> JsonObject:
        """Send a command that must be accepted; raise MotionEnded where it is not."""
        reply = self.ask(command)
        if reply is None:
            raise MotionEnded("%s was not answered" % codec.command_name(command))
        try:
            codec.raise_if_rejected(codec.command_name(command), reply)
        except JakaError as error:
            raise MotionEnded(str(error)) from error
        return reply

    def is_taken(self, command: Command) -> bool:
        """Send a command; return whether it was accepted."""
        try:
            self.require(command)
        except MotionEnded:
            self.turn()  # raises where it was not the refusal that ended it
            return False
        return True

    def stream(self, position: float, cycles: int) -> None:
        """Send a servo frame that brings the joint here, rad, within so many cycles, and wait until it is over.

        The next one comes two cycles later, because a controller may ignore one that comes while another runs.
        """
        frame = self.frame(position, cycles)
        self.send(encode_object(codec.encode(frame)))
        self.wait((frame.cycles + 2) * CYCLE_S)

    def frame(self, position: float, cycles: int) -> ServoJoint:
        """Return a servo frame that brings the joint here, rad, within so many cycles, or more where it would be fast.

        A stream that ran dry may have gone on meanwhile.
        """
        slowest = math.ceil(abs(position - self.position) / (FASTEST * CYCLE_S))
        return ServoJoint(self.joints(position), cycles=max(cycles, slowest))

    def joints(self, position: float) -> Vector:
        """Return the joints of the start, rad (6,), with the one that moves here."""
        return (*self.start[:self._axis], position, *self.start[self._axis + 1:])

    def send(self, data: bytes) -> None:
        """Send bytes; raise MotionEnded where the command port is lost."""
        try:
            self._connect()
        except OSError as error:
            raise MotionEnded("the command port: %s" % error) from error
        if self._command is None or not self._command.send(data):
            raise MotionEnded("the command port was closed")

    def _connect(self) -> None:
        if self._command is None or self._command.is_closed:
            self.hang_up()
            self._command = self._record.connect("command", self._port)

    def hang_up(self) -> None:
        """Close the command port; the next command connects it again."""
        if self._command is not None:
            self._command.close()
        self._command, self._stream, self._items = None, ObjectStream(), []

    # ---- custody ----

    def run(self, step: Callable[[], None]) -> str:
        """Run a step that moves the arm, and bring it to rest; return why it was ended before its time, "" for not.

        Ctrl-C is taken when the arm rests.

        Raises:
            MotionEnded: The arm was not seen at rest: the guard goes on to stop it when this process ends.
        """
        why = ""
        with uninterrupted():
            self._wait_for_guard()
            self.seen = self.seen[-1:]
            self._guard.notify(True)
            self._turned_at, self._guard_trouble = time.monotonic(), self._guard.health().last_trouble
            try:
                self.turn()
                step()
            except MotionEnded as ended:
                why = str(ended)
            finally:
                try:
                    has_seen_rest = self._end_motion()
                finally:
                    self._put_back()
        if not has_seen_rest:
            raise MotionEnded(_UNSEEN)
        return why

    def _end_motion(self) -> bool:
        """Bring the arm to rest; return whether it was seen there.

        Where it was not, that is noted and said here, before a put-off signal can end the process.
        """
        has_seen_rest = False
        try:
            has_seen_rest = self._come_to_rest()
        finally:
            if has_seen_rest:
                self._guard.notify(False)
            else:
                self.back.left.append(_UNSEEN)
                self._log(_UNSEEN)
        return has_seen_rest

    def _put_back(self) -> None:
        """Send the setting that is to be put back, whatever has ended the step, and note where it is not accepted."""
        command, self.put_back = self.put_back, None
        if command is None:
            return
        name, self._items = codec.command_name(command), []
        deadline = time.monotonic() + _ANSWER_S
        why = "no answer"
        try:
            self.send(encode_object(codec.encode(command)))
            while why and time.monotonic() < deadline:
                self._read(_TURN_S)
                for item in self._items:
                    if item.get("cmdName") == name:
                        codec.raise_if_rejected(name, item)
                        why = ""
        except JakaError as error:
            why = str(error)
        if why:
            self.back.left.append("%s was not put back: %s" % (name, why))

    def _wait_for_guard(self) -> None:
        deadline = time.monotonic() + _GUARD_S
        while not self._guard.health().is_alive:
            if time.monotonic() > deadline:
                raise MotionEnded("the guard process does not answer: %s" % self._guard.health().last_trouble)
            self._read(_TURN_S)

    def _come_to_rest(self) -> bool:
        """Stop the arm as the guard does, until it is seen at rest; return False where it was not."""
        stopping = self._stopping = Stopping(time.monotonic(), self._log)
        try:
            while True:
                now = time.monotonic()
                step = stopping.step(now, DriverCondition.DEAD)
                if step is Step.FINISH:
                    return stopping.has_seen_rest
                if step is Step.HANG_UP:
                    self.hang_up()
                elif step is Step.SEND:
                    if self._command is None or not self._command.send(stopping.request(now)):
                        self.hang_up()
                        stopping.failed("the command port was closed", False, now)
                elif step is Step.CONNECT:
                    try:
                        self._connect()
                        stopping.connected()
                    except OSError as error:
                        stopping.failed(str(error), isinstance(error, ConnectionRefusedError), now)
                self._read(_TURN_S)
                if self._feed.connection.is_closed:
                    stopping.saw_nothing("the status port was closed")
                if self._command is not None and self._command.is_closed:
                    self.hang_up()
                    stopping.failed("the command port was closed", False, time.monotonic())
        finally:
            self._stopping = None
