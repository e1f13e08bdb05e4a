"""The status feed: bytes in, states out, and which of them show the present.

Frames may have waited on their way: in this process while it was stopped, in the network, in the controller. Such
frames come faster than the controller makes them. After a silence frames are therefore old news until they come in
their own rhythm again, unless all that were made meanwhile have come at once.

A feed that falls behind without a silence owes frames: those of its period that have not come. Arrivals alone do not
show whether the link is slow or the controller makes frames more slowly than it says; ``Witness`` does.
"""
from collections import deque
from dataclasses import dataclass
from typing import Callable, Deque, List, Optional, Tuple

from jaka_ros_driver.errors import FramingError, StatusFrameError
from jaka_ros_driver.protocol.framing import FrameStream
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.protocol.steady_arrays import SteadyArrays
from jaka_ros_driver.state import RobotState

MAX_BURST = 5
"""Most frames of one piece that count as new, the newest ones: the others are old news."""
SILENCE_S = 0.15
"""Longest pause, s, in a feed that is otherwise faster, that does not put the following frames in doubt.

After a shorter one all that has waited arrives in one piece, and the newest frames of that are new indeed.
"""
_SHORTEST_PERIOD_S = 0.004
"""Shortest period, s, at which a controller makes frames; shorter intervals are those of frames that waited."""
_MISSING_S = 0.05
"""Missing frames, s, after a pause, that are tolerated: they were not made, or are still on their way."""
_RATE_WINDOW = 250
"""Frames from which rate and jitter are computed: 2 s at 125 Hz."""
_USUAL_WINDOW = 9
"""Intervals whose median is the usual one: five frames show a new rhythm, and four odd ones change nothing."""
_TICK_S = 1e-6
"""Shortest time, s, between the arrivals of two frames: of those read at once, too, each is later than the last."""
_CLOCKS_DIFFER = 0.015
"""Share by which a feed may be slower than its period, for good: clocks differ, and a controller counts in cycles."""
_SLOWER_BY_NATURE = 1.5
"""Factor above which a rhythm slower than the period is a controller's that does not keep to it, unless it once did."""
_MEAN_SHARE = 0.02
"""Share of a frame in the mean interval, which so follows the last fifty."""
_RHYTHM_FRAMES = 100
"""Frames after which the mean shows the rhythm of a connection."""
LONGEST_DEBT_S = 0.45
"""Missing frames, s, above which a feed is taken for old, where no witness shows that it is not."""
_REFUTED_DEBT_S = 1.0
"""Missing frames, s, above which a feed that is not old is made at the rhythm at which it comes."""


