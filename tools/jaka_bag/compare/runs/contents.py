"""The contents of messages beyond joints, poses and states: each field as numbers or as a sequence of values."""
import hashlib
import re
from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from ...messages.batch import Array, are_rows_equal
from ...messages.columns import Columns, is_ragged
from ...units import NS_PER_S
from .publishers import by_length, name_of, spread, text_of
from .run import Contents

TRANSFORM_TYPES = ("tf2_msgs/TFMessage", "tf/tfMessage")
WHOLE = "(bytes)"
"""Name of the one field of messages that are compared by their bytes."""
COUNTER, STAMP, NUMBERS, SEQUENCE = "message numbers", "stamps", "numbers", "sequence of values"
AGE, QUATERNION = " (from recording, s)", " (quaternion)"
"""Endings of the names of numbers that are times, s since their message was recorded, and unit quaternions x y z w."""
_TRANSFORM_FIELDS = {"seq": COUNTER, "stamp": AGE}
_COUNTERS = re.compile(r"(.*\.)?header\.seq")
_GOAL_IDS = re.compile(r"(.*\.)?goal_id\.id")
_OF_ONE_RUN = re.compile(rb"-\d+\.\d+$|_\d+_\d{10,}")
"""The parts of actionlib's goal ids that differ from run to run: the goal's time; an anonymous node's process and time.

The node's name and the number of its goal stay.
"""
_MOST_LABELS = 2000
"""Most values whose text is kept for the report; of a field with more the others show as a digest."""
_LABEL_VALUES, _LABEL_LETTERS = 12, 60

Numbers = Dict[str, Tuple[Array, Optional[Array]]]
"""Numbers by field: values, shape (n, columns), and the rows that count (None: all)."""


class Split(NamedTuple):
    """The fields of some messages of one topic.

    Attributes:
        numbers: Floating-point fields and times, by field.
        names: Fields that are sequences of values.
        values: Their values, or keys of their values, int64, shape (n, len(names)).
        handled: How each field of the type is compared, by field.
    """

    numbers: Numbers
    names: List[str]
    values: Array
    handled: Dict[str, str]


def digest(raw: bytes) -> int:
    """Return a key for some bytes: a signed number of 64 bits."""
    return int.from_bytes(hashlib.blake2b(raw, digest_size=8).digest(), "little", signed=True)


def by_bytes(payloads: List[bytes]) -> Split:
    """Return messages whose fields are not known, one value a message: a key of its bytes."""
    values = np.array([digest(raw) for raw in payloads], np.int64).reshape(-1, 1)
    return Split({}, [WHOLE], values, {WHOLE: "bytes"})


class Splitter:
    """A splitter of one topic's messages into numbers and sequences of values.

    Attributes:
        labels: Readable values by field and key, of those that are no whole numbers.
    """

    def __init__(self) -> None:
        self.labels: Dict[str, Dict[int, str]] = {}
        self._lengths: Dict[str, int] = {}

    def split(self, columns: Columns, types: Dict[str, str], known: Dict[str, str]) -> Split:
        """Split messages.

        Args:
            columns: The messages; fields that are missing are not wanted.
            types: Type of each field; see ``messages.layout.Leaf``.
            known: How fields that others compare are compared.
        """
        numbers: Numbers = {}
        names: List[str] = []
        values: List[Array] = []
        handled: Dict[str, str] = {}
        fields = columns.fields
        if columns.connection.datatype in TRANSFORM_TYPES:
            numbers = _transforms(columns)
            handled = {name: _TRANSFORM_FIELDS.get(name.rsplit(".", 1)[-1], NUMBERS) for name in fields}
            fields = {}
        for name, column in fields.items():
            if column.ndim == 2 or is_ragged(column):
                length = _lengths(column)
                if len(length):
                    names.append(name + " (length)")
                    values.append(length)
            handled[name] = known.get(name, "")
            if handled[name]:
                continue
            if _COUNTERS.fullmatch(name):
                handled[name] = COUNTER
            elif types[name] == "time" and name != "header.stamp":
                handled[name] = AGE
                _add_numbers(numbers, name + AGE, _since_recording(column, columns.log_time), self._lengths)
            elif name == "header.stamp":
                handled[name] = STAMP
            elif types[name] in ("float32", "float64", "duration"):
                handled[name] = NUMBERS
                scaled = column if types[name] != "duration" else _in_seconds(column)
                _add_numbers(numbers, name, scaled, self._lengths)
            else:
                handled[name] = SEQUENCE
                names.append(name)
                values.append(self._keys(name, column))
        _join_quaternions(numbers)
        stacked = np.stack(values, axis=1) if values else np.zeros((len(columns.log_time), 0), np.int64)
        return Split(numbers, names, stacked, handled)

    def _keys(self, name: str, column: Array) -> Array:
        """Return whole numbers as they are, of other values a key each, int64, shape (n,)."""
        if column.dtype.kind in "iub" and column.ndim == 1:
            return whole_numbers(column)
        if not len(column):
            return np.zeros(0, np.int64)
        if column.dtype == object:
            begins = np.arange(len(column))
        else:
            rows = as_bytes(column.reshape(len(column), -1))
            begins = np.zeros(1, np.int64) if are_rows_equal(rows) else np.flatnonzero(
                np.concatenate([[True], (rows[1:] != rows[:-1]).any(axis=1)]))
        labels = self.labels.setdefault(name, {})
        is_goal_id = _GOAL_IDS.fullmatch(name) is not None
        keys = [_key(_of_any_run(column[i]) if is_goal_id else column[i], labels) for i in begins.tolist()]
        return np.repeat(np.array(keys, np.int64), np.diff(begins, append=len(column)))


