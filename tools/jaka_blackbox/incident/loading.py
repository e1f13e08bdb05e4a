"""The part of a log around an accident; every time is in s from the trigger.

Reading raises ``BagError`` where the log cannot be read, ``BagFormatError`` where it is damaged.
"""
import json
from dataclasses import dataclass, field
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Set, Tuple

import numpy as np

from jaka_bag.containers.interface import LogReader, Message
from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.driver_interface import CALL_TYPE, DIAGNOSTICS_TYPE, STATE_TYPE
from jaka_bag.errors import DefinitionError, UsageError
from jaka_bag.log_records import ACCIDENT, DROPS, RECORDING, TRIGGER
from jaka_bag.messages.batch import Array
from jaka_bag.messages.columns import Columns, by_name
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.selection import Selection, TimePoint
from jaka_bag.messages.values import ValueReader
from jaka_bag.operations.columns import ColumnReader
from jaka_bag.paths import PathLike
from jaka_bag.units import NS_PER_S

from ..triggers import TriggerWatch, level_name

JOINT_TYPE = "sensor_msgs/JointState"
POSE_TYPE = "geometry_msgs/TwistStamped"
_POSE_NAME = "tool_position"
_BEFORE_S, _AFTER_S = 60.0, 20.0
"""Time, s, shown before and after a trigger of a log that does not say its own: the recorder's usual times."""
_AXES = ["twist.linear." + axis for axis in "xyz"]
_SILENCES, _LEAST_SILENCE_S, _USUAL_INTERVALS = 40, 0.2, 8.0
"""Silences that are shown; one is longer than this, s, and than so many usual steps: a busy host makes less."""
_STATUS_LASTS_S = 3.5
"""Time, s, without a status of diagnostics, which come once a second, after which it is not reported any more."""
_STEADY = 20
"""Fewest steps of a topic that show what is usual."""


class RecordedTrigger(NamedTuple):
    """The reason why a log was kept: the trigger's time, s, its kind, the observation in words, the topic."""

    at: float
    kind: str
    detail: str
    topic: str


class ServedCall(NamedTuple):
    """One service call; ``at`` is when it arrived, s; ``duration`` until it was answered, s."""

    at: float
    duration: float
    service: str
    caller: str
    success: bool
    error: str
    request: str
    response: str


class StatusChange(NamedTuple):
    """A status of diagnostics that changed, s; ``before`` is empty at its first message."""

    at: float
    name: str
    before: str
    level: str
    message: str


class Silence(NamedTuple):
    """A topic from which nothing came for much longer than usual; from, to, s."""

    start: float
    end: float
    topic: str


class Motion(NamedTuple):
    """Joints or a tool point over time: names, time in s (n,), values (n, k), velocities (n, k); rad or m, and 1/s."""

    names: Tuple[str, ...]
    time: Array
    value: Array
    velocity: Array

    @property
    def speed(self) -> Array:
        """Length of the velocity, shape (n,)."""
        length: Array = np.sqrt((self.velocity ** 2).sum(axis=1))
        return length


