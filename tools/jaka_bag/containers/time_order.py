"""The messages of logs in the order of time, several logs as one.

``BagFormatError`` is raised where a chunk is damaged, ``BagError`` where a pattern is no regular expression.
"""
from typing import Iterable, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..messages.batch import Array, MessageBatch, concatenate, pieces_of
from ..messages.selection import MessageFilter, Selection
from .index import ChunkRef
from .interface import LogReader, Message

_PIECE = 1 << 20
"""Payload, byte, of a batch: what follows holds one in memory."""
_MOST_HELD = 1 << 18
"""Messages of a batch, for those without bytes."""
HELD_BYTES = 32 << 20
"""Chunk contents kept while chunks overlap in time; beyond it they are read again when their turn comes."""


class Source(NamedTuple):
    """One log of several that are read together; ``numbers`` are its connections' numbers among all."""

    reader: LogReader
    message_filter: MessageFilter
    numbers: Array


class _Held:
    """A chunk of which some messages are still to be given."""

    def __init__(self, order: Tuple[int, int], source: Source, chunk: ChunkRef) -> None:
        self.order = order
        self._source = source
        self._chunk = chunk
        self.rest = self._load()
        self.picked = np.arange(len(self.rest))

    def _load(self) -> MessageBatch:
        source = self._source
        return source.message_filter.apply(source.reader.load(self._chunk)).with_connections(source.numbers)

    @property
    def held_bytes(self) -> int:
        return len(self.rest.data)

    def drop(self) -> None:
        """Forget the payloads, but not the times."""
        rest = self.rest
        none = np.zeros(0, np.uint8)  # not a view, which would keep the whole buffer
        self.rest = MessageBatch(none, rest.start, rest.length, rest.connection, rest.log_time)

    def take_before(self, time: Optional[int]) -> MessageBatch:
        """Remove and return the messages before a time, ns (None: all)."""
        mask = np.ones(len(self.rest), bool) if time is None else self.rest.log_time < time
        if not mask.any():
            return self.rest.take(mask)
        full = self.rest
        if not len(full.data) and int(full.length.sum()):
            full = self._load().take(self.picked)
        taken = full.take(mask)
        self.rest = self.rest.take(~mask)
        self.picked = self.picked[~mask]
        return taken


def _emit(held: Iterable[_Held], before: Optional[int]) -> Iterator[MessageBatch]:
    parts = [part for part in (h.take_before(before) for h in sorted(held, key=lambda h: h.order)) if len(part)]
    if parts:
        whole = concatenate(parts)
        if (whole.log_time[1:] < whole.log_time[:-1]).any():
            whole = whole.take(np.argsort(whole.log_time, kind="stable"))
        yield from pieces_of(whole, _PIECE)


def in_time_order(sources: Sequence[Source]) -> Iterator[MessageBatch]:
    """Yield all wanted messages of several logs by log time; equal times in the order of the logs and of each file."""
    queue = sorted(((chunk.start_time, k, chunk.position, chunk) for k, source in enumerate(sources)
                    for chunk in source.reader.wanted_chunks(source.message_filter)), key=lambda entry: entry[:3])
    held: List[_Held] = []
    for start, k, position, chunk in queue:
        yield from _emit(held, start)
        held = [h for h in held if len(h.rest)]
        held.append(_Held((k, position), sources[k], chunk))
        for old in held[:-1] if sum(h.held_bytes for h in held) > HELD_BYTES else ():
            old.drop()
    yield from _emit(held, None)


def gathered(batches: Iterable[MessageBatch], size: int) -> Iterator[MessageBatch]:
    """Yield the messages in batches of at least ``size`` bytes of payload, or a quarter of a million messages."""
    held: List[MessageBatch] = []
    total = count = 0
    for batch in batches:
        held.append(batch.copy() if len(batch.data) > 2 * size else batch)
        total += int(batch.length.sum())
        count += len(batch)
        if total >= size or count >= _MOST_HELD:
            yield concatenate(held)
            held, total, count = [], 0, 0
    if held:
        yield concatenate(held)


def whole_source(reader: LogReader, selection: Optional[Selection] = None) -> Source:
    """Return the source for a log that is read on its own."""
    connections = reader.connections
    return Source(reader, MessageFilter(selection or Selection(), connections), np.arange(len(connections)))


def messages_of(reader: LogReader, selection: Optional[Selection] = None) -> Iterator[Message]:
    """Yield the wanted messages of a log, one by one, by log time."""
    connections = reader.connections
    for batch in in_time_order([whole_source(reader, selection)]):
        base = int(batch.start.min())
        raw = batch.data[base:int((batch.start + batch.length).max())].tobytes()
        for start, length, number, log_time, publish_time, sequence in zip(
                (batch.start - base).tolist(), batch.length.tolist(), batch.connection.tolist(),
                batch.log_time.tolist(), batch.publish_time.tolist(), batch.sequence.tolist()):
            yield Message(connections[number], log_time, raw[start:start + length], publish_time, sequence)
