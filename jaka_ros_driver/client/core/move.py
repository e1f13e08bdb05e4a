"""A planned move, or several that are queued: from acceptance to the target, in the evidence of the status feed."""
import math
from typing import List, Optional, Union

from jaka_ros_driver.client.core.actions import Token
from jaka_ros_driver.client.core.arrival import NO_DISTANCE, SETTLE_TIME_S, InPosition, has_settled
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import ArmMotion, MotionOwner, is_held, rest_time_at
from jaka_ros_driver.client.core.motion_guard.motion_check import StartPlace
from jaka_ros_driver.client.core.stillness import MOVEMENT, REST_TIME_S
from jaka_ros_driver.commands import ArcMove, JointMove, LinearMove, MoveCommand, PathCommand
from jaka_ros_driver.errors import CommandRejected, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between
from jaka_ros_driver.state import RobotState

NOT_SEEN_TO_BEGIN = "accepted, but the arm was not seen to move"
_JOINT_TOLERANCE = 0.01
"""Largest distance of a joint, rad, from its target that counts as there.

With a larger one a move that was stopped short of its target would count as completed; with a smaller one an arm that
settles beside it would not.
"""
_POSITION_TOLERANCE = 0.002
"""The same for the tool's position, m."""
_ANGLE_TOLERANCE = 0.02
"""The same for the tool's orientation, rad."""
_LONGEST_FRAME_TIME_S = 0.1
"""Longest interval, s, between two frames of a feed in good order."""
_LEVER = 0.1
"""Smallest radius, m, at which a joint's turning moves the tool for that joint to count."""
_PAUSE_ENDS_AFTER = 3
"""Frames without the pause that end it; what one frame alone shows may be damage."""


class PausableMotion(ArmMotion):
    """A motion that the controller plans, and holds in a pause: by a call, or at the pendant.

    Attributes:
        is_paused: Paused by a call; that time does not count. It is so until a call resumes it, or the feed shows
            the pause no more: then somebody has resumed it at the pendant.
    """

    _custody: Custody
    is_paused = False
    _held_at = 0.0
    _frames_without = 0
    _counted_until: Optional[float] = None

    def _note_pause(self, state: RobotState, now: float, has_moved: bool) -> None:
        """Take what the feed shows of a pause; the one of a call was shown before ``is_paused`` was set."""
        self._frames_without = self._frames_without + 1 if self.is_paused and not state.is_paused else 0
        if self._frames_without >= _PAUSE_ENDS_AFTER:
            self.is_paused = False
        if self.is_paused or (has_moved and is_held(state)):
            self._held_at = now

    def _extend_time(self, now: float) -> bool:
        """Return whether it is paused by a call; then its time limit comes later by the time that has passed."""
        if not self.is_paused:
            self._counted_until = None
            return False
        passed = 0.0 if self._counted_until is None else now - self._counted_until
        self.deadline = max(self.deadline + passed, now + self._custody.start_window(0.0))
        self._counted_until = now
        return True


class _Part:
    """One command of the queue, and the caller who has not been answered yet."""

    def __init__(self, command: MoveCommand, call: Token, waits: bool, place: StartPlace, end: Token = None) -> None:
        self.command = command
        self.place = place
        self.call = call
        self.end = end
        self.waits = waits
        self.is_accepted = False
        self.is_answered = False
        self.was_reached = False


