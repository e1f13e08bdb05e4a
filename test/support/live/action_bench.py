"""Actionlib clients of FollowJointTrajectory and move_path, goals to send, and the way that the tool took."""
import math
import time

import actionlib
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import WAIT, eventually
from wire_verdict import WireVerdict

from jaka_msgs.msg import MovePathAction, MovePathGoal, PathSegment
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.ros.other_messages import made_type, message_type
from jaka_ros_driver.simulation.arm.profiles import CYCLE_TIME_S

CONTROLLER = "/jaka_zu7_controller"
NAMES = ["joint_%d" % n for n in range(1, 7)]
START = [0.0, 1.5, -1.5, 1.5, 1.5, 0.0]
ACTION = message_type("control_msgs/FollowJointTrajectoryAction")
GOAL = type(ACTION().action_goal.goal)
TOLERANCE = made_type("control_msgs/JointTolerance")
STATES = {value: name for name, value in vars(GoalStatus).items() if isinstance(value, int) and name.isupper()}
MODEL = load_model("zu7")
TURN = [2.2214, -2.2214, 0.0]
"""Rotation vector of a tool that looks down, rad."""
SQUARE = [(0.46, 0.10), (0.46, 0.16), (0.40, 0.16), (0.40, 0.10)]
"""Corners in the plane z = 0.37, m; a path begins at the last one."""


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

    def __init__(self, name=CONTROLLER + "/follow_joint_trajectory", action=ACTION):
        self._client = actionlib.ActionClient(name, action)
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

    def cancel(self, handle):
        """Ask for the end of a goal, which may have ended meanwhile.

        The handle's own ``cancel`` then waits for an answer for ever: it sets its state without a look at the old one.
        """
        goal = handle.comm_state_machine.action_goal.goal_id.id
        self._client.pub_cancel.publish(GoalID(stamp=rospy.Time(0), id=goal))

    def end(self, handle, timeout=WAIT):
        """Wait for a goal's end; return the name of its terminal state, and its result."""
        assert eventually(lambda: handle.get_comm_state() == actionlib.CommState.DONE, timeout), "it has no end"
        return STATES[handle.get_goal_status()], handle.get_result()

    def run(self, goal):
        return self.end(self.send(goal))

    def close(self):
        self._client.stop()


class PathClient(Client):
    """A sender of paths, each given by its segments."""

    def __init__(self, name="/jaka_driver/move_path"):
        super().__init__(name, MovePathAction)

    def send(self, segments):
        return super().send(MovePathGoal(segments=segments))

    def come_to(self, fraction):
        """Wait until the running path has come so far."""
        assert eventually(lambda: self.feedback and self.feedback[-1].fraction >= fraction)


def joints_of(request):
    return [math.radians(value) for value in request["jointPosition"]]


def joint(joints, speed=2.0, acceleration=8.0, radius=0.0):
    return PathSegment(type=PathSegment.JOINT, joints=list(joints), speed=speed, acceleration=acceleration,
                       blend_radius=radius)


def line(x, y, z=0.37, speed=0.2, acceleration=2.0, radius=0.0):
    return PathSegment(type=PathSegment.LINE, pose=[x, y, z] + TURN, speed=speed, acceleration=acceleration,
                       blend_radius=radius)


def arc(via, end, z=0.37, speed=0.2, acceleration=2.0, radius=0.0):
    return PathSegment(type=PathSegment.ARC, via=[*via, z] + TURN, pose=[*end, z] + TURN, speed=speed,
                       acceleration=acceleration, blend_radius=radius)


def square(radius=0.0, speed=0.2):
    return [line(x, y, radius=radius if n < 3 else 0.0, speed=speed) for n, (x, y) in enumerate(SQUARE)]


def tool_way(log_file, since):
    """Return places of the tool, m, cycle by cycle."""
    return [forward(MODEL, joints)[9:] for at, joints in WireVerdict(log_file).joints() if at >= since]


def bow(log_file, since, index):
    """Return by what factor the straight line behind a sample of the joints may be farther off the curve than at one
    cycle.

    A line over two cycles, where the simulator was late, is four times as far off as one over one cycle.
    """
    times = [at for at, _ in WireVerdict(log_file).joints() if at >= since]
    return max(1.0, (times[index + 1] - times[index]) / CYCLE_TIME_S) ** 2


def nearest(way, place):
    """Return (distance, index) of the way's nearest place, in its unit, on straight lines from one to the next."""
    best = math.inf, 0
    for index, (a, b) in enumerate(zip(way, way[1:])):
        step = [q - p for p, q in zip(a, b)]
        square_of_step = sum(s * s for s in step)
        share = (sum((c - p) * s for p, c, s in zip(a, place, step)) / square_of_step) if square_of_step else 0.0
        at = [p + min(1.0, max(0.0, share)) * s for p, s in zip(a, step)]
        best = min(best, (math.dist(at, place), index))
    return best
