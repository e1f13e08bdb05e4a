"""A planned move, or several that are queued: from acceptance to the target, in the evidence of the status feed."""
import math
from typing import Any, List, Optional

from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import Motion, MotionOwner, is_held, rest_time_at
from jaka_ros_driver.client.core.stillness import MOVEMENT, REST_TIME_S
from jaka_ros_driver.commands import JointMove, PathCommand
from jaka_ros_driver.commands import Motion as MoveCommand
from jaka_ros_driver.errors import CommandRejected, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between
from jaka_ros_driver.state import RobotState

START_WINDOW_S = 1.0
"""s; a motion that is accepted and not seen to begin within this time is stopped: it may not begin later."""
SETTLE_TIME_S = 0.3
"""s; an arm that rests away from its target for so long has been stopped by somebody else."""
_JOINT_TOLERANCE = 0.01
_POSITION_TOLERANCE = 0.002
_ANGLE_TOLERANCE = 0.02
_LONGEST_FRAME_TIME_S = 0.1
"""s; a feed in good order has a frame at least so often."""
_LEVER = 0.1
"""m; a joint whose turning moves the tool at a smaller radius does not count."""
NO_DISTANCE = 0.03
"""Of a tolerance: an arm that is as near as this may be there without having moved."""


class _Part:
    """One command of the queue, and the caller who has not been answered yet."""

    def __init__(self, command: MoveCommand, call: Any, waits: bool, end: Any = None) -> None:
        self.command = command
        self.call = call
        self.end = end
        self.waits = waits
        self.is_accepted = False
        self.is_answered = False
        self.was_reached = False


class Move(Motion):
    """Completed when the arm is at the last target and still; stopped when anything contradicts that it gets there."""

    owner = MotionOwner.MOVE
    is_paused = False
    """Paused by a call; the time in which it is does not count."""

    def __init__(self, custody: Custody, command: MoveCommand, call: Any, waits: bool, state: RobotState,
                 end: Any = None) -> None:
        """Prepare.

        Args:
            custody: Of this motion.
            command: The target.
            call: Who is answered.
            waits: The answer comes at the end; else with the controller's acceptance.
            state: Before the motion.
            end: Answered at the end, and not before ``call``; None for nobody.
        """
        self._custody = custody
        self._start = state
        self._parts = [_Part(command, call, waits, end)]
        self._target: Optional[MoveCommand] = None
        self._accepted_at = 0.0
        self._waits_since: Optional[float] = None
        self._held_at = 0.0
        self._has_moved = False
        self._must_move = False

    def begin(self, now: float) -> None:
        self._send(self._parts[0], now)

    def add(self, command: MoveCommand, call: Any, now: float, end: Any = None) -> None:
        """Queue another one behind those that are under way; answered with the controller's acceptance.

        Raises:
            JakaError: Nothing was sent.
        """
        part = _Part(command, call, waits=False, end=end)
        self._send(part, now)
        self._parts.append(part)

    def observe(self, state: RobotState, now: float) -> None:
        if self._target is None or state.received_at <= self._accepted_at:
            return
        if not self._has_moved:
            self._has_moved = _joint_distance(state, self._start) > MOVEMENT
        if self.is_paused or (self._has_moved and is_held(state)):
            self._held_at = now
        self._look_for_the_end(self._target, state, now)

    def tick(self, now: float) -> None:
        if self.is_paused:
            self.deadline = max(self.deadline, now + START_WINDOW_S)
        elif self._target is not None and now >= self.deadline:
            self._custody.stop(MotionInterrupted(
                StopCause.TIMEOUT, "not completed after %.0f s" % self._custody.settings.motion_timeout), now)

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        for part in self._parts:
            was_passed_over = outcome is None and len(self._parts) > 1 and not part.was_reached
            error = (MotionInterrupted(StopCause.STOPPED, "its target was not seen to be reached")
                     if was_passed_over else outcome)
            self._answer(part, error)
            self._end(part, error)

    # ---- inside ----

    def _send(self, part: _Part, now: float) -> None:
        self._custody.channel.request(part.command, now, lambda _, error, at: self._replied(part, error, at))

    def _replied(self, part: _Part, error: Optional[JakaError], now: float) -> None:
        if self._custody.motion is not self:
            return
        if error is None:
            part.is_accepted = True
            self._accepted(part, now)
            return
        self._answer(part, error)
        self._end(part, error)
        self._parts.remove(part)
        if not self._parts or not isinstance(error, CommandRejected):  # refused, it leaves the others of the queue
            self._custody.not_accepted(error, now)

    def _accepted(self, part: _Part, now: float) -> None:
        self._target = part.command
        self._accepted_at = now
        self._waits_since = now if self._waits_since is None else self._waits_since
        self.deadline = now + self._custody.settings.motion_timeout
        self.rest_time = rest_time_at(part.command.speed, not isinstance(part.command, JointMove))
        distance = relative_distance(part.command, self._start)
        self._must_move = self._must_move or (distance is not None and distance > NO_DISTANCE)
        if not part.waits and not self._custody.is_ending:
            self._answer(part, None)

    def _answer(self, part: _Part, error: Optional[JakaError]) -> None:
        if not part.is_answered:
            part.is_answered = True
            self._custody.actions.answer(part.call, None, error)

    def _end(self, part: _Part, error: Optional[JakaError]) -> None:
        end, part.end = part.end, None
        self._custody.actions.answer(end, None, error)

    def _look_for_the_end(self, target: MoveCommand, state: RobotState, now: float) -> None:
        """Measured positions decide. ``inpos`` delays the end by 1 s at most: what begins later is too late."""
        self._note_reached(state)
        still = self._custody.stillness.duration(max(self._accepted_at, self._held_at))
        if still < self.rest_time or not all(part.is_accepted for part in self._parts):
            return
        distance = relative_distance(target, state)
        has_run = self._has_moved or not self._must_move
        is_late = still >= max(START_WINDOW_S, self.rest_time)
        if has_run and distance is not None and distance <= 1.0:
            is_sure = self._was_run_through(distance)
            if is_sure and (state.is_in_position or (
                    distance <= NO_DISTANCE and still >= self.rest_time + SETTLE_TIME_S)):
                self._custody.finish(now)
            elif is_late:
                self._custody.stop(None, now)
        elif not self._has_moved:
            self._look_for_the_start(target, state, distance, now)
        elif not state.is_in_position and not is_late:
            return
        elif distance is None and state.is_in_position:
            self._custody.finish(now)
        elif distance is None:
            self._custody.stop(MotionInterrupted(
                StopCause.STOPPED, "the arm came to rest, and is not said to be in position"), now)
        elif still >= max(SETTLE_TIME_S, self.rest_time):
            self._custody.stop(MotionInterrupted(
                StopCause.STOPPED, "the arm came to rest %s from the target" % distance_text(target, state)), now)

    def _note_reached(self, state: RobotState) -> None:
        """Of a queue, each target is passed in its turn; all but the last one may be passed beside a rounded corner."""
        for part in self._parts:
            is_last = part is self._parts[-1]
            if not part.was_reached:
                distance = relative_distance(part.command, state)
                if not part.is_accepted or (distance is not None and distance > 1.0
                                            and (is_last or not _is_beside(part.command, state))):
                    return
                part.was_reached = True
            if not is_last:
                self._end(part, None)

    def _was_run_through(self, distance: float) -> bool:
        """Of a queue, another part may still begin; a stop makes sure of the end where that cannot be excluded."""
        return len(self._parts) == 1 or (distance <= NO_DISTANCE and all(part.was_reached for part in self._parts))

    def _look_for_the_start(self, target: MoveCommand, state: RobotState, distance: Optional[float],
                            now: float) -> None:
        if self._waits_since is None or now - max(self._waits_since, self._held_at) < START_WINDOW_S:
            return
        if distance is not None and distance <= 1.0:
            self._custody.stop(None, now)
            return
        where = ("it is %s from the target" % distance_text(target, state) if distance is not None
                 else "the controller does not tell how far it is from the target")
        self._custody.stop(MotionInterrupted(StopCause.FAULT, "accepted, but the arm did not move; " + where), now)


