"""Reads a log into a ``Run``: the topics of the driver's interface by type, of all others the times."""
from dataclasses import replace
from typing import Dict, List, Optional, Sequence, Set, Tuple

import numpy as np

from ..containers.contract import LogReader
from ..containers.registry import open_log
from ..errors import BagError
from ..messages.batch import Array, distinct
from ..messages.columns import Columns
from ..messages.selection import Selection
from ..operations.columns import ColumnReader
from ..operations.tool_poses import POSE_NAME, POSE_TYPE, TWIST_TYPE, tool_poses
from ..paths import PathLike
from ..units import NS_PER_S
from .run import Call, Run, Stream, Track
from .tolerances import Tolerances

JOINT_STATE = "sensor_msgs/JointState"
STATE_TYPES = ("jaka_msgs/RobotMsg", "industrial_msgs/RobotStatus")
CALL_TYPE = "jaka_msgs/ServiceCall"
_POSE_PARTS = {TWIST_TYPE: ("twist.linear", "twist.angular"), POSE_TYPE: ("position", "rotation vector")}


def _stamps(columns: Columns) -> Optional[Array]:
    stamps = columns.fields.get("header.stamp")
    if stamps is None or stamps.dtype == object or stamps.ndim != 1 or not stamps.any():
        return None
    return stamps


def _lost(columns: Columns) -> Optional[int]:
    """Messages that header.seq steps over; steps back are restarts of the publisher and lose nothing."""
    sequence = columns.fields.get("header.seq")
    if sequence is None or len(sequence) < 2:
        return None
    steps = np.diff(sequence.astype(np.int64))
    if not steps.any():
        return None
    return int((steps[steps > 1] - 1).sum())


def _matrix(column: Array) -> Tuple[Array, Optional[Array]]:
    """An array field as (n, k), and the rows that have the length most of them have (None: all)."""
    if column.dtype != object:
        return column.astype(float), None
    lengths = np.array([len(row) for row in column])
    usual = int(np.bincount(lengths).argmax())
    value = np.full((len(column), usual), np.nan)
    rows = np.flatnonzero(lengths == usual)
    if len(rows):
        value[rows] = np.stack([column[i] for i in rows.tolist()])
    return value, rows


def _joint_names(columns: Columns, count: int) -> Sequence[str]:
    names = columns.fields["name"]
    texts = [_text(name) for name in (names[0] if len(names) else ())]
    return texts if len(texts) == count else ["joint_%d" % (i + 1) for i in range(count)]


def _text(value: bytes) -> str:
    return bytes(value).decode("utf-8", "replace")


def _texts(column: Array) -> Tuple[str, ...]:
    """The different ones, sorted."""
    if len(column) and (column == column[0]).all():
        return (_text(column[0]),)
    return tuple(sorted({_text(value) for value in np.unique(column)}))


def _raw(value: Array) -> bytes:
    return np.asarray(value, np.uint8).tobytes()


