"""The audit log of one arm: callers queue lines, and a thread of its own writes them.

A caller never waits for a disk. While the disk takes nothing, lines wait in memory; those that find no room there are
counted, and the count is written as a line of its own as soon as lines can be written again. So is the number of lines
that were written and whose file somebody has removed meanwhile.
"""
import contextlib
import logging
import os
import threading
import time
from collections import deque
from queue import Empty, SimpleQueue
from typing import Any, Callable, Deque, Dict, List, Mapping, NamedTuple, Optional, Tuple

from jaka_ros_driver.audit.chain import START, ChainLink, encode, link_of
from jaka_ros_driver.audit.folder import AuditFolder, LogEnd

_LOG = logging.getLogger(__name__)

MOST_WAITING = 2000
"""Most lines that wait in memory for a disk."""
FILE_BYTES = 8 << 20
"""Size, byte, of a file after which the next one begins: old lines are deleted file by file."""
SYNC_PERIOD_S = 1.0
"""Longest time, s, until lines are on the disk, as far as the disk honours fsync."""
_TURN_S = 0.25
"""Longest wait, s, of the writing thread: its delay in seeing a file that was removed, or a disk that has room."""
_BATCH = 250
"""Most lines taken over before they are written: of a backlog the first ones are on the disk soon."""
_RETRY_PERIOD_S = 1.0
"""Pause, s, between attempts to write on a disk that refuses; meanwhile lines wait in memory."""
_STUCK_S = 5.0
"""Time, s, that one write may take before the log reports that the disk does not answer."""
_WARN_PERIOD_S = 60.0
"""Least time, s, between two warnings, of a disk that refuses again and again."""
_CLOCK_STEP_S = 0.5
"""Least step, s, of the wall clock that gets a line of its own; ntpd slews by 0.5 ms/s at most, so seldom by so much.
"""
_NS = 1e-9
_DAY_S = 86400.0
"""A day, s."""


class _Record(NamedTuple):
    """A line without a number yet: Unix time and monotonic time, ns; ``is_urgent``: to be on the disk at once."""

    wall: int
    monotonic: int
    kind: str
    fields: Mapping[str, Any]
    is_urgent: bool


class Health(NamedTuple):
    """The condition of the log.

    Attributes:
        trouble: Why lines cannot be written now; "" where they can.
        waiting: Lines in memory.
        lost: Lines that were lost since the start, those among them that were written and then removed.
        written: Lines that were written since the start.
        link: The place of the last line.
        lag: Age of the oldest line in memory, s; 0 without one.
    """

    trouble: str
    waiting: int
    lost: int
    written: int
    link: ChainLink
    lag: float = 0.0


