"""The action ``NAME/gripper_cmd`` (control_msgs/GripperCommand) for a gripper on outputs, and its joint state.

A goal sets the outputs as ``~set_io`` does. Nothing but a goal sets them: neither a start, a stop, a cancel nor the
driver's end, so that a work piece is not dropped.
"""
import logging
import math
import threading
import time
from typing import Any, Callable, Optional, Union

from actionlib.server_goal_handle import ServerGoalHandle
from sensor_msgs.msg import JointState

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.commands import SetAnalogOutput, SetDigitalOutput
from jaka_ros_driver.errors import InvalidCommand, JakaError
from jaka_ros_driver.ros.action_server import QuietActionServer
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.gripper import Gripper, GripperEnd
from jaka_ros_driver.ros.other_messages import message_type
from jaka_ros_driver.ros.services.server import CallCount
from jaka_ros_driver.ros.topics.stamps import SampleStamps
from jaka_ros_driver.state import IoState, RobotState

_LOG = logging.getLogger(__name__)

_LOOK_S = 0.02
"""Period, s, of the looks at the inputs: the delay of a goal's end; less than three frames of the feed."""
_FEEDBACK_PERIOD_S = 0.1
"""Period, s, of the feedback: 10 Hz, as much as a person or a behaviour tree reads."""
_JOINT_PERIOD_S = 0.05
"""Longest period, s, of the gripper's joint where it stands still: 20 Hz."""
SetOutput = Callable[[Union[SetDigitalOutput, SetAnalogOutput]], Any]


class _Goal:
    """A goal that runs.

    Attributes:
        handle: What actionlib knows of it.
        aim: Position that is asked for, m or rad.
        ending: Set when the goal is to end before it has arrived; ``why`` says by what.
    """

    def __init__(self, handle: ServerGoalHandle, aim: float) -> None:
        self.handle = handle
        self.aim = aim
        self.ending = threading.Event()
        self.why = ""

    def end(self, why: str) -> None:
        """Have the goal's thread end it; the first reason counts."""
        if not self.ending.is_set():
            self.why = why
            self.ending.set()


class GripperJoint:
    """The gripper's joint on ``joint_states``, in messages of its own, 20 times a second and on change.

    It is published while its position is known, with the stamp of the status frame that it was seen with. Outputs that
    somebody else sets otherwise end what is known by a goal alone.
    """

    def __init__(self, gripper: Gripper, name: str, publish: Callable[[JointState], None],
                 stamps: SampleStamps) -> None:
        """Set up the joint, which is named ``name`` in the messages given to ``publish``."""
        self._gripper = gripper
        self._name = name
        self._publish = publish
        self._stamps = stamps
        self._lock = threading.Lock()
        self._assumed: Optional[float] = None
        self._aim = 0.0
        self._published_at = float("-inf")
        self.position: Optional[float] = None
        """The position by the newest frame, m or rad; None where it is not known."""

    def assume(self, position: Optional[float], aim: float) -> None:
        """Take the position, m or rad, by the end of a goal; None while a goal runs and after one that failed.

        aim: The position, m or rad, for which the goal has set the outputs.
        """
        with self._lock:
            self._assumed, self._aim = position, aim

    def arrived(self, state: RobotState, is_new: bool) -> None:
        """Take a status frame, in the client's thread."""
        if not is_new:
            return
        before = self.position
        self.position = position = self._position(state)
        if position is None or (position == before and state.received_at - self._published_at < _JOINT_PERIOD_S):
            return
        self._published_at = state.received_at
        message = JointState(name=[self._name], position=[position])
        message.header.stamp = self._stamps.of(state)
        self._publish(message)

    def _position(self, state: RobotState) -> Optional[float]:
        with self._lock:
            if self._assumed is not None and not self._gripper.outputs_hold(state.io, self._aim):
                _LOG.warning("the gripper's outputs were set by somebody else: where it is is not known by its last "
                             "goal any longer")
                self._assumed = None
            try:
                return self._gripper.position(state.io, self._assumed)
            except InvalidCommand:
                return None  # a goal says so; a line for each frame would not help


