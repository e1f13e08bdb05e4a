"""Ends a jog that nobody keeps going: exactly ``timeout`` after the last call, also when the caller has died."""
import threading
import time
from typing import Callable, Optional

from jaka_ros_driver.commands import Jog


class JogWatchdog:
    """Holds the running jog and its deadline; a thread calls ``on_expired`` when that passes."""

    def __init__(self, timeout: float, on_expired: Callable[[Jog], None]) -> None:
        self._timeout = timeout
        self._on_expired = on_expired
        self._changed = threading.Condition()
        self._jog: Optional[Jog] = None
        self._deadline = 0.0
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="jog watchdog", daemon=True)
        self._thread.start()

    def begin(self, jog: Jog, within: Optional[float] = None) -> None:
        """This jog runs from now on; ``within`` (s) where it is to end sooner than the time-out."""
        with self._changed:
            self._jog = jog
            self._deadline = time.monotonic() + (self._timeout if within is None else within)
            self._changed.notify_all()

    def keep_going(self, jog: Jog) -> bool:
        """Give the running jog its full time again; False when another jog runs, or none."""
        with self._changed:
            if self._jog != jog:
                return False
            self._deadline = time.monotonic() + self._timeout
            return True

    @property
    def running(self) -> Optional[Jog]:
        """The jog that is watched."""
        return self._jog

    def end(self) -> Optional[Jog]:
        """Watch no longer; returns the jog that ran."""
        with self._changed:
            jog, self._jog = self._jog, None
            return jog

    def close(self) -> None:
        """End the thread."""
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                if self._is_closing:
                    return
                remaining = self._deadline - time.monotonic() if self._jog is not None else None
                if remaining is None or remaining > 0.0:
                    self._changed.wait(remaining)
                    continue
                expired, self._jog = self._jog, None
            if expired is not None:
                self._on_expired(expired)
