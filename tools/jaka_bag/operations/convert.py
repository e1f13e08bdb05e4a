"""The conversion of one file as one job, and the functions by which merge, split and recover write as well."""
import re
import time
from pathlib import Path
from typing import (
    Any,
    Callable,
    Dict,
    FrozenSet,
    Iterable,
    Iterator,
    List,
    NamedTuple,
    Optional,
    Sequence,
    Set,
    Tuple,
    TypeVar,
    Union,
)

import numpy as np

from ..containers.index import ChunkRef
from ..containers.interface import EncodedChunk, LogReader, LogWriter
from ..containers.recovery import LogRecovery
from ..containers.registry import create_log, open_log
from ..containers.ros1_view import as_ros1_log, without_ros1_form
from ..containers.time_order import HELD_BYTES, Source, gathered, in_time_order
from ..errors import BagError, DefinitionError, TopicRefused, UsageError
from ..messages.batch import Array, MessageBatch, concatenate, distinct, pieces_of
from ..messages.connection import Connection
from ..messages.definitions import definition_md5
from ..messages.selection import MessageFilter, Selection, TimeSpan, require_match
from ..output_file import is_same_file
from ..paths import PathLike
from ..pipeline import WORKERS, in_order

_MAX_PIECE = 4 << 20
"""Payload of the largest chunk written from larger ones, byte."""
_OVERLAP = 0.1
"""Share of the chunks' time that lies in an earlier chunk, too, above which sorting is worth its time."""
_SMALL, _SMALL_UNPACKED = 256 << 10, 8 << 20
"""Neighbouring chunks are written as one up to this many bytes in the source, and unpacked."""

OnProgress = Callable[[int, int], None]
"""A callback for the bytes read and the messages written since the last call."""
_Item = TypeVar("_Item")


class Job(NamedTuple):
    """One file to convert.

    Attributes:
        source: A .bag or .mcap, by content.
        target: .bag or .mcap by suffix, or a folder for the profile ``ros2``.
        selection: Wanted messages, times excepted.
        span: Wanted time span.
        compression: None for the target format's default.
        level: The codec's level; None for its default.
        profile: ``ros1``, or ``ros2`` for a rosbag2 folder.
        overwrite: Replace an existing target.
        workers: Threads.
        keep_latched: Also the newest message before the span of each latched publisher.
    """

    source: str
    target: str
    selection: Selection = Selection()
    span: TimeSpan = TimeSpan()
    compression: Optional[str] = None
    level: Optional[int] = None
    profile: str = "ros1"
    overwrite: bool = False
    workers: int = WORKERS
    keep_latched: bool = False


class WriteResult(NamedTuple):
    """The result of a log's writing.

    Attributes:
        source: Name of the source.
        target: The log.
        messages: Messages written.
        bytes_read: Size of the source.
        bytes_written: Size of the target.
        seconds: Wall time, s.
        notes: Losses that the target's format causes.
        left_out: Number of topics that are left out, each of which has a note.
        error: The reason why there is no target; empty on success.
    """

    source: str
    target: str
    messages: int = 0
    bytes_read: int = 0
    bytes_written: int = 0
    seconds: float = 0.0
    notes: Tuple[str, ...] = ()
    left_out: int = 0
    error: str = ""

    def document(self) -> Dict[str, Any]:
        """Return the result as JSON data."""
        return dict(self._asdict(), notes=list(self.notes), error=self.error or None)


def refuse_same_file(source: PathLike, target: PathLike) -> None:
    """Refuse, by ``BagError``, a target that is the source under any name."""
    if is_same_file(source, target):
        raise BagError("%s is input and output" % source)


def size_of(path: object) -> int:
    """Return the bytes of a file, or of the files in a folder."""
    target = Path(str(path))
    files = target.rglob("*") if target.is_dir() else [target]
    return sum(file.stat().st_size for file in files if file.is_file())


