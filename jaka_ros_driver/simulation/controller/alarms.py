"""The event in the feed's ``errcode`` and ``errmsg`` (docs/controller-protocol.md section 4.4).

Errors stand until ``clear_error``; soft-limit events while the arm is on the limit; the note that the drives were
disabled until they are enabled again. Warnings, and notes about states in which the arm can move, are kept in the list
of past events only: the maker's SDK ends a blocking move on any ``errcode`` but 0 (docs/sdk-client.md section 5).
"""
from collections import deque
from typing import Deque, Optional, Tuple

from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent

EMERGENCY_STOP = PlantEvent(0x309082, "emergency stop triggered")
COLLISION = PlantEvent(0x0F0034, "collision detected")
DISABLED_NOTE = PlantEvent(0x10F0005, "robot servo disabled")
"""The note of disabled drives; its text was captured from a real controller (docs/controller-protocol.md section 4.4).
"""

_LATCHING = frozenset((
    COLLISION, events.INVERSE_KINEMATICS_FAILED, events.TARGET_UNREACHABLE, events.SINGULARITY_PROTECTIVE_STOP,
    events.LINEAR_MOVE_FAILED, events.SINGULARITY, events.HAND_GUIDING_HIT_SOFT_LIMIT))
_SOFT_LIMIT_KINDS = (0x31, 0x32, 0x35, 0x36)
_COLLISION_KIND = 0x61
_MAX_PAST = 200
"""Newest events that are kept: a controller that runs for weeks takes no more memory."""


class Alarms:
    """The event that the status feed shows now, and past events.

    Attributes:
        past: The last events, oldest first, each with the simulated time at which it happened, s.
    """

    def __init__(self) -> None:
        self.past: Deque[Tuple[float, PlantEvent]] = deque(maxlen=_MAX_PAST)
        self._emergency_stop: Optional[PlantEvent] = None
        self._error: Optional[PlantEvent] = None
        self._limit: Optional[PlantEvent] = None
        self._note: Optional[PlantEvent] = None
        self._refused: Optional[PlantEvent] = None

    def raise_event(self, event: PlantEvent, now: float) -> None:
        """Record an event of the arm. An error that is shown already stays the one shown."""
        self.past.append((now, event))
        kind = None if event.joint is None else event.code & 0xFFFF
        if event == EMERGENCY_STOP:
            self._emergency_stop = event
        elif event == DISABLED_NOTE:
            self._note = event
        elif kind in _SOFT_LIMIT_KINDS:
            self._limit = event
        elif event in _LATCHING or kind == _COLLISION_KIND:
            self._error = self._error or event

    def clear(self, emergency_stop_pressed: bool) -> None:
        """Clear what ``clear_error`` clears; the emergency stop only if its button is released."""
        self._error = self._note = self._refused = None
        if not emergency_stop_pressed:
            self._emergency_stop = None

    def drives_enabled(self) -> None:
        """Remove the note that the drives were disabled, because they are enabled."""
        self._note = None

    def move_refused(self, event: PlantEvent, now: float) -> None:
        """Record that a move was refused; it latches nothing (docs/controller-protocol.md section 4.3)."""
        self.past.append((now, event))
        self._refused = event

    def move_accepted(self) -> None:
        """Remove the event of an earlier refused move, because one was accepted."""
        self._refused = None

    def left_soft_limit(self) -> None:
        """Remove the soft-limit event, because no joint stands on a soft limit any more."""
        self._limit = None

    def shown(self) -> Tuple[int, str]:
        """Return code and text for the feed; (0, "") for none."""
        event = self._emergency_stop or self._error or self._limit or self._refused or self._note
        return (event.code, event.text) if event else (0, "")
