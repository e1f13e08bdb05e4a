"""The export of messages' fields as CSV, NPZ or Parquet; one table a topic."""
import contextlib
import csv
import functools
import io
import re
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, cast

import numpy as np

from ..containers.contract import LogReader
from ..containers.time_order import in_time_order, whole_source
from ..errors import BagError
from ..messages.batch import Array
from ..messages.columns import leaf_values
from ..messages.layout import Layout, Leaf, is_bytes
from ..messages.selection import Selection
from ..output_file import OutputFile
from ..paths import PathLike
from ..units import NS_PER_S
from .columns import ColumnReader
from .parquet import ParquetTable

FORMATS = (".csv", ".npz", ".parquet")


class Table(NamedTuple):
    """Some messages of one topic: their log times, ns, and fields of one layout."""

    log_time: Array
    layout: Layout
    rows: Array


def tables(reader: LogReader, columns: ColumnReader, topic: str) -> Iterator[Table]:
    """Yield the messages of a topic in the order of time, in runs of one layout."""
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


def _text_time(ns: int) -> str:
    sign = "-" if ns < 0 else ""
    return "%s%d.%09d" % (sign, abs(ns) // NS_PER_S, abs(ns) % NS_PER_S)


def _cells(leaf: Leaf, rows: Array, width: int) -> List[List[Any]]:
    """Return the ``width`` CSV columns of a field."""
    values = leaf_values(rows, leaf)
    if is_bytes(leaf):
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
            count = 1 if is_bytes(leaf) or not leaf.is_array else (
                len(leaf.counts) if leaf.type == "string" else sum(leaf.counts))
            widths[name] = (leaf, max(count, widths.get(name, (leaf, 0))[1]))
    return widths


def _write_csv(output: OutputFile, again: Callable[[], Iterator[Table]]) -> int:
    widths = _widths(again())
    stream = io.TextIOWrapper(io.BufferedWriter(cast(io.RawIOBase, output.file), 1 << 20), encoding="utf-8", newline="")
    writer = csv.writer(stream)
    header = ["log_time"]
    for name, (leaf, width) in widths.items():
        header += ["%s[%d]" % (name, i) for i in range(width)] if leaf.is_array and not is_bytes(leaf) else [name]
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


def _write_parquet(reader: LogReader, outputs: Dict[str, OutputFile]) -> Dict[str, int]:
    columns = ColumnReader(reader, Selection(topics=tuple(outputs)))
    with contextlib.ExitStack() as stack:
        encoder = stack.enter_context(ThreadPoolExecutor(1))
        tables_of = {topic: stack.enter_context(ParquetTable(output.file, encoder=encoder))
                     for topic, output in outputs.items()}
        for topic, some in columns.pieces():
            tables_of[topic].add(some, functools.partial(columns.leaf, topic))
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
    """Return the path for the table of a topic: the target itself for one topic, else ``STEM_topic.SUFFIX``."""
    if is_only:
        return target
    return target.with_name("%s_%s%s" % (target.stem, re.sub(r"[^\w.-]+", "_", topic.strip("/")), target.suffix))


def export(reader: LogReader, target: PathLike, selection: Optional[Selection] = None,
           overwrite: bool = False) -> Dict[str, Tuple[str, int]]:
    """Write the wanted topics; return for each the file and the number of messages.

    Args:
        reader: The log.
        target: .csv, .npz or .parquet by suffix. NPZ holds all topics; of the others each topic has its own file,
            ``STEM_topic.SUFFIX`` where there are several.
        selection: Wanted topics.
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
