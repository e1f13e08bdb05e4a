"""The sqlite3 storage of rosbag2: its topics, and where its messages are; read without numpy."""
import contextlib
import os
import re
import sqlite3
from pathlib import Path
from typing import Any, Dict, List, Optional, Tuple

from ..errors import BagFormatError
from ..messages.connection import Connection
from ..paths import PathLike
from .index import ZSTD, ChunkRef, CodecTotals, LogIndex, codec_totals, leftovers
from .packed_messages import HEAD, unpacked_size

_ROW = 24
"""Bytes that a message takes besides its payload, about."""
_CHUNK_BYTES, _CHUNK_MESSAGES = 1 << 20, 4096

_TABLES = ("topics", "messages", "message_definitions", "schema")
"""Tables that are read; a storage has at least the first two."""
_GENERATED = (2, 3)
"""Kinds of columns in ``PRAGMA table_xinfo`` whose values an expression makes when they are read."""


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "surrogateescape")


def _no_views(action: int, first: Any, second: Any, database: Any, view: Optional[str]) -> int:
    """Refuse what a view or a trigger asks for: what it makes may be without an end."""
    return sqlite3.SQLITE_OK if view is None else sqlite3.SQLITE_DENY


def open_database(path: PathLike, options: str = "mode=ro&immutable=1") -> sqlite3.Connection:
    """Open a database, which is not changed and of which views are not read; threads may use it one at a time.

    Raises:
        sqlite3.Error: It cannot be opened.
    """
    database = sqlite3.connect("%s?%s" % (Path(os.path.abspath(str(path))).as_uri(), options), uri=True,
                               check_same_thread=False)
    try:
        database.execute("PRAGMA writable_schema=ON")  # else one that is cut off is refused as a whole
    except BaseException:
        database.close()
        raise
    database.text_factory = _text
    database.set_authorizer(_no_views)
    return database


def check_tables(database: sqlite3.Connection) -> None:
    """Check that the tables of a storage hold what is in the file, and nothing that is made when it is read.

    Raises:
        BagFormatError: They do not, or are not there.
        sqlite3.Error: The database is damaged.
    """
    found = database.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'").fetchall()
    tables = {str(name).lower() for name, text in found if re.match(r"\s*CREATE\s+TABLE\b", str(text), re.I)}
    if not {"topics", "messages"} <= tables:
        raise BagFormatError("it is a database, but no storage of rosbag2")
    for name in _TABLES:
        if any(column[6] in _GENERATED for column in database.execute("PRAGMA table_xinfo(%s)" % name)):
            raise BagFormatError("it is no storage of rosbag2: its table %s has generated columns" % name)


def read_topics(database: sqlite3.Connection) -> Tuple[Dict[int, Connection], int]:
    """Return the connections by the file's id, and how many rows of topics are damaged.

    Raises:
        sqlite3.Error: They cannot be read.
    """
    from ..messages.ros2_types import ros2_definition

    columns = {row[1] for row in database.execute("PRAGMA table_info(topics)")}
    definitions: Dict[str, Tuple[str, str]] = {}
    with contextlib.suppress(sqlite3.Error):  # older databases have none
        for kind, encoding, text in database.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"):
            if isinstance(text, str):
                definitions[kind] = ("ros2idl" if encoding == "ros2idl" else "ros2msg", text)
    wanted = [name if name in columns else "''" for name in ("offered_qos_profiles", "type_description_hash")]
    found: Dict[int, Connection] = {}
    damaged = 0
    for row in database.execute("SELECT id, name, type, serialization_format, %s, %s FROM topics" % tuple(wanted)):
        file_id, topic, kind, encoding, qos, type_hash = row
        if not isinstance(file_id, int) or file_id < 0 or not all(isinstance(each, str) for each in row[1:]):
            damaged += 1
            continue
        language, text = definitions.get(kind) or ("ros2msg", "")
        found[file_id] = Connection(
            topic, kind, "", text or ros2_definition(kind), encoding=encoding, schema_encoding=language,
            extra=(("offered_qos_profiles", qos), ("topic_type_hash", type_hash)))
    return found, damaged


