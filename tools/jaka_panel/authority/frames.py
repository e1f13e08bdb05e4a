"""WebSocket frames in a stream of bytes, counted before anything reads them (RFC 6455, section 5.2)."""
from typing import NamedTuple, Optional

_LENGTHS = {126: 2, 127: 8}
"""Bytes of the extended length by the 7-bit length that announces it."""


class FrameHead(NamedTuple):
    """The head of a frame: bytes of the whole frame and of its payload, and whether a message goes on behind it."""

    size: int
    payload: int
    is_control: bool
    is_last: bool


class FrameCounter:
    """A count of the frames in a stream, wherever TCP has cut it.

    Attributes:
        unfinished: Bytes of the message whose last fragment has not come.
    """

    def __init__(self) -> None:
        self.unfinished = 0
        self._rest = b""
        self._skip = 0

    def feed(self, data: bytes) -> int:
        """Take bytes as they come; return how many frames begin in them."""
        data = self._rest + data
        at, frames = self._skip, 0
        while True:
            frame = _frame(data, at)
            if frame is None:
                break
            frames += 1
            at += frame.size
            if not frame.is_control:
                self.unfinished = 0 if frame.is_last else self.unfinished + frame.payload
        self._rest, self._skip = data[at:], max(0, at - len(data))
        return frames


def _frame(data: bytes, at: int) -> Optional[FrameHead]:
    """Read the head of the frame that begins at ``at``; return None where it is not whole."""
    if len(data) < at + 2:
        return None
    first, second = data[at], data[at + 1]
    payload = second & 0x7F
    head = 2 + _LENGTHS.get(payload, 0)
    if len(data) < at + head:
        return None
    if head > 2:
        payload = int.from_bytes(data[at + 2:at + head], "big")
    return FrameHead(head + (4 if second & 0x80 else 0) + payload, payload, bool(first & 0x08), bool(first & 0x80))
