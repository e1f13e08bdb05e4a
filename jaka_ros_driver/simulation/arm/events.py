"""The events of the moving arm: entries of the event list (docs/controller-protocol.md section 4.4)."""
from typing import NamedTuple, Optional

from jaka_ros_driver.errors import JakaError


class PlantEvent(NamedTuple):
    """One entry of the controller's event list, as it happened.

    Attributes:
        code: Number in the event list, e.g. 0x020031.
        text: The event in words.
        joint: Joint index 0..5 where the event names one, else None.
    """

    code: int
    text: str
    joint: Optional[int] = None


NOT_ALLOWED_IN_MODE = PlantEvent(0x0F0003, "not allowed in this mode")
INVERSE_KINEMATICS_FAILED = PlantEvent(0x0F0004, "inverse kinematics failed")
BAD_SPEED = PlantEvent(0x0F0010, "bad speed in move")
TARGET_OUTSIDE_LIMITS = PlantEvent(0x0F0011, "move target outside limits")
TARGET_UNREACHABLE = PlantEvent(0x0F0017, "target unreachable")
SINGULARITY_PROTECTIVE_STOP = PlantEvent(0x0F0018, "singularity, protective stop")
LINEAR_MOVE_FAILED = PlantEvent(0x0F0020, "moveL failed to reach target")
SINGULARITY = PlantEvent(0x0F0033, "singularity")
JOINT_MOVE_NOT_ADDED = PlantEvent(0x0F0038, "joint move not added")
HAND_GUIDING_ON_SOFT_LIMIT = PlantEvent(0x0F0040, "drag refused, on soft limit")
HAND_GUIDING_HIT_SOFT_LIMIT = PlantEvent(0x0F0041, "drag hit the soft limit, drag left")
HAND_GUIDING_REFUSED_MOVING = PlantEvent(0x0F0044, "drag refused, moving")
SERVO_STARVED = PlantEvent(0x0F0003, "servo stream ran dry")
"""The event of a dry servo stream; its code is a guess: no entry for it was found in the maker's list."""


class TargetRejected(JakaError):
    """The error that the arm cannot run a motion.

    Nothing was queued and no error is latched: the next valid motion runs.

    Attributes:
        event_code: Of the event with the reason (docs/controller-protocol.md section 4.4), e.g. 0x0F0017.
        reason: Why, in words.
    """

    def __init__(self, event: PlantEvent, reason: str = "") -> None:
        """Set event and reason.

        reason: Why, in words; empty for the event's own text.
        """
        self.event_code, self.reason = event.code, reason or event.text
        super().__init__("0x%06X: %s" % (self.event_code, self.reason))


def overspeed(joint: int) -> PlantEvent:
    """Return event 0x0n0030: joint (index 0..5) went faster than its limit."""
    return _of_joint(joint, 0x30, "overspeed")


def on_soft_limit(joint: int, upper: bool) -> PlantEvent:
    """Return event 0x0n0031 or 32: joint (index 0..5) stands on its upper or lower soft limit."""
    return _of_joint(joint, 0x31 + (not upper), "on %s soft limit" % "-+"[upper])


def near_soft_limit(joint: int, upper: bool) -> PlantEvent:
    """Return event 0x0n0033 or 34: joint (index 0..5) is about to hit its upper or lower soft limit."""
    return _of_joint(joint, 0x33 + (not upper), "about to hit %s soft limit" % "-+"[upper])


def jog_beyond_limit(joint: int, upper: bool) -> PlantEvent:
    """Return event 0x0n0035 or 36: the jog leads beyond the upper or lower soft limit of joint (index 0..5)."""
    return _of_joint(joint, 0x35 + (not upper), "jog target beyond %s soft limit" % "-+"[upper])


def of_jog(cause: PlantEvent) -> PlantEvent:
    """Return the event that a jog reports where its path, or a joint's range, ends for this cause."""
    return cause if cause.joint is None else jog_beyond_limit(cause.joint, cause == on_soft_limit(cause.joint, True))


def joint_collision(joint: int) -> PlantEvent:
    """Return event 0x0n0061: joint (index 0..5) hit something, the arm stopped."""
    return _of_joint(joint, 0x61, "collision, stopped")


def _of_joint(joint: int, kind: int, what: str) -> PlantEvent:
    return PlantEvent((joint << 16) | kind, "joint %d %s" % (joint + 1, what), joint)
