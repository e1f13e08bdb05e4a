"""Log records of the package, which knows nothing of ROS, to rosout, the screen and the node's log file."""
import logging

import rospy

_PACKAGE = "jaka_ros_driver"


class RosLogHandler(logging.Handler):
    """Passes a record on to rospy at its level."""

    def emit(self, record: logging.LogRecord) -> None:
        text = self.format(record)
        if record.levelno >= logging.ERROR:
            rospy.logerr(text)
        elif record.levelno >= logging.WARNING:
            rospy.logwarn(text)
        elif record.levelno >= logging.INFO:
            rospy.loginfo(text)
        else:
            rospy.logdebug(text)


def log_to_ros() -> None:
    """From now on; call after init_node."""
    logger = logging.getLogger(_PACKAGE)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    logger.addHandler(RosLogHandler())
