"""Messages of CDR that rosbag2 compressed one by one, its mode MESSAGE."""
from typing import TYPE_CHECKING

from ..errors import BagFormatError
from .compression import check_chunk, decompress
from .index import ZSTD

if TYPE_CHECKING:  # sizes are read without numpy
    from ..messages.batch import MessageBatch

HEAD = 18
"""Bytes of the longest head of a compressed message."""


def unpacked_size(head: bytes) -> int:
    """Return the size, byte, that a compressed message's head tells; -1 where it tells none."""
    import zstandard
    try:
        return int(zstandard.frame_content_size(head))
    except zstandard.ZstdError:
        return -1


def unpacked(data: bytes) -> bytes:
    """Return a message of CDR, which may be compressed.

    Raises:
        BagFormatError: It is damaged.
        LimitReached: It claims too much.
    """
    if not data.startswith(ZSTD):
        return data
    size = unpacked_size(data)
    if size < 0:
        raise BagFormatError("a compressed message is damaged")
    return bytes(decompress("zstd", data, size))


def may_be_packed(batch: "MessageBatch") -> bool:
    """Return whether the first byte of a message of CDR is that of a compressed one."""
    return bool((batch.data[batch.start[batch.length > 0]] == ZSTD[0]).any())


def plain(batch: "MessageBatch") -> "MessageBatch":
    """Return messages of CDR, those unpacked that are compressed; raises as ``unpacked``."""
    from ..messages.batch import with_payloads

    made = []
    total = 0
    for begin, size in zip(batch.start.tolist(), batch.length.tolist()):
        made.append(unpacked(batch.data[begin:begin + size].tobytes()))
        total += len(made[-1])
        check_chunk(total, len(batch.data))
    return with_payloads(batch, made)