def with_md5(connection: Connection) -> Connection:
    """Return the connection with its definition's md5, where the log has none and the definition is understood."""
    if connection.md5sum or connection.encoding != "ros1":
        return connection
    try:
        return connection._replace(md5sum=definition_md5(connection.datatype, connection.definition))
    except DefinitionError:
        return connection


def add_channels(connections: Sequence[Connection], writer: LogWriter, wanted: Optional[Array] = None) -> Array:
    """Add the wanted connections (None: all) to a writer; return its number of each, 0 for the others.

    Raises:
        BagError: The output's format cannot hold one of them.
    """
    flags = [True] * len(connections) if wanted is None else wanted
    return np.array([writer.add_channel(with_md5(c)) if w else 0 for c, w in zip(connections, flags)] or [0], np.int64)


class LossNotes:
    """A watch for data that an output has no place for.

    Args:
        writer: The output.
    """

    def __init__(self, writer: LogWriter) -> None:
        self._format_name = writer.format_name
        self._can = writer.capabilities
        self._publish_times = False
        self._sequences = False

    def look(self, batch: MessageBatch) -> MessageBatch:
        """Look at a batch on its way."""
        if not (self._can.publish_times or self._publish_times) and batch.publish_time is not batch.log_time:
            self._publish_times = bool((batch.publish_time != batch.log_time).any())
        if not (self._can.sequences or self._sequences):
            self._sequences = bool(batch.sequence.any())
        return batch

    def notes(self, readers: Sequence[LogReader]) -> Tuple[str, ...]:
        """Return the losses, one line each."""
        result = [note for reader in readers for note in reader.index.notes]
        if self._publish_times:
            result.append("%s has no place for publish times: only the log times are kept" % self._format_name)
        if self._sequences:
            result.append("%s has no place for the MCAP's sequence numbers: they are left out" % self._format_name)
        extras = sum((0 if self._can.attachments else len(reader.index.attachments))
                     + (0 if self._can.metadata else len(reader.index.metadata)) for reader in readers)
        if extras:
            result.append("%s has no place for attachments and metadata: %d left out" % (self._format_name, extras))
        return tuple(result)


def copy_extras(source: Union[LogReader, LogRecovery], writer: LogWriter, has_attachments: bool = True,
                known: Optional[Set[Tuple[str, FrozenSet[Tuple[str, str]]]]] = None) -> None:
    """Copy attachments and metadata where the output has a place for them.

    Args:
        source: The log.
        writer: The output.
        has_attachments: False to copy the metadata only.
        known: Metadata, name and values, that the output has already and that is not repeated; it grows.

    Raises:
        BagFormatError: One of them is damaged.
    """
    found = source.index if isinstance(source, LogReader) else source
    for attachment in found.attachments if has_attachments and writer.capabilities.attachments else ():
        writer.add_attachment(attachment.name, source.read_attachment(attachment), attachment.media_type,
                              attachment.log_time, attachment.create_time)
    for entry in found.metadata if writer.capabilities.metadata else ():
        values = source.read_metadata(entry)
        fact = (entry.name, frozenset(values.items()))
        if known is None or fact not in known:
            writer.add_metadata(entry.name, values)
        if known is not None:
            known.add(fact)


def write_in_order(items: Iterable[_Item], load: Callable[[_Item], Tuple[int, MessageBatch]], writer: LogWriter,
                   ids: Optional[Array] = None, on_progress: Optional[OnProgress] = None,
                   workers: int = WORKERS) -> int:
    """Write batches in the order of the items that they come from; return the number of messages.

    Args:
        items: Items that the batches are made of.
        load: Bytes of the source, and the batch, of one item; thread-safe.
        writer: The output; it stays open.
        ids: The writer's number of each of the batches' connections; None: they are numbered so already.
        on_progress: Receives the progress.
        workers: Threads.

    Raises:
        BagFormatError: A chunk read meanwhile is damaged.
        BagError: The output cannot hold them.
    """
    def work(item: _Item) -> Tuple[int, int, List[Optional[EncodedChunk]]]:
        size, batch = load(item)
        numbers = np.arange(int(batch.connection.max(initial=0)) + 1) if ids is None else ids
        return size, len(batch), [writer.encode(piece, numbers) for piece in pieces_of(batch, _MAX_PIECE)]

    def encoded_items() -> Iterator[Tuple[int, int, List[Optional[EncodedChunk]]]]:
        waiting = iter(items)
        for item in waiting:  # a bag's first chunk carries the connections: how many more would depend on the threads
            first = work(item)
            yield first
            if first[1]:
                break
        yield from in_order(work, waiting, workers)

    written = 0
    for size, count, encoded in encoded_items():
        for chunk in encoded:
            writer.append(chunk)
        written += count
        if on_progress is not None:
            on_progress(size, count)
    return written


