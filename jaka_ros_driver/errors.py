"""The errors of this package, one class for each cause. Callers catch ``JakaError`` or one of its children."""
import enum
from typing import Union


class JakaError(Exception):
    """Base class of all errors that this package expects; every other exception is a defect."""


class InvalidCommand(JakaError, ValueError):
    """The caller's request is malformed or outside the arm's limits; nothing was sent."""


class UnreachablePose(InvalidCommand):
    """No joint position within the limits puts the flange there."""


class PoseOutsideLimits(UnreachablePose):
    """The pose is within reach, but only with a joint outside its limits."""


class CommandRejected(JakaError):
    """The controller answered the command with an error code.

    Attributes:
        command: The controller's name of the command (``cmdName``).
        code: The controller's ``errorCode``; an int where it is a number, else its text.
        reason: The controller's own words, or the meaning of the code where it sent none.
    """

    def __init__(self, command: str, code: Union[int, str], reason: str) -> None:
        super().__init__("controller rejected %s: code %s, %s" % (command, code, reason))
        self.command = command
        self.code = code
        self.reason = reason


class ProtocolError(JakaError):
    """The peer's bytes break the protocol."""


class FramingError(ProtocolError):
    """Bytes that cannot be cut into JSON objects: garbage, an object that never ends, one too large."""


class StatusFrameError(ProtocolError):
    """A status frame that lacks an essential field or holds a value of the wrong type or range."""


class ReplyTimeout(JakaError, TimeoutError):
    """The controller did not answer in time; whether it acted on the command is unknown.

    Attributes:
        command: The controller's name of the command.
        waited_s: How long the reply was waited for, s.
    """

    def __init__(self, command: str, waited_s: float) -> None:
        super().__init__("no reply to %s within %.3g s" % (command, waited_s))
        self.command = command
        self.waited_s = waited_s


class StopNotSeen(JakaError, TimeoutError):
    """The controller accepted a stop, and the arm was not seen at rest in time."""


class ConnectionLost(JakaError, ConnectionError):
    """The link to the controller is down, or went down before the reply came."""


class StopCause(enum.Enum):
    """The reason why an accepted motion did not complete; the value is the phrase shown to users."""

    STOPPED = "stopped by request"
    PROTECTIVE_STOP = "protective stop"
    EMERGENCY_STOP = "emergency stop"
    FAULT = "controller fault"
    NOT_ENABLED = "drives not enabled"
    LINK_LOST = "link to the controller lost"
    TIMEOUT = "timed out"
    SHUTDOWN = "driver shut down"
    CANCELLED = "cancelled by its client"
    REPLACED = "replaced by another trajectory"
    MOTION_GUARD = "stopped by the motion guard"


class MotionInterrupted(JakaError):
    """An accepted motion ended before it was completed.

    Attributes:
        cause: The ``StopCause``.
    """

    def __init__(self, cause: StopCause, detail: str = "") -> None:
        super().__init__(cause.value + (": " + detail if detail else ""))
        self.cause = cause


class PathInterrupted(MotionInterrupted):
    """A path of several segments ended before it was completed.

    Attributes:
        completed: Number of segments that have ended.
        fraction: Of the whole path, 0 to 1.
    """

    def __init__(self, why: MotionInterrupted, completed: int, count: int, fraction: float) -> None:
        super().__init__(why.cause)
        self.args = ("%s; %d of %d segments completed, %.1f %% of the path" % (
            why, completed, count, 100.0 * fraction),)
        self.completed = completed
        self.fraction = fraction


class PathToleranceViolated(MotionInterrupted):
    """The arm left its trajectory by more than was allowed; it was stopped."""

    def __init__(self, detail: str) -> None:
        super().__init__(StopCause.FAULT, detail)


class GoalToleranceViolated(MotionInterrupted):
    """The arm did not come to rest near enough to the end of its trajectory in time; it was stopped."""

    def __init__(self, detail: str) -> None:
        super().__init__(StopCause.TIMEOUT, detail)
