"""The diagnosis of a log, read as a whole: losses, oddities and facts worth knowing."""
import os
from typing import Any, Dict, List, NamedTuple, Optional, Set, Tuple

import numpy as np

from ..containers.interface import LogReader
from ..containers.recovery import LogRecovery, Loss
from ..containers.registry import open_damaged, open_log
from ..errors import BagError, BagFormatError, DefinitionError, LimitReached
from ..messages.batch import MessageBatch, distinct
from ..messages.connection import Connection
from ..messages.definitions import definition_md5
from ..messages.layout import LayoutFinder
from ..paths import PathLike
from .convert import OnProgress

DAMAGED, LIMITED, ODD, WHOLE = "damaged", "limited", "odd", "whole"
_EMPTY_MD5 = "d41d8cd98f00b204e9800998ecf8427e"
_MOST_LOSSES = 8
"""Losses of a kind that are listed; the rest is counted."""
_LEVELS = ("error", "limit", "warning", "note")
"""Levels of findings, the worst first."""


class Finding(NamedTuple):
    """One thing found.

    Attributes:
        level: ``error`` (something is lost), ``limit`` (something was not read), ``warning`` (some software will
            stumble) or ``note``.
        text: The finding, one line.
    """

    level: str
    text: str


class Diagnosis(NamedTuple):
    """The diagnosis of one log.

    Attributes:
        path: Path of the file.
        messages: Messages that can be read.
        findings: Findings, the worst first.
    """

    path: str
    messages: int
    findings: Tuple[Finding, ...]

    @property
    def verdict(self) -> str:
        """``damaged`` where there is an error, ``limited`` for a limit, ``odd`` for a warning, else ``whole``."""
        levels = {finding.level for finding in self.findings}
        return next((verdict for level, verdict in zip(_LEVELS, (DAMAGED, LIMITED, ODD)) if level in levels), WHOLE)

    def document(self) -> Dict[str, Any]:
        """Return the diagnosis as JSON data."""
        return {"path": self.path, "verdict": self.verdict, "messages": self.messages,
                "findings": [finding._asdict() for finding in self.findings]}


class _Findings:
    def __init__(self) -> None:
        self.list: List[Finding] = []

    def error(self, text: str) -> None:
        self.list.append(Finding("error", text))

    def limit(self, text: str) -> None:
        self.list.append(Finding("limit", text))

    def blame(self, error: BagError, text: str) -> None:
        """Add an error that ended a reading: a limit or damage."""
        (self.limit if LimitReached.WORDS in str(error) else self.error)(text)

    @property
    def has_limit(self) -> bool:
        return any(finding.level == "limit" for finding in self.list)

    def warn(self, text: str) -> None:
        self.list.append(Finding("warning", text))

    def note(self, text: str) -> None:
        if Finding("note", text) not in self.list:
            self.list.append(Finding("note", text))


class _Messages:
    """An examination of all messages that can be read.

    Attributes:
        total: Number of messages.
        counts: Number of messages by the file's own id of the connection.
    """

    def __init__(self, recovery: LogRecovery, findings: _Findings) -> None:
        self._recovery = recovery
        self._findings = findings
        self._fits: Dict[int, bool] = {}
        self._last_time: Optional[int] = None
        self._backward = self._timeless = 0
        self.total = 0
        self.counts: Dict[int, int] = {}

    def look(self, batch: MessageBatch) -> None:
        times = batch.log_time
        if not len(times):
            return
        self.total += len(batch)
        steps = np.diff(times)
        self._backward += int((steps < 0).sum()) + (self._last_time is not None and int(times[0]) < self._last_time)
        self._last_time = int(times[-1])
        self._timeless += int((times == 0).sum())
        for file_id in distinct(batch.connection).tolist():
            which = np.flatnonzero(batch.connection == file_id)
            self.counts[file_id] = self.counts.get(file_id, 0) + len(which)
            if file_id in self._recovery.connections and file_id not in self._fits:
                self._fits[file_id] = self._look_inside(self._recovery.connections[file_id], batch, which[:100])

    def _look_inside(self, connection: Connection, batch: MessageBatch, which: Any) -> bool:
        """Return whether the first messages of a connection are as its definition says."""
        try:
            if connection.encoding == "ros1":
                for _ in LayoutFinder(connection).groups(batch, which):
                    pass
        except DefinitionError as error:
            self._findings.warn(str(error) if connection.topic in str(error) else "%s: %s" % (connection.topic, error))
            return False
        return True

    def finish(self) -> None:
        """Add the findings that need all messages."""
        if self._backward:
            self._findings.note("%d messages are older than the one before them in the file" % self._backward)
        if self._timeless:
            self._findings.warn("%d messages have the log time 0" % self._timeless)
        for file_id, count in self.counts.items():
            if file_id not in self._recovery.connections and not self._findings.has_limit:
                self._findings.error("%d messages of connection %d, which is not described" % (count, file_id))


