"""The recovery of the sqlite3 storage of a rosbag2 folder: every row that can be reached and is a message.

Pages of a database have no checksums: bytes that changed inside of a message are not noticed.
"""
import contextlib
import os
import shutil
import sqlite3
import tempfile
from pathlib import Path
from typing import Any, Iterator, List, Optional, Tuple

from ..errors import BagFormatError
from .index import leftovers
from .packed_messages import unpacked
from .recovery import LogRecovery, Stretch
from .sqlite_reader import batch_of
from .sqlite_records import check_tables, open_database, read_topics

_BATCH_BYTES, _BATCH_MESSAGES = 1 << 20, 4096
_SINGLE_STEPS = 1000
"""Unreadable rows that are tried one by one before the steps grow."""
_NO_MESSAGE = "a row is no message"


def _short(error: Exception) -> str:
    return "sqlite3: %s" % error


class SqliteRecovery(LogRecovery):
    """The recovery of one database; see ``LogRecovery``. The file is not changed.

    Args:
        descriptor: Its open file.
        size: byte.
    """

    def __init__(self, descriptor: int, size: int) -> None:
        super().__init__(descriptor, size)
        self.profile = "ros2"
        self._path = Path(os.readlink("/proc/self/fd/%d" % descriptor))
        self._largest = size

    def _database(self, folder: str) -> sqlite3.Connection:
        """Return the open database; where it has changes of an unfinished writer, those are taken up in a copy."""
        path, options = self._path, "mode=ro&immutable=1"
        besides = leftovers(self._path)
        if besides:
            for name in (str(self._path), *besides):
                shutil.copyfile(name, os.path.join(folder, os.path.basename(name)))
            self._largest += sum(map(os.path.getsize, besides))
            path, options = Path(folder) / self._path.name, "mode=rw"
            self.notes.append("changes that a writer left beside %s were taken up" % self._path.name)
        return open_database(path, options)

    def _stretches(self) -> Iterator[Stretch]:
        with tempfile.TemporaryDirectory(prefix="jaka_bag") as folder:
            with contextlib.ExitStack() as stack:
                try:
                    database = stack.enter_context(contextlib.closing(self._database(folder)))
                    self._read_topics(database)
                except (sqlite3.Error, OSError) as error:
                    self.lose(0, self.size, "its topics cannot be read (%s)" % _short(error))
                    return
                except BagFormatError as error:
                    self.lose(0, self.size, str(error))
                    return
                yield from self._batches(database)

    def _read_topics(self, database: sqlite3.Connection) -> None:
        check_tables(database)
        found, damaged = read_topics(database)
        for _ in range(damaged):
            self.lose(0, self.size, "the row of a topic is damaged")
        self.learn(found)

    def _first_id(self, database: sqlite3.Connection) -> int:
        """Return the number of the first row where it is negative, which no recorder makes, else 0."""
        found = None
        with contextlib.suppress(sqlite3.Error):
            found = database.execute("SELECT id FROM messages WHERE id < 0 ORDER BY id LIMIT 1").fetchone()
        return found[0] if found and isinstance(found[0], int) else 0

    def _last_id(self, database: sqlite3.Connection) -> Optional[int]:
        """Return the number of the last row; None where it cannot be reached."""
        try:
            found = database.execute("SELECT id FROM messages ORDER BY id DESC LIMIT 1").fetchone()
        except sqlite3.Error:
            return None
        if found is None:
            return 0
        return found[0] if isinstance(found[0], int) else None

    def _next_row(self, database: sqlite3.Connection, begin: int, last: int) -> int:
        """Return the number of the first row from ``begin`` on that can be reached; ``last`` + 1 where none can."""
        found: Any = None

        def is_reached(number: int) -> bool:
            nonlocal found
            try:
                found = database.execute("SELECT id, timestamp, data FROM messages WHERE id >= ? ORDER BY id LIMIT 1",
                                         (number,)).fetchone()
                return found is not None and isinstance(found[0], int) and found[0] >= number
            except sqlite3.Error:
                return False

        number, step = begin, 1
        for tried in range(1 << 20):
            if number > last:
                return last + 1
            if is_reached(number):
                break
            if found and isinstance(found[0], (str, bytes)):  # they sort behind every number
                return last + 1
            step = 1 if tried < _SINGLE_STEPS else 2 * step
            number += step
        while step > 1:  # the first behind the damage lies in the last step
            step //= 2
            if is_reached(number - step):
                number -= step
        return number

    def _rows_of(self, database: sqlite3.Connection) -> Iterator[Tuple[Any, Any, Any]]:
        """Yield (topic, time, data) of all rows that can be reached, and note the others."""
        begin = self._first_id(database)
        last = self._last_id(database)
        with contextlib.suppress(sqlite3.Error):
            if database.execute("SELECT 1 FROM messages WHERE id IS NULL LIMIT 1").fetchone():
                self.lose(0, self.size, _NO_MESSAGE)
        while True:
            try:
                for number, topic, time, data in database.execute(
                        "SELECT id, topic_id, timestamp, CASE WHEN length(data) <= ? THEN data END FROM messages "
                        "WHERE id >= ? ORDER BY id", (self._largest, begin)):
                    if not isinstance(number, int):
                        self.lose(0, self.size, _NO_MESSAGE)
                        continue
                    if number < begin:  # damaged pages may lead back, without an end
                        raise sqlite3.DatabaseError("they are not in order")
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
            if not (isinstance(topic, int) and topic >= 0 and isinstance(time, int) and isinstance(data, bytes)):
                self.lose(0, self.size, _NO_MESSAGE)
                continue
            try:
                data = unpacked(data)
            except BagFormatError as error:
                self.lose(0, self.size, str(error))
                continue
            waiting.append((topic, time, data))
            held += len(data)
            if held >= _BATCH_BYTES or len(waiting) >= _BATCH_MESSAGES:
                yield self._stretch(waiting)
                waiting, held = [], 0
        if waiting:
            yield self._stretch(waiting)

    def _stretch(self, rows: List[Tuple[int, int, bytes]]) -> Stretch:
        return Stretch(0, self.size, batch_of(rows))
