"""The clock of a playback: play, pause, seek, speed; a pure function of the time that it is given."""
from jaka_bag.units import NS_PER_S

LEAST_SPEED, MOST_SPEED = 0.01, 100.0
"""Log seconds in a second."""


class PlaybackClock:
    """A position between two log times, ns, which moves while it plays and nothing holds it.

    Args:
        begin: First log time, ns.
        end: Last log time, ns.
        speed: Log seconds in a second, from ``LEAST_SPEED`` to ``MOST_SPEED``; what is beyond is cut.
        is_playing: Begin to move at once.

    Attributes:
        begin: First log time, ns.
        end: Last log time, ns.
        speed: Log seconds in a second.
        is_playing: The position is to move.
        is_held: The position stands although it is to move.
    """

    def __init__(self, begin: int, end: int, speed: float = 1.0, is_playing: bool = True) -> None:
        self.begin = begin
        self.end = end
        self.speed = min(max(speed, LEAST_SPEED), MOST_SPEED)
        self.is_playing = is_playing
        self.is_held = False
        self._base = begin
        self._since = 0.0

    def position(self, now: float) -> int:
        """Return the log time, ns, at a moment of the monotonic clock, s."""
        if not self.is_playing or self.is_held:
            return self._base
        return min(self._base + int((now - self._since) * self.speed * NS_PER_S), self.end)

    def _anchor(self, now: float) -> None:
        self._base, self._since = self.position(now), now

    def seek(self, now: float, time: int) -> None:
        """Go to a log time, ns; what is outside of the log is cut."""
        self._base, self._since = min(max(time, self.begin), self.end), now

    def set(self, now: float, is_playing: bool, speed: float) -> None:
        """Play or pause from here on, at a speed."""
        self._anchor(now)
        self.is_playing = is_playing
        self.speed = min(max(speed, LEAST_SPEED), MOST_SPEED)

    def hold(self, now: float, is_held: bool) -> None:
        """Hold the position, or continue from it."""
        if is_held != self.is_held:
            self._anchor(now)
            self.is_held = is_held
