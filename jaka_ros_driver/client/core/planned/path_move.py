"""A path of several segments in custody: one queue in the controller, watched from its first byte until the arm rests.

Each segment is sent when the one before it was accepted, so that a refusal leaves nothing behind it that would begin
at the wrong place.
"""
from typing import Callable, NamedTuple, Optional

from jaka_ros_driver.client.core.actions import Token
from jaka_ros_driver.client.core.arrival import NO_DISTANCE, SETTLE_TIME_S, InPosition, has_settled
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import MotionOwner, rest_time_at
from jaka_ros_driver.client.core.move import (
    NOT_SEEN_TO_BEGIN,
    PausableMotion,
    distance_text,
    relative_distance,
)
from jaka_ros_driver.client.core.stillness import MOVEMENT
from jaka_ros_driver.commands import JointMove
from jaka_ros_driver.errors import JakaError, MotionInterrupted, PathInterrupted, StopCause
from jaka_ros_driver.state import RobotState
from jaka_ros_driver.trajectory.segments import PathTracker, SegmentPath


class PathProgress(NamedTuple):
    """The progress of an arm on its path.

    Attributes:
        call: Of its goal.
        completed: Segments that have ended.
        total: Number of all its segments.
        fraction: Of the whole path, 0 to 1, by the time that its segments take at their programmed speeds.
        is_paused: It is held by a pause.
    """

    call: Token
    completed: int
    total: int
    fraction: float
    is_paused: bool = False

    @property
    def segment(self) -> int:
        """The index of the running segment, from 0; the last one's until the arm is seen at rest at its end."""
        return min(self.completed, self.total - 1)


