"""The recovery of a whole log from the readable parts of a cut-off, unindexed or damaged one."""
import os
import time
from pathlib import Path
from typing import Any, Dict, Iterator, NamedTuple, Optional, Set, Tuple

import numpy as np

from ..containers.interface import LogWriter
from ..containers.recovery import LogRecovery, Loss
from ..containers.registry import create_log, open_damaged
from ..errors import BagError, BagFormatError
from ..messages.batch import MessageBatch, distinct, pieces_of
from ..messages.connection import Connection
from ..paths import PathLike
from .convert import OnProgress, add_channels, copy_extras, refuse_same_file, size_of, with_md5, write_in_order

_MAX_PIECE = 4 << 20
"""Payload, byte, that is written at once: progress shows, and memory stays bounded."""
ACCOUNT = "jaka_bag.recovery"
"""Name of the metadata with the losses that a recovered MCAP has."""
_MOST_IN_ACCOUNT = 1000
"""Most losses in the account; a file that is damaged all over would have millions."""


class Recovered(NamedTuple):
    """The result of a recovery.

    Attributes:
        target: The new log.
        messages: Messages in it.
        expected: Messages by the old log's index; None where it has none.
        losses: Stretches that could not be read or trusted, and messages that could not be placed.
        bytes_written: Size of the new log.
        seconds: Wall time, s.
        notes: Bytes that are no part of the format and were skipped, one line each.
    """

    target: str
    messages: int
    expected: Optional[int]
    losses: Tuple[Loss, ...]
    bytes_written: int
    seconds: float
    notes: Tuple[str, ...] = ()

    @property
    def is_whole(self) -> bool:
        """True where nothing is known to be lost."""
        return not self.losses and (self.expected is None or self.expected <= self.messages)

    def document(self) -> Dict[str, Any]:
        """Return the result as JSON data."""
        return dict(self._asdict(), losses=[loss._asdict() for loss in self.losses], is_whole=self.is_whole)


def _renumbered(batch: MessageBatch, connections: Dict[int, Connection], writer: LogWriter,
                unknown: Dict[int, int]) -> MessageBatch:
    """Return the messages of described connections with the new log's numbers; count others by the file's id."""
    ids = distinct(batch.connection)
    numbers = np.array([writer.add_channel(with_md5(connections[i])) if i in connections else -1
                        for i in ids.tolist()], np.int64)
    for file_id in ids[numbers < 0].tolist():
        unknown[file_id] = unknown.get(file_id, 0) + int((batch.connection == file_id).sum())
    new = numbers[np.searchsorted(ids, batch.connection)]
    kept = batch.replace(connection=new)
    return kept if (new >= 0).all() else kept.take(new >= 0)


def _write(recovery: LogRecovery, writer: LogWriter, unknown: Dict[int, int],
           on_progress: Optional[OnProgress]) -> int:
    def batches() -> Iterator[Tuple[int, MessageBatch]]:
        done = 0
        for stretch in recovery.stretches():
            if len(stretch.batch):
                batch = _renumbered(stretch.batch, recovery.connections, writer, unknown)
                for piece in pieces_of(batch, _MAX_PIECE):
                    yield stretch.end - done, piece
                    done = stretch.end

    written = write_in_order(batches(), lambda item: item, writer, None, on_progress)
    add_channels(list(recovery.connections.values()), writer)  # those without messages
    return written


def _attempt(recovery: LogRecovery, path: str, target: PathLike, compression: Optional[str], level: Optional[int],
             overwrite: bool, known: Dict[int, Connection], on_progress: Optional[OnProgress]
             ) -> Optional[Tuple[int, Tuple[Loss, ...]]]:
    """Write what can be read; None where connections were described behind their messages, which are known now."""
    for file_id, connection in known.items():
        recovery.connections.setdefault(file_id, connection)
    unknown: Dict[int, int] = {}
    as_folder = os.path.isdir(path) and not os.path.splitext(str(target))[1]
    with create_log(target, compression, level, overwrite, recovery.profile, as_folder) as writer:
        written = _write(recovery, writer, unknown, on_progress)
        if not written and recovery.losses:
            raise BagFormatError("%s: no message could be read (%s)" % (path, recovery.losses[0].describe()))
        late: Set[int] = unknown.keys() & recovery.connections.keys() - known.keys()
        if late:  # described behind their messages
            writer.abort()
            known.update(recovery.connections)
            return None
        copy_extras(recovery, writer)
        losses = (*recovery.losses, *(
            Loss(0, recovery.size, "%d messages of connection %d, whose description is lost" % (count, file_id))
            for file_id, count in unknown.items()))
        if losses and writer.capabilities.metadata:
            writer.add_metadata(ACCOUNT, {
                "source": Path(path).name, "messages": str(written), "losses": str(len(losses)),
                **{"lost %d" % number: loss.describe() for number, loss in enumerate(losses[:_MOST_IN_ACCOUNT], 1)}})
    return written, losses


def recover(source: PathLike, target: PathLike, compression: Optional[str] = None, level: Optional[int] = None,
            overwrite: bool = False, on_progress: Optional[OnProgress] = None) -> Recovered:
    """Write all that can be read of a log into a new, whole one.

    Args:
        source: .bag or .mcap by content, as ``.bag.active`` and ``.mcap.active``, or a rosbag2 folder.
        target: .bag or .mcap by suffix; of a rosbag2 folder without suffix one more.
        compression: None for the target format's default.
        level: The codec's level; None for its default.
        overwrite: Replace an existing target.
        on_progress: Receives the progress.

    Raises:
        BagFormatError: It is neither, it is encrypted, or no message can be read.
        BagError: The source cannot be opened, or the target cannot be written or hold it.
    """
    begin = time.monotonic()
    refuse_same_file(source, target)
    known: Dict[int, Connection] = {}
    done = None
    while done is None:
        with open_damaged(source) as recovery:
            done = _attempt(recovery, str(source), target, compression, level, overwrite, known, on_progress)
    written, losses = done
    return Recovered(str(target), written, recovery.expected, losses, size_of(target),
                     time.monotonic() - begin, tuple(recovery.notes))


def default_target(source: PathLike) -> Path:
    """Return the path to recover to: the name without ``.active``, else with ``recovered`` in it.

    Raises:
        BagError: The name does not show the format.
    """
    path = Path(source)
    if path.is_dir():
        path = Path(os.path.abspath(str(path)))
        return path.with_name(path.name.replace(".", "_") + "_recovered")
    if path.suffix in (".active", ".part"):
        path = path.with_suffix("")
        if path.suffix in (".bag", ".mcap"):
            return path
    elif path.suffix in (".bag", ".mcap"):
        return path.with_suffix(".recovered" + path.suffix)
    elif path.suffix == ".db3":
        return path.with_suffix(".recovered.mcap")
    raise BagError("%s: give the output" % source)
