"""The splitting of one log into several."""
import os
import re
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from ..containers.interface import LogWriter
from ..containers.registry import create_log, open_log
from ..containers.time_order import in_time_order, whole_source
from ..errors import BagError
from ..messages.batch import Array, MessageBatch, pieces_of
from ..messages.selection import Selection
from ..output_file import OutputFolder, check_output
from ..paths import PathLike
from .convert import LossNotes, OnProgress, add_channels, copy_extras, refuse_same_file

_FINEST = 64
"""Pieces that a part limited by size is at least made of."""


class SplitLimits(NamedTuple):
    """The limits of a part; None for no limit.

    Attributes:
        size: Bytes of the file; the last chunk and the index may go beyond.
        duration: Log time, ns.
        messages: Number of messages.
    """

    size: Optional[int] = None
    duration: Optional[int] = None
    messages: Optional[int] = None


class SplitResult(NamedTuple):
    """The parts in order, (path, messages), what they cannot hold, and the number of topics that are left out."""

    parts: Tuple[Tuple[str, int], ...]
    notes: Tuple[str, ...]
    left_out: int = 0


class _Parts:
    """The parts written so far and the one being written: in a folder of their own, until all of them are whole."""

    def __init__(self, source: PathLike, stem: Path, compression: Optional[str], level: Optional[int],
                 overwrite: bool, profile: str) -> None:
        self._source = source
        self._stem = stem
        self._overwrite = overwrite
        self._settings = (compression, level, False, profile)
        self._pattern = re.compile(r"%s_([0-9]{1,6})%s" % (re.escape(stem.stem), re.escape(stem.suffix)))
        self.done: List[Tuple[str, int]] = []
        self.writer: Optional[LogWriter] = None
        self.begin_time = 0
        self.own = 0
        self._check(0)
        self._folder = OutputFolder(stem.with_name(stem.name + ".split"), lambda left: bool(
            self._pattern.fullmatch(left[:-len(".part")] if left.endswith(".part") else left)))

    def path(self, number: int) -> Path:
        return self._stem.with_name("%s_%d%s" % (self._stem.stem, number, self._stem.suffix))

    def _check(self, number: int) -> Path:
        path = self.path(number)
        check_output(path, self._overwrite)
        refuse_same_file(self._source, path)
        return path

    def begin(self, time: int) -> LogWriter:
        path = self._check(len(self.done))
        self.writer = create_log(self._folder.working_path / path.name, *self._settings)
        self.writer.name = str(path)
        self.begin_time, self.own = time, 0
        return self.writer

    def finish(self) -> None:
        if self.writer is not None:
            self.writer.close()
            self.done.append((self.writer.name, self.writer.message_count))
            self.writer = None

    def commit(self) -> None:
        """Give all parts their names.

        The parts of an earlier split that go on where the new ones end are removed: they would double messages.
        """
        obsolete: List[str] = []
        while self._overwrite and self.path(len(self.done) + len(obsolete)).is_file():
            obsolete.append(self._check(len(self.done) + len(obsolete)).name)
        self._folder.commit_files([Path(path).name for path, _ in self.done], obsolete, self._overwrite)

    def strangers(self) -> Tuple[str, ...]:
        """Return a line for each other file that is named like a part."""
        found = [(int(match.group(1)), match.group()) for match in map(self._pattern.fullmatch, os.listdir(
            str(self._stem.parent))) if match]
        return tuple("%s is no part of this split: merging %s_*%s would take it, too"
                     % (name, self._stem.stem, self._stem.suffix)
                     for number, name in sorted(found) if number >= len(self.done))

    def discard(self) -> None:
        """Remove what was written: a set with parts missing would look whole."""
        if self.writer is not None:
            self.writer.abort()
        self._folder.abort()


