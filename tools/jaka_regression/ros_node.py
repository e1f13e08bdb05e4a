"""The start of a ROS node that goes on where rospy's log file cannot be written."""
import logging
import sys
import threading
from typing import Any, Optional

import rosgraph.roslogging
import rospy


def become_node(name: str, anonymous: bool = False) -> None:
    """Make this process a ROS node, which leaves signals alone; what becomes of its log file is said in one line.

    By itself rospy ends where the file cannot be opened, and prints a traceback for each line that a full disk does not
    take.

    Args:
        name: Name of the node, where the command line gives none.
        anonymous: A number is added to it.
    """
    configure = rosgraph.roslogging.configure_logging

    def configure_as_far_as_possible(*args: Any, **kwargs: Any) -> Optional[str]:
        try:
            return configure(*args, **kwargs)
        except (OSError, ValueError, rosgraph.roslogging.LoggingException) as error:
            print("%s: there is no log file: %s" % (name, error), file=sys.stderr)
            return None
        finally:
            for handler in logging.getLogger().handlers:
                handler.handleError = tell_once  # type: ignore[method-assign]

    told = threading.Lock()

    def tell_once(record: logging.LogRecord) -> None:
        if told.acquire(blocking=False):
            print("%s: the log file is not written: %s" % (name, sys.exc_info()[1]), file=sys.stderr)

    rosgraph.roslogging.configure_logging = configure_as_far_as_possible
    rospy.init_node(name, anonymous=anonymous, disable_signals=True)
