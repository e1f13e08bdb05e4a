"""The limit on how many messages a page may send."""


class RateLimiter:
    """A rate limiter: a number of messages a second, and a number at once; what exceeds them is refused."""

    def __init__(self, rate: float, burst: float, now: float) -> None:
        """Begin with the full burst.

        Args:
            rate: Messages a second.
            burst: Messages at once.
            now: Monotonic time, s.
        """
        self._rate, self._burst = rate, burst
        self._left, self._at = burst, now

    def spend(self, now: float) -> bool:
        """Count one message; return False where it exceeds the rate."""
        self._left = min(self._burst, self._left + self._rate * (now - self._at))
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
