"""The writer of ROS bags, version 2.0, chunk by chunk with flat memory: single messages or batches."""
from typing import Dict, List, Optional, Tuple

import numpy as np

from ...errors import BagError, TopicRefused
from ...messages.batch import Array, MessageBatch
from ...messages.connection import Connection
from ...units import NS_PER_S
from ..compression import BAG_CODECS
from ..interface import EncodedChunk, LogWriter, by_connection, message_records
from . import records as fmt
from .reader import ENTRY_TYPE

_HEAD_TYPE = np.dtype([("header_size", "<u4"), ("size1", "<u4"), ("name1", "S5"), ("connection", "<u4"),
                       ("size2", "<u4"), ("name2", "S3"), ("op", "u1"), ("size3", "<u4"), ("name3", "S5"),
                       ("seconds", "<u4"), ("nanoseconds", "<u4"), ("data_size", "<u4")])
_HEAD = np.array([(38, 9, b"conn=", 0, 4, b"op=", fmt.OP_MESSAGE, 13, b"time=", 0, 0, 0)], _HEAD_TYPE)
_MAX_CHUNK = 0xFFFFFFFF
"""Largest chunk, byte: its size has 32 bits."""


class BagWriter(LogWriter):
    """A ROS bag being written; see ``LogWriter``."""

    format_name = "a .bag"
    codecs = BAG_CODECS
    usual_chunk_size = 768 * 1024
    """Bytes of a chunk: the default of rosbag record."""
    is_for_ros1 = True

    def _begin(self, profile: str) -> None:
        self._channels: Dict[Connection, int] = {}
        self._records: List[bytes] = []
        self._undeclared: Tuple[int, ...] = ()
        self._chunk_infos: List[bytes] = []
        self._write(fmt.MAGIC, fmt.file_header(0, 0, 0))

    def add_channel(self, connection: Connection) -> int:
        """See ``LogWriter.add_channel``; a .bag holds ROS 1 messages only."""
        if connection.encoding != "ros1":
            raise TopicRefused("%s is encoded as %s: a .bag holds ROS 1 messages only (jaka_bag convert makes them of "
                               "others)" % (connection.topic, connection.encoding), connection.topic)
        known = self._channels.get(connection)
        if known is None:
            known = len(self._channels)
            self._records.append(fmt.connection_record(known, connection))
            self._channels[connection] = known
            self._undeclared += (known,)
        return known

    def encode(self, batch: MessageBatch, channel_ids: Array) -> Optional[EncodedChunk]:
        """Make a chunk of a batch (None where it has no message); see ``LogWriter.encode``.

        The first chunk after a new connection carries its record: ``rosbag reindex`` needs it there.
        """
        if not len(batch):
            return None
        declared = self._undeclared
        number = channel_ids[batch.connection]
        unsigned = batch.log_time.view(np.uint64)
        seconds, nanoseconds = np.divmod(unsigned, np.uint64(NS_PER_S))
        if int(seconds.max()) > fmt.MAX_SECONDS:
            latest = int(unsigned.max())
            shown = " (shown as %d ns)" % (latest - (1 << 64)) if latest >= 1 << 63 else ""
            raise BagError("a message time of %d ns%s does not fit into a .bag" % (latest, shown))
        prefix = b"".join(self._records[i] for i in declared)
        if len(prefix) + int(batch.length.sum()) + len(batch) * _HEAD.itemsize > _MAX_CHUNK:
            raise BagError("a chunk is too large for a .bag")
        heads = np.repeat(_HEAD, len(batch))
        heads["connection"] = number
        heads["seconds"] = seconds
        heads["nanoseconds"] = nanoseconds
        heads["data_size"] = batch.length
        data, offset = message_records(batch, heads, prefix)
        entries = np.empty(len(batch), ENTRY_TYPE)
        entries["seconds"] = seconds
        entries["nanoseconds"] = nanoseconds
        entries["offset"] = offset
        opaque = entries.view("V%d" % ENTRY_TYPE.itemsize)  # gathered several times as fast
        indexes, counts = [], {}
        for connection, which in by_connection(number, unsigned):
            indexes.append((connection, fmt.index_record(connection, len(which), opaque[which].tobytes())))
            counts[connection] = len(which)
        codec, body = self._packed(data)
        return EncodedChunk(fmt.chunk_head(codec, len(data), len(body)), body, indexes, counts,
                            int(unsigned.min()), int(unsigned.max()), codec, len(data), declared)

    def append(self, chunk: Optional[EncodedChunk]) -> None:
        """Write a chunk; see ``LogWriter.append``."""
        if chunk is None:
            return
        begin = self._write(chunk.head, chunk.body, b"".join(record for _, record in chunk.indexes))
        self._undeclared = tuple(i for i in self._undeclared if i not in chunk.declared)
        self._chunk_infos.append(fmt.chunk_info_record(
            fmt.ChunkInfo(begin, chunk.start_time, chunk.end_time, chunk.counts)))
        self.message_count += sum(chunk.counts.values())

    def _finish(self) -> None:
        index_position = self.position
        self._write(*(self._records + self._chunk_infos))
        self._rewrite(len(fmt.MAGIC), fmt.file_header(index_position, len(self._records), len(self._chunk_infos)))
