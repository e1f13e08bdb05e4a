"""Fields of messages as numpy columns; all messages of one layout are decoded at once."""
from typing import Container, Dict, List, NamedTuple, Optional, Sequence

import numpy as np

from ..units import NS_PER_S
from .batch import Array, MessageBatch, are_rows_equal, columns_at, end_to_end
from .connection import Connection
from .layout import Group, Layout, Leaf

_TYPES = {name: np.dtype(code) for name, code in {
    "bool": "?", "byte": "i1", "char": "u1", "time": "<u4,<u4", "duration": "<i4,<i4", "int8": "i1", "uint8": "u1",
    "int16": "<i2", "uint16": "<u2", "int32": "<i4", "uint32": "<u4", "int64": "<i8", "uint64": "<u8",
    "float32": "<f4", "float64": "<f8"}.items()}


_LENGTH = 4
"""Bytes of the length between two texts of an array."""
_MANY_ROWS = 64
"""Fewest messages that are looked at whether their texts, as names of joints, never change: for fewer it costs more."""
_WIDE_BYTES, _WASTE = 32 << 20, 4
"""Texts are no table of one width where that has more bytes, and so many times those of the texts of each layout."""


class Columns(NamedTuple):
    """All messages of one topic, in the order of time.

    Attributes:
        connection: The topic's first connection; its others have the same type.
        log_time: Time of recording, ns since the epoch, int64, shape (n,).
        publish_time: Time of publishing, ns, int64, shape (n,); the log time where the log has none.
        fields: By dotted name (``header.stamp``, ``pose.position.x``), first axis is the message. Times and durations
            are int64 ns; strings are numpy byte strings (``S``), or objects, one ``bytes`` a message, where one ends
            with a zero or a long one would widen many short ones; arrays have a second axis, or are objects, one array
            a message, where their length changes or a text in them ends with a zero. Arrays of messages are spread over
            their fields, the elements one after the other (``transforms.header.stamp``); those of messages without
            fields are their number.
    """

    connection: Connection
    log_time: Array
    publish_time: Array
    fields: Dict[str, Array]


def _strings(matrix: Array, leaf: Leaf, width: int) -> Array:
    padded = np.zeros((len(matrix), len(leaf.counts), width), np.uint8)
    for i, (at, count) in enumerate(zip(leaf.offsets, leaf.counts)):
        padded[:, i, :count] = matrix[:, at:at + count]
    return padded.view("S%d" % width)[:, :, 0]


def _exact_strings(matrix: Array, leaf: Leaf) -> Array:
    """Return texts as objects: ``S`` would lose the zeros at their end."""
    made = np.empty(len(matrix), object)
    for place, row in enumerate(matrix):
        texts = [row[at:at + count].tobytes() for at, count in zip(leaf.offsets, leaf.counts)]
        made[place] = np.array(texts, object) if leaf.is_array else texts[0]
    return made


def is_ragged(column: Array) -> bool:
    """Return whether a column is objects, one array a message; texts as objects are none."""
    return column.dtype == object and not (len(column) > 0 and isinstance(column[0], bytes))


def _texts(rows: Sequence[Array], leaf: Leaf) -> Array:
    """Return the texts of messages, shape (n, texts); as objects where one ends with a zero."""
    width = max(leaf.counts, default=0)
    if width == 0:
        return np.zeros((sum(map(len, rows)), len(leaf.counts)), "S1")
    first, size = leaf.offsets[0], leaf.offsets[-1] + leaf.counts[-1] - leaf.offsets[0]
    matrix, leaf = columns_at(rows, first, size), leaf._replace(offsets=tuple(at - first for at in leaf.offsets))
    is_dense = size == sum(leaf.counts) + _LENGTH * (len(leaf.counts) - 1)
    is_constant = is_dense and len(matrix) >= _MANY_ROWS and are_rows_equal(matrix)
    some = matrix[:1] if is_constant else matrix
    ends = [at + count - 1 for at, count in zip(leaf.offsets, leaf.counts) if count]
    if not some[:, ends].all():
        return _exact_strings(matrix, leaf)
    return np.repeat(_strings(some, leaf, width), len(matrix), axis=0) if is_constant else _strings(some, leaf, width)


def leaf_values(rows: Sequence[Array], leaf: Leaf) -> Array:
    """Return a field of messages of one layout: shape (n,), or (n, values) for an array.

    Args:
        rows: Bytes of the messages, uint8, shape (some, length of the layout) each, contiguous.
        leaf: The field.
    """
    if leaf.type == "string":
        values = _texts(rows, leaf)
        if values.dtype == object:
            return values
    else:
        kind = _TYPES[leaf.type]
        runs = [columns_at(rows, at, count * kind.itemsize) for at, count in zip(leaf.offsets, leaf.counts) if count]
        raw = runs[0] if len(runs) == 1 else np.concatenate(
            [np.zeros((sum(map(len, rows)), 0), np.uint8), *runs], axis=1)
        values = raw.view(kind) if raw.shape[1] else np.zeros(raw.shape, kind)
        if kind.names:  # seconds and nanoseconds
            values = values["f0"].astype(np.int64) * NS_PER_S + values["f1"]
    return values if leaf.is_array else values[:, 0]


