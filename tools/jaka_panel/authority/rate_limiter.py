"""The limit on how much a peer may send."""


class RateLimiter:
    """A rate limiter: an amount a second, and an amount at once; what exceeds them is refused."""

    def __init__(self, rate: float, burst: float, now: float) -> None:
        """Begin with the full burst.

        Args:
            rate: Messages, frames or bytes a second.
            burst: As many at once.
            now: Monotonic time, s.
        """
        self._rate, self._burst = rate, burst
        self._left, self._at = burst, now

    def spend(self, now: float, amount: float = 1.0) -> bool:
        """Count an amount; return False where it exceeds the rate."""
        self._left = min(self._burst, self._left + self._rate * (now - self._at))
        self._at = now
        if self._left < amount:
            return False
        self._left -= amount
        return True
