"""Conversion of FollowJointTrajectory goals to trajectories and tolerances, and of joint states to messages."""
import logging
import math
import time
from dataclasses import replace
from typing import Any, Dict, List, Optional, Sequence, Tuple

import rospy
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.trajectories.controller_params import ControllerParams
from jaka_ros_driver.state import Vector
from jaka_ros_driver.trajectory.follower import LONGEST_AHEAD_S
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import (
    InvalidTrajectory,
    JointTrajectory,
    TrajectoryOfThePast,
    TrajectoryPoint,
    TrajectoryTolerances,
    check_points,
)

_LOG = logging.getLogger(__name__)


class InvalidJoints(InvalidTrajectory):
    """The error that the names are not those of the arm's six joints."""


class TrajectoryDecoder:
    """The decoder of trajectories. Joints may come in any order, with the prefix of the frames or without."""

    def __init__(self, config: DriverConfig, params: ControllerParams) -> None:
        """Set up the decoder; ``params`` hold for goals that name nothing else."""
        self.params = params
        self.joint_names = [config.frame_prefix + joint for joint in JOINTS]
        self._index: Dict[str, int] = dict(zip(JOINTS, range(len(JOINTS))))
        self._index.update(zip(self.joint_names, range(len(JOINTS))))
        self._late = config.late_stamp

    def trajectory(self, message: JointTrajectoryMessage, is_goal: bool = True) -> Optional[JointTrajectory]:
        """Decode a trajectory_msgs/JointTrajectory; None where it has no points, which means: stop.

        is_goal: It is of an action, which must name the joints in any case, and end at rest.

        Raises:
            InvalidJoints: A name is missing, foreign, or there twice.
            InvalidTrajectory: The lengths of a point's fields do not fit; ``check_points`` checks the numbers.
        """
        if not message.points and not is_goal:
            return None
        order = self._order(message.joint_names)
        if not message.points:
            return None
        count = len(message.joint_names)
        points = tuple([self._point(number, point, order, count) for number, point in enumerate(message.points, 1)])
        if message.header.stamp.is_zero():  # as in ros_controllers, such points are past
            points = tuple([point for point in points if not point.time < 0.0]) or points
        held = tuple([joint for joint, place in enumerate(order) if place is None])
        return JointTrajectory(points, _starts_at(message), not is_goal, held)

    def stream_point(self, message: JointTrajectoryMessage) -> Tuple[Vector, float]:
        """Decode the first point of a message: joints, rad (6,), and when the arm is to be there, monotonic time, s.

        Raises:
            InvalidJoints: A name is missing, foreign, or there twice.
            InvalidTrajectory: It is not six finite positions, or its time has gone for too long.
        """
        trajectory = self.trajectory(message, is_goal=False)
        assert trajectory is not None
        if trajectory.held:
            raise InvalidJoints("joint_names lacks %s; a stream needs all joints" % ", ".join(
                [self.joint_names[joint] for joint in trajectory.held]))
        check_points(replace(trajectory, points=trajectory.points[:1]))
        now, point = time.monotonic(), trajectory.points[0]
        due = (now if trajectory.starts_at is None else trajectory.starts_at) + point.time
        if not now - self._late <= due <= now + 2.0 * LONGEST_AHEAD_S:
            raise TrajectoryOfThePast("a point of a stream is due in %.3f s; valid: -%g to %g s" % (
                due - now, self._late, 2.0 * LONGEST_AHEAD_S))
        return point.position, due

    def tolerances(self, goal: Any = None) -> TrajectoryTolerances:
        """Decode the tolerances of a FollowJointTrajectoryGoal, or those of the parameters.

        As in ros_controllers, 0 is the default, and a negative number means that nothing is watched. Only positions are
        watched; the velocity at the end is, by the rest of the arm.

        Raises:
            InvalidJoints, InvalidTrajectory: A name or a number makes no sense.
        """
        path, end = list(self.params.path), list(self.params.goal)
        goal_time: Optional[float] = self.params.goal_time
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
            if tolerance.velocity > 0.0 or tolerance.acceleration > 0.0:
                _LOG.info("%s of %s: only the position is watched on the way; at the end the arm rests", field,
                          tolerance.name)
            if tolerance.position:
                values[index] = tolerance.position if tolerance.position > 0.0 else None

    def _order(self, names: Sequence[str]) -> List[Optional[int]]:
        """Return the position in the message of each joint of the arm; None for one that may be missing."""
        found: Dict[int, int] = {}
        for position, name in enumerate(names):
            index = self._index.get(name)
            if index is None:
                raise InvalidJoints("joint_names has %.60r; the arm has %s" % (name, ", ".join(self.joint_names)))
            if index in found:
                raise InvalidJoints("joint_names has joint %d of the arm twice" % (index + 1))
            found[index] = position
        missing = [name for index, name in enumerate(self.joint_names) if index not in found]
        if missing and not (found and self.params.allows_partial):
            raise InvalidJoints("joint_names lacks %s" % ", ".join(missing))
        return [found.get(index) for index in range(len(JOINTS))]

    @staticmethod
    def _point(number: int, point: JointTrajectoryPoint, order: Sequence[Optional[int]], count: int) -> TrajectoryPoint:
        def values(field: str, is_needed: bool) -> Optional[Vector]:
            given = getattr(point, field)
            if not is_needed and not len(given):
                return None
            if len(given) != count:
                raise InvalidTrajectory("point %d has %d %s; it must be %d%s" % (
                    number, len(given), field, count, "" if is_needed else ", or none"))
            return tuple([0.0 if index is None else given[index] for index in order])
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


def _starts_at(message: JointTrajectoryMessage) -> Optional[float]:
    """Return the time of the message's stamp, monotonic, s; None where it is zero, which means: as soon as possible."""
    stamp = message.header.stamp
    return None if stamp.is_zero() else time.monotonic() + (stamp - rospy.Time.now()).to_sec()
