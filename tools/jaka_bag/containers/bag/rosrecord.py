"""The reader of bags of version 1.2 (ROS wiki, Bags/Format/1.2): consecutive records, no chunks; never written.

Functions that read raise ``BagFormatError`` where the bytes are damaged or cut off.
"""
import os
from typing import BinaryIO, Counter, Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import MessageBatch, RowStore
from ...messages.connection import Connection
from ...paths import PathLike
from ...units import NS_PER_S
from ..index import ChunkRef, LogIndex, read_at
from ..interface import LogReader, chunk_of
from ..recovery import LogRecovery, Stretch
from . import records as fmt
from .records import parse_chunk_head

__all__ = ["RosrecordReader", "RosrecordRecovery", "parse_chunk_head", "read_index"]

MAGIC = b"#ROSRECORD V1.2\n"
_OP_DEFINITION, _OP_MESSAGE, _OP_FILE_HEADER, _OP_INDEX = range(1, 5)
_WINDOW = 1 << 20
"""Bytes read at a time: memory stays bounded, and a disk is read in long pieces."""


class _Run(NamedTuple):
    """Records that lie together in the file, from one byte to before another, and their messages."""

    begin: int
    end: int
    batch: MessageBatch


class _Walk:
    """A walk over records in the order of the file, which learns definitions and connections.

    Attributes:
        numbers: The connections in the order of their first messages, with their numbers.
        at: Start of the next record; the end of the file, or the position of damage.
    """

    def __init__(self, descriptor: int, size: int, connections: Tuple[Connection, ...] = ()) -> None:
        self._descriptor = descriptor
        self._size = size
        self.numbers = {connection: number for number, connection in enumerate(connections)}
        self._definitions: Dict[Tuple[str, str], str] = {
            (c.datatype, c.md5sum): c.definition for c in connections if c.definition}
        self.at = len(MAGIC)

    def _number(self, fields: fmt.Header) -> int:
        texts = {name: value.decode("utf-8", "surrogateescape") for name, value in fields.items()}
        if "topic" not in texts or "type" not in texts:
            raise BagFormatError("a message lacks its topic or type")
        latching = {"0": False, "1": True}.get(texts.get("latching", ""))
        datatype, md5sum = texts["type"], texts.get("md5", "")
        connection = Connection(texts["topic"], datatype, md5sum, self._definitions.get((datatype, md5sum), ""),
                                texts.get("callerid"), latching)
        return self.numbers.setdefault(connection, len(self.numbers))

    def run(self, stop: int) -> Optional[_Run]:
        """Return whole records, at most a window's worth, up to a byte of the file; None where there is none."""
        begin = self.at
        raw = read_at(self._descriptor, begin, min(_WINDOW, stop - begin))
        first = fmt.try_record_at(raw)
        if first is not None and first.end > len(raw) and begin + first.end <= stop:
            raw = read_at(self._descriptor, begin, first.end)  # one message is larger than the window
        rows, at = RowStore(has_publish=False), 0
        while at < len(raw):
            record = fmt.try_record_at(raw, at)
            if record is None or record.end > len(raw) or not _OP_DEFINITION <= record.kind <= _OP_INDEX:
                break
            if record.kind == _OP_DEFINITION:
                texts = {name: value.decode("utf-8", "surrogateescape") for name, value in record.fields.items()}
                self._definitions[texts.get("type", ""), texts.get("md5", "")] = texts.get("def", "")
            elif record.kind == _OP_MESSAGE and "topic" in record.fields:
                time = fmt.u32(record.fields, "sec") * NS_PER_S + fmt.u32(record.fields, "nsec")
                rows.append((record.begin, record.end - record.begin, self._number(record.fields), time))
            at = record.end
        if not at:
            return None
        self.at = begin + at
        return _Run(begin, self.at, rows.batch(np.frombuffer(raw, np.uint8)))

    def runs(self) -> Iterator[_Run]:
        """Yield all runs of records up to the file's end, or up to damage."""
        while self.at < self._size:
            run = self.run(self._size)
            if run is None:
                return
            yield run


def read_index(path: PathLike, descriptor: int) -> LogIndex:
    """Read the index of a bag of version 1.2 in a walk through the file: its own index holds little."""
    size = os.fstat(descriptor).st_size
    walk = _Walk(descriptor, size)
    chunks: List[ChunkRef] = []
    totals: Counter[int] = Counter()
    for run in walk.runs():
        if len(run.batch):
            chunks.append(chunk_of(run.begin, run.end, run.batch, True))
            totals.update(chunks[-1].counts)
    if walk.at < size:
        raise BagFormatError("a record at byte %d is cut off or damaged (jaka_bag recover keeps those before it)"
                             % walk.at)
    connections = list(walk.numbers)
    return LogIndex("bag", "1.2", str(path), size, connections, {i: i for i in range(len(connections))}, chunks,
                    [totals[i] for i in range(len(connections))],
                    min((c.start_time for c in chunks), default=None), max((c.end_time for c in chunks), default=None))


class RosrecordReader(LogReader):
    """A bag of version 1.2 open for reading; see ``LogReader``."""

    def __init__(self, file: BinaryIO, index: LogIndex) -> None:
        super().__init__(file, index)
        self._size = index.size

    def _parse(self, chunk: ChunkRef, raw: bytes) -> MessageBatch:
        walk = _Walk(self._file.fileno(), self._size, tuple(self.connections))
        walk.at = chunk.position
        run = walk.run(chunk.end)
        if run is None or run.end != chunk.end:
            raise BagFormatError("a record is damaged")
        return run.batch


class RosrecordRecovery(LogRecovery):
    """The recovery of a bag of version 1.2 up to its first damage; see ``LogRecovery``."""

    def _stretches(self) -> Iterator[Stretch]:
        walk = _Walk(self.descriptor, self.size)
        for run in walk.runs():
            self.learn({number: connection for connection, number in walk.numbers.items()})
            yield Stretch(run.begin, run.end, run.batch)
        if walk.at < self.size:
            self.lose(walk.at, self.size, "a record is cut off or damaged")
