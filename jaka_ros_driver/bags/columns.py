"""Fields of messages as numpy columns: all messages of one layout are taken at once."""
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .blocks import Array, Block, distinct
from .connection import Connection
from .errors import BagError, DefinitionError
from .layout import Group, LayoutFinder, Leaf
from .log_index import ChunkRef
from .log_reader import LogReader
from .paths import PathLike
from .pipeline import WORKERS, in_order
from .readers import open_log
from .selection import Picker, Selection

NS_PER_S = 1000000000
_TYPES = {"bool": "?", "byte": "i1", "char": "u1", "time": "<u4", "duration": "<i4", "int8": "i1", "uint8": "u1",
          "int16": "<i2", "uint16": "<u2", "int32": "<i4", "uint32": "<u4", "int64": "<i8", "uint64": "<u8",
          "float32": "<f4", "float64": "<f8"}
_SIZES = {"time": 8, "duration": 8}


class Columns(NamedTuple):
    """All messages of one topic, in the order of time.

    Attributes:
        connection: The topic's first connection; its others have the same type.
        log_time: Time of recording, ns since the epoch, int64, shape (n,).
        publish_time: Time of publishing, ns, int64, shape (n,); the log time where the log has none.
        fields: By dotted name (``header.stamp``, ``pose.position.x``), first axis is the message. Times and durations
            are int64 ns; strings are numpy byte strings (``S``); arrays have a second axis, or are objects, one array
            a message, where their length changes. Arrays of messages are spread over their fields, the elements one
            after the other (``transforms.header.stamp``).
    """

    connection: Connection
    log_time: Array
    publish_time: Array
    fields: Dict[str, Array]


def _runs(matrix: Array, offsets: Sequence[int], counts: Sequence[int], size: int) -> Array:
    """The bytes of equal-sized values at several places of each row, contiguous, shape (n, values x size)."""
    if len(offsets) == 1:
        return np.ascontiguousarray(matrix[:, offsets[0]:offsets[0] + counts[0] * size])
    return np.ascontiguousarray(np.concatenate(
        [matrix[:, at:at + count * size] for at, count in zip(offsets, counts)], axis=1))


def _strings(matrix: Array, leaf: Leaf) -> Array:
    width = max(leaf.counts, default=0)
    if width == 0:
        return np.zeros((len(matrix), len(leaf.counts)), "S1")
    padded = np.zeros((len(matrix), len(leaf.counts), width), np.uint8)
    for i, (at, count) in enumerate(zip(leaf.offsets, leaf.counts)):
        padded[:, i, :count] = matrix[:, at:at + count]
    return padded.view("S%d" % width)[:, :, 0]


def leaf_values(matrix: Array, leaf: Leaf) -> Array:
    """A field of messages of one layout: shape (n,), or (n, values) for an array."""
    if leaf.type == "string":
        values = _strings(matrix, leaf)
    elif not leaf.offsets:
        values = np.zeros((len(matrix), 0), np.int64 if leaf.type in _SIZES else _TYPES[leaf.type])
    else:
        kind = np.dtype(_TYPES[leaf.type])
        raw = _runs(matrix, leaf.offsets, leaf.counts, _SIZES.get(leaf.type, kind.itemsize))
        if raw.shape[1] == 0:
            values = np.zeros((len(matrix), 0), np.int64 if leaf.type in _SIZES else kind)
        else:
            values = raw.view(kind)
            if leaf.type in _SIZES:
                parts = values.astype(np.int64)
                values = parts[:, 0::2] * NS_PER_S + parts[:, 1::2]
    return values if leaf.is_array else values[:, 0]


def _fields(group: Group) -> Dict[str, Array]:
    return {name: leaf_values(group.rows, leaf) for name, leaf in group.layout.leaves.items()}


class _Taken(NamedTuple):
    """Messages of one layout out of one chunk: positions among the topic's messages of that chunk, and fields."""

    which: Array
    fields: Dict[str, Array]


class _Part(NamedTuple):
    """One topic's messages out of one chunk."""

    log_time: Array
    publish_time: Array
    taken: List[_Taken]


def _join(where: List[Array], values: List[Array], count: int) -> Array:
    """One column from the values of each layout of each chunk and their positions."""
    if len({v.shape[1:] for v in values}) > 1:
        ragged = np.empty(count, object)
        for places, some in zip(where, values):
            for place, value in zip(places.tolist(), some):
                ragged[place] = value
        return ragged
    joined: Array = values[0] if len(values) == 1 else np.concatenate(values)
    places = where[0] if len(where) == 1 else np.concatenate(where)
    if (places[1:] < places[:-1]).any():
        ordered = np.empty_like(joined)
        ordered[places] = joined
        return ordered
    return joined


