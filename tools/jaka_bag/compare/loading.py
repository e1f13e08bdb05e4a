"""Reads a log into a ``Run``: the topics of the driver's interface by type, of all others the times."""
from typing import Dict, List, Optional, Sequence, Set, Tuple

import numpy as np

from ..containers.contract import LogReader
from ..containers.registry import open_log
from ..errors import BagError
from ..messages.batch import Array, distinct
from ..messages.columns import Columns
from ..messages.selection import Selection
from ..operations.columns import ColumnReader
from ..paths import PathLike
from ..units import NS_PER_S
from .run import Call, PoseTrack, Run, Stream, Track
from .tolerances import Tolerances

JOINT_STATE = "sensor_msgs/JointState"
POSE_TYPE = "geometry_msgs/TwistStamped"
POSE_NAME = "tool_position"
STATE_TYPES = ("jaka_msgs/RobotMsg", "industrial_msgs/RobotStatus")
CALL_TYPE = "jaka_msgs/ServiceCall"
_POSE_FIELDS = tuple("twist.%s.%s" % (part, axis) for part in ("linear", "angular") for axis in "xyz")


class _Clock:
    """The log's times to s since its first message, as if it had run at speed 1."""

    def __init__(self, start_ns: int, time_scale: float) -> None:
        self._start_ns = start_ns
        self._factor = time_scale / NS_PER_S

    def __call__(self, time_ns: Array) -> Array:
        seconds: Array = (np.asarray(time_ns, np.int64) - self._start_ns) * self._factor
        return seconds


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


def _track(topic: str, names: Sequence[str], clock: _Clock, columns: Columns, value: Array,
           rows: Optional[Array] = None) -> Track:
    """Rows by stamp; one that repeats both stamp and value of the one before is the same sample again."""
    stamps = _stamps(columns)
    time = clock(columns.log_time if stamps is None else stamps)
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


def _joint_names(columns: Columns, count: int) -> Tuple[str, ...]:
    names = columns.fields["name"]
    first = names[0] if len(names) else ()
    texts = tuple(bytes(name).decode("utf-8", "replace") for name in first)
    return texts if len(texts) == count else tuple("joint_%d" % (i + 1) for i in range(count))


def _text(value: bytes) -> str:
    return bytes(value).decode("utf-8", "replace")


def _texts(column: Array) -> Tuple[str, ...]:
    """The different ones, sorted."""
    if len(column) and (column == column[0]).all():
        return (_text(column[0]),)
    return tuple(sorted({_text(value) for value in np.unique(column)}))


def _raw(value: Array) -> bytes:
    return np.asarray(value, np.uint8).tobytes()


def _calls(topic: str, columns: Columns, clock: _Clock, time_scale: float) -> List[Call]:
    fields = columns.fields
    stamps = _stamps(columns)
    starts = clock(columns.log_time if stamps is None else stamps).tolist()
    return [Call(topic, starts[i], float(fields["duration"][i]) * time_scale, _text(fields["service"][i]),
                 _text(fields["service_type"][i]), _text(fields["md5sum"][i]), _raw(fields["request"][i]),
                 _raw(fields["response"][i]), bool(fields["success"][i]), _text(fields["error"][i]),
                 _text(fields["request_text"][i]), _text(fields["response_text"][i])) for i in range(len(starts))]


def _further_fields(topic: str, columns: Columns, clock: _Clock, wanted: Sequence[str], path: str) -> Dict[str, Track]:
    result = {}
    for name in wanted:
        column = columns.fields.get(name)
        if column is None or column.dtype.kind not in "biufO":
            raise BagError("%s: %s has no numeric field %s" % (path, topic, name))
        value, rows = _matrix(column if column.ndim == 2 or column.dtype == object else column[:, None])
        result[name] = _track(topic, [name] * value.shape[1], clock, columns, value, rows)
    return result


class _Loader:
    def __init__(self, reader: LogReader, tolerances: Tolerances, time_scale: float) -> None:
        self._reader = reader
        self._tolerances = tolerances
        self._time_scale = time_scale
        index = reader.index
        if index.start_time is None or index.end_time is None:
            raise BagError("%s has no messages" % reader.path)
        self._clock = _Clock(index.start_time, time_scale)
        self._start_ns = index.start_time
        self._duration = (index.end_time - index.start_time) * time_scale / NS_PER_S
        self._streams: Dict[str, Stream] = {}
        self._joints: Dict[str, Track] = {}
        self._poses: Dict[str, PoseTrack] = {}
        self._states: Dict[str, Track] = {}
        self._fields: Dict[str, Dict[str, Track]] = {}
        self._types: Dict[str, Set[Tuple[str, str]]] = {}
        for number, connection in enumerate(reader.connections):
            if index.counts[number] and not tolerances.ignores(connection.topic):
                self._types.setdefault(connection.topic, set()).add((connection.datatype, connection.md5sum))

    def _is_decoded(self, topic: str) -> bool:
        kinds = self._types[topic]
        if len(kinds) > 1:
            return False
        datatype = next(iter(kinds))[0]
        return (topic in self._tolerances.fields or datatype == JOINT_STATE or datatype == CALL_TYPE
                or datatype in STATE_TYPES or (datatype == POSE_TYPE and topic.endswith("/" + POSE_NAME)))

    def load(self) -> Run:
        decoded = [topic for topic in self._types if self._is_decoded(topic)]
        calls: List[Call] = []
        if decoded:
            for topic, columns in ColumnReader(self._reader, Selection(topics=decoded)).read().items():
                calls += self._take(topic, columns)
        self._take_times([topic for topic in self._types if topic not in self._streams])
        return Run(self._reader.path, self._start_ns, self._duration, self._streams, self._joints, self._poses,
                   self._states, self._fields, tuple(sorted(calls, key=lambda call: call.start)))

    def _stream(self, topic: str, log_time: Array, columns: Optional[Columns]) -> None:
        stamps = _stamps(columns) if columns is not None else None
        self._streams[topic] = Stream(topic, tuple(sorted(self._types[topic])), self._clock(log_time),
                                         None if stamps is None else self._clock(stamps),
                                         _lost(columns) if columns is not None else None)

    def _take(self, topic: str, columns: Columns) -> List[Call]:
        self._stream(topic, columns.log_time, columns)
        datatype = columns.connection.datatype
        if topic in self._tolerances.fields:
            self._fields[topic] = _further_fields(topic, columns, self._clock,
                                                     list(self._tolerances.fields[topic]), self._reader.path)
        if datatype == CALL_TYPE:
            return _calls(topic, columns, self._clock, self._time_scale)
        if datatype == JOINT_STATE:
            value, rows = _matrix(columns.fields["position"])
            if value.shape[1]:
                self._joints[topic] = _track(topic, _joint_names(columns, value.shape[1]), self._clock, columns,
                                                value, rows)
        elif datatype == POSE_TYPE:
            value = np.stack([columns.fields[name] for name in _POSE_FIELDS], axis=1)
            track = _track(topic, _POSE_FIELDS, self._clock, columns, value)
            frames = _texts(columns.fields["header.frame_id"])
            self._poses[topic] = PoseTrack(topic, track.time, track.value[:, :3], track.value[:, 3:], frames)
        elif datatype in STATE_TYPES:
            names = [name for name, column in columns.fields.items()
                     if column.ndim == 1 and column.dtype.kind in "iub" and not name.startswith("header.")]
            value = np.stack([columns.fields[name].astype(np.int64) for name in names], axis=1)
            self._states[topic] = _track(topic, names, self._clock, columns, value)
        return []

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
            self._stream(topic, np.sort(np.concatenate(parts)), None)


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
