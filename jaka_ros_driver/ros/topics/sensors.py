"""The topics ``~wrench``, ``~joint_temperatures``, ``~joint_currents``, offered once the status feed has their values.

A message that nobody subscribes to is not made. Nothing is published of a sample that is stale or lacks the value.
"""
import logging
from typing import Any, Callable, Generic, Optional, Tuple, Type, TypeVar

import genpy
import rospy
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float64MultiArray

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.ros import convert
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.topics.stamps import SampleStamps
from jaka_ros_driver.state import RobotState, Vector

_LOG = logging.getLogger(__name__)

_QUEUE = 10
"""Messages that wait for a slow subscriber; the newest is the one that counts."""
_EARLY = 0.5
"""Share of the feed's period by which a sample may come before a message is due to be taken for it."""
TEMPERATURE_PERIOD_S = 1.0
"""Period, s, of the temperatures, which change in minutes."""
CURRENT_PERIOD_S = 0.1
"""Period, s, of the currents: a load shows, and the topic stays small beside the 125 Hz of the joints."""

_Message = TypeVar("_Message", bound=genpy.Message)
Read = Callable[[RobotState], Optional[Vector]]


class SensorTopic(Generic[_Message]):
    """One topic of values that not every feed has.

    ``read`` takes the values out of a state, ``to_message`` makes the message of a state and its values; ``period``: s
    between two messages at least, 0 for each sample.
    """

    def __init__(self, name: str, message_type: Type[_Message], read: Read,
                 to_message: Callable[[RobotState, Vector], _Message],
                 period: float = 0.0) -> None:
        self._name = name
        self._type = message_type
        self._read = read
        self._to_message = to_message
        self._period = period
        self._published_at = float("-inf")
        self._publisher: Optional[rospy.Publisher[_Message]] = None

    def offer_where_it_is_known(self, state: RobotState) -> None:
        """Offer the topic where the state has its values."""
        if self._publisher is None and self._read(state) is not None:
            self._publisher = direct_publisher(self._name, self._type, _QUEUE)

    def publish(self, state: RobotState, early: float) -> None:
        """Publish a new sample, where it is due within ``early``, s."""
        publisher = self._publisher
        if publisher is None or not publisher.get_num_connections():
            return
        if state.received_at - self._published_at < self._period - early:
            return
        values = self._read(state)
        if values is not None:
            self._published_at = state.received_at
            publisher.publish(self._to_message(state, values))


class SensorPublishers:
    """The topics of the force sensor and of the joints' drives.

    To offer a topic takes a call of the master, which may take long: ``offer`` does it, and is called by another thread
    than the client's.
    """

    def __init__(self, arm: ArmClient, stamps: SampleStamps, sensor_frame: str) -> None:
        """Set up the topics; none is offered yet.

        sensor_frame: The frame of the wrench.
        """
        self._arm = arm
        self._early = _EARLY * arm.settings.feed_period
        self._sensor_error = 0
        self._topics: Tuple[SensorTopic[Any], ...] = (
            SensorTopic("~wrench", WrenchStamped, lambda state: state.wrench, lambda state, values: convert.wrench(
                values, stamps.of(state), sensor_frame)),
            SensorTopic("~joint_temperatures", Float64MultiArray, lambda state: state.joint_temperature,
                        lambda _, values: convert.for_each_joint(values), TEMPERATURE_PERIOD_S),
            SensorTopic("~joint_currents", Float64MultiArray, lambda state: state.joint_current,
                        lambda _, values: convert.for_each_joint(values), CURRENT_PERIOD_S))

    def start(self) -> None:
        """Begin to publish the offered topics."""
        self._arm.add_listener(self._arrived)

    def offer(self) -> None:
        """Offer the topics of which the newest state has the values, and log when the sensor fails or recovers."""
        state = self._arm.state
        if state is None:
            return
        for topic in self._topics:
            topic.offer_where_it_is_known(state)
        if state.sensor_error != self._sensor_error:
            self._sensor_error = state.sensor_error
            if state.sensor_error:
                _LOG.warning("the force sensor reports error %d: ~wrench is silent", state.sensor_error)
            else:
                _LOG.info("the force sensor reports no error any more")

    def _arrived(self, state: RobotState, is_new: bool) -> None:
        if is_new:
            for topic in self._topics:
                topic.publish(state, self._early)
