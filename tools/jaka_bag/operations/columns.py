"""The messages of a log as numpy columns, by topic.

Decoding raises ``DefinitionError`` where a definition is not understood or does not describe a message, and
``BagFormatError`` where a chunk is damaged.
"""
from typing import Container, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from ..containers.index import ChunkRef
from ..containers.interface import LogReader
from ..containers.registry import open_log
from ..containers.time_order import Source, in_time_order
from ..errors import BagError, DefinitionError
from ..messages.batch import MessageBatch, distinct
from ..messages.columns import Columns, Grouped, Part, columns_of, grouped, part_of
from ..messages.connection import Connection
from ..messages.encodings import described
from ..messages.layout import Group, LayoutFinder, Leaf
from ..messages.selection import MessageFilter, Selection
from ..paths import PathLike
from ..pipeline import WORKERS, in_order

_GROUP_MESSAGES, _GROUP_BYTES, _UNPACKED_BYTES = 30000, 2 << 20, 16 << 20


def chunk_groups(chunks: Sequence[ChunkRef], times: int = 1) -> List[List[ChunkRef]]:
    """Group chunks in the order of time, into groups that are worth to be decoded at once.

    Args:
        chunks: The chunks.
        times: A group has so many times the usual messages, for one who works on all of it at once; what it may
            unpack to stays.
    """
    groups: List[List[ChunkRef]] = []
    messages = size = unpacked = 0
    for chunk in sorted(chunks, key=lambda chunk: (chunk.start_time, chunk.position)):
        if not groups or messages >= times * _GROUP_MESSAGES or size >= times * _GROUP_BYTES \
                or unpacked >= _UNPACKED_BYTES:
            groups.append([])
            messages = size = unpacked = 0
        groups[-1].append(chunk)
        messages += sum(chunk.counts.values())
        size += chunk.end - chunk.position
        unpacked += chunk.unpacked
    return groups


class ColumnReader:
    """A decoder of a log's messages into columns.

    Args:
        reader: The log.
        selection: The wanted messages; None for all.
        only_connection: Number of the one connection to decode; None for all that are selected.

    Raises:
        DefinitionError: The definition of a wanted connection is not understood, or two connections of a topic
            have different types.
        BagError: A pattern of the selection is not a regular expression.
    """

    def __init__(self, reader: LogReader, selection: Optional[Selection] = None,
                 only_connection: Optional[int] = None) -> None:
        self._reader = reader
        self._filter = MessageFilter(selection or Selection(), reader.connections)
        if only_connection is not None:
            self._filter.limit_to(only_connection)
        self.connections: Dict[str, Connection] = {}
        self._finders: Dict[int, LayoutFinder] = {}
        self._topics: List[str] = [connection.topic for connection in reader.connections]
        counts = reader.index.counts
        for number, connection in enumerate(reader.connections):
            if not self._filter.wanted[number] or (not counts[number] and connection.topic in self.connections):
                continue
            plain = described(connection)
            first = self.connections.setdefault(connection.topic, plain)
            if (first.datatype, first.md5sum) != (plain.datatype, plain.md5sum):
                raise DefinitionError("%s holds messages of different types: %s and %s"
                                      % (connection.topic, first.datatype, plain.datatype))
            self._finders[number] = LayoutFinder(connection)

    def groups(self, batch: MessageBatch) -> Iterator[Tuple[str, Group]]:
        """Yield the messages of a batch by topic and layout."""
        for number in distinct(batch.connection).tolist():
            for group in self._finders[number].groups(batch, np.flatnonzero(batch.connection == number)):
                yield self._topics[number], group

    def leaf(self, topic: str, name: str) -> Leaf:
        """Return the description of a field, of a topic of which messages were decoded."""
        found = (finder.leaf(name) for number, finder in self._finders.items() if self._topics[number] == topic)
        return next(leaf for leaf in found if leaf is not None)

    def parts(self, chunk: ChunkRef, fields: Optional[Mapping[str, Container[str]]] = None) -> Dict[str, Part]:
        """Return the wanted messages of one chunk, by topic; may be called by several threads at once.

        Args:
            chunk: One of the reader's.
            fields: The only fields that are needed, by topic; of other topics all are given.
        """
        return {topic: part_of([some], (fields or {}).get(topic)) for topic, some in self.grouped(chunk).items()}

    def grouped(self, chunk: ChunkRef) -> Dict[str, Grouped]:
        """Return the wanted messages of one of the reader's chunks, by topic and layout."""
        return self._grouped(self._filter.apply(self._reader.load(chunk)))

    def _grouped(self, batch: MessageBatch) -> Dict[str, Grouped]:
        by_topic: Dict[str, List[Group]] = {}
        for topic, group in self.groups(batch):
            by_topic.setdefault(topic, []).append(group)
        return {topic: grouped(batch, groups) for topic, groups in by_topic.items()}

    def pieces(self, fields: Optional[Mapping[str, Container[str]]] = None,
               workers: int = WORKERS) -> Iterator[Tuple[str, Columns]]:
        """Yield all wanted messages in the order of time, piece by piece: topic and messages.

        Messages of equal times keep the order of the file.

        Args:
            fields: See ``parts``.
            workers: Threads.
        """
        groups = chunk_groups(self._reader.wanted_chunks(self._filter))
        starts = [group[0].start_time for group in groups]
        ends = [max(chunk.end_time for chunk in group) for group in groups]
        groups = [sorted(group, key=lambda chunk: chunk.position) for group in groups]
        if any(end > start or end == start and group[-1].position > after[0].position
               for end, start, group, after in zip(ends, starts[1:], groups, groups[1:])):
            yield from self._pieces_in_time_order(fields)
            return
        chunks = [chunk for group in groups for chunk in group]
        last_of_group = [chunk is group[-1] for group in groups for chunk in group]
        parts = in_order(lambda chunk: self.parts(chunk, fields), chunks, workers)
        found: Dict[str, List[Part]] = {}
        for by_topic, is_last in zip(parts, last_of_group):
            for topic, part in by_topic.items():
                found.setdefault(topic, []).append(part)
            if is_last:
                for topic, some in found.items():
                    yield topic, columns_of(self.connections[topic], some)
                found = {}

    def _pieces_in_time_order(self, fields: Optional[Mapping[str, Container[str]]]) -> Iterator[Tuple[str, Columns]]:
        numbers = np.arange(len(self._reader.connections))
        for batch in in_time_order([Source(self._reader, self._filter, numbers)]):
            for topic, some in self._grouped(batch).items():
                yield topic, columns_of(self.connections[topic], [part_of([some], (fields or {}).get(topic))])

    def read(self, workers: int = WORKERS) -> Dict[str, Columns]:
        """Read all wanted messages, by topic; a topic without messages has no entry."""
        parts: Dict[str, List[Part]] = {}
        for by_topic in in_order(self.parts, self._reader.wanted_chunks(self._filter), workers):
            for topic, part in by_topic.items():
                parts.setdefault(topic, []).append(part)
        return {topic: columns_of(self.connections[topic], parts.pop(topic)) for topic in list(parts)}


def read_columns(path: PathLike, topics: Optional[Sequence[str]] = None,
                 selection: Optional[Selection] = None) -> Dict[str, Columns]:
    """Read the messages of a log as columns, by topic; a topic without messages has no entry.

    Args:
        path: A .bag, an .mcap or a rosbag2 folder.
        topics: Topics to decode; None for all.
        selection: The wanted messages, where more than topics matters.

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
