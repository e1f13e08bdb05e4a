"""Keeps one link up: connects, and connects anew with back-off when it goes down."""
import logging
import threading
from typing import Callable

from jaka_ros_driver.errors import JakaError

_LOG = logging.getLogger(__name__)

_FIRST_DELAY = 0.1
_LONGEST_DELAY = 0.5
_STABLE_TIME = 2.0
_STOP_TIMEOUT = 0.3


class LinkKeeper:
    """A thread that calls ``connect`` until it succeeds, and again after ``closed``.

    A link that goes down at once, as when the controller's port is busy with another client, counts as a failure:
    the pause before the next try doubles up to 0.5 s.
    """

    def __init__(self, name: str, connect: Callable[[], None], on_lost: Callable[[str], None]) -> None:
        """Prepare; ``start`` begins.

        Args:
            name: The link's name in messages.
            connect: Brings the link up; raises a JakaError when it cannot.
            on_lost: Called in the keeper's thread with the reason, when a link that was up is down.
        """
        self._name = name
        self._connect = connect
        self._on_lost = on_lost
        self._changed = threading.Condition()
        self._is_up = False
        self._is_stopping = False
        self._down_reason = ""
        self.connections = 0
        self.last_error = "not connected yet"
        self._thread = threading.Thread(target=self._run, name=name + " keeper", daemon=True)

    @property
    def is_up(self) -> bool:
        """True while the link is connected and ready for use."""
        return self._is_up

    def start(self) -> None:
        """Begin to connect."""
        self._thread.start()

    def stop(self) -> None:
        """No more connecting; waits for the thread, but not for a connection that it is still trying."""
        with self._changed:
            self._is_stopping = True
            self._changed.notify_all()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(_STOP_TIMEOUT)

    def closed(self, reason: str) -> None:
        """The link went down; may be called from any thread, also while ``connect`` is at work."""
        with self._changed:
            self._is_up = False
            self._down_reason = reason
            self._changed.notify_all()

    def _run(self) -> None:
        delay = 0.0
        while not self._pause(delay):
            self._down_reason = ""
            try:
                self._connect()
            except JakaError as error:
                if str(error) != self.last_error:
                    _LOG.warning("%s: %s", self._name, error)
                self.last_error = str(error)
                delay = min(_LONGEST_DELAY, max(_FIRST_DELAY, 2 * delay))
                continue
            with self._changed:
                self._is_up = not self._down_reason
                self.connections += 1
                if self._is_up:
                    self.last_error = ""
                    _LOG.info("%s connected", self._name)
                    self._changed.wait_for(lambda: self._is_stopping or not self._is_up, _STABLE_TIME)
                    if self._is_up and not self._is_stopping:
                        delay = 0.0
                    self._changed.wait_for(lambda: self._is_stopping or not self._is_up)
                if self._is_stopping:
                    return
                self._is_up = False
                self.last_error = self._down_reason
            _LOG.warning("%s lost: %s", self._name, self._down_reason)
            self._on_lost(self._down_reason)
            delay = min(_LONGEST_DELAY, max(_FIRST_DELAY, 2 * delay))

    def _pause(self, delay: float) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: self._is_stopping, delay)
