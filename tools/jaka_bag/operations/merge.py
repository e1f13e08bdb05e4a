"""Makes one log of several, in the order of time."""
import contextlib
import time
from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np

from ..containers.contract import LogReader
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
)


def sources_of(readers: Sequence[LogReader]) -> Tuple[List[Source], List[Connection]]:
    """Logs to be read together, and the connections of all; equal ones of different logs become one."""
    numbers: Dict[Connection, int] = {}
    sources = []
    for reader in readers:
        own = [numbers.setdefault(connection, len(numbers)) for connection in reader.connections]
        sources.append(Source(reader, MessageFilter(Selection(), reader.connections), np.array(own or [0])))
    return sources, list(numbers)


def merge(paths: Sequence[PathLike], target: PathLike, compression: Optional[str] = None, level: Optional[int] = None,
          overwrite: bool = False, on_progress: Optional[OnProgress] = None) -> WriteResult:
    """Write the messages of several logs into one, by log time; equal times in the order of the logs given.

    Raises:
        BagError: A source cannot be read, or the target cannot be written or hold it.
    """
    begin = time.monotonic()
    for path in paths:
        refuse_same_file(path, target)
    with contextlib.ExitStack() as stack:
        readers = [stack.enter_context(open_log(path)) for path in paths]
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
            if written != expected:
                raise BagError("the indexes tell of %d messages, the chunks hold %d (jaka_bag recover keeps them)"
                               % (expected, written))
            for reader in readers:
                copy_extras(reader, writer)
        return WriteResult(", ".join(map(str, paths)), str(target), written, sum(r.index.size for r in readers),
                       size_of(target), time.monotonic() - begin, losses.notes(readers))
