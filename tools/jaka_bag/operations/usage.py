"""The number of bytes that each topic of a log takes.

``BagFormatError`` is raised where a chunk is damaged.
"""
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from ..containers.index import ChunkRef
from ..containers.interface import LogReader
from ..messages.batch import Array
from ..pipeline import in_order
from .convert import OnProgress


class TopicUsage(NamedTuple):
    """The usage of one topic.

    Attributes:
        topic: Name of the topic.
        datatype: ``package/Type`` of its first connection.
        messages: Number of messages.
        payload: Bytes of the messages, uncompressed.
        stored: Bytes in the file: of each chunk and its index the part that its payload has in it.
    """

    topic: str
    datatype: str
    messages: int
    payload: int
    stored: int

    def document(self) -> Dict[str, Any]:
        """Return the usage as JSON data."""
        return {"topic": self.topic, "type": self.datatype, "messages": self.messages, "payload_bytes": self.payload,
                "stored_bytes": self.stored}


def usage_of(reader: LogReader, on_progress: Optional[OnProgress] = None) -> List[TopicUsage]:
    """Return the usage of each topic, the largest first.

    Args:
        reader: The log.
        on_progress: Receives the progress.
    """
    count = len(reader.connections)
    messages, payload, stored = np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros(count)

    def work(chunk: ChunkRef) -> Tuple[int, Array, Array]:
        batch = reader.load(chunk)
        sizes = np.bincount(batch.connection, batch.length, count)
        return chunk.end - chunk.position, np.bincount(batch.connection, minlength=count), sizes

    for size, counts, sizes in in_order(work, reader.chunks):
        messages += counts
        payload += sizes.astype(np.int64)
        share = sizes if sizes.sum() else counts.astype(float)
        stored += share * (size / max(share.sum(), 1.0))
        if on_progress is not None:
            on_progress(size, int(counts.sum()))
    rows: Dict[str, TopicUsage] = {}
    for number, connection in enumerate(reader.connections):
        row = rows.get(connection.topic, TopicUsage(connection.topic, connection.datatype, 0, 0, 0))
        rows[connection.topic] = row._replace(
            messages=row.messages + int(messages[number]), payload=row.payload + int(payload[number]),
            stored=row.stored + round(float(stored[number])))
    return sorted(rows.values(), key=lambda row: (-row.stored, row.topic))
