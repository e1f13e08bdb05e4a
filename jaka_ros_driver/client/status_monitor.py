"""The newest state of the arm from the status feed, those who want to hear of each one, and how the feed does."""
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Callable, Deque, List, Optional

from jaka_ros_driver.client.transport import Connection
from jaka_ros_driver.errors import ConnectionLost, FramingError, StatusFrameError, StopCause
from jaka_ros_driver.protocol.framing import FrameStream
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.state import RobotState

Listener = Callable[[RobotState, bool], None]

_RATE_WINDOW = 250
_TICK = 1e-6
MAX_BURST = 5
"""Of the frames that arrive in one piece only so many, the newest, are shown as new: the others are old news.

So is all that piled up while nobody read, as after the process was stopped and continued."""


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


class StatusMonitor:
    """Keeps the newest state; one reader thread a connection, many readers of the result."""

    def __init__(self, silence_timeout: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._silence_timeout = silence_timeout
        self._clock = clock
        self._changed = threading.Condition()
        self._state: Optional[RobotState] = None
        self._listeners: List[Listener] = []
        self._stream = FrameStream()
        self._connection: Optional[Connection] = None
        self._arrivals: Deque[float] = deque(maxlen=_RATE_WINDOW)
        self._frames = 0
        self._damaged = 0
        self._last_damage = ""
        self._last_arrival = 0.0
        self._is_closed = False

    def connect(self, host: str, port: int, connect_timeout: float, on_closed: Callable[[str], None]) -> None:
        """Connect to the feed and begin to read.

        Raises:
            ConnectionLost: The controller cannot be reached.
        """
        self._stream.clear()
        with self._changed:
            self._arrivals.clear()
        self._connection = Connection(host, port, connect_timeout, "status port", self._received, on_closed,
                                      silence_timeout=self._silence_timeout)
        self._connection.start()

    def close(self, reason: str) -> None:
        """End the connection, if there is one, for good: whoever waits for a state is told so."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        if self._connection is not None:
            self._connection.close(reason)
            self._connection.join()

    def add_listener(self, listener: Listener) -> None:
        """Call ``listener(state, is_new)`` for every frame in the reader thread; is_new as MAX_BURST says."""
        self._listeners.append(listener)

    @property
    def state(self) -> Optional[RobotState]:
        """The newest state, however old; None before the first."""
        return self._state

    def fresh_state(self, max_age: float) -> Optional[RobotState]:
        """The newest state, or None when it is older than ``max_age`` seconds."""
        state = self._state
        if state is None or self._clock() - state.received_at > max_age:
            return None
        return state

    def wait_for(self, predicate: Callable[[RobotState], bool], timeout: float,
                 after: Optional[float] = None) -> Optional[RobotState]:
        """Wait for a state received after ``after`` (default: now) of which the predicate holds.

        Returns:
            That state, or None after ``timeout`` seconds.

        Raises:
            ConnectionLost: The driver shuts down.
        """
        start = self._clock()
        newer_than = start if after is None else after
        with self._changed:
            while True:
                state = self._state
                if state is not None and state.received_at > newer_than:
                    newer_than = state.received_at
                    if predicate(state):
                        return state
                if self._is_closed:
                    raise ConnectionLost(StopCause.SHUTDOWN.value)
                remaining = start + timeout - self._clock()
                if remaining <= 0.0:
                    return None
                self._changed.wait(remaining)

    def health(self) -> FeedHealth:
        """Rate, jitter and damage of the feed."""
        with self._changed:
            arrivals = list(self._arrivals)
            state = self._state
        age = self._clock() - state.received_at if state is not None else float("inf")
        rate = jitter = 0.0
        if len(arrivals) > 2 and age < self._silence_timeout:
            intervals = sorted(b - a for a, b in zip(arrivals, arrivals[1:]))
            rate = len(intervals) / max(1e-9, arrivals[-1] - arrivals[0])
            median = intervals[len(intervals) // 2]
            deviations = sorted(abs(interval - median) for interval in intervals)
            jitter = deviations[int(0.99 * (len(deviations) - 1))]
        return FeedHealth(rate, jitter, age, self._frames, self._damaged, self._last_damage)

    def _received(self, data: bytes, is_backlog: bool) -> None:
        now = self._clock()
        states: List[RobotState] = []
        for item in self._stream.feed(data):
            try:
                if isinstance(item, FramingError):
                    raise item
                self._last_arrival = max(now, self._last_arrival + _TICK)
                states.append(parse_status(item, self._last_arrival))
            except (FramingError, StatusFrameError) as error:
                self._damaged += 1
                self._last_damage = str(error)
        for index, state in enumerate(states):
            self._frames += 1
            with self._changed:
                self._state = state
                self._arrivals.append(state.received_at)
                self._changed.notify_all()
            for listener in self._listeners:
                listener(state, not is_backlog and len(states) - index <= MAX_BURST)
