"""The loader of a log into a ``Run``: topics of the driver's interface by type, all other fields by their types.

A log is read once from begin to end. Facts found on the way (which topics are stamped, how many values an array usually
has, how close samples lie) are needed from the first message on: they are taken from the first part of the log, and the
log is read again where the rest of it differs. Rows are given in windows later on.
"""
import weakref
from typing import Callable, Container, Dict, Iterable, List, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from ...containers.index import ChunkRef
from ...containers.interface import LogReader
from ...containers.registry import open_log
from ...driver_interface import CALL_TYPE, STATE_TYPE
from ...errors import BagError, DefinitionError
from ...messages.batch import Array, MessageBatch, distinct
from ...messages.columns import Columns, Grouped, columns_of, is_ragged, part_of
from ...messages.definitions import definition_md5
from ...messages.encodings import described, types_of
from ...messages.selection import Selection
from ...operations.columns import ColumnReader, chunk_groups
from ...operations.tool_poses import POSE_FIELDS, POSE_NAME, POSE_TYPE, TWIST_TYPE, tool_poses
from ...paths import PathLike
from ...units import NS_PER_S
from ..tolerances import Tolerances
from .contents import AGE, NUMBERS, TRANSFORM_TYPES, Collector, Splitter, as_bytes, by_bytes, whole_numbers
from .publishers import PartRows, Publishers, by_length, main_one, matrix, name_of, publishers_of, spread, text_of
from .run import Arrivals, Call, LongTrack, Run, Stream, Track
from .track_facts import FactsBuilder, StateChanges
from .windows import LogWindows, Rows, TrackKey, samples_of

JOINT_STATE = "sensor_msgs/JointState"
STATE_TYPES = (STATE_TYPE, "industrial_msgs/RobotStatus")
_HEADER_FIELDS = ("header.stamp", "header.seq")
_FRAME = "header.frame_id"
_MD5SUMS = {JOINT_STATE: "3066dcd76a6cfaef579bd0f34173e9fd", TWIST_TYPE: "98d34b0043a2093cf9d9345ab6eef12e",
            POSE_TYPE: "d3812c3cbc69362b77dc0b19b345f8f5"}
_SCANS = 4
"""Most readings of a log; after one its fields are known, and each further one is for what they showed."""
_PART_GROUPS = 4
"""Multiple of the usual messages that are decoded at once: of few, most of the time goes to what each part costs."""
_MORE_OF_JOINTS = ("velocity", "effort")
_POSE_PARTS = {TWIST_TYPE: ("twist.linear", "twist.angular"), POSE_TYPE: ("position", "rotation vector")}


def _stamps(columns: Columns) -> Optional[Array]:
    stamps = columns.fields.get("header.stamp")
    return None if stamps is None or stamps.dtype == object or stamps.ndim != 1 else stamps


def _joint_names(columns: Columns, count: int, row: int) -> Sequence[str]:
    names = columns.fields["name"]
    texts = [text_of(name) for name in (names[row] if len(names) else ())]
    return texts if len(texts) == count else ["joint_%d" % (i + 1) for i in range(count)]


def _texts(column: Array) -> Tuple[str, ...]:
    """Return the different texts of a column, sorted."""
    if len(column) and (column == column[0]).all():
        return (text_of(column[0]),)
    return tuple(sorted({text_of(value) for value in np.unique(column)}))


def _raw(value: Array) -> bytes:
    return np.asarray(value, np.uint8).tobytes()


class _Assumed(NamedTuple):
    """The assumptions for the reading of a log, by topic or track; one that is missing is taken from the first part.

    ``lengths`` is of arrays, ``reach`` the number of samples to either side over which speeds are taken, ``publisher``
    the one whose joints are the topic's own.
    """

    is_stamped: Dict[str, bool]
    lengths: Dict[TrackKey, int]
    reach: Dict[TrackKey, int]
    publisher: Dict[str, str]


