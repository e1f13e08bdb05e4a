"""The topics ``~motion_state`` and ``~program/state``: the progress and the ends of accepted moves and programs."""
import functools
import itertools
import threading
from concurrent.futures import Future
from typing import Optional

import rospy

from jaka_msgs import msg as messages
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.errands import ERRANDS
from jaka_ros_driver.ros.jaka_types import warn_absent
from jaka_ros_driver.state import ProgramState, RobotState

_NOT_PUBLISHED = "the topic %s is not published; everything else is served"

_QUEUE = 100
"""Messages that wait for a slow subscriber: each is an event that comes once, so many more than of states."""
_JOG = "jog"
"""The id of a velocity jog on ``~motion_state``."""


class MotionEnds:
    """The publisher of both topics, latched, with each change, in the order of events.

    Events are recorded by the threads that see them, and published as errands: the client's, which holds its lock then,
    must not wait.
    A ``jaka_msgs`` from elsewhere (``JAKA_MSGS_EXTERNAL=1``) may lack either type, as the maker's does; then a warning
    is logged, and its topic is not published.
    """

    def __init__(self, arm: ArmClient) -> None:
        self._arm = arm
        self._ids = itertools.count(1)
        self._shown: Optional[int] = None
        self._foreign = ""
        self._jog_obstacle = ""
        self._program = ""
        self._reason = ""
        self._lock = threading.Lock()
        self._moves: Optional[rospy.Publisher[messages.MotionState]] = None
        self._programs: Optional[rospy.Publisher[messages.ProgramState]] = None
        if hasattr(messages, "MotionState"):
            self._moves = direct_publisher("~motion_state", messages.MotionState, _QUEUE, latch=True)
        else:
            warn_absent("MotionState", _NOT_PUBLISHED % "~motion_state", messages)
        if hasattr(messages, "ProgramState"):
            self._programs = direct_publisher("~program/state", messages.ProgramState, _QUEUE, latch=True)
        else:
            warn_absent("ProgramState", _NOT_PUBLISHED % "~program/state", messages)

    def start(self) -> None:
        """Begin to publish."""
        self._look_for_foreign_motion()
        self._arm.add_listener(self._arrived)

    def move_accepted(self, end: "Future[None]") -> str:
        """Publish that a move was accepted; return the id under which its end will be published."""
        number = str(next(self._ids))
        self._publish_move(number, "ACCEPTED", "")
        end.add_done_callback(lambda done: self._move_ended(number, done))
        return number

    def program_loaded(self, name: str) -> None:
        """Publish the name of the loaded program."""
        with self._lock:
            self._program, self._reason = name, ""
        self._publish_program()

    def program_began(self, end: "Future[None]") -> None:
        """Take note that a program of this driver runs, and publish its end."""
        with self._lock:
            self._reason = ""
        end.add_done_callback(self._program_ended)

    # ---- inside ----

    def _move_ended(self, number: str, end: "Future[None]") -> None:
        error = end.exception()
        if error is None:
            self._publish_move(number, "COMPLETED", "the target is reached")
        else:
            self._publish_move(number, "STOPPED", str(error))

    def _program_ended(self, end: "Future[None]") -> None:
        error = end.exception()
        with self._lock:
            self._reason = "completed" if error is None else str(error)
        self._publish_program()

    def _look_for_foreign_motion(self) -> None:
        """Publish the begin and the end of a motion in nobody's custody, or of one that a dead driver left."""
        text, before = self._arm.foreign_motion, self._foreign
        if text != before:
            self._foreign = text
            self._publish_move("", "FOREIGN" if text else "FOREIGN_ENDED", text or "ended: " + before)

    def _look_for_a_standing_jog(self) -> None:
        """Publish that the tool of a velocity jog stands, though it is asked to move, and that it does so no more."""
        obstacle = self._arm.velocity_jog.obstacle
        if obstacle != self._jog_obstacle:
            self._jog_obstacle = obstacle
            self._publish_move(_JOG, "STOPPED" if obstacle else "ACCEPTED", obstacle)

    def _arrived(self, state: RobotState, is_new: bool) -> None:
        self._look_for_foreign_motion()
        self._look_for_a_standing_jog()
        if is_new and state.program_state is not None and state.program_state != self._shown:
            self._shown = state.program_state
            self._publish_program()

    def _publish_move(self, number: str, state: str, reason: str) -> None:
        if self._moves is not None:
            message = messages.MotionState(id=number, state=getattr(messages.MotionState, state), reason=reason)
            message.header.stamp = rospy.Time.now()
            ERRANDS.soon(functools.partial(self._moves.publish, message))

    def _publish_program(self) -> None:
        if self._programs is None or self._shown is None:
            return
        with self._lock:
            shown = self._shown if self._shown in tuple(ProgramState) else messages.ProgramState.UNKNOWN
            message = messages.ProgramState(state=shown, program=self._program, reason=self._reason)
        message.header.stamp = rospy.Time.now()
        ERRANDS.soon(functools.partial(self._programs.publish, message))
