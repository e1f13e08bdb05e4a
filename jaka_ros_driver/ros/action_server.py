"""The action server of actionlib, without a traceback at the node's end."""
import rospy
from actionlib import ActionServer


class QuietActionServer(ActionServer):  # type: ignore[misc]
    """Its timer publishes the status five times a second, also while the node's topics are being closed."""

    def publish_status(self) -> None:
        """Publish the status of all goals; after the node's end nothing."""
        try:
            super().publish_status()
        except rospy.ROSException:
            if not rospy.is_shutdown():
                raise