def _look_at_connections(connections: List[Connection], findings: _Findings) -> None:
    types: Dict[str, Set[Tuple[str, str]]] = {}
    for connection in connections:
        types.setdefault(connection.topic, set()).add((connection.datatype, connection.md5sum))
        if connection.encoding != "ros1" or connection.schema_encoding != "ros1msg":
            continue
        if not connection.definition.strip() and connection.md5sum not in ("", _EMPTY_MD5):
            findings.warn("%s: the definition of %s is missing: its messages cannot be decoded"
                          % (connection.topic, connection.datatype))
            continue
        try:
            md5 = definition_md5(connection.datatype, connection.definition)
        except (DefinitionError, RecursionError) as error:
            findings.warn("%s: the definition of %s is not understood (%s)"
                          % (connection.topic, connection.datatype, error))
            continue
        if not connection.md5sum:
            findings.note("%s names no md5; that of its definition is %s" % (connection.topic, md5))
        elif connection.md5sum not in (md5, "*"):
            findings.warn("%s: the md5 is %s, that of its definition of %s is %s: subscribers will refuse one of them"
                          % (connection.topic, connection.md5sum, connection.datatype, md5))
    for topic, kinds in sorted(types.items()):
        if len(kinds) > 1:
            findings.warn("%s has messages of %d types: %s"
                          % (topic, len(kinds), ", ".join(sorted("%s (md5 %s)" % kind for kind in kinds))))


def _look_at_index(reader: LogReader, seen: _Messages, findings: _Findings) -> None:
    """Compare the log's index with its content."""
    index = reader.index
    for note in index.notes:
        (findings.error if index.contradiction and note is index.notes[-1] else findings.note)(note)
    if findings.has_limit:  # what was not read cannot be compared
        return
    if sum(index.counts) != seen.total:
        findings.error("the index tells of %d messages, the file holds %d" % (sum(index.counts), seen.total))
    else:
        for file_id, number in index.numbers.items():
            if index.counts[number] != seen.counts.get(file_id, 0):
                findings.error("%s: the index tells of %d messages of connection %d, the file holds %d" % (
                    index.connections[number].topic, index.counts[number], file_id, seen.counts.get(file_id, 0)))
    ordered = sorted(index.chunks, key=lambda chunk: chunk.start_time)
    overlaps = sum(1 for before, after in zip(ordered, ordered[1:]) if after.start_time < before.end_time)
    if overlaps:
        findings.note("%d of %d chunks overlap in time" % (overlaps, len(ordered)))
    for attachment in index.attachments:
        try:
            reader.read_attachment(attachment)
        except BagFormatError as error:
            findings.error(str(error))
    for entry in index.metadata:
        try:
            reader.read_metadata(entry)
        except BagFormatError as error:
            findings.error("metadata %s: %s" % (entry.name, error))


def _look_at_losses(losses: List[Loss], findings: _Findings) -> None:
    """Add the losses, the first ones in full: those by a limit of this reader are no damage."""
    for is_limit, add, rest in ((True, findings.limit, "%d more places were not read"),
                                (False, findings.error, "%d more places are damaged")):
        some = [loss for loss in losses if loss.is_limit == is_limit]
        for loss in some[:_MOST_LOSSES]:
            add(loss.describe())
        if len(some) > _MOST_LOSSES:
            add(rest % (len(some) - _MOST_LOSSES))


def _look_at_folder(path: PathLike, recovery: LogRecovery, findings: _Findings) -> None:
    """Open a rosbag2 folder as other commands do."""
    if recovery.expected is None:  # no declarations that can be read
        return
    try:
        with open_log(path) as reader:
            for note in reader.index.notes:
                findings.note("as a log of ROS 1: %s" % note)
    except DefinitionError as error:
        findings.note("ROS 1 can have none of it: %s" % str(error).replace("%s: " % path, "", 1))
    except BagError as error:
        findings.blame(error, "other commands cannot read it: %s" % str(error).replace("%s: " % path, "", 1))


def diagnose(path: PathLike, on_progress: Optional[OnProgress] = None) -> Diagnosis:
    """Read all of a log.

    Args:
        path: A .bag, .mcap or rosbag2 folder, damaged or not.
        on_progress: Receives the progress.

    Raises:
        BagError: It cannot be opened.
        BagFormatError: It is of no known format, or encrypted.
    """
    findings = _Findings()
    with open_damaged(path) as recovery:
        seen = _Messages(recovery, findings)
        done = 0
        for stretch in recovery.stretches():
            seen.look(stretch.batch)
            if on_progress is not None:
                on_progress(stretch.end - done, len(stretch.batch))
            done = stretch.end
    is_active = str(path).endswith(".active")
    for note in recovery.notes:
        findings.note(note)
    _look_at_losses([loss for loss in recovery.losses if not (is_active and loss.end >= recovery.size)], findings)
    seen.finish()
    if recovery.misled and not str(path).endswith(".active"):
        findings.error("the index of %d chunks leads to other places than their messages" % recovery.misled)
    _look_at_connections(list(recovery.connections.values()), findings)
    for contradiction in recovery.contradictions(seen.counts) if not findings.has_limit else ():
        findings.error(contradiction)
    if os.path.isdir(str(path)):
        _look_at_folder(path, recovery, findings)
        return _told(path, seen, findings)
    try:
        with open_log(path) as reader:
            if is_active:
                findings.note("it is still being written, or was cut off: this is what was whole when it was read")
            else:
                _look_at_index(reader, seen, findings)
    except BagError as error:
        findings.blame(error, "it has no usable index: %s" % str(error).replace("%s: " % path, "", 1))
    return _told(path, seen, findings)


def _told(path: PathLike, seen: _Messages, findings: _Findings) -> Diagnosis:
    return Diagnosis(str(path), seen.total, tuple(sorted(findings.list, key=lambda f: _LEVELS.index(f.level))))
