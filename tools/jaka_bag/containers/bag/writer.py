"""Writes ROS bags, version 2.0, chunk by chunk with flat memory: single messages or blocks."""
from typing import BinaryIO, Dict, List, NamedTuple, Optional, Tuple, Union

import numpy as np

from ...errors import BagError
from ...messages.batch import Array, Block, copy_pieces, distinct, windows
from ...messages.connection import Connection
from ...paths import PathLike
from ...units import NS_PER_S
from ..compression import BAG_CODECS, check_codec, compressor
from ..writer import ChunkWriter
from . import records as fmt

_HEAD_TYPE = np.dtype([("header_size", "<u4"), ("size1", "<u4"), ("name1", "S5"), ("connection", "<u4"),
                       ("size2", "<u4"), ("name2", "S3"), ("op", "u1"), ("size3", "<u4"), ("name3", "S5"),
                       ("seconds", "<u4"), ("nanoseconds", "<u4"), ("data_size", "<u4")])
_HEAD_SIZE = _HEAD_TYPE.itemsize
_HEAD = np.array([(38, 9, b"conn=", 0, 4, b"op=", fmt.OP_MESSAGE, 13, b"time=", 0, 0, 0)], _HEAD_TYPE)
_ENTRY_TYPE = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
_MAX_CHUNK = 0xFFFFFFFF


class EncodedChunk(NamedTuple):
    """One chunk ready to be written: its record in two parts, its indexes, totals, connections declared in it."""

    head: bytes
    body: bytes
    indexes: List[bytes]
    counts: Dict[int, int]
    start_time: int
    end_time: int
    declared: Tuple[int, ...]


def _records_of(block: Block, number: Array, seconds: Array, nanoseconds: Array,
                prefix: bytes) -> Tuple[Array, Array]:
    """Message records of a block behind ``prefix``, and where each starts."""
    size = block.length + _HEAD_SIZE
    offset = np.cumsum(size) - size + len(prefix)
    data = np.empty(len(prefix) + int(size.sum()), np.uint8)
    data[:len(prefix)] = np.frombuffer(prefix, np.uint8)
    heads = np.repeat(_HEAD, len(block))
    heads["connection"] = number
    heads["seconds"] = seconds
    heads["nanoseconds"] = nanoseconds
    heads["data_size"] = block.length
    windows(data, _HEAD_SIZE)[offset] = heads.view("V%d" % _HEAD_SIZE)
    copy_pieces(block.data, block.start, data, offset + _HEAD_SIZE, block.length)
    return data, offset


class BagWriter(ChunkWriter):
    """A ROS bag being written; nothing of the final name exists before ``close``.

    Args:
        target: Final path, or an open binary file that can seek (which is neither renamed nor closed).
        compression: ``none``, ``lz4`` or ``bz2``.
        level: The codec's level; None for its default.
        chunk_size: Single messages are collected up to this many bytes before a chunk is closed.
        overwrite: Replace an existing file.
        suffix: What the working name has more than the final one.
        keep_leftover: Refuse to take over the working file of a killed program.
        profile: A .bag has no place for it.

    Raises:
        BagError: The compression is not the format's, or the output cannot be created.
    """

    def __init__(self, target: Union[PathLike, BinaryIO], compression: str = "none", level: Optional[int] = None,
                 chunk_size: int = 768 * 1024, overwrite: bool = False, suffix: str = ".part",
                 keep_leftover: bool = False, profile: str = "ros1") -> None:
        check_codec(compression, BAG_CODECS, "a .bag")
        self._codec = compression
        self._compress = compressor(compression, level, for_bag=True)
        self._channels: Dict[Connection, int] = {}
        self._records: List[bytes] = []
        self._undeclared: Tuple[int, ...] = ()
        self._chunk_infos: List[bytes] = []
        super().__init__(target, chunk_size, overwrite, suffix, keep_leftover)
        self._write(fmt.MAGIC, fmt.file_header(0, 0, 0))

    def add_channel(self, connection: Connection) -> int:
        """Number of a connection in this file; see ``ChunkWriter.add_channel``.

        Raises:
            BagError: The messages are not ROS 1 messages.
        """
        if connection.encoding != "ros1":
            raise BagError("%s is encoded as %s: a .bag holds ROS 1 messages only"
                           % (connection.topic, connection.encoding))
        known = self._channels.get(connection)
        if known is None:
            known = len(self._channels)
            self._records.append(fmt.connection_record(known, connection))
            self._channels[connection] = known
            self._undeclared += (known,)
        return known

    def encode(self, block: Block, channel_ids: Array) -> Optional[EncodedChunk]:
        """Make a chunk of a block (None where it has no message); see ``ChunkWriter.encode``.

        The first chunk behind a new connection carries its record: ``rosbag reindex`` needs it there.
        """
        if not len(block):
            return None
        declared = self._undeclared
        number = channel_ids[block.connection]
        unsigned = block.log_time.view(np.uint64)
        seconds, nanoseconds = np.divmod(unsigned, np.uint64(NS_PER_S))
        if int(seconds.max()) > fmt.MAX_SECONDS:
            raise BagError("a message time of %d s does not fit into a .bag" % int(seconds.max()))
        prefix = b"".join(self._records[i] for i in declared)
        if len(prefix) + int(block.length.sum()) + len(block) * _HEAD_SIZE > _MAX_CHUNK:
            raise BagError("a chunk is too large for a .bag")
        data, offset = _records_of(block, number, seconds, nanoseconds, prefix)
        entries = np.empty(len(block), _ENTRY_TYPE)
        entries["seconds"] = seconds
        entries["nanoseconds"] = nanoseconds
        entries["offset"] = offset
        indexes, counts = [], {}
        for connection in distinct(number).tolist():
            which = np.flatnonzero(number == connection)
            times = unsigned[which]
            if (times[1:] < times[:-1]).any():
                which = which[np.argsort(times, kind="stable")]
            indexes.append(fmt.index_record(connection, len(which), entries[which].tobytes()))
            counts[connection] = len(which)
        body = self._compress(data.data)
        return EncodedChunk(fmt.chunk_head(self._codec, len(data), len(body)), body, indexes, counts,
                            int(unsigned.min()), int(unsigned.max()), declared)

    def append(self, chunk: Optional[EncodedChunk]) -> None:
        """Write an encoded chunk (None: nothing) after what was written so far.

        Raises:
            WriteFailed: The system refused.
        """
        if chunk is None:
            return
        begin = self._write(chunk.head, chunk.body, *chunk.indexes)
        self._undeclared = tuple(i for i in self._undeclared if i not in chunk.declared)
        self._chunk_infos.append(fmt.chunk_info_record(
            fmt.ChunkInfo(begin, chunk.start_time, chunk.end_time, chunk.counts)))
        self.message_count += sum(chunk.counts.values())

    def _finish(self) -> None:
        index_position = self.position
        self._write(*(self._records + self._chunk_infos))
        self._rewrite(len(fmt.MAGIC), fmt.file_header(index_position, len(self._records), len(self._chunk_infos)))