@dataclass(frozen=True)
class FeedHealth:
    """The state of the status feed.

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
    """The receiver of the status feed, which keeps the newest state that is not old news.

    Attributes:
        state: That state, however old; None before the first.
        last_byte_at: When the port last sent anything, s.
        owed: Frames of so long a time have not come on this connection, s, silences left out.
    """

    def __init__(self, period: float) -> None:
        """Set up without a connection.

        period: The period, s, that the controller was asked for.
        """
        self._period = period
        self._due_period: Optional[float] = None
        self._mean = 0.0
        self._counted = 0
        self._keeps_period = False
        self._is_given_up = False
        self.owed = 0.0
        self._stream = FrameStream(parse=SteadyArrays().parse)
        self._arrivals: Deque[float] = deque(maxlen=_RATE_WINDOW)
        self._intervals: Deque[float] = deque(maxlen=_USUAL_WINDOW)
        self._opened_at = 0.0
        self._last_piece: Optional[float] = None
        self._last_arrival = 0.0
        self._is_doubtful = False
        self._was_held_up = False
        self._was_steady = False
        self._missing = 0.0
        self._frames = 0
        self._damaged = 0
        self._last_damage = ""
        self.state: Optional[RobotState] = None
        self.last_byte_at = 0.0

    def open(self, now: float) -> None:
        """Begin with a new connection: what it sends soon is new."""
        self._opened_at = now
        self._stream = FrameStream(parse=SteadyArrays().parse)
        self._arrivals.clear()
        self._intervals.clear()
        self._last_piece = None
        self._is_doubtful = self._was_held_up = self._was_steady = False
        self._missing = self.owed = 0.0
        self._counted = 0
        self.last_byte_at = now

    def confirmed(self, period: Optional[float]) -> None:
        """Count missing frames from the period that the controller confirmed, s; none where it confirmed none."""
        self._due_period = period if period is not None and period > 0.0 else None
        self._keeps_period = False
        self.owed = 0.0

    def refute_debt(self) -> None:
        """Take the rhythm at which frames come for the controller's own: a witness has shown that they are not old."""
        if self.owed > _REFUTED_DEBT_S and len(self._arrivals) > _RHYTHM_FRAMES:
            self._due_period = (self._arrivals[-1] - self._arrivals[0]) / (len(self._arrivals) - 1)
            self.owed = 0.0

    def give_up(self) -> None:
        """Discard the newest state as old: there is no fresh state before the next new one."""
        self._is_given_up = True

    @property
    def is_flooded(self) -> bool:
        """True where the connection brings so much damage that it is not read any more."""
        return self._stream.is_flooded

    @property
    def usual_period(self) -> float:
        """The usual time between two pieces, s."""
        return sorted(self._intervals)[len(self._intervals) // 2] if self._intervals else self._period

    def held_up(self) -> None:
        """Take note that nobody read for a while: what has piled up is old news."""
        self._was_held_up = True

    def received(self, data: bytes, now: float, is_believed: Callable[[RobotState], bool] = lambda state: True
                 ) -> List[Tuple[RobotState, bool]]:
        """Take bytes of the port; return the states that they complete, and whether each shows the present.

        is_believed: Asked for each that has come in time, in their order; others are no news.
        """
        self.last_byte_at = now
        states: List[RobotState] = []
        items = self._stream.feed(data)
        for item in items:
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
        new = self._count_new(len(states), len(items), now)
        self._frames += len(states)
        oldest_new = len(states) - new
        told = [(state, index >= oldest_new and is_believed(state)) for index, state in enumerate(states)]
        believed = [state for state, is_new in told if is_new]
        if believed:
            self.state = believed[-1]
            self._is_given_up = False
        self._arrivals.extend([state.received_at for state in states[max(0, oldest_new):]])
        return told

    def fresh_state(self, max_age: float, now: float) -> Optional[RobotState]:
        """Return the newest state, or None when it is older than ``max_age`` s."""
        state = self.state
        return None if state is None or self._is_given_up or now - state.received_at > max_age else state

    def health(self, now: float, silence_timeout: float) -> FeedHealth:
        """Return rate, jitter and damage of the feed."""
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

    def _count_new(self, count: int, sent: int, now: float) -> int:
        """Return how many frames of a piece of ``count``, the newest, show the present.

        ``sent`` counts the damaged ones, too.

        After a pause the newest one does, where nothing was in doubt before and nearly all frames have come that were
        made since; how many those are is unknown on a connection that has brought nothing yet. A doubt ends with the
        second of two pieces before which the port was silent for half a period for each of their frames: what has piled
        up anywhere comes without such pauses, or with one, where a link was held up and brings its first frame alone.
        """
        last, self._last_piece = self._last_piece, now
        was_held_up, self._was_held_up = self._was_held_up, False
        if last is None:
            self._is_doubtful = was_held_up or now - self._opened_at > max(SILENCE_S, 3.0 * self._period)
            return 0 if self._is_doubtful else MAX_BURST
        interval = now - last
        usual = self.usual_period
        if interval >= _SHORTEST_PERIOD_S:
            self._intervals.append(interval)
        period = min(self._period, usual)
        self._missing = max(0.0, self._missing + interval - count * period)
        is_silence = was_held_up or interval > max(SILENCE_S, 3.0 * usual)
        if not is_silence:
            self._count_debt(interval, sent)
        was_steady = self._was_steady
        self._was_steady = not was_held_up and interval >= max(_SHORTEST_PERIOD_S, 0.5 * period) * count
        if is_silence:
            self._is_doubtful = self._is_doubtful or self._missing > _MISSING_S
            return 0 if self._is_doubtful else 1
        if self._was_steady:
            self._is_doubtful = self._is_doubtful and not was_steady
            if interval <= 3.0 * usual:
                self._missing = 0.0
        return 0 if self._is_doubtful else MAX_BURST

    def _count_debt(self, interval: float, count: int) -> None:
        due = self._due_period
        self._mean += min(1.0, _MEAN_SHARE * count if self._counted else 1.0) * (interval / count - self._mean)
        self._counted += count
        if due is None:
            return
        if self._counted > _RHYTHM_FRAMES and self._mean <= (1.0 + _CLOCKS_DIFFER) * due:
            self._keeps_period = True
        if self._mean > _SLOWER_BY_NATURE * due and not self._keeps_period:
            self.owed = 0.0
        else:
            self.owed = max(0.0, self.owed + (1.0 - _CLOCKS_DIFFER) * interval - count * due)
