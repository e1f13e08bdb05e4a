"""The task that adds one log to a data set: its topics become tables, then its row in ``runs`` appears.

The tables of a log are ``topic=NAME/date=YYYY-MM-DD/CELL-RUN.parquet``: see ``runs.folder_of`` for NAME; the date is
that of the log's first message, UTC.
"""
import contextlib
import functools
import hashlib
import os
import re
from datetime import datetime, timedelta
from pathlib import Path
from typing import BinaryIO, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_bag.containers.index import METADATA, PACKED_SUFFIXES, open_for_reading, storage_files
from jaka_bag.containers.interface import LogReader
from jaka_bag.containers.registry import open_log
from jaka_bag.engines.tasks import DONE, SKIPPED, LogResult, LogTask
from jaka_bag.errors import BagError, BagFormatError, DefinitionError, UsageError
from jaka_bag.messages.batch import Array
from jaka_bag.messages.columns import Columns
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.selection import Selection
from jaka_bag.operations.columns import ColumnReader
from jaka_bag.operations.parquet import ParquetTable, load_pyarrow
from jaka_bag.operations.recover import recover
from jaka_bag.operations.timing import sequence_gaps
from jaka_bag.output_file import is_being_written
from jaka_bag.units import NS_PER_S

from .log_facts import read_facts
from .runs import (
    COMPACTED,
    COMPRESSION,
    FOLDER,
    LEFT_OUT,
    RECOVERED,
    RESERVED,
    UNREADABLE,
    WHOLE,
    RunRow,
    TopicCount,
    find_status,
    folder_of,
    metadata_of,
    name_of,
    write_row,
)
from .store import Staging, open_store

SUFFIXES = (".bag", ".mcap", ".db3", ".bag.active", ".mcap.active")
UNNAMED = "unnamed"
"""The cell of a log for which nothing names one."""
_HASH_PIECE = 1 << 20
"""Bytes hashed at a time: memory stays bounded."""
_HASH_LENGTH = 12
"""Hexadecimal digits in a run's name: 48 bits, so that of a million logs two are alike with 1 in 560."""
_LONGEST_CELL = 100
"""Most characters of a cell in a file's name, which has at most 255 bytes with the run's."""
_SEQUENCE = "header.seq"
_EPOCH = datetime(1970, 1, 1)


class AddSettings(NamedTuple):
    """The settings with which logs are added.

    Attributes:
        location: The data set: a folder or URL, as the workers name it.
        cell: Name of the cell for all logs; empty where the next, or the log itself, names it.
        cell_pattern: Regular expression, searched for in the log's path; its first group is the cell.
        is_again: Read logs again that are listed as unreadable.
    """

    location: str
    cell: str = ""
    cell_pattern: str = ""
    is_again: bool = False


def find_logs(sources: Sequence[str]) -> List[str]:
    """Return the named logs, and those in folders and below, each once, sorted within a folder.

    The files of a rosbag2 folder are logs; where they are compressed as a whole, the folder is one.

    Raises:
        UsageError: There is no such file, or a folder has none, or cannot be read.
    """
    def refuse(error: OSError) -> None:
        raise UsageError("%s cannot be read: %s" % (error.filename, error.strerror))

    found: Dict[str, None] = {}
    for source in sources:
        if not os.path.isdir(source):
            if not os.path.exists(source):
                raise UsageError("there is no log %s" % source)
            found[source] = None
            continue
        before = len(found)
        for folder, folders, names in os.walk(source, onerror=refuse):
            folders[:] = sorted(name for name in folders if not name.startswith("."))
            found.update(dict.fromkeys(os.path.join(folder, name) for name in sorted(names)
                                       if name.endswith(SUFFIXES)))
            if METADATA in names and any(name.endswith(PACKED_SUFFIXES) for name in names):
                found[folder] = None
        if len(found) == before:
            raise UsageError("%s holds no log (%s)" % (source, ", ".join("*" + suffix for suffix in SUFFIXES)))
    return list(found)


def cell_of(settings: AddSettings, path: str, told: str) -> str:
    """Return the cell of a log: from the settings, else from its path, else from the log itself."""
    match = re.search(settings.cell_pattern, path) if settings.cell_pattern else None
    by_path = (match.group(1) if match.groups() else match.group()) if match else ""
    return settings.cell or by_path or told or UNNAMED


def file_name(cell: str, run: str) -> str:
    """Name of a log's tables; of a long cell its beginning, as a name has at most 255 bytes; the run is its own."""
    return "%s-%s.parquet" % (re.sub(r"[^\w.+]", "_", cell, flags=re.ASCII)[:_LONGEST_CELL], run)


def _files_of(path: str) -> List[str]:
    """Return the files of a log: itself, or those of a rosbag2 folder."""
    return [os.path.join(path, name) for name in [METADATA, *storage_files(path)]] if os.path.isdir(path) else [path]


