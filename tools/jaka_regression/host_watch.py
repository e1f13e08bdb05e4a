"""Notices when a busy computer lets programs wait, which can look like a difference of the arm."""
import threading
import time
from dataclasses import dataclass
from typing import List

EVERY_S = 0.02
NOTABLE_S = 0.1
"""A pause that tolerances of time do not cover for certain."""


@dataclass(frozen=True)
class Pause:
    """A program that wanted to run did not.

    Attributes:
        ended_ns: When it ran again, ns since the epoch.
        lasted_s: How long it waited.
    """

    ended_ns: int
    lasted_s: float


class HostWatch:
    """While it is open, a thread wants to run every 20 ms and notes where it was late by more than ``NOTABLE_S``."""

    def __init__(self) -> None:
        self.pauses: List[Pause] = []
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="host_watch", daemon=True)

    def __enter__(self) -> "HostWatch":
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._is_over.set()
        self._thread.join()

    def _watch(self) -> None:
        before = time.monotonic()
        while not self._is_over.wait(EVERY_S):
            now = time.monotonic()
            late = now - before - EVERY_S
            if late > NOTABLE_S:
                self.pauses.append(Pause(time.time_ns(), late))
            before = now

    def words(self, since_ns: int, time_scale: float = 1.0) -> str:
        """What to tell of it beside a difference; empty where there was no pause since the log began.

        Args:
            since_ns: Start of the log whose times the reader sees, ns since the epoch.
            time_scale: The log ran this many times faster than its times are shown.
        """
        longest = max((pause for pause in self.pauses if pause.ended_ns > since_ns), default=None,
                      key=lambda pause: pause.lasted_s)
        if longest is None:
            return ""
        return ("this computer let programs wait for up to %.2f s, at %.1f s of the candidate: replay again before you "
                "believe a difference of time"
                % (longest.lasted_s, time_scale * 1e-9 * (longest.ended_ns - since_ns)))
