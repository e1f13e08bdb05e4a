"""The action server of actionlib, without a traceback at the node's end."""
import contextlib
from typing import Any, Iterator

import rospy
from actionlib import ActionServer


class QuietActionServer(ActionServer):  # type: ignore[misc]
    """Publishes nothing more, and raises nothing, once the node's end has closed its topics.

    Its timer publishes the status five times a second. rospy closes all topics before ``rospy.is_shutdown`` says True,
    and actionlib asks only that.
    """

    def publish_status(self) -> None:
        """Publish the status of all goals."""
        with _closed_only_at_the_end():
            super().publish_status()

    def publish_result(self, status: Any, result: Any) -> None:
        """Publish the result of a goal, and the status of all."""
        with _closed_only_at_the_end():
            super().publish_result(status, result)

    def publish_feedback(self, status: Any, feedback: Any) -> None:
        """Publish how far a goal is."""
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
