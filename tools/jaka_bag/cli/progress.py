"""A progress bar with rate and time left, for terminals."""
import time
from typing import Optional, TextIO

_INTERVAL_S = 0.1
_WIDTH = 24


class Progress:
    """Shows how far a task is; a stream of None stays silent.

    Args:
        total: Bytes to be worked on.
        name: What is worked on.
        stream: Where to draw.
    """

    def __init__(self, total: int, name: str, stream: Optional[TextIO]) -> None:
        self._total = max(total, 1)
        self._name = name[-32:]
        self._stream = stream
        self._begin = self._drawn = time.monotonic()
        self._bytes = self._messages = 0
        self._line = 0

    def __call__(self, size: int, messages: int) -> None:
        """Some bytes and messages more are done."""
        if self._stream is None:
            return
        self._bytes += size
        self._messages += messages
        now = time.monotonic()
        if now - self._drawn >= _INTERVAL_S:
            self._drawn = now
            self._draw(max(now - self._begin, 1e-6))

    def _draw(self, elapsed_s: float) -> None:
        assert self._stream is not None
        share = min(self._bytes / self._total, 1.0)
        left_s = int(elapsed_s * (1 - share) / max(share, 1e-6))
        line = "%s [%-*s] %3.0f %%  %.1f MB/s  %.0f msg/s  %d:%02d left" % (
            self._name, _WIDTH, "#" * int(share * _WIDTH), share * 100, self._bytes / elapsed_s / 1e6,
            self._messages / elapsed_s, left_s // 60, left_s % 60)
        self._stream.write("\r" + line.ljust(self._line))
        self._stream.flush()
        self._line = len(line)

    def close(self) -> None:
        """Remove the bar."""
        if self._stream is not None and self._line:
            self._stream.write("\r" + " " * self._line + "\r")
            self._stream.flush()
            self._line = 0

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
