"""A client of the driver's action FollowJointTrajectory, through actionlib: one goal, its end, and its cancelling.

control_msgs is not packaged everywhere; where it is not installed, its types are made from definitions of our own
writing, which have the md5 of the published ones.
"""
import threading
import time
from typing import Any, NamedTuple, Sequence, Union

import actionlib
import rospy
from genpy import dynamic
from roslib import message as roslib_message
from trajectory_msgs.msg import JointTrajectoryPoint

from jaka_bag.errors import BagError
from jaka_bag.interrupts import Flag
from jaka_bag.live.graph import RemoteNode
from jaka_bag.messages.batch import Array

from .driver_client import DriverNotThere

ACTION_TYPE = "control_msgs/FollowJointTrajectoryAction"
_SUFFIX = "/follow_joint_trajectory"
_POLL_S = 0.1
"""Longest wait, s, before the next look whether the motion was stopped."""
_BRAKE_S = 5.0
"""Longest wait, s, for the result of a goal that was cancelled: it comes when the arm has braked."""
_SILENCE_S = 10.0
"""Silence, s, after which the action server counts as gone; it publishes its state five times a second."""
_SEPARATOR = "=" * 80 + "\nMSG: %s\n"
_HEAD = "Header header\nactionlib_msgs/%s\n"
_DEFINITIONS = {
    "control_msgs/FollowJointTrajectoryAction": (
        "FollowJointTrajectoryActionGoal action_goal\nFollowJointTrajectoryActionResult action_result\n"
        "FollowJointTrajectoryActionFeedback action_feedback\n"),
    "control_msgs/FollowJointTrajectoryActionGoal": (_HEAD % "GoalID goal_id") + "FollowJointTrajectoryGoal goal\n",
    "control_msgs/FollowJointTrajectoryActionResult": (
        (_HEAD % "GoalStatus status") + "FollowJointTrajectoryResult result\n"),
    "control_msgs/FollowJointTrajectoryActionFeedback": (
        (_HEAD % "GoalStatus status") + "FollowJointTrajectoryFeedback feedback\n"),
    "control_msgs/FollowJointTrajectoryGoal": (
        "trajectory_msgs/JointTrajectory trajectory\nJointTolerance[] path_tolerance\n"
        "JointTolerance[] goal_tolerance\nduration goal_time_tolerance\n"),
    "control_msgs/FollowJointTrajectoryResult": (
        "int32 error_code\nint32 SUCCESSFUL = 0\nint32 INVALID_GOAL = -1\nint32 INVALID_JOINTS = -2\n"
        "int32 OLD_HEADER_TIMESTAMP = -3\nint32 PATH_TOLERANCE_VIOLATED = -4\nint32 GOAL_TOLERANCE_VIOLATED = -5\n"
        "string error_string\n"),
    "control_msgs/FollowJointTrajectoryFeedback": (
        "Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint desired\n"
        "trajectory_msgs/JointTrajectoryPoint actual\ntrajectory_msgs/JointTrajectoryPoint error\n"),
    "control_msgs/JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
}
_INSTALLED = ("std_msgs/Header", "actionlib_msgs/GoalID", "actionlib_msgs/GoalStatus",
              "trajectory_msgs/JointTrajectory", "trajectory_msgs/JointTrajectoryPoint")


class End(NamedTuple):
    """The end of a goal.

    Attributes:
        succeeded: True if the arm rests at the last point.
        text: The driver's message.
        is_known: True if the driver has reported its end; else the arm may still be moving.
    """

    succeeded: bool
    text: str
    is_known: bool = True


def action_type() -> Any:
    """Return the class of control_msgs/FollowJointTrajectoryAction: the installed one, else ``made_action_type``.

    Raises:
        BagError: A type that it holds is not installed.
    """
    return roslib_message.get_message_class(ACTION_TYPE) or made_action_type()


def made_action_type() -> Any:
    """Make the class of FollowJointTrajectoryAction from its definitions here; raise BagError if one is missing."""
    definitions = dict(_DEFINITIONS)
    for name in _INSTALLED:
        known = roslib_message.get_message_class(name)
        if known is None:
            raise BagError("the message type %s is not installed" % name)
        definitions[name] = known._full_text.partition("=" * 80)[0].rstrip("\n") + "\n"
    text = definitions.pop(ACTION_TYPE) + "".join(_SEPARATOR % name + own for name, own in sorted(definitions.items()))
    return dynamic.generate_dynamic(ACTION_TYPE, text)[ACTION_TYPE]


