"""The replay of recorded calls and messages: on time, overlapping as they did, until an unforeseen refusal."""
import threading
import time
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence

from jaka_bag.interrupts import Flag

from .attended import ReplayStopped, attended
from .command_schedule import Planned, due
from .driver_inputs import Input

_POLL_S = 0.02
"""Longest wait, s, before the next look at what has changed: the delay of a stop."""
_PATIENCE = 5.0
"""Factor over its recorded time after which a call has no end."""
_PATIENCE_S = 60.0
"""Time, s, beside that: short calls wait for others on a busy host."""


class ServiceReply(NamedTuple):
    """The reply to a call made again.

    Attributes:
        success: Answered, and successful as far as its type can tell.
        text: Message of the response, or the error.
    """

    success: bool
    text: str


def longest_wait(call: Input) -> float:
    """Return how long to wait for the end of a call or goal that is made again, s."""
    return _PATIENCE * call.duration + _PATIENCE_S


class CommandPlayer:
    """A player of a plan's calls.

    Args:
        planned: The plan.
        perform: Makes one call and waits for its answer; must be thread-safe; an error is a ServiceReply, too.
        notice: Told of each call: the planned one, when it was made (monotonic s), and its reply or None when it
            begins.
        after_previous: Each call as soon as those that it follows have ended.
        cancelled: Set to stop.

    Attributes:
        lateness: Time by which each call was made later than due, s.
    """

    def __init__(self, planned: Sequence[Planned], perform: Callable[[Input], ServiceReply],
                 notice: Callable[[Planned, float, Optional[ServiceReply]], None], after_previous: bool = False,
                 cancelled: Optional[Flag] = None) -> None:
        self._planned = planned
        self._perform = perform
        self._notice = notice
        self._after_previous = after_previous
        self._cancelled = cancelled or Flag()
        self._started: List[Optional[float]] = [None] * len(planned)
        self._ended: List[Optional[float]] = [None] * len(planned)
        self._changed = threading.Condition()
        self._failure: Optional[str] = None
        self.lateness: List[float] = []

    def run(self, begin: Optional[float] = None) -> None:
        """Make all calls; returns when the last has been answered.

        Args:
            begin: Time at which the plan begins, monotonic s; None: now.

        Raises:
            ReplayStopped: A call was refused that succeeded in the log, or the replay was cancelled. This is raised at
                once, also while other calls wait for their answers; none is begun afterwards.
        """
        attended(lambda: self._make_calls(time.monotonic() if begin is None else begin), self._why_end)

    def _make_calls(self, begin: float) -> None:
        threads: Dict[int, threading.Thread] = {}
        for entry in self._planned:
            moment = self._wait_until_due(entry, begin)
            self.lateness.append(max(0.0, time.monotonic() - moment))
            self._begin(entry)  # before the thread runs, so that what overlaps this call can be planned
            if entry.is_overlapped:
                threads[entry.number] = threading.Thread(target=self._finish, args=(entry,), daemon=True,
                                                         name="call %d" % entry.number)
                threads[entry.number].start()
            else:
                self._finish(entry)
            self._check()
        for number, thread in threads.items():
            thread.join(longest_wait(self._planned[number].call))
            if thread.is_alive():
                raise ReplayStopped("%s was not answered" % self._planned[number].call.words)
        self._check()

    def _wait_until_due(self, entry: Planned, begin: float) -> float:
        with self._changed:
            while not self._cancelled.is_set() and self._failure is None:
                moment = due(entry, self._started, self._ended, begin, self._after_previous)
                now = time.monotonic()
                if moment is not None and moment <= now:
                    return moment
                self._changed.wait(_POLL_S if moment is None else min(moment - now, _POLL_S))
        return time.monotonic()

    def _begin(self, entry: Planned) -> None:
        now = time.monotonic()
        with self._changed:
            self._check()
            self._started[entry.number] = now
        self._notice(entry, now, None)

    def _finish(self, entry: Planned) -> None:
        reply = self._perform(entry.call)
        now = time.monotonic()
        self._notice(entry, now, reply)
        with self._changed:
            self._ended[entry.number] = now
            if not reply.success and entry.call.success and self._failure is None:
                self._failure = "%s was refused, unlike in the log: %s" % (entry.call.words, reply.text)
            self._changed.notify_all()

    def _why_end(self) -> Optional[str]:
        return self._failure or ("interrupted" if self._cancelled.is_set() else None)

    def _check(self) -> None:
        reason = self._why_end()
        if reason is not None:
            raise ReplayStopped(reason)