def _columns(connection: Connection, parts: List[_Part]) -> Columns:
    log_time = np.concatenate([part.log_time for part in parts])
    publish_time = np.concatenate([part.publish_time for part in parts])
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


class ColumnReader:
    """Decodes the messages of a log.

    Args:
        reader: The log.
        selection: Which messages; None for all.
        only_connection: Number of the one connection to decode; None for all that are selected.

    Raises:
        DefinitionError: The definition of a wanted connection is not understood, or two connections of a topic
            have different types.
        BagError: A pattern of the selection is not a regular expression.
    """

    def __init__(self, reader: LogReader, selection: Optional[Selection] = None,
                 only_connection: Optional[int] = None) -> None:
        self._reader = reader
        self._picker = Picker(selection or Selection(), reader.connections)
        if only_connection is not None:
            self._picker.limit_to(only_connection)
        self.connections: Dict[str, Connection] = {}
        self._finders: Dict[int, LayoutFinder] = {}
        self._topics: List[str] = [connection.topic for connection in reader.connections]
        counts = reader.index.counts
        for number, connection in enumerate(reader.connections):
            if not self._picker.wanted[number] or (not counts[number] and connection.topic in self.connections):
                continue
            first = self.connections.setdefault(connection.topic, connection)
            if (first.datatype, first.md5sum) != (connection.datatype, connection.md5sum):
                raise DefinitionError("%s holds messages of different types: %s and %s"
                                      % (connection.topic, first.datatype, connection.datatype))
            self._finders[number] = LayoutFinder(connection)

    def groups(self, block: Block) -> Iterator[Tuple[str, Group]]:
        """The messages of a block by topic and layout.

        Raises:
            DefinitionError: A definition does not describe a message.
        """
        for number in distinct(block.connection).tolist():
            for group in self._finders[number].groups(block, np.flatnonzero(block.connection == number)):
                yield self._topics[number], group

    def _part(self, block: Block) -> Dict[str, _Part]:
        by_topic: Dict[str, List[Group]] = {}
        for topic, group in self.groups(block):
            by_topic.setdefault(topic, []).append(group)
        parts = {}
        for topic, groups in by_topic.items():
            among = np.sort(np.concatenate([group.which for group in groups])) if len(groups) > 1 else groups[0].which
            parts[topic] = _Part(block.log_time[among], block.publish_time[among],
                                 [_Taken(np.searchsorted(among, g.which), _fields(g)) for g in groups])
        return parts

    def read(self, workers: int = WORKERS) -> Dict[str, Columns]:
        """All wanted messages, by topic; a topic without messages has no entry.

        Raises:
            BagFormatError: A chunk is damaged.
            DefinitionError: A definition does not describe a message.
        """
        def work(chunk: ChunkRef) -> Dict[str, _Part]:
            return self._part(self._picker.pick(self._reader.load(chunk)))

        parts: Dict[str, List[_Part]] = {}
        for by_topic in in_order(work, self._picker.chunks(self._reader.chunks), workers):
            for topic, part in by_topic.items():
                parts.setdefault(topic, []).append(part)
        return {topic: _columns(self.connections[topic], parts.pop(topic)) for topic in list(parts)}


def read_columns(path: PathLike, topics: Optional[Sequence[str]] = None,
                 selection: Optional[Selection] = None) -> Dict[str, Columns]:
    """The messages of a log as columns, by topic; a topic without messages has no entry.

    Args:
        path: A .bag or .mcap of ROS 1 messages.
        topics: Topics to decode; None for all.
        selection: Which messages, where more than topics matters.

    Raises:
        BagError: The log cannot be read, or has none of the topics.
        BagFormatError: It is damaged, or has no index because the recording was cut off.
        DefinitionError: A definition is not understood or does not describe a message.
    """
    with open_log(path) as reader:
        if topics is not None:
            missing = set(topics) - {connection.topic for connection in reader.connections}
            if missing:
                raise BagError("%s has no topic %s" % (path, ", ".join(sorted(missing))))
            selection = (selection or Selection())._replace(topics=tuple(topics))
        if topics is not None and not topics:
            return {}
        return ColumnReader(reader, selection).read()
