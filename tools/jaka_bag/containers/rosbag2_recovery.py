"""The recovery of rosbag2 folders: each file of messages in order, with ``metadata.yaml`` or without it."""
import os
import tempfile
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Optional, Tuple

import numpy as np

from ..errors import BagError, BagFormatError
from ..messages.batch import Array, MessageBatch, distinct, with_payloads
from ..messages.connection import Connection
from ..paths import PathLike
from .compression import unpack_file
from .index import METADATA, PACKED, AttachmentIndex, MetadataIndex, open_for_reading, storage_files
from .mcap.recovery import McapRecovery
from .packed_messages import may_be_packed, unpacked
from .recovery import LogRecovery, Loss, Stretch
from .rosbag2_declarations import Declarations, declarations, unnamed
from .sqlite_recovery import SqliteRecovery

_DECLARATIONS = "rosbag2"
"""Name of the record in which an MCAP of a folder repeats the folder's ``metadata.yaml``."""


class Rosbag2Recovery(LogRecovery):
    """The recovery of a folder; see ``LogRecovery``. Positions of losses are those in their file.

    Args:
        folder: The folder.

    Raises:
        BagFormatError: It has no file of messages.
        BagError: It cannot be listed.
    """

    def __init__(self, folder: PathLike) -> None:
        self._folder = Path(os.path.abspath(str(folder)))
        try:
            there = storage_files(self._folder)
            size = sum((self._folder / name).stat().st_size for name in there)
        except OSError as error:
            raise BagError("cannot read %s: %s" % (folder, error.strerror)) from error
        super().__init__(-1, size)
        self.profile = "ros2"
        self._contradictions: List[str] = []
        self._declared: Optional[Declarations] = None
        names: List[str] = []
        try:
            self._declared = declarations(self._folder)
            names, self.expected = self._declared.names, self._declared.messages
        except BagError as error:
            self._contradictions.append(str(error))
        for name in names:
            if name not in there:
                self.losses.append(Loss(0, 0, "%s names it, and it is not there" % METADATA, file=name))
        strangers = [name for name in there if name not in names and name + PACKED not in there]
        if names:
            self._contradictions += unnamed(names, there)
        self._files = [name for name in names if name in there] + strangers
        if not there:
            raise BagFormatError("%s has no file of messages (.mcap, .db3)" % folder)
        self._numbers: Dict[Connection, int] = {}
        self._undescribed: Dict[Tuple[str, int], int] = {}
        self._extras: Dict[Any, Callable[[], Any]] = {}

    def _stretches(self) -> Iterator[Stretch]:
        passed = 0
        for name in self._files:
            path = self._folder / name
            size = path.stat().st_size
            try:
                with open_for_reading(path) as file, tempfile.NamedTemporaryFile(prefix="jaka_bag") as space:
                    if name.endswith(PACKED):
                        end, reason = unpack_file(file.fileno(), size, space.file)
                        damage = [Loss(end, size, "the compressed file was unpacked up to here (%s)" % reason)
                                  ] if reason else []
                        for each in self._file(Path(space.name), name, space, passed):
                            yield each._replace(begin=passed, end=passed + size)
                        self._lose_of(name, damage)
                    else:
                        for each in self._file(path, name, file, passed):
                            yield each._replace(begin=passed + each.begin, end=passed + each.end)
            except BagError as error:
                self._lose_of(name, [Loss(0, size, str(error).replace("%s: " % path, ""))])
            passed += size

    def _lose_of(self, name: str, losses: List[Loss]) -> None:
        """Take over losses of one file."""
        for loss in losses:
            after = self._last_time if loss.after is None else loss.after
            self.losses.append(loss._replace(after=after, file=name))

    def _file(self, path: Path, name: str, file: Any, passed: int) -> Iterator[Stretch]:
        """Yield the messages of one file, with the numbers of this recovery.

        Args:
            path: The file, or what it was unpacked to.
            name: Its name in the folder.
            file: It, open.
            passed: Bytes of the files before it.
        """
        size = os.fstat(file.fileno()).st_size
        is_database = name.endswith((".db3", ".db3" + PACKED))
        part = (SqliteRecovery if is_database else McapRecovery)(file.fileno(), size)
        known = 0
        for stretch in part.stretches():
            if len(stretch.batch):  # until then a loss may still grow
                self._lose_of(name, part.losses[known:])
                known = len(part.losses)
                yield stretch._replace(batch=self._renumbered(self._plain(stretch, name), part, name))
        self._lose_of(name, part.losses[known:])
        for file_id, connection in part.connections.items():
            self._number(connection)
            if (name, file_id) in self._undescribed:  # described behind their messages
                self.connections[self._undescribed[name, file_id]] = connection
        self.misled += part.misled
        self.notes += ["%s: %s" % (name, note) for note in part.notes]
        for attachment in part.attachments:
            self.attachments.append(attachment._replace(position=passed + attachment.position))
            self._extras[self.attachments[-1]] = self._later(path, name, part, McapRecovery.read_attachment, attachment)
        for entry in part.metadata:
            if entry.name != _DECLARATIONS:
                self.metadata.append(entry._replace(position=passed + entry.position))
                self._extras[self.metadata[-1]] = self._later(path, name, part, McapRecovery.read_metadata, entry)

    def _plain(self, stretch: Stretch, name: str) -> MessageBatch:
        """Return the messages of a file, those unpacked that were compressed one by one."""
        batch = stretch.batch
        if not may_be_packed(batch):
            return batch
        made: List[bytes] = []
        good: List[int] = []
        for number, (begin, size) in enumerate(zip(batch.start.tolist(), batch.length.tolist())):
            try:
                made.append(unpacked(batch.data[begin:begin + size].tobytes()))
                good.append(number)
            except BagFormatError as error:
                self._lose_of(name, [Loss(stretch.begin, stretch.end, str(error))])
        return with_payloads(batch.take(np.array(good, np.int64)), made)

    def _later(self, path: Path, name: str, part: Any, read: Callable[..., Any], entry: Any) -> Callable[[], Any]:
        """Return what reads an attachment or metadata of a file: again, or at once where it is unpacked only now."""
        if name.endswith(PACKED):
            content = read(part, entry)
            return lambda: content

        def again() -> Any:
            with open_for_reading(path) as file:
                return read(McapRecovery(file.fileno(), os.fstat(file.fileno()).st_size), entry)
        return again

    def _next_number(self) -> int:
        return len(self._numbers) + len(self._undescribed)

    def _number(self, connection: Connection) -> int:
        number = self._numbers.setdefault(connection, self._next_number())
        self.connections[number] = connection
        return number

    def _renumbered(self, batch: MessageBatch, part: LogRecovery, name: str) -> MessageBatch:
        """Return the messages of a file with this recovery's numbers."""
        ids = distinct(batch.connection)
        new: Array = np.array([
            self._number(part.connections[file_id]) if file_id in part.connections
            else self._undescribed.setdefault((name, file_id), self._next_number())
            for file_id in ids.tolist()], np.int64)
        return batch.replace(connection=new[np.searchsorted(ids, batch.connection)])

    def contradictions(self, counts: Dict[int, int]) -> List[str]:
        """See ``LogRecovery``."""
        if self._declared is None:
            return self._contradictions
        found: Dict[str, int] = {}
        for number in counts.keys() & self.connections.keys():
            topic = self.connections[number].topic
            found[topic] = found.get(topic, 0) + counts[number]
        return self._contradictions + self._declared.contradictions(
            {**dict.fromkeys(self._declared.topics, 0), **found}, sum(counts.values()))

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """See ``LogRecovery``."""
        content: bytes = self._extras[entry]()
        return content

    def read_metadata(self, entry: MetadataIndex) -> Dict[str, str]:
        """See ``LogRecovery``."""
        values: Dict[str, str] = self._extras[entry]()
        return values