def _neighbours(chunks: Iterable[ChunkRef]) -> Iterator[List[ChunkRef]]:
    """Yield neighbouring small chunks together, each larger one on its own."""
    group: List[ChunkRef] = []
    size = unpacked = 0
    for chunk in chunks:
        length = chunk.end - chunk.position
        if group and (size + length > _SMALL or unpacked + chunk.unpacked > _SMALL_UNPACKED):
            yield group
            group, size, unpacked = [], 0, 0
        group.append(chunk)
        size += length
        unpacked += chunk.unpacked
    if group:
        yield group


def is_worth_sorting(chunks: Sequence[ChunkRef], expansion: float) -> bool:
    """Return whether chunks overlap in time so much that a reader in the order of time unpacks them again and again.

    False also where those that overlap are too large to be held at once.

    Args:
        chunks: Chunks in any order.
        expansion: Unpacked bytes for each stored one.
    """
    overlap = span = 0
    open_chunks: List[Tuple[int, int]] = []
    latest: Optional[int] = None
    for chunk in sorted(chunks, key=lambda c: (c.start_time, c.position)):
        span += chunk.end_time - chunk.start_time
        overlap += 0 if latest is None else max(0, min(latest, chunk.end_time) - chunk.start_time)
        latest = chunk.end_time if latest is None else max(latest, chunk.end_time)
        open_chunks = [entry for entry in open_chunks if entry[0] > chunk.start_time]
        open_chunks.append((chunk.end_time, chunk.end - chunk.position))
        if sum(size for _, size in open_chunks) * expansion > HELD_BYTES:
            return False
    return overlap > _OVERLAP * span


def _latched_before(reader: LogReader, message_filter: MessageFilter, start_time: int) -> MessageBatch:
    """Return the newest message before a time, ns, of each wanted latched connection, in the order of time."""
    latched = np.array([bool(c.latching) for c in reader.connections], bool) & message_filter.wanted
    newest: Dict[int, MessageBatch] = {}
    for chunk in reader.chunks:
        if chunk.start_time >= start_time or not (not chunk.counts or any(latched[n] for n in chunk.counts)):
            continue
        batch = reader.load(chunk)
        which = np.flatnonzero(latched[batch.connection] & (batch.log_time < start_time))
        for number in distinct(batch.connection[which]).tolist():
            own = which[batch.connection[which] == number]
            last = own[len(own) - 1 - int(np.argmax(batch.log_time[own][::-1]))]
            candidate = batch.take(np.array([last]))
            if number not in newest or candidate.log_time[0] >= newest[number].log_time[0]:
                newest[number] = candidate.copy()
    return concatenate(sorted(newest.values(), key=lambda b: int(b.log_time[0])))


def wrong_count(expected: int, written: int) -> str:
    """Return the note on an index that tells of another number of messages than the records are."""
    return "the index tells of %d messages: there are %d, and all are kept" % (expected, written)


