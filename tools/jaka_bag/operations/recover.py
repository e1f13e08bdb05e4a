"""Makes a whole log of what can be read of a cut-off, unindexed or damaged one."""
import os
import time
from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Set, Tuple

import numpy as np

from ..containers.index import AttachmentIndex, open_for_reading, read_at
from ..containers.mcap.records import parse_metadata
from ..containers.mcap.writer import McapWriter
from ..containers.recovery import Loss, Salvager
from ..containers.registry import create_log, open_damaged
from ..containers.writer import ChunkWriter
from ..errors import BagError, BagFormatError
from ..messages.batch import Array, Block, distinct, pieces_of
from ..messages.connection import Connection
from ..paths import PathLike
from ..pipeline import in_order
from .convert import same_file, size_of
from .copying import OnProgress, with_md5

_MAX_PIECE = 4 << 20


class Recovered(NamedTuple):
    """What was recovered.

    Attributes:
        target: The new log.
        messages: Messages in it.
        expected: Messages that the old log's index tells of; None where it has none.
        losses: Stretches that could not be read or trusted, and messages that could not be placed.
        bytes_written: Size of the new log.
        seconds: Wall time, s.
    """

    target: str
    messages: int
    expected: Optional[int]
    losses: Tuple[Loss, ...]
    bytes_written: int
    seconds: float

    @property
    def is_whole(self) -> bool:
        """True where nothing is known to be lost."""
        return not self.losses and (self.expected is None or self.expected <= self.messages)

    def document(self) -> Dict[str, Any]:
        """The result as JSON data."""
        return dict(self._asdict(), losses=[loss._asdict() for loss in self.losses], is_whole=self.is_whole)


class _Channels:
    """The file's ids of connections to the new log's numbers, as they become known."""

    def __init__(self, writer: ChunkWriter) -> None:
        self._writer = writer
        self._seen: Dict[int, Connection] = {}
        self._numbers: Dict[int, int] = {}

    def number(self, file_id: int, connections: Dict[int, Connection]) -> int:
        """The new log's number; -1 where the connection is not described."""
        connection = connections.get(file_id)
        if connection is None:
            return -1
        if self._seen.get(file_id) is not connection:
            self._seen[file_id] = connection
            self._numbers[file_id] = self._writer.add_channel(with_md5(connection))
        return self._numbers[file_id]

    def renumber(self, block: Block, connections: Dict[int, Connection], unknown: Dict[int, int]) -> Block:
        """The messages of described connections with new numbers; the others are counted by id."""
        ids = distinct(block.connection)
        numbers = np.array([self.number(i, connections) for i in ids.tolist()], np.int64)
        new = numbers[np.searchsorted(ids, block.connection)]
        for file_id, number in zip(ids.tolist(), numbers.tolist()):
            if number < 0:
                unknown[file_id] = unknown.get(file_id, 0) + int((block.connection == file_id).sum())
        kept = Block(block.data, block.start, block.length, new, block.log_time, block.publish_time, block.sequence)
        return kept if (new >= 0).all() else kept.take(new >= 0)


def _write(salvager: Salvager, writer: ChunkWriter, unknown: Dict[int, int],
           on_progress: Optional[OnProgress]) -> int:
    channels = _Channels(writer)
    ends: List[int] = [0]

    def blocks() -> Iterator[Tuple[int, Block]]:
        for stretch in salvager.stretches():
            size = stretch.end - ends[0]
            ends[0] = stretch.end
            if len(stretch.block):
                kept = channels.renumber(stretch.block, stretch.connections, unknown)
                for piece in pieces_of(kept, _MAX_PIECE):
                    yield size, piece
                    size = 0

    def work(item: Tuple[int, Block]) -> Tuple[int, int, Any]:
        size, block = item
        return size, len(block), writer.encode(block, _identity(block))

    written = 0
    for size, count, chunk in in_order(work, blocks()):
        writer.append(chunk)
        written += count
        if on_progress is not None:
            on_progress(size, count)
    for connection in salvager.connections.values():  # those without messages
        writer.add_channel(with_md5(connection))
    return written


