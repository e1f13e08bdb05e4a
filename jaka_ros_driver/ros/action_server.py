"""The action server of actionlib, without a traceback at the node's end; its goals are recorded."""
import contextlib
from typing import Any, Callable, Iterator

import rospy
from actionlib import ActionServer
from actionlib.server_goal_handle import ServerGoalHandle
from actionlib_msgs.msg import GoalID, GoalStatus

from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.errands import ERRANDS


class QuietActionServer(ActionServer):
    """An action server that records goals, cancels and results, and raises nothing once the node's end closed its
    topics.

    The status is published five times a second, as an errand. rospy closes all topics before ``rospy.is_shutdown`` is
    True, and actionlib checks only that.
    """

    def __init__(self, name: str, spec: Any, take: Callable[[ServerGoalHandle], None],
                 cancel: Callable[[ServerGoalHandle], None],
                 recorder: Recorder) -> None:
        """Set up the server; ``start`` begins.

        Args:
            name: Of the action, with ``~`` for the node's own.
            spec: The generated type.
            take: Called with the handle of each new goal.
            cancel: Called with the handle of each goal that is to be cancelled.
            recorder: Records goals, cancels and results.
        """
        self._name = name
        self._recorder = recorder
        recorder.offers_action(name)
        super().__init__(rospy.resolve_name(name), spec, take, cancel, auto_start=False)

    def initialize(self) -> None:
        """Set up the topics; the errands take the place of the server's own timer."""
        super().initialize()
        if self.status_timer is not None:
            self.status_timer.shutdown()
            ERRANDS.every(1.0 / self.status_frequency, lambda: self.publish_status_async(None))

    def internal_goal_callback(self, goal: Any) -> None:
        """Take a goal from the topic."""
        self._recorder.goal(self._name, goal)
        super().internal_goal_callback(goal)

    def internal_cancel_callback(self, goal_id: GoalID) -> None:
        """Take a cancel from the topic."""
        self._recorder.cancel(self._name, goal_id)
        super().internal_cancel_callback(goal_id)

    def publish_status(self) -> None:
        """Publish the status of all goals."""
        with _closed_only_at_the_end():
            super().publish_status()

    def publish_result(self, status: GoalStatus, result: Any) -> None:
        """Publish the result of a goal, and the status of all."""
        self._recorder.result(self._name, status, result)
        with _closed_only_at_the_end():
            super().publish_result(status, result)

    def publish_feedback(self, status: GoalStatus, feedback: Any) -> None:
        """Publish the progress of a goal."""
        with _closed_only_at_the_end():
            super().publish_feedback(status, feedback)


@contextlib.contextmanager
def _closed_only_at_the_end() -> Iterator[None]:
    """Ignore a topic that is closed while the node ends; raise ROSException at any other time."""
    try:
        yield
    except rospy.ROSException:
        if not rospy.core.is_shutdown_requested():
            raise
