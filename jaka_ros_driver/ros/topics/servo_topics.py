"""Servo targets by topic: streaming without the cost of a service call each.

Targets are absolute and in SI units in both interfaces. A refused target moves nothing; the refusal is logged and
counted. A target whose stamp is old, or from a clock that is ahead, is refused: it may come from a played bag or from a
buffer that was held up. Many clients stamp nothing; a stamp of zero gives no age and counts.
"""
from typing import Any, Callable, Union

import rospy
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.velocity_jog.dead_man import AHEAD_S, FRESH_S
from jaka_ros_driver.commands import ServoJoint, ServoPose
from jaka_ros_driver.errors import InvalidCommand, JakaError
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.convert import RequestDecoder
from jaka_ros_driver.ros.topics.state_publishers import FrameNames

_LOG_PERIOD_S = 1.0
"""Least time, s, between two warnings of a stream whose every message may be wrong."""


class ServoTopics:
    """The subscribers of ``~servo_j_command`` (sensor_msgs/JointState) and ``~servo_p_command``
    (geometry_msgs/PoseStamped).
    """

    def __init__(self, arm: ArmClient, decoder: RequestDecoder, names: FrameNames, recorder: Recorder) -> None:
        self._arm = arm
        self._recorder = recorder
        self._decoder = decoder
        self._names = names
        self.refused = 0

    def start(self) -> None:
        """Subscribe to both topics."""
        for name, kind, to_command in (("~servo_j_command", JointState, self._decoder.servo_joint_topic),
                                       ("~servo_p_command", PoseStamped, self._pose_target)):
            self._recorder.takes_topic(name)
            rospy.Subscriber(name, kind, self._taker(name, to_command), queue_size=1, tcp_nodelay=True)

    def _pose_target(self, message: PoseStamped) -> ServoPose:
        state = self._arm.fresh_state()
        return self._decoder.servo_pose_topic(message, self._names.user(state.user_frame_id))

    def _taker(self, name: str, to_command: Callable[[Any], Union[ServoJoint, ServoPose]]) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            try:
                require_fresh(message.header.stamp, rospy.Time.now())
                self._arm.servo_target(to_command(message))
                self._recorder.message(name, message)
            except JakaError as error:
                self._recorder.message(name, message, str(error))
                self.refused += 1
                rospy.logwarn_throttle(_LOG_PERIOD_S, "%s: %s" % (name, error))
        return take


def require_fresh(stamp: rospy.Time, now: rospy.Time) -> None:
    """Refuse a stamp that is older than ``FRESH_S`` or more than ``AHEAD_S`` in the future; zero passes.

    Raises:
        InvalidCommand: The message has the stamp's age.
    """
    if stamp.is_zero():
        return
    age = (now - stamp).to_sec()
    if not -AHEAD_S <= age <= FRESH_S:
        raise InvalidCommand("refused: header.stamp is %.3f s %s; valid: 0, or at most %g s old and %g s ahead" % (
            abs(age), "old" if age > 0.0 else "in the future", FRESH_S, AHEAD_S))
