"""The reader of a rosbag2 storage file of sqlite3 without its folder: messages of ROS 2, as those of an MCAP."""
import sqlite3
import threading
from typing import BinaryIO, Dict, List, Tuple

import numpy as np

from ..errors import BagFormatError, LimitReached
from ..messages.batch import MessageBatch, with_payloads
from .index import ChunkRef, LogIndex
from .interface import LogReader
from .packed_messages import unpacked
from .sqlite_records import open_database


def batch_of(rows: List[Tuple[int, int, bytes]]) -> MessageBatch:
    """Return messages from (the file's id of the connection, log time in ns, CDR) of each."""
    times = np.array([row[1] for row in rows], np.int64)
    none = np.zeros(len(rows), np.int64)
    return with_payloads(MessageBatch(np.zeros(0, np.uint8), none, none, np.array([row[0] for row in rows], np.int64),
                                      times), [row[2] for row in rows])


class SqliteReader(LogReader):
    """A database open for reading; see ``LogReader``."""

    def __init__(self, file: BinaryIO, index: LogIndex) -> None:
        super().__init__(file, index)
        self._database = open_database(index.path)
        self._one_at_a_time = threading.Lock()

    def _load(self, chunk: ChunkRef) -> MessageBatch:
        try:
            with self._one_at_a_time:
                rows = self._database.execute("SELECT topic_id, timestamp, data FROM messages WHERE id BETWEEN ? AND ? "
                                              "ORDER BY id", chunk.rows).fetchall()
            batch = batch_of([(topic, time, unpacked(data)) for topic, time, data in rows])
            return batch.replace(connection=self._renumber(batch.connection))
        except LimitReached as error:
            raise LimitReached("%s: rows %d to %d: %s" % (self.path, *chunk.rows, error)) from error
        except (BagFormatError, sqlite3.Error) as error:
            raise BagFormatError(self.advice("%s: rows %d to %d: %s (jaka_bag recover keeps the rest)" % (
                self.path, *chunk.rows, error))) from error

    def read_metadata(self, entry: object) -> Dict[str, str]:
        """See ``LogReader``; a database has none."""
        return {}

    def close(self) -> None:
        """Close the database."""
        self._database.close()
        super().close()