class Move(PausableMotion):
    """A motion that is completed when the arm rests at the last target, and stopped when anything contradicts that.

    Attributes:
        place: Where its last target is: a move that is queued behind it is looked at from there.
    """

    owner = MotionOwner.MOVE

    def __init__(self, custody: Custody, command: MoveCommand, call: Token, waits: bool, state: RobotState,
                 place: StartPlace, end: Token = None) -> None:
        """Set up the motion.

        Args:
            custody: Of this motion.
            command: The target.
            call: Who is answered.
            waits: The answer comes at the end; else with the controller's acceptance.
            state: Before the motion.
            place: Where it ends.
            end: Answered at the end, and not before ``call``; None for nobody.
        """
        self.place = place
        self._custody = custody
        self._start = state
        self._parts = [_Part(command, call, waits, place, end)]
        self._target: Optional[MoveCommand] = None
        self._accepted_at = 0.0
        self._waits_since: Optional[float] = None
        self._has_moved = False
        self._must_move = False
        self._in_position = InPosition()
        self._met = 0  # so many targets, from the first on, were seen in their turn and without a distance

    def begin(self, now: float) -> None:
        self._send(self._parts[0], now)

    def add(self, command: MoveCommand, call: Token, now: float, place: StartPlace, end: Token = None) -> None:
        """Queue another move behind the running ones; answered with the controller's acceptance.

        place: Where it ends.

        Raises:
            JakaError: Nothing was sent.
        """
        part = _Part(command, call, waits=False, place=place, end=end)
        self._send(part, now)
        self._parts.append(part)
        self.place = place

    def observe(self, state: RobotState, now: float) -> None:
        if self._target is None or state.received_at <= self._accepted_at:
            return
        if not self._has_moved:
            self._has_moved = _joint_distance(state, self._start) > MOVEMENT
        if self._has_moved:
            self._in_position.observe(state)
        self._note_pause(state, now, self._has_moved)
        self._note_reached(state, now)
        if not self._has_moved and self._must_move:
            self._look_for_the_start(self._target, state, now)
        else:
            self._look_for_the_end(self._target, state, now)

    def tick(self, now: float) -> None:
        if self._extend_time(now):
            return
        if self._target is not None and now >= self.deadline:
            self._custody.stop(MotionInterrupted(
                StopCause.TIMEOUT, "not completed after %.0f s" % self._custody.settings.motion_timeout), now)
        elif (self._must_move and not self._has_moved and self._waits_since is not None
              and now - max(self._waits_since, self._held_at) >= self._custody.unseen_start(self.rest_time)):
            self._custody.stop(MotionInterrupted(StopCause.FAULT, NOT_SEEN_TO_BEGIN), now)

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        for part in self._parts:
            was_passed_over = outcome is None and len(self._parts) > 1 and not part.was_reached
            error = (MotionInterrupted(StopCause.STOPPED, "its target was not seen to be reached")
                     if was_passed_over else outcome)
            self._answer(part, error)
            self._end(part, error)

    # ---- inside ----

    def _send(self, part: _Part, now: float) -> None:
        self.rest_time = max(self.rest_time, rest_time_at(part.command.speed, not isinstance(part.command, JointMove)))
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
        is_last = part is self._parts[-1]
        self._parts.remove(part)
        self.place = self._parts[-1].place if self._parts else StartPlace.unknown()
        if not self._parts or not isinstance(error, CommandRejected):
            self._custody.not_accepted(error, now)
        elif not is_last:  # the way from there to their targets was neither asked for nor looked at
            self._custody.stop(MotionInterrupted(
                StopCause.FAULT, "a move of the queue was refused; those behind it would begin elsewhere"), now)

    def _accepted(self, part: _Part, now: float) -> None:
        self._target = part.command
        self._accepted_at = now
        self._waits_since = now if self._waits_since is None else self._waits_since
        if not any(other.is_accepted and not other.was_reached for other in self._parts if other is not part):
            self._begin_turn(now)
        distance = relative_distance(part.command, self._start)
        self._must_move = self._must_move or distance is None or distance > NO_DISTANCE
        if not part.waits and not self._custody.is_ending:
            self._answer(part, None)

    def _begin_turn(self, now: float) -> None:
        """Give the next move of the queue its time; a caller who waits is answered within that of the first one."""
        if self.deadline == math.inf or not self._parts[0].waits:
            self.deadline = now + self._custody.settings.motion_timeout

    def _answer(self, part: _Part, error: Optional[JakaError]) -> None:
        if not part.is_answered:
            part.is_answered = True
            self._custody.actions.answer(part.call, None, error)

    def _end(self, part: _Part, error: Optional[JakaError]) -> None:
        end, part.end = part.end, None
        self._custody.actions.answer(end, None, error)

    def _look_for_the_end(self, target: MoveCommand, state: RobotState, now: float) -> None:
        """Decide by the measured positions whether the motion has ended; ``inpos`` counts only where it has followed
        it.

        After the rest of ``start_window`` a stop makes sure of the end: what begins later is too late.
        """
        since, custody = max(self._accepted_at, self._held_at), self._custody
        if custody.rest_since(since) < self.rest_time or not all(part.is_accepted for part in self._parts):
            return
        resting = custody.stillness.elapsed(since)
        distance = relative_distance(target, state)
        is_late = resting >= custody.start_window(self.rest_time)
        if distance is not None and distance <= 1.0:
            if self._has_arrived(distance, resting, state) and self._is_seen_after_all(since):
                if self._last_leads_nowhere(state):
                    custody.stop(None, now)
                else:
                    custody.finish(now)
            elif is_late:
                custody.stop(None, now)
        elif not state.is_in_position and not is_late:
            return
        elif distance is None and self._in_position.shows_the_end(state):
            custody.finish(now)
        elif distance is None:
            if is_late:
                custody.stop(MotionInterrupted(
                    StopCause.STOPPED, "the arm came to rest, and the controller does not tell where its tool is"), now)
        elif resting >= max(SETTLE_TIME_S, self.rest_time):
            custody.stop(MotionInterrupted(
                StopCause.STOPPED, "the arm came to rest %s from the target" % distance_text(target, state)), now)

    def _note_reached(self, state: RobotState, now: float) -> None:
        """Mark the targets of a queue as reached, each in its turn.

        All but the last one may be passed beside a rounded corner.
        """
        while self._met < len(self._parts) and self._parts[self._met].is_accepted and _is_at(
                self._parts[self._met].command, state):
            self._met += 1
        for part in self._parts:
            is_last = part is self._parts[-1]
            if not part.was_reached:
                distance = relative_distance(part.command, state)
                if not part.is_accepted or (distance is not None and distance > 1.0
                                            and (is_last or not _is_beside(part.command, state))):
                    return
                part.was_reached = True
                self._begin_turn(now)
            if not is_last:
                self._end(part, None)

    def _has_arrived(self, distance: float, resting: float, state: RobotState) -> bool:
        """Return whether the motion has ended, of an arm that rests within the tolerance of the last target."""
        if len(self._parts) == 1:
            return has_settled(distance, resting, self.rest_time, state) or self._in_position.shows_the_end(state)
        return has_settled(distance, resting, self.rest_time, state) and self._was_run_through(state)

    def _is_seen_after_all(self, accepted_at: float) -> bool:
        """Return whether the feed tells of after the acceptance: a frozen one shows rest, too.

        An arm that was seen to move to its target shows it by that.
        """
        return self._has_moved or self._custody.is_answered_since(accepted_at)

    def _last_leads_nowhere(self, state: RobotState) -> bool:
        """Return whether the last command begins where it ends, and the arm rests there.

        Nothing shows that it has begun. One that the controller holds may begin when the arm is elsewhere, and takes it
        back: a stop makes sure.
        """
        return self._places_here(state)[-1]

    def _places_here(self, state: RobotState) -> List[bool]:
        """Return of the place where the arm began, and of each target but the last, whether the arm is there."""
        began_here = _joint_distance(state, self._start) <= _JOINT_TOLERANCE * NO_DISTANCE
        return [began_here, *[_is_at(part.command, state) for part in self._parts[:-1]]]

    def _was_run_through(self, state: RobotState) -> bool:
        """Return whether no part of a queue can still begin, of an arm that rests on the last target.

        One can where an earlier target, or the place where the arm began, is the same, and what lies between was not
        seen: a controller that hesitates between two moves rests on a target, too, and may set ``inpos`` there.
        """
        if not all(part.was_reached for part in self._parts):
            return False
        places = [*self._places_here(state), True]  # that are where the arm is now: the start, each target
        first = len(places) - 1
        while first and places[first - 1]:  # from the first of them on, the way to the next one is no way
            first -= 1
        return self._met >= first or not any(places[self._met:first])

    def _look_for_the_start(self, target: MoveCommand, state: RobotState, now: float) -> None:
        """Stop a move that has not begun in time, by the clock: frames of rest may be missing at that moment."""
        if (self._waits_since is None
                or now - max(self._waits_since, self._held_at) < self._custody.start_window(self.rest_time)):
            return
        distance = relative_distance(target, state)
        if distance is not None and distance <= 1.0:
            self._custody.stop(None, now)
            return
        where = ("it is %s from the target" % distance_text(target, state) if distance is not None
                 else "the controller does not tell how far it is from the target")
        self._custody.stop(MotionInterrupted(StopCause.FAULT, "accepted, but the arm did not move; " + where), now)


