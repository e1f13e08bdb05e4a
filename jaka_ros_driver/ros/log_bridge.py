"""The bridge of the package's log records (Python's ``logging``) to rosout, the screen and the node's log file."""
import logging
from typing import Callable

import rospy

from jaka_ros_driver.background_log import Background

_PACKAGE = "jaka_ros_driver"
_ROSPY_LOGGER = "rosout"


class RosLogHandler(logging.Handler):
    """A log handler that passes a record on to rospy at its level."""

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


def log_to_ros() -> Callable[[float], bool]:
    """Begin to pass records on, after ``rospy.init_node``; screen and rosout each have a thread for theirs.

    Returns a function that waits for all records to be written, at most the given s; it returns False when some are
    left.
    """
    rospy_logger = logging.getLogger(_ROSPY_LOGGER)
    backgrounds = [Background(handler) for handler in rospy_logger.handlers]
    rospy_logger.handlers = list(backgrounds)
    logger = logging.getLogger(_PACKAGE)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    logger.addHandler(RosLogHandler())

    def drain_all(timeout: float) -> bool:
        drained = [background.drain(timeout) for background in backgrounds]
        return all(drained)

    return drain_all