@dataclass
class Incident:
    """The facts about an accident in a log.

    Attributes:
        path: Path of the log.
        at_ns: Log time of the trigger, ns since the epoch.
        span: First and last time that is looked at, s.
        triggers: Triggers by time.
        joints: Joint motion, rad, by topic.
        poses: Motion of tool points, m, by topic.
        states: By topic and field: time in s, whole numbers.
        calls: Service calls by time.
        changes: Changes in diagnostics, by time.
        ended: When each status that was not reported to the end was last reported, s, by its name.
        silences: Silences by time.
        counts: Messages by topic.
        drops: Messages known to the recorder as lost, by topic; numbers by kind.
        facts: The recorder's statements about itself, host, clock and versions.
        attachments: Name and size, byte, of each.
        gaps: What the log has and this does not, in words.
    """

    path: str
    at_ns: int
    span: Tuple[float, float]
    triggers: List[RecordedTrigger] = field(default_factory=list)
    joints: Dict[str, Motion] = field(default_factory=dict)
    poses: Dict[str, Motion] = field(default_factory=dict)
    states: Dict[str, Dict[str, Tuple[Array, Array]]] = field(default_factory=dict)
    calls: List[ServedCall] = field(default_factory=list)
    changes: List[StatusChange] = field(default_factory=list)
    ended: Dict[str, float] = field(default_factory=dict)
    silences: List[Silence] = field(default_factory=list)
    counts: Dict[str, int] = field(default_factory=dict)
    drops: Dict[str, Dict[str, Any]] = field(default_factory=dict)
    facts: Dict[str, str] = field(default_factory=dict)
    attachments: List[Tuple[str, int]] = field(default_factory=list)
    gaps: List[str] = field(default_factory=list)


def _metadata(log: LogReader, name: str) -> Iterator[Dict[str, str]]:
    for entry in log.index.metadata:
        if entry.name == name:
            yield log.read_metadata(entry)


def _whole(text: Optional[str]) -> int:
    return int(text) if text and text.isdecimal() and len(text) < 20 else 0


def _seconds(text: Optional[str], otherwise: float) -> float:
    try:
        return float(text or otherwise)
    except ValueError:
        return otherwise


def _first_fault(log: LogReader) -> List[Tuple[int, Any]]:
    """Return the first fault that the messages themselves report."""
    watch = TriggerWatch([], lambda line: None)
    for message in messages_of(log, Selection(types=(STATE_TYPE, CALL_TYPE, DIAGNOSTICS_TYPE))):
        for trigger in watch.look(message.connection, message.data):
            return [(message.log_time, trigger)]
    return []


def _reads(connection: Connection) -> bool:
    return connection.datatype == JOINT_TYPE or connection.datatype == STATE_TYPE or (
        connection.datatype == POSE_TYPE and connection.topic.endswith("/" + _POSE_NAME))


