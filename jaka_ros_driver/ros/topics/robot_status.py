"""The topic ``~robot_status``, which ROS-Industrial clients read before they move an arm.

Published with a status frame, at once when something has changed, else ten times a second; while the controller is
silent ten times a second, with what is not known as UNKNOWN. While nobody subscribes, nothing is computed.
"""
from typing import Any, NamedTuple, Optional

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.client.loop_task import LoopTask
from jaka_ros_driver.errors import ConnectionLost
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.other_messages import message_type
from jaka_ros_driver.ros.topics.stamps import StampClock, ros_clock
from jaka_ros_driver.state import RobotState

UNKNOWN, FALSE, TRUE = -1, 0, 1
"""Values of industrial_msgs/TriState."""
MANUAL, AUTO = 1, 2
"""Values of industrial_msgs/RobotMode, which has UNKNOWN, too."""
_PERIOD_S = 0.1
"""Period, s, at which a status that does not change is published, and the silence of the controller noticed."""
_QUEUE = 10
"""Messages that wait for a slow subscriber; the newest is the one that counts."""
_INT32 = 0x7FFFFFFF


class Truth(NamedTuple):
    """The fields of the message, without its header."""

    mode: int
    e_stopped: int
    drives_powered: int
    motion_possible: int
    in_motion: int
    in_error: int
    error_code: int


NOTHING_KNOWN = Truth(UNKNOWN, UNKNOWN, UNKNOWN, FALSE, UNKNOWN, UNKNOWN, 0)
"""The fields while the controller is silent; this driver then refuses every motion."""


def truth_of(state: RobotState, is_hand_guided: bool, is_motion_possible: bool,
             is_in_motion: bool) -> Truth:
    """Return the fields of the message for a state.

    Args:
        state: Fresh.
        is_hand_guided: Somebody guides the arm by hand: then no client can move it, which is MANUAL.
        is_motion_possible: This driver can move the arm, or moves it.
        is_in_motion: The arm moves, for whatever reason.
    """
    is_fault = state.has_fault and not state.has_warning
    in_error = is_fault or state.emergency_stop or state.protective_stop
    return Truth(
        mode=MANUAL if is_hand_guided else AUTO, e_stopped=int(state.emergency_stop),
        drives_powered=int(state.is_powered), motion_possible=int(is_motion_possible),
        in_motion=int(is_in_motion), in_error=int(in_error),
        error_code=min(state.error_code, _INT32) if is_fault else 0)


class RobotStatusPublisher(LoopTask):
    """The publisher of ``~robot_status`` in the client's thread."""

    def __init__(self, arm: ArmClient) -> None:
        self._arm = arm
        self._type = message_type("industrial_msgs/RobotStatus")
        self._publisher = direct_publisher("~robot_status", self._type, _QUEUE)
        self._clock = StampClock(ros_clock())
        self._newest: Optional[Truth] = None
        self._published_at = self._looked_at = 0.0

    def start(self) -> None:
        """Begin to publish."""
        self._arm.add_listener(self._arrived)
        self._arm.add_task(self)

    def due(self) -> Optional[float]:
        """Return when to check whether the controller is silent, monotonic time, s; None while nobody subscribes."""
        return max(self._published_at, self._looked_at) + _PERIOD_S if self._publisher.get_num_connections() else None

    def run(self, now: float) -> None:
        """Publish that nothing is known, unless there is a fresh state.

        A feed that is only slow is published with its next frame.
        """
        self._looked_at = now
        try:
            self._arm.fresh_state()
        except ConnectionLost:
            self._publish(NOTHING_KNOWN, now)

    def _arrived(self, state: RobotState, is_new: bool) -> None:
        if not is_new or not self._publisher.get_num_connections():
            return
        truth = truth_of(state, self._arm.is_hand_guided(state), self._arm.is_motion_possible,
                         self._is_in_motion(state))
        if truth != self._newest or state.received_at - self._published_at >= _PERIOD_S:
            self._publish(truth, state.received_at)

    def _is_in_motion(self, state: RobotState) -> bool:
        """Return whether the measured joints have moved within the last 0.08 s, or a motion runs that may be too slow
        to show.

        A motion that is held, and servo mode, show only in the joints.
        """
        if self._arm.has_moved_since(state.received_at - REST_TIME_S):
            return True
        is_held = bool(state.is_paused) or state.program_state == 2 or state.rapid_rate == 0.0
        is_servo = self._arm.is_servo_active or self._arm.motion_owner in (
            MotionOwner.SERVO, MotionOwner.TRAJECTORY, MotionOwner.VELOCITY_JOG)
        return state.is_enabled and not state.is_in_position and not is_held and not is_servo

    def _publish(self, truth: Truth, told_at: float) -> None:
        self._newest, self._published_at = truth, told_at
        message: Any = self._type()
        message.header.stamp = self._clock.stamp(told_at)
        for field, value in truth._asdict().items():
            if field == "error_code":
                message.error_code = value
            else:
                getattr(message, field).val = value
        self._publisher.publish(message)
