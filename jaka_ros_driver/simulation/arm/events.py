"""What the arm reports while it moves: entries of the event list (docs/controller-protocol.md section 4.4)."""
from typing import NamedTuple, Optional

from jaka_ros_driver.errors import JakaError

NOT_ALLOWED_IN_MODE = 0x0F0003
INVERSE_KINEMATICS_FAILED = 0x0F0004
BAD_SPEED = 0x0F0010
TARGET_OUTSIDE_LIMITS = 0x0F0011
JOINT_ON_SOFT_LIMIT = 0x0F0016
TARGET_UNREACHABLE = 0x0F0017
SINGULARITY_PROTECTIVE_STOP = 0x0F0018
LINEAR_MOVE_FAILED = 0x0F0020
SINGULARITY = 0x0F0033
JOINT_MOVE_NOT_ADDED = 0x0F0038
HAND_GUIDING_ON_SOFT_LIMIT = 0x0F0040
HAND_GUIDING_HIT_SOFT_LIMIT = 0x0F0041
HAND_GUIDING_REFUSED_MOVING = 0x0F0044

_OVERSPEED = 0x30
_SOFT_LIMIT = 0x31
_NEAR_LIMIT = 0x33
_JOG_BEYOND_LIMIT = 0x35

_TEXTS = {
    NOT_ALLOWED_IN_MODE: "not allowed in this mode",
    INVERSE_KINEMATICS_FAILED: "inverse kinematics failed",
    BAD_SPEED: "bad speed in move",
    TARGET_OUTSIDE_LIMITS: "move target outside limits",
    JOINT_ON_SOFT_LIMIT: "joint on soft limit",
    TARGET_UNREACHABLE: "target unreachable",
    SINGULARITY_PROTECTIVE_STOP: "singularity, protective stop",
    LINEAR_MOVE_FAILED: "moveL failed to reach target",
    SINGULARITY: "singularity",
    JOINT_MOVE_NOT_ADDED: "joint move not added",
    HAND_GUIDING_ON_SOFT_LIMIT: "drag refused, on soft limit",
    HAND_GUIDING_HIT_SOFT_LIMIT: "drag hit the soft limit, drag left",
    HAND_GUIDING_REFUSED_MOVING: "drag refused, moving",
}


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


class TargetRejected(JakaError):
    """The arm cannot run this motion. Nothing was queued and no error is latched: the next valid motion runs.

    Attributes:
        event_code: The event that says why (docs/controller-protocol.md section 4.4), e.g. 0x0F0017.
        reason: Why, in words.
    """

    def __init__(self, event_code: int, reason: str) -> None:
        super().__init__("0x%06X: %s" % (event_code, reason))
        self.event_code = event_code
        self.reason = reason


def event(code: int) -> PlantEvent:
    """The event of this code, one that names no joint."""
    return PlantEvent(code, _TEXTS[code])


def overspeed(joint: int) -> PlantEvent:
    """0x0n0030: joint (index 0..5) went faster than its limit."""
    return _of_joint(joint, _OVERSPEED, "overspeed")


def on_soft_limit(joint: int, upper: bool) -> PlantEvent:
    """0x0n0031 / 32: joint (index 0..5) stands on its upper or lower soft limit."""
    return _of_joint(joint, _SOFT_LIMIT + (not upper), "on %s soft limit" % "-+"[upper])


def near_soft_limit(joint: int, upper: bool) -> PlantEvent:
    """0x0n0033 / 34: joint (index 0..5) is about to hit its upper or lower soft limit."""
    return _of_joint(joint, _NEAR_LIMIT + (not upper), "about to hit %s soft limit" % "-+"[upper])


def jog_beyond_limit(joint: int, upper: bool) -> PlantEvent:
    """0x0n0035 / 36: the jog leads beyond the upper or lower soft limit of joint (index 0..5)."""
    return _of_joint(joint, _JOG_BEYOND_LIMIT + (not upper), "jog target beyond %s soft limit" % "-+"[upper])


def _of_joint(joint: int, kind: int, what: str) -> PlantEvent:
    return PlantEvent((joint << 16) | kind, "joint %d %s" % (joint + 1, what), joint)
