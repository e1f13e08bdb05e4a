"""The bridge of the package's log records (Python's ``logging``) to rosout, the screen and the node's log file."""
import functools
import logging
import sys
from typing import Any, Callable, List, Optional

import rosgraph.roslogging
import rospy
from rosgraph_msgs.msg import Log
from rospy.impl.registration import get_topic_manager

from jaka_ros_driver.background_log import QUEUE_LIMIT, Background, final
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.errands import ERRANDS

_PACKAGE = "jaka_ros_driver"
_ROSPY_LOGGER = "rosout"
_QUEUE = 100
"""Lines that wait for a listener of /rosout that is slow, as in rospy."""
_LEVELS = {logging.DEBUG: Log.DEBUG, logging.INFO: Log.INFO, logging.WARNING: Log.WARN, logging.ERROR: Log.ERROR,
           logging.CRITICAL: Log.FATAL}


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


class RosoutHandler(logging.Handler):
    """A log handler that publishes on /rosout, as an errand.

    rospy's own has a thread for each listener, and asks the master for a parameter with each line.
    """

    def __init__(self) -> None:
        """Offer the topic; this waits for the master."""
        super().__init__()
        self._tells_topics = not rospy.get_param("/rosout_disable_topics_generation", False)
        self._publisher = direct_publisher("/rosout", Log, _QUEUE, latch=True)

    def emit(self, record: logging.LogRecord) -> None:
        """Hand the record over, or drop it where too much waits."""
        if ERRANDS.waiting < QUEUE_LIMIT:
            ERRANDS.soon(functools.partial(self._publish, final(record), rospy.Time.now()))

    def _publish(self, record: logging.LogRecord, now: rospy.Time) -> None:
        try:
            message = Log(level=_LEVELS.get(record.levelno, Log.INFO), name=rospy.get_name(), msg=self.format(record),
                          file=record.filename, line=record.lineno, function=record.funcName)
            message.header.stamp = now
            if self._tells_topics:
                message.topics = list(get_topic_manager().get_topics())
            self._publisher.publish(message)
        except Exception:  # at the end the topic is closed; a line about it on /rosout would be the next one
            if not rospy.core.is_shutdown_requested():
                logging.getLogger("rospy.rosout").exception("a line is not on /rosout")  # in the log file alone


def log_without_a_file() -> None:
    """Keep the screen and rosout where rospy's log file cannot be written; call before ``rospy.init_node``.

    rospy logs nothing at all without its folder, ends where the file cannot be opened, and prints a traceback for each
    line that a full disk does not take.
    """
    configure = rosgraph.roslogging.configure_logging

    @functools.wraps(configure)
    def configure_at_least_the_screen(*args: Any, **kwargs: Any) -> Optional[str]:
        path = None
        try:
            path = configure(*args, **kwargs)
        except (OSError, ValueError, rosgraph.roslogging.LoggingException) as error:
            print("WARNING: there is no log file: %s; screen and /rosout go on" % error, file=sys.stderr)
        logger = logging.getLogger(_ROSPY_LOGGER)
        if not logger.handlers:
            logger.addHandler(rosgraph.roslogging.RosStreamHandler())
            logger.setLevel(logging.INFO)
        for handler in logging.getLogger().handlers:
            handler.handleError = _Refused(path)  # type: ignore[method-assign]
        return path

    rosgraph.roslogging.configure_logging = configure_at_least_the_screen


class _Refused:
    """The answer of a log handler that cannot write: one warning for all its records."""

    def __init__(self, path: Optional[str]) -> None:
        self._path = path
        self._is_told = False

    def __call__(self, record: logging.LogRecord) -> None:
        if not self._is_told:
            self._is_told = True  # the warning comes to the same handler
            rospy.logwarn("the log file %s is not written: %s; screen and /rosout go on", self._path, sys.exc_info()[1])


def log_to_ros() -> Callable[[float], bool]:
    """Begin to pass records on, after ``rospy.init_node(disable_rosout=True)``.

    Screen and log file have a thread each, because they may stand still; /rosout never does.

    Returns a function that waits for all records to be written, at most the given s; it returns False when some are
    left.
    """
    backgrounds: List[Background] = []
    for name in (_ROSPY_LOGGER, None):  # the log file is the root logger's
        rospy_logger = logging.getLogger(name)
        rospy_logger.handlers = [Background(handler) for handler in rospy_logger.handlers]
        backgrounds += rospy_logger.handlers  # type: ignore[arg-type]
    # the screen, for rospy's own warnings where there is no log file
    if logging.lastResort is not None and not logging.getLogger().handlers:
        logging.lastResort = Background(logging.lastResort)
    logging.getLogger(_ROSPY_LOGGER).addHandler(RosoutHandler())
    logger = logging.getLogger(_PACKAGE)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    logger.addHandler(RosLogHandler())

    def drain_all(timeout: float) -> bool:
        drained = [drain(timeout) for drain in (*(background.drain for background in backgrounds), ERRANDS.drain)]
        return all(drained)

    return drain_all