class PathMove(PausableMotion):
    """A motion that is completed when every segment was passed and the arm rests at the last target.

    It is stopped by what contradicts that.
    """

    owner = MotionOwner.PATH
    is_answered_at_rest = True

    def __init__(self, custody: Custody, path: SegmentPath, call: Token, on_begun: Callable[[], None],
                 state: RobotState, now: float) -> None:
        """Set up the motion.

        Args:
            custody: Of this motion.
            path: Audited; begins where the arm is.
            call: Answered at the end with its PathProgress, or with a PathInterrupted.
            on_begun: Called when the controller has accepted the first segment.
            state: Before the motion.
            now: s.
        """
        self._custody = custody
        self._path = path
        self._call = call
        self._on_begun = on_begun
        self._start = state
        self._frames = state.tool_id, state.user_frame_id
        self._tracker = PathTracker(path, now)
        self._waiting = [segment.command for segment in path.segments if not segment.is_nowhere]
        self._is_single = len(self._waiting) == 1
        self._target = self._waiting[-1]
        self._begun_at: Optional[float] = None
        self._accepted_at: Optional[float] = None
        self._has_moved = False
        self._must_move = any((relative_distance(command, state) or 0.0) > NO_DISTANCE for command in self._waiting)
        self._in_position = InPosition()
        self._completed = 0
        self._is_done = False
        self._has_rested = False
        self.rest_time = max(rest_time_at(command.speed, not isinstance(command, JointMove))
                             for command in self._waiting)

    # ---- what is known ----

    @property
    def progress(self) -> PathProgress:
        """The progress on the path."""
        count = len(self._path.segments)
        if self._is_done:
            return PathProgress(self._call, count, count, 1.0)
        return PathProgress(self._call, self._tracker.completed, count, self._tracker.fraction, self.is_paused)

    # ---- life ----

    def begin(self, now: float) -> None:
        self._send_next(now)

    def observe(self, state: RobotState, now: float) -> None:
        self._follow(state)
        if self._begun_at is None:
            return
        if not self._has_moved:
            self._has_moved = max([abs(a - b) for a, b in zip(
                state.joint_position, self._start.joint_position)]) > MOVEMENT
        if self._has_moved:
            self._in_position.observe(state)
        self._note_pause(state, now, self._has_moved)
        if self._tracker.completed > self._completed:
            self._completed = self._tracker.completed
            self._set_deadline(now)
        if not self._has_moved and self._must_move and state.received_at > self._begun_at:
            if now - max(self._begun_at, self._held_at) >= self._custody.start_window(self.rest_time):
                self._end_away(StopCause.FAULT, "accepted, but the arm did not move; it is %s from the end", state, now)
        elif self._accepted_at is not None and state.received_at > self._accepted_at:
            self._look_for_the_end(self._accepted_at, state, now)

    def observe_stop(self, state: RobotState) -> None:
        """Follow the arm until it rests: what moves it after that is not this path."""
        self._has_rested = self._has_rested or self._custody.stillness.elapsed() >= self.rest_time
        if not self._has_rested:
            self._follow(state)

    def tick(self, now: float) -> None:
        if self._extend_time(now):
            return
        if now >= self.deadline:
            self._custody.stop(MotionInterrupted(
                StopCause.TIMEOUT, "no segment completed for %.0f s" % self._custody.settings.motion_timeout), now)
        elif (self._begun_at is not None and self._must_move and not self._has_moved
              and now - max(self._begun_at, self._held_at) >= self._custody.unseen_start(self.rest_time)):
            self._custody.stop(MotionInterrupted(StopCause.FAULT, NOT_SEEN_TO_BEGIN), now)

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        if outcome is None:
            self._is_done = True
            self._answer(self.progress, None)
        else:
            progress = self.progress
            self._answer(None, PathInterrupted(outcome, progress.completed, progress.total, progress.fraction))

    # ---- inside ----

    def _send_next(self, now: float) -> None:
        self._custody.channel.request(self._waiting.pop(0), now, self._replied)

    def _replied(self, _result: object, error: Optional[JakaError], now: float) -> None:
        if self._custody.motion is not self or self._custody.is_ending:
            return
        if error is not None:
            if self._begun_at is None:
                self._answer(None, error)
                self._custody.not_accepted(error, now)
            elif self._custody.channel.is_open:
                self._custody.stop(MotionInterrupted(StopCause.FAULT, str(error)), now)
            return
        self._set_deadline(now)
        if self._begun_at is None:
            self._begun_at = now
            self._on_begun()
        if self._waiting:
            self._send_next(now)
        else:
            self._accepted_at = now

    def _set_deadline(self, now: float) -> None:
        self.deadline = now + self._custody.settings.motion_timeout

    def _follow(self, state: RobotState) -> None:
        """Take the arm's place on the path, unless its pose is given in another frame than the targets."""
        if self._begun_at is not None and (state.tool_id, state.user_frame_id) == self._frames:
            self._tracker.observe(state)

    def _answer(self, progress: Optional[PathProgress], error: Optional[JakaError]) -> None:
        call, self._call = self._call, None
        self._custody.actions.answer(call, progress, error)

    def _look_for_the_end(self, accepted_at: float, state: RobotState, now: float) -> None:
        """Decide by the measured positions whether the path has ended, as for a single move.

        The arm must also have come along the path.
        """
        since = max(accepted_at, self._held_at)
        if self._custody.rest_since(since) < self.rest_time:
            return
        resting = self._custody.stillness.elapsed(since)
        distance = relative_distance(self._target, state)
        is_late = resting >= self._custody.start_window(self.rest_time)
        if distance is not None and distance <= 1.0 and self._was_followed:
            if self._has_arrived(distance, resting, state):
                self._custody.finish(now)
            elif is_late:
                self._custody.stop(None, now)
        elif is_late or (state.is_in_position and self._has_moved and resting >= SETTLE_TIME_S):
            self._end_away(StopCause.STOPPED, "the arm came to rest %s from the end", state, now)

    def _end_away(self, cause: StopCause, text: str, state: RobotState, now: float) -> None:
        """Stop an arm that rests elsewhere than at the end; the text's "%s" stands for the distance."""
        self._custody.stop(MotionInterrupted(cause, text % distance_text(self._target, state)), now)

    def _has_arrived(self, distance: float, resting: float, state: RobotState) -> bool:
        """Return whether no segment can still begin, or go on, of an arm that rests within the tolerance of its end."""
        return self._tracker.fraction >= 1.0 and (
            has_settled(distance, resting, self.rest_time, state)
            or (self._is_single and self._in_position.shows_the_end(state)))

    @property
    def _was_followed(self) -> bool:
        """True where the arm has passed every corner."""
        return self._tracker.completed >= len(self._path.segments) - 1
