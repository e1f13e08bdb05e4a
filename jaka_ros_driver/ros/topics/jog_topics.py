"""Velocity jog by topic: the arm moves only while fresh messages of one publisher come.

A message that does not count is refused and logged, once a second at most. A release of the dead-man is in the log
besides.
"""
import math
import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import rospy
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage
from jaka_ros_driver.client.core.velocity_jog.line import turned
from jaka_ros_driver.client.core.velocity_jog.ramp import Wish
from jaka_ros_driver.commands import JOINTS, JogFrame
from jaka_ros_driver.errors import InvalidCommand, JakaError
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.ros.topics.state_publishers import FrameNames

_LOG_PERIOD_S = 1.0
"""Least time, s, between two warnings of a stream whose every message may be wrong."""
_QUEUE = 10
"""Most messages that wait; those that have waited too long are recognised by their age."""
_BASE, _TOOL, _USER = "base", "tool", "user"


class JogSubscribers:
    """The subscribers of ``~jog_twist`` (geometry_msgs/TwistStamped) and ``~jog_joints`` (sensor_msgs/JointState)."""

    def __init__(self, arm: ArmClient, names: FrameNames, frames: FrameReader, recorder: Recorder) -> None:
        """Set up the subscribers.

        names, frames: Of the base, the active tool and the active user frame.
        """
        self._arm = arm
        self._recorder = recorder
        self._frames = frames
        self._names = names

    def start(self) -> None:
        """Subscribe to both topics."""
        for name, kind, to_wish in (("~jog_joints", JointState, lambda message: joint_wish(message, self._names)),
                                    ("~jog_twist", TwistStamped, self._twist_wish)):
            self._recorder.takes_topic(name)
            rospy.Subscriber(name, kind, self._taker(name, to_wish), queue_size=_QUEUE, tcp_nodelay=True)

    def _twist_wish(self, message: TwistStamped) -> Wish:
        state = self._arm.fresh_state()
        flange_t_tool = self._frames.flange_t_tool(state)
        if flange_t_tool is None:
            raise InvalidCommand("the active tool's frame is not known yet")
        twist = message.twist
        velocity = _finite("twist", [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"])
        if message.header.frame_id not in (_USER, self._names.user(state.user_frame_id)):
            return Wish(jog_frame(message.header.frame_id, self._names), velocity, flange_t_tool)
        base_t_user = self._frames.base_t_user(state)
        if base_t_user is None:
            raise InvalidCommand("the active user frame is not known yet")
        return Wish(JogFrame.BASE, turned(base_t_user, velocity), flange_t_tool)

    def _taker(self, name: str, to_wish: Callable[[Any], Wish]) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            received_at, now = time.monotonic(), rospy.Time.now()
            stamp = message.header.stamp
            source = "%s on %s" % (getattr(message, "_connection_header", {}).get("callerid", ""), name)
            read = JogMessage(source, stamp.to_nsec(), (now - stamp).to_sec(), received_at, None)
            try:
                try:
                    read = read._replace(wish=to_wish(message))
                except JakaError as error:  # what cannot be understood releases the dead-man: the core receives it, too
                    read = read._replace(problem=str(error))
                self._arm.jog_velocity(read)
                self._recorder.message(name, message, state=_state(read.wish))
            except JakaError as error:
                self._recorder.message(name, message, str(error), _state(read.wish))
                rospy.logwarn_throttle(_LOG_PERIOD_S, "%s: %s" % (name, error))
        return take


def _state(wish: Optional[Wish]) -> str:
    """Return the name of the stream that a message belongs to in the audit log.

    Messages of zero velocity are a stream of their own: many clients publish them all day.
    """
    return "at rest" if wish is not None and wish.is_zero else ""


def joint_wish(message: JointState, names: FrameNames) -> Wish:
    """Return velocities of joints by name, in any order; a joint that is not named rests. Positions are ignored.

    Raises:
        InvalidCommand: A name is foreign or there twice, there is none, or not one finite velocity for each.
    """
    index: Dict[str, int] = {prefix + joint: number for prefix in ("", names.prefix)
                             for number, joint in enumerate(JOINTS)}
    velocity: List[float] = [0.0] * len(JOINTS)
    if not message.name or len(message.name) != len(message.velocity):
        raise InvalidCommand("%d names and %d velocities; valid: one velocity for each named joint"
                             % (len(message.name), len(message.velocity)))
    seen: List[int] = []
    for name, value in zip(message.name, _finite("velocity", message.velocity)):
        number = index.get(name)
        if number is None or number in seen:
            raise InvalidCommand("name has %.60r %s; valid: %s" % (
                name, "twice" if number in seen else "", ", ".join(names.prefix + joint for joint in JOINTS)))
        seen.append(number)
        velocity[number] = value
    return Wish(JogFrame.JOINT, tuple(velocity))


def jog_frame(frame_id: str, names: FrameNames) -> JogFrame:
    """Return the frame that a message names, other than the user frame: as /tf calls it, or "base" or "tool".

    Raises:
        InvalidCommand: It is another one.
    """
    if frame_id in (_BASE, names.base):
        return JogFrame.BASE
    if frame_id in (_TOOL, names.tool):
        return JogFrame.TOOL
    raise InvalidCommand("frame_id is %.60r; valid: %s" % (frame_id, ", ".join(sorted(
        {_BASE, _TOOL, _USER, names.base, names.tool}))))


def _finite(field: str, values: Sequence[float]) -> Tuple[float, ...]:
    if not all(map(math.isfinite, values)):
        raise InvalidCommand("%s holds %s; it must be finite numbers" % (field, list(values)))
    return tuple(map(float, values))
