"""The action ``~move_path`` (jaka_msgs/MovePath): paths of several segments, and each goal ends exactly once."""
import logging
import threading
from concurrent.futures import Future
from concurrent.futures import TimeoutError as StillRunning
from typing import Any, Callable, Dict, Optional

from actionlib.server_goal_handle import ServerGoalHandle

from jaka_msgs import msg as messages
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.planned.path_move import PathProgress
from jaka_ros_driver.errors import JakaError, MotionInterrupted, PathInterrupted, StopCause
from jaka_ros_driver.ros.action_server import QuietActionServer
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.convert import RequestDecoder
from jaka_ros_driver.ros.jaka_types import warn_absent
from jaka_ros_driver.ros.services.server import CallCount

_LOG = logging.getLogger(__name__)

_FEEDBACK_PERIOD_S = 0.1
"""Period, s, of the feedback: 10 Hz, as much as a person or a behaviour tree reads."""


class _Goal:
    """The state of a goal."""

    def __init__(self) -> None:
        self.is_cancelled = threading.Event()
        self.is_begun = threading.Event()
        self.done: Optional[Future[PathProgress]] = None


class PathAction:
    """The server of the goals, each in a thread of its own; one that comes while something moves the arm is refused.

    A ``jaka_msgs`` from elsewhere (``JAKA_MSGS_EXTERNAL=1``) may lack the action, as the maker's does; then a warning
    is logged, and it is not offered.
    """

    def __init__(self, arm: ArmClient, decoder: RequestDecoder, recorder: Recorder) -> None:
        self._arm = arm
        self._recorder = recorder
        self._decoder = decoder
        self._goals: Dict[str, _Goal] = {}
        self._count = CallCount()
        self._server: Optional[QuietActionServer] = None

    def offer(self) -> None:
        """Begin to take goals."""
        if not hasattr(messages, "MovePathAction"):
            warn_absent("action MovePath", "~move_path is not offered", messages)
            return
        self._server = QuietActionServer("~move_path", messages.MovePathAction, self._take, self._cancel,
                                         self._recorder)
        self._server.start()

    def finish_goals(self, timeout: float) -> None:
        """Wait until every goal has its result, at most ``timeout`` s."""
        if not self._count.wait_for_none(timeout):
            _LOG.warning("a path was not answered before the driver shut down")

    # ---- called by actionlib ----

    def _take(self, handle: ServerGoalHandle) -> None:
        self._goals[handle.get_goal_id().id] = _Goal()
        threading.Thread(target=self._carry_out, args=(handle,), name="path goal", daemon=True).start()

    def _cancel(self, handle: ServerGoalHandle) -> None:
        goal = self._goals.get(handle.get_goal_id().id)
        if goal is not None:
            goal.is_cancelled.set()
            if goal.done is not None:
                self._arm.cancel_path(goal.done)

    # ---- in the goal's own thread ----

    def _carry_out(self, handle: ServerGoalHandle) -> None:
        goal = self._goals[handle.get_goal_id().id]
        with self._count:
            try:
                segments = self._decoder.path(handle.get_goal())
                goal.done = self._arm.begin_path(segments, goal.is_cancelled.is_set, goal.is_begun.set)
                progress = self._watch(handle, goal, goal.done)
            except JakaError as error:
                _LOG.info("move_path: %s", error)
                self._failed(handle, goal, error)
            except Exception as error:  # a defect; its client must not wait for ever
                self._end(self._end_of(handle, goal, None), False, "internal error: %r" % error, 0, 0.0)
                raise
            else:
                self._accept(handle, goal)
                self._end(handle.set_succeeded, True, "the arm rests at the last target", progress.completed,
                          progress.fraction)
            finally:
                del self._goals[handle.get_goal_id().id]

    def _watch(self, handle: ServerGoalHandle, goal: _Goal, done: "Future[PathProgress]") -> PathProgress:
        """Publish the path's progress until it ends; raise the error with which it ends."""
        is_accepted = is_cancelled = False
        while True:
            try:
                return done.result(_FEEDBACK_PERIOD_S)
            except StillRunning:
                if not goal.is_begun.is_set():
                    continue
            if not is_accepted:
                is_accepted = True
                self._accept(handle, goal)
            if goal.is_cancelled.is_set() and not is_cancelled:
                is_cancelled = self._arm.cancel_path(done)  # it may have been asked for between audit and begin
            progress = self._arm.path
            if progress is not None and progress.call is done:
                handle.publish_feedback(messages.MovePathFeedback(
                    segment=progress.segment, fraction=progress.fraction, paused=progress.is_paused))

    def _accept(self, handle: ServerGoalHandle, goal: _Goal) -> None:
        """Accept a goal that is still pending.

        That is needed also of a path that is over before this thread looks: actionlib knows no end of a pending goal.
        """
        if handle.get_goal_status().status in (handle.get_goal_status().PENDING,
                                               handle.get_goal_status().RECALLING):
            handle.set_accepted()

    def _failed(self, handle: ServerGoalHandle, goal: _Goal, error: JakaError) -> None:
        completed, fraction = 0, 0.0
        if isinstance(error, PathInterrupted):
            completed, fraction = error.completed, error.fraction
        self._end(self._end_of(handle, goal, error), False, str(error), completed, fraction)

    def _end_of(self, handle: ServerGoalHandle, goal: _Goal, error: Optional[JakaError]) -> Callable[[Any, str], None]:
        """Return the kind of end: cancelled; rejected, where nothing moved; else aborted."""
        if isinstance(error, MotionInterrupted) and error.cause is StopCause.CANCELLED:
            return handle.set_canceled
        if not goal.is_begun.is_set():
            return handle.set_rejected
        self._accept(handle, goal)
        return handle.set_aborted

    def _end(self, end: Callable[[Any, str], None], success: bool, text: str, completed: int, fraction: float) -> None:
        end(messages.MovePathResult(success=success, message=text, completed=completed, fraction=fraction), text)