class GripperAction:
    """The server of the goals, each in a thread of its own; a newer goal ends an older one."""

    def __init__(self, arm: ArmClient, gripper: Gripper, set_output: SetOutput, joint: GripperJoint,
                 recorder: Recorder) -> None:
        """Set up the server; ``offer`` begins.

        Args:
            arm: Its status frames have the inputs.
            gripper: The description.
            set_output: Sets an output as ``~set_io`` does, and raises a JakaError where that fails.
            joint: Its position.
            recorder: Records goals, cancels and results.
        """
        self._arm = arm
        self._gripper = gripper
        self._set_output = set_output
        self._joint = joint
        self._recorder = recorder
        self._goals = CallCount()
        self._changing = threading.Lock()
        self._outputs = threading.Lock()
        self._current: Optional[_Goal] = None
        self._is_closed = False
        kind = message_type("control_msgs/GripperCommandAction")
        self._kind = kind
        self._result = type(kind().action_result.result)
        self._feedback = type(kind().action_feedback.feedback)
        self._server: Optional[QuietActionServer] = None

    def offer(self) -> None:
        """Begin to take goals and to publish the joint."""
        self._arm.add_listener(self._joint.arrived)
        self._server = QuietActionServer(self._gripper.controller + "/gripper_cmd", self._kind, self._take,
                                         self._cancel, self._recorder)
        self._server.start()

    def finish_goals(self, timeout: float) -> None:
        """End the running goal, and wait until it has its result, at most ``timeout`` s; the outputs stay."""
        with self._changing:
            self._is_closed = True
            if self._current is not None:
                self._current.end("the driver ends; the gripper's outputs stay as they are")
        if not self._goals.wait_for_none(timeout):
            _LOG.warning("a goal of the gripper was not answered before the driver shut down")

    # ---- called by actionlib ----

    def _take(self, handle: ServerGoalHandle) -> None:
        command = handle.get_goal().command
        try:
            if self._is_closed:
                raise InvalidCommand("the driver ends")
            goal = _Goal(handle, self._gripper.aim(command.position, command.max_effort))
        except InvalidCommand as error:
            _LOG.info("gripper: %s", error)
            handle.set_rejected(self._result_of(GripperEnd(False, self._joint.position, False, False, "")), str(error))
            return
        with self._changing:
            if self._current is not None:
                self._current.end("replaced by a newer goal")
            self._current = goal
        handle.set_accepted()
        threading.Thread(target=self._carry_out, args=(goal,), name="gripper goal", daemon=True).start()

    def _cancel(self, handle: ServerGoalHandle) -> None:
        with self._changing:
            goal = self._current
            if goal is not None and goal.handle.get_goal_id().id == handle.get_goal_id().id:
                goal.end("cancelled; the gripper's outputs stay as they are")

    # ---- in the goal's own thread ----

    def _carry_out(self, goal: _Goal) -> None:
        with self._goals:
            try:
                end = self._end_of(goal)
            except JakaError as error:
                end = GripperEnd(False, None, False, False, str(error))
            except Exception as error:  # a defect; its client must not wait for ever
                self._finish(goal, GripperEnd(False, None, False, False, "internal error: %r" % error))
                raise
            self._finish(goal, end)

    def _end_of(self, goal: _Goal) -> Optional[GripperEnd]:
        """Set the outputs, and wait for the end; return it, or None where the goal was ended before."""
        with self._outputs:  # of the goals that come together the newest sets its outputs last
            for command in self._gripper.commands(goal.aim):
                if goal.ending.is_set():
                    return None
                self._joint.assume(None, goal.aim)
                self._set_output(command)
        begun = time.monotonic()
        told_at = begun
        watch = self._gripper.watch(goal.aim)
        while not goal.ending.wait(_LOOK_S):
            now = time.monotonic()
            end = watch(self._terminals(begun), now - begun)
            if end is not None:
                return end
            if now - told_at >= _FEEDBACK_PERIOD_S:
                told_at = now
                goal.handle.publish_feedback(self._feedback(
                    position=math.nan if self._joint.position is None else self._joint.position))
        return None

    def _terminals(self, since: float) -> Optional[IoState]:
        """Return the terminals in a frame that came after ``since``, monotonic time, s; None without one."""
        try:
            state = self._arm.fresh_state()
        except JakaError:
            return None
        return state.io if state.received_at > since else None

    def _finish(self, goal: _Goal, end: Optional[GripperEnd]) -> None:
        """Give the goal its result; ``end`` None is that of one which was ended before it arrived."""
        with self._changing:
            is_current = self._current is goal
            if is_current:
                self._current = None
            if is_current and end is not None and end.is_success:
                self._joint.assume(end.position, goal.aim)
        if end is None:
            _LOG.info("gripper: %s", goal.why)
            finish = goal.handle.set_aborted if self._is_closed else goal.handle.set_canceled
            finish(self._result_of(GripperEnd(False, self._joint.position, False, False, goal.why)), goal.why)
            return
        log = _LOG.info if end.is_success else _LOG.warning
        log("gripper: %s", end.text)
        (goal.handle.set_succeeded if end.is_success else goal.handle.set_aborted)(self._result_of(end), end.text)

    def _result_of(self, end: GripperEnd) -> Any:
        return self._result(position=math.nan if end.position is None else end.position, effort=0.0,
                            stalled=end.is_stalled, reached_goal=end.reached_goal)