def _identity(block: Block) -> Array:
    return np.arange(int(block.connection.max()) + 1 if len(block) else 1)


def _copy_extras(salvager: Salvager, writer: ChunkWriter) -> None:
    if isinstance(writer, McapWriter):
        for attachment in salvager.attachments:
            data = _attachment_data(salvager, attachment)
            writer.add_attachment(attachment.name, data, attachment.media_type, attachment.log_time,
                                  attachment.create_time)
        for entry in salvager.metadata:
            name, values = parse_metadata(read_at(salvager.descriptor, entry.position, entry.size))
            writer.add_metadata(name, values)


def _attachment_data(salvager: Salvager, entry: AttachmentIndex) -> bytes:
    end = entry.position + entry.size - 4  # the CRC
    return read_at(salvager.descriptor, end - entry.data_size, entry.data_size)


def _attempt(path: str, descriptor: int, target: PathLike, compression: Optional[str], level: Optional[int],
             overwrite: bool, known: Dict[int, Connection], on_progress: Optional[OnProgress]
             ) -> Tuple[Salvager, int, Dict[int, int]]:
    salvager = open_damaged(path, descriptor)
    for file_id, connection in known.items():
        salvager.connections.setdefault(file_id, connection)
    unknown: Dict[int, int] = {}
    writer = create_log(target, compression, level, overwrite, salvager.profile)
    try:
        written = _write(salvager, writer, unknown, on_progress)
        if not written and salvager.losses:
            raise BagFormatError("%s: no message could be read (%s)" % (path, salvager.losses[0].describe()))
        late: Set[int] = unknown.keys() & salvager.connections.keys() - known.keys()
        if late:  # described behind their messages
            writer.abort()
            return _attempt(path, descriptor, target, compression, level, overwrite, dict(salvager.connections),
                            on_progress)
        _copy_extras(salvager, writer)
        writer.close()
    except BaseException:
        writer.abort()
        raise
    return salvager, written, unknown


def recover(source: PathLike, target: PathLike, compression: Optional[str] = None, level: Optional[int] = None,
            overwrite: bool = False, on_progress: Optional[OnProgress] = None) -> Recovered:
    """Write all that can be read of a log into a new, whole one.

    Args:
        source: .bag or .mcap by content, as ``.bag.active`` and ``.mcap.active``.
        target: .bag or .mcap by suffix.
        compression: None for the target format's default.
        level: The codec's level; None for its default.
        overwrite: Replace an existing target.
        on_progress: Is told how far it is.

    Raises:
        BagFormatError: It is neither, it is encrypted, or no message can be read.
        BagError: The source cannot be opened, or the target cannot be written or hold it.
    """
    begin = time.monotonic()
    if same_file(str(source), str(target)):
        raise BagError("%s is input and output" % source)
    descriptor = open_for_reading(source)
    try:
        salvager, written, unknown = _attempt(str(source), descriptor, target, compression, level, overwrite, {},
                                              on_progress)
    finally:
        os.close(descriptor)
    losses = salvager.losses + [
        Loss(0, salvager.size, "%d messages of connection %d, whose description is lost" % (count, file_id))
        for file_id, count in unknown.items()]
    return Recovered(str(target), written, salvager.expected, tuple(losses), size_of(str(target)),
                     time.monotonic() - begin)


def default_target(source: PathLike) -> Path:
    """Where to recover to: the name without ``.active``, else with ``.recovered`` in it.

    Raises:
        BagError: The name tells no format.
    """
    path = Path(source)
    if path.suffix in (".active", ".part"):
        path = path.with_suffix("")
        if path.suffix in (".bag", ".mcap"):
            return path
    elif path.suffix in (".bag", ".mcap"):
        return path.with_suffix(".recovered" + path.suffix)
    raise BagError("%s: give the output" % source)