def as_bytes(column: Array) -> Array:
    """Return flags as the bytes that they are in a message, for any byte but zero is true; other values as they are."""
    return column.view(np.uint8) if column.dtype == bool else column


def whole_numbers(column: Array) -> Array:
    """Return whole numbers or flags as int64."""
    numbers: Array = as_bytes(column).astype(np.int64)
    return numbers


def _of_any_run(goal_ids: Array) -> Array:
    ids = _exact(goal_ids)
    return np.array([_OF_ONE_RUN.sub(b"", one) for one in ids.reshape(-1).tolist()], object).reshape(ids.shape)


def _exact(value: Array) -> Array:
    """Return a value as an array; texts as objects, for ``S`` has no zeros at the end."""
    return np.asarray(value, object if isinstance(value, bytes) else None)


def _key(value: Array, labels: Dict[int, str]) -> int:
    value = _exact(value)
    raw = repr(value.tolist()).encode() if value.dtype.kind in "SO" else value.tobytes()
    key = digest(raw)
    if value.dtype == bool and (value.view(np.uint8) > 1).any():
        value = value.view(np.uint8)
    if key not in labels and len(labels) < _MOST_LABELS:
        if value.ndim == 0:
            text = text_of(value.item())
            labels[key] = repr(text if len(text) <= _LABEL_LETTERS else text[:_LABEL_LETTERS] + "...")
        elif value.size <= _LABEL_VALUES:
            labels[key] = str([text_of(one) if isinstance(one, bytes) else one for one in value.tolist()])
        else:
            labels[key] = "%d values (%016x)" % (value.size, key & (1 << 64) - 1)
    return key


def _lengths(column: Array) -> Array:
    """Return the number of values in each message, int64, shape (n,)."""
    if column.dtype == object:
        return np.array([len(row) for row in column], np.int64)
    return np.full(len(column), column.shape[1], np.int64)


def _in_seconds(column: Array) -> Array:
    if column.dtype != object:
        seconds: Array = column / float(NS_PER_S)
        return seconds
    result = np.empty(len(column), object)
    for i, row in enumerate(column):
        result[i] = row / float(NS_PER_S)
    return result


def _since_recording(column: Array, log_time: Array) -> Array:
    """Return times as s since the recording of their message; those that are zero stay zero."""
    if column.dtype == object:
        result = np.empty(len(column), object)
        for i, row in enumerate(column):
            result[i] = np.where(row == 0, 0.0, (row - log_time[i]) / float(NS_PER_S))
        return result
    since: Array = np.where(column == 0, 0.0, (column.T - log_time).T / float(NS_PER_S))
    return since


def _add_numbers(numbers: Numbers, name: str, column: Array, usual: Dict[str, int]) -> None:
    """Add a field, one track for each length that its arrays have; those without values have none."""
    for length, part in by_length(column).items():
        numbers[_named(name, length, usual)] = part


def _named(name: str, length: int, usual: Dict[str, int]) -> str:
    """Return the name of a track: that of the field for the length that was met first."""
    return name if usual.setdefault(name, length) == length else name_of(name, str(length))


