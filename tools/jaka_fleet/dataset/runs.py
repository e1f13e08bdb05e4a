"""The table ``runs`` of a data set: one row a log.

A row is a file of its own, ``runs/HASH.parquet``, until ``compact`` puts all rows into ``runs/compacted.parquet``. For
a moment a row may be in both: whoever reads the files takes one row of each hash.
"""
import json
from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple
from urllib.parse import quote

from jaka_bag.errors import BagError
from jaka_bag.operations.parquet import load_pyarrow

from .store import Store

SCHEMA_VERSION = 1
"""Version of the tables; a data set of another one is not touched."""
FOLDER = "runs"
COMPACTED = "compacted.parquet"
RESERVED = ("date", "topic")
"""Names that the folders of tables give: a column of a table has a ``_`` more."""
COMPACT_ABOVE = 64
"""Number of rows in files of their own that are left alone."""
WHOLE, RECOVERED, UNREADABLE = "whole", "recovered", "unreadable"
LEFT_OUT = " is left out: "
"""Words in the reason of a row for each topic that is not in the data set."""
COMPRESSION = "zstd"
_VERSION_FILE = "_jaka_bag.json"
_VERSION_KEY = "jaka_bag.schema_version"
_ROW_GROUP_ROWS = 10000
"""Rows of a row group: a query reads those of the runs that it wants."""
_LONGEST_NAME = 240
"""Most characters of a folder's name, of 255 that a file system takes."""
_SUFFIX = ".parquet"


class TopicCount(NamedTuple):
    """One topic of a log.

    Attributes:
        topic: Name of the topic.
        type: Type of its messages.
        md5sum: MD5 sum of the type's definition.
        messages: Number of messages.
        lost: Messages known to be missing: by ``header.seq``, by what the recorder counted; None if unknown.
    """

    topic: str
    type: str
    md5sum: str
    messages: int
    lost: Optional[int]


class TriggerEvent(NamedTuple):
    """The reason why a black box kept the log: time, ns since the epoch; kind and detail."""

    at: int
    kind: str
    detail: str


class RunRow(NamedTuple):
    """The table's row of a log.

    Attributes:
        hash: SHA-256 of the file, hexadecimal; no two rows have the same.
        run: Start and beginning of the hash; with the cell it names the log's files.
        cell: Cell in which it was recorded.
        status: ``WHOLE``, ``RECOVERED`` (what could be read of it is in) or ``UNREADABLE`` (nothing is).
        reason: Why it is not whole; which topics were left out.
        arm_model: Model of the arm, as ``zu7``; empty where the log does not name it, as the two that follow.
        controller_firmware: Version that the controller reports.
        driver_version: Version of the driver.
        start: First log time, ns since the epoch; None where there are no messages.
        duration: Time from the first to the last log time, s.
        messages: Number of messages in all topics.
        lost: Messages known to be missing, in all topics.
        topics: Topics by name.
        triggers: Triggers by time.
        path: The log, as it was named when it was added.
        size: Size of the log, bytes.
    """

    hash: str
    run: str
    cell: str
    status: str
    reason: str = ""
    arm_model: str = ""
    controller_firmware: str = ""
    driver_version: str = ""
    start: Optional[int] = None
    duration: float = 0.0
    messages: int = 0
    lost: int = 0
    topics: Tuple[TopicCount, ...] = ()
    triggers: Tuple[TriggerEvent, ...] = ()
    path: str = ""
    size: int = 0


def _schema(pa: Any, time: Any = None) -> Any:
    """Return the columns; ``time`` is another type for the times."""
    text, whole, time = pa.string(), pa.int64(), time or pa.timestamp("ns", "UTC")
    topic = pa.struct([("topic", text), ("type", text), ("md5sum", text), ("messages", whole), ("lost", whole)])
    trigger = pa.struct([("at", time), ("kind", text), ("detail", text)])
    kinds = {"start": time, "duration": pa.float64(), "messages": whole, "lost": whole, "topics": pa.list_(topic),
             "triggers": pa.list_(trigger), "size": whole}
    return pa.schema([(name, kinds.get(name, text)) for name in RunRow._fields],
                     metadata={_VERSION_KEY: str(SCHEMA_VERSION)})


def metadata_of(topic: str, datatype: str, md5sum: str, digest: str) -> Dict[str, str]:
    """Return the metadata in the footer of a topic's file."""
    return {_VERSION_KEY: str(SCHEMA_VERSION), "jaka_bag.topic": topic, "jaka_bag.type": datatype,
            "jaka_bag.md5sum": md5sum, "jaka_bag.hash": digest}


def folder_of(topic: str) -> str:
    """Name of the folder of a topic's tables: with ``.`` for each ``/`` but the first; that of ``x`` is ``.x``.

    What stands in no name of ROS is written as in a URL: such a name leads into no other folder.
    """
    name = topic.strip("/").replace("/", ".")
    return "topic=" + quote(name if topic.startswith("/") else "." + name, safe="")[:_LONGEST_NAME]


def name_of(digest: str) -> str:
    """Name of the file of a row."""
    return "%s/%s%s" % (FOLDER, digest, _SUFFIX)


def write_row(row: RunRow, path: Path) -> None:
    """Write the file of one row."""
    pa, parquet = load_pyarrow()
    values = row._asdict()
    values["topics"] = [topic._asdict() for topic in row.topics]
    values["triggers"] = [trigger._asdict() for trigger in row.triggers]
    parquet.write_table(pa.Table.from_pylist([values], schema=_schema(pa)), str(path), compression=COMPRESSION)


