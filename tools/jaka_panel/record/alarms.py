"""Alarms and notes of an arm in the order of time: the controller's events, the driver's log, this panel's own acts."""
import re
from collections import deque
from typing import Any, Deque, Dict, List, Optional, Tuple

KEPT = 200
"""Newest alarms that are kept, and that each page gets when it comes."""
LEVELS = ("info", "warning", "error")
_EVENT = re.compile(r"(0x[0-9A-Fa-f]+)\s*(.*)", re.DOTALL)
_NO_EVENT = 0
_LONGEST = 500
"""Most characters of an alarm's text."""
_REPEAT_S = 5.0
"""Time, s, within which the same text is the same alarm: a condition that goes on is reported each second."""


class AlarmBook:
    """The newest alarms. Every method that changes something returns what was changed, as JSON has it."""

    def __init__(self) -> None:
        self._alarms: Deque[Dict[str, Any]] = deque(maxlen=KEPT)
        self._count = 0
        self._event: Optional[Dict[str, Any]] = None

    def all(self) -> List[Dict[str, Any]]:
        """Return all entries, oldest first."""
        return list(self._alarms)

    def event(self, wall: float, number: int, text: str, is_alarm: bool) -> List[Dict[str, Any]]:
        """Update the controller's present event, 0 for none; return the entries that have changed.

        Args:
            wall: Seconds since the epoch.
            number: The controller's number of the event.
            text: Text of the event; empty where it is not known yet: it may come later.
            is_alarm: True if it stops the arm; else it is a note or a warning.
        """
        current, changed = self._event, []
        if current is not None and (number == _NO_EVENT or current["code"] != _code(number)):
            current["until"] = wall
            changed.append(current)
            self._event = current = None
        if number == _NO_EVENT:
            return changed
        level = "error" if is_alarm else "warning"
        if current is None:
            self._event = self._add(wall, level, _code(number), text, "controller")
            changed.append(self._event)
        elif (text and current["text"] != text[:_LONGEST]) or current["level"] != level:
            current.update(text=text[:_LONGEST] or current["text"], level=level)
            changed.append(current)
        return changed

    def note(self, wall: float, level: str, text: str, source: str) -> List[Dict[str, Any]]:
        """Add a note of one of ``LEVELS``, unless it repeats the newest one within 5 s; return the entries added."""
        newest = self._alarms[-1] if self._alarms else None
        if newest is not None and (newest["text"], newest["source"]) == (text[:_LONGEST], source) and (
                wall - newest["wall"] < _REPEAT_S):
            return []
        return [self._add(wall, level, None, text, source)]

    def _add(self, wall: float, level: str, code: Optional[str], text: str, source: str) -> Dict[str, Any]:
        self._count += 1
        alarm = {"n": self._count, "wall": round(wall, 3), "until": None if code else round(wall, 3), "level": level,
                 "code": code, "text": text[:_LONGEST], "source": source}
        self._alarms.append(alarm)
        return alarm


def _code(number: int) -> str:
    return "0x%X" % (number & 0xFFFFFFFF)


def event_of(text: str) -> Tuple[int, str]:
    """Parse what /diagnostics call ``event``, as "0x10F0005 drives disabled", to number and text; (0, "") for none."""
    found = _EVENT.match(text.strip())
    return (int(found.group(1), 16), found.group(2).strip()) if found else (_NO_EVENT, "")