class _Loader:
    def __init__(self, log: LogReader, at: Optional[TimePoint], before_s: Optional[float],
                 after_s: Optional[float]) -> None:
        self._log = log
        index = log.index
        if index.start_time is None or index.end_time is None:
            raise UsageError("%s has no messages" % log.path)
        facts: Dict[str, str] = {}
        for name in (RECORDING, ACCIDENT, ACCIDENT + ".end"):
            for values in _metadata(log, name):
                facts.update(values)
        found = [(_whole(values.get("time_ns")), values) for values in _metadata(log, TRIGGER)]
        triggers = [(at_ns, values.get("kind", ""), values.get("detail", ""), values.get("topic", ""))
                    for at_ns, values in found]
        if at is not None:
            self._at_ns = at.resolve(index.start_time, index.end_time)
        else:
            triggers = triggers or [(at_ns, *fault) for at_ns, fault in _first_fault(log)]
            if not triggers:
                raise UsageError("%s has no trigger, and tells of no fault: say with --at where to look" % log.path)
            self._at_ns = triggers[0][0]
        shown = [self._time(one[0]) for one in triggers] if at is None else [0.0]
        first = -(_seconds(facts.get("before_s"), _BEFORE_S) if before_s is None else before_s)
        last = max(shown) + (_seconds(facts.get("after_s"), _AFTER_S) if after_s is None else after_s)
        span = (max(first, self._time(index.start_time)), min(last, self._time(index.end_time)))
        if not span[1] > span[0]:
            raise UsageError("%s has no messages at that time" % log.path)
        self._incident = Incident(str(log.path), self._at_ns, span, facts=facts, triggers=sorted(
            RecordedTrigger(self._time(at_ns), kind, detail, topic) for at_ns, kind, detail, topic in triggers))
        self._selection = Selection(start_time=self._at_ns + int(span[0] * NS_PER_S) - 1,
                                    end_time=self._at_ns + int(span[1] * NS_PER_S) + 1)

    def _time(self, time_ns: int) -> float:
        return (time_ns - self._at_ns) / NS_PER_S

    def load(self) -> Incident:
        log, incident = self._log, self._incident
        incident.attachments += [(entry.name, entry.data_size) for entry in log.index.attachments]
        for values in _metadata(log, DROPS):
            for topic, text in values.items():
                try:
                    account = json.loads(text)
                except ValueError:
                    continue
                if isinstance(account, dict):
                    incident.drops[topic] = account
        self._load_columns()
        self._load_messages()
        return incident

    def _load_columns(self) -> None:
        kinds: Dict[str, Set[Tuple[str, str]]] = {}
        for connection in self._log.connections:
            kinds.setdefault(connection.topic, set()).add((connection.datatype, connection.md5sum))
        wanted = sorted({c.topic for c in self._log.connections if _reads(c)})
        topics = [topic for topic in wanted if len(kinds[topic]) == 1]
        self._incident.gaps += ["%s has %d definitions: its values are not shown" % (topic, len(kinds[topic]))
                                for topic in wanted if topic not in topics]
        if not topics:
            return
        reader = ColumnReader(self._log, self._selection._replace(topics=topics))
        for topic, columns in reader.read().items():
            time = (columns.log_time - self._at_ns) / NS_PER_S
            if columns.connection.datatype == JOINT_TYPE:
                if not self._take_joints(topic, columns, time):
                    self._incident.gaps.append("%s: its messages differ in their joints, which are not shown" % topic)
            elif columns.connection.datatype == POSE_TYPE:
                value = np.stack([columns.fields[name] for name in _AXES], axis=1)
                self._incident.poses[topic] = Motion(("x", "y", "z"), time, value, _rate(time, value))
            else:
                self._incident.states[topic] = {name: (time, column.astype(np.int64))
                                                for name, column in columns.fields.items()
                                                if column.ndim == 1 and column.dtype.kind in "iub"}

    def _take_joints(self, topic: str, columns: Columns, time: Array) -> bool:
        """Take the joints' motion; return False where it cannot be shown."""
        value, names, velocity = (columns.fields[name] for name in ("position", "name", "velocity"))
        if value.dtype == object or value.ndim != 2 or not value.shape[1]:
            return False
        labels = tuple("joint %d" % (number + 1) for number in range(value.shape[1]))
        if names.dtype != object and names.shape[1:] == value.shape[1:]:
            ordered = [by_name(column, names, names[0]) if column.shape == value.shape else column
                       for column in (value, velocity)]
            if ordered[0] is None or ordered[1] is None:  # the values of one joint would be shown as another's
                return False
            value, velocity = ordered[0], ordered[1]
            labels = tuple(bytes(name).decode("utf-8", "replace") for name in names[0])
        if velocity.dtype == object or velocity.shape != value.shape:
            velocity = _rate(time, value)
        self._incident.joints[topic] = Motion(labels, time, value, velocity)
        return True

    def _load_messages(self) -> None:
        incident = self._incident
        readers: Dict[Connection, Optional[ValueReader]] = {}
        levels: Dict[str, Tuple[str, str]] = {}
        times: Dict[str, List[float]] = {}
        unread: Dict[str, int] = {}
        reported: Dict[str, float] = {}
        for message in messages_of(self._log, self._selection):
            times.setdefault(message.connection.topic, []).append(self._time(message.log_time))
            if message.connection.datatype in (CALL_TYPE, DIAGNOSTICS_TYPE):
                values = _values(readers, message)
                if values is None:
                    unread[message.connection.topic] = unread.get(message.connection.topic, 0) + 1
                elif message.connection.datatype == CALL_TYPE:
                    self._take_call(message, values)
                else:
                    self._take_statuses(message, values, levels)
                    reported.update({status["name"]: self._time(message.log_time) for status in values["status"]})
        incident.counts.update({topic: len(found) for topic, found in sorted(times.items())})
        incident.gaps += ["%s: %d messages are not what its definition says, and are not shown" % (topic, count)
                          for topic, count in sorted(unread.items())]
        incident.ended.update({name: at for name, at in reported.items() if incident.span[1] - at > _STATUS_LASTS_S})
        for topic, found in times.items():
            self._take_silences(topic, found)
        longest = sorted(incident.silences, key=lambda one: one.start - one.end)
        if len(longest) > _SILENCES:
            incident.gaps.append("%d more silences, of at most %.3f s, are not shown" % (
                len(longest) - _SILENCES, longest[_SILENCES].end - longest[_SILENCES].start))
        incident.silences = sorted(longest[:_SILENCES])
        incident.calls.sort()

    def _take_silences(self, topic: str, found: List[float]) -> None:
        """Take the silences of a topic that comes steadily, those before its first and behind its last message, too."""
        steps = np.diff(found)
        usual = float(np.median(steps)) if len(steps) >= _STEADY else 0.0
        limit = max(_USUAL_INTERVALS * usual, _LEAST_SILENCE_S)
        if not 0.0 < usual < limit:
            return
        ends = [self._incident.span[0], *found, self._incident.span[1]]
        self._incident.silences += [Silence(ends[number], ends[number + 1], topic)
                                    for number in np.flatnonzero(np.diff(ends) > limit).tolist()]

    def _take_call(self, message: Message, values: Dict[str, Any]) -> None:
        stamp = values["header"]["stamp"]
        at = self._time(message.log_time) - values["duration"] if not stamp else stamp - self._at_ns / NS_PER_S
        self._incident.calls.append(ServedCall(
            at, values["duration"], values["service"], values["caller"], values["success"], values["error"],
            values["request_text"], values["response_text"]))

    def _take_statuses(self, message: Message, values: Dict[str, Any], levels: Dict[str, Tuple[str, str]]) -> None:
        for status in values["status"]:
            name, now = status["name"], (level_name(status["level"]), status["message"])
            before = levels.get(name)
            levels[name] = now
            if before is None or before[0] != now[0] or (before != now and now[0] != "OK"):
                self._incident.changes.append(StatusChange(self._time(message.log_time), name,
                                                     "" if before is None else before[0], *now))


