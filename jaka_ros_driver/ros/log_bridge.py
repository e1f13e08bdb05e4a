"""Log records of the package, which knows nothing of ROS, to rosout, the screen and the node's log file."""
import contextlib
import logging
import queue
import threading
from typing import Callable

import rospy

_PACKAGE = "jaka_ros_driver"
_ROSPY_LOGGER = "rosout"
_QUEUE_LIMIT = 1000


class Background(logging.Handler):
    """Gives records to another handler in a thread of its own; what does not fit into its queue is left out.

    Who logs then never waits for a terminal or a pipe that nobody reads, nor for a master that does not answer: a
    thread that stops the arm logs as well.
    """

    def __init__(self, handler: logging.Handler) -> None:
        super().__init__(handler.level)
        self._handler = handler
        self._records: queue.Queue[logging.LogRecord] = queue.Queue(_QUEUE_LIMIT)
        threading.Thread(target=self._run, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        _settle(record)
        try:
            self._records.put_nowait(record)
        except queue.Full:
            return

    def drain(self, timeout: float) -> bool:
        """Wait until all records are out, s at most; False when some are still there."""
        with self._records.all_tasks_done:
            return self._records.all_tasks_done.wait_for(lambda: not self._records.unfinished_tasks, timeout)

    def _run(self) -> None:
        while True:
            record = self._records.get()
            try:
                self._handle(record)
            finally:
                self._records.task_done()

    def _handle(self, record: logging.LogRecord) -> None:
        """What the handler cannot write, it gets once more in plain letters; one record never ends all others."""
        try:
            self._handler.handle(record)
        except Exception:  # a terminal that knows only ASCII, one that is gone, a bug in the handler
            record.msg = ascii(record.msg)[1:-1]
            record.exc_info = record.exc_text = record.stack_info = None
            with contextlib.suppress(Exception):
                self._handler.handle(record)


def _settle(record: logging.LogRecord) -> None:
    """Make the record's text final here, where its arguments are what they were, and such that UTF-8 can hold it.

    A text with half a character in it would spoil the buffer of rosout's publisher for all texts after it.
    """
    try:
        text = record.getMessage()
    except Exception as error:  # the message does not fit its arguments; who logs must not fall over that
        text = "%s (%r with %.200r)" % (error, record.msg, record.args)
    record.msg, record.args = _writable(text), None
    if record.exc_info:
        record.exc_text = _writable(logging.Formatter().formatException(record.exc_info))


def _writable(text: str) -> str:
    return text.encode("utf-8", "replace").decode("utf-8")


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


def log_to_ros() -> Callable[[float], bool]:
    """From now on; call after init_node. The screen and rosout each get their records in a thread of their own.

    Returns:
        A function that waits until all records are out, s at most; False when some are still there.
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
