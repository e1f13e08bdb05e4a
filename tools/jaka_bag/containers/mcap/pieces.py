"""An MCAP file as a row of records, for those who look at its bytes and not at its messages; no numpy."""
import os
import struct
from typing import BinaryIO, Iterator, Tuple

from ...units import NS_PER_S
from .records import (
    ATTACHMENT,
    ATTACHMENT_INDEX,
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    METADATA,
    METADATA_INDEX,
    RECORD_HEAD,
    SCHEMA,
    STATISTICS,
    SUMMARY_OFFSET,
)

_RECORD_NAMES = {
    HEADER: "header", FOOTER: "footer", SCHEMA: "message definition", CHANNEL: "channel", MESSAGE: "message",
    CHUNK: "chunk", MESSAGE_INDEX: "message index", CHUNK_INDEX: "chunk index", ATTACHMENT: "attachment",
    ATTACHMENT_INDEX: "attachment index", STATISTICS: "statistics", METADATA: "metadata",
    METADATA_INDEX: "metadata index", SUMMARY_OFFSET: "summary offset", DATA_END: "end of the data"}
_SPAN = struct.Struct("<QQ")


def pieces(file: BinaryIO) -> Iterator[Tuple[int, int, str]]:
    """Yield each record up to the first that is cut off: first byte, size, kind; the file's position is changed."""
    size = os.fstat(file.fileno()).st_size
    yield 0, len(MAGIC), "magic bytes"
    at = len(MAGIC)
    while at + RECORD_HEAD.size <= size - len(MAGIC):
        file.seek(at)
        head = file.read(RECORD_HEAD.size + _SPAN.size)
        opcode, length = RECORD_HEAD.unpack_from(head)
        length += RECORD_HEAD.size
        if at + length > size:
            return
        what = _RECORD_NAMES.get(opcode, "record of kind %d" % opcode)
        if opcode == CHUNK and len(head) == RECORD_HEAD.size + _SPAN.size:
            start, end = _SPAN.unpack_from(head, RECORD_HEAD.size)
            what += " of the messages from %.3f to %.3f s" % (start / NS_PER_S, end / NS_PER_S)
        yield at, length, what
        at += length
