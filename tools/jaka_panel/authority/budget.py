"""How many messages a page may send."""


class Budget:
    """So many messages a second, and so many at once; more are too many."""

    def __init__(self, rate: float, burst: float, now: float) -> None:
        """rate: messages a second; burst: at once; now: monotonic time, s."""
        self._rate, self._burst = rate, burst
        self._left, self._at = burst, now

    def spend(self, now: float) -> bool:
        """Take one message from the budget; False where nothing is left."""
        self._left = min(self._burst, self._left + self._rate * (now - self._at))
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
