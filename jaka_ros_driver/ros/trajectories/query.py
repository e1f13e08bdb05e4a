"""The service query_state of the trajectory controller: where the joints are wanted at a time."""
import time
from typing import Any, Optional

import rospy

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.errors import InvalidCommand, JakaError
from jaka_ros_driver.ros.other_messages import service_type
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.services.server import CallCount, ServiceServer
from jaka_ros_driver.state import RobotState, Vector
from jaka_ros_driver.trajectory.path import JointState

_SAME = 1e-4
"""Largest distance, rad, within which a joint is held: the noise of a measured position stays below it."""
_LOG_PERIOD_S = 1.0
"""Least time, s, between two warnings of a client that asks again and again."""


class HeldPosition:
    """The position that the arm holds, and since when.

    Attributes:
        since: Monotonic time, s, since which the commanded joints are the same; None before the first state.
    """

    def __init__(self) -> None:
        self.since: Optional[float] = None
        self._held: Vector = ()

    def observe(self, state: RobotState) -> None:
        """Compare a state with what was held until now."""
        joints = _commanded(state)
        if self.since is None or max([abs(a - b) for a, b in zip(joints, self._held)]) > _SAME:
            self.since, self._held = state.received_at, joints


class StateQuery:
    """The service: the running trajectory's plan, or the held position; what is not known is a service error."""

    def __init__(self, arm: ArmClient, config: DriverConfig) -> None:
        """Set up the service; ``offer`` begins."""
        self._arm = arm
        self._name = config.trajectory_controller_name + "/query_state"
        self._joints = [config.frame_prefix + joint for joint in JOINTS]
        self._held = HeldPosition()
        self._service: Optional[ServiceServer] = None

    def offer(self) -> None:
        """Begin to answer."""
        self._arm.add_listener(lambda state, is_new: self._held.observe(state) if is_new else None)
        query = service_type("control_msgs/QueryTrajectoryState")
        self._service = ServiceServer(self._name, query, lambda request: self._answer(
            request.time, query._response_class()), CallCount())

    def desired_at(self, at: float) -> JointState:
        """Return where the joints are wanted at this moment, monotonic s.

        Raises:
            InvalidCommand: Nobody knows: it is before the running plan or before the arm began to rest, or something
                else than a trajectory moves the arm.
            ConnectionLost: No trajectory runs, and the state is stale.
        """
        planned = self._arm.desired_at(at)
        if planned is not None:
            return planned
        state, owner, since = self._arm.fresh_state(), self._arm.motion_owner, self._held.since
        mover = owner.value if owner is not None else self._arm.foreign_motion
        if mover:
            raise InvalidCommand("no trajectory runs, and something else has the arm: %s" % mover)
        if since is None or at < since:
            raise InvalidCommand("no trajectory runs, and the arm has held its position only since %s" % (
                "now" if since is None else "%.3f s after that time" % (since - at)))
        nothing = (0.0,) * len(JOINTS)
        return JointState(_commanded(state), nothing, nothing)

    def _answer(self, asked: rospy.Time, response: Any) -> Any:
        at = time.monotonic() + (asked - rospy.Time.now()).to_sec()
        try:
            state = self.desired_at(at)
        except JakaError as error:
            text = "the state at %.3f is not known: %s" % (asked.to_sec(), error)
            rospy.logwarn_throttle(_LOG_PERIOD_S, "%s: %s" % (self._name, text))
            raise rospy.ServiceException(text) from None
        response.name = self._joints
        response.position, response.velocity, response.acceleration = state
        return response


def _commanded(state: RobotState) -> Vector:
    return state.joint_position_commanded or state.joint_position
