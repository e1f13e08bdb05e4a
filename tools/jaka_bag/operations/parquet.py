"""Tables of messages as Parquet, a topic a file; row groups in the order of time, with statistics of every column."""
import contextlib
import importlib
from concurrent.futures import Executor, Future
from types import TracebackType
from typing import Any, Callable, Dict, Iterable, List, Mapping, Optional, Tuple, Type

import numpy as np

from ..errors import MissingDependency
from ..messages.batch import Array
from ..messages.columns import Columns
from ..messages.layout import Leaf, is_bytes
from ..messages.table_names import column_names

_ROW_GROUP_BYTES = 8 << 20
"""Bytes of messages in a row group: memory stays bounded, and a reader skips what it does not want."""


def load_pyarrow() -> Tuple[Any, Any]:
    """Import the modules ``pyarrow`` and ``pyarrow.parquet``.

    Raises:
        MissingDependency: pyarrow is not installed.
    """
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise MissingDependency("Parquet needs the Python package pyarrow") from None


def _arrow_texts(pa: Any, values: Array) -> Any:
    """Convert byte strings, shape (n,), to text; most of a log's are the same again and again."""
    if len(values) and (values == values[0]).all():
        texts, which = values[:1], np.zeros(len(values), np.int32)
    else:
        texts, which = np.unique(values, return_inverse=True)
    known = pa.array([text.decode("utf-8", "replace") for text in texts.tolist()], pa.string())
    return pa.DictionaryArray.from_arrays(pa.array(which.astype(np.int32)), known).dictionary_decode()


def _arrow_text_rows(pa: Any, values: Array) -> Any:
    """Convert rows of byte strings, shape (n, k), to text, one row after the other."""
    if len(values) and (values == values[0]).all():
        texts = pa.array([text.decode("utf-8", "replace") for text in values[0].tolist()], pa.string())
        again = np.tile(np.arange(values.shape[1], dtype=np.int32), len(values))
        return pa.DictionaryArray.from_arrays(pa.array(again), texts).dictionary_decode()
    return _arrow_texts(pa, values.reshape(-1))


def _arrow_column(pa: Any, leaf: Leaf, values: Array) -> Any:
    if is_bytes(leaf):
        return pa.array([row.tobytes() for row in values], pa.binary())
    lengths = None
    if values.dtype == object and leaf.type == "string" and not leaf.is_array:
        return pa.array([text.decode("utf-8", "replace") for text in values], pa.string())
    if values.dtype == object:
        lengths = np.array([len(row) for row in values], np.int64)
        values = np.concatenate(list(values))
    if leaf.type == "string":
        column = _arrow_text_rows(pa, values) if values.ndim > 1 else _arrow_texts(pa, values)
    else:
        kind = {"time": pa.timestamp("ns", "UTC"), "duration": pa.duration("ns")}.get(leaf.type)
        column = pa.array(values.reshape(-1), kind)
    if not leaf.is_array:
        return column
    if lengths is None:
        lengths = np.full(len(values), values.shape[1], np.int64)
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    return pa.ListArray.from_arrays(pa.array(offsets), column)


class ParquetTable:
    """The table of one topic: its row groups are written as they fill. Leave its block to finish the file.

    Args:
        file: Open for writing; it stays open.
        constants: Columns of text that have one value in all rows; they come first. A field of a message that has
            such a name, or ``log_time``, gets a ``_`` appended.
        metadata: Facts about the file, in its footer.
        compression: A codec of Parquet.
        encoder: Executor that compresses and writes, while the next messages are added; it must outlive the block.
            None: the calling thread.
        reserved: Further names of which a field gets a ``_`` appended.

    Attributes:
        count: Messages so far.

    Raises:
        MissingDependency: pyarrow is not installed.
    """

    def __init__(self, file: Any, constants: Optional[Mapping[str, str]] = None,
                 metadata: Optional[Mapping[str, str]] = None, compression: str = "snappy",
                 encoder: Optional[Executor] = None, reserved: Iterable[str] = ()) -> None:
        self._pa, self._parquet = load_pyarrow()
        self._file = file
        self._constants = dict(constants or {})
        self._metadata = dict(metadata or {})
        self._compression = compression
        self._encoder = encoder
        self._reserved = tuple(reserved)
        self._writing: Optional[Future[None]] = None
        self._stack = contextlib.ExitStack()
        self._writer: Any = None
        self._waiting: List[Any] = []
        self._waiting_bytes = 0
        self.count = 0

    def add(self, columns: Columns, leaf: Callable[[str], Leaf]) -> None:
        """Add further messages; ``leaf`` returns the description of a field."""
        pa = self._pa
        made: Dict[str, Any] = {name: pa.repeat(pa.scalar(value, pa.string()), len(columns.log_time))
                                for name, value in self._constants.items()}
        made["log_time"] = pa.array(columns.log_time, pa.timestamp("ns", "UTC"))
        names = column_names(columns.fields, [*made, *self._reserved])
        for name, values in columns.fields.items():
            made[names[name]] = _arrow_column(pa, leaf(name), values)
        table = pa.table(made)
        self.count += len(columns.log_time)
        self._waiting.append(table)
        self._waiting_bytes += table.nbytes
        if self._waiting_bytes >= _ROW_GROUP_BYTES:
            self._pass_on()

    def _pass_on(self) -> None:
        """Have what waits written as one row group, when the one before is written."""
        self._wait()
        some, self._waiting, self._waiting_bytes = self._waiting, [], 0
        if some and self._encoder is not None:
            self._writing = self._encoder.submit(self._write, some)
        elif some:
            self._write(some)

    def _wait(self) -> None:
        writing, self._writing = self._writing, None
        if writing is not None:
            writing.result()

    def _write(self, some: List[Any]) -> None:
        pa, table = self._pa, self._pa.concat_tables(some)
        if self._writer is None:
            sink = self._stack.enter_context(pa.PythonFile(self._file, mode="w"))
            # numbers that are measured rarely repeat: a dictionary of them would be made in vain
            repeated = [field.name for field in table.schema if not pa.types.is_list(field.type) and (
                pa.types.is_string(field.type) or pa.types.is_integer(field.type) and field.type.bit_width < 32)]
            texts = [field.name for field in table.schema if pa.types.is_list(field.type)
                     and pa.types.is_string(field.type.value_type)]
            self._writer = self._stack.enter_context(self._parquet.ParquetWriter(
                sink, table.schema.with_metadata(self._metadata or None), compression=self._compression,
                use_dictionary=repeated + [name + ".list.element" for name in texts] or False))
        self._writer.write_table(table, row_group_size=max(len(table), 1))

    def __enter__(self) -> "ParquetTable":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        try:
            if kind is None:
                self._pass_on()
            self._wait()
        finally:
            self._stack.close()
