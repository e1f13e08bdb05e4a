"""The topic ``~io_states``: every input and output in the status feed, latched.

A change of a digital value is published with the frame that shows it. Analog values are noisy: what changes in them
alone is published ten times a second at most, and only while somebody subscribes. Without a change it is published once
a second, so that a reader can see that it holds.
"""
from typing import Any, Optional, Tuple

import rospy

from jaka_msgs import msg as messages
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.ros import convert
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.jaka_types import warn_absent
from jaka_ros_driver.ros.topics.stamps import SampleStamps
from jaka_ros_driver.state import IoState, RobotState

_PERIOD_S = 1.0
"""Period, s, at which terminals that do not change are published; digital changes are published at once."""
_ANALOG_PERIOD_S = 0.1
"""Shortest period, s, of analog changes, which may come with every frame."""
_QUEUE = 10
"""Messages that wait for a slow subscriber; the newest is the one that counts."""
NOTHING_REPORTED = IoState()


class IoPublisher:
    """The publisher of ``~io_states``, in the client's thread, with each new frame that calls for it.

    A ``jaka_msgs`` from elsewhere (``JAKA_MSGS_EXTERNAL=1``) may lack ``IOStates``; then nothing is published.
    """

    def __init__(self, arm: ArmClient, stamps: SampleStamps) -> None:
        self._arm = arm
        self._stamps = stamps
        self._published = NOTHING_REPORTED
        self._published_at = float("-inf")
        self._publisher: Optional[rospy.Publisher[messages.IOStates]] = None
        if hasattr(messages, "IOStates"):
            self._publisher = direct_publisher("~io_states", messages.IOStates, _QUEUE, latch=True)
        else:
            warn_absent("IOStates", "~io_states is not published", messages)

    def start(self) -> None:
        """Begin to publish."""
        if self._publisher is not None:
            self._arm.add_listener(self._arrived)

    def _arrived(self, state: RobotState, is_new: bool) -> None:
        publisher = self._publisher
        assert publisher is not None
        if is_new and self._is_due(state, publisher) and state.io != NOTHING_REPORTED:
            self._published, self._published_at = state.io, state.received_at
            publisher.publish(convert.io_states(state.io, self._stamps.of(state)))

    def _is_due(self, state: RobotState, publisher: "rospy.Publisher[messages.IOStates]") -> bool:
        age = state.received_at - self._published_at
        if age >= _PERIOD_S:
            return True
        if state.io is self._published:  # as long as no terminal changes, the decoder returns the same again
            return False
        if _digital(state.io) != _digital(self._published):
            return True
        return (age >= _ANALOG_PERIOD_S and bool(publisher.get_num_connections())
                and state.io != self._published)


def _digital(io: IoState) -> Tuple[Any, ...]:
    return (io.digital_inputs, io.digital_outputs, io.relays,
            [(terminals.digital_inputs, terminals.digital_outputs) for terminals in io.field_buses.values()])
