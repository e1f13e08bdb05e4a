"""Questions to a data set in SQL, by DuckDB: the table ``runs``, and a view for each topic.

Times are UTC, with microseconds: DuckDB has few functions for nanoseconds.

A question sees the runs that are in the table when it begins, and of the topics the rows of those runs alone: logs that
are added meanwhile show whole in the next one.
"""
import importlib
import re
from types import TracebackType
from typing import Any, Dict, Iterator, List, Optional, Set, Tuple, Type

from jaka_bag.errors import MissingDependency, UsageError
from jaka_bag.messages.table_names import meetings, unique_names

from .runs import RESERVED, check_version, folder_of, read_table, with_plain_times
from .store import open_store

_BATCH_ROWS = 100000
"""Rows fetched at a time: memory stays bounded."""
_RENAMED = {name + end for name in RESERVED for end in ("", "_")}
_PATH = "path of the file"
"""Name of DuckDB's column where a field is called ``filename``: one that no field has."""
_PATTERN = re.compile(r"([*?\[])")


def load_duckdb() -> Any:
    """Import the module ``duckdb``.

    Raises:
        MissingDependency: It is not installed.
    """
    try:
        return importlib.import_module("duckdb")
    except ImportError:
        raise MissingDependency("dataset query needs the Python package duckdb") from None


def view_names(topics: List[str]) -> Dict[str, str]:
    """Map the names of views to topics: ``jaka_driver_robot_states`` to ``/jaka_driver/robot_states``.

    That view is ``robot_states``, too, where no other topic ends so; where names meet, see ``unique_names``.
    """
    names = {name: topic for topic, name in unique_names(topics, _view_name).items()}
    known = {name.lower() for name in names}
    last: Dict[str, List[str]] = {}
    for topic in topics:
        last.setdefault(_view_name(topic.rsplit("/", 1)[-1]), []).append(topic)
    for name, ones in last.items():
        if len(ones) == 1 and name.lower() not in known:
            names[name] = ones[0]
    return names


def _view_name(name: str) -> str:
    plain = re.sub(r"\W", "_", name.strip("/"), flags=re.ASCII)
    return plain + "_" if plain.lower() == "runs" else plain


def _quoted(name: str) -> str:
    return '"%s"' % name.replace('"', '""')


