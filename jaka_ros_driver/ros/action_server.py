"""The action server of actionlib, without a traceback at the node's end; its goals are recorded."""
import contextlib
import logging
import threading
from typing import Any, Callable, Dict, Iterator, List

import rospy
from actionlib import ActionServer
from actionlib.server_goal_handle import ServerGoalHandle
from actionlib_msgs.msg import GoalID, GoalStatus

from jaka_ros_driver.ros.audit.recorder import Recorder

_LOG = logging.getLogger(__name__)


class QuietActionServer(ActionServer):
    """An action server that records goals, cancels and results, and raises nothing once the node's end closed its
    topics.

    A timer publishes the status five times a second; all action servers of a process share it. rospy closes all topics
    before ``rospy.is_shutdown`` is True, and actionlib checks only that.
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
        """Set up the topics; the shared timer takes the place of the server's own."""
        super().initialize()
        if self.status_timer is not None:
            self.status_timer.shutdown()
            _publish_status_of(self, self.status_frequency)

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


_SERVERS: Dict[float, List[QuietActionServer]] = {}
"""The servers that were started, by how often they publish their status, Hz: each kind has a timer."""
_SERVERS_LOCK = threading.Lock()


def _publish_status_of(server: QuietActionServer, frequency: float) -> None:
    """Publish the status of a server so often, Hz, until the node ends."""
    with _SERVERS_LOCK:
        if frequency not in _SERVERS:
            servers = _SERVERS[frequency] = []
            rospy.Timer(rospy.Duration(1.0 / frequency), lambda event: _publish_all(servers, event))
        _SERVERS[frequency].append(server)


def _publish_all(servers: List[QuietActionServer], event: Any) -> None:
    for server in list(servers):
        try:
            server.publish_status_async(event)
        except Exception:  # its status ends, as with a timer of its own, and that of no other
            _LOG.exception("%s: the status is published no more", server.ns)
            servers.remove(server)
