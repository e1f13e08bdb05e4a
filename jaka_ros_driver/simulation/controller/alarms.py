"""Which event the feed's ``errcode`` and ``errmsg`` show (docs/controller-protocol.md section 4.4).

Errors stand until ``clear_error``; soft-limit events while the arm is on the limit; the note that the drives were
disabled until they are enabled again. Warnings, and notes about states in which the arm can move, are kept in the
list of past events only: the maker's SDK ends a blocking move on any ``errcode`` but 0 (docs/sdk-client.md section 5).
"""
from collections import deque
from typing import Deque, NamedTuple, Optional, Tuple

from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent

EMERGENCY_STOP = PlantEvent(0x309082, "emergency stop triggered")
COLLISION = PlantEvent(0x0F0034, "collision detected")
DISABLED_NOTE = PlantEvent(0x10F0005, "robot servo disabled")
"""The text as captured from a real controller (docs/controller-protocol.md section 4.4)."""

_LATCHING = frozenset((
    events.INVERSE_KINEMATICS_FAILED, events.TARGET_UNREACHABLE, events.SINGULARITY_PROTECTIVE_STOP,
    events.LINEAR_MOVE_FAILED, events.SINGULARITY, events.HAND_GUIDING_HIT_SOFT_LIMIT))
_JOINT_KIND = 0xFFFF
_SOFT_LIMIT_KINDS = (0x31, 0x32, 0x35, 0x36)
_MAX_PAST = 200


def joint_collision(joint: int) -> PlantEvent:
    """0x0n0061: joint (index 0..5) hit something, the arm stopped."""
    return PlantEvent((joint << 16) | 0x61, "joint %d collision, stopped" % (joint + 1), joint)


class PastEvent(NamedTuple):
    """An event and when it happened, s of simulated time."""

    at: float
    event: PlantEvent


class Alarms:
    """The event that the status feed shows now, and past events."""

    def __init__(self) -> None:
        self.past: Deque[PastEvent] = deque(maxlen=_MAX_PAST)
        self._emergency_stop = False
        self._error: Optional[PlantEvent] = None
        self._limit: Optional[PlantEvent] = None
        self._note: Optional[PlantEvent] = None

    def raise_event(self, event: PlantEvent, now: float) -> None:
        """Note an event of the arm. An error that is shown already stays the one shown."""
        self.past.append(PastEvent(now, event))
        if event == EMERGENCY_STOP:
            self._emergency_stop = True
        elif event == DISABLED_NOTE:
            self._note = event
        elif event.joint is not None and event.code & _JOINT_KIND in _SOFT_LIMIT_KINDS:
            self._limit = event
        elif event.code in _LATCHING or event == COLLISION or _is_collision(event):
            self._error = self._error or event

    def clear(self, emergency_stop_pressed: bool) -> None:
        """Clear what ``clear_error`` clears; the emergency stop only if its button is released."""
        self._error = self._note = None
        self._emergency_stop = self._emergency_stop and emergency_stop_pressed

    def drives_enabled(self) -> None:
        """The drives are enabled: remove the note that they were disabled."""
        self._note = None

    def left_soft_limit(self) -> None:
        """No joint stands on a soft limit any more."""
        self._limit = None

    def shown(self) -> Tuple[int, str]:
        """Code and text for the feed; (0, "") for none."""
        if self._emergency_stop:
            return EMERGENCY_STOP.code, EMERGENCY_STOP.text
        event = self._error or self._limit or self._note
        return (event.code, event.text) if event else (0, "")


def _is_collision(event: PlantEvent) -> bool:
    return event.joint is not None and event.code & _JOINT_KIND == 0x61
