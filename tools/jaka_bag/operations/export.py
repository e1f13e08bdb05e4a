"""Writes the fields of messages as CSV, NPZ or Parquet; one table a topic."""
import contextlib
import csv
import functools
import importlib
import io
import re
import zipfile
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, cast

import numpy as np

from ..containers.contract import LogReader
from ..containers.time_order import in_time_order, whole_source
from ..errors import BagError, MissingDependency
from ..messages.batch import Array
from ..messages.columns import Columns, leaf_values
from ..messages.layout import Layout, Leaf
from ..messages.selection import Selection
from ..output_file import OutputFile
from ..paths import PathLike
from ..units import NS_PER_S
from .columns import ColumnReader

FORMATS = (".csv", ".npz", ".parquet")
_ROW_GROUP_BYTES = 8 << 20
_BYTE_TYPES = ("uint8", "char", "byte", "int8")


class Table(NamedTuple):
    """Some messages of one topic: their log times, ns, and fields of one layout."""

    log_time: Array
    layout: Layout
    rows: Array


def tables(reader: LogReader, columns: ColumnReader, topic: str) -> Iterator[Table]:
    """The messages of a topic in the order of time, in runs of one layout."""
    for batch in in_time_order([whole_source(reader, Selection(topics=(topic,)))]):
        groups = [group for _, group in columns.groups(batch)]
        if len(groups) == 1:
            yield Table(batch.log_time[groups[0].which], groups[0].layout, groups[0].rows)
            continue
        owner = np.zeros(len(batch), np.int64)
        place = np.zeros(len(batch), np.int64)
        for i, group in enumerate(groups):
            owner[group.which] = i
            place[group.which] = np.arange(len(group.which))
        for run in np.split(np.arange(len(batch)), np.flatnonzero(np.diff(owner)) + 1):
            group = groups[owner[run[0]]]
            yield Table(batch.log_time[run], group.layout, group.rows[place[run]])


def _is_bytes(leaf: Leaf) -> bool:
    return leaf.is_array and leaf.type in _BYTE_TYPES


