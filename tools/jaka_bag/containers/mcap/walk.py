"""The index of an MCAP that has no usable summary, from a walk over its records."""
from typing import Dict, List, Optional

import numpy as np

from ...errors import BagFormatError
from ...messages.connection import Connection
from ...paths import PathLike
from ..index import AttachmentIndex, ChunkRef, LogIndex, MetadataIndex, read_at
from . import records as fmt
from .chunk import Parsed, scan
from .reader import read_chunk

_WINDOW = 1 << 20
LOOSE = (fmt.SCHEMA, fmt.CHANNEL, fmt.MESSAGE)


class Walk:
    """What a walk over an MCAP has found so far.

    Attributes:
        schemas: Types by id.
        connections: Channels by number, in the order found.
        numbers: Channel id to number.
        chunks: Chunks and stretches of loose records.
        counts: Messages by channel id.
        start_time: Earliest log time, ns.
        end_time: Latest log time, ns.
    """

    def __init__(self) -> None:
        self.schemas: Dict[int, fmt.Schema] = {}
        self.connections: List[Connection] = []
        self.numbers: Dict[int, int] = {}
        self.chunks: List[ChunkRef] = []
        self.counts: Dict[int, int] = {}
        self.start_time: Optional[int] = None
        self.end_time: Optional[int] = None

    def learn(self, parsed: Parsed) -> None:
        """Take up the types and channels that a stretch of records declares."""
        self.schemas.update(parsed.schemas)
        for channel, connection in parsed.connections.items():
            if channel not in self.numbers:
                self.numbers[channel] = len(self.connections)
                self.connections.append(connection)

    def add(self, position: int, end: int, parsed: Parsed, is_loose: bool) -> None:
        """Take up a chunk or a stretch of loose records."""
        self.learn(parsed)
        block = parsed.block
        if not len(block):
            return
        channels, counts = np.unique(block.connection, return_counts=True)
        unknown = set(channels.tolist()) - self.numbers.keys()
        if unknown:
            raise BagFormatError("messages of channel %d, which is not described" % min(unknown))
        for channel, count in zip(channels.tolist(), counts.tolist()):
            self.counts[channel] = self.counts.get(channel, 0) + count
        first, last = int(block.log_time.min()), int(block.log_time.max())
        self.start_time = first if self.start_time is None else min(self.start_time, first)
        self.end_time = last if self.end_time is None else max(self.end_time, last)
        by_number = {self.numbers[c]: n for c, n in zip(channels.tolist(), counts.tolist())}
        self.chunks.append(ChunkRef(position, end, first, last, by_number, is_loose))


def record_end(descriptor: int, position: int, size: int) -> int:
    """Where the record at a position ends.

    Raises:
        BagFormatError: It is cut off.
    """
    head = read_at(descriptor, position, fmt.RECORD_HEAD.size)
    if len(head) == fmt.RECORD_HEAD.size:
        end = position + fmt.RECORD_HEAD.size + int(fmt.RECORD_HEAD.unpack(head)[1])
        if end <= size:
            return end
    raise BagFormatError("a record at byte %d is cut off (jaka_bag recover keeps the rest)" % position)


def chunk_region_end(descriptor: int, position: int, size: int) -> int:
    """Where a chunk and the message indexes behind it end.

    Raises:
        BagFormatError: The chunk is cut off.
    """
    end = record_end(descriptor, position, size)
    while read_at(descriptor, end, 1) == bytes([fmt.MESSAGE_INDEX]):
        try:
            end = record_end(descriptor, end, size)
        except BagFormatError:
            break
    return end


def read_loose(descriptor: int, position: int, size: int, schemas: Dict[int, fmt.Schema]) -> Parsed:
    """Loose records from a position on, as many as fit into a window, but at least one.

    Raises:
        BagFormatError: The first one is cut off.
    """
    length = max(_WINDOW, record_end(descriptor, position, size) - position)
    return scan(read_at(descriptor, position, length), schemas, is_loose=True)


def walk_index(path: PathLike, descriptor: int, size: int, profile: str, library: str, begin: int) -> LogIndex:
    """The index of an MCAP without a usable summary.

    Raises:
        BagFormatError: The file is damaged.
    """
    walk = Walk()
    attachments: List[AttachmentIndex] = []
    metadata: List[MetadataIndex] = []
    at = begin
    while at < size:
        opcode = read_at(descriptor, at, 1)[0]
        if opcode == fmt.DATA_END or opcode == fmt.FOOTER:
            break
        if opcode == fmt.CHUNK:
            end = chunk_region_end(descriptor, at, size)
            walk.add(at, end, read_chunk(read_at(descriptor, at, end - at), walk.schemas), False)
        elif opcode in LOOSE:
            parsed = read_loose(descriptor, at, size, walk.schemas)
            if not parsed.consumed:
                raise BagFormatError("the record at byte %d is damaged (jaka_bag recover keeps the rest)" % at)
            end = at + parsed.consumed
            walk.add(at, end, parsed, True)
        else:
            end = record_end(descriptor, at, size)
            if opcode == fmt.METADATA:
                metadata.append(MetadataIndex(at, end - at, _metadata_name(read_at(descriptor, at, end - at))))
            elif opcode == fmt.ATTACHMENT:
                attachments.append(attachment_index_of(read_at(descriptor, at, end - at), at))
        at = end
    counts = [0] * len(walk.connections)
    for channel, count in walk.counts.items():
        counts[walk.numbers[channel]] = count
    return LogIndex("mcap", "0", str(path), size, walk.connections, walk.numbers, walk.chunks, counts,
                    walk.start_time, walk.end_time, profile, library, tuple(attachments), tuple(metadata))


def _metadata_name(raw: bytes) -> str:
    return fmt.Cursor(raw, fmt.RECORD_HEAD.size).text()


def attachment_index_of(raw: bytes, position: int) -> AttachmentIndex:
    """The index entry of an attachment record.

    Raises:
        BagFormatError: It is damaged.
    """
    cursor = fmt.Cursor(raw, fmt.RECORD_HEAD.size)
    log_time, create_time = cursor.unpack("QQ")
    name, media_type = cursor.text(), cursor.text()
    return AttachmentIndex(position, len(raw), log_time, create_time, cursor.number("Q"), name, media_type)