class _Loader:
    def __init__(self, reader: LogReader, tolerances: Tolerances, time_scale: float) -> None:
        index = reader.index
        if index.start_time is None or index.end_time is None:
            raise BagError("%s has no messages" % reader.path)
        self._reader = reader
        self._tolerances = tolerances
        self._time_scale = time_scale
        self._run = Run(reader.path, index.start_time, (index.end_time - index.start_time) * time_scale / NS_PER_S)
        self._calls: List[Call] = []
        self._types: Dict[str, Set[Tuple[str, str]]] = {}
        for number, connection in enumerate(reader.connections):
            if index.counts[number] and not tolerances.ignores(connection.topic):
                self._types.setdefault(connection.topic, set()).add((connection.datatype, connection.md5sum))

    def load(self) -> Run:
        decoded = [topic for topic in self._types if self._is_decoded(topic)]
        if decoded:
            for topic, columns in ColumnReader(self._reader, Selection(topics=decoded)).read().items():
                self._take(topic, columns)
        self._take_times([topic for topic in self._types if topic not in self._run.streams])
        return replace(self._run, calls=tuple(sorted(self._calls, key=lambda call: call.start)))

    def _is_decoded(self, topic: str) -> bool:
        kinds = self._types[topic]
        if len(kinds) > 1:
            return False
        datatype = next(iter(kinds))[0]
        return (topic in self._tolerances.fields or datatype in (JOINT_STATE, CALL_TYPE, *STATE_TYPES)
                or (datatype in _POSE_PARTS and topic.endswith("/" + POSE_NAME)))

    def _seconds(self, time_ns: Array) -> Array:
        """Times since the log's first message, s, as if it had run at speed 1."""
        seconds: Array = (np.asarray(time_ns, np.int64) - self._run.start_ns) * (self._time_scale / NS_PER_S)
        return seconds

    def _stream(self, topic: str, log_time: Array, stamps: Optional[Array] = None, lost: Optional[int] = None) -> None:
        self._run.streams[topic] = Stream(topic, tuple(sorted(self._types[topic])), self._seconds(log_time),
                                          None if stamps is None else self._seconds(stamps), lost)

    def _take(self, topic: str, columns: Columns) -> None:
        run, fields, datatype = self._run, columns.fields, columns.connection.datatype
        stamps = _stamps(columns)
        self._stream(topic, columns.log_time, stamps, _lost(columns))
        if topic in self._tolerances.fields:
            run.fields[topic] = {name: self._further_field(topic, columns, name)
                                 for name in self._tolerances.fields[topic]}
        if datatype == CALL_TYPE:
            self._take_calls(topic, columns)
        elif datatype == JOINT_STATE:
            value, rows = _matrix(fields["position"])
            if value.shape[1]:
                run.joints[topic] = self._track(topic, _joint_names(columns, value.shape[1]), columns, value, rows)
        elif datatype in _POSE_PARTS:
            poses = tool_poses(columns)
            if poses is not None:
                names = ["%s.%s" % (part, axis) for part in _POSE_PARTS[datatype] for axis in "xyz"]
                run.poses[topic] = replace(self._track(topic, names, columns, np.hstack(poses)),
                                           frames=_texts(fields["header.frame_id"]))
        elif datatype in STATE_TYPES:
            names = [name for name, column in fields.items()
                     if column.ndim == 1 and column.dtype.kind in "iub" and not name.startswith("header.")]
            value = np.stack([fields[name].astype(np.int64) for name in names], axis=1)
            run.states[topic] = self._track(topic, names, columns, value)

    def _track(self, topic: str, names: Sequence[str], columns: Columns, value: Array,
               rows: Optional[Array] = None) -> Track:
        """Rows by stamp; one that repeats both stamp and value of the one before is the same sample again."""
        stamps = _stamps(columns)
        time = self._seconds(columns.log_time if stamps is None else stamps)
        if rows is not None:
            time, value = time[rows], value[rows]
        if stamps is not None and len(time) > 1:
            if (time[1:] < time[:-1]).any():
                order = np.argsort(time, kind="stable")
                time, value = time[order], value[order]
            repeated = time[1:] == time[:-1]
            if repeated.any():
                again = (value[1:] == value[:-1]).all(axis=1) & repeated
                keep = np.concatenate([[True], ~again])
                time, value = time[keep], value[keep]
        return Track(topic, tuple(names), time, value)

    def _further_field(self, topic: str, columns: Columns, name: str) -> Track:
        column = columns.fields.get(name)
        if column is None or column.dtype.kind not in "biufO":
            raise BagError("%s: %s has no numeric field %s" % (self._run.path, topic, name))
        value, rows = _matrix(column if column.ndim == 2 or column.dtype == object else column[:, None])
        return self._track(topic, [name] * value.shape[1], columns, value, rows)

    def _take_calls(self, topic: str, columns: Columns) -> None:
        fields = columns.fields
        stamps = _stamps(columns)
        starts = self._seconds(columns.log_time if stamps is None else stamps).tolist()
        self._calls += [
            Call(topic, start, float(fields["duration"][i]) * self._time_scale, _text(fields["service"][i]),
                 _text(fields["service_type"][i]), _text(fields["md5sum"][i]), _raw(fields["request"][i]),
                 _raw(fields["response"][i]), bool(fields["success"][i]), _text(fields["error"][i]),
                 _text(fields["request_text"][i]), _text(fields["response_text"][i]))
            for i, start in enumerate(starts)]

    def _take_times(self, topics: Sequence[str]) -> None:
        if not topics:
            return
        wanted = set(topics)
        names = [connection.topic for connection in self._reader.connections]
        times: Dict[str, List[Array]] = {topic: [] for topic in topics}
        for chunk in self._reader.chunks:
            if chunk.counts and not any(names[number] in wanted for number in chunk.counts):
                continue
            numbers, log_times = self._reader.load_times(chunk)
            for number in distinct(numbers).tolist():
                if names[number] in wanted:
                    times[names[number]].append(log_times[numbers == number])
        for topic, parts in times.items():
            self._stream(topic, np.sort(np.concatenate(parts)))


def load_run(path: PathLike, tolerances: Optional[Tolerances] = None, time_scale: float = 1.0) -> Run:
    """Read a log.

    Args:
        path: A .bag or .mcap of ROS 1 messages.
        tolerances: Which topics are left out, and which further fields are wanted.
        time_scale: The log ran this many times faster than the one it is compared with.

    Raises:
        BagError: It cannot be read, has no messages, or lacks a field that the tolerances name.
        BagFormatError: It is damaged, or has no index because the recording was cut off.
        DefinitionError: A definition is not understood.
    """
    with open_log(path) as reader:
        return _Loader(reader, tolerances or Tolerances(), time_scale).load()
