"""The black box: the newest messages in memory, and a file around each trigger.

It takes the place of a recording's files (``RollingFiles``): the writing thread hands it every message in order.
"""
import collections
import datetime
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional, Sequence, Tuple

from jaka_bag.errors import BagError
from jaka_bag.live.rolling_files import RollingFiles
from jaka_bag.live.stream_account import PublisherStream, TopicDrops, drops_by_topic
from jaka_bag.log_records import TRIGGER
from jaka_bag.units import NS_PER_S

from .files import Keep, new_stem, remove_old
from .triggers import Trigger, TriggerWatch

ITEM_BYTES = 256
"""Memory that a message takes besides its payload, byte (measured: 230)."""
_ACCOUNT_PERIOD_S = 1.0
"""Period, s, of the counts that are kept: the account of a file is exact to so much."""
_ANSWER_TIMEOUT_S = 10.0
"""Longest wait, s, of a call for its file to begin; the file is made in any case."""
_MARGIN_S = 1.0
"""Time, s, for which messages stay in memory beyond the window: they may have waited before they are examined."""
_AFTER_MARGIN_S = 0.25
"""Delay, s, before a file is finished: messages that came in time may still wait."""
_LARGEST_FILE = 1 << 30
"""A file that triggers keep extending ends at this size, byte; the next one goes on without a gap."""
_MOST_RECORDS = 1000
"""Triggers that one file records; further ones only keep it open."""

_Lost = Tuple[int, int, int, int]


class _Item(NamedTuple):
    """A message in memory; ``at`` is on the black box's clock, s."""

    at: float
    stream: PublisherStream
    number: int
    log_time: int
    publish_time: int
    payload: bytes


@dataclass(frozen=True)
class Window:
    """The extent of a file, s before and after the trigger, and the limit of message bytes in memory."""

    before_s: float
    after_s: float
    memory_bytes: int


class SnapshotRequest:
    """A trigger from outside; ``wait`` gives the name of the file that it is written to."""

    def __init__(self, trigger: Trigger, time_ns: int) -> None:
        self.trigger = trigger
        self.time_ns = time_ns
        self._answered = threading.Event()
        self._answer = (False, "")

    def answer(self, is_written: bool, text: str) -> None:
        """Set the reply and release the waiting thread."""
        self._answer = (is_written, text)
        self._answered.set()

    def wait(self) -> Tuple[bool, str]:
        """Wait for the reply; return whether the file is being written, and its name or the reason why not."""
        if not self._answered.wait(_ANSWER_TIMEOUT_S):
            return False, "the black box takes longer than %g s to begin the file" % _ANSWER_TIMEOUT_S
        return self._answer