def by_name(values: Array, names: Array, wanted: Array) -> Optional[Array]:
    """Return rows of values, shape (n, k), each in the order of ``wanted``: a publisher may change that of its names.

    Args:
        values: The values.
        names: The name of each, shape (n, k).
        wanted: The names in the order that is asked for, shape (k,).

    Returns:
        None where a row has other names, or a name twice in an order of its own.
    """
    if (names == wanted).all():
        return values
    order, places = names.argsort(axis=1, kind="stable"), wanted.argsort(kind="stable")
    in_alphabet = wanted[places]
    if (in_alphabet[1:] == in_alphabet[:-1]).any() or (np.take_along_axis(names, order, 1) != in_alphabet).any():
        return None
    result = np.empty_like(values)
    result[:, places] = np.take_along_axis(values, order, 1)
    return result


class Grouped(NamedTuple):
    """One topic's messages out of one chunk, by layout; the positions in the groups are among these messages."""

    log_time: Array
    publish_time: Array
    groups: List[Group]


class _Taken(NamedTuple):
    """Messages of one layout out of a part: positions among the topic's messages of that part, and fields."""

    which: Array
    fields: Dict[str, Array]


class Part(NamedTuple):
    """One topic's messages out of one chunk or several."""

    log_time: Array
    publish_time: Array
    taken: List[_Taken]


def _is_wasteful(values: List[Array]) -> bool:
    """Return whether texts as one table, all as wide as the longest, take far more room than what they are."""
    if any(some.dtype.kind != "S" or some.ndim > 1 for some in values):
        return False
    joined = max(some.itemsize for some in values) * sum(map(len, values))
    return joined > _WIDE_BYTES and joined > _WASTE * sum(some.nbytes for some in values)


def _as_objects(texts: Array) -> Array:
    made = np.empty(len(texts), object)
    made[:] = texts.tolist()
    return made


def _join(where: List[Array], values: List[Array], count: int) -> Array:
    """Join one column from the values of each layout of each chunk and their positions."""
    if len({v.shape[1:] for v in values}) > 1:
        ragged = np.empty(count, object)
        for places, some in zip(where, values):
            for place, value in zip(places.tolist(), some):
                ragged[place] = value
        return ragged
    if _is_wasteful(values):
        values = [_as_objects(some) for some in values]
    joined, places = end_to_end(values), end_to_end(where)
    if (places[1:] < places[:-1]).any():
        ordered = np.empty_like(joined)
        ordered[places] = joined
        return ordered
    return joined


def grouped(batch: MessageBatch, groups: List[Group]) -> Grouped:
    """Return the messages of one topic in a batch, given by layout."""
    if len(groups) == 1:
        among, places = groups[0].which, [np.arange(len(groups[0].which))]
    else:
        among = np.sort(np.concatenate([group.which for group in groups]))
        places = [np.searchsorted(among, group.which) for group in groups]
    return Grouped(batch.log_time[among], batch.publish_time[among],
                   [group._replace(which=which) for group, which in zip(groups, places)])


def part_of(pieces: Sequence[Grouped], fields: Optional[Container[str]] = None) -> Part:
    """Return one topic's messages out of some chunks, in the order of the file; with some ``fields``, only these.

    Messages of one layout are decoded together, whichever of the chunks they are in.
    """
    layouts: Dict[int, Layout] = {}
    where: Dict[int, List[Array]] = {}
    rows: Dict[int, List[Array]] = {}
    base = 0
    for piece in pieces:
        for group in piece.groups:
            layouts.setdefault(id(group.layout), group.layout)
            where.setdefault(id(group.layout), []).append(group.which + base)
            rows.setdefault(id(group.layout), []).append(group.rows)
        base += len(piece.log_time)
    taken = []
    for key, layout in layouts.items():
        taken.append(_Taken(end_to_end(where[key]), {name: leaf_values(rows[key], leaf)
                                                  for name, leaf in layout.leaves.items()
                                                  if fields is None or name in fields}))
    return Part(end_to_end([piece.log_time for piece in pieces]),
                end_to_end([piece.publish_time for piece in pieces]), taken)


def columns_of(connection: Connection, parts: List[Part]) -> Columns:
    """Join one topic's columns from its parts, which are given in the order of the file."""
    log_time = end_to_end([part.log_time for part in parts])
    publish_time = end_to_end([part.publish_time for part in parts])
    where: Dict[str, List[Array]] = {}
    values: Dict[str, List[Array]] = {}
    base = 0
    for part in parts:
        for taken in part.taken:
            places = taken.which + base
            for name, some in taken.fields.items():
                where.setdefault(name, []).append(places)
                values.setdefault(name, []).append(some)
        base += len(part.log_time)
    fields = {name: _join(where[name], values.pop(name), base) for name in list(values)}
    if (log_time[1:] < log_time[:-1]).any():
        order = np.argsort(log_time, kind="stable")
        log_time, publish_time = log_time[order], publish_time[order]
        fields = {name: column[order] for name, column in fields.items()}
    return Columns(connection, log_time, publish_time, fields)
