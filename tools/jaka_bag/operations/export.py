"""The export of messages' fields as CSV, NPZ or Parquet; one table a topic."""
import contextlib
import csv
import functools
import io
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, cast

import numpy as np

from ..containers.interface import LogReader
from ..containers.time_order import in_time_order, whole_source
from ..errors import BagError, DefinitionError
from ..messages.batch import Array
from ..messages.columns import is_ragged, leaf_values
from ..messages.layout import Layout, Leaf, is_bytes
from ..messages.selection import MessageFilter, Selection
from ..messages.table_names import column_names, meetings, unique_names
from ..output_file import OutputFile, check_output
from ..paths import PathLike
from ..units import NS_PER_S
from .columns import ColumnReader
from .convert import refuse_same_file
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
    values = leaf_values([rows], leaf)
    if is_bytes(leaf):
        return [[row.tobytes().hex() for row in values]]
    if leaf.is_array and values.dtype == object:
        columns = [np.array([row[i] for row in values], object) for i in range(len(leaf.counts))]
    else:
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
    names = column_names(widths)
    for field, (leaf, width) in widths.items():
        name = names[field]
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


def _add_topic(archive: zipfile.ZipFile, reader: LogReader, topic: str, base: str) -> int:
    """Add the arrays of one topic to an NPZ; return its number of messages."""
    columns = ColumnReader(reader, Selection(topics=(topic,))).read().get(topic)
    if columns is None:
        return 0
    _add_array(archive, base + "/log_time", columns.log_time)
    names = column_names(columns.fields)
    for field, values in columns.fields.items():
        name = names[field]
        if values.dtype == object:
            _add_array(archive, "%s/%s.lengths" % (base, name), np.array([len(v) for v in values], np.int64))
            if is_ragged(values):
                values = np.concatenate(list(values))
                if values.dtype == object:  # texts, one of which ends with a zero
                    _add_array(archive, "%s/%s.sizes" % (base, name), np.array([len(v) for v in values], np.int64))
        if values.dtype == object:
            values = np.frombuffer(b"".join(values), np.uint8)
        _add_array(archive, "%s/%s" % (base, name), values)
    return len(columns.log_time)


def _archive_name(topic: str) -> str:
    """Return a topic's folder in an NPZ."""
    return topic.strip("/").encode("utf-8", "backslashreplace").decode()


class Exported(NamedTuple):
    """The result of an export.

    Attributes:
        tables: File and number of messages, by topic.
        notes: A line for each topic that has not its own name.
        failed: The reason why there is no table, by topic.
    """

    tables: Dict[str, Tuple[str, int]]
    notes: Tuple[str, ...]
    failed: Dict[str, str]


def _one_by_one(topics: Sequence[str], work: Callable[[str], Tuple[str, int]], notes: Tuple[str, ...]) -> Exported:
    """Export topics one after the other; those whose messages are not understood are left out."""
    result = Exported({}, notes, {})
    for topic in topics:
        try:
            result.tables[topic] = work(topic)
        except DefinitionError as error:
            result.failed[topic] = str(error)
    return result


def export(reader: LogReader, target: PathLike, selection: Optional[Selection] = None,
           overwrite: bool = False) -> Exported:
    """Write the wanted topics; a topic whose messages are not understood costs no other.

    Args:
        reader: The log.
        target: .csv, .npz or .parquet by suffix. NPZ holds all topics; of the others each topic has its own file,
            ``STEM_topic.SUFFIX`` where there are several. A field that is called ``log_time`` gets a ``_`` appended.
        selection: Wanted topics.
        overwrite: Replace existing files.

    Raises:
        BagError: The suffix is none of these, no topic is wanted, or a file cannot be created.
        BagFormatError: A chunk is damaged.
        DefinitionError: No wanted topic's messages are understood.
        MissingDependency: Parquet is wanted and pyarrow is not installed.
    """
    path = Path(target)
    if path.suffix not in FORMATS:
        raise BagError("%s: the name of an export ends in one of %s" % (path, ", ".join(FORMATS)))
    wanted = MessageFilter(selection or Selection(), reader.connections).wanted
    topics = sorted({c.topic for c, is_wanted in zip(reader.connections, wanted) if is_wanted})
    if not topics:
        raise BagError("%s has none of the topics" % reader.path)
    with contextlib.ExitStack() as outputs:
        if path.suffix == ".npz":
            refuse_same_file(reader.path, path)
            names = unique_names(topics, _archive_name)
            archive = outputs.enter_context(zipfile.ZipFile(
                outputs.enter_context(OutputFile(path, overwrite)).file, "w", zipfile.ZIP_DEFLATED))
            result = _one_by_one(topics, lambda topic: (str(path), _add_topic(archive, reader, topic, names[topic])),
                                 meetings(names, _archive_name))
        else:
            result = _export_files(reader, path, topics, overwrite)
        if not result.tables:
            raise DefinitionError("; ".join(result.failed.values()))
    return result


def _export_files(reader: LogReader, path: Path, topics: Sequence[str], overwrite: bool) -> Exported:
    """Write a file for each topic."""
    names = unique_names(topics)
    files = {topic: path.with_name("%s_%s%s" % (path.stem, name, path.suffix)) for topic, name in names.items()}
    notes = meetings(names)
    if len(topics) == 1:
        files, notes = {topics[0]: path}, ()
    for file in files.values():
        check_output(file, overwrite)
        refuse_same_file(reader.path, file)

    def write(topic: str) -> Tuple[str, int]:
        with OutputFile(files[topic], overwrite) as output:
            if path.suffix == ".parquet":
                return str(files[topic]), _write_parquet(reader, {topic: output})[topic]
            columns = ColumnReader(reader, Selection(topics=(topic,)))
            return str(files[topic]), _write_csv(output, functools.partial(tables, reader, columns, topic))

    if path.suffix == ".parquet":
        with contextlib.suppress(DefinitionError), contextlib.ExitStack() as opened:  # all in one reading
            counts = _write_parquet(reader, {topic: opened.enter_context(OutputFile(file, overwrite))
                                             for topic, file in files.items()})
            return Exported({topic: (str(file), counts[topic]) for topic, file in files.items()}, notes, {})
    return _one_by_one(topics, write, notes)