class AuditLog:
    """The log of one arm. ``write`` may be called from any thread."""

    def __init__(self, folder: str, days: float, file_bytes: int = FILE_BYTES,
                 most_waiting: int = MOST_WAITING) -> None:
        """Set up the log; ``start`` begins to write.

        Args:
            folder: Of this log alone; it is created where it is missing.
            days: Age of a file's last line at which the file is deleted; 0 for never.
            file_bytes: Size at which a file is followed by the next.
            most_waiting: Lines that wait in memory at most.
        """
        self.path = folder
        self._folder = AuditFolder(folder)
        self._days = days
        self._file_bytes = file_bytes
        self._most_waiting = most_waiting
        self._queue: SimpleQueue[Optional[_Record]] = SimpleQueue()
        self._pending: Deque[_Record] = deque()
        self._unsure: List[Tuple[_Record, int]] = []
        self._tasks: List[Callable[[], None]] = []
        self._lost_lock = threading.Lock()
        self._lost: List[int] = []
        self._lost_in_all = 0
        self._gone: Optional[Dict[str, Any]] = None
        self._told: List[Tuple[int, int]] = []
        self._descriptor: Optional[int] = None
        self._size = 0
        self._link = START
        self._offset: Optional[int] = None
        self._written = 0
        self._is_dirty = False
        self._is_pruning_due = True
        self._synced_at = self._retry_at = self._looked_at = 0.0
        self._warned_at = -_WARN_PERIOD_S
        self._trouble = ""
        self._busy_since: Optional[float] = None
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="audit log", daemon=True)

    def start(self) -> None:
        """Start the writing thread."""
        self._thread.start()

    def add_task(self, task: Callable[[], None]) -> None:
        """Have the writing thread call ``task`` a few times a second."""
        self._tasks.append(task)

    def write(self, kind: str, fields: Mapping[str, Any], is_urgent: bool = False) -> None:
        """Queue a line for writing; return at once.

        Args:
            kind: The kind of line; docs/audit.md lists them.
            fields: The rest of the line; plain values, which are not changed afterwards.
            is_urgent: It is to be on the disk at once, and not within ``SYNC_PERIOD_S``.
        """
        wall, monotonic = time.time_ns(), time.monotonic_ns()
        if self._waiting >= self._most_waiting:
            with self._lost_lock:
                self._lost_in_all += 1
                self._lost = [self._lost[0] + 1, self._lost[1], wall] if self._lost else [1, wall, wall]
            return
        self._queue.put(_Record(wall, monotonic, kind, fields, is_urgent))

    def health(self) -> Health:
        """Return the condition of the log."""
        busy_since = self._busy_since
        trouble = self._trouble
        if not trouble and busy_since is not None and time.monotonic() - busy_since > _STUCK_S:
            trouble = "the disk does not answer"
        return Health(trouble, self._waiting, self._lost_in_all, self._written, self._link, self._lag())

    def close(self, timeout: float) -> bool:
        """Write the waiting lines, if the disk takes them within ``timeout`` s, and end; return False where lines are
        left.
        """
        self._is_closing = True
        self._queue.put(None)
        if self._thread.is_alive():
            self._thread.join(timeout)
        return not self._thread.is_alive() and not self._waiting

    @property
    def _waiting(self) -> int:
        return self._queue.qsize() + len(self._pending) + len(self._unsure)

    def _lag(self) -> float:
        with contextlib.suppress(IndexError):  # the writing thread has just taken the last one
            oldest = self._unsure[0][0] if self._unsure else self._pending[0]
            return 1e-9 * (time.monotonic_ns() - oldest.monotonic)
        return 0.0

    # ---- the thread ----

    def _run(self) -> None:
        while True:
            self._collect()
            is_last = self._is_closing  # before the last look at the file
            try:
                for task in self._tasks:
                    task()
            except Exception:
                _LOG.exception("a task of the audit log has a defect")
            try:
                self._flush()
            except Exception:  # a defect must cost lines and not the log
                _LOG.exception("the audit log has a defect")
                self._drop()
            if is_last and (self._trouble or not self._pending and self._queue.empty()):
                break
        self._release()

    def _collect(self) -> None:
        """Take over lines that wait; where there are none, wait for some."""
        with contextlib.suppress(Empty):
            record = self._queue.get(timeout=_TURN_S)
            while True:
                if record is not None:
                    self._pending.append(record)
                if len(self._pending) >= _BATCH:
                    break
                record = self._queue.get_nowait()

    def _flush(self) -> None:
        now = time.monotonic()
        if self._trouble and now < self._retry_at and not self._is_closing:
            time.sleep(min(_TURN_S, self._retry_at - now))
            return
        self._busy_since = now
        try:
            self._look(now)
            if self._descriptor is None:
                self._open()
            self._put_pending()
            self._write_losses()
            self._prune()
            if self._is_dirty and time.monotonic() - self._synced_at >= SYNC_PERIOD_S:
                self._sync()
            if self._trouble:
                _LOG.warning("the audit log in %s is written again", self.path)
                self._trouble = ""
        except OSError as error:
            self._fail(error)
        finally:
            self._busy_since = None

    def _look(self, now: float) -> None:
        """Look a few times a second whether somebody has removed or replaced the file, and begin anew then."""
        if self._descriptor is None or now - self._looked_at < _TURN_S and not self._is_closing:
            return
        self._looked_at = now
        try:
            self._folder.check(self._descriptor)
        except OSError as error:
            _LOG.warning("the audit log is begun anew: %s", error)
            self._close_file()

    def _put_pending(self) -> None:
        """Write the collected lines as one piece."""
        data: List[bytes] = []
        is_urgent = False
        link, offset = self._link, self._offset
        while self._pending:
            record = self._pending[0]
            step = self._clock_step(record, offset)
            offset = record.wall - record.monotonic
            for each in ([] if step is None else [step]) + [record]:
                line = self._line(link, each)
                link = link_of(line, link.number + 1)
                data.append(line + b"\n")
            self._unsure.append((self._pending.popleft(), link.number))
            is_urgent = is_urgent or record.is_urgent
        if data:
            self._put(b"".join(data), link)
            self._offset = offset
            self._written += len(data)
            if is_urgent:
                self._sync()
            self._unsure.clear()

    def _put(self, data: bytes, link: ChainLink) -> None:
        """Append whole lines, in the next file where this one is full; raise OSError where the disk refuses."""
        if self._size >= self._file_bytes:
            self._sync()
            assert self._descriptor is not None
            os.close(self._descriptor)
            self._descriptor = None
            self._descriptor = self._folder.make_next(self._link.number + 1)
            self._size = 0
            self._is_pruning_due = True
        assert self._descriptor is not None
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._descriptor, rest):]
        self._size += len(data)
        self._link = link
        self._is_dirty = True

    def _put_own(self, kind: str, fields: Mapping[str, Any]) -> None:
        """Write a line that the log has about itself."""
        line = self._line(self._link, _Record(time.time_ns(), time.monotonic_ns(), kind, fields, False))
        self._put(line + b"\n", link_of(line, self._link.number + 1))
        self._written += 1

    def _line(self, after: ChainLink, record: _Record) -> bytes:
        head = {"time": iso(record.wall), "up": round(record.monotonic * _NS, 6), "kind": record.kind}
        try:
            return encode(after, {**head, **record.fields})
        except (TypeError, ValueError) as error:
            return encode(after, {**head, "left_out": "cannot be written: %s" % error})

    @staticmethod
    def _clock_step(record: _Record, offset: Optional[int]) -> Optional[_Record]:
        """Return a line about a clock that was set since the previous line; None where it was not."""
        step = 0.0 if offset is None else (record.wall - record.monotonic - offset) * _NS
        if abs(step) < _CLOCK_STEP_S:
            return None
        text = "the clock was set %s by %.3f s" % ("forward" if step > 0.0 else "back", abs(step))
        return record._replace(kind="clock", fields={"step_s": round(step, 6), "text": text})

    def _write_losses(self) -> None:
        """Write how many lines were lost, once there is room again."""
        if not self._lost or not self._queue.empty():
            return
        with self._lost_lock:
            told = self._lost
        count, since, until = told
        self._put_loss({"count": count, "from": iso(since), "to": iso(until)})
        with self._lost_lock:
            more = self._lost[0] - count
            self._lost = [more, until, self._lost[2]] if more else []
        _LOG.warning("%d lines of the audit log were lost", count)

    def _put_loss(self, fields: Mapping[str, Any]) -> None:
        self._put_own("lost", fields)
        self._told.append((self._link.number, fields["count"]))

    # ---- files ----

    def _open(self) -> None:
        """Open the log where it ends on the disk, whoever wrote it and however that ended."""
        self._folder.take()
        end = self._folder.end()
        before, self._link, self._size = self._link, end.link, 0
        again = 0
        for record, number in reversed(self._unsure):  # what of the last try is on the disk, and what is not
            if number > end.link.number:
                self._pending.appendleft(record)
                again += number <= before.number
        self._unsure.clear()
        self._note_gone(before, again, end)
        self._descriptor = self._folder.open_newest(end.name) if end.name else self._folder.make_next(1)
        if end.tail is not None or end.lacks_line_end:
            self._put(b"\n", self._link)
        if end.tail is not None:
            self._put_own("cut", {"bytes": end.tail.size, "sha256": end.tail.sha256, "text": "what stands before this "
                                  "line is what was left of lines that could not be written to their end"})
        self._size += end.size  # only now: what ends a cut line belongs behind it, however large the file is
        if self._gone is not None:
            self._put_loss(self._gone)
            self._gone = None
        if self._offset is None and end.time > iso(time.time_ns()):
            self._put_own("clock", {"before": end.time, "text": "the last line before has a later time than now"})

    def _note_gone(self, before: ChainLink, again: int, end: LogEnd) -> None:
        """Count the lines up to ``before`` that are no longer in the log, but for those that are written ``again``.

        A line about losses that is gone itself leaves its number to the next one.
        """
        count = before.number - end.link.number - again
        if count <= 0:
            return
        with self._lost_lock:
            self._lost_in_all += count
        _LOG.warning("%d lines of the audit log in %s were removed", count, self.path)
        count += sum(told for number, told in self._told if number > end.link.number)
        self._told = [(number, told) for number, told in self._told if number <= end.link.number]
        earlier = self._gone or {"count": 0, "from": end.time}
        self._gone = {"count": earlier["count"] + count, "from": earlier["from"], "to": iso(time.time_ns()),
                      "last": before.number, "sha256": before.sha256,
                      "text": "these lines were written, and their file was removed; sha256 is of the last one"}

    def _prune(self) -> None:
        """Delete old files at the start and with each new file, after a line that names them is on the disk.

        At other times nothing is deleted: a clock that is wrong by years costs two files at a time.
        """
        if not self._days or not self._is_pruning_due:
            return
        self._is_pruning_due = False
        old = self._folder.older_than(iso(time.time_ns() - int(self._days * _DAY_S / _NS)))
        if old:
            self._put_own("pruned", {"days": self._days, "files": [file._asdict() for file in old]})
            self._sync()
            self._folder.delete(old)

    def _sync(self) -> None:
        """Have the lines on the disk; raise OSError where it refuses, or where their file was removed."""
        assert self._descriptor is not None
        self._folder.check(self._descriptor)
        os.fsync(self._descriptor)
        self._is_dirty, self._synced_at = False, time.monotonic()

    def _fail(self, error: OSError) -> None:
        """Close the file after an error; a later try looks at what became of it."""
        self._close_file()
        now = time.monotonic()
        self._retry_at = now + _RETRY_PERIOD_S
        is_new, self._trouble = not self._trouble, str(error)
        if is_new and now - self._warned_at >= _WARN_PERIOD_S:
            self._warned_at = now
            _LOG.warning("the audit log in %s cannot be written: %s. All else goes on; %d lines wait in memory at "
                         "most, what is beyond that is counted", self.path, error, self._most_waiting)

    def _drop(self) -> None:
        with self._lost_lock:
            count, now = max(1, len(self._pending) + len(self._unsure)), time.time_ns()
            self._lost_in_all += count
            self._lost = [self._lost[0] + count, self._lost[1], now] if self._lost else [count, now, now]
        self._pending.clear()
        self._unsure.clear()
        self._close_file()
        time.sleep(_TURN_S)

    def _close_file(self) -> None:
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
            self._descriptor = None

    def _release(self) -> None:
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                self._sync()
        self._close_file()
        self._folder.release()


def iso(wall: int) -> str:
    """Return a Unix time, ns, as UTC in the form of ISO 8601, to the microsecond."""
    seconds, rest = divmod(wall, 1000000000)
    return "%s.%06dZ" % (time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(seconds)), rest // 1000)
