"""An actionlib client of FollowJointTrajectory, as other people's programs have it, and plans to send."""
import math
import time

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from arm_bench import eventually
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from jaka_ros_driver.ros.other_messages import made_type, message_type

CONTROLLER = "/jaka_zu7_controller"
NAMES = ["joint_%d" % n for n in range(1, 7)]
START = [0.0, 1.5, -1.5, 1.5, 1.5, 0.0]
ACTION = message_type("control_msgs/FollowJointTrajectoryAction")
GOAL = type(ACTION().action_goal.goal)
TOLERANCE = made_type("control_msgs/JointTolerance")
WAIT = 60.0
STATES = {value: name for name, value in vars(GoalStatus).items() if isinstance(value, int) and name.isupper()}


def point(seconds, positions, velocities=(), accelerations=()):
    return JointTrajectoryPoint(positions=list(positions), velocities=list(velocities),
                                accelerations=list(accelerations), time_from_start=rospy.Duration.from_sec(seconds))


def smooth(way, duration, spacing, start=START, has_accelerations=True):
    """Return points of a quintic from rest to rest, so far apart: joint 1 by ``way`` and the others by less."""
    points, count = [], int(round(duration / spacing))
    for number in range(count + 1):
        s = min(1.0, number / count)
        place, speed = s ** 3 * (10 - 15 * s + 6 * s * s), 30 * s * s * (1 - s) ** 2 / duration
        change = 60 * s * (1 - s) * (1 - 2 * s) / duration ** 2
        share = [way / (joint + 1) for joint in range(6)]
        points.append(point(s * duration, [a + w * place for a, w in zip(start, share)], [w * speed for w in share],
                            [w * change for w in share] if has_accelerations else ()))
    return points


def trajectory(points, names=NAMES, stamp=None):
    message = JointTrajectory(joint_names=list(names), points=list(points))
    if stamp is not None:
        message.header.stamp = stamp
    return message


def goal_of(points, names=NAMES, stamp=None, path=(), end=(), seconds=0.0):
    """Return a goal; tolerances as (name, position)."""
    goal = GOAL()
    goal.trajectory = trajectory(points, names, stamp)
    for field, tolerances in ((goal.path_tolerance, path), (goal.goal_tolerance, end)):
        for name, position in tolerances:
            field.append(TOLERANCE(name=name, position=position))
    goal.goal_time_tolerance = rospy.Duration.from_sec(seconds)
    return goal


class Client:
    """A sender of goals that keeps how often each ended, and all feedback."""

    def __init__(self, name=CONTROLLER + "/follow_joint_trajectory"):
        self._client = actionlib.ActionClient(name, ACTION)
        assert self._client.wait_for_server(rospy.Duration(WAIT))
        self.feedback = []
        self.ends = []

    def send(self, goal):
        """Send a goal; return its handle."""
        begun = time.monotonic()

        def changed(handle):
            if handle.get_comm_state() == actionlib.CommState.DONE:
                self.ends.append((handle, time.monotonic() - begun))
        return self._client.send_goal(goal, changed, lambda _, feedback: self.feedback.append(feedback))

    def end(self, handle, timeout=WAIT):
        """Wait for a goal's end; return the name of its terminal state, and its result."""
        assert eventually(lambda: handle.get_comm_state() == actionlib.CommState.DONE, timeout), "it has no end"
        return STATES[handle.get_goal_status()], handle.get_result()

    def run(self, goal):
        return self.end(self.send(goal))

    def close(self):
        self._client.stop()


def joints_of(request):
    return [math.radians(value) for value in request["jointPosition"]]
