"""An actionlib client of move_path, paths to send, and how near the tool came to their corners."""
import math

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from arm_bench import eventually
from wire_verdict import WireVerdict

from jaka_msgs.msg import MovePathAction, MovePathGoal, PathSegment
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.simulation.arm.profiles import CYCLE_TIME_S

WAIT = 60.0
STATES = {value: name for name, value in vars(GoalStatus).items() if isinstance(value, int) and name.isupper()}
MODEL = load_model("zu7")
TURN = [2.2214, -2.2214, 0.0]
"""Rotation vector of a tool that looks down, rad."""
SQUARE = [(0.46, 0.10), (0.46, 0.16), (0.40, 0.16), (0.40, 0.10)]
"""Corners in the plane z = 0.37, m; a path begins at the last one."""


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


class PathClient:
    """A sender of paths that keeps how often each ended, and all feedback."""

    def __init__(self, name="/jaka_driver/move_path"):
        self._client = actionlib.ActionClient(name, MovePathAction)
        assert self._client.wait_for_server(rospy.Duration(WAIT))
        self.feedback = []
        self.ends = []

    def send(self, segments):
        def changed(handle):
            if handle.get_comm_state() == actionlib.CommState.DONE:
                self.ends.append(handle)
        return self._client.send_goal(MovePathGoal(segments=segments), changed,
                                      lambda _, feedback: self.feedback.append(feedback))

    def end(self, handle):
        """Return the name of a goal's terminal state, and its result."""
        assert eventually(lambda: handle.get_comm_state() == actionlib.CommState.DONE, WAIT), "it has no end"
        return STATES[handle.get_goal_status()], handle.get_result()

    def run(self, segments):
        return self.end(self.send(segments))

    def come_to(self, fraction):
        """Wait until the running path has come so far."""
        assert eventually(lambda: self.feedback and self.feedback[-1].fraction >= fraction, WAIT)

    def close(self):
        self._client.stop()


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
