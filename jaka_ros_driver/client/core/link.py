"""One connection and its retries: a new one is asked for with growing pauses when it goes down."""
import logging
from collections import deque
from typing import Deque, NamedTuple

from jaka_ros_driver.client.core.actions import Actions, Close, Open, Port

_FIRST_PAUSE_S = 0.1
"""Pause, s, after a first failure; it doubles with each that follows."""
_LONGEST_PAUSE_S = 0.5
"""Longest pause, s: a controller that was away for long is found within it."""
_STABLE_TIME_S = 2.0
"""Life of a connection, s, after which its loss counts as a first failure again."""
_FIRST_WAY_S, _LONGEST_WAY_S = 1.0, 10.0
"""First and longest pause, s, of a link that gives way to another client."""
_RIVALS_GONE_S = 30.0
"""Life of a connection, s, longer than any pause, that shows that nobody takes the port any more."""
_TAKEN_TIMES, _TAKEN_WITHIN_S = 3, 10.0
"""Connections, and the time, s, within which the controller ends so many where another client takes the port."""
_NEVER = float("inf")


class PortLink:
    """The connection to one port.

    A connection that goes down at once, as when the controller's port is busy with another client, counts as a failure:
    the pause before the next try doubles up to 0.5 s.

    Attributes:
        is_wanted: True from ``start`` to ``stop``: it is connected, or will be.
        is_up: True while it is connected.
        connections: How often it has been connected.
        losses: How often a connection that was up has ended, other than by ``stop``.
        last_error: Why it is down; empty while it is up.
        retry_at: When the next try is due, s; infinite while there is none to come.
    """

    def __init__(self, port: Port, actions: Actions) -> None:
        self._port = port
        self._actions = actions
        self._pause = 0.0
        self._way = 0.0
        self._opened_at = self._ended_at = 0.0
        self.is_wanted = False
        self.is_up = False
        self.connections = 0
        self.losses = 0
        self.last_error = "not connected yet"
        self.retry_at = _NEVER

    def start(self, now: float) -> None:
        """Ask for a connection, unless there is one."""
        self.is_wanted = True
        if not self.is_up:
            self.retry_at = now

    def stop(self, reason: str) -> None:
        """Close the connection; ask for no more."""
        self.is_wanted = False
        self.retry_at = _NEVER
        self._actions.add(Close(self._port, reason))
        self.is_up = False
        self.last_error = reason

    def opened(self, now: float) -> None:
        """Take note that the port is connected: no other try is due."""
        self.is_up = True
        self.retry_at = _NEVER
        self._opened_at = now
        self.connections += 1
        self.last_error = ""
        self._actions.log(logging.INFO, "%s connected" % self._port.value)

    def failed(self, reason: str, now: float) -> None:
        """Take note that the port could not be connected."""
        if reason != self.last_error:
            self._actions.log(logging.WARNING, reason)
        self._again(reason, now)

    def lost(self, reason: str, now: float) -> None:
        """Take note that a connection that was up has ended."""
        if not self.is_up:
            return
        self.is_up = False
        self.losses += 1
        if now - self._opened_at > _STABLE_TIME_S:
            self._pause = 0.0
        if now - self._opened_at > _RIVALS_GONE_S:
            self._way = 0.0
        self._actions.log(logging.WARNING, "%s lost: %s" % (self._port.value, reason))
        self._again(reason, now)

    def drop(self, reason: str, now: float) -> None:
        """End the connection from this side, and ask for a new one."""
        self._actions.add(Close(self._port, reason))
        self.lost(reason, now)

    def give_way(self, now: float) -> None:
        """Leave the port to another client for a while, longer each time; called when the connection has ended."""
        self._way = min(_LONGEST_WAY_S, max(_FIRST_WAY_S, 2.0 * self._way))
        if self.retry_at != _NEVER:
            self.retry_at = now + self._way

    def gives_way(self, now: float) -> bool:
        """Return whether another client was seen to take the port, and has not been seen to be gone."""
        return self._way > 0.0 and not (self.is_up and self.lasted(now) > _RIVALS_GONE_S)

    @property
    def is_left_to_others(self) -> bool:
        """True while the connection is down because another client was seen to take the port."""
        return self._way > 0.0 and not self.is_up and self.is_wanted

    def lasted(self, now: float) -> float:
        """Return how long the present connection has lasted, s."""
        return now - self._opened_at

    def hurry(self, at: float = _NEVER) -> None:
        """Let the next try wait for nobody, and for no grown pause: a stop is owed.

        at: The latest time of the try, s.
        """
        if self.retry_at != _NEVER:
            self.retry_at = min(self.retry_at, self._ended_at + _FIRST_PAUSE_S, at)

    def tick(self, now: float) -> None:
        """Ask for a connection when that is due."""
        if now >= self.retry_at:
            self.retry_at = _NEVER
            self._actions.add(Open(self._port))

    def _again(self, reason: str, now: float) -> None:
        self.last_error = reason
        self._ended_at = now
        self._pause = min(_LONGEST_PAUSE_S, max(_FIRST_PAUSE_S, 2.0 * self._pause))
        self.retry_at = now + self._pause if self.is_wanted else _NEVER


class _End(NamedTuple):
    at: float
    lasted: float


class Takeovers:
    """The detector of another client that takes the command port again and again, among other losses of a link.

    The controller does not report who it is. It closes one client's connection when it accepts the next one, or at once
    where it keeps its first client, and goes on with its status feed meanwhile.
    """

    def __init__(self) -> None:
        self._ends: Deque[_End] = deque(maxlen=_TAKEN_TIMES)

    def note(self, lasted: float, now: float) -> None:
        """Count a connection that the controller has ended after so long, s, while all else was well."""
        self._ends.append(_End(now, lasted))

    def are_rivalry(self, now: float) -> bool:
        """Return whether the port was taken three times in ten seconds."""
        return len(self._ends) == _TAKEN_TIMES and now - self._ends[0].at <= _TAKEN_WITHIN_S

    def __str__(self) -> str:
        return ("another client seems to use this controller, which does not say who: it ended the last %d connections "
                "to the command port after %s s, and its status port was well" % (
                    len(self._ends), ", ".join(["%.1f" % end.lasted for end in self._ends])))
