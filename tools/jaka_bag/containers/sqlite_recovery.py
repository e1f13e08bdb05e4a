"""The recovery of the sqlite3 storage of a rosbag2 folder: every row that can be reached and is a message.

Pages of a database have no checksums: bytes that changed inside of a message are not noticed.
"""
import os
import shutil
import sqlite3
import tempfile
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Tuple

import numpy as np

from ..messages.batch import MessageBatch
from ..messages.connection import Connection
from ..messages.ros2_types import ros2_definition
from ..paths import PathLike
from .compression import decompress_partly
from .recovery import LogRecovery, Stretch

_BATCH_BYTES, _BATCH_MESSAGES = 1 << 20, 4096
_SINGLE_STEPS = 1000
"""Unreadable rows that are tried one by one before the steps grow."""
_ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a compressed message; one of CDR begins with 0."""
_UNFINISHED = ("-wal", "-journal")
"""Suffixes of files with changes that a writer that was killed had not brought into the database."""


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "surrogateescape")


def _short(error: Exception) -> str:
    return "sqlite3: %s" % error


class SqliteRecovery(LogRecovery):
    """The recovery of one database; see ``LogRecovery``. The file is not changed.

    Args:
        path: The database.
        descriptor: Its open file.
        size: byte.
    """

    def __init__(self, path: PathLike, descriptor: int, size: int) -> None:
        super().__init__(descriptor, size)
        self.profile = "ros2"
        self._path = Path(os.path.abspath(str(path)))

    def _database(self, folder: str) -> sqlite3.Connection:
        """Return the open database; where it has changes of an unfinished writer, those are taken up in a copy."""
        path, options = self._path, "mode=ro&immutable=1"
        besides = [Path(str(self._path) + suffix) for suffix in _UNFINISHED]
        if any(each.is_file() and each.stat().st_size for each in besides):
            for each in (self._path, *(each for each in besides if each.is_file())):
                shutil.copyfile(str(each), os.path.join(folder, each.name))
            path, options = Path(folder) / self._path.name, "mode=rw"
            self.notes.append("changes that a writer left beside %s were taken up" % self._path.name)
        database = sqlite3.connect("%s?%s" % (path.as_uri(), options), uri=True)
        database.execute("PRAGMA writable_schema=ON")  # else one that is cut off is refused as a whole
        database.text_factory = _text
        return database

    def _stretches(self) -> Iterator[Stretch]:
        with tempfile.TemporaryDirectory(prefix="jaka_bag") as folder:
            try:
                database = self._database(folder)
                self._read_topics(database)
            except (sqlite3.Error, OSError) as error:
                self.lose(0, self.size, "its topics cannot be read (%s)" % _short(error))
                return
            try:
                yield from self._batches(database)
            finally:
                database.close()

    def _read_topics(self, database: sqlite3.Connection) -> None:
        columns = {row[1] for row in database.execute("PRAGMA table_info(topics)")}
        definitions: Dict[str, Tuple[str, str]] = {}
        try:
            for kind, encoding, text in database.execute(
                    "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"):
                definitions[kind] = ("ros2idl" if encoding == "ros2idl" else "ros2msg", text)
        except sqlite3.Error:
            pass  # older databases have none
        wanted = [name if name in columns else "''" for name in ("offered_qos_profiles", "type_description_hash")]
        for row in database.execute("SELECT id, name, type, serialization_format, %s, %s FROM topics" % tuple(wanted)):
            file_id, topic, kind, encoding, qos, type_hash = row
            if not isinstance(file_id, int) or not all(isinstance(each, str) for each in row[1:]):
                self.lose(0, self.size, "the row of a topic is damaged")
                continue
            language, text = definitions.get(kind) or ("ros2msg", "")
            self.learn({file_id: Connection(
                topic, kind, "", text or ros2_definition(kind), encoding=encoding, schema_encoding=language,
                extra=(("offered_qos_profiles", qos), ("topic_type_hash", type_hash)))})

    def _last_id(self, database: sqlite3.Connection) -> Optional[int]:
        """Return the number of the last row; None where it cannot be reached."""
        try:
            found = database.execute("SELECT id FROM messages ORDER BY id DESC LIMIT 1").fetchone()
        except sqlite3.Error:
            return None
        return found[0] if found else 0

    def _next_row(self, database: sqlite3.Connection, begin: int, last: int) -> int:
        """Return the number of the first row from ``begin`` on that can be reached; ``last`` + 1 where none can."""
        def is_reached(number: int) -> bool:
            try:
                return database.execute("SELECT timestamp, data FROM messages WHERE id >= ? ORDER BY id LIMIT 1",
                                        (number,)).fetchone() is not None
            except sqlite3.Error:
                return False

        number, step = begin, 1
        for tried in range(1 << 20):
            if number > last:
                return last + 1
            if is_reached(number):
                break
            step = 1 if tried < _SINGLE_STEPS else 2 * step
            number += step
        while step > 1:  # the first behind the damage lies in the last step
            step //= 2
            if is_reached(number - step):
                number -= step
        return number

    def _rows_of(self, database: sqlite3.Connection) -> Iterator[Tuple[Any, Any, Any]]:
        """Yield (topic, time, data) of all rows that can be reached, and note the others."""
        begin = 0
        last = self._last_id(database)
        while True:
            try:
                for number, topic, time, data in database.execute(
                        "SELECT id, topic_id, timestamp, data FROM messages WHERE id >= ? ORDER BY id", (begin,)):
                    begin = number + 1
                    yield topic, time, data
                return
            except sqlite3.Error as error:
                reason = _short(error)
            limit = self.size if last is None else last  # no database has more rows than bytes
            after = self._next_row(database, begin + 1, limit)
            self.lose(0, self.size, "rows from %d on%s cannot be read (%s)" % (
                begin, "" if last is None and after > limit else " up to %d" % (after - 1), reason))
            if after > limit:
                return
            begin = after

    def _batches(self, database: sqlite3.Connection) -> Iterator[Stretch]:
        waiting: List[Tuple[int, int, bytes]] = []
        held = 0
        for topic, time, data in self._rows_of(database):
            if not (isinstance(topic, int) and isinstance(time, int) and isinstance(data, bytes)):
                self.lose(0, self.size, "a row is no message")
                continue
            if data.startswith(_ZSTD):
                data, reason = self._unpacked(data)
                if reason:
                    self.lose(0, self.size, reason)
                    continue
            waiting.append((topic, time, data))
            held += len(data)
            if held >= _BATCH_BYTES or len(waiting) >= _BATCH_MESSAGES:
                yield self._stretch(waiting)
                waiting, held = [], 0
        if waiting:
            yield self._stretch(waiting)

    def _unpacked(self, data: bytes) -> Tuple[bytes, str]:
        """Return a compressed message, and the reason where it cannot be had."""
        import zstandard
        try:
            size = zstandard.frame_content_size(data)
        except zstandard.ZstdError:
            size = -1
        whole = decompress_partly("zstd", data)
        if size < 0 or len(whole) != size:
            return b"", "a compressed message is damaged"
        return whole, ""

    def _stretch(self, rows: List[Tuple[int, int, bytes]]) -> Stretch:
        length = np.array([len(data) for _, _, data in rows], np.int64)
        batch = MessageBatch(np.frombuffer(b"".join(data for _, _, data in rows), np.uint8),
                             np.cumsum(length) - length, length, np.array([row[0] for row in rows], np.int64),
                             np.array([row[1] for row in rows], np.int64))
        return Stretch(0, self.size, batch)