def check_version(store: Store, is_to_be_made: bool = False) -> None:
    """Refuse a data set of another schema version.

    Args:
        store: The data set.
        is_to_be_made: True if it may be made here.

    Raises:
        BagError: It is of another version, or there is none.
    """
    if not store.exists(_VERSION_FILE):
        if not is_to_be_made:
            raise BagError("%s is no data set of jaka_bag" % store.location)
        # whoever makes it at the same time may have done so since the first look
        if any(not name.startswith(".") for name in store.names("")) and not store.exists(_VERSION_FILE):
            raise BagError("%s is no data set of jaka_bag, and not empty" % store.location)
        with store.staging() as staging:
            path = staging.folder / _VERSION_FILE
            path.write_text(json.dumps({"schema_version": SCHEMA_VERSION}) + "\n", encoding="utf-8")
            staging.publish([(path, _VERSION_FILE)])
        return
    with store.open(_VERSION_FILE) as file:
        try:
            found = json.loads(file.read().decode())["schema_version"]
        except (ValueError, KeyError, TypeError):
            raise BagError("%s: %s is damaged" % (store.location, _VERSION_FILE)) from None
    if found != SCHEMA_VERSION:
        raise BagError("%s has tables of version %s; this jaka_bag reads and writes version %d"
                       % (store.location, found, SCHEMA_VERSION))


def is_dataset(store: Store) -> bool:
    """Return whether a data set is there, of whatever version."""
    return store.exists(_VERSION_FILE)


def _read(store: Store, name: str, **options: Any) -> Any:
    """Read the table of a file, as ``pyarrow.parquet.read_table`` reads it with these options.

    The file is copied to memory of pyarrow's own: its threads may release a Python object while the process ends, and
    the process is aborted then (apache/arrow 34314).
    """
    pa, parquet = load_pyarrow()
    with store.open("%s/%s" % (FOLDER, name)) as file:
        content = file.read()
    memory = pa.allocate_buffer(len(content))
    memoryview(memory).cast("B")[:] = content
    return parquet.read_table(pa.BufferReader(memory), **options)


def _tables(store: Store, columns: Optional[Sequence[str]] = None) -> Iterator[Any]:
    """Iterate over the rows in files of their own, then the compacted ones; a row may come twice."""
    # One that is compacted meanwhile is in the compacted file, which is read last.
    for name in [name for name in store.names(FOLDER) if name != COMPACTED] + [COMPACTED]:
        try:
            yield _read(store, name, columns=columns)
        except FileNotFoundError:
            continue


def find_status(store: Store, digest: str) -> Optional[str]:
    """Return the status of a log in the table; None if it is not there."""
    # One that is compacted meanwhile is in the compacted file, which is read last.
    for name in (digest + _SUFFIX, COMPACTED):
        try:
            found = _read(store, name, columns=["status"], filters=[("hash", "=", digest)])
        except FileNotFoundError:
            continue
        if len(found):
            return str(found["status"][0])
    return None


def is_in(store: Store, name: str) -> bool:
    """Return whether the row whose file is or was called ``name`` is in the table."""
    folder, _, rest = name.partition("/")
    return store.exists(name) if folder != FOLDER else find_status(store, rest.split(".")[0]) is not None


def read_table(store: Store, columns: Optional[Sequence[str]] = None) -> Any:
    """Read the table as a ``pyarrow.Table``, one row a hash, sorted by hash, with ``columns`` besides it, or all."""
    pa, _ = load_pyarrow()
    schema = _schema(pa)
    wanted = None if columns is None else ["hash", *[name for name in columns if name != "hash"]]
    found = [table.cast(pa.schema([schema.field(name) for name in table.column_names])) for table in
             _tables(store, wanted)]
    if not found:
        empty = schema.empty_table()
        return empty if wanted is None else empty.select(wanted)
    whole = pa.concat_tables(found)
    if len(found) == 1:
        return whole
    order: Dict[str, int] = {}
    for place, digest in enumerate(whole["hash"].to_pylist()):
        order.setdefault(digest, place)
    return whole.take(pa.array([order[digest] for digest in sorted(order)], pa.int64()))


def with_plain_times(table: Any) -> Any:
    """Return the table with times of microseconds, UTC, without a time zone."""
    pa, _ = load_pyarrow()
    return table.cast(_schema(pa, pa.timestamp("us")), safe=False)


def read_runs(store: Store) -> List[RunRow]:
    """Read the rows, by start and hash; logs without messages come first."""
    rows = []
    pa, _ = load_pyarrow()
    for values in read_table(store).cast(_schema(pa, pa.int64())).to_pylist():
        values["topics"] = tuple(TopicCount(**topic) for topic in values["topics"])
        values["triggers"] = tuple(TriggerEvent(**trigger) for trigger in values["triggers"])
        rows.append(RunRow(**values))
    return sorted(rows, key=lambda row: (row.start or 0, row.hash))


def loose_count(store: Store) -> int:
    """Count the rows in files of their own."""
    return sum(1 for name in store.names(FOLDER) if name != COMPACTED)


def compact(store: Store) -> int:
    """Put all rows into one file; return their number.

    Others may add logs and ask meanwhile. In an object store nobody else may compact at the same time.
    """
    _, parquet = load_pyarrow()
    with store.staging() as staging:
        with store.alone():
            names = [name for name in store.names(FOLDER) if name != COMPACTED]
            table = read_table(store)
            path = staging.folder / COMPACTED
            parquet.write_table(table.replace_schema_metadata({_VERSION_KEY: str(SCHEMA_VERSION)}), str(path),
                                compression=COMPRESSION, row_group_size=_ROW_GROUP_ROWS)
            staging.place(path, "%s/%s" % (FOLDER, COMPACTED))
            for name in names:
                store.remove("%s/%s" % (FOLDER, name))
    return len(table)