class _Scan:
    """The findings of one reading of a log from begin to end."""

    def __init__(self) -> None:
        self.counts: Dict[str, int] = {}
        self.stamped: Set[str] = set()
        self.has_stamps: Set[str] = set()
        self.lengths: Dict[TrackKey, Dict[int, int]] = {}
        self.publishers: Dict[str, Dict[str, int]] = {}
        self.frames: Dict[str, Set[str]] = {}
        self.calls: List[Call] = []
        self.contents: Dict[str, Collector] = {}
        self.facts: Dict[TrackKey, FactsBuilder] = {}
        self.states: Dict[str, StateChanges] = {}
        self.last: Dict[TrackKey, float] = {}
        self.unordered: Set[TrackKey] = set()


class _Loader:
    def __init__(self, reader: LogReader, tolerances: Tolerances, time_scale: float,
                 kept_bytes: Optional[int], with_contents: bool) -> None:
        index = reader.index
        if index.start_time is None or index.end_time is None:
            raise BagError("%s has no messages" % reader.path)
        self._reader = reader
        self._tolerances = tolerances
        self._time_scale = time_scale
        self._start_ns = index.start_time
        self._duration = (index.end_time - index.start_time) * time_scale / NS_PER_S
        self._types: Dict[str, Set[Tuple[str, str]]] = {}
        self._described = [described(connection) for connection in reader.connections]
        for number, connection in enumerate(self._described):
            if index.counts[number] and not tolerances.ignores(connection.topic):
                self._types.setdefault(connection.topic, set()).add((connection.datatype, connection.md5sum))
        self._kinds = {topic: self._kind_of(topic) for topic in self._types}
        self._with_contents = with_contents
        decoded = [topic for topic in self._types if self._is_decoded(topic)]
        self._columns = ColumnReader(reader, Selection(topics=decoded)) if decoded else None
        self._decoded = {number for number, c in enumerate(reader.connections) if c.topic in decoded}
        self._timed = {number: c.topic for number, c in enumerate(reader.connections)
                       if c.topic in self._types and c.topic not in decoded}
        self._fields: Dict[str, Container[str]] = {}
        self._splitters: Dict[str, Splitter] = {topic: Splitter() for topic in self._types} if with_contents else {}
        self._leaf_types: Dict[str, Dict[str, str]] = {}
        for topic in decoded:
            self._restrict(topic)
        self._names: Dict[str, Tuple[str, ...]] = {}
        self._assumed = _Assumed({}, {}, {}, {})
        self._widths: Dict[str, Dict[str, int]] = {}
        self._usual: Dict[str, Dict[str, int]] = {}
        self._scan: Optional[_Scan] = None
        self._parts = chunk_groups([chunk for chunk in reader.chunks if self._is_wanted(chunk)], _PART_GROUPS)
        spans = [(min(chunk.start_time for chunk in part), max(chunk.end_time for chunk in part))
                 for part in self._parts]
        self._windows = LogWindows(self._decode, [tuple(self._seconds(np.array(span)).tolist()) for span in spans],
                                   kept_bytes)

    def _is_wanted(self, chunk: ChunkRef) -> bool:
        return not chunk.counts or any(number in self._decoded or number in self._timed for number in chunk.counts)

    def _is_decoded(self, topic: str) -> bool:
        if topic in self._tolerances.fields and len(self._types[topic]) == 1 or self._kinds[topic] is not None:
            return True
        return self._with_contents and len(self._types[topic]) == 1 and self._is_understood(topic)

    def _is_understood(self, topic: str) -> bool:
        """Return whether the fields of a topic's messages are known."""
        try:
            for connection in self._reader.connections:
                if connection.topic == topic:
                    types_of(connection)
        except DefinitionError:
            return False
        return True

    def _has_known_fields(self, topic: str, datatype: str) -> bool:
        """Return whether a topic's definition is ROS's own of that type, where fields are taken by their names."""
        md5sum = _MD5SUMS.get(datatype)
        definition = next(c.definition for c in self._described if c.topic == topic)
        try:
            return md5sum is None or definition_md5(datatype, definition) == md5sum
        except DefinitionError:
            return True  # whoever decodes it tells why it cannot

    def _kind_of(self, topic: str) -> Optional[str]:
        """Return the type of a topic whose purpose is known; None for others."""
        if len(self._types[topic]) > 1:
            return None
        datatype = next(iter(self._types[topic]))[0]
        if not self._has_known_fields(topic, datatype):
            return None
        is_known = datatype in (JOINT_STATE, CALL_TYPE, *STATE_TYPES) or (
            datatype in _POSE_PARTS and topic.endswith("/" + POSE_NAME))
        return datatype if is_known else None

    def _restrict(self, topic: str) -> None:
        """Decode no more of a topic than is needed, where that is known."""
        if self._with_contents:
            return
        kind = self._kinds[topic] or ""
        some = ("position", "name") if kind == JOINT_STATE else POSE_FIELDS.get(kind)
        if some is not None:
            self._fields[topic] = {*_HEADER_FIELDS, _FRAME, *some, *self._tolerances.fields.get(topic, ())}

    def _seconds(self, time_ns: Array) -> Array:
        """Return times since the log's first message, s, as if it had run at speed 1."""
        seconds: Array = (np.asarray(time_ns, np.int64) - self._start_ns) * (self._time_scale / NS_PER_S)
        return seconds

    # --- parts -------------------------------------------------------------------------------------------------------

    def _decode(self, number: int) -> Dict[str, Rows]:
        """Return the rows of a part of the log, by topic."""
        found: Dict[str, List[Grouped]] = {}
        times: Dict[str, List[Array]] = {}
        for decoded, timed in map(self._work, self._parts[number]):
            for topic, some in decoded.items():
                found.setdefault(topic, []).append(some)
            for topic, log_times in timed.items():
                times.setdefault(topic, []).append(log_times)
        rows: Dict[str, Rows] = {}
        for topic, taken in found.items():
            assert self._columns is not None
            part = part_of(taken, self._fields.get(topic))
            rows[topic] = self._rows(topic, columns_of(self._columns.connections[topic], [part]))
        for topic, log_time in times.items():
            seconds = self._seconds(np.sort(np.concatenate(log_time)))
            rows[topic] = Rows(Arrivals(seconds), seconds, {})
        return rows

    def _take_bytes(self, batch: MessageBatch) -> None:
        """Add to the scan the messages of a chunk whose fields are not known, by their bytes."""
        for number in distinct(batch.connection).tolist():
            if number in self._timed:
                some = batch.take(batch.connection == number)
                payloads = [batch.data[at:at + size].tobytes()
                            for at, size in zip(some.start.tolist(), some.length.tolist())]
                assert self._scan is not None
                self._scan.contents.setdefault(self._timed[number], Collector()).add(
                    self._seconds(some.log_time), by_bytes(payloads))

    def _work(self, chunk: ChunkRef) -> Tuple[Dict[str, Grouped], Dict[str, Array]]:
        decoded: Dict[str, Grouped] = {}
        timed: Dict[str, List[Array]] = {}
        numbers = chunk.counts or range(len(self._reader.connections))
        if self._columns is not None and any(number in self._decoded for number in numbers):
            decoded = self._columns.grouped(chunk)
        if any(number in self._timed for number in numbers):
            batch = self._reader.load(chunk)
            if self._with_contents and self._scan is not None:
                self._take_bytes(batch)
            for number in distinct(batch.connection).tolist():
                if number in self._timed:
                    timed.setdefault(self._timed[number], []).append(batch.log_time[batch.connection == number])
        return decoded, {topic: np.concatenate(some) for topic, some in timed.items()}

    def _rows(self, topic: str, columns: Columns) -> Rows:
        """Return the rows of one topic out of a part; add their facts to the scan."""
        fields, scan = columns.fields, self._scan
        stamps = _stamps(columns)
        if scan is not None:
            scan.counts[topic] = scan.counts.get(topic, 0) + len(columns.log_time)
            if stamps is not None:
                scan.has_stamps.add(topic)
                if stamps.any():
                    scan.stamped.add(topic)
        if stamps is not None and not self._assumed.is_stamped.setdefault(topic, bool(stamps.any())):
            stamps = None
        sequence = fields.get("header.seq")
        log_time = self._seconds(columns.log_time)
        stamp = None if stamps is None else self._seconds(stamps)
        arrivals = Arrivals(log_time, stamp, None if sequence is None or sequence.dtype == object
                            else sequence.astype(np.int64))
        values: Dict[str, PartRows] = {}
        kind = self._kinds[topic]
        them = self._publishers(topic, columns) if kind == JOINT_STATE else None
        for name in self._tolerances.fields.get(topic, ()):
            values.update(self._further_field(topic, columns, name, them))
        if them is not None:
            values.update(self._joints(topic, them, fields["position"]))
            if topic not in self._names and "" in values:
                row = 0 if values[""][1] is None else int(values[""][1][0])
                self._names[topic] = tuple(_joint_names(columns, values[""][0].shape[1], row))
                if not self._with_contents and len(them.labels) == 1:
                    self._fields[topic] = {*_HEADER_FIELDS, "position", *self._tolerances.fields.get(topic, ())}
        elif kind in _POSE_PARTS:
            poses = tool_poses(columns)
            if poses is not None:
                values[""] = (np.hstack(poses), None)
            self._names[topic] = tuple("%s.%s" % (part, axis) for part in _POSE_PARTS[kind] for axis in "xyz")
            if scan is not None:
                scan.frames.setdefault(topic, set()).update(_texts(fields[_FRAME]))
        elif kind in STATE_TYPES:
            names = [name for name, column in fields.items()
                     if column.ndim == 1 and column.dtype.kind in "iub" and not name.startswith("header.")]
            states = [as_bytes(fields[name]) for name in names]
            values[""] = (np.stack(states, axis=1) if np.result_type(*states).kind in "iu" else np.stack(
                [whole_numbers(some) for some in states], axis=1), None)
            self._names[topic] = tuple(names)
        elif kind == CALL_TYPE and scan is not None:
            scan.calls += self._calls(topic, columns, log_time if stamp is None else stamp)
        if self._with_contents:
            self._add_contents(topic, columns, log_time if stamp is None else stamp, values, them)
        return Rows(arrivals, log_time if stamp is None else stamp, values)

    def _add_contents(self, topic: str, columns: Columns, time: Array,
                      values: Dict[str, PartRows], them: Optional[Publishers]) -> None:
        """Add the numbers of fields that nothing else compares to ``values``, the other fields to the scan."""
        kind, reader = self._kinds[topic], self._columns
        assert reader is not None
        types = self._leaf_types.setdefault(topic, {})
        for name in columns.fields:
            if name not in types:
                types[name] = reader.leaf(topic, name).type
        known = dict.fromkeys(self._tolerances.fields.get(topic, ()), NUMBERS)
        if kind == CALL_TYPE:
            known.update((name, "" if name == "caller" else "calls") for name in columns.fields if name != _FRAME)
        elif kind == JOINT_STATE:
            known["position"] = "joints"
            known.update(dict.fromkeys(_MORE_OF_JOINTS, NUMBERS))
        elif kind in STATE_TYPES:
            known.update(dict.fromkeys(self._names[topic], "states"))
        elif kind in _POSE_PARTS and "" in values:
            known.update(dict.fromkeys((*POSE_FIELDS[kind], _FRAME), "tool poses"))
        if kind == CALL_TYPE:
            columns = columns._replace(fields={name: columns.fields[name] for name in (_FRAME,)
                                               if name in columns.fields})
        split = self._splitters[topic].split(columns, types, known)
        if kind == CALL_TYPE:
            split = split._replace(handled={**known, **split.handled})
        for name in _MORE_OF_JOINTS:
            if them is not None and name in columns.fields and name not in self._tolerances.fields.get(topic, ()):
                split.numbers.update(self._by_publisher(topic, them, name, columns.fields[name]))
        for name, (value, which) in split.numbers.items():
            values[name] = (value, which)
            self._assumed.lengths.setdefault((topic, name), value.shape[1])
        if self._scan is not None:
            self._scan.contents.setdefault(topic, Collector()).add(time, split)

    def _array(self, key: TrackKey, column: Array) -> Tuple[Array, Optional[Array]]:
        value, rows, lengths = matrix(column, self._assumed.lengths.get(key))
        self._assumed.lengths.setdefault(key, value.shape[1])
        if self._scan is not None:
            known = self._scan.lengths.setdefault(key, {})
            for length, count in lengths.items():
                known[length] = known.get(length, 0) + count
        return value, rows

    def _further_field(self, topic: str, columns: Columns, name: str,
                       them: Optional[Publishers]) -> Dict[str, PartRows]:
        """Return the tracks of a field that has a tolerance of its own, by name."""
        column = columns.fields.get(name)
        if column is None or column.dtype.kind not in "biufO" or column.dtype == object and not is_ragged(column):
            raise BagError("%s: %s has no numeric field %s" % (self._reader.path, topic, name))
        column = as_bytes(column if column.ndim == 2 or column.dtype == object else column[:, None])
        if them is not None:
            self._assumed.lengths.setdefault((topic, name), 0)
            found = self._by_publisher(topic, them, name, column)
            return found if found else {name: (np.zeros((len(column), 0)), None)}
        found = {name: self._array((topic, name), column)}
        width = self._assumed.lengths[topic, name]
        for length, part in by_length(column).items() if column.dtype == object else ():
            if length != width:
                found[name_of(name, str(length))] = part
                self._assumed.lengths[topic, name_of(name, str(length))] = length
        return found

    def _publishers(self, topic: str, columns: Columns) -> Publishers:
        """Return the publishers of a topic of joints; add them to the scan."""
        position, main = columns.fields["position"], self._assumed.publisher.get(topic)
        them = publishers_of(position, columns.fields.get("name"),
                             None if main is None else (main, self._assumed.lengths.get((topic, ""), -1)))
        counts = dict(zip(them.labels, np.bincount(them.number, minlength=len(them.labels)).tolist()))
        widths = self._widths.setdefault(topic, {})
        for place, label in enumerate(them.labels):
            if label not in widths:
                widths[label] = len(position[int(np.argmax(them.number == place))])
        if main is None:
            self._assumed.publisher[topic] = main_one(counts, widths)
        if self._scan is not None:
            known = self._scan.publishers.setdefault(topic, {})
            for label, count in counts.items():
                known[label] = known.get(label, 0) + count
        return them

    def _joints(self, topic: str, them: Publishers, position: Array) -> Dict[str, PartRows]:
        """Return the positions of each publisher by the name of its track: empty for that of the topic's own joints."""
        found: Dict[str, PartRows] = {}
        for place, label in enumerate(them.labels):
            rows = them.rows(place)
            some = position if rows is None else position[rows]
            value = np.stack(list(some)).astype(float) if some.dtype == object else some.astype(float)
            is_own = label == self._assumed.publisher[topic]
            name = "" if is_own else name_of("position", label)
            if is_own or value.shape[1]:
                found[name] = (value, None) if rows is None else spread(value, rows, len(position))
                self._assumed.lengths[topic, name] = value.shape[1]
        return found

    def _by_publisher(self, topic: str, them: Publishers, name: str, column: Array) -> Dict[str, PartRows]:
        """Return a field beside joints, one track for each publisher, and for each length that its arrays have."""
        found: Dict[str, PartRows] = {}
        usual = self._usual.setdefault(topic, {})
        for place, label in enumerate(them.labels):
            rows = them.rows(place)
            base = name if label == self._assumed.publisher[topic] else name_of(name, label)
            for length, (value, which) in by_length(column if rows is None else column[rows]).items():
                track = base if usual.setdefault(base, length) == length else name_of(base, str(length))
                if rows is not None:
                    value, which = spread(value if which is None else value[which],
                                          rows if which is None else rows[which], len(column))
                found[track] = (value, which)
                self._assumed.lengths[topic, track] = length
        return found

    def _calls(self, topic: str, columns: Columns, starts: Array) -> List[Call]:
        fields = columns.fields
        return [
            Call(topic, start, float(fields["duration"][i]) * self._time_scale, text_of(fields["service"][i]),
                 text_of(fields["service_type"][i]), text_of(fields["md5sum"][i]), _raw(fields["request"][i]),
                 _raw(fields["response"][i]), bool(fields["success"][i]), text_of(fields["error"][i]),
                 text_of(fields["request_text"][i]), text_of(fields["response_text"][i]))
            for i, start in enumerate(starts.tolist())]

    # --- the whole ---------------------------------------------------------------------------------------------------

    def load(self) -> Run:
        """Read the log."""
        for _ in range(_SCANS):
            scan = self._read_once()
            if self._is_as_assumed(scan):
                break
        self._scan = None
        for topic in self._fields if not self._with_contents else ():
            kind = self._kinds[topic]
            if kind in POSE_FIELDS:
                self._fields[topic] = {*_HEADER_FIELDS, *POSE_FIELDS[kind], *self._tolerances.fields.get(topic, ())}
        if self._with_contents:
            self._restrict_to_tracks(scan)
        windows = self._windows.windows()
        ignored = {connection.topic for number, connection in enumerate(self._reader.connections)
                   if self._reader.index.counts[number] and self._tolerances.ignores(connection.topic)}
        run = Run(self._reader.path, self._start_ns, self._duration, windows=windows, ignored=tuple(sorted(ignored)),
                  calls=tuple(sorted(scan.calls, key=lambda call: call.start)))
        for topic, types in self._types.items():
            run.streams[topic] = Stream(topic, tuple(sorted(types)), scan.counts.get(topic, 0),
                                        self._assumed.is_stamped.get(topic, False), self._arrivals_of(topic))
        for topic in self._types:
            kind = self._kinds[topic]
            if kind in STATE_TYPES:
                time, value = self._states(scan, topic)
                run.states[topic] = Track(topic, self._names[topic], time, value)
            elif kind in _POSE_PARTS and (topic, "") in {*scan.facts, *scan.unordered}:
                run.poses[topic] = self._long_track(scan, (topic, ""), tuple(sorted(scan.frames[topic])))
            elif kind == JOINT_STATE and self._assumed.lengths[topic, ""]:
                run.joints[topic] = self._long_track(scan, (topic, ""))
            further = {name for place, name in {*scan.facts, *scan.unordered} if place == topic and name}
            further.update(self._tolerances.fields.get(topic, ()) if self._is_decoded(topic) else ())
            if further:
                run.fields[topic] = {}
                for name in sorted(further):
                    title = self._title(topic, name, further)
                    run.fields[topic][title] = self._long_track(scan, (topic, name), (), title)
            if topic in scan.contents:
                found = scan.contents[topic].contents(self._splitters[topic])
                # names and lengths go to and fro with the publishers, of which each has tracks of its own
                run.contents[topic] = found if len(scan.publishers.get(topic, ())) < 2 else found.without(
                    [name for name in found.names if name == "name" or name.endswith(" (length)")])
        return run

    def _restrict_to_tracks(self, scan: _Scan) -> None:
        """Decode only fields that are read again: those of tracks."""
        for topic, handled in ((topic, some.handled) for topic, some in scan.contents.items()):
            if self._columns is None or topic not in self._columns.connections:
                continue
            if self._columns.connections[topic].datatype in TRANSFORM_TYPES:
                continue
            again = [name for name, how in handled.items()
                     if how in ("joints", "tool poses", "states", "calls", NUMBERS, AGE)]
            names = ("name",) if len(scan.publishers.get(topic, ())) > 1 else ()
            self._fields[topic] = {*_HEADER_FIELDS, *names, *self._tolerances.fields.get(topic, ()), *again}

    @property
    def needs_file(self) -> bool:
        """The need to read windows from the file."""
        return not self._windows.is_all_kept

    def _arrivals_of(self, topic: str) -> Callable[[float, float], Arrivals]:
        windows = self._windows
        return lambda begin, end: windows.arrivals(topic, begin, end)

    def _read_once(self) -> _Scan:
        scan = self._scan = _Scan()
        self._windows.forget()
        for number in range(self._windows.part_count):
            rows = self._windows.part(number)
            self._windows.note(number, rows)
            for topic, some in rows.items():
                if topic in self._timed.values():
                    scan.counts[topic] = scan.counts.get(topic, 0) + len(some.time)
                for field in some.values:
                    self._take(scan, (topic, field), some)
        return scan

    def _take(self, scan: _Scan, key: TrackKey, rows: Rows) -> None:
        if key in scan.unordered:
            return
        time, value = samples_of(rows, key[1])
        if not len(time):
            return
        if float(time[0]) <= scan.last.get(key, -np.inf):
            scan.unordered.add(key)
            return
        scan.last[key] = float(time[-1])
        if self._kinds[key[0]] in STATE_TYPES and not key[1]:
            scan.states.setdefault(key[0], StateChanges()).add(time, value)
        else:
            self._facts_builder(scan, key).add(time, value)

    def _facts_builder(self, scan: _Scan, key: TrackKey) -> FactsBuilder:
        if key not in scan.facts:
            is_arm = not key[1] and self._kinds[key[0]] == JOINT_STATE
            scan.facts[key] = FactsBuilder(is_arm, self._assumed.reach.get(key))
        return scan.facts[key]

    def _is_as_assumed(self, scan: _Scan) -> bool:
        """Return whether the log is as assumed; correct the assumptions."""
        is_right = True
        for topic in scan.has_stamps:
            is_stamped = topic in scan.stamped
            is_right &= self._assumed.is_stamped[topic] == is_stamped
            self._assumed.is_stamped[topic] = is_stamped
        for topic, publishers in scan.publishers.items():
            main = main_one(publishers, self._widths[topic])
            if self._assumed.publisher[topic] != main:
                is_right = False
                self._assumed.publisher[topic] = main
                self._names.pop(topic, None)
                self._usual.pop(topic, None)
                self._restrict(topic)
        for key, counts in scan.lengths.items():
            usual = int(main_one({str(length): count for length, count in counts.items()},
                                 {str(length): length for length in counts}))
            is_right &= self._assumed.lengths[key] == usual
            if self._assumed.lengths[key] != usual:
                self._names.pop(key[0], None)
                self._restrict(key[0])
            self._assumed.lengths[key] = usual
        return is_right

    def _title(self, topic: str, name: str, tracks: Iterable[str]) -> str:
        """Return the name of a track: with its length where there are others, as any of them may come first."""
        is_one_of_several = any(other.startswith(name_of(name, "")[:-1]) for other in tracks)
        if not is_one_of_several or self._kinds[topic] == JOINT_STATE or name in self._tolerances.fields.get(topic, ()):
            return name
        return name_of(name, str(self._assumed.lengths[topic, name]))

    def _long_track(self, scan: _Scan, key: TrackKey, frames: Tuple[str, ...] = (), title: str = "") -> LongTrack:
        names = (title or key[1],) * self._assumed.lengths[key] if key[1] else self._names[key[0]]
        windows = self._windows.windows()
        between = self._windows.reader(key, names, frames)
        builder = self._facts_builder(scan, key)
        facts = builder.facts() if key not in scan.unordered else None
        while facts is None or (builder.used_reach or facts.reach) != facts.reach:
            builder = FactsBuilder(not key[1] and key[0] in self._names and self._kinds[key[0]] == JOINT_STATE,
                                   None if facts is None else facts.reach)
            for begin, end in windows:
                block = between(begin, end)
                builder.add(block.time, block.value)
            facts = builder.facts()
        return LongTrack(key[0], names, facts, windows, between, frames)

    def _states(self, scan: _Scan, topic: str) -> Tuple[Array, Array]:
        changes = scan.states.get(topic)
        if changes is None or (topic, "") in scan.unordered:
            changes = StateChanges()
            for begin, end in self._windows.windows():
                changes.add(*self._windows.samples((topic, ""), begin, end))
        times, values = changes.samples()
        return times, values.astype(np.int64)


def load_run(path: PathLike, tolerances: Optional[Tolerances] = None, time_scale: float = 1.0,
             kept_bytes: Optional[int] = None, with_contents: bool = True) -> Run:
    """Read a log; the file stays open, until the run is forgotten, where the log is too long to be kept in memory.

    Args:
        path: A .bag or .mcap of ROS 1 messages.
        tolerances: Topics to leave out, and further fields that are wanted.
        time_scale: The log ran this many times faster than the one it is compared with.
        kept_bytes: Decoded messages are kept up to this size; None for 64 MB.
        with_contents: Read every field of every topic; a comparison needs them. Without them only joints, poses, states
            and calls are read, and of other topics the times.

    Raises:
        BagError: It cannot be read, has no messages, or lacks a field that the tolerances name.
        BagFormatError: It is damaged, or has no index because the recording was cut off.
        DefinitionError: A definition is not understood.
    """
    reader = open_log(path)
    try:
        loader = _Loader(reader, tolerances or Tolerances(), time_scale, kept_bytes, with_contents)
        run = loader.load()
    except BaseException:
        reader.close()
        raise
    if loader.needs_file:
        weakref.finalize(loader, reader.close)
    else:
        reader.close()
    return run
