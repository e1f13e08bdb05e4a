"""The lists of motions on a driver: planned with its kinematics, run part by part by its ``~move_path``."""
import threading
import time
from typing import Any, Callable, Mapping, Optional, Sequence

from roslib import message as roslib_message

from jaka_bag.errors import JakaBagError
from jaka_regression.trajectory_client import GoalClient

from ..plans.motion_list import JOINT, JointAngles, ListMotion, ListPart, ListPlan, plan_list
from ..plans.point_plan import WrongPlan
from ..teach.rotations import FramePose
from .arm_feed import STALE_S, ArmFeed
from .arms import Driver
from .requests import REQUESTS, CallResult, is_same
from .trajectories import START_TOLERANCE_RAD

PLAN_S = 60.0
"""Longest wait, s, for a plan; a page must not wait for ever, and the work is one thread's."""
ACTION, ACTION_TYPE = "move_path", "jaka_msgs/MovePathAction"
_CONNECT_S = 5.0
"""Longest wait, s, for the driver's action server."""
_SETTLE_S = 2.0
"""Longest wait, s, until the arm is seen where the last part ended: topics come a little behind the result."""
_LOOK_S = 0.05
"""Period, s, of the looks whether the list was cancelled: with it a stop takes no longer."""


def is_offered(driver: Driver) -> bool:
    """Return whether a driver runs paths, and their types are installed."""
    return driver.publishes(ACTION + "/status") and roslib_message.get_message_class(ACTION_TYPE) is not None


def plan(driver: Driver, steps: Sequence[Mapping[str, Any]], points: Mapping[str, Mapping[str, Any]],
         begin: JointAngles, limits: Optional[Sequence[Mapping[str, Any]]]) -> ListPlan:
    """Plan a list from where the arm is; it asks the driver for each pose, and is called in a thread that may wait.

    Raises:
        WrongPlan: It cannot be planned, or that takes longer than ``PLAN_S``; the text names the step.
    """
    until = time.monotonic() + PLAN_S

    def asked(name: str, **args: Any) -> Mapping[str, Any]:
        if time.monotonic() > until:
            raise WrongPlan("planning takes longer than %g s" % PLAN_S)
        answer = REQUESTS[name].perform(driver, args)
        if not answer.ok or answer.data is None:
            raise WrongPlan(answer.message or "the driver does not tell the pose")
        return answer.data

    def forward(joints: JointAngles) -> FramePose:
        pose = asked("fk", q=list(joints))
        return FramePose(pose["p"], pose["r"])

    def inverse(pose: FramePose, near: JointAngles) -> JointAngles:
        found: JointAngles = asked("ik", p=list(pose.position), r=list(pose.rotation_vector), near=list(near))["q"]
        return found

    return plan_list(steps, points, begin, limits, forward, inverse)


class StopWatch(threading.Event):
    """The event of any stop since the begin: this panel's, a call of somebody else to the driver, or lost control.

    A path that is sent when the arm was just stopped would begin after the stop.
    """

    def __init__(self, feed: ArmFeed, cancelled: threading.Event, may_go_on: Callable[[], bool]) -> None:
        super().__init__()
        self._feed, self._cancelled, self._may_go_on, self._stops = feed, cancelled, may_go_on, feed.stops

    @property
    def is_stopped(self) -> bool:
        """True once the arm was stopped."""
        return self._cancelled.is_set() or self._feed.stops != self._stops

    def is_set(self) -> bool:
        """Return whether what runs has to end."""
        return self.is_stopped or not self._may_go_on()


