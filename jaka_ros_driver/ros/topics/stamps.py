"""The ROS time of what arrived at a given monotonic time."""
import logging
import time
from typing import Callable, Optional

import rospy

from jaka_ros_driver.state import RobotState
from jaka_ros_driver.units import NS_PER_S

_LOG = logging.getLogger(__name__)

_TICK_NS = 1000
"""Smallest step, ns, from one stamp to the next: a smaller one is lost in seconds as a float, as ``to_sec`` gives."""
_SET_BACK_NS = NS_PER_S


class StampClock:
    """The clock that turns arrival times into stamps that strictly increase.

    While the system's clock goes back by up to 1 s, stamps go on in steps of 1 us. A larger step back means that the
    clock was set: then the stamps follow it, and a warning is logged.
    """

    def __init__(self, now_ns: Callable[[], int] = time.time_ns,
                 monotonic: Callable[[], float] = time.monotonic) -> None:
        """Set up the clock.

        now_ns: The ROS time now, ns; see ``ros_clock``.
        """
        self._now_ns = now_ns
        self._monotonic = monotonic
        self._last = 0

    def stamp(self, received_at: float) -> rospy.Time:
        """Return the ROS time for the monotonic time ``received_at``, s; later than the last stamp, and never zero.

        While the time is 0, a simulated clock that does not run, stamps go on in steps as well.
        """
        ago = self._monotonic() - received_at
        now = self._now_ns()
        nanoseconds = max(_TICK_NS, now - int(ago * NS_PER_S))
        if nanoseconds <= self._last:
            if now > 0 and self._last - nanoseconds > _SET_BACK_NS:
                _LOG.warning("the system's clock was set back by %.3f s; stamps follow it",
                             (self._last - nanoseconds) / NS_PER_S)
            else:
                nanoseconds = self._last + _TICK_NS
        self._last = nanoseconds
        stamp = rospy.Time.__new__(rospy.Time)  # its constructor looks for floats and takes five times as long
        stamp.secs, stamp.nsecs = divmod(nanoseconds, NS_PER_S)
        return stamp


class SampleStamps:
    """The stamp of each sample: all messages made of one sample have the same."""

    def __init__(self, clock: StampClock) -> None:
        self._clock = clock
        self._state: Optional[RobotState] = None
        self._stamp = rospy.Time()

    def of(self, state: RobotState) -> rospy.Time:
        """Return the ROS time at which the sample arrived; samples come in order. Two that arrive together have two
        stamps.
        """
        if state is not self._state:
            self._state, self._stamp = state, self._clock.stamp(state.received_at)
        return self._stamp


def ros_clock() -> Callable[[], int]:
    """Return a function that returns the ROS time, ns: the system's clock, or under ``/use_sim_time`` the simulated
    one.

    ``rospy.Time.now`` takes thirty times as long as the system's clock by itself.
    """
    if rospy.get_param("/use_sim_time", False):
        return lambda: int(rospy.Time.now().to_nsec())
    return time.time_ns