def copy_log(reader: LogReader, writer: LogWriter, message_filter: MessageFilter, on_progress: Optional[OnProgress],
             workers: int, latched_from: Optional[int]) -> Tuple[int, Tuple[str, ...]]:
    """Copy the wanted messages of one log in the order of the file, and what stands beside them.

    Where its chunks overlap in time, the messages are sorted by time, so that readers need each new chunk once.
    Also the newest message before ``latched_from``, ns (None: not), of each latched connection. Gives how many messages
    were written, and what was left out.
    """
    ids = add_channels(reader.connections, writer, message_filter.wanted)
    losses = LossNotes(writer)

    def load(chunks: List[ChunkRef]) -> Tuple[int, MessageBatch]:
        batch = concatenate([message_filter.apply(reader.load(chunk)) for chunk in chunks])
        return sum(chunk.end - chunk.position for chunk in chunks), losses.look(batch)

    written = 0
    if latched_from is not None:
        before = _latched_before(reader, message_filter, latched_from)
        writer.append(writer.encode(before, ids))
        written += len(before)
    wanted = reader.wanted_chunks(message_filter)
    stored = sum(entry[2] for entry in reader.index.codecs)
    if stored and is_worth_sorting(wanted, sum(entry[3] for entry in reader.index.codecs) / stored):
        source = Source(reader, message_filter, np.arange(len(reader.connections)))
        written += write_in_order(gathered(in_time_order([source]), writer.chunk_size),
                                  lambda batch: (int(batch.length.sum()), losses.look(batch)), writer, ids,
                                  on_progress, workers)
    else:
        written += write_in_order(_neighbours(wanted), load, writer, ids, on_progress, workers)
    if not written and reader.message_count:
        raise UsageError("%s: no message is selected: the selected topics have none in the selected time" % reader.path)
    copy_extras(reader, writer)
    notes = losses.notes([reader])
    if message_filter.takes_all and written != reader.message_count:
        notes += (wrong_count(reader.message_count, written),)
    return written, notes


def convert_file(job: Job, on_progress: Optional[OnProgress] = None) -> WriteResult:
    """Convert one file; leave out, and note, a topic that the target cannot hold, where others remain.

    Raises:
        BagError: The source cannot be read, or the target cannot be written or hold it.
        TopicRefused: The target can hold none of the topics.
        UsageError: Nothing of the source is selected.
    """
    begin = time.monotonic()
    refuse_same_file(job.source, job.target)
    with open_log(job.source) as log:
        is_for_ros1 = str(job.target).endswith(".bag") or job.profile == "ros2"
        is_foreign = any(connection.encoding != "ros1" for connection in log.connections)
        reader = as_ros1_log(log) if is_for_ros1 and is_foreign else log
        index = reader.index
        missing = require_match(job.selection, reader.connections, job.source)
        selection = job.span.apply(job.selection, index.start_time, index.end_time)
        refused = without_ros1_form(reader) if is_foreign and str(job.target).endswith(".bag") else {}
        every = MessageFilter(selection, reader.connections)
        refused = {c.topic: refused[c.topic] for c, wanted in zip(reader.connections, every.wanted)
                   if wanted and c.topic in refused}
        while True:
            chosen = MessageFilter(selection._replace(exclude=(*selection.exclude, *map(re.escape, refused))),
                                   reader.connections)
            if refused and not any(count for count, wanted in zip(index.counts, chosen.wanted) if wanted):
                raise TopicRefused("%s: %s" % (job.source, "; ".join(refused.values())))
            reader.decode_only(chosen.wanted)
            try:
                with create_log(job.target, job.compression, job.level, job.overwrite, index.profile or "ros1",
                                job.profile == "ros2") as writer:
                    messages, notes = copy_log(reader, writer, chosen, on_progress, job.workers,
                                               selection.start_time if job.keep_latched else None)
                break
            except TopicRefused as error:  # which may be the last message's fault: once more, without the topic
                if not chosen.wanted[[c.topic == error.topic for c in reader.connections]].any():
                    raise
                refused[error.topic] = str(error)
    return WriteResult(job.source, job.target, messages, index.size, size_of(job.target), time.monotonic() - begin,
                       (*notes, *missing, *("%s is left out: %s" % item for item in refused.items())),
                       len(index.left_out) + len(refused))
