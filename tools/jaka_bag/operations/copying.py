"""Copies messages of logs into another, chunk by chunk, on two threads: what convert, filter and merge do."""
from typing import Any, Callable, Dict, Iterable, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..containers.index import ChunkRef
from ..containers.mcap.writer import McapWriter
from ..containers.reader import LogReader
from ..containers.writer import ChunkWriter
from ..errors import BagFormatError, DefinitionError
from ..messages.batch import Array, Block, concatenate, distinct, pieces_of
from ..messages.connection import Connection
from ..messages.definitions import definition_md5
from ..messages.selection import Picker
from ..pipeline import WORKERS, in_order

_MAX_PIECE = 4 << 20
"""Payload of the largest chunk written from larger ones, byte."""
_SMALL = 256 << 10
"""Neighbouring chunks are written as one up to this many bytes in the source."""

OnProgress = Callable[[int, int], None]
"""Takes the bytes read and the messages written since the last call."""


class CopyResult(NamedTuple):
    """What was copied.

    Attributes:
        messages: Number of messages written.
        notes: What the output cannot hold, one line each.
    """

    messages: int
    notes: Tuple[str, ...]


def with_md5(connection: Connection) -> Connection:
    """The connection with the md5 of its definition, where the log names none and the definition is understood."""
    if connection.md5sum or connection.encoding != "ros1":
        return connection
    try:
        return connection._replace(md5sum=definition_md5(connection.datatype, connection.definition))
    except DefinitionError:
        return connection


def add_channels(connections: Sequence[Connection], wanted: Array, writer: ChunkWriter) -> Array:
    """Declare the wanted connections; give the writer's number of each, 0 for the others.

    Raises:
        BagError: The output's format cannot hold one of them.
    """
    return np.array([writer.add_channel(with_md5(c)) if w else 0 for c, w in zip(connections, wanted)] or [0],
                    np.int64)


def batches(chunks: Iterable[ChunkRef]) -> Iterator[List[ChunkRef]]:
    """Neighbouring small chunks together, each larger one on its own."""
    batch: List[ChunkRef] = []
    size = 0
    for chunk in chunks:
        length = chunk.end - chunk.position
        if batch and size + length > _SMALL:
            yield batch
            batch, size = [], 0
        batch.append(chunk)
        size += length
    if batch:
        yield batch


class LossNotes:
    """Watches for what a .bag has no place for.

    Args:
        writer: The output.
    """

    def __init__(self, writer: ChunkWriter) -> None:
        self._is_bag = not isinstance(writer, McapWriter)
        self._publish_times = False
        self._sequences = False

    def look(self, block: Block) -> Block:
        """Look at a block on its way."""
        if self._is_bag:
            if not self._publish_times and block.publish_time is not block.log_time:
                self._publish_times = bool((block.publish_time != block.log_time).any())
            if not self._sequences:
                self._sequences = bool(block.sequence.any())
        return block

    def notes(self, readers: Sequence[LogReader]) -> Tuple[str, ...]:
        """What was left out, one line each."""
        result = []
        if self._publish_times:
            result.append("a .bag has no place for publish times: only the log times are kept")
        if self._sequences:
            result.append("a .bag has no place for the MCAP's sequence numbers: they are left out")
        extras = sum(len(reader.index.attachments) + len(reader.index.metadata) for reader in readers)
        if self._is_bag and extras:
            result.append("a .bag has no place for attachments and metadata: %d left out" % extras)
        return tuple(result)


