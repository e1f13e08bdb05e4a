"""The events and motions in each second around an accident, in words and figures."""
import math
from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from jaka_bag.compare.checks.state_checks import state_name

from .loading import Incident, Motion

_LONGEST = 240
"""Most characters of a line of the account, so that a message of any length leaves it readable."""
AT_REST = 0.01
"""Speed, rad/s, below which a joint counts as still here."""
_TOOL_AT_REST = 0.001
"""Speed, m/s, below which the tool counts as still here: noise of positions and of their differences."""


class IncidentEvent(NamedTuple):
    """Something that happened: when, s; of which sort (``trigger``, ``state``, ``call``, ``failed``, ``fault``,
    ``diagnostics``, ``silence``); in words.
    """

    at: float
    sort: str
    words: str


class Second(NamedTuple):
    """A second, or several in which nothing happened.

    Attributes:
        start: Its first moment, s from the trigger.
        end: Its last moment, s.
        events: Events by time.
        joint: The fastest joint and its speed, rad/s; None without samples.
        tool: Largest speed of a tool point, m/s; None without samples.
    """

    start: int
    end: int
    events: Tuple[IncidentEvent, ...]
    joint: Optional[Tuple[str, float]]
    tool: Optional[float]

    @property
    def is_quiet(self) -> bool:
        """True where nothing happened and nothing was seen to move."""
        return not self.events and (self.joint is None or self.joint[1] < AT_REST) and (
            self.tool is None or self.tool < _TOOL_AT_REST)

    @property
    def is_seen(self) -> bool:
        """True where joints or a tool point were recorded."""
        return self.joint is not None or self.tool is not None


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST else line[:_LONGEST - 3] + "..."


def events_of(incident: Incident) -> List[IncidentEvent]:
    """Return all events by time."""
    events = [IncidentEvent(one.at, "trigger", "TRIGGER %s: %s%s" % (
        one.kind, one.detail, " on %s" % one.topic if one.topic else "")) for one in incident.triggers]
    for topic, fields in incident.states.items():
        for name, (time, value) in fields.items():
            for number in (np.flatnonzero(np.diff(value)) + 1).tolist():
                events.append(IncidentEvent(float(time[number]), "state", "%s %s: %s -> %s" % (
                    topic, name, state_name(name, int(value[number - 1])), state_name(name, int(value[number])))))
    for call in incident.calls:
        words = "%s called by %s: %s" % (call.service, call.caller, _short(call.request))
        if call.success:
            events.append(IncidentEvent(call.at, "call", "%s; succeeded after %.3f s" % (words, call.duration)))
        else:
            events.append(IncidentEvent(call.at, "failed", "%s; FAILED after %.3f s: %s" % (
                words, call.duration, call.error)))
    for change in incident.changes:
        if change.before or change.level != "OK":
            sort = "fault" if change.level == "ERROR" else "diagnostics"
            events.append(IncidentEvent(change.at, sort, "%s: %s%s, %s" % (
                change.name, "%s -> " % change.before if change.before else "", change.level, _short(change.message))))
    for name, at in incident.ended.items():
        events.append(IncidentEvent(at, "silence", "%s: not reported any more" % name))
    for silence in incident.silences:
        events.append(IncidentEvent(silence.start, "silence", "nothing came on %s for %.3f s%s" % (
            silence.topic, silence.end - silence.start,
            ", nor until the end of what is shown" if silence.end == incident.span[1] else "")))
    return sorted(event for event in events if incident.span[0] <= event.at <= incident.span[1])


def _largest(motion: Motion, start: int) -> Optional[Tuple[int, float]]:
    """Return the column with the largest absolute velocity in a second, and that velocity."""
    first, last = np.searchsorted(motion.time, (start, start + 1))
    part = np.abs(motion.velocity[int(first):int(last)])
    part = np.where(np.isfinite(part), part, -1.0)  # a joint without a number hides no other
    if not (part >= 0.0).any():
        return None
    column = int(part.max(axis=0).argmax())
    return column, float(part[:, column].max())


def _fastest_joint(incident: Incident, start: int) -> Optional[Tuple[str, float]]:
    found = []
    for motion in incident.joints.values():
        largest = _largest(motion, start)
        if largest is not None:
            found.append((largest[1], motion.names[largest[0]]))
    return (max(found)[1], max(found)[0]) if found else None


def _tool_speed(incident: Incident, start: int) -> Optional[float]:
    found = []
    for pose in incident.poses.values():
        first, last = np.searchsorted(pose.time, (start, start + 1))
        speed = pose.speed[int(first):int(last)]
        found += [float(speed[np.isfinite(speed)].max())] if np.isfinite(speed).any() else []
    return max(found) if found else None


def _faster(one: Optional[Tuple[str, float]], other: Optional[Tuple[str, float]]) -> Optional[Tuple[str, float]]:
    return one or other if one is None or other is None else max(one, other, key=lambda joint: joint[1])


def _larger(one: Optional[float], other: Optional[float]) -> Optional[float]:
    return max((speed for speed in (one, other) if speed is not None), default=None)


def seconds_of(incident: Incident) -> List[Second]:
    """Return each second with an event or a motion, and the quiet stretches between, each joined into one."""
    by_second: Dict[int, List[IncidentEvent]] = {}
    for event in events_of(incident):
        by_second.setdefault(math.floor(event.at), []).append(event)
    result: List[Second] = []
    for start in range(math.floor(incident.span[0]), math.floor(incident.span[1]) + 1):
        second = Second(start, start + 1, tuple(by_second.get(start, ())), _fastest_joint(incident, start),
                        _tool_speed(incident, start))
        before = result[-1] if result else None
        if before is not None and before.is_quiet and second.is_quiet and before.is_seen == second.is_seen:
            result[-1] = before._replace(end=second.end, joint=_faster(before.joint, second.joint),
                                         tool=_larger(before.tool, second.tool))
        else:
            result.append(second)
    return result
