"""The player of messages at their times: absolute deadlines, pause and step, /clock, and an account of lateness."""
import time
from dataclasses import dataclass
from typing import Callable, Dict, Iterable, Optional

from ..units import NS_PER_S
from .keyboard import Keyboard
from .latency_histogram import LatencyHistogram
from .log_source import Timed

_PAUSE_POLL_S = 0.05
"""Longest wait, s, before the next look at the keyboard: a key must seem to act at once."""
_LEAST_SPIN_S = 60e-6
"""Least time, s, polled before a message is due: with less the time in which the thread wakes shows in the latency."""
_SPIN_SHARE = 0.1
"""Largest share of a short wait that is spent polling: other threads delay one that computes all the time."""
_PAUSED = "paused: space goes on, s steps"


@dataclass(frozen=True)
class Pace:
    """The schedule by which messages are sent.

    Attributes:
        rate: Log seconds per second.
        is_immediate: Send without waiting.
        is_paused: Begin paused.
        spin_s: Largest part, s, of the end of each wait that is spent polling the clock; punctual, and costs CPU.
        skip_empty_s: Gaps of the log longer than this are skipped, s of log time; None keeps them.
        clock_period_s: Period of ``/clock``, which is published at each message as well, s; None: there is no clock.
    """

    rate: float = 1.0
    is_immediate: bool = False
    is_paused: bool = False
    spin_s: float = 200e-6
    skip_empty_s: Optional[float] = None
    clock_period_s: Optional[float] = None


class Player:
    """A player that sends messages one after the other, each when its time has come.

    A message that comes late does not move those after it: they keep their own times.

    Args:
        pace: Schedule of the messages.
        send: Sends one message.
        send_clock: Publishes a log time, ns, as the time.
        keyboard: Source of keys: space pauses and resumes, s steps.
        idle: Called while waiting, often: serves subscribers that have come.
        notice: Takes a line for the user.

    Attributes:
        accounts: By connection: number of messages sent, and their lateness; immediate ones are never late.
        is_paused: The player waits for a key.
    """

    def __init__(self, pace: Pace, send: Callable[[Timed], None], send_clock: Callable[[int], None],
                 keyboard: Keyboard, idle: Callable[[], None], notice: Callable[[str], None]) -> None:
        self._pace = pace
        self._send = send
        self._send_clock = send_clock
        self._keyboard = keyboard
        self._idle = idle
        self._notice = notice
        self.accounts: Dict[int, LatencyHistogram] = {}
        self.is_paused = pace.is_paused
        self._steps = 0
        self._log_base = 0
        self._wall_base = 0.0
        self._clock_time = 0
        self._next_tick = 0.0

    def _deadline(self, log_time: int) -> float:
        return self._wall_base + (log_time - self._log_base) / (NS_PER_S * self._pace.rate)

    def _log_now(self) -> int:
        """Return the log time, ns, that is due now."""
        if self.is_paused:
            return self._log_base
        return self._log_base + int((time.monotonic() - self._wall_base) * self._pace.rate * NS_PER_S)

    def _anchor(self, log_time: int) -> None:
        """Make now the time at which ``log_time`` is due."""
        self._log_base = log_time
        self._wall_base = time.monotonic()

    def play(self, messages: Iterable[Timed], begin: int) -> None:
        """Send all messages.

        Args:
            messages: Messages in the order of time.
            begin: Log time at which playing begins, ns.
        """
        if self.is_paused:
            self._notice(_PAUSED)
        self._anchor(begin)
        self._clock_time = begin
        self._next_tick = self._wall_base
        newest = begin
        has_clock = self._pace.clock_period_s is not None
        is_timed = not self._pace.is_immediate
        skip = self._pace.skip_empty_s
        for message in messages:
            log_time = message.time
            if skip is not None and log_time - newest > skip * NS_PER_S:
                self._anchor(log_time)
            newest = log_time
            if is_timed or self.is_paused:
                self._wait_for(log_time)
            elif self._keyboard.is_active:
                self._serve(0.0)
            if has_clock and log_time > self._clock_time:
                self._clock_time = log_time
                self._send_clock(log_time)
            late = time.monotonic() - self._deadline(log_time)
            self._send(message)
            account = self.accounts.get(message.connection)
            if account is None:
                account = self.accounts[message.connection] = LatencyHistogram()
            account.add(late if is_timed else 0.0)

    def wait(self, seconds: float, log_time: int) -> None:
        """Wait some seconds, while ``/clock`` stays at one log time, ns."""
        deadline = time.monotonic() + seconds
        while True:
            left = deadline - time.monotonic()
            if left <= 0:
                return
            self._tick(log_time)
            self._serve(min(left, self._tick_wait()))

    def _wait_for(self, log_time: int) -> None:
        """Wait until a message is due, or a step lets it go."""
        whole = self._deadline(log_time) - time.monotonic()
        spin = min(self._pace.spin_s, max(_LEAST_SPIN_S, whole * _SPIN_SHARE))
        while True:
            if self.is_paused:
                while self.is_paused and not self._steps:
                    self._tick(self._log_base)
                    self._serve(self._tick_wait())
                if self._steps:
                    self._steps -= 1
                    self._anchor(log_time)
            if self._pace.is_immediate:
                return
            left = self._deadline(log_time) - time.monotonic() - spin
            if left <= 0:
                break
            self._tick(min(self._log_now(), log_time))
            self._serve(min(left, self._tick_wait()))
        deadline = self._deadline(log_time)
        while time.monotonic() < deadline:
            pass

    def _tick(self, log_time: int) -> None:
        """Publish ``log_time``, ns, as the time where that is due."""
        if self._pace.clock_period_s is None or time.monotonic() < self._next_tick:
            return
        self._next_tick += self._pace.clock_period_s
        if self._next_tick < time.monotonic():
            self._next_tick = time.monotonic() + self._pace.clock_period_s
        self._clock_time = max(self._clock_time, log_time)
        self._send_clock(self._clock_time)

    def _tick_wait(self) -> float:
        if self._pace.clock_period_s is None:
            return 3600.0
        return max(0.0, self._next_tick - time.monotonic())

    def _serve(self, timeout_s: float) -> None:
        """Wait at most ``timeout_s``, and obey keys."""
        self._idle()
        for key in self._keyboard.wait(max(0.0, min(timeout_s, _PAUSE_POLL_S))):
            if key == " ":
                self._anchor(self._log_now())
                self.is_paused = not self.is_paused
                self._steps = 0
                self._notice(_PAUSED if self.is_paused else "goes on")
            elif key == "s" and self.is_paused:
                self._steps += 1

    def total_of(self, connections: Iterable[int]) -> LatencyHistogram:
        """Return the account of several connections together."""
        total = LatencyHistogram()
        for number in connections:
            total.merge(self.accounts[number])
        return total
