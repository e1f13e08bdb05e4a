"""ROS 1 messages to CDR, many at once: for each layout, which byte goes where is learnt from rosbags.

``DefinitionError`` is raised where a definition is not understood or does not describe a message.
"""
from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from ..errors import DefinitionError, TopicRefused
from .batch import Array, MessageBatch, distinct, rows, windows
from .connection import Connection
from .layout import Group, Layout, LayoutFinder
from .ros2_types import Ros2Type

_MAP_LIMIT = 8192
"""Larger messages, byte, go through rosbags one by one: there it copies whole arrays."""
_WORTH_A_MAP = 8
"""Fewest messages of one layout for which its map is learned: learning takes as long as some messages."""
_MOST_COUNTED = 512
"""Layouts of which anything is kept: more than the finder knows again, which keeps the first ones."""


class ByteMap(NamedTuple):
    """The recipe for CDR messages of one layout: constant bytes, and stretches (from, to, length) to copy in."""

    template: Array
    stretches: Tuple[Tuple[int, int, int], ...]

    def apply(self, rows: Array) -> Array:
        """Convert ROS 1 messages, uint8, one a row, to CDR messages."""
        result = np.empty((len(rows), len(self.template)), np.uint8)
        result[:] = self.template
        for source, target, length in self.stretches:
            result[:, target:target + length] = rows[:, source:source + length]
        return result


def learn_map(layout: Layout, kind: Ros2Type) -> ByteMap:
    """Learn the byte map of a layout from rosbags' conversion of messages whose bytes encode their positions."""
    position = np.arange(layout.length)
    probes = []
    for digits in (position & 255, position >> 8 & 255, ~position & 255):
        probe = digits.astype(np.uint8)
        probe[layout.lengths_at] = layout.lengths
        probes.append(np.frombuffer(kind.to_cdr(probe.tobytes()), np.uint8))
    low, high, inverse = probes
    copied = np.flatnonzero(low == ~inverse)
    source = low[copied].astype(np.int64) | high[copied].astype(np.int64) << 8
    template = low.copy()
    template[copied] = 0
    breaks = np.flatnonzero((np.diff(copied) != 1) | (np.diff(source) != 1)) + 1
    runs = np.split(np.arange(len(copied)), breaks)
    return ByteMap(template, tuple((int(source[run[0]]), int(copied[run[0]]), len(run)) for run in runs if len(run)))


class CdrConverter:
    """A converter for the messages of one connection. It learns maps as layouts appear.

    Threads may share one: a map that two of them learn at once is the same, and counts only say when to learn one.

    Args:
        connection: Connection with type and definition.

    Attributes:
        kind: The ROS 2 side of the type.

    Raises:
        MissingDependency: rosbags is not installed.
        TopicRefused: The definition is not understood.
    """

    def __init__(self, connection: Connection) -> None:
        self._topic = connection.topic
        try:
            self._finder = LayoutFinder(connection)  # first, for it refuses definitions that rosbags would not get done
            self.kind = Ros2Type(connection)
        except DefinitionError as error:
            raise TopicRefused(str(error), self._topic) from error
        self._maps: Dict[Layout, ByteMap] = {}
        self._seen: Dict[Layout, int] = {}

    def _map_of(self, group: Group) -> Optional[ByteMap]:
        """Return the byte map of a group; None where one is not worth learning."""
        layout = group.layout
        if layout.length > _MAP_LIMIT:
            return None
        known = self._maps.get(layout)
        if known is None:
            is_kept = layout in self._seen or len(self._seen) < _MOST_COUNTED
            count = self._seen.get(layout, 0) + len(group.which)
            known = learn_map(layout, self.kind) if count >= _WORTH_A_MAP else None
            if is_kept:
                self._seen[layout] = count
                if known is not None:
                    self._maps[layout] = known
        return known

    def convert(self, batch: MessageBatch, which: Array) -> List[Tuple[Array, Array]]:
        """Return (positions in the batch, CDR messages of one length, one a row) that cover ``which``.

        Raises:
            TopicRefused: A message is not as its definition says.
        """
        try:
            return self._converted(batch, which)
        except DefinitionError as error:
            raise TopicRefused(str(error), self._topic) from error

    def _converted(self, batch: MessageBatch, which: Array) -> List[Tuple[Array, Array]]:
        result = []
        for group in self._finder.groups(batch, which):
            byte_map = self._map_of(group)
            if byte_map is not None:
                result.append((group.which, byte_map.apply(group.rows)))
            else:
                made = [np.frombuffer(self.kind.to_cdr(row.tobytes()), np.uint8) for row in group.rows]
                result.append((group.which, np.stack(made)))
        return result


def cdr_batch(batch: MessageBatch, converters: Dict[int, CdrConverter]) -> MessageBatch:
    """Convert messages to CDR, in the same order.

    Args:
        batch: Messages.
        converters: Converters by number of the connection, for those of ROS 1; others are CDR already.
    """
    if not converters:
        return batch
    length = np.zeros(len(batch), np.int64)
    parts = []
    for number in distinct(batch.connection).tolist():
        chosen = np.flatnonzero(batch.connection == number)
        for which, made in converters[number].convert(batch, chosen) if number in converters else (
                (chosen[i:i + 1], rows(batch, chosen[i:i + 1], int(batch.length[chosen[i]])))
                for i in range(len(chosen))):
            length[which] = made.shape[1]
            parts.append((which, made))
    start = np.cumsum(length) - length
    data = np.empty(int(length.sum()), np.uint8)
    for which, made in parts:
        if made.shape[1]:
            windows(data, made.shape[1])[start[which]] = made.view("V%d" % made.shape[1])[:, 0]
    return MessageBatch(data, start, length, batch.connection, batch.log_time, batch.publish_time, batch.sequence)
