"""A watch for pauses in which a busy computer lets processes wait, which can look like a difference of the arm."""
import os
import threading
import time
from dataclasses import dataclass
from typing import List

EVERY_S = 0.02
"""Period, s, of the looks: one that comes late was held up by the host, as the driver would be."""
NOTABLE_S = 0.1
"""A pause that tolerances of time do not cover for certain."""


@dataclass(frozen=True)
class Pause:
    """A process that wanted to run did not.

    Attributes:
        ended_ns: Time at which it ran again, ns since the epoch.
        lasted_s: Length of the pause, s.
    """

    ended_ns: int
    lasted_s: float


class HostWatch:
    """The watch of a host: on each processor a thread wants to run every 20 ms, and notes where it was late.

    Late is more than ``NOTABLE_S``. A host may take one processor away, and leave the others.
    """

    def __init__(self) -> None:
        self.pauses: List[Pause] = []
        self._is_over = threading.Event()
        self._threads = [threading.Thread(target=self._watch, args=(processor,), name="host_watch", daemon=True)
                         for processor in os.sched_getaffinity(0)]

    def __enter__(self) -> "HostWatch":
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._is_over.set()
        for thread in self._threads:
            thread.join()

    def _watch(self, processor: int) -> None:
        os.sched_setaffinity(threading.get_native_id(), {processor})
        before = time.monotonic()
        while not self._is_over.wait(EVERY_S):
            now = time.monotonic()
            late = now - before - EVERY_S
            if late > NOTABLE_S:
                self.pauses.append(Pause(time.time_ns(), late))
            before = now

    def words(self, since_ns: int, time_scale: float = 1.0) -> str:
        """Describe the longest pause, to be shown beside a difference; empty if there was none since the log began.

        Args:
            since_ns: Start of the log whose times the reader sees, ns since the epoch.
            time_scale: The log ran this many times faster than its times are shown.
        """
        longest = max((pause for pause in self.pauses if pause.ended_ns > since_ns), default=None,
                      key=lambda pause: pause.lasted_s)
        if longest is None:
            return ""
        return ("this computer let processes wait for up to %.2f s, at %.1f s of the candidate: replay again before "
                "you believe a difference of time"
                % (longest.lasted_s, time_scale * 1e-9 * (longest.ended_ns - since_ns)))