def _join_quaternions(numbers: Numbers) -> None:
    """Join the parts of each quaternion into one track."""
    for name in [name for name in numbers if name.endswith(".w")]:
        parts = [name[:-1] + axis for axis in "xyzw"]
        if all(part in numbers and numbers[part][1] is None and numbers[part][0].shape[1] == 1 for part in parts):
            numbers[name[:-2] + QUATERNION] = (np.hstack([numbers.pop(part)[0] for part in parts]), None)


def _transforms(columns: Columns) -> Numbers:
    """Return the poses of all frames, each as translation, m, and rotation, quaternion x y z w; and their stamps."""
    fields = columns.fields
    found: Dict[str, Tuple[List[int], List[List[float]]]] = {}
    parts = ["transforms.transform.translation." + axis for axis in "xyz"] + [
        "transforms.transform.rotation." + axis for axis in "xyzw"]
    for i, parents in enumerate(fields["transforms.header.frame_id"]):
        values = [fields[part][i] for part in parts]
        for k, (parent, child) in enumerate(zip(parents, fields["transforms.child_frame_id"][i])):
            frame = "%s > %s" % tuple(map(text_of, (parent, child)))
            which, rows = found.setdefault(frame, ([], []))
            which.append(i)
            stamp = int(fields["transforms.header.stamp"][i][k])
            rows.append([float(value[k]) for value in values]
                        + [(stamp - int(columns.log_time[i])) / float(NS_PER_S) if stamp else 0.0])
    numbers: Numbers = {}
    for frame, (which, rows) in found.items():
        places, matrix = np.array(which), np.array(rows)
        for part, some in ((".translation", slice(0, 3)), (".rotation" + QUATERNION, slice(3, 7)),
                           (".header.stamp" + AGE, slice(7, 8))):
            numbers[frame + part] = spread(matrix[:, some], places, len(columns.log_time))
    return numbers


class Collector:
    """A collector of one topic's sequences of values: the messages at which one changes."""

    def __init__(self) -> None:
        self._names: List[str] = []
        self._times: List[Array] = []
        self._values: List[Array] = []
        self._last: Optional[Tuple[Array, List[Array]]] = None
        self.handled: Dict[str, str] = {}
        self._repeats = 0

    def add(self, time: Array, split: Split) -> None:
        """Add further messages, s, shape (n,), in the order of recording."""
        for name, how in split.handled.items():
            self.handled.setdefault(name, how)
        if not len(time):
            return
        new = [name for name in split.names if name not in self._names]
        if new:
            self._names += new
            self._values = [np.pad(value, ((0, 0), (0, len(new)))) for value in self._values]
        value = split.values
        if split.names != self._names:
            value = np.zeros((len(time), len(self._names)), np.int64)
            value[:, [self._names.index(name) for name in split.names]] = split.values
        differs = value[1:] != value[:-1]
        changes = differs.any(axis=1) if differs.any() else np.zeros(len(differs), bool)
        changed = np.flatnonzero(changes)
        kept = np.unique(np.concatenate([[0], changed, changed + 1, [len(time) - 1]]))
        self._times.append(time[kept])
        self._values.append(value[kept])
        self._count_repeats(value, ~changes, split)

    def _count_repeats(self, value: Array, same: Array, split: Split) -> None:
        """Count the messages that repeat the contents of the one before; ``same`` are those that repeat ``value``."""
        numbers = [rows for rows, which in split.numbers.values() if which is None]
        if len(numbers) == len(split.numbers):
            for rows in numbers:
                same &= ((rows[1:] == rows[:-1]) | (np.isnan(rows[1:]) & np.isnan(rows[:-1]))).all(axis=1)
            self._repeats += int(same.sum())
            if self._last is not None and len(self._last[0]) == value.shape[1] \
                    and len(self._last[1]) == len(numbers):
                self._repeats += int((self._last[0] == value[0]).all() and all(
                    np.array_equal(before, rows[0]) for before, rows in zip(self._last[1], numbers)))
        self._last = value[-1].copy(), [rows[-1].copy() for rows in numbers]

    def contents(self, splitter: Splitter) -> Contents:
        """Return everything, after the last message."""
        time = np.concatenate([np.zeros(0), *self._times])
        value = np.concatenate([np.zeros((0, len(self._names)), np.int64), *self._values])
        order = np.argsort(time, kind="stable")
        return Contents(tuple(self._names), time[order], value[order], splitter.labels, self._repeats, self.handled)