def _version(database: sqlite3.Connection) -> str:
    with contextlib.suppress(sqlite3.Error):
        found = database.execute("SELECT schema_version FROM schema").fetchone()
        if found:
            return str(found[0])
    return "of an unnamed version"


class _Chunks:
    """The messages of a database in the order of its rows, gathered to chunks."""

    def __init__(self) -> None:
        self.chunks: List[ChunkRef] = []
        self.codecs: List[Tuple[str, int, int]] = []
        self._position = 0
        self._reset()

    def _reset(self) -> None:
        self._rows: List[int] = []
        self._times: List[int] = []
        self._counts: Dict[int, int] = {}
        self._stored = self._size = 0
        self._codec = "none"

    def add(self, row: int, number: int, time: int, stored: int, head: bytes) -> None:
        """Add a message: numbers of its row and connection, ns, bytes in the file, and its first bytes."""
        self._rows.append(row)
        self._times.append(time)
        self._counts[number] = self._counts.get(number, 0) + 1
        self._stored += stored + _ROW
        self._size += (max(unpacked_size(head), 0) if head.startswith(ZSTD) else stored) + _ROW
        if head.startswith(ZSTD):
            self._codec = "zstd"
        if self._size >= _CHUNK_BYTES or len(self._rows) >= _CHUNK_MESSAGES:
            self.close()

    def close(self) -> None:
        """End a chunk."""
        if self._rows:
            end = self._position + self._stored
            self.chunks.append(ChunkRef(self._position, end, min(self._times), max(self._times), self._counts,
                                        rows=(self._rows[0], self._rows[-1]), unpacked=self._size))
            self.codecs.append((self._codec, self._stored, self._size))
            self._position = end
            self._reset()


def read_index(path: PathLike, descriptor: int) -> LogIndex:
    """Return the index of a database, which is that of its messages: it has no other.

    Raises:
        BagFormatError: It is no storage of rosbag2, it is damaged, or a writer left changes beside it.
    """
    if leftovers(path):
        raise BagFormatError("its writer was cut off and left changes beside it (jaka_bag recover takes them up)")
    found = _Chunks()
    file_size = os.fstat(descriptor).st_size
    try:
        with contextlib.closing(open_database(path)) as database:
            check_tables(database)
            topics, damaged = read_topics(database)
            numbers = {file_id: number for number, file_id in enumerate(topics)}
            next_row = -2**63
            for row, topic, time, size, head in database.execute(
                    "SELECT id, topic_id, timestamp, length(data), substr(data, 1, %d) FROM messages ORDER BY id"
                    % HEAD):
                if damaged or not (isinstance(row, int) and row >= next_row and isinstance(topic, int)
                                   and topic in numbers and isinstance(time, int) and isinstance(size, int)
                                   and size <= file_size and isinstance(head, bytes)):
                    raise BagFormatError("a row is damaged (jaka_bag recover keeps the rest)")
                next_row = row + 1  # damaged pages may lead back, without an end
                found.add(row, numbers[topic], time, size, head)
            version = _version(database)
    except sqlite3.Error as error:
        raise BagFormatError("sqlite3: %s (jaka_bag recover keeps the rest)" % error) from error
    found.close()
    chunks = found.chunks
    codecs: Tuple[CodecTotals, ...] = codec_totals(found.codecs)
    start: Optional[int] = min((chunk.start_time for chunk in chunks), default=None)
    end: Optional[int] = max((chunk.end_time for chunk in chunks), default=None)
    return LogIndex("sqlite3", version, str(path), file_size, list(topics.values()), numbers, chunks,
                    [sum(chunk.counts.get(number, 0) for chunk in chunks) for number in range(len(topics))], start, end,
                    profile="ros2", codecs=codecs)
