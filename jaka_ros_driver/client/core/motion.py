"""The base class of all motions, with their kinds and the conditions in which one rests or is held."""
import enum
from typing import Optional

from jaka_ros_driver.client.core.stillness import MOVEMENT, REST_TIME_S
from jaka_ros_driver.commands import JogStop
from jaka_ros_driver.errors import MotionInterrupted
from jaka_ros_driver.state import RobotState

_NEVER = float("inf")
_REACH = 1.5
"""Largest reach, m: a joint turns at least by the tool's way divided by it."""


class MotionOwner(enum.Enum):
    """The kinds of use that may hold the arm's motion; the value is the name in refusals.

    Those from SETTING on move nothing: the arm rests, and nothing may move it meanwhile.
    """

    MOVE = "a move"
    JOG = "a jog"
    SERVO = "servo mode"
    TRAJECTORY = "a trajectory"
    VELOCITY_JOG = "a velocity jog"
    PATH = "a path"
    PROGRAM = "a program"
    LEFT = "what a dead driver left moving"
    SETTING = "a change of frames, payload or hand guiding"
    SENSOR = "the zeroing of the force sensor"
    ZONES = "a change of the zones"
    LOADING = "the loading of a program"
    LOOK = "the motion guard's look at a move"
    AUDIT = "the audit of a path"


class ArmMotion:
    """One motion, from before its first byte until custody of it ends.

    Attributes:
        owner: Its kind.
        rest_time: How long the joints must be still to show that it has ended, s.
        deadline: When its time is over, s; infinite where it has no limit.
        is_leaving: It comes to its end by itself: who wants the arm waits for that.
        is_answered_at_rest: After a stop its callers are answered when the arm rests, not when the stop is accepted.
        jog_stop: The command that ends its jog; None where it is none.
        is_beside_program: A program was paused at the controller when it began: a resumption would run that, too.
    """

    owner = MotionOwner.MOVE
    rest_time = REST_TIME_S
    deadline = _NEVER
    is_leaving = False
    is_answered_at_rest = False
    jog_stop: Optional[JogStop] = None
    is_beside_program = False

    @property
    def name(self) -> str:
        """The name of this kind of motion, for messages."""
        return self.owner.value

    def begin(self, now: float) -> None:
        """Send the motion's first command.

        Raises:
            JakaError: Nothing was sent.
        """
        raise NotImplementedError

    def due(self) -> float:
        """Return when ``tick`` is due, s."""
        return self.deadline

    def wants_servo_mode(self, since: float) -> Optional[bool]:
        """Return whether the motion has needed servo mode all the time since then, s; None while it enters or leaves
        it.
        """
        return False

    def observe(self, state: RobotState, now: float) -> None:
        """Take a fresh state into account; not called any more while the motion is being stopped."""

    def tick(self, now: float) -> None:
        """Let time pass; not called any more while the motion is being stopped."""

    def prepare(self) -> None:
        """Compute in idle time what the next ``tick`` needs, as far as it is known; nothing is sent."""

    def observe_stop(self, state: RobotState) -> None:
        """Take a fresh state into account while the motion is being stopped."""

    def may_be_left(self, state: RobotState) -> bool:
        """Return whether this state, after an accepted stop or a refusal and with joints at rest, shows no further
        motion.
        """
        return True

    def goes_on(self, state: RobotState) -> bool:
        """Return whether the motion is known to go on after an accepted stop, with joints at rest, and must be stopped
        again.
        """
        return not self.may_be_left(state)

    def halt(self) -> Optional[JogStop]:
        """Send nothing any more, because the motion is being stopped; return the command that ends its jog, or None."""
        return self.jog_stop

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        """Answer the callers of the motion: it is completed (None), or was interrupted.

        Only the first outcome counts.
        """


def is_held(state: RobotState) -> bool:
    """Return whether the feed gives a reason why an arm rests within its motion: a pause, or a speed override of 0."""
    return bool(state.is_paused) or state.rapid_rate == 0.0


def event_text(state: RobotState) -> str:
    """Return the controller's event in words; empty for none."""
    if not state.error_code:
        return ""
    return ("event 0x%X %s" % (state.error_code, state.error_message)).rstrip()


def rest_time_at(speed: float, is_linear: bool) -> float:
    """Return the time of stillness, s, in which a motion of this speed, rad/s (m/s of the tool), would be seen.

    The audit's lowest speed (``limits.SLOWEST``) bounds it to 1.2 s.
    """
    joint_speed = speed / _REACH if is_linear else speed
    return max(REST_TIME_S, 2.0 * MOVEMENT / joint_speed)
