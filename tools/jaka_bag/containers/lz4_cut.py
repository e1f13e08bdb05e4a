"""The beginning of an LZ4 block that is cut off (LZ4 frame format 1.6.4, block format), which no library gives."""
import struct

_MAGIC = b"\x04\x22\x4d\x18"
_HAS_DICTIONARY, _HAS_SIZE, _HAS_CHECKSUMS = 1, 8, 16
_IS_PLAIN = 1 << 31
_WINDOW = 1 << 16
"""Bytes that a block can refer back to."""
_LEAST_MATCH = 4


def cut_off_part(frame: bytes, before: bytes, most: int) -> bytes:
    """Return the bytes that the last block of a cut-off frame gives up to the cut.

    Args:
        frame: The frame, up to where it is cut off.
        before: Bytes that its whole blocks give.
        most: Bytes at most.
    """
    if frame[:4] != _MAGIC or len(frame) < 7:
        return b""
    flags = frame[4]
    at = 7 + 8 * bool(flags & _HAS_SIZE) + 4 * bool(flags & _HAS_DICTIONARY)
    while at + 4 <= len(frame):
        word = struct.unpack_from("<I", frame, at)[0]
        begin, size = at + 4, word & ~_IS_PLAIN
        if begin + size > len(frame):
            data = frame[begin:]
            return data[:most] if word & _IS_PLAIN else _decoded(data, before[-_WINDOW:], most)
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
            if not 0 < back <= len(out):
                break
            piece = bytes(out[len(out) - back:len(out) - back + count])
            out += (piece * (count // len(piece) + 1))[:count]
    except IndexError:  # the cut
        pass
    return bytes(out[len(window):end])
