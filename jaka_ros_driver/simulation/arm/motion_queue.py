"""The queue of accepted moves, and the jog that may run in its place."""
from collections import deque
from typing import Deque, List, NamedTuple, Optional, Tuple

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent, TargetRejected
from jaka_ros_driver.simulation.arm.follower import Follower
from jaka_ros_driver.simulation.arm.frames import ArmFrames
from jaka_ros_driver.simulation.arm.legs import Leg
from jaka_ros_driver.simulation.arm.profiles import JERK_TIME_S, jerk_time
from jaka_ros_driver.simulation.arm.routes import CartesianRoute, JointRoute, Route
from jaka_ros_driver.state import Vector

MAX_QUEUE = 500
"""Most motions that wait: no source names a bound, and without one a client could fill the memory."""
_SAME_MOMENT_S = 1e-6
"""Allowance for rounding, s."""

JogAxis = Tuple[JogFrame, int, bool]
"""Frame, axis 0..5, and True for the positive direction."""


class _Entry(NamedTuple):
    route: Route
    jog: Optional[JogAxis] = None


class MotionQueue:
    """The queue that runs routes one after the other. A stopped route slows down first; then the next one begins.

    Attributes:
        jerk_limited: True where moves and jogs that are added from now on have a limited jerk, given ruckig.
        is_paused: True from ``pause`` until ``resume`` or the end of the queue.
        motion_line: ``executing_line_id`` of the move running or last run.
        blends_joint_moves: A joint move that may pass its end is joined with the next one, where that goes on along the
            same line with the same limits.
        jerk_seconds: How long the acceleration of moves and jogs builds up, s, where their jerk is limited.
        start_delay: From the acceptance of a motion by an arm at rest to its beginning, s.
        braking_share: Deceleration of stops and pauses, as a share of the strongest that the model allows.
        fault: Set where the arm cannot go on along the running path; the owner then brings it to rest and calls
            ``clear``.
    """

    def __init__(self, frames: ArmFrames) -> None:
        self.jerk_limited = True
        self.blends_joint_moves = False
        self.jerk_seconds = JERK_TIME_S
        self.start_delay = 0.0
        self.braking_share = 1.0
        self._start_in = 0.0
        self.is_paused = False
        self.motion_line = 0
        self.fault: Optional[PlantEvent] = None
        self._frames = frames
        self._running: Optional[Follower] = None
        self._running_jog: Optional[JogAxis] = None
        self._rest: Optional[Vector] = None
        self._waiting: Deque[_Entry] = deque()

    @property
    def is_empty(self) -> bool:
        """True when nothing runs or waits."""
        return self._running is None and not self._waiting

    @property
    def is_jogging(self) -> bool:
        """True while a jog runs, slows down or waits for the arm to stand."""
        return self._running_jog is not None or any(entry.jog for entry in self._waiting)

    @property
    def length(self) -> int:
        """The number of moves not yet completed; jogs and stopped moves do not count."""
        waiting = sum(1 for entry in self._waiting if entry.jog is None)
        running = self._running
        if running is None or running.is_ending or self._running_jog is not None:
            return waiting
        return waiting + running.route.moves_left(running.way)

    def end_joints(self, standing_at: Vector) -> Vector:
        """Return the arm's position when the queue is empty, rad (6,)."""
        if self._waiting:
            return self._waiting[-1].route.end_joints
        if self._running is None:
            return standing_at
        return self._rest if self._rest is not None else self._running.route.end_joints

    def add_joint_route(self, route: JointRoute) -> None:
        """Queue a joint motion; raise TargetRejected while a jog runs, or where the queue is full."""
        self._check_room()
        if not self.blends_joint_moves or not self._is_joined(route):
            self._enter(_Entry(route))

    def _is_joined(self, route: JointRoute) -> bool:
        """Join a joint motion to the last motion; return False where that is not possible."""
        if self._waiting:
            last = self._waiting[-1].route
            longer = last.joined(route, 0.0) if isinstance(last, JointRoute) and self._waiting[-1].jog is None else None
            if longer is not None:
                self._waiting[-1] = _Entry(longer)
            return longer is not None
        running = self._running
        if running is None or running.is_ending or self._running_jog is not None:
            return False
        longer = running.route.joined(route, running.way) if isinstance(running.route, JointRoute) else None
        return longer is not None and running.take_limits_of(longer)

    def add_leg(self, leg: Leg, start_joints: Vector) -> None:
        """Queue a Cartesian motion; the corner before it is rounded where tolerance and the way left allow it.

        Raises:
            TargetRejected: A jog runs, the queue is full, or the path breaks off where it begins.
        """
        self._check_room()
        if self._waiting:
            last = self._waiting[-1].route
            if isinstance(last, CartesianRoute) and last.append(leg, 0.0, 0.0, self._jerk_time):
                return
        elif self._running is not None and not self._running.is_ending:
            running = self._running
            if isinstance(running.route, CartesianRoute) and running.route.append(
                    leg, running.way, running.speed, self._jerk_time):
                return
        route = CartesianRoute(self._frames, leg, start_joints)
        if route.break_event is not None and route.length < 1e-6:
            raise TargetRejected(_of_move(route.break_event))
        self._enter(_Entry(route))

    @property
    def _jerk_time(self) -> float:
        return jerk_time(self.jerk_limited, self.jerk_seconds)

    @property
    def takes_jog(self) -> bool:
        """True where nothing waits, and nothing runs but a stopped motion."""
        return not self._waiting and (self._running is None or self._running.is_ending)

    def start_jog(self, axis: JogAxis, route: Route) -> None:
        """Start a jog as soon as the arm stands. Call it only where ``takes_jog`` is True."""
        self._enter(_Entry(route, axis))

    def change_jog(self, route: Route) -> bool:
        """Continue the running jog with the limits of this route; return False where no jog runs or the geometries
        differ.
        """
        return self._running is not None and self._running.take_limits_of(route)

    def running_jog_start(self, axis: JogAxis) -> Optional[Vector]:
        """Return the joints where the jog of this axis began; None unless it runs."""
        if self._running is None or self._running_jog != axis or self._running.is_ending:
            return None
        return self._running.route.start_joints

    def end_jog(self, frame: JogFrame, axis: int) -> None:
        """Stop the jog of this frame and axis, in whichever direction it moves."""
        self._waiting = deque(entry for entry in self._waiting if entry.jog is None or entry.jog[:2] != (frame, axis))
        if self._running_jog is not None and self._running_jog[:2] == (frame, axis):
            self._end_running()

    def pause(self) -> None:
        """Slow down along the path and hold; no effect where nothing is queued."""
        self.is_paused = self.length > 0

    def resume(self) -> None:
        self.is_paused = False

    def stop(self) -> None:
        """Slow down along the path and empty the queue."""
        self._waiting.clear()
        self.is_paused = False
        self._end_running()

    def clear(self) -> None:
        """Empty the queue at once; the owner brings the arm to rest."""
        self._waiting.clear()
        self.is_paused = False
        self._running = self._running_jog = self._rest = self.fault = None

    def step(self, dt: float, rate: float) -> Tuple[Optional[Vector], List[PlantEvent]]:
        """Run one cycle of ``dt`` s at ``rate`` (0 to 1); return the joints, rad (6,), None at rest, and the events."""
        if self._running is None:
            self._start_in -= dt
            if not self._waiting or self._start_in > _SAME_MOMENT_S:
                return None, []
            self._start(self._waiting.popleft())
        running = self._running
        assert running is not None
        joints = running.step(dt, 0.0 if self.is_paused else rate)
        if running.fault is not None:
            self.fault = running.fault if self._running_jog else _of_move(running.fault)
            return None, [self.fault]
        if self._running_jog is None:
            self.motion_line = running.route.line_id_at(running.way)
        if not running.is_done:
            return joints, []
        joints = joints if self._rest is None or running.is_at_end else self._rest
        return joints, self._finish(running)

    def _finish(self, running: Follower) -> List[PlantEvent]:
        broken = running.route.break_event if running.is_at_end else None
        jog = self._running_jog
        self._running = self._running_jog = self._rest = None
        happened: List[PlantEvent] = []
        if broken is not None:
            self._waiting.clear()
            happened.append(events.of_jog(broken) if jog else _of_move(broken))
        if not self._waiting:
            self.is_paused = False
        return happened

    def _check_room(self) -> None:
        if self.is_jogging and not (self._running is not None and self._running.is_ending and not self._waiting):
            raise TargetRejected(events.JOINT_MOVE_NOT_ADDED, "a jog is running")
        if self.length >= MAX_QUEUE:
            raise TargetRejected(events.JOINT_MOVE_NOT_ADDED, "the queue is full")

    def _enter(self, entry: _Entry) -> None:
        if self._running is None and not self._waiting:
            if self.start_delay > 0.0:
                self._start_in = self.start_delay
                self._waiting.append(entry)
            else:
                self._start(entry)
        else:
            self._waiting.append(entry)

    def _start(self, entry: _Entry) -> None:
        self._running = Follower(entry.route, self._frames.model.joint_max_speed, self.jerk_limited,
                                 self.braking_share, self.jerk_seconds)
        self._running_jog = entry.jog

    def _end_running(self) -> None:
        if self._running is not None and not self._running.is_ending:
            self._rest = self._running.end()


def _of_move(cause: PlantEvent) -> PlantEvent:
    """Return the event that a planned move reports where its path ends for this cause."""
    return events.SINGULARITY_PROTECTIVE_STOP if cause == events.SINGULARITY else events.LINEAR_MOVE_FAILED
