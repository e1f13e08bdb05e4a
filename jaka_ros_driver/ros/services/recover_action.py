"""The action ``~recover`` (jaka_msgs/Recover): the service of that name, with feedback, and it can be cancelled."""
import contextlib
import logging
import threading
from concurrent.futures import Future
from queue import Empty, SimpleQueue
from typing import Dict, Optional

from actionlib.server_goal_handle import ServerGoalHandle

from jaka_msgs import msg as messages
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.procedures.recovery import RecoveryCancelled, RecoveryStep, recover
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.ros.action_server import QuietActionServer
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.jaka_types import warn_absent
from jaka_ros_driver.ros.services.server import CallCount

_LOG = logging.getLogger(__name__)

_FEEDBACK_PERIOD_S = 0.2
"""Longest wait, s, for a step, and so the delay of a cancel: steps take seconds."""


class RecoverAction:
    """The server of the goals, each in a thread of its own, so that a second one is refused instead of ending the
    first.

    A ``jaka_msgs`` from elsewhere (``JAKA_MSGS_EXTERNAL=1``) may lack the action, as the maker's does; then a warning
    is logged, and the service alone is offered.
    """

    def __init__(self, arm: ArmClient, recorder: Recorder) -> None:
        self._arm = arm
        self._recorder = recorder
        self._cancels: Dict[str, threading.Event] = {}
        self._goals = CallCount()
        self._server: Optional[QuietActionServer] = None

    def offer(self) -> None:
        """Begin to take goals."""
        if not hasattr(messages, "RecoverAction"):
            warn_absent("action Recover", "the action ~recover is not offered, the service is", messages)
            return
        self._server = QuietActionServer("~recover", messages.RecoverAction, self._take, self._cancel, self._recorder)
        self._server.start()

    def finish_goals(self, timeout: float) -> None:
        """Wait until every goal has its result, at most ``timeout`` s."""
        if not self._goals.wait_for_none(timeout):
            _LOG.warning("a recovery was not answered before the driver shut down")

    def _take(self, goal: ServerGoalHandle) -> None:
        self._cancels[goal.get_goal_id().id] = threading.Event()
        goal.set_accepted()
        threading.Thread(target=self._carry_out, args=(goal,), name="recover", daemon=True).start()

    def _cancel(self, goal: ServerGoalHandle) -> None:
        cancelled = self._cancels.get(goal.get_goal_id().id)
        if cancelled is not None:
            cancelled.set()

    def _carry_out(self, goal: ServerGoalHandle) -> None:
        goal_id = goal.get_goal_id().id
        with self._goals:
            try:
                text = self._recover(goal, self._cancels[goal_id])
                goal.set_succeeded(messages.RecoverResult(success=True, message=text), text)
            except JakaError as error:
                _LOG.info("recover: %s", error)
                end = goal.set_canceled if isinstance(error, RecoveryCancelled) else goal.set_aborted
                end(messages.RecoverResult(success=False, message=str(error)), str(error))
            finally:
                del self._cancels[goal_id]

    def _recover(self, goal: ServerGoalHandle, cancelled: threading.Event) -> str:
        """Recover the arm, and return what was done; publish the steps in this thread, because the client's must not
        wait.

        The present step is published again and again: an actionlib client misses what comes while it still sends its
        goal.
        """
        steps: SimpleQueue[Optional[RecoveryStep]] = SimpleQueue()
        done: Future[str] = self._arm.begin(lambda core: recover(core, steps.put, cancelled.is_set))
        done.add_done_callback(lambda _: steps.put(None))
        step = steps.get()
        while step is not None:
            goal.publish_feedback(messages.RecoverFeedback(step=step.value))
            with contextlib.suppress(Empty):
                step = steps.get(timeout=_FEEDBACK_PERIOD_S)
        return done.result()
