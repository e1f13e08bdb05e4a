"""The driver's velocity jog topics (docs/velocity_jog.md): one message for each command, stamped now."""
from typing import Any, Dict, Sequence

import geometry_msgs.msg as untyped_geometry_msgs
import rospy as untyped_rospy
import sensor_msgs.msg as untyped_sensor_msgs

rospy: Any = untyped_rospy
TwistStamped: Any = untyped_geometry_msgs.TwistStamped
JointState: Any = untyped_sensor_msgs.JointState
_JOINTS = ["joint_%d" % number for number in range(1, 7)]


class JogTopics:
    """Publishers for one driver, connected before they are needed: the first message of a jog must not be lost."""

    def __init__(self, node: str) -> None:
        self._publishers: Dict[str, Any] = {
            topic: rospy.Publisher("%s/%s" % (node, topic), kind, queue_size=1, tcp_nodelay=True)
            for topic, kind in (("jog_joints", JointState), ("jog_twist", TwistStamped))}

    def say(self, space: str, values: Sequence[float]) -> None:
        """Publish velocities, without waiting: of the joints, rad/s, or of the tool, m/s and rad/s; (6,)."""
        if space == "joint":
            joints = JointState(name=_JOINTS, velocity=list(values))
            joints.header.stamp = rospy.Time.now()
            self._publishers["jog_joints"].publish(joints)
            return
        twist = TwistStamped()
        twist.header.stamp, twist.header.frame_id = rospy.Time.now(), space
        for part, three in ((twist.twist.linear, values[:3]), (twist.twist.angular, values[3:])):
            part.x, part.y, part.z = three
        self._publishers["jog_twist"].publish(twist)

    def close(self) -> None:
        """Publish nothing more."""
        for publisher in self._publishers.values():
            publisher.unregister()
