"""Many messages in few numpy arrays: the form that readers, filters and writers share."""
import functools
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Sequence, Tuple, Union

import numpy as np

if TYPE_CHECKING:
    Array = np.ndarray[Any, Any]
else:
    Array = np.ndarray

_GATHER_LIMIT = 4096
"""Payloads above this size, byte, are copied one by one: memcpy then wins over index arrays."""
_GATHER_ROWS = 8
"""Fewest payloads of one length that are copied together: for fewer an index array costs more than it saves."""
_MAX_GAPS = 64
"""Most stretches that are kept apart; with more all bytes are taken as they are."""
_MOST_IN_PIECE = 1 << 18
"""Messages in one piece of a batch, for those without bytes."""
_ROWS = 1 << 16
"""Rows that are kept as Python objects before they are packed into an array, which takes less memory."""


class MessageBatch:
    """Messages that lie in one buffer.

    Attributes:
        data: The buffer, uint8.
        start: First byte of each message in ``data``, int64, shape (n,).
        length: Bytes of each message, int64, shape (n,).
        connection: Position in the reader's ``connections``, int32, shape (n,).
        log_time: Time of recording, ns since the epoch, int64, shape (n,).
        publish_time: Time of publishing, ns, int64, shape (n,); equal to ``log_time`` where the log has none.
        sequence: Number given by the publisher or recorder, uint32, shape (n,); 0 where the log has none.
    """

    __slots__ = ("data", "start", "length", "connection", "log_time", "publish_time", "sequence")

    def __init__(self, data: Array, start: Array, length: Array, connection: Array,
                 log_time: Array, publish_time: Optional[Array] = None,
                 sequence: Optional[Array] = None) -> None:
        self.data = data
        self.start = start
        self.length = length
        self.connection = connection
        self.log_time = log_time
        self.publish_time = log_time if publish_time is None else publish_time
        self.sequence = np.zeros(len(start), np.uint32) if sequence is None else sequence

    def __len__(self) -> int:
        return len(self.start)

    def take(self, which: Union[Array, slice]) -> "MessageBatch":
        """Return the messages that ``which`` (a mask, indices or a slice) picks; the buffer is shared."""
        return MessageBatch(self.data, self.start[which], self.length[which], self.connection[which],
                     self.log_time[which], self.publish_time[which], self.sequence[which])

    def copy(self) -> "MessageBatch":
        """Return the messages in a buffer that holds nothing else."""
        return concatenate([self, self.take(slice(0, 0))])

    def replace(self, **arrays: Array) -> "MessageBatch":
        """Return the messages with other arrays, by name."""
        return MessageBatch(**{name: arrays.get(name, getattr(self, name)) for name in self.__slots__})

    def with_connections(self, mapping: Array) -> "MessageBatch":
        """Return the messages with connection ``c`` renumbered to ``mapping[c]``."""
        return self.replace(connection=mapping[self.connection].astype(np.int32))


def empty_batch() -> MessageBatch:
    """Return a batch without messages."""
    none = np.zeros(0, np.int64)
    return MessageBatch(np.zeros(0, np.uint8), none, none, none.astype(np.int32), none)


def distinct(values: Array) -> Array:
    """Return the distinct values of a non-negative integer array, ascending; faster than ``unique`` for small ones."""
    if len(values) == 0:
        return values
    if int(values.max()) <= 1 << 16:
        return np.flatnonzero(np.bincount(values))
    return np.unique(values)