def _joint_distance(a: RobotState, b: RobotState) -> float:
    return max([abs(p - q) for p, q in zip(a.joint_position, b.joint_position)])


def relative_distance(command: PathCommand, state: RobotState) -> Optional[float]:
    """How far the arm is from the target, 1.0 at the tolerance; None where the feed does not tell."""
    if isinstance(command, JointMove):
        return max([abs(a - b) for a, b in zip(command.joint_position, state.joint_position)]) / _JOINT_TOLERANCE
    away = _pose_distance(command, state)
    if away is None:
        return None
    return max(away[0] / _POSITION_TOLERANCE, away[1] / _ANGLE_TOLERANCE)


def _is_beside(command: MoveCommand, state: RobotState) -> bool:
    """Of a target whose corner is rounded: the arm is as near as it comes to it, or one frame of the feed from that."""
    if command.tolerance <= _POSITION_TOLERANCE:
        return False
    frame_way = command.speed * _LONGEST_FRAME_TIME_S
    if isinstance(command, JointMove):
        away = max([abs(a - b) for a, b in zip(command.joint_position, state.joint_position)])
        return away <= command.tolerance / _LEVER + frame_way
    distance = _pose_distance(command, state)
    return distance is not None and distance[0] <= command.tolerance + frame_way


def _pose_distance(command: Any, state: RobotState) -> Optional[List[float]]:
    if state.tcp_position is None or state.tcp_rpy is None:
        return None
    away = math.sqrt(sum([(a - b) ** 2 for a, b in zip(command.target.position, state.tcp_position)]))
    return [away, rotation_angle_between(matrix_from_rpy(command.target.rpy), matrix_from_rpy(state.tcp_rpy))]


def distance_text(command: PathCommand, state: RobotState) -> str:
    """How far the arm is from the target, with units."""
    if isinstance(command, JointMove):
        return "%.4f rad" % max([abs(a - b) for a, b in zip(command.joint_position, state.joint_position)])
    away = _pose_distance(command, state) or [0.0, 0.0]
    return "%.4f m and %.4f rad" % (away[0], away[1])


assert REST_TIME_S < SETTLE_TIME_S
