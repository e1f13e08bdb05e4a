"""Keeps one connection up: asks for it, and for a new one with growing pauses when it goes down."""
import logging

from jaka_ros_driver.client.core.actions import Actions, Close, Open, Port

_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 0.5
_STABLE_TIME_S = 2.0
_NEVER = float("inf")


class Link:
    """One port's connection.

    A connection that goes down at once, as when the controller's port is busy with another client, counts as a
    failure: the pause before the next try doubles up to 0.5 s.

    Attributes:
        is_up: It is connected.
        connections: How often it has been connected.
        last_error: Why it is down; empty while it is up.
        retry_at: When the next try is due, s; infinite while there is none to come.
    """

    def __init__(self, port: Port, actions: Actions) -> None:
        self._port = port
        self._actions = actions
        self._pause = 0.0
        self._opened_at = 0.0
        self._is_stopped = False
        self.is_up = False
        self.connections = 0
        self.last_error = "not connected yet"
        self.retry_at = _NEVER

    def start(self, now: float) -> None:
        """Ask for a connection, unless there is one."""
        self._is_stopped = False
        if not self.is_up:
            self.retry_at = now

    def stop(self, reason: str) -> None:
        """Drop the connection; ask for no more."""
        self._is_stopped = True
        self.retry_at = _NEVER
        self._actions.add(Close(self._port, reason))
        self.is_up = False
        self.last_error = reason

    def opened(self, now: float) -> None:
        """It is connected."""
        self.is_up = True
        self._opened_at = now
        self.connections += 1
        self.last_error = ""
        self._actions.log(logging.INFO, "%s connected" % self._port.value)

    def failed(self, reason: str, now: float) -> None:
        """It could not be connected."""
        if reason != self.last_error:
            self._actions.log(logging.WARNING, reason)
        self._again(reason, now)

    def lost(self, reason: str, now: float) -> None:
        """A connection that was up has ended."""
        if not self.is_up:
            return
        self.is_up = False
        if now - self._opened_at > _STABLE_TIME_S:
            self._pause = 0.0
        self._actions.log(logging.WARNING, "%s lost: %s" % (self._port.value, reason))
        self._again(reason, now)

    def drop(self, reason: str, now: float) -> None:
        """End the connection from this side, and ask for a new one."""
        self._actions.add(Close(self._port, reason))
        self.lost(reason, now)

    def tick(self, now: float) -> None:
        """Ask for a connection when that is due."""
        if now >= self.retry_at:
            self.retry_at = _NEVER
            self._actions.add(Open(self._port))

    def _again(self, reason: str, now: float) -> None:
        self.last_error = reason
        self._pause = min(_LONGEST_PAUSE_S, max(_FIRST_PAUSE_S, 2.0 * self._pause))
        self.retry_at = _NEVER if self._is_stopped else now + self._pause
