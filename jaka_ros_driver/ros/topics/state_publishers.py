"""The state topics and transforms, published for every new sample as it arrives, in the thread of the arm's client.

Nothing is published while the newest state is stale or the status link is down. A message that nobody subscribes to is
not made: its making would cost as much as that of those which are read.
"""
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple, Type, TypeVar

import genpy
import rospy
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from jaka_msgs import msg as messages
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.loop_task import LoopTask
from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.ros import convert
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.ros.jaka_types import warn_absent
from jaka_ros_driver.ros.packed import PackedTopic
from jaka_ros_driver.ros.params import TF_ALL, TF_NONE, DriverConfig
from jaka_ros_driver.ros.topics.stamps import SampleStamps, StampClock, ros_clock
from jaka_ros_driver.ros.topics.state_repeater import StateRepeater, StateThinner
from jaka_ros_driver.ros.topics.velocity import VelocityEstimate
from jaka_ros_driver.state import RobotState, Vector

_Message = TypeVar("_Message", bound=genpy.Message)
_QUEUE = 10
"""Messages that wait for a slow subscriber: 80 ms at 125 Hz; the newest is the one that counts."""
_EARLY_S = 0.0005
"""Longest lead, s, with which a repeat is published, because the timer is no more exact."""


class Sample(NamedTuple):
    """The content of one status frame, kept so that it can be published again."""

    state: RobotState
    stamp: rospy.Time
    is_servo_active: bool
    is_stream_moving: Optional[bool]


class FrameNames:
    """Names of the tf frames, with their prefix."""

    def __init__(self, config: DriverConfig) -> None:
        self.prefix = config.frame_prefix
        self.base = config.frame_prefix + config.base_frame
        self.flange = config.frame_prefix + config.flange_frame
        self.tool = config.frame_prefix + config.tool_frame

    def user(self, user_frame_id: Optional[int]) -> str:
        """Return the name of a user frame; id 0 is the base."""
        return self.base if not user_frame_id else "%suser_frame_%d" % (self.prefix, user_frame_id)