def latched_before(reader: LogReader, picker: Picker, start_time: int) -> Block:
    """The newest message before a time, ns, of each wanted latched connection, in the order of time.

    Raises:
        BagFormatError: A chunk is damaged.
    """
    latched = np.array([bool(c.latching) for c in reader.connections] or [False], bool) & (
        picker.wanted if len(picker.wanted) else np.zeros(1, bool))
    newest: Dict[int, Block] = {}
    for chunk in reader.chunks:
        if chunk.start_time >= start_time or not (not chunk.counts or any(latched[n] for n in chunk.counts)):
            continue
        block = reader.load(chunk)
        which = np.flatnonzero(latched[block.connection] & (block.log_time < start_time))
        for number in distinct(block.connection[which]).tolist():
            own = which[block.connection[which] == number]
            last = own[len(own) - 1 - int(np.argmax(block.log_time[own][::-1]))]
            candidate = block.take(np.array([last]))
            if number not in newest or candidate.log_time[0] >= newest[number].log_time[0]:
                newest[number] = concatenate([candidate, candidate.take(slice(0, 0))])
    return concatenate(sorted(newest.values(), key=lambda b: int(b.log_time[0])))


def copy_log(reader: LogReader, writer: ChunkWriter, picker: Picker, on_progress: Optional[OnProgress] = None,
             workers: int = WORKERS, latched_from: Optional[int] = None) -> CopyResult:
    """Copy the wanted messages of one log in the order of the file; attachments and metadata where there is place.

    Args:
        reader: The log.
        writer: The output; it stays open.
        picker: Which messages.
        on_progress: Is told how far it is.
        workers: Threads.
        latched_from: Copy also the newest message before this time, ns, of each latched connection.

    Raises:
        BagFormatError: A chunk is damaged, or the chunks hold other messages than the index says.
        BagError: The output cannot hold them.
    """
    ids = add_channels(reader.connections, picker.wanted, writer)
    losses = LossNotes(writer)

    def work(batch: List[ChunkRef]) -> Tuple[int, int, List[Any]]:
        block = concatenate([picker.pick(reader.load(chunk)) for chunk in batch])
        losses.look(block)
        encoded = [writer.encode(piece, ids) for piece in pieces_of(block, _MAX_PIECE)]
        return sum(chunk.end - chunk.position for chunk in batch), len(block), encoded

    written = 0
    if latched_from is not None:
        before = latched_before(reader, picker, latched_from)
        writer.append(writer.encode(before, ids))
        written += len(before)
    for size, count, encoded in in_order(work, batches(reader.wanted_chunks(picker)), workers):
        for chunk in encoded:
            writer.append(chunk)
        written += count
        if on_progress is not None:
            on_progress(size, count)
    if picker.takes_all and written != reader.message_count:
        raise BagFormatError("%s: the index tells of %d messages, the chunks hold %d (jaka_bag recover keeps them)"
                             % (reader.path, reader.message_count, written))
    copy_extras(reader, writer)
    return CopyResult(written, losses.notes([reader]))


def copy_extras(reader: LogReader, writer: ChunkWriter) -> None:
    """Copy attachments and metadata from MCAP to MCAP.

    Raises:
        BagFormatError: One of them is damaged.
    """
    if not isinstance(writer, McapWriter) or reader.index.format != "mcap":
        return
    for attachment in reader.index.attachments:
        data = reader.read_attachment(attachment)
        writer.add_attachment(attachment.name, data, attachment.media_type, attachment.log_time,
                              attachment.create_time)
    for entry in reader.index.metadata:
        name, values = reader.read_metadata(entry)
        writer.add_metadata(name, values)


def copy_blocks(blocks: Iterable[Block], ids: Array, writer: ChunkWriter,
                on_progress: Optional[OnProgress] = None, workers: int = WORKERS) -> int:
    """Write blocks in their order; give the number of messages.

    Raises:
        BagFormatError: A chunk read meanwhile is damaged.
        BagError: The output cannot hold them.
    """
    def work(block: Block) -> Tuple[int, int, List[Any]]:
        return len(block), int(block.length.sum()), [writer.encode(b, ids) for b in pieces_of(block, _MAX_PIECE)]

    written = 0
    for count, size, encoded in in_order(work, blocks, workers):
        for chunk in encoded:
            writer.append(chunk)
        written += count
        if on_progress is not None:
            on_progress(size, count)
    return written
