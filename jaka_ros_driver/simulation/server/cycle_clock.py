"""The deadlines of cycles and status frames on the wall clock, and how late they were. It has no clock of its own."""
import math
from collections import deque
from typing import Deque, Dict

from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S

MIN_TICK_S = 0.002
"""Shortest time, s, between two wake-ups; with a high time scale, several cycles are run at each."""
MIN_FEED_PERIOD_S = 0.004
"""Shortest wall time, s, between two status frames, whatever the time scale."""
_MAX_LAG_S = 0.25
"""Lateness, s, above which missed cycles are left out: made up for, they would be a burst of frames."""
_SAMPLES = 7500
"""Cycles whose lateness is kept: those of a minute."""
_SAME_MOMENT_S = 1e-6
"""Rounding, s, of sums of cycles: far below a cycle (8 ms), far above what floats lose in a day."""


class CycleClock:
    """The absolute deadlines of cycles and frames: a late cycle does not delay those that follow."""

    def __init__(self, time_scale: float, now: float) -> None:
        self._scale = time_scale
        self._tick = max(CYCLE_TIME_S / time_scale, MIN_TICK_S)
        self._late: Deque[float] = deque(maxlen=_SAMPLES)
        self._lags = 0
        self._feed_period = 0.0
        self.restart(now)

    def restart(self, now: float) -> None:
        """Begin anew after a time without cycles."""
        self._origin = now
        self._ticks = 0
        self._cycles = 0
        self.next_tick = now + self._tick
        self.next_frame = self.next_tick

    def due_cycles(self, now: float) -> int:
        """Return the number of cycles to run now; 0 before the next tick."""
        late = now - self.next_tick
        if late < 0.0:
            return 0
        self._late.append(late)
        if late > _MAX_LAG_S:
            self._lags += 1
            self.restart(now)
            return 1
        self._ticks += 1 + int(late / self._tick)
        reached = math.floor(self._ticks * self._tick * self._scale / CYCLE_TIME_S + _SAME_MOMENT_S)
        cycles, self._cycles = reached - self._cycles, reached
        self.next_tick = self._origin + (self._ticks + 1) * self._tick
        return cycles

    def due_frames(self, now: float, period: float) -> int:
        """Return the number of frames to send now, one for each period of the feed, s of simulated time.

        now: wall clock, s. After a standstill of the computer it is one, as with cycles.
        """
        wall_period = max(period / self._scale, MIN_FEED_PERIOD_S)
        if wall_period != self._feed_period:
            self._feed_period = wall_period
            self.next_frame = self.next_tick
        if now < self.next_frame - _SAME_MOMENT_S:
            return 0
        late = max(0.0, now - self.next_frame)
        due = 1 + int(late / wall_period)
        self.next_frame += due * wall_period
        return due if late <= _MAX_LAG_S else 1

    def lateness(self) -> Dict[str, float]:
        """Return the lateness of the cycles of the last minute, s.

        ``lags``: restarts after the host stood still.
        """
        late = sorted(self._late) or [0.0]
        return {"cycles": len(self._late), "median_s": late[len(late) // 2], "p99_s": late[int(0.99 * (len(late) - 1))],
                "max_s": late[-1], "lags": self._lags}