def _cuts(batch: MessageBatch, begin_time: int, written: int, limits: SplitLimits) -> int:
    """Return how many of the batch's first messages still belong to a part; one or more to an empty one.

    Args:
        batch: The messages that come next.
        begin_time: The part's first log time, ns.
        written: The part's own messages so far, without those that it repeats.
        limits: Limits of a part.
    """
    fits = len(batch)
    if limits.duration is not None:
        fits = min(fits, int(np.searchsorted(batch.log_time, begin_time + limits.duration)))
    if limits.messages is not None:
        fits = min(fits, limits.messages - written)
    return fits if written else max(fits, 1)  # an empty part would be followed by others, for ever


class _Latched:
    """The newest message of each latched connection so far."""

    def __init__(self, is_latched: Array) -> None:
        self._is_latched = is_latched
        self._newest: Dict[int, MessageBatch] = {}

    def look(self, batch: MessageBatch) -> None:
        for i in np.flatnonzero(self._is_latched[batch.connection]).tolist():
            self._newest[int(batch.connection[i])] = batch.take(np.array([i])).copy()

    def repeated(self, time: int) -> Iterator[MessageBatch]:
        """Yield the latched messages, with the time at which a part begins, ns."""
        for batch in self._newest.values():
            yield batch.replace(log_time=np.full(1, time, np.int64))


def split(source: PathLike, stem: PathLike, limits: SplitLimits, compression: Optional[str] = None,
          level: Optional[int] = None, overwrite: bool = False, repeat_latched: bool = False,
          on_progress: Optional[OnProgress] = None) -> SplitResult:
    """Write a log as parts ``STEM_0.SUFFIX``, ``STEM_1.SUFFIX``, ..., in the order of time.

    The log's attachments go to the first part, its metadata to each.

    Args:
        source: The log.
        stem: ``NAME.bag`` or ``NAME.mcap``.
        limits: Limits of a part, at least one.
        compression: None for the format's default.
        level: The codec's level; None for its default.
        overwrite: Replace existing parts, and remove those of an earlier split that had more of them.
        repeat_latched: Begin each further part with the newest message of each latched connection.
        on_progress: Receives the progress.

    Raises:
        BagError: The source cannot be read, a part cannot be written, or no limit is given.
    """
    if limits == SplitLimits():
        raise BagError("nothing says where to split")
    with open_log(source) as reader:
        parts = _Parts(source, Path(stem), compression, level, overwrite, reader.index.profile or "ros1")
        latched = _Latched(np.array([bool(c.latching) for c in reader.connections], bool))
        losses: Optional[LossNotes] = None
        ids = np.zeros(1, np.int64)
        def begin(first: int) -> LogWriter:
            nonlocal ids, losses
            writer = parts.begin(first)
            ids = add_channels(reader.connections, writer)
            losses = LossNotes(writer)
            copy_extras(reader, writer, has_attachments=not parts.done)
            return writer

        piece = 1 << 20 if limits.size is None else max(min(1 << 20, limits.size // _FINEST), 1)
        try:
            for whole in in_time_order([whole_source(reader, Selection())]):
                for rest in pieces_of(whole, piece):
                    while len(rest):
                        writer = parts.writer
                        if writer is None:
                            first = int(rest.log_time[0])
                            writer = begin(first)
                            for batch in latched.repeated(first) if repeat_latched and parts.done else ():
                                writer.append(writer.encode(batch, ids))
                        fits = _cuts(rest, parts.begin_time, parts.own, limits)
                        taken, rest = rest.take(slice(0, fits)), rest.take(slice(fits, len(rest)))
                        latched.look(taken)
                        assert losses is not None
                        writer.append(writer.encode(losses.look(taken), ids))
                        parts.own += len(taken)
                        if len(rest) or (limits.size is not None and writer.position >= limits.size):
                            parts.finish()
                if on_progress is not None:
                    on_progress(int(whole.length.sum()), len(whole))
            if not parts.done and parts.writer is None and (reader.index.attachments or reader.index.metadata):
                begin(0)
            parts.finish()
            parts.commit()
        except BaseException:
            parts.discard()
            raise
        return SplitResult(tuple(parts.done), (losses.notes([reader]) if losses is not None else ())
                           + parts.strangers(), len(reader.index.left_out))
