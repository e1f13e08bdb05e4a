"""The reader of rosbag2 folders behind the interface of every log: their messages are those of ROS 1."""
import os
from typing import Dict, List

import numpy as np

from ..messages.batch import Array, MessageBatch
from ..paths import PathLike
from .index import METADATA, ChunkRef, LogIndex, open_for_reading
from .interface import LogReader
from .rosbag2_declarations import declarations
from .rosbag2_folder import Rosbag2Folder, describe

_MESSAGES, _BYTES = 4096, 4 << 20
"""Messages in one chunk, and bytes of them, about: the folder has none of its own that both storages share."""


def _chunks(numbers: Array, times: Array, sizes: Array, bytes_each: int) -> List[ChunkRef]:
    """Return chunks of messages in the order of time, which part where the time changes."""
    chunks: List[ChunkRef] = []
    ends = np.cumsum(sizes)
    begin = 0
    while begin < len(times):
        fits = int(np.searchsorted(ends, (ends[begin - 1] if begin else 0) + _BYTES, "right"))
        last = min(begin + _MESSAGES, max(fits, begin + 1), len(times)) - 1
        end = int(np.searchsorted(times, times[last], "right"))
        counts = np.bincount(numbers[begin:end])
        chunks.append(ChunkRef(begin * bytes_each, end * bytes_each, int(times[begin]), int(times[end - 1]), {
            number: int(counts[number]) for number in np.flatnonzero(counts).tolist()},
            unpacked=int(sizes[begin:end].sum())))
        begin = end
    return chunks


class Rosbag2Reader(LogReader):
    """A rosbag2 folder open for reading; see ``LogReader``. What ROS 1 cannot have is left out, with a note.

    Args:
        path: The folder.

    Raises:
        BagError: It cannot be read.
        DefinitionError: There are messages, and ROS 1 can have none of them.
        MissingDependency: rosbags is not installed.
    """

    def __init__(self, path: PathLike) -> None:
        folder = self._folder = Rosbag2Folder(path)
        try:
            found = list(folder.sizes())
        except BaseException:
            folder.close()
            raise
        numbers, times, sizes = np.array(found, np.int64).reshape(-1, 3).T
        order = np.argsort(times, kind="stable")
        facts = describe(path)
        chunks = _chunks(numbers[order], times[order], sizes[order], max(facts["size"] // max(len(found), 1), 1))
        counts = np.bincount(numbers, minlength=len(folder.connections)).tolist()
        start, end = (int(times.min()), int(times.max())) if found else (None, None)
        by_topic: Dict[str, int] = {}
        for connection, count in zip(folder.connections, counts):
            by_topic[connection.topic] = by_topic.get(connection.topic, 0) + count
        span = None if start is None or end is None or folder.left_out else (start, end)
        lies = declarations(path).contradictions(by_topic, None if folder.left_out else len(found), span)
        super().__init__(open_for_reading(os.path.join(str(path), METADATA)), LogIndex(
            "rosbag2", facts["version"], str(path), facts["size"], folder.connections,
            {number: number for number in range(len(counts))}, chunks, counts, start, end,
            codecs=(("none", len(chunks), facts["size"], facts["size"]),),
            notes=(*folder.left_out, *lies), left_out=tuple(folder.left_out)))

    def decode_only(self, wanted: Array) -> None:
        """See ``LogReader``; messages of the others are missing."""
        self._folder.decode_only(np.flatnonzero(wanted).tolist())

    def _load(self, chunk: ChunkRef) -> MessageBatch:
        numbers: List[int] = []
        times: List[int] = []
        payloads: List[bytes] = []
        for number, time, raw in self._folder.messages(chunk.start_time, chunk.end_time + 1):
            numbers.append(number)
            times.append(time)
            payloads.append(raw)
        length = np.array(list(map(len, payloads)), np.int64)
        return MessageBatch(np.frombuffer(b"".join(payloads), np.uint8), np.cumsum(length) - length, length,
                            np.array(numbers, np.int32), np.array(times, np.int64))

    def close(self) -> None:
        """Close the folder."""
        self._folder.close()
        super().close()

    def read_metadata(self, entry: object) -> Dict[str, str]:
        """See ``LogReader``; a folder has none."""
        return {}