class _Source:
    """The log's file, or those of its folder: their hash, and whether they are still what was hashed."""

    def __init__(self, path: str, files: Sequence[BinaryIO]) -> None:
        self.path = path
        self._files = files
        self._state = self._look()
        self.size = sum(size for size, _ in self._state)
        digest = hashlib.sha256()
        for file in files:
            while True:
                piece = file.read(_HASH_PIECE)
                if not piece:
                    break
                digest.update(piece)
        self.hash = digest.hexdigest()

    def _look(self) -> List[Tuple[int, int]]:
        states = [os.fstat(file.fileno()) for file in self._files]
        return [(state.st_size, state.st_mtime_ns) for state in states]

    def check_unchanged(self) -> None:
        """Raise ``BagError`` where it was written to, or another file has its name, since it was opened."""
        try:
            is_same = all(os.path.samestat(os.stat(path), os.fstat(file.fileno()))
                          for path, file in zip(_files_of(self.path), self._files))
        except FileNotFoundError:
            is_same = False
        if not is_same or self._look() != self._state:
            raise BagError("it changed while it was read: add it again")


def add_log(task: LogTask) -> LogResult:
    """Add a log; ``task.settings`` are ``AddSettings``, ``value`` is the ``RunRow``, or the hash of a skipped log.

    Raises:
        BagError: It cannot be opened, changed meanwhile, or a table cannot be written.
        MissingDependency: pyarrow is not installed.
        OSError: The system refused, as with a full disk; nothing of the log is in the data set then.
    """
    settings: AddSettings = task.settings
    load_pyarrow()
    store = open_store(settings.location)
    if task.path.endswith(".active") and is_being_written(Path(task.path)):
        return LogResult(task.path, SKIPPED, "it is being written")
    with contextlib.ExitStack() as stack:
        source = _Source(task.path, [stack.enter_context(open_for_reading(path)) for path in _files_of(task.path)])

        def is_to_be_added() -> bool:
            status = find_status(store, source.hash)
            return status is None or settings.is_again and status == UNREADABLE

        def is_still_to_be_added() -> bool:
            # the compacted rows are many, and were looked at before: they count again only where they are others
            is_as_before = store.stamp(compacted) == before and not store.exists(name_of(source.hash))
            return is_as_before or is_to_be_added()

        compacted = "%s/%s" % (FOLDER, COMPACTED)
        before = store.stamp(compacted)
        is_there = LogResult(task.path, SKIPPED, "it is in the data set", source.size, 0, source.hash)
        if not is_to_be_added():
            return is_there
        with store.staging() as staging:
            row, tables = _read(source, settings, staging)
            source.check_unchanged()
            row_path = staging.folder / "row"
            write_row(row, row_path)
            # another process may have added the same log meanwhile, and under another cell, with other names
            if not staging.publish([*tables, (row_path, name_of(row.hash))], is_still_to_be_added):
                return is_there
    return LogResult(task.path, DONE, row.reason, source.size, row.messages, row)


def _read(source: _Source, settings: AddSettings, staging: Staging) -> Tuple[RunRow, List[Tuple[Path, str]]]:
    """Write the log's tables; return its row, and the tables with their names."""
    try:
        with open_log(source.path) as reader:
            return _Tables(source, settings, staging.folder, reader, WHOLE, "").written()
    except BagFormatError as error:
        reason = _without_path(error, source.path)
    whole = staging.folder / "recovered.mcap"
    try:
        recovered = recover(source.path, whole, compression="none", overwrite=True)
        with open_log(whole) as reader:
            losses = "; ".join([reason, *(loss.describe() for loss in recovered.losses[:3])])
            return _Tables(source, settings, staging.folder, reader, RECOVERED, losses).written()
    except BagFormatError as error:
        reason = _without_path(error, source.path).replace("%s: " % whole, "")
    row = RunRow(source.hash, source.hash[:_HASH_LENGTH], cell_of(settings, source.path, ""), UNREADABLE, reason,
                 path=source.path, size=source.size)
    return row, []


def _without_path(error: Exception, path: str) -> str:
    return " ".join(str(error).replace("%s: " % path, "").replace("%s is" % path, "it is").split())


