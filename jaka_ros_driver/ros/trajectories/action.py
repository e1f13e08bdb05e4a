"""The action FollowJointTrajectory: goals are taken one after the other, and each ends exactly once."""
import logging
import threading
import time
from collections import deque
from concurrent.futures import Future
from concurrent.futures import TimeoutError as StillRunning
from typing import Any, Callable, Deque, Dict, Optional

from actionlib.server_goal_handle import ServerGoalHandle

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.errors import (
    GoalToleranceViolated,
    InvalidCommand,
    JakaError,
    MotionInterrupted,
    StopCause,
)
from jaka_ros_driver.ros.action_server import QuietActionServer
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.other_messages import message_type
from jaka_ros_driver.ros.services.server import CallCount
from jaka_ros_driver.ros.topics.stamps import StampClock
from jaka_ros_driver.ros.trajectories.messages import InvalidJoints, TrajectoryDecoder, fill_states
from jaka_ros_driver.state import RobotState
from jaka_ros_driver.trajectory.points import TrajectoryOfThePast

_LOG = logging.getLogger(__name__)

SUCCESSFUL, INVALID_GOAL, INVALID_JOINTS, OLD_HEADER_TIMESTAMP = 0, -1, -2, -3
PATH_TOLERANCE_VIOLATED, GOAL_TOLERANCE_VIOLATED = -4, -5
"""Error codes of control_msgs/FollowJointTrajectoryResult."""
_FEEDBACK_PERIOD_S = 0.05
"""Period, s, of feedback: 20 Hz, as ros_control's action_monitor_rate has by default."""
_STOP_WAIT_S = 2.0
"""Longest wait, s, of an empty goal for the rest of the arm."""