def _values(readers: Dict[Connection, Optional[ValueReader]], message: Message) -> Optional[Dict[str, Any]]:
    """Return the values of a message; None where its definition does not describe it."""
    try:
        if message.connection not in readers:
            readers[message.connection] = None
            readers[message.connection] = ValueReader(message.connection)
        reader = readers[message.connection]
        return None if reader is None else reader.read(message.data)
    except DefinitionError:
        return None


def _rate(time: Array, value: Array) -> Array:
    """Return differences of neighbours over time, (n, k), for increasing stamps; 0 where there is only one sample."""
    if len(time) < 2:
        return np.zeros(value.shape)
    step = np.diff(time)
    step = np.where(step > 0.0, step, np.inf)
    rate = np.diff(value, axis=0) / step[:, None]
    return np.concatenate([rate[:1], rate])


def load_incident(path: PathLike, at: Optional[TimePoint] = None, before_s: Optional[float] = None,
                  after_s: Optional[float] = None) -> Incident:
    """Load the facts about an accident from a log.

    Args:
        path: Log of a black box, or any other log of the driver's topics.
        at: Time of the accident; None for the first trigger that the log names, else the first fault in it.
        before_s: Time to show before it, s; None for the black box's setting, else 60 s.
        after_s: Time to show after the last trigger, s; None likewise, else 20 s.

    Raises:
        UsageError: There is nothing at that time, or the log has no trigger and no fault.
    """
    with open_log(path) as log:
        return _Loader(log, at, before_s, after_s).load()