class StatePublishers(LoopTask):
    """The publishers of the state; as a task of the client's thread they repeat samples of a slow feed.

    Attributes:
        stamps: Of the samples.
        joint_states: The publisher of ``~joint_states_topic``, on which others publish joints of their own.
    """

    def __init__(self, arm: ArmClient, config: DriverConfig, frames: FrameReader) -> None:
        self._arm = arm
        self._config = config
        self._frames = frames
        self._names = FrameNames(config)
        self._joint_names = [config.frame_prefix + joint for joint in JOINTS]
        self.stamps = SampleStamps(StampClock(ros_clock()))
        self._velocity = VelocityEstimate()
        self._tool_position: PackedTopic[Any] = PackedTopic(
            _publisher("~tool_position", PoseStamped if config.is_vendor_2025 else TwistStamped),
            convert.POSE_FIELDS if config.is_vendor_2025 else convert.TWIST_FIELDS)
        self._joint_position = PackedTopic(_publisher("~joint_position", JointState), convert.JOINT_FIELDS)
        self._robot_states: Optional[PackedTopic[messages.RobotMsg]] = None
        if hasattr(messages, "RobotMsg"):
            self._robot_states = PackedTopic(_publisher("~robot_states", messages.RobotMsg), convert.ROBOT_FIELDS)
        else:
            warn_absent("RobotMsg", "~robot_states is not published; everything else is served", messages)
        self.joint_states = _publisher(config.joint_states_topic, JointState)
        self._joint_states = PackedTopic(self.joint_states, convert.JOINT_FIELDS)
        self._tf = _publisher("/tf", TFMessage) if config.publish_tf != TF_NONE else None
        self._repeater = StateRepeater(1.0 / config.publish_rate)
        self._thinner = StateThinner(1.0 / config.publish_rate, arm.settings.feed_period)
        self._newest: Optional[Sample] = None
        self._pose_of: Tuple[Optional[Vector], Optional[Vector]] = None, None
        self._pose: Optional[Tuple[float, ...]] = None
        """Pose of the tool as its topic has it, made anew where the feed has another one."""

    def start(self) -> None:
        """Begin to publish."""
        self._arm.add_listener(self._arrived)
        self._arm.add_task(self)

    def due(self) -> Optional[float]:
        """Return when to publish the newest sample again, monotonic time, s; None while the feed is fast enough."""
        due = self._repeater.next_repeat()
        return None if due is None or self._newest is None else due - _EARLY_S

    def run(self, now: float) -> None:
        """Publish the newest sample again, with its own stamp, unless it is stale."""
        newest = self._newest
        if newest is None or now - newest.state.received_at > self._config.stale_after or (
                not self._arm.link_health.status_is_up):
            self._repeater.forget()
        else:
            self._publish(newest)
            self._repeater.repeated(now)

    def joint_velocity(self, state: RobotState) -> Optional[Vector]:
        """Return the joint velocity, rad/s (6,): the controller's, else an estimate at the newest state.

        It is None while there are too few samples.
        """
        return state.joint_velocity if state.joint_velocity is not None else self._velocity.value()

    def _arrived(self, state: RobotState, is_new: bool) -> None:
        self._velocity.add(state)
        if not is_new or not self._thinner.takes(state.received_at):
            return
        stamp = self.stamps.of(state)
        sample = Sample(state, stamp, self._arm.is_servo_active, self._arm.is_stream_moving)
        self._newest = sample
        self._publish(sample)
        self._repeater.arrived(state.received_at)
        if self._joint_states.is_heard():
            _publish_joints(self._joint_states, state, stamp, self._joint_names, self.joint_velocity(state))
        if self._tf is not None and self._tf.get_num_connections():
            self._tf.publish(TFMessage(self._transforms(state, stamp)))

    def _publish(self, sample: Sample) -> None:
        state, stamp = sample.state, sample.stamp
        if self._tool_position.is_heard():
            self._publish_tool(state, stamp)
        if self._joint_position.is_heard():
            _publish_joints(self._joint_position, state, stamp, JOINTS, state.joint_velocity)
        if self._robot_states is not None and self._robot_states.is_heard():
            conditions = convert.robot_conditions(state, sample.is_servo_active, self._config.is_vendor,
                                                  sample.is_stream_moving)
            self._robot_states.publish(True, lambda: convert.robot_states(conditions), conditions)

    def _publish_tool(self, state: RobotState, stamp: rospy.Time) -> None:
        is_2025 = self._config.is_vendor_2025
        if state.tcp_position is not self._pose_of[0] or state.tcp_rpy is not self._pose_of[1]:
            self._pose_of = state.tcp_position, state.tcp_rpy
            self._pose = convert.tool_pose(state) if is_2025 else convert.tool_twist(state, self._config.is_vendor)
        pose = self._pose
        if pose is not None:
            frame = self._names.user(state.user_frame_id)
            make = convert.tool_position_2025 if is_2025 else convert.tool_position
            self._tool_position.publish(frame, lambda: make(pose, stamp, frame), (stamp.secs, stamp.nsecs) + pose)

    def _transforms(self, state: RobotState, stamp: rospy.Time) -> List[TransformStamped]:
        names = self._names
        transforms = []
        if self._config.publish_tf == TF_ALL:
            transforms.append(convert.transform_message(
                forward(self._arm.model, state.joint_position), names.base, names.flange, stamp))
        flange_t_tool = self._frames.flange_t_tool(state)
        if flange_t_tool is not None:
            transforms.append(convert.transform_message(flange_t_tool, names.flange, names.tool, stamp))
        base_t_user = self._frames.base_t_user(state)
        if state.user_frame_id and base_t_user is not None:
            transforms.append(convert.transform_message(
                base_t_user, names.base, names.user(state.user_frame_id), stamp))
        return transforms


def _publish_joints(topic: "PackedTopic[JointState]", state: RobotState, stamp: rospy.Time, names: Sequence[str],
                    velocity: Optional[Vector]) -> None:
    topic.publish(velocity is None, lambda: convert.joint_position(state, stamp, names, velocity),
                  (stamp.secs, stamp.nsecs) + state.joint_position + (velocity or ()))


def _publisher(name: str, message_type: Type[_Message]) -> "rospy.Publisher[_Message]":
    return direct_publisher(name, message_type, _QUEUE)
