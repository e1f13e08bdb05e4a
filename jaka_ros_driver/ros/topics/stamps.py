"""ROS time for what arrived at a given monotonic time."""
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

    While the system's clock goes back by up to 1 s, stamps go on in steps of 1 us. A larger step back means that the
    clock was set: then the stamps follow it, and a warning is logged.
    """

    def __init__(self, now: Callable[[], rospy.Time] = rospy.Time.now,
                 monotonic: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._monotonic = monotonic
        self._last = 0

    def stamp(self, received_at: float) -> rospy.Time:
        """The ROS time for the monotonic time ``received_at``, s; later than the stamp before."""
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
