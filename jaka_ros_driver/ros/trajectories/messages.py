"""Conversion of FollowJointTrajectory goals to trajectories and tolerances, and of joint states to messages."""
import math
import time
from typing import Any, Dict, List, Optional, Sequence, Tuple

import rospy
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.state import Vector
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import InvalidTrajectory, JointTrajectory, TrajectoryPoint, TrajectoryTolerances


class InvalidJoints(InvalidTrajectory):
    """The error that the names are not those of the arm's six joints."""


class TrajectoryDecoder:
    """The decoder of trajectories. Joints may come in any order, with the prefix of the frames or without."""

    def __init__(self, config: DriverConfig) -> None:
        self.joint_names = [config.frame_prefix + joint for joint in JOINTS]
        self._index: Dict[str, int] = dict(zip(JOINTS, range(len(JOINTS))))
        self._index.update(zip(self.joint_names, range(len(JOINTS))))
        self._config = config

    def trajectory(self, message: JointTrajectoryMessage, may_end_moving: bool = False) -> Optional[JointTrajectory]:
        """Decode a trajectory_msgs/JointTrajectory; None where it has no points, which means: stop.

        Raises:
            InvalidJoints: A name is missing, foreign, or there twice.
            InvalidTrajectory: The lengths of a point's fields do not fit; ``check_points`` checks the numbers.
        """
        if not message.points:
            return None
        order = self._order(message.joint_names)
        points = tuple([self._point(number, point, order) for number, point in enumerate(message.points, 1)])
        stamp, starts_at = message.header.stamp, None
        if not stamp.is_zero():
            starts_at = time.monotonic() + (stamp - rospy.Time.now()).to_sec()
        return JointTrajectory(points, starts_at, may_end_moving)

    def tolerances(self, goal: Any = None) -> TrajectoryTolerances:
        """Decode the tolerances of a FollowJointTrajectoryGoal, or those of the parameters.

        As in ros_controllers, 0 is the default, and a negative number means that nothing is watched. Only positions are
        watched; the velocity at the end is, by the rest of the arm.

        Raises:
            InvalidJoints, InvalidTrajectory: A name or a number makes no sense.
        """
        config = self._config
        path: List[Optional[float]] = [config.trajectory_path_tolerance or None] * len(JOINTS)
        end: List[Optional[float]] = [config.trajectory_goal_tolerance or None] * len(JOINTS)
        goal_time: Optional[float] = config.trajectory_goal_time
        if goal is not None:
            self._apply("path_tolerance", goal.path_tolerance, path)
            self._apply("goal_tolerance", goal.goal_tolerance, end)
            asked = goal.goal_time_tolerance.to_sec()
            goal_time = goal_time if asked == 0.0 else None if asked < 0.0 else asked
        return TrajectoryTolerances(tuple(path), tuple(end), goal_time)

    def _apply(self, field: str, tolerances: Sequence[Any], values: List[Optional[float]]) -> None:
        for tolerance in tolerances:
            index = self._index.get(tolerance.name)
            if index is None:
                raise InvalidJoints("%s names joint %.60r; the arm has %s" % (
                    field, tolerance.name, ", ".join(self.joint_names)))
            if not all(map(math.isfinite, (tolerance.position, tolerance.velocity, tolerance.acceleration))):
                raise InvalidTrajectory("%s of %s holds %r; it must be finite numbers" % (
                    field, tolerance.name, (tolerance.position, tolerance.velocity, tolerance.acceleration)))
            if tolerance.position:
                values[index] = tolerance.position if tolerance.position > 0.0 else None

    def _order(self, names: Sequence[str]) -> List[int]:
        """Return the position in the message of each joint of the arm."""
        found: Dict[int, int] = {}
        for position, name in enumerate(names):
            index = self._index.get(name)
            if index is None:
                raise InvalidJoints("joint_names has %.60r; the arm has %s" % (name, ", ".join(self.joint_names)))
            if index in found:
                raise InvalidJoints("joint_names has joint %d of the arm twice" % (index + 1))
            found[index] = position
        missing = [name for index, name in enumerate(self.joint_names) if index not in found]
        if missing:
            raise InvalidJoints("joint_names lacks %s" % ", ".join(missing))
        return [found[index] for index in range(len(JOINTS))]

    @staticmethod
    def _point(number: int, point: JointTrajectoryPoint, order: Sequence[int]) -> TrajectoryPoint:
        def values(field: str, is_needed: bool) -> Optional[Vector]:
            given = getattr(point, field)
            if not is_needed and not len(given):
                return None
            if len(given) != len(order):
                raise InvalidTrajectory("point %d has %d %s; it must be %d%s" % (
                    number, len(given), field, len(order), "" if is_needed else ", or none"))
            return tuple([given[index] for index in order])
        position = values("positions", True)
        assert position is not None
        return TrajectoryPoint(point.time_from_start.to_sec(), position, values("velocities", False),
                               values("accelerations", False))


def point_message(state: JointState, seconds: float) -> JointTrajectoryPoint:
    """Return a trajectory_msgs/JointTrajectoryPoint of a joint state, ``seconds`` after the trajectory's start."""
    return JointTrajectoryPoint(positions=state.position, velocities=state.velocity, accelerations=state.acceleration,
                                time_from_start=rospy.Duration.from_sec(max(0.0, seconds)))


def fill_states(message: Any, names: Sequence[str], stamp: rospy.Time, desired: JointState,
                actual: Tuple[Vector, Optional[Vector]], seconds: float) -> Any:
    """Fill a FollowJointTrajectoryFeedback or a JointTrajectoryControllerState, which have the same fields.

    ``actual``: measured position and, where it is known, velocity.
    """
    position, velocity = actual
    message.header.stamp = stamp
    message.joint_names = list(names)
    message.desired = point_message(desired, seconds)
    since = message.desired.time_from_start
    message.actual = JointTrajectoryPoint(positions=position, velocities=velocity or (), time_from_start=since)
    message.error = JointTrajectoryPoint(
        positions=tuple([a - b for a, b in zip(desired.position, position)]), time_from_start=since,
        velocities=() if velocity is None else tuple([a - b for a, b in zip(desired.velocity, velocity)]))
    return message