class DataSet:
    """A data set that is open for questions; leave its block to close it.

    Args:
        location: A folder, or a URL that fsspec knows.
        threads: For DuckDB; None for all processors.

    Attributes:
        views: Name of each view, and its topic.

    Raises:
        BagError: It is no data set, or of another version.
        MissingDependency: duckdb or pyarrow is not installed.
    """

    def __init__(self, location: str, threads: Optional[int] = None) -> None:
        duckdb = load_duckdb()
        self._duckdb = duckdb
        self._store = open_store(location)
        check_version(self._store)
        with self._store.shared():
            self._runs = with_plain_times(read_table(self._store))
        self._types: Dict[str, Set[str]] = {}
        for topics in self._runs["topics"].to_pylist():
            for topic in topics:
                self._types.setdefault(topic["topic"], set()).add(topic["md5sum"])
        there = set(self._store.names(""))
        self.views = view_names([topic for topic in self._types if folder_of(topic) in there])
        self._connection = duckdb.connect(":memory:", config={} if threads is None else {"threads": threads})
        self._connection.execute("SET TimeZone = 'UTC'")
        self._store.registered(self._connection)
        self._connection.register("runs", self._runs)
        self._made: Set[str] = set()

    def notes(self, question: Optional[str] = None) -> Tuple[str, ...]:
        """Return a line for each view that has not its topic's own name, where a question (None: any) may mean it."""
        words = None if question is None else {word.lower() for word in re.findall(r"\w+", question)}
        names = unique_names(set(self.views.values()), _view_name)
        return meetings({topic: name for topic, name in names.items() if words is None or words & {
            name.lower(), _view_name(topic).lower()}}, _view_name)

    def _make_views(self, question: str) -> None:
        """Make the views that a question may mean: to look at all files of all topics would take longer than it."""
        for name in sorted(set(re.findall(r"\w+", question)) & set(self.views) - self._made):
            topic = self.views[name]
            self._connection.execute('CREATE VIEW "%s" AS %s' % (name, self._selection(topic)))
            self._made.add(name)

    def _selection(self, topic: str) -> str:
        """Return the question of a topic's view: the columns of its files, and the date that their folders have."""
        # a part of the location that looks like a pattern, or like a partition (cell=A), is neither
        place = _PATTERN.sub(r"[\1]", self._store.address(folder_of(topic))) + "/*/*.parquet"
        source = "read_parquet('%s', hive_partitioning = false, union_by_name = %%s%%s)" % (
            place.replace("'", "''").replace("%", "%%"))
        # types of ROS 2 have no MD5 sum, so nothing tells whether theirs has changed
        is_one = len(self._types[topic]) == 1 and "" not in self._types[topic]
        kinds = self._kinds(source % ("false" if is_one else "true", ""))
        if is_one and not _RENAMED.isdisjoint(kinds):  # an earlier version wrote these without the _
            is_one, kinds = False, self._kinds(source % ("true", ""))
        columns = []
        for name, kind in kinds.items():
            value, shown = self._value(_quoted(name), kind), name
            if name.lower() in RESERVED:
                shown += "_"
                if shown in kinds:
                    continue
            elif name[:-1] in kinds and name.endswith("_") and name[:-1].lower() in RESERVED:
                value = "coalesce(%s, %s)" % (value, self._value(_quoted(name[:-1]), kinds[name[:-1]]))
            columns.append("%s AS %s" % (value, _quoted(shown)))
        # another name than filename makes DuckDB before version 1.3 open the files of all dates
        path = "filename" if "filename" not in map(str.lower, kinds) else _quoted(_PATH)
        columns.append("TRY_CAST(regexp_extract(%s, '/date=([^/]*)/[^/]*$', 1) AS DATE) AS date" % path)
        return "SELECT %s FROM %s WHERE run IN (SELECT run FROM runs)" % (", ".join(columns), source % (
            "false" if is_one else "true", ", filename = %s" % ("true" if path == "filename" else "'%s'" % _PATH)))

    def _kinds(self, source: str) -> Dict[str, str]:
        """Return the types of the columns of files, by name."""
        return {row[0]: row[1] for row in self._connection.execute("DESCRIBE SELECT * FROM " + source).fetchall()}

    @staticmethod
    def _value(quoted: str, kind: str) -> str:
        """Return a column's value as a view gives it: times as TIMESTAMP in UTC, which all functions of DuckDB take."""
        if not kind.startswith("TIMESTAMP"):
            return quoted
        # in two steps: DuckDB 2 has no cast from nanoseconds with a time zone
        if kind.endswith("[]"):
            return "%s::TIMESTAMPTZ[]::TIMESTAMP[]" % quoted
        # a cast that takes the time zone off asks a calendar for each row: half the time of a question that groups rows
        return "make_timestamp(epoch_us(%s::TIMESTAMPTZ))" % quoted

    def ask(self, question: str) -> Tuple[Any, Iterator[Any]]:
        """Return the answer to a question: its ``pyarrow.Schema``, and record batches.

        Raises:
            UsageError: DuckDB does not understand the question, or cannot answer it.
        """
        try:
            self._make_views(question)
            answer = self._connection.sql(question)
            if answer is None:
                raise UsageError("this is no question: it has no answer")
            # DuckDB 2 gave it another name
            read = answer.to_arrow_reader if hasattr(answer, "to_arrow_reader") else answer.fetch_arrow_reader
            reader = read(_BATCH_ROWS)
        except self._duckdb.Error as error:
            raise UsageError(self._told(error)) from error
        return reader.schema, self._batches(reader)

    def _batches(self, reader: Any) -> Iterator[Any]:
        try:
            yield from reader
        except (self._duckdb.Error, OSError) as error:  # pyarrow wraps what DuckDB raises in the middle of an answer
            raise UsageError(self._told(error)) from error

    def _told(self, error: Exception) -> str:
        """Return DuckDB's first line, and the tables that there are where it missed one."""
        lines = str(error).strip().splitlines() or [type(error).__name__]
        if lines[0].startswith("Catalog Error: Table with name"):
            return "%s; the tables are runs, %s" % (lines[0], ", ".join(sorted(self.views)) or "and no other")
        return lines[0]

    def close(self) -> None:
        """Close the connection to the database."""
        self._connection.close()

    def __enter__(self) -> "DataSet":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        self.close()
