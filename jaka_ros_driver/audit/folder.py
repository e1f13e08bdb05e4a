"""The files of one audit log: their names, the end of the chain in them, and the age at which they are deleted.

A file is named after the number of its first line. Files are only appended to. What a loss of power left of a line
stays where it is; the next line records its length and its hash.
"""
import contextlib
import errno
import fcntl
import hashlib
import os
import re
from typing import Dict, List, NamedTuple, Optional, Tuple

from jaka_ros_driver.audit.chain import LONGEST_LINE, START, ChainLink, decode, is_whole, link_of

_NAME = re.compile(r"audit-([0-9]{12})\.jsonl\Z")
_PIECE = 1 << 16
"""Bytes hashed at a time: a torn tail of any length takes no more memory."""
_MOST_PRUNED = 2
"""Most files deleted at a time: a clock that is wrong by years must not cost the whole log."""


class Tail(NamedTuple):
    """The bytes behind the last whole line of a file: ``size`` of them, with this ``sha256``."""

    size: int
    sha256: str


class LogEnd(NamedTuple):
    """The end of a log: its last file and line.

    Attributes:
        name: Of the newest file; "" where there is none.
        size: Of that file, bytes.
        link: The place of the last whole line in the log.
        time: That line's time, as it stands there; "" without one.
        tail: What stands behind it and is no line; None for nothing.
        lacks_line_end: The last line is whole except for its line end.
    """

    name: str
    size: int
    link: ChainLink
    time: str
    tail: Optional[Tail]
    lacks_line_end: bool


class OldFile(NamedTuple):
    """A file that is deleted: its name, the numbers of its first and last line, the hash of the last one."""

    name: str
    first: int
    last: int
    sha256: str


class LogInUse(OSError):
    """The error that another process writes this log."""


class AuditFolder:
    """The folder of one log, created when it is first used. Errors are OSErrors."""

    def __init__(self, path: str) -> None:
        self.path = path
        self._lock: Optional[int] = None
        self._opened = ""
        self._ages: Dict[str, Optional[Tuple[str, OldFile]]] = {}

    def take(self) -> None:
        """Create the folder and lock it for this process, until ``release``; raise LogInUse where another has it.

        A lock on a file that was removed locks nothing: it is taken anew.
        """
        path = self._path("lock")
        if self._lock is not None:
            if _is_at(self._lock, path):
                return
            self.release()
        self._ages.clear()
        os.makedirs(self.path, mode=0o750, exist_ok=True)
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not _is_at(lock, path):
                raise _removed(path)
        except OSError as error:
            os.close(lock)
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                raise LogInUse(errno.EBUSY, "another process writes this log", self.path) from None
            raise
        self._lock = lock

    def check(self, descriptor: int) -> None:
        """Raise OSError where the file that was opened last, or the lock, is no longer the one in the folder."""
        assert self._lock is not None
        for each, path in ((descriptor, self._path(self._opened)), (self._lock, self._path("lock"))):
            if not _is_at(each, path):
                raise _removed(path)

    def release(self) -> None:
        """Unlock the folder for other processes."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def names(self) -> List[str]:
        """Return the names of the log's files, oldest first."""
        return sorted(name for name in os.listdir(self.path) if _NAME.match(name))

    def end(self) -> LogEnd:
        """Find where the log ends: read the newest file, and older ones where that one has no line."""
        names = self.names()
        newest = _Scan(self._path(names[-1])) if names else None
        last = newest
        for name in reversed(names[:-1]):
            if last is None or last.link is not None:
                break
            last = _Scan(self._path(name))
        link = START if last is None or last.link is None else last.link
        return LogEnd(names[-1] if names else "", newest.size if newest else 0, link, last.time if last else "",
                      newest.tail if newest else None, newest.lacks_line_end if newest else False)

    def open_newest(self, name: str) -> int:
        """Open a file for appending lines; return its descriptor."""
        self._opened = name
        return os.open(self._path(name), os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW)

    def make_next(self, number: int) -> int:
        """Create the file whose first line has this number, and open it as ``open_newest`` does."""
        self._opened = "audit-%012d.jsonl" % number
        descriptor = os.open(self._path(self._opened),
                             os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
        with contextlib.suppress(OSError):  # not every file system can
            self._sync_names()
        return descriptor

    def older_than(self, oldest: str) -> List[OldFile]:
        """Return the oldest files whose last line has a time before this one; two at most, never the newest file."""
        old: List[OldFile] = []
        for name in self.names()[:-1][:_MOST_PRUNED]:
            if name not in self._ages:  # a file that is not the newest does not change
                scan = _Scan(self._path(name))
                self._ages[name] = None if scan.link is None or not scan.time else (
                    scan.time, OldFile(name, scan.first, scan.link.number, scan.link.sha256))
            known = self._ages[name]
            if known is None or known[0] >= oldest:
                break
            old.append(known[1])
        return old

    def delete(self, files: List[OldFile]) -> None:
        """Delete these files; those that are gone already count as deleted."""
        for file in files:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(self._path(file.name))

    def _path(self, name: str) -> str:
        return os.path.join(self.path, name)

    def _sync_names(self) -> None:
        descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _is_at(descriptor: int, path: str) -> bool:
    """Return whether a path is still that of an open file, which nobody has removed or replaced."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except (FileNotFoundError, NotADirectoryError):
        return False


def _removed(path: str) -> OSError:
    return OSError(errno.ENOENT, "was removed or replaced while it was open", path)


class _Scan:
    """The result of reading one file to its end.

    Attributes:
        size: Of the file, bytes.
        first: The number of its first whole line; 0 where it has none.
        link: The place of its last whole line; None where it has none.
        time: That line's time.
        tail, lacks_line_end: As ``LogEnd`` has them.
    """

    def __init__(self, path: str) -> None:
        first = last = b""
        behind = self.size = 0
        digest = hashlib.sha256()
        with open(path, "rb") as file:
            for line in iter(lambda: file.readline(LONGEST_LINE + 2), b""):
                self.size += len(line)
                if is_whole(line.rstrip(b"\n")):
                    first, last, behind = first or line, line, self.size
            file.seek(behind)
            for piece in iter(lambda: file.read(_PIECE), b""):
                digest.update(piece)
        self.tail = Tail(self.size - behind, digest.hexdigest()) if self.size > behind else None
        self.lacks_line_end = bool(last) and not last.endswith(b"\n")
        self.first = (decode(first.rstrip(b"\n")) or {"n": 0})["n"]
        fields = decode(last.rstrip(b"\n"))
        self.link = None if fields is None else link_of(last.rstrip(b"\n"), fields["n"])
        self.time = "" if fields is None else str(fields.get("time", ""))