class ListRun:
    """One run of a list, in a thread that may wait. What stops the arm ends it, in a wait, too: nothing goes on by
    itself.
    """

    def __init__(self, feed: ArmFeed, may_go_on: Callable[[], bool], cancelled: threading.Event) -> None:
        """Set up.

        Args:
            feed: The driver's topics.
            may_go_on: Returns whether the page still has control.
            cancelled: Set to end it; the arm brakes.
        """
        self._feed, self._may_go_on, self._cancelled = feed, may_go_on, cancelled
        self._stopped = StopWatch(feed, cancelled, may_go_on)

    def run(self, plan: ListPlan) -> CallResult:
        """Run a list from its begin to its end."""
        driver = self._feed.driver
        try:
            client = GoalClient("%s/%s" % (driver.node, ACTION), _known(ACTION_TYPE), "message", _CONNECT_S)
        except JakaBagError as error:
            return CallResult(False, str(error))
        try:
            for part in plan.parts:
                problem = self._against(part) or self._do(client, driver, part)
                if problem:
                    return CallResult(False, "step %d: %s" % (part.step, problem))
        finally:
            client.close()
        return CallResult(True, "")

    def _against(self, part: ListPart) -> str:
        """Return why a part may not begin; empty where it may."""
        away = self._away(part)
        until = time.monotonic() + _SETTLE_S
        while away and not self._ended() and time.monotonic() < until:
            time.sleep(_LOOK_S)
            away = self._away(part)
        return self._ended() or away

    def _away(self, part: ListPart) -> str:
        joints = self._feed.joints
        if joints is None or time.monotonic() - joints.at > STALE_S:
            return "the arm is not seen"
        distance, number = max((abs(a - b), n) for n, (a, b) in enumerate(zip(part.begin, joints.position), 1))
        return "" if distance <= START_TOLERANCE_RAD else (
            "joint %d is %.4f rad from where it begins: move there first" % (number, distance))

    def _ended(self) -> str:
        """Return what has ended the run; empty where it goes on."""
        if self._stopped.is_stopped:
            return "the arm was stopped"
        if not self._may_go_on():
            return "the page has lost control"
        now = time.monotonic()
        status = self._feed.state(now)["status"]
        if status is None or status["age"] > STALE_S:
            return "the arm is not seen"
        if status["e_stopped"] is not False or status["in_error"] is not False or status["drives_powered"] is not True:
            return "the arm has stopped: emergency stop, fault, or no power"
        return ""

    def _do(self, client: GoalClient, driver: Driver, part: ListPart) -> str:
        if part.segments:
            return self._move(client, driver, part)
        if part.output is not None:
            done = REQUESTS["set_output"].perform(driver, part.output)
            return "" if done.ok else done.message or "the output is not set"
        until = time.monotonic() + part.wait
        while time.monotonic() < until:
            ended = self._ended()
            if ended:
                return ended
            self._cancelled.wait(min(_LOOK_S, max(0.0, until - time.monotonic())))
        return ""

    def _move(self, client: GoalClient, driver: Driver, part: ListPart) -> str:
        answer = REQUESTS["fk"].perform(driver, {"q": list(part.begin)})
        if not answer.ok or answer.data is None:
            return answer.message or "the driver does not tell the pose"
        if not is_same(part.pose, FramePose(answer.data["p"], answer.data["r"])):
            return "tool or user frame are others than when the list was planned: plan it anew"
        goal = client.new_goal()
        goal.segments = [_message(segment) for segment in part.segments]
        end = client.perform(goal, self._stopped)
        return "" if end.succeeded else end.text or "the path has ended before its target"


def _known(kind: str) -> Any:
    found = roslib_message.get_message_class(kind)
    if found is None:
        raise WrongPlan("the message type %s is not installed" % kind)
    return found


def _message(segment: ListMotion) -> Any:
    message = _known("jaka_msgs/PathSegment")()
    message.type, message.blend_radius = segment.kind, segment.blend
    message.speed, message.acceleration = segment.speed, segment.acceleration
    if segment.kind == JOINT:
        message.joints = list(segment.joints)
    else:
        message.pose = [*segment.pose.position, *segment.pose.rotation_vector]
    if segment.via is not None:
        message.via = [*segment.via.position, *segment.via.rotation_vector]
    return message
