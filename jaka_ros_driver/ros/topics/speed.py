"""The topic ``~speed_scaling_factor``: the controller's speed override, with which trajectories run, too."""
from typing import Optional

from std_msgs.msg import Float64

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.state import RobotState


class SpeedPublisher:
    """The publisher of the speed override, 0 to 1, latched, with each change.

    Nothing is published where the controller does not report it.
    """

    def __init__(self, arm: ArmClient) -> None:
        self._arm = arm
        self._published: Optional[float] = None
        self._publisher = direct_publisher("~speed_scaling_factor", Float64, 1, latch=True)

    def start(self) -> None:
        """Begin to publish."""
        self._arm.add_listener(self._arrived)

    def _arrived(self, state: RobotState, is_new: bool) -> None:
        if is_new and state.rapid_rate is not None and state.rapid_rate != self._published:
            self._published = state.rapid_rate
            self._publisher.publish(Float64(state.rapid_rate))
