"""The file of a cell: one writer, revisions, kept versions, and writes that are whole or not at all.

Every method may wait for a disk and is called in a thread that may. ``cell.json`` stands beside ``cell.versions/``, of
which each file is what ``cell.json`` was before a change, and ``cell.audit/``, which says who made it.
"""
import contextlib
import hashlib
import json
import os
import re
import shutil
import stat
import threading
import time
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence

from .change_log import ChangeLog
from .contents import EMPTY, LARGEST, CellData, Change, WrongCell, cell_of, text_of, with_changes

KEPT = 100
"""Versions of before that are kept."""
_VERSION = re.compile(r"cell-([0-9]{9})(-broken)?\.json\Z")
_HEAD_LINE = re.compile(r'\s*"(saved|by)": (".*"),?\Z')
_HEAD, _HEAD_LINES = 2048, 8
_MODE = 0o640
_LOGGED = 6000
"""Longest account of a change in the log, characters; a longer one is told by its size, and stands in the versions."""


class StaleRevision(WrongCell):
    """The refusal of a change that was made to an older revision than the present one."""


class FileIdentity(NamedTuple):
    """The identity of a file's content: another writer leaves another one."""

    device: int
    number: int
    size: int
    changed_ns: int


class CellStore:
    """The data of one cell.

    Attributes:
        path: Of the file.
        cell: Its contents; replaced as a whole, never changed.
        problem: Why the file cannot be used; empty where it can.
    """

    def __init__(self, path: str, is_read_only: bool,
                 notify: Callable[[CellData, Optional[Sequence[Change]]], None]) -> None:
        """Set up; nothing is read or made before ``open``.

        Args:
            path: Of the file, which may be missing.
            is_read_only: Nothing is written, no log either, so that another panel may.
            notify: Called with each new state and with the changes that led there, None where all may be new.
        """
        self.path = os.path.realpath(os.path.expanduser(path))
        stem = os.path.splitext(self.path)[0]
        self.folder = stem + ".versions"
        self.cell = EMPTY
        self.problem = "the data of the cell are not read yet"
        self._log = None if is_read_only else ChangeLog(stem + ".audit")
        self._notify = notify
        self._identity: Optional[FileIdentity] = None
        self._lock = threading.Lock()

    def open(self) -> None:
        """Read the file and begin the log of changes."""
        with self._lock:
            self._read()
            if self._log is not None:
                self._log.start({"what": "cell", "file": self.path, "revision": self.cell.revision,
                             "sha256": hashlib.sha256(_bytes_of(self.path)).hexdigest(), "ok": not self.problem,
                             "message": self.problem, "process": os.getpid(), "user": os.getuid()})
            self._notify(self.cell, None)

    def close(self) -> None:
        """End the log; a running write is waited for no longer than the log is."""
        if self._log is not None:
            self._log.close()

    def look(self) -> None:
        """Read the file again where another process has written it."""
        with self._lock:
            self._follow()

    # ---- changes ----

    def change(self, revision: int, changes: Sequence[Change], who: Mapping[str, Any]) -> CellData:
        """Make changes; return the new state.

        Args:
            revision: The one that the writer has seen.
            changes: What is set and removed.
            who: Fields of the log about the writer; ``name`` is kept in the file, too.

        Raises:
            StaleRevision: There is a newer one.
            WrongCell: The file cannot be used, or too much would be in it.
            OSError: The disk does not take it; the file is as before.
        """
        with self._lock:
            self._require(revision, False)
            cell = self._next(with_changes(self.cell.data, changes), who)
            account: Any = [change._asdict() for change in changes]
            if len(str(account)) > _LOGGED:
                account = [list(change[:3]) + ["removed" if change.entry is None else "set"] for change in changes]
            self._write(cell, changes, {"what": "change", **who, "changes": account})
            return cell

    def replace(self, revision: int, text: str, who: Mapping[str, Any]) -> CellData:
        """Put what an exported text holds in the place of all data; a file that cannot be read is kept beside it.

        Raises:
            WrongCell: The text holds no cell; besides, as ``change``.
        """
        given = cell_of(text)
        with self._lock:
            self._require(revision, True)
            self._write(self._next(given.data, who), None, {
                "what": "import", **who, "imported_revision": given.revision, "imported_bytes": len(text)})
            return self.cell

    def restore(self, revision: int, version: int, who: Mapping[str, Any]) -> CellData:
        """Make the data of a kept version the present ones, as a change of its own.

        Raises:
            WrongCell: There is no such version; besides, as ``change``.
        """
        given = cell_of(self.text(version))
        with self._lock:
            self._require(revision, True)
            self._write(self._next(given.data, who), None, {"what": "restore", **who, "version": version})
            return self.cell

    def _require(self, revision: int, may_be_broken: bool) -> None:
        """Look at the file and at the log before a change; raise why it cannot be made."""
        self._follow()
        if self._log is None:
            raise WrongCell("this panel is read-only")
        if self.problem and not may_be_broken:
            raise WrongCell("%s. Nothing was changed: import a file, or restore a version" % self.problem)
        if revision != self.cell.revision:
            raise StaleRevision("the data have changed: revision %d is the present one, and this is a change of "
                                "revision %d. Nothing was changed" % (self.cell.revision, revision))
        trouble = self._log.trouble()
        if trouble:
            raise WrongCell("nothing was changed, because the log of changes cannot be written: %s" % trouble)

    def _next(self, data: Any, who: Mapping[str, Any]) -> CellData:
        saved = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        return CellData(self.cell.revision + 1, saved, str(who.get("name", "")), data)

    def _write(self, cell: CellData, changes: Optional[Sequence[Change]], account: Mapping[str, Any]) -> None:
        """Put a new state into the place of the file, which is kept as a version."""
        data = text_of(cell).encode("utf-8")
        os.makedirs(self.folder, mode=0o750, exist_ok=True)
        new = self.path + ".new"
        descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW, _MODE)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            self._keep()
            os.replace(new, self.path)
        except OSError:
            with contextlib.suppress(OSError):
                os.unlink(new)
            raise
        assert self._log is not None
        self._log.write({**account, "revision": cell.revision, "sha256": hashlib.sha256(data).hexdigest(), "ok": True})
        _sync(os.path.dirname(self.path))
        self.cell, self.problem, self._identity = cell, "", _identity_of(self.path)
        self._notify(cell, changes)
        self._prune()

    # ---- versions ----

    def _keep(self) -> None:
        """Keep the present file, if there is one, as a version; one that cannot be read is kept, too."""
        if self._identity is None:
            return
        name = "cell-%09d%s.json" % (self.cell.revision, "-broken" if self.problem else "")
        kept = os.path.join(self.folder, name)
        with contextlib.suppress(FileNotFoundError):
            os.unlink(kept)  # of a change that was not made after all
        try:
            os.link(self.path, kept)
        except OSError:  # not every file system can
            shutil.copyfile(self.path, kept)
        _sync(self.folder)

    def _prune(self) -> None:
        for name in sorted(self._names())[:-KEPT]:
            with contextlib.suppress(OSError):
                os.unlink(os.path.join(self.folder, name))

    def _names(self) -> List[str]:
        with contextlib.suppress(FileNotFoundError):
            return [name for name in os.listdir(self.folder) if _VERSION.match(name)]
        return []

    def versions(self) -> List[Dict[str, Any]]:
        """Return ``revision``, ``saved``, ``by`` of each kept version, newest first."""
        found = []
        for name in sorted(self._names(), reverse=True):
            match = _VERSION.match(name)
            if match is None or match.group(2):
                continue
            with contextlib.suppress(OSError):
                found.append({"revision": int(match.group(1)), **_head(os.path.join(self.folder, name))})
        return found

    def text(self, version: Optional[int] = None) -> str:
        """Return the present state, or a kept version, as a file's text; raise WrongCell where it is not there."""
        if version is None:
            return text_of(self.cell)
        try:
            return _text_of_file(os.path.join(self.folder, "cell-%09d.json" % version))
        except OSError:
            raise WrongCell("version %d is not kept" % version) from None

    # ---- reading ----

    def _follow(self) -> None:
        if self._identity != _identity_of(self.path):
            self._read()
            self._notify(self.cell, None)

    def _read(self) -> None:
        """Read the file, written by whomever; what cannot be read stays where it is."""
        before = self.cell.revision
        self.problem = ""
        try:
            self._identity = _identity_of(self.path)
            if self._identity is None:
                self.cell = EMPTY._replace(revision=before + 1 if before else self._newest() + 1)
                return
            cell = cell_of(_text_of_file(self.path))
        except (OSError, WrongCell) as error:
            self.problem = "%s cannot be used: %s" % (os.path.basename(self.path), error)
            self.cell = EMPTY._replace(revision=max(before, self._newest()) + 1)
            return
        if before and cell.revision <= before:  # somebody else wrote it: no page has seen this one
            cell = cell._replace(revision=before + 1)
        self.cell = cell

    def _newest(self) -> int:
        return max([int(name[5:14]) for name in self._names()] or [-1])


def _identity_of(path: str) -> Optional[FileIdentity]:
    try:
        found = os.stat(path)
    except FileNotFoundError:
        return None
    return FileIdentity(found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns)


def _bytes_of(path: str) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read(LARGEST + 1)
    except OSError:
        return b""


def _head(path: str) -> Dict[str, str]:
    """Return when and by whom a version was saved, from its first lines; empty texts where they are others."""
    found = {"saved": "", "by": ""}
    with open(path, "rb") as file:
        lines = file.read(_HEAD).decode("utf-8", "replace").splitlines()
    for line in lines[:_HEAD_LINES]:
        match = _HEAD_LINE.match(line)
        if match is not None:
            with contextlib.suppress(ValueError):
                found[match.group(1)] = str(json.loads(match.group(2)))
    return found


def _text_of_file(path: str) -> str:
    """Return a file's text; raise WrongCell where it is none, or too long, OSError where it cannot be read."""
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise WrongCell("it is no regular file")
    with open(path, "rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise WrongCell("it is longer than %d bytes" % LARGEST)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise WrongCell("it is no text: %s" % error) from None


def _sync(folder: str) -> None:
    """Have a folder's names on the disk, as far as its file system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