class TurnQueue:
    """The order in which goals begin, that in which they came: the last one is the one that moves the arm.

    They begin in a thread that lasts as long as there are some.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._work: Deque[Callable[[], None]] = deque()
        """Goals that begin or wait to: the first one is being begun."""

    def put(self, work: Callable[[], None]) -> None:
        """Run ``work`` when all that was put before has been done."""
        with self._lock:
            self._work.append(work)
            if len(self._work) > 1:
                return
        try:
            threading.Thread(target=self._run, name="trajectory goals", daemon=True).start()
        except RuntimeError:  # no more threads: the sender of this one waits
            self._run()

    def _run(self) -> None:
        while True:
            try:
                self._work[0]()
            except Exception:  # a defect in one goal must not keep later ones from being taken
                _LOG.exception("a trajectory could not be begun")
            with self._lock:
                del self._work[0]
                if not self._work:
                    return


class _Goal:
    """One goal: whether its client has cancelled it, and the future that ends when the arm has followed it.

    ``stops``: how many stops had been asked for when it came; a later one ends it, also while it waits for its turn.
    """

    def __init__(self, stops: int) -> None:
        self.stops = stops
        self.is_cancelled = False
        self.done: Optional[Future[str]] = None


class TrajectoryAction:
    """The action server under one name."""

    def __init__(self, name: str, arm: ArmClient, decoder: TrajectoryDecoder, turns: TurnQueue,
                 goals: CallCount, recorder: Recorder, clock: StampClock) -> None:
        """Set up the server; ``offer`` begins.

        Args:
            name: Of the action, as rospy takes it.
            arm: Follows the trajectories.
            decoder: Decodes them.
            turns: Shared by all who send trajectories to this arm.
            goals: Counts those that have not ended.
            recorder: Records goals, cancels and results.
            clock: For the stamps of the feedback; of this action alone.
        """
        self._recorder = recorder
        self._name = name
        self._arm = arm
        self._decoder = decoder
        self._turns = turns
        self._count = goals
        self._goals: Dict[str, _Goal] = {}
        action = message_type("control_msgs/FollowJointTrajectoryAction")
        self._spec = action
        self._result_type = type(action().action_result.result)
        self._feedback_type = type(action().action_feedback.feedback)
        self._server: Optional[QuietActionServer] = None
        self._clock = clock

    def offer(self) -> None:
        """Begin to take goals."""
        self._server = QuietActionServer(self._name, self._spec, self._take, self._cancel, self._recorder)
        self._server.start()

    # ---- called by actionlib ----

    def _take(self, handle: ServerGoalHandle) -> None:
        self._goals[handle.get_goal_id().id] = _Goal(self._arm.stops)
        self._turns.put(lambda: self._begin(handle))

    def _cancel(self, handle: ServerGoalHandle) -> None:
        goal = self._goals.get(handle.get_goal_id().id)
        if goal is not None:
            goal.is_cancelled = True
            if goal.done is not None:
                self._arm.cancel_trajectory(goal.done)

    # ---- in the thread of turns ----

    def _begin(self, handle: ServerGoalHandle) -> None:
        goal_id = handle.get_goal_id().id
        goal, message = self._goals[goal_id], handle.get_goal()
        if goal.is_cancelled:
            self._end(handle, handle.set_canceled, SUCCESSFUL, "cancelled before it began")
            return
        try:
            trajectory = self._decoder.trajectory(message.trajectory)
            tolerances = self._decoder.tolerances(message)
            if trajectory is None:
                self._end_what_is_under_way()
            else:
                goal.done = self._arm.follow(trajectory, tolerances, goal.stops)
        except JakaError as error:
            _LOG.info("%s: %s", self._name, error)
            self._end(handle, handle.set_rejected, _code_of_refusal(error), str(error))
            return
        except Exception as error:  # a defect; its client must not wait for ever
            self._end(handle, handle.set_rejected, INVALID_GOAL, "internal error: %r" % error)
            raise
        handle.set_accepted()
        if goal.is_cancelled and goal.done is not None:
            self._arm.cancel_trajectory(goal.done)
        threading.Thread(target=self._watch, args=(handle, goal.done), name="trajectory goal", daemon=True).start()

    def _end_what_is_under_way(self) -> None:
        owner = self._arm.motion_owner
        if not self._arm.cancel_trajectory() and owner is not None and owner is not MotionOwner.TRAJECTORY:
            raise InvalidCommand("refused: %s owns the arm's motion; an empty trajectory ends trajectories only"
                                 % owner.value)

    # ---- in the goal's own thread ----

    def _watch(self, handle: ServerGoalHandle, done: "Optional[Future[str]]") -> None:
        with self._count:
            if done is None:
                self._hold(handle)
            told: Optional[RobotState] = None
            while done is not None:
                try:
                    led = done.result(_FEEDBACK_PERIOD_S)
                except StillRunning:
                    told = self._publish_feedback(handle, done, told)
                    continue
                except JakaError as error:
                    self._ended_with(handle, error)
                    return
                self._end(handle, handle.set_succeeded, SUCCESSFUL, "the arm rests at the last point" + (
                    "; " + led if led else ""))
                return

    def _hold(self, handle: ServerGoalHandle) -> None:
        """Wait until the arm rests, and end a goal without points.

        Such a goal has ended the running trajectory.
        """
        deadline = time.monotonic() + _STOP_WAIT_S
        while self._arm.trajectory is not None and time.monotonic() < deadline:
            time.sleep(_FEEDBACK_PERIOD_S)
        if self._arm.trajectory is None:
            self._end(handle, handle.set_succeeded, SUCCESSFUL, "an empty trajectory: the arm holds its place")
        else:
            self._end(handle, handle.set_aborted, PATH_TOLERANCE_VIOLATED, "the arm was not seen at rest")

    def _publish_feedback(self, handle: ServerGoalHandle, done: "Future[str]",
                          told: Optional[RobotState]) -> Optional[RobotState]:
        """Publish the newest state, unless it is ``told``, the last that was; return the last that was then."""
        progress, state = self._arm.trajectory, self._arm.state
        if progress is None or progress.call is not done or state is None or state is told:
            return told
        handle.publish_feedback(fill_states(
            self._feedback_type(), self._decoder.joint_names, self._clock.stamp(state.received_at), progress.desired,
            (state.joint_position, state.joint_velocity), progress.time))
        return state

    def _ended_with(self, handle: ServerGoalHandle, error: JakaError) -> None:
        _LOG.info("%s: %s", self._name, error)
        if isinstance(error, MotionInterrupted) and error.cause in (StopCause.CANCELLED, StopCause.REPLACED):
            self._end(handle, handle.set_canceled, SUCCESSFUL, str(error))
        else:
            self._end(handle, handle.set_aborted, _code_of_end(error), str(error))

    def _end(self, handle: ServerGoalHandle, end: Callable[[Any, str], None], code: int, text: str) -> None:
        end(self._result_type(error_code=code, error_string=text), text)
        self._goals.pop(handle.get_goal_id().id, None)


def _code_of_refusal(error: JakaError) -> int:
    if isinstance(error, InvalidJoints):
        return INVALID_JOINTS
    return OLD_HEADER_TIMESTAMP if isinstance(error, TrajectoryOfThePast) else INVALID_GOAL


def _code_of_end(error: JakaError) -> int:
    """Return the action's code for the end of a motion.

    It has none for an arm that was stopped: the path was not followed.
    """
    if isinstance(error, GoalToleranceViolated):
        return GOAL_TOLERANCE_VIOLATED
    return INVALID_GOAL if isinstance(error, InvalidCommand) else PATH_TOLERANCE_VIOLATED