def _text_time(ns: int) -> str:
    sign = "-" if ns < 0 else ""
    return "%s%d.%09d" % (sign, abs(ns) // NS_PER_S, abs(ns) % NS_PER_S)


def _cells(leaf: Leaf, rows: Array, width: int) -> List[List[Any]]:
    """The CSV columns of a field, ``width`` of them."""
    values = leaf_values(rows, leaf)
    if _is_bytes(leaf):
        return [[row.tobytes().hex() for row in values]]
    columns = [values] if values.ndim == 1 else [values[:, i] for i in range(values.shape[1])]
    cells: List[List[Any]] = []
    for column in columns:
        if leaf.type == "string":
            cells.append([v.decode("utf-8", "replace") for v in column.tolist()])
        elif leaf.type in ("time", "duration"):
            cells.append([_text_time(v) for v in column.tolist()])
        elif leaf.type == "float32":
            cells.append([str(v) for v in column])  # the shortest text that gives the same float32
        else:
            cells.append(column.tolist())
    return cells + [[""] * len(rows)] * (width - len(cells))


def _widths(source: Iterator[Table]) -> Dict[str, Tuple[Leaf, int]]:
    widths: Dict[str, Tuple[Leaf, int]] = {}
    for table in source:
        for name, leaf in table.layout.leaves.items():
            count = 1 if _is_bytes(leaf) or not leaf.is_array else (
                len(leaf.counts) if leaf.type == "string" else sum(leaf.counts))
            widths[name] = (leaf, max(count, widths.get(name, (leaf, 0))[1]))
    return widths


def _write_csv(output: OutputFile, again: Callable[[], Iterator[Table]]) -> int:
    widths = _widths(again())
    stream = io.TextIOWrapper(io.BufferedWriter(cast(io.RawIOBase, output.file), 1 << 20), encoding="utf-8", newline="")
    writer = csv.writer(stream)
    header = ["log_time"]
    for name, (leaf, width) in widths.items():
        header += ["%s[%d]" % (name, i) for i in range(width)] if leaf.is_array and not _is_bytes(leaf) else [name]
    writer.writerow(header)
    count = 0
    for table in again():
        cells: List[List[Any]] = [[_text_time(t) for t in table.log_time.tolist()]]
        for name, (_, width) in widths.items():
            cells += _cells(table.layout.leaves[name], table.rows, width)
        writer.writerows(zip(*cells))
        count += len(table.log_time)
    stream.flush()
    stream.detach().detach()
    return count


def _arrow_texts(pa: Any, values: Array) -> Any:
    """Text from byte strings, shape (n,); most of a log's are the same again and again."""
    if len(values) and (values == values[0]).all():
        texts, which = values[:1], np.zeros(len(values), np.int32)
    else:
        texts, which = np.unique(values, return_inverse=True)
    known = pa.array([text.decode("utf-8", "replace") for text in texts.tolist()], pa.string())
    return pa.DictionaryArray.from_arrays(pa.array(which.astype(np.int32)), known).dictionary_decode()


def _arrow_text_rows(pa: Any, values: Array) -> Any:
    """As ``_arrow_texts``, of rows of texts, shape (n, k), one behind the other."""
    if len(values) and (values == values[0]).all():
        texts = pa.array([text.decode("utf-8", "replace") for text in values[0].tolist()], pa.string())
        again = np.tile(np.arange(values.shape[1], dtype=np.int32), len(values))
        return pa.DictionaryArray.from_arrays(pa.array(again), texts).dictionary_decode()
    return _arrow_texts(pa, values.reshape(-1))


def _arrow_column(pa: Any, leaf: Leaf, values: Array) -> Any:
    if _is_bytes(leaf):
        return pa.array([row.tobytes() for row in values], pa.binary())
    lengths = None
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


class _ParquetTable:
    """The table of one topic: its row groups are written as they fill, by the thread of ``encoder``."""

    def __init__(self, pa: Any, parquet: Any, output: OutputFile, stack: contextlib.ExitStack,
                 encoder: ThreadPoolExecutor) -> None:
        self._encoder = encoder
        self._writing: Optional[Future[None]] = None
        self._pa, self._parquet, self._output, self._stack = pa, parquet, output, stack
        self._writer: Any = None
        self._waiting: List[Any] = []
        self._waiting_bytes = 0
        self.count = 0

    def add(self, columns: Columns, leaf: Callable[[str], Leaf]) -> None:
        """Further messages."""
        pa = self._pa
        made = {"log_time": pa.array(columns.log_time, pa.timestamp("ns", "UTC"))}
        for name, values in columns.fields.items():
            made[name] = _arrow_column(pa, leaf(name), values)
        table = pa.table(made)
        self.count += len(columns.log_time)
        self._waiting.append(table)
        self._waiting_bytes += table.nbytes
        if self._waiting_bytes >= _ROW_GROUP_BYTES:
            self._pass_on()

    def end(self) -> None:
        """Write what is left."""
        self._pass_on()
        self._wait()

    def _pass_on(self) -> None:
        """Begin to write what waits as one row group, when the one before is written."""
        self._wait()
        if self._waiting:
            self._writing = self._encoder.submit(self._write, self._waiting)
            self._waiting, self._waiting_bytes = [], 0

    def _wait(self) -> None:
        writing, self._writing = self._writing, None
        if writing is not None:
            writing.result()

    def _write(self, some: List[Any]) -> None:
        pa, table = self._pa, self._pa.concat_tables(some)
        if self._writer is None:
            sink = self._stack.enter_context(pa.PythonFile(self._output.file, mode="w"))
            # numbers that are measured rarely repeat: a dictionary of them would be made in vain
            repeated = [field.name for field in table.schema if not pa.types.is_list(field.type) and (
                pa.types.is_string(field.type) or pa.types.is_integer(field.type) and field.type.bit_width < 32)]
            texts = [field.name for field in table.schema if pa.types.is_list(field.type)
                     and pa.types.is_string(field.type.value_type)]
            self._writer = self._stack.enter_context(self._parquet.ParquetWriter(
                sink, table.schema, use_dictionary=repeated + [name + ".list.element" for name in texts] or False))
        self._writer.write_table(table, row_group_size=max(len(table), 1))


def _write_parquet(reader: LogReader, outputs: Dict[str, OutputFile]) -> Dict[str, int]:
    try:
        pa = importlib.import_module("pyarrow")
        parquet = importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise MissingDependency("Parquet needs the Python package pyarrow") from None
    columns = ColumnReader(reader, Selection(topics=tuple(outputs)))
    with contextlib.ExitStack() as stack, ThreadPoolExecutor(1) as encoder:  # which ends before the files are closed
        tables_of = {topic: _ParquetTable(pa, parquet, output, stack, encoder) for topic, output in outputs.items()}
        for topic, some in columns.pieces():
            tables_of[topic].add(some, functools.partial(columns.leaf, topic))
        for table in tables_of.values():
            table.end()
    return {topic: table.count for topic, table in tables_of.items()}


def _add_array(archive: zipfile.ZipFile, name: str, values: Array) -> None:
    with archive.open(name + ".npy", "w", force_zip64=True) as member:
        np.save(member, np.ascontiguousarray(values), allow_pickle=False)


def _write_npz(output: OutputFile, reader: LogReader, topics: Sequence[str]) -> Dict[str, int]:
    counts = {}
    with zipfile.ZipFile(output.file, "w", zipfile.ZIP_DEFLATED) as archive:
        for topic in topics:
            columns = ColumnReader(reader, Selection(topics=(topic,))).read().get(topic)
            counts[topic] = 0 if columns is None else len(columns.log_time)
            if columns is None:
                continue
            base = topic.strip("/")
            _add_array(archive, base + "/log_time", columns.log_time)
            for name, values in columns.fields.items():
                if values.dtype == object:
                    _add_array(archive, "%s/%s.lengths" % (base, name), np.array([len(v) for v in values], np.int64))
                    values = np.concatenate(list(values))
                _add_array(archive, "%s/%s" % (base, name), values)
    return counts


def table_path(target: Path, topic: str, is_only: bool) -> Path:
    """Where the table of a topic goes: the target itself for one topic, else ``STEM_topic.SUFFIX``."""
    if is_only:
        return target
    return target.with_name("%s_%s%s" % (target.stem, re.sub(r"[^\w.-]+", "_", topic.strip("/")), target.suffix))


def export(reader: LogReader, target: PathLike, selection: Optional[Selection] = None,
           overwrite: bool = False) -> Dict[str, Tuple[str, int]]:
    """Write the wanted topics; give for each the file and the number of messages.

    Args:
        reader: The log.
        target: .csv, .npz or .parquet by suffix. NPZ holds all topics; of the others each topic has its own file,
            ``STEM_topic.SUFFIX`` where there are several.
        selection: Which topics.
        overwrite: Replace existing files.

    Raises:
        BagError: The suffix is none of these, no topic is wanted, or a file cannot be created.
        BagFormatError: A chunk is damaged.
        DefinitionError: A definition is not understood or does not describe a message.
        MissingDependency: Parquet is wanted and pyarrow is not installed.
    """
    path = Path(target)
    if path.suffix not in FORMATS:
        raise BagError("%s: the name of an export ends in one of %s" % (path, ", ".join(FORMATS)))
    columns = ColumnReader(reader, selection)
    topics = sorted(columns.connections)
    if not topics:
        raise BagError("%s has none of the topics" % reader.path)
    result: Dict[str, Tuple[str, int]] = {}
    with contextlib.ExitStack() as outputs:
        if path.suffix == ".npz":
            counts = _write_npz(outputs.enter_context(OutputFile(path, overwrite)), reader, topics)
            result = {topic: (str(path), counts[topic]) for topic in topics}
        else:
            files = {topic: table_path(path, topic, len(topics) == 1) for topic in topics}
            opened = {topic: outputs.enter_context(OutputFile(file, overwrite)) for topic, file in files.items()}
            if path.suffix == ".parquet":
                counts = _write_parquet(reader, opened)
            else:
                counts = {topic: _write_csv(output, functools.partial(
                    tables, reader, ColumnReader(reader, Selection(topics=(topic,))), topic))
                    for topic, output in opened.items()}
            result = {topic: (str(files[topic]), counts[topic]) for topic in topics}
    return result
