"""The positions where the arm may be while it is streamed: near something that it was sent a moment ago.

A controller whose frames come late may go on by itself, and then ignore frames that lie too far behind it for one cycle
(docs/controller-protocol.md section 5.6.5): nothing in the stream would ever bring it back. Only the status feed
reveals that.
"""
from collections import deque
from typing import Deque, List, NamedTuple, Sequence

_WINDOW_S = 1.0
"""Time, s, for which sent positions count: longer than a controller's queue and filters lag behind."""
_BUCKET_S = 0.1
"""Length, s, of a piece whose extent is kept as one; shorter pieces cost time and memory for the same extent."""


class _Extent(NamedTuple):
    since: float
    low: List[float]
    high: List[float]


class ServoTrace:
    """The extent of the positions sent lately, coordinate by coordinate; it has no clock."""

    def __init__(self, window_s: float = _WINDOW_S, bucket_s: float = _BUCKET_S) -> None:
        """Remember what was sent within the last ``window_s``, in pieces of ``bucket_s``."""
        self._window, self._bucket = window_s, bucket_s
        self._extents: Deque[_Extent] = deque()

    def sent(self, point: Sequence[float], now: float) -> None:
        """Add a point that was sent at this time, s."""
        if not self._extents or now - self._extents[-1].since > self._bucket:
            self._extents.append(_Extent(now, list(point), list(point)))
            while now - self._extents[0].since > self._window + self._bucket:
                self._extents.popleft()
            return
        _, low, high = self._extents[-1]
        for index, value in enumerate(point):
            if value < low[index]:
                low[index] = value
            elif value > high[index]:
                high[index] = value

    def excess(self, point: Sequence[float]) -> float:
        """Return the distance of the point from that extent, in its farthest coordinate; 0 inside, and before the
        first.
        """
        return max(self.excesses(point))

    def excesses(self, point: Sequence[float]) -> List[float]:
        """Return the distance from that extent for each coordinate."""
        extents = list(self._extents)
        if not extents:
            return [0.0] * len(point)
        return [max(0.0, min([e.low[i] for e in extents]) - value, value - max([e.high[i] for e in extents]))
                for i, value in enumerate(point)]
