"""ROS time of what arrived at a monotonic time."""
import logging
import time
from typing import Callable

import rospy

from jaka_ros_driver.units import NS_PER_S

_LOG = logging.getLogger(__name__)

_TICK_NS = 1000
_SET_BACK_NS = NS_PER_S


class StampClock:
    """Turns arrival times into stamps that strictly increase.

    Small steps back of the system's clock are bridged by steps of 1 us. One of more than 1 s means that the clock was
    set: then the stamps follow it, and a warning tells so.
    """

    def __init__(self, now: Callable[[], rospy.Time] = rospy.Time.now,
                 monotonic: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._monotonic = monotonic
        self._last = 0

    def stamp(self, received_at: float) -> rospy.Time:
        """The ROS time of the monotonic time ``received_at``, s; later than the one before."""
        ago = self._monotonic() - received_at
        nanoseconds = max(0, self._now().to_nsec() - int(ago * NS_PER_S))
        if nanoseconds <= self._last:
            if self._last - nanoseconds > _SET_BACK_NS:
                _LOG.warning("the system's clock was set back by %.3f s; stamps follow it",
                             (self._last - nanoseconds) / NS_PER_S)
            else:
                nanoseconds = self._last + _TICK_NS
        self._last = nanoseconds
        return rospy.Time(*divmod(nanoseconds, NS_PER_S))
