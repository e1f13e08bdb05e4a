"""The limit on log lines that anybody on the network can cause."""
import logging
import time

from ..authority.rate_limiter import RateLimiter

_NAMES = ("aiohttp.server", "aiohttp.web", "aiohttp.websocket", "asyncio") + tuple(
    "jaka_panel.pages." + name for name in ("door", "hub", "peer", "websocket_session"))
_RATE, _BURST = 0.2, 20.0


class LogLimit(logging.Filter):
    """A filter that passes 20 lines at once and one in 5 s, and counts what it leaves out."""

    def __init__(self) -> None:
        super().__init__()
        self._limiter = RateLimiter(_RATE, _BURST, time.monotonic())
        self._left_out = 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line is written; the next one that is says how many were not."""
        if not self._limiter.spend(time.monotonic()):
            self._left_out += 1
            return False
        if self._left_out:
            record.msg = "%s (%d lines before were left out)" % (record.msg, self._left_out)
            self._left_out = 0
        return True


def limit_lines() -> None:
    """Limit the lines of the loggers that write about what peers do."""
    limit = LogLimit()
    for name in _NAMES:
        logging.getLogger(name).addFilter(limit)
