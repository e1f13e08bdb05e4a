"""A log open for reading, either format: connections, chunks as blocks, messages in time order."""
import os
from types import TracebackType
from typing import Dict, List, NamedTuple, Optional, Tuple, Type

import numpy as np

from ..errors import BagFormatError
from ..messages.batch import Array, Block
from ..messages.connection import Connection
from ..messages.selection import Picker
from .index import AttachmentIndex, ChunkRef, LogIndex, MetadataIndex, read_at

_LOOKUP_LIMIT = 1 << 20


class Message(NamedTuple):
    """One message as the log holds it; times in ns since the epoch."""

    connection: Connection
    log_time: int
    data: bytes
    publish_time: int
    sequence: int


class Renumbering:
    """The file's ids of connections to this package's numbers, for whole arrays."""

    def __init__(self, numbers: Dict[int, int]) -> None:
        self._numbers = numbers
        self._table: Optional[Array] = None
        if not numbers or max(numbers) < _LOOKUP_LIMIT:
            self._table = np.full(max(numbers, default=0) + 1, -1, np.int32)
            for file_id, number in numbers.items():
                self._table[file_id] = number

    def __call__(self, block: Block) -> Block:
        """The block with numbers.

        Raises:
            BagFormatError: A message is of a connection that the log does not describe.
        """
        ids = block.connection
        if not len(ids):
            number = ids.astype(np.int32)
        elif self._table is not None and int(ids.max()) < len(self._table):
            number = self._table[ids]
        else:
            values, inverse = np.unique(ids, return_inverse=True)
            number = np.array([self._numbers.get(v, -1) for v in values.tolist()], np.int32)[inverse]
        if len(number) and int(number.min()) < 0:
            raise BagFormatError("messages of a connection that the log does not describe")
        return Block(block.data, block.start, block.length, number, block.log_time, block.publish_time,
                     block.sequence)


class LogReader:
    """A log open for reading; ``load`` may be called by several threads at once. ``open_log`` makes it.

    Args:
        descriptor: Of the open file; it is closed with the reader.
        index: What the log says about itself.

    Attributes:
        index: What the log says about itself.
        connections: Its connections; blocks refer to them by position.
        chunks: Its chunks in the order of the file.
    """

    def __init__(self, descriptor: int, index: LogIndex) -> None:
        self._descriptor = descriptor
        self.index = index
        self.path = index.path
        self.connections: List[Connection] = index.connections
        self.chunks: List[ChunkRef] = index.chunks
        self._renumber = Renumbering(index.numbers)

    @property
    def message_count(self) -> int:
        """Messages in the log, by its index."""
        return sum(self.index.counts)

    def load(self, chunk: ChunkRef) -> Block:
        """The messages of one chunk, in the order of the file.

        Raises:
            BagFormatError: The chunk is damaged.
        """
        raw = read_at(self._descriptor, chunk.position, chunk.end - chunk.position)
        try:
            return self._renumber(self._parse(chunk, raw))
        except BagFormatError as error:
            raise BagFormatError("%s: chunk at byte %d: %s (jaka_bag recover keeps the rest)"
                                 % (self.path, chunk.position, error)) from error

    def load_times(self, chunk: ChunkRef) -> Block:
        """As ``load``, but only connection and log time are right; from the index where it has them."""
        return self.load(chunk)

    def _parse(self, chunk: ChunkRef, raw: bytes) -> Block:
        raise NotImplementedError

    def wanted_chunks(self, picker: Picker) -> List[ChunkRef]:
        """The chunks that may hold a wanted message, in the order of the file."""
        return [chunk for chunk in self.chunks if picker.may_be_in(chunk.start_time, chunk.end_time, chunk.counts)]

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """The content of one of ``index.attachments``.

        Raises:
            BagFormatError: It is damaged.
        """
        raise NotImplementedError

    def read_metadata(self, entry: MetadataIndex) -> Tuple[str, Dict[str, str]]:
        """Name and content of one of ``index.metadata``.

        Raises:
            BagFormatError: It is damaged.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Close the file."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> "LogReader":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], value: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        self.close()
