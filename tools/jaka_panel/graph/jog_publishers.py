"""The driver's velocity jog topics (docs/velocity_jog.md): one message for each command, stamped now."""
from typing import Sequence

import rospy
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState

_JOINTS = ["joint_%d" % number for number in range(1, 7)]


class JogPublishers:
    """Publishers for one driver, connected before they are needed: the first message of a jog must not be lost."""

    def __init__(self, node: str) -> None:
        self._joints = rospy.Publisher(node + "/jog_joints", JointState, queue_size=1, tcp_nodelay=True)
        self._twist = rospy.Publisher(node + "/jog_twist", TwistStamped, queue_size=1, tcp_nodelay=True)

    def is_heard(self, space: str) -> bool:
        """Return whether somebody subscribes to the commands of this space."""
        publisher = self._joints if space == "joint" else self._twist
        return bool(publisher.get_num_connections())

    def publish(self, space: str, values: Sequence[float]) -> None:
        """Publish velocities, without waiting: of the joints, rad/s, or of the tool, m/s and rad/s; (6,)."""
        if space == "joint":
            joints = JointState(name=_JOINTS, velocity=list(values))
            joints.header.stamp = rospy.Time.now()
            self._joints.publish(joints)
            return
        twist = TwistStamped()
        twist.header.stamp, twist.header.frame_id = rospy.Time.now(), space
        for part, three in ((twist.twist.linear, values[:3]), (twist.twist.angular, values[3:])):
            part.x, part.y, part.z = three
        self._twist.publish(twist)

    def close(self) -> None:
        """Publish nothing more."""
        self._joints.unregister()
        self._twist.unregister()