class _Tables:
    """A writer of the topics of one log.

    Args:
        source: The log as it was given.
        settings: Settings with which it is added.
        folder: Folder to write to.
        reader: The log, or what was recovered of it.
        status: Status of the row.
        reason: Reason of the row.
    """

    def __init__(self, source: _Source, settings: AddSettings, folder: Path, reader: LogReader, status: str,
                 reason: str) -> None:
        self._source = source
        self._folder = folder
        self._reader = reader
        self._reasons = [*([reason] if reason else []), *reader.index.left_out]
        self._status = status
        facts = self._facts = read_facts(reader)
        self._cell = cell_of(settings, source.path, facts.cell)
        start = reader.index.start_time
        moment = None if start is None else _EPOCH + timedelta(seconds=start // NS_PER_S)
        self._date = "" if moment is None else moment.strftime("%Y-%m-%d")
        self._run = "%s%s" % ("" if moment is None else moment.strftime("%Y%m%dT%H%M%SZ-"), source.hash[:_HASH_LENGTH])
        self._first: Dict[str, Connection] = {}
        self._counts: Dict[str, int] = {}
        self._publishers: Dict[str, int] = {}
        for connection, count in zip(reader.connections, reader.index.counts):
            if count:
                self._first.setdefault(connection.topic, connection)
                self._counts[connection.topic] = self._counts.get(connection.topic, 0) + count
                self._publishers[connection.topic] = self._publishers.get(connection.topic, 0) + 1
        self._skipped: Dict[str, int] = {}
        self._last_sequence: Dict[str, Array] = {}

    def written(self) -> Tuple[RunRow, List[Tuple[Path, str]]]:
        """Write the tables; return the row, and the tables with their names."""
        topics = sorted(self._first)
        try:
            paths = self._write(topics) if topics else {}
        except DefinitionError:  # of one topic: the others are read without it
            paths = {}
            for topic in topics:
                self._skipped.pop(topic, None)
                self._last_sequence.pop(topic, None)
                try:
                    paths.update(self._write([topic]))
                except DefinitionError as error:
                    self._reasons.append(topic + LEFT_OUT + " ".join(str(error).split()))
        name = file_name(self._cell, self._run)
        files: Dict[str, Path] = {}
        for topic, path in paths.items():
            target = "%s/date=%s/%s" % (folder_of(topic), self._date, name)
            if target in files:  # names that ROS allows all differ
                self._reasons.append(topic + LEFT_OUT + "another topic has its table")
            files.setdefault(target, path)
        return self._row(), [(path, target) for target, path in files.items()]

    def _write(self, topics: Sequence[str]) -> Dict[str, Path]:
        columns = ColumnReader(self._reader, Selection(topics=tuple(topics)))
        paths: Dict[str, Path] = {}
        tables: Dict[str, ParquetTable] = {}
        with contextlib.ExitStack() as stack:
            for topic, some in columns.pieces(workers=1):
                if topic not in tables:
                    path = paths[topic] = self._folder / ("%d.parquet" % sorted(self._first).index(topic))
                    tables[topic] = stack.enter_context(self._table(topic, stack.enter_context(path.open("wb"))))
                tables[topic].add(some, functools.partial(columns.leaf, topic))
                self._look_at_sequence(topic, some)
        return paths

    def _table(self, topic: str, file: BinaryIO) -> ParquetTable:
        first = self._first[topic]
        return ParquetTable(file, {"cell": self._cell, "run": self._run}, metadata_of(
            topic, first.datatype, first.md5sum, self._source.hash), COMPRESSION, reserved=RESERVED)

    def _look_at_sequence(self, topic: str, some: Columns) -> None:
        """Count the numbers that are skipped, of a topic with one publisher."""
        numbers = some.fields.get(_SEQUENCE)
        if numbers is None or numbers.ndim != 1 or numbers.dtype == object or self._publishers[topic] > 1:
            return
        steps = np.diff(np.concatenate([self._last_sequence.get(topic, np.zeros(0, np.int64)),
                                        numbers.astype(np.int64)]))
        # a smaller number is a publisher's new start
        self._skipped[topic] = self._skipped.get(topic, 0) + int((steps[steps > 1] - 1).sum())
        self._last_sequence[topic] = numbers[-1:].astype(np.int64)

    def _lost(self, topic: str) -> Optional[int]:
        """Count the messages known to be missing from a topic; sequence numbers skip what the recorder lost, too."""
        told = self._facts.lost.get(topic)
        skipped = self._skipped.get(topic)
        if skipped is None and self._publishers[topic] > 1:
            with contextlib.suppress(KeyError, DefinitionError):
                skipped = sequence_gaps(self._reader, topic)[0]
        return max(told, skipped) if told is not None and skipped is not None else told if skipped is None else skipped

    def _row(self) -> RunRow:
        index, facts = self._reader.index, self._facts
        topics = tuple(TopicCount(topic, first.datatype, first.md5sum, self._counts[topic], self._lost(topic))
                       for topic, first in sorted(self._first.items()))
        duration = 0 if index.start_time is None or index.end_time is None else index.end_time - index.start_time
        return RunRow(
            self._source.hash, self._run, self._cell, self._status, "; ".join(self._reasons), facts.arm_model,
            facts.controller_firmware, facts.driver_version, index.start_time, duration / NS_PER_S,
            sum(self._counts.values()), sum(topic.lost or 0 for topic in topics), topics, facts.triggers,
            self._source.path, self._source.size)