def action_of(master: RemoteNode, node: str) -> str:
    """Name of the action at which a driver takes trajectories, as ``/jaka_zu7_controller/follow_joint_trajectory``.

    Raises:
        DriverNotThere: The node offers none.
        ConnectionLost, ProtocolError: The master does not answer.
    """
    _, subscribers, _ = master.call("getSystemState")
    names = [topic[:-len("/goal")] for topic, nodes in subscribers
             if topic.endswith(_SUFFIX + "/goal") and node in nodes]
    if not names:
        raise DriverNotThere("no node %s takes trajectories: is the driver running? --driver names it" % node)
    return str(sorted(names)[0])


class GoalClient:
    """A client that sends goals of one action; the process must be a ROS node."""

    def __init__(self, action: str, kind: Any, text: str, timeout_s: float) -> None:
        """Connect to an action by its name.

        Args:
            action: Its name.
            kind: Class of its action message.
            text: Field of the result that has the driver's message.
            timeout_s: Longest wait for a server, s.

        Raises:
            DriverNotThere: Nobody offers it within the time.
        """
        self._name, self._text = action, text
        self._client = actionlib.SimpleActionClient(action, kind)
        if not self._client.wait_for_server(rospy.Duration(timeout_s)):
            raise DriverNotThere("nobody answers at %s" % action)

    def new_goal(self) -> Any:
        """Return a goal to be filled in."""
        return self._client.action_client.ActionGoal().goal

    def perform(self, goal: Any, cancelled: Union[Flag, threading.Event]) -> End:
        """Send a goal, and wait for its end; when cancelled, for the rest of the arm after that."""
        if cancelled.is_set():
            return End(False, "interrupted")
        self._client.send_goal(goal)
        heard, status = time.monotonic(), None
        while not self._client.wait_for_result(rospy.Duration(_POLL_S)):
            newest = self._client.action_client.last_status_msg
            if newest is not status:
                heard, status = time.monotonic(), newest
            if time.monotonic() - heard > _SILENCE_S:
                return End(False, "the driver says nothing more at %s" % self._name, False)
            if cancelled.is_set():
                return self._cancel()
        return self._end()

    def close(self) -> None:
        """Leave the action."""
        self._client.stop_tracking_goal()
        self._client.action_client.stop()

    def _cancel(self) -> End:
        self._client.cancel_goal()
        if not self._client.wait_for_result(rospy.Duration(_BRAKE_S)):  # the result comes when the arm rests
            return End(False, "interrupted, and the driver does not say that the arm rests", False)
        return End(False, "interrupted: %s" % self._end().text)

    def _end(self) -> End:
        result = self._client.get_result()
        text = str(getattr(result, self._text)) if result is not None else ""
        return End(self._client.get_state() == actionlib.GoalStatus.SUCCEEDED,
                   text or self._client.get_goal_status_text())


class TrajectoryClient(GoalClient):
    """A client that sends joint trajectories."""

    def __init__(self, action: str, timeout_s: float) -> None:
        """Connect to an action by its name; raise DriverNotThere where nobody offers it within the time, s."""
        super().__init__(action, action_type(), "error_string", timeout_s)

    def follow(self, names: Sequence[str], time_s: Array, position: Array, velocity: Array, acceleration: Array,
               cancelled: Union[Flag, threading.Event]) -> End:
        """Have the arm go along points, and wait for its rest; when cancelled, for the rest after that.

        Args:
            names: Names of the joints.
            time_s: Times of the points, s (n,).
            position: rad (n, joints).
            velocity: rad/s (n, joints).
            acceleration: rad/s2 (n, joints).
            cancelled: Set to have the arm brake on its path.
        """
        goal = self.new_goal()
        goal.trajectory.joint_names = list(names)
        goal.trajectory.points = [
            JointTrajectoryPoint(positions=p, velocities=v, accelerations=a, time_from_start=rospy.Duration.from_sec(t))
            for t, p, v, a in zip(time_s.tolist(), position.tolist(), velocity.tolist(), acceleration.tolist())]
        return self.perform(goal, cancelled)