class BlackBox:
    """A recorder's memory, and the files that triggers make of it. ``trigger`` may be called from any thread.

    Args:
        folder: Folder of the files.
        window: Extent of the files.
        watch: Finds triggers in messages.
        open_file: Begins a file of this path without suffix, of which the account is what the function gives.
        streams: Gives all streams so far.
        clock: Time by which messages age, s; nobody may set it, as ``/clock`` and the host's date are set.
        log_time: The log time of a message that came now, ns.
        notice: Takes a line for the user.
        keep: Limits of the files that stay in the folder.
        before_end: Called with each file before it is finished.
        after_end: Called with the path of each finished file.

    Attributes:
        finished: Finished files, oldest first.
        messages: Messages in files.
        is_large_enough: Never: a black box runs until it is ended.
        failures: Files that could not be begun or finished.
    """

    is_large_enough = False

    def __init__(self, folder: Path, window: Window, watch: TriggerWatch,
                 open_file: Callable[[Path, Callable[[], Dict[str, TopicDrops]]], RollingFiles],
                 streams: Callable[[], List[PublisherStream]], clock: Callable[[], float], log_time: Callable[[], int],
                 notice: Callable[[str], None], keep: Keep,
                 before_end: Callable[[RollingFiles], None], after_end: Callable[[Path], None]) -> None:
        self._folder = folder
        self._window = window
        self._watch = watch
        self._open_file = open_file
        self._streams = streams
        self._clock = clock
        self._log_time = log_time
        self._notice = notice
        self._keep = keep
        self._before_end = before_end
        self._after_end = after_end
        self._ring: Deque[_Item] = collections.deque()
        self._ring_bytes = 0
        self._forgotten_at: Optional[float] = None
        self._numbers: Dict[PublisherStream, int] = {}
        self._latched: Dict[PublisherStream, _Item] = {}
        self._latched_in_file: Dict[PublisherStream, _Item] = {}
        self._accounts: Deque[Tuple[float, Dict[PublisherStream, _Lost]]] = collections.deque()
        self._files: Optional[RollingFiles] = None
        self._stem = folder
        self._until = 0.0
        self._remembered_s = 0.0
        self._count = 0
        self._requests: Deque[SnapshotRequest] = collections.deque()
        self.finished: List[Path] = []
        self.messages = 0
        self.failures = 0

    def trigger(self, trigger: Trigger) -> SnapshotRequest:
        """Write what is in memory, and what comes, to a file; a signal handler may call it."""
        request = SnapshotRequest(trigger, self._log_time())
        self._requests.append(request)
        return request

    # The writing thread

    def add(self, stream: PublisherStream, log_time: int, publish_time: int, payload: bytes) -> None:
        """Take one message; see ``RollingFiles.add``. What it triggers begins with this very message in the file."""
        now = self._clock()
        taken = self._numbers[stream] = self._numbers.get(stream, 0) + 1
        item = _Item(now, stream, taken + stream.overflowed, log_time, publish_time, payload)
        self._ring.append(item)
        self._ring_bytes += len(payload) + ITEM_BYTES
        if stream.connection.latching:
            self._latched.pop(stream, None)  # in the order of messages, not of publishers
            self._latched[stream] = item
        self._trim(now)
        if self._files is not None:
            self._write(item)
        for trigger in self._watch.look(stream.connection, payload):
            self._set_off(trigger, log_time, now)

    def tick(self) -> None:
        """Take triggers from outside, forget what is old, finish the file when its time is over; to be called often."""
        now = self._clock()
        while self._requests:
            request = self._requests.popleft()
            begun = self._set_off(request.trigger, request.time_ns, now)
            request.answer(begun, "%s%s" % (self._stem, ".mcap") if begun else "the file cannot be written")
        self._trim(now)
        self._note_losses(now)
        if self._files is not None:
            if now >= self._until:
                self._finish()
            else:
                self._guarded(self._files.tick)

    def lose_chunk(self) -> None:
        """See ``RollingFiles.lose_chunk``; a black box handles a refusal of the system itself."""

    def close(self) -> None:
        """Finish the open file."""
        self.tick()
        if self._files is not None:
            self._finish()

    def _trim(self, now: float) -> None:
        oldest = now - self._window.before_s - _MARGIN_S
        ring = self._ring
        while ring and (ring[0].at < oldest or self._ring_bytes > self._window.memory_bytes):
            item = ring.popleft()
            self._ring_bytes -= len(item.payload) + ITEM_BYTES
            if item.at >= oldest:
                self._forgotten_at = now

    def _set_off(self, trigger: Trigger, time_ns: int, now: float) -> bool:
        """Begin a file, or extend the running one; return whether there is one now.

        The time after the trigger is counted from when all that was in memory is written: what comes meanwhile waits.
        """
        if self._files is None:
            self._begin(trigger, now)
        if self._files is None:
            return False
        self._note(trigger, time_ns)
        self._until = self._clock() + self._window.after_s + _AFTER_MARGIN_S
        return self._files is not None

    def _note(self, trigger: Trigger, time_ns: int) -> None:
        """Report a trigger, in the file and to the user."""
        self._count += 1
        files = self._files
        if files is None or self._count > _MOST_RECORDS:
            return
        self._notice("trigger %d, %s: %s%s" % (self._count, trigger.kind, trigger.detail,
                                               " on %s" % trigger.topic if trigger.topic else ""))
        moment = datetime.datetime.fromtimestamp(time_ns / NS_PER_S).astimezone()
        facts = {"number": str(self._count), "kind": trigger.kind, "detail": trigger.detail, "topic": trigger.topic,
                 "time_ns": str(time_ns), "time": moment.isoformat()}
        if self._count == 1:
            facts["remembered_s"] = "%.3f" % self._remembered_s
        self._guarded(lambda: files.add_metadata(TRIGGER, facts))
        if self._count == 1:
            self._guarded(files.force)

    def _begin(self, trigger: Trigger, now: float) -> None:
        """Begin a file with the newest message of each latched publisher, then all messages in memory."""
        self._stem = new_stem(self._folder, trigger.kind)
        self._count = 0
        self._latched_in_file.clear()
        if not self._open():
            return
        assert self._files is not None
        self._remembered_s = now - self._ring[0].at if self._ring else 0.0
        if self._forgotten_at is not None and self._forgotten_at >= now - self._window.before_s and self._ring:
            self._notice("only the newest %.1f s fit into memory" % self._remembered_s)
        first = self._ring[0].log_time if self._ring else self._log_time()
        ring = set(map(id, self._ring))
        for item in list(self._latched.values()):
            if id(item) not in ring:
                self._write(item._replace(log_time=first))
        for item in self._ring:
            self._write(item)

    def _open(self) -> bool:
        try:
            self._files = self._open_file(self._stem, self._losses)
        except (BagError, OSError) as error:
            self.failures += 1
            self._notice("error: %s" % error)
            self._files = None
        return self._files is not None

    def _put(self, item: _Item) -> None:
        files = self._files
        if files is None:
            return
        if item.stream.connection.latching:
            self._latched_in_file.pop(item.stream, None)
            self._latched_in_file[item.stream] = item
        self._guarded(lambda: files.add(item.stream, item.log_time, item.publish_time, item.payload, item.number))

    def _write(self, item: _Item) -> None:
        """Write a message; where the file has its size, go on in another one that has the latched ones, too."""
        files = self._files
        if files is None:
            return
        self._put(item)
        limit = min(_LARGEST_FILE, self._keep.size // 4 or _LARGEST_FILE)
        if self._files is not None and files.size >= limit:
            before = self._stem
            self._finish()
            self._stem = new_stem(self._folder, "continued")
            self._count = 0
            self._remembered_s = 0.0
            self._open()
            self._note(Trigger("continued", "goes on from %s.mcap" % before.name, ""), item.log_time)
            for latched in list(self._latched_in_file.values()):
                self._put(latched._replace(log_time=item.log_time))

    def _guarded(self, work: Callable[[], Any]) -> None:
        """Do something with the file; where the system refuses, it ends there, and the black box goes on."""
        files = self._files
        try:
            work()
        except (BagError, OSError) as error:
            self._notice("error: %s" % error)
            self.failures += 1
            if files is not None:
                files.lose_chunk()
                self._finish()

    def _finish(self) -> None:
        files, self._files = self._files, None
        if files is None:
            return
        try:
            try:
                self._before_end(files)
            except (BagError, OSError) as error:
                self._notice("error: %s" % error)
            files.close()
            self.finished += files.finished
            self._notice("wrote %s: %d messages" % (files.finished[-1], files.messages))
            self._after_end(files.finished[-1])
            remove_old(self._folder, self._keep, self._notice)
        except (BagError, OSError) as error:
            self.failures += 1
            self._notice("error: %s" % error)
        self.messages += files.messages

    # What was lost in the time that a file covers

    def _counts(self) -> Dict[PublisherStream, _Lost]:
        return {s: (s.missing, s.undelivered or 0, s.overflowed, s.unwritten) for s in self._streams()}

    def _note_losses(self, now: float) -> None:
        if not self._accounts or now - self._accounts[-1][0] >= _ACCOUNT_PERIOD_S:
            self._accounts.append((now, self._counts()))
        begin = now - self._window.before_s - _MARGIN_S - 2 * _ACCOUNT_PERIOD_S if self._files is None else None
        while begin is not None and len(self._accounts) > 1 and self._accounts[1][0] <= begin:
            self._accounts.popleft()

    def _losses(self) -> Dict[str, TopicDrops]:
        """Return the drops since the oldest note in memory: those of all streams less earlier ones."""
        before: Dict[str, List[int]] = {}
        for stream, lost in (self._accounts[0][1] if self._accounts else {}).items():
            sums = before.setdefault(stream.connection.topic, [0, 0, 0, 0])
            before[stream.connection.topic] = [one + other for one, other in zip(sums, lost)]
        result = {}
        for topic, account in drops_by_topic(self._streams()).items():
            missing, undelivered, overflowed, unwritten = before.get(topic, [0, 0, 0, 0])
            result[topic] = account._replace(
                missing=None if account.missing is None else account.missing - missing,
                undelivered=None if account.undelivered is None else max(0, account.undelivered - undelivered),
                overflowed=account.overflowed - overflowed, unwritten=account.unwritten - unwritten)
        return result


def started_line(window: Window, folder: Path, triggers: Sequence[str]) -> str:
    """Return the line for the start: the extent of files, their folder, the memory needed, the triggers."""
    return "keeping the newest %g s in memory, at most %d MB; a file in %s at each trigger, until %g s after it: %s" % (
        window.before_s, (2 * window.memory_bytes + (1 << 20) - 1) >> 20, folder, window.after_s, ", ".join(triggers))
