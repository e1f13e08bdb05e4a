"""The blocks of a compressed chunk that is cut off or damaged, as far as they can be read.

A block of LZ4 (LZ4 frame format 1.6.4, block format) gives its beginning, which no library returns. One of Zstandard
(RFC 8878) is read from its end backwards and gives nothing where it is cut, unless it is stored as it is; one of bzip2
gives nothing, as every byte of it depends on all others.
"""
import struct
from typing import Iterator

_MAGIC = b"\x04\x22\x4d\x18"
_HAS_DICTIONARY, _HAS_SIZE, _HAS_CHECKSUMS = 1, 8, 16
_IS_PLAIN = 1 << 31
_WINDOW = 1 << 16
"""Bytes that a block can refer back to."""
_LEAST_MATCH = 4
"""Bytes of the shortest match, which LZ4's format does not count."""
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_IS_ONE_BYTE = 1
"""Type of a Zstandard block that repeats one byte."""
_LARGEST_BLOCK = 1 << 17
_MOST_ODD = 16
"""Bytes of what is no frame that are passed on: enough for a library to refuse it."""


def cut_off_part(frame: bytes, before: bytes, most: int, is_cut: bool) -> bytes:
    """Return the bytes that the first block of a frame that no library unpacks gives up to the cut or damage.

    Bytes behind damage may be wrong: it is noticed where a block refers to what is not there.

    Args:
        frame: The frame, up to where it is cut off.
        before: Bytes that the blocks before give.
        most: Bytes at most.
        is_cut: The frame is cut off; else the block is damaged.
    """
    if frame[:4] != _MAGIC or len(frame) < 7:
        return b""
    flags = frame[4]
    number, is_within = divmod(len(before), 1 << (8 + 2 * (frame[5] >> 4 & 7)))
    at = 7 + 8 * bool(flags & _HAS_SIZE) + 4 * bool(flags & _HAS_DICTIONARY)
    while at + 4 <= len(frame):
        word = struct.unpack_from("<I", frame, at)[0]
        begin, size = at + 4, word & ~_IS_PLAIN
        if begin + size > len(frame) or not (is_cut or number or is_within):
            data = frame[begin:begin + size]
            return data[:most] if word & _IS_PLAIN else _decoded(data, before[-_WINDOW:], most)
        number -= 1
        at = begin + size + 4 * bool(flags & _HAS_CHECKSUMS)
    return b""


def _decoded(data: bytes, window: bytes, most: int) -> bytes:
    """Return what the sequences of a block give that are whole."""
    out = bytearray(window)
    end = len(window) + most
    at = 0

    def length(start: int) -> int:
        nonlocal at
        total = start
        while start == 15:
            total += data[at]
            at += 1
            if data[at - 1] != 255:
                break
        return total

    try:
        while at < len(data) and len(out) < end:
            token = data[at]
            at += 1
            literals = length(token >> 4)
            out += data[at:at + literals]
            at += literals
            back = data[at] | data[at + 1] << 8
            at += 2
            count = min(length(token & 15) + _LEAST_MATCH, max(end - len(out), 0))
            if not 0 < back <= len(out) or not count:
                break
            piece = bytes(out[len(out) - back:len(out) - back + count])
            out += (piece * (count // len(piece) + 1))[:count]
    except IndexError:  # the cut
        pass
    return bytes(out[len(window):end])


def zstd_blocks(frame: bytes) -> Iterator[bytes]:
    """Yield the head of a Zstandard frame, then its blocks, each of which unpacks to 128 KiB at most.

    A library that is given block by block returns all that lies before a damaged one. Bytes that are no blocks, or
    behind the last one, are yielded as they are.
    """
    if len(frame) < 6 or frame[:4] != _ZSTD_MAGIC:
        yield frame[:_MOST_ODD]
        return
    flags = frame[4]
    is_single = flags >> 5 & 1
    at = 6 - is_single + (0, 1, 2, 4)[flags & 3] + ((1 if is_single else 0), 2, 4, 8)[flags >> 6]
    yield frame[:at]
    is_last = False
    while not is_last and at + 3 <= len(frame):
        word = int.from_bytes(frame[at:at + 3], "little")
        is_last = bool(word & 1)
        size = 1 if word >> 1 & 3 == _IS_ONE_BYTE else word >> 3
        if size > _LARGEST_BLOCK:
            return
        yield frame[at:at + 3 + size]
        at += 3 + size
    if is_last and flags & 4:
        yield frame[at:at + 4]