def end_to_end(arrays: Sequence[Array]) -> Array:
    """Return one array of at least one; a single one itself."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def largest(rows_of_few: Array) -> Array:
    """Return the largest value of each row, shape (n, columns) to (n,), NaN where it holds one.

    Column by column, which for few columns is several times as fast as row by row.
    """
    result: Array = functools.reduce(np.maximum, rows_of_few.T)
    return result


def row_products(some: Array, others: Array) -> Array:
    """Return the scalar products of rows, shape (..., columns) to (...), of at least one column.

    Column by column; see ``largest``.
    """
    columns = zip(np.moveaxis(some, -1, 0), np.moveaxis(others, -1, 0))
    result: Array = functools.reduce(np.add, (one * other for one, other in columns))
    return result


def are_rows_equal(rows_of_bytes: Array) -> bool:
    """Return whether all rows of a contiguous array are the same bytes; for texts several times as fast as ``==``."""
    if len(rows_of_bytes) < 2:
        return True
    flat = rows_of_bytes.reshape(-1).view(np.uint8)
    size = len(flat) // len(rows_of_bytes)
    return bool((flat[size:] == flat[:-size]).all()) if size else True


def columns_at(matrices: Sequence[Array], begin: int, width: int) -> Array:
    """Return bytes ``begin`` up to ``begin + width`` (at least 1) of each row of contiguous uint8 matrices, joined."""
    opaque = np.dtype("V%d" % width)
    made = np.empty(sum(map(len, matrices)), opaque)
    done = 0
    for matrix in matrices:
        made[done:done + len(matrix)] = np.ndarray((len(matrix),), opaque, matrix, begin, (matrix.shape[1],))
        done += len(matrix)
    return made.view(np.uint8).reshape(-1, width)


def windows(data: Array, width: int) -> Array:
    """Return all windows of ``width`` bytes (at least 1) of a contiguous uint8 buffer as a view, dtype void.

    Opaque elements are gathered and scattered several times as fast as rows of bytes.
    """
    return np.ndarray((max(len(data) - width + 1, 0),), np.dtype("V%d" % width), data, strides=(1,))


def rows(batch: MessageBatch, which: Array, length: int) -> Array:
    """Return the bytes of messages that all have ``length``, uint8, shape (len(which), length)."""
    if length == 0:
        return np.zeros((len(which), 0), np.uint8)
    taken: Array = windows(batch.data, length)[batch.start[which]].view(np.uint8)
    return taken.reshape(len(which), length)


def copy_pieces(source: Array, source_start: Array, target: Array,
                target_start: Array, length: Array) -> None:
    """Copy many pieces between two uint8 buffers, together where many have the same length."""
    for size in distinct(length).tolist():
        if size == 0:
            continue
        which = np.flatnonzero(length == size)
        if size <= _GATHER_LIMIT and len(which) >= _GATHER_ROWS:
            windows(target, size)[target_start[which]] = windows(source, size)[source_start[which]]
        else:
            for a, b in zip(source_start[which].tolist(), target_start[which].tolist()):
                target[b:b + size] = source[a:a + size]


def concatenate(batches: Sequence[MessageBatch]) -> MessageBatch:
    """Join batches into one, in the order given; only bytes of messages are copied."""
    if len(batches) == 1:
        return batches[0]
    if not batches:
        return empty_batch()
    length = np.concatenate([b.length for b in batches])
    start = np.cumsum(length) - length
    data = np.empty(int(length.sum()), np.uint8)
    done = 0
    for batch in batches:
        copy_pieces(batch.data, batch.start, data, start[done:done + len(batch)], batch.length)
        done += len(batch)
    return MessageBatch(data, start, length, np.concatenate([b.connection for b in batches]),
                 np.concatenate([b.log_time for b in batches]), np.concatenate([b.publish_time for b in batches]),
                 np.concatenate([b.sequence for b in batches]))


def converted(batch: MessageBatch, which: Array, convert: Callable[[bytes], bytes]) -> MessageBatch:
    """Return the messages at some positions of a batch, each converted, in a buffer of their own."""
    taken = batch.take(which)
    made = [convert(batch.data[at:at + size].tobytes())
            for at, size in zip(taken.start.tolist(), taken.length.tolist())]
    return with_payloads(taken, made)


def with_payloads(batch: MessageBatch, payloads: List[bytes]) -> MessageBatch:
    """Return a batch with other payloads, one for each of its messages."""
    length = np.array(list(map(len, payloads)), np.int64)
    return batch.replace(data=np.frombuffer(b"".join(payloads), np.uint8), start=np.cumsum(length) - length,
                         length=length)


def pieces_of(batch: MessageBatch, max_bytes: int) -> List[MessageBatch]:
    """Split a batch, in order, into batches of at most ``max_bytes`` of messages (a larger message stays whole)."""
    total = int(batch.length.sum())
    if total <= max_bytes and len(batch) <= _MOST_IN_PIECE or len(batch) <= 1:
        return [batch]
    ends = np.cumsum(batch.length)
    result: List[MessageBatch] = []
    begin = 0
    while begin < len(batch):
        base = int(ends[begin - 1]) if begin else 0
        end = max(int(np.searchsorted(ends, base + max_bytes, side="right")), begin + 1)
        end = min(end, begin + _MOST_IN_PIECE)
        result.append(batch.take(slice(begin, end)))
        begin = end
    return result


def uncovered(start: Array, end: Array, total: int) -> Optional[List[Tuple[int, int]]]:
    """Return the stretches that no message covers; None where messages overlap or the stretches are too many."""
    begins = np.concatenate([[0], end])
    ends = np.concatenate([start, [total]])
    if (ends < begins).any():
        return None
    which = np.flatnonzero(ends != begins)
    if len(which) > _MAX_GAPS:
        return None
    return list(zip(begins[which].tolist(), ends[which].tolist()))


class RowStore:
    """A compact store of (start, length, connection, log time[, publish time, sequence]) of each message."""

    def __init__(self, has_publish: bool) -> None:
        self._width = 6 if has_publish else 4
        self._rows: List[Tuple[int, ...]] = []
        self._tables: List[Array] = []

    def append(self, row: Tuple[int, ...]) -> None:
        """Add one message."""
        self._rows.append(row)
        if len(self._rows) >= _ROWS:
            self._pack()

    def _pack(self) -> None:
        self._tables.append(np.array(self._rows, np.uint64).reshape(-1, self._width))
        self._rows = []

    def batch(self, data: Array) -> MessageBatch:
        """Return the messages, which lie in ``data``, and empty the store."""
        self._pack()
        fields = np.empty((self._width, sum(map(len, self._tables))), np.int64)
        self._tables.reverse()
        begin = 0
        while self._tables:  # each is let go as soon as it has been copied
            table = self._tables.pop()
            fields[:, begin:begin + len(table)] = table.view(np.int64).T
            begin += len(table)
        optional = (fields[4], fields[5].astype(np.uint32)) if self._width == 6 else ()
        return MessageBatch(data, *fields[:4], *optional)
