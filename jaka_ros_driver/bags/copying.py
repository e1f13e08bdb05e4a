"""Copies messages of logs into another, chunk by chunk, on two threads: what convert, filter and merge do."""
from typing import Any, Callable, Iterable, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .blocks import Array, Block, concatenate, pieces_of
from .chunk_writer import ChunkWriter
from .definitions import Connection, definition_md5
from .errors import BagFormatError, DefinitionError
from .log_index import ChunkRef
from .log_reader import LogReader
from .mcap_writer import McapWriter
from .pipeline import WORKERS, in_order
from .selection import Picker

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
        from dataclasses import replace
        return replace(connection, md5sum=definition_md5(connection.datatype, connection.definition))
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


class _Losses:
    """Notes what a .bag has no place for."""

    def __init__(self, writer: ChunkWriter) -> None:
        self._is_bag = not isinstance(writer, McapWriter)
        self.publish_times = False
        self.sequences = False

    def look(self, block: Block) -> None:
        if self._is_bag:
            if not self.publish_times and block.publish_time is not block.log_time:
                self.publish_times = bool((block.publish_time != block.log_time).any())
            if not self.sequences:
                self.sequences = bool(block.sequence.any())

    def notes(self, reader: LogReader) -> Tuple[str, ...]:
        result = []
        if self.publish_times:
            result.append("a .bag has no place for publish times: only the log times are kept")
        if self.sequences:
            result.append("a .bag has no place for the MCAP's sequence numbers: they are left out")
        if self._is_bag and (reader.index.attachments or reader.index.metadata):
            result.append("a .bag has no place for attachments and metadata: %d left out"
                          % (len(reader.index.attachments) + len(reader.index.metadata)))
        return tuple(result)


def copy_log(reader: LogReader, writer: ChunkWriter, picker: Picker, on_progress: Optional[OnProgress] = None,
             workers: int = WORKERS) -> CopyResult:
    """Copy the wanted messages of one log in the order of the file; attachments and metadata where there is place.

    Raises:
        BagFormatError: A chunk is damaged, or the chunks hold other messages than the index says.
        BagError: The output cannot hold them.
    """
    ids = add_channels(reader.connections, picker.wanted, writer)
    losses = _Losses(writer)

    def work(batch: List[ChunkRef]) -> Tuple[int, int, List[Any]]:
        block = concatenate([picker.pick(reader.load(chunk)) for chunk in batch])
        losses.look(block)
        encoded = [writer.encode(piece, ids) for piece in pieces_of(block, _MAX_PIECE)]
        return sum(chunk.end - chunk.position for chunk in batch), len(block), encoded

    written = 0
    for size, count, encoded in in_order(work, batches(picker.chunks(reader.chunks)), workers):
        for chunk in encoded:
            writer.append(chunk)
        written += count
        if on_progress is not None:
            on_progress(size, count)
    if picker.takes_all and written != reader.message_count:
        raise BagFormatError("%s: the index tells of %d messages, the chunks hold %d (jaka_bag recover keeps them)"
                             % (reader.path, reader.message_count, written))
    copy_extras(reader, writer)
    return CopyResult(written, losses.notes(reader))


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
