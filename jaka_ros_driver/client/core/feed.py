"""The status feed: bytes in, states out, and which of them tell of now.

Frames may have waited on their way: in this process while it was stopped, in the network, in the controller. Such
frames come faster than the controller makes them. After a silence frames are therefore old news until they come in
their own rhythm again, unless all that were made meanwhile have come at once.
"""
from collections import deque
from dataclasses import dataclass
from typing import Deque, List, Optional, Tuple

from jaka_ros_driver.errors import FramingError, StatusFrameError
from jaka_ros_driver.protocol.framing import FrameStream
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.state import RobotState

MAX_BURST = 5
"""Of the frames that arrive in one piece so many, the newest, are shown as new: the others are old news."""
SILENCE_S = 0.15
"""s; a longer pause in a feed that is otherwise faster puts what follows in doubt.

After a shorter one all that has waited arrives in one piece, and the newest frames of that are new indeed.
"""
_SHORTEST_PERIOD_S = 0.004
"""s; no controller makes frames faster, so that shorter intervals are those of frames that waited."""
_MISSING_S = 0.05
"""s; after a pause frames of so long a time may be missing: they were not made, or are still on their way."""
_RATE_WINDOW = 250
_USUAL_WINDOW = 9
_TICK_S = 1e-6


@dataclass(frozen=True)
class FeedHealth:
    """How the status feed does.

    Attributes:
        rate: Frames a second over the last two seconds or so, Hz; 0 while there is no feed.
        jitter: 99th percentile of the deviation of the interval from its median, s.
        age: Time since the newest good frame, s; infinite before the first.
        frames: Good frames since start.
        damaged: Frames refused since start.
        last_damage: Why the last one was refused.
    """

    rate: float
    jitter: float
    age: float
    frames: int
    damaged: int
    last_damage: str


class Feed:
    """Keeps the newest state that is not old news.

    Attributes:
        state: That state, however old; None before the first.
        last_byte_at: When the port last sent anything, s.
    """

    def __init__(self, period: float) -> None:
        """``period``: how often the controller was asked for a frame, s."""
        self._period = period
        self._stream = FrameStream()
        self._arrivals: Deque[float] = deque(maxlen=_RATE_WINDOW)
        self._intervals: Deque[float] = deque(maxlen=_USUAL_WINDOW)
        self._last_piece: Optional[float] = None
        self._last_arrival = 0.0
        self._is_doubtful = False
        self._was_held_up = False
        self._missing = 0.0
        self._frames = 0
        self._damaged = 0
        self._last_damage = ""
        self.state: Optional[RobotState] = None
        self.last_byte_at = 0.0

    def open(self, now: float) -> None:
        """A new connection: what it sends is new."""
        self._stream = FrameStream()
        self._arrivals.clear()
        self._intervals.clear()
        self._last_piece = None
        self._is_doubtful = self._was_held_up = False
        self._missing = 0.0
        self.last_byte_at = now

    def held_up(self) -> None:
        """Nobody read for a while: what has piled up is old news."""
        self._was_held_up = True

    def received(self, data: bytes, now: float) -> List[Tuple[RobotState, bool]]:
        """Take bytes of the port; returns the states that they complete, and whether each tells of now."""
        self.last_byte_at = now
        states: List[RobotState] = []
        for item in self._stream.feed(data):
            try:
                if isinstance(item, FramingError):
                    raise item
                self._last_arrival = max(now, self._last_arrival + _TICK_S)
                states.append(parse_status(item, self._last_arrival))
            except (FramingError, StatusFrameError) as error:
                self._damaged += 1
                self._last_damage = str(error)
        if not states:
            return []
        new = self._count_new(len(states), now)
        self._frames += len(states)
        if new:
            self.state = states[-1]
            self._arrivals.extend([state.received_at for state in states])
        oldest_new = len(states) - new
        return [(state, index >= oldest_new) for index, state in enumerate(states)]

    def fresh_state(self, max_age: float, now: float) -> Optional[RobotState]:
        """The newest state, or None when it is older than ``max_age`` s."""
        state = self.state
        return None if state is None or now - state.received_at > max_age else state

    def health(self, now: float, silence_timeout: float) -> FeedHealth:
        """Rate, jitter and damage."""
        age = now - self.state.received_at if self.state is not None else float("inf")
        rate = jitter = 0.0
        if len(self._arrivals) > 2 and age < silence_timeout:
            arrivals = list(self._arrivals)
            intervals = sorted([b - a for a, b in zip(arrivals, arrivals[1:])])
            rate = len(intervals) / max(1e-9, arrivals[-1] - arrivals[0])
            median = intervals[len(intervals) // 2]
            deviations = sorted([abs(interval - median) for interval in intervals])
            jitter = deviations[int(0.99 * (len(deviations) - 1))]
        return FeedHealth(rate, jitter, age, self._frames, self._damaged, self._last_damage)

    def _count_new(self, count: int, now: float) -> int:
        """How many of the frames of a piece, that arrives now, tell of now: the newest so many.

        After a pause the newest one does, where nothing was in doubt before and nearly all frames have come that were
        made since. A doubt ends with a piece before which the port was silent for half a period for each of its frames:
        what has piled up anywhere comes without such pauses.
        """
        last, self._last_piece = self._last_piece, now
        was_held_up, self._was_held_up = self._was_held_up, False
        if last is None:
            self._is_doubtful = was_held_up
            return 0 if was_held_up else MAX_BURST
        interval = now - last
        usual = sorted(self._intervals)[len(self._intervals) // 2] if self._intervals else self._period
        if interval >= _SHORTEST_PERIOD_S:
            self._intervals.append(interval)
        period = min(self._period, usual)
        self._missing = max(0.0, self._missing + interval - count * period)
        if was_held_up or interval > max(SILENCE_S, 3.0 * usual):
            self._is_doubtful = self._is_doubtful or self._missing > _MISSING_S
            return 0 if self._is_doubtful else 1
        if interval >= max(_SHORTEST_PERIOD_S, 0.5 * period) * count:
            self._is_doubtful = False
            if interval <= 3.0 * usual:
                self._missing = 0.0
        return 0 if self._is_doubtful else MAX_BURST
