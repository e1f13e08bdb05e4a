"""The merging of several logs into one, in the order of time."""
import contextlib
import time
from typing import Dict, FrozenSet, List, Optional, Sequence, Set, Tuple

import numpy as np

from ..containers.interface import LogReader
from ..containers.registry import create_log, open_log
from ..containers.time_order import Source, in_time_order
from ..errors import BagError
from ..messages.connection import Connection
from ..messages.selection import MessageFilter, Selection
from ..paths import PathLike
from .convert import (
    LossNotes,
    OnProgress,
    WriteResult,
    add_channels,
    copy_extras,
    refuse_same_file,
    size_of,
    write_in_order,
    wrong_count,
)


def open_all(paths: Sequence[PathLike]) -> List[LogReader]:
    """Open several logs; close them after use.

    Raises:
        BagError: Some cannot be read; the text names each of them.
    """
    readers: List[LogReader] = []
    errors: List[str] = []
    for path in paths:
        try:
            readers.append(open_log(path))
        except BagError as error:
            errors.append(str(error))
    if errors:
        for reader in readers:
            reader.close()
        raise BagError("; ".join(errors))
    return readers


def sources_of(readers: Sequence[LogReader]) -> Tuple[List[Source], List[Connection]]:
    """Return the sources for logs that are read together, and the connections of all, with equal ones joined."""
    numbers: Dict[Connection, int] = {}
    sources = []
    for reader in readers:
        own = [numbers.setdefault(connection, len(numbers)) for connection in reader.connections]
        sources.append(Source(reader, MessageFilter(Selection(), reader.connections), np.array(own or [0])))
    return sources, list(numbers)


def merge(paths: Sequence[PathLike], target: PathLike, compression: Optional[str] = None, level: Optional[int] = None,
          overwrite: bool = False, on_progress: Optional[OnProgress] = None) -> WriteResult:
    """Write the messages of several logs into one, by log time; equal times in the order of the logs given.

    Attachments and metadata of all logs are kept; equal metadata, as the parts of one log have, once.

    Raises:
        BagError: A source cannot be read, or the target cannot be written or hold it.
    """
    begin = time.monotonic()
    for path in paths:
        refuse_same_file(path, target)
    with contextlib.ExitStack() as stack:
        readers = [stack.enter_context(reader) for reader in open_all(paths)]
        profiles = {reader.index.profile or "ros1" for reader in readers}
        if len(profiles) > 1:
            raise BagError("logs of different profiles cannot be merged: %s" % ", ".join(sorted(profiles)))
        sources, connections = sources_of(readers)
        with create_log(target, compression, level, overwrite, profiles.pop()) as writer:
            ids = add_channels(connections, writer)
            losses = LossNotes(writer)
            written = write_in_order(in_time_order(sources),
                                     lambda batch: (int(batch.length.sum()), losses.look(batch)), writer, ids,
                                     on_progress)
            expected = sum(reader.message_count for reader in readers)
            known: Set[Tuple[str, FrozenSet[Tuple[str, str]]]] = set()
            for reader in readers:
                copy_extras(reader, writer, known=known)
        return WriteResult(", ".join(map(str, paths)), str(target), written, sum(r.index.size for r in readers),
                       size_of(target), time.monotonic() - begin, losses.notes(readers) + (
                               (wrong_count(expected, written),) if written != expected else ()),
                           sum(len(reader.index.left_out) for reader in readers))