def _joint_distance(a: RobotState, b: RobotState) -> float:
    return max([abs(p - q) for p, q in zip(a.joint_position, b.joint_position)])


def relative_distance(command: PathCommand, state: RobotState) -> Optional[float]:
    """Return the arm's distance from the target, 1.0 at the tolerance; None where the feed does not show it."""
    if isinstance(command, JointMove):
        return max([abs(a - b) for a, b in zip(command.joint_position, state.joint_position)]) / _JOINT_TOLERANCE
    away = _pose_distance(command, state)
    if away is None:
        return None
    return max(away[0] / _POSITION_TOLERANCE, away[1] / _ANGLE_TOLERANCE)


def _is_at(command: MoveCommand, state: RobotState) -> bool:
    """Return whether the arm is seen at the command's target."""
    distance = relative_distance(command, state)
    return distance is not None and distance <= NO_DISTANCE


def _is_beside(command: MoveCommand, state: RobotState) -> bool:
    """Return whether the arm is as near to a target with a rounded corner as it comes, or one frame of the feed from
    that.
    """
    if command.tolerance <= _POSITION_TOLERANCE:
        return False
    frame_way = command.speed * _LONGEST_FRAME_TIME_S
    if isinstance(command, JointMove):
        away = max([abs(a - b) for a, b in zip(command.joint_position, state.joint_position)])
        return away <= command.tolerance / _LEVER + frame_way
    distance = _pose_distance(command, state)
    return distance is not None and distance[0] <= command.tolerance + frame_way


def _pose_distance(command: Union[LinearMove, ArcMove], state: RobotState) -> Optional[List[float]]:
    if state.tcp_position is None or state.tcp_rpy is None:
        return None
    away = math.sqrt(sum([(a - b) ** 2 for a, b in zip(command.target.position, state.tcp_position)]))
    return [away, rotation_angle_between(matrix_from_rpy(command.target.rpy), matrix_from_rpy(state.tcp_rpy))]


def distance_text(command: PathCommand, state: RobotState) -> str:
    """Return the arm's distance from the target, with units."""
    if isinstance(command, JointMove):
        return "%.4f rad" % max([abs(a - b) for a, b in zip(command.joint_position, state.joint_position)])
    away = _pose_distance(command, state) or [0.0, 0.0]
    return "%.4f m and %.4f rad" % (away[0], away[1])


assert REST_TIME_S < SETTLE_TIME_S
