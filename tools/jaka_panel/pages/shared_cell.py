"""The data of the cell, as pages see and change them; all file work runs in threads, away from stop and heartbeats."""
import asyncio
import functools
import json
import logging
import os
import time
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence

from ..authority.rate_limiter import RateLimiter
from ..cell.cell_store import CellStore, StaleRevision
from ..cell.contents import EMPTY, LARGEST, CellData, Change, check_change
from ..graph.calls import Calls
from ..graph.requests import Args, CallResult, whole
from .session import Session

_LOG = logging.getLogger(__name__)
MOST_CHANGES = 200
"""Changes in one message."""
WRITE_RATE, WRITE_BURST = 2.0, 20.0
"""Most writes a second and at once, of all pages together: each waits for a disk."""
MOST_PARTS = 64
"""Most parts of a file: a cell of 256 kB has to fit in messages of 64 kB; with more a page sends crumbs."""
_LIMIT_S = 10.0
"""Longest wait, s, for the disk."""
_LOOK_S = 2.0
"""Period, s, of the looks whether somebody else has changed the file."""
_LARGEST_REVISION = 10 ** 12
"""Largest revision, far beyond any count of changes: a number without a bound may have a million digits."""
_TOO_OFTEN = "too many changes of the cell's data at once: try again"


class _Upload(NamedTuple):
    """The parts of a file that have come from a page: their number in all, and those that are there."""

    total: int
    parts: List[str]


class SharedCell:
    """The cell's data for all pages of a hub; in the hub's loop."""

    def __init__(self, path: str, is_read_only: bool, tell_all: Callable[[Dict[str, Any]], None]) -> None:
        self._file = CellStore(path, is_read_only, self._notify)
        self._tell_all = tell_all
        self._calls = Calls()
        self._loop: Optional[asyncio.AbstractEventLoop] = None
        self._writes = RateLimiter(WRITE_RATE, WRITE_BURST, time.monotonic())
        self._uploads: Dict[str, _Upload] = {}
        self._told: Optional[str] = None
        self._cell = EMPTY
        self._problem = self._file.problem

    async def follow_for_ever(self) -> None:
        """Read the file, and again whenever another process has written it."""
        self._loop = asyncio.get_event_loop()
        work = self._file.open
        while True:
            try:
                await self._calls.run(work, _LIMIT_S)
                work = self._file.look
            except Exception:  # such as a disk that does not answer; the next look may be better
                _LOG.exception("the cell's data cannot be read")
            await asyncio.sleep(_LOOK_S)

    async def close(self) -> None:
        """End the log of changes."""
        try:
            await self._calls.run(self._file.close, _LIMIT_S)
        except Exception:  # whatever it was, the panel ends
            _LOG.exception("the log of the cell's data did not end in order")

    def _notify(self, cell: CellData, changes: Optional[Sequence[Change]]) -> None:
        """Pass a new state on to the loop; called in a thread."""
        assert self._loop is not None
        try:
            self._loop.call_soon_threadsafe(self._take, cell, self._file.problem, changes)
        except RuntimeError:
            _LOG.debug("the loop has ended before a change of the cell's data")

    def _take(self, cell: CellData, problem: str, changes: Optional[Sequence[Change]]) -> None:
        self._cell, self._problem, self._told = cell, problem, None
        self._tell_all({"t": "cell_changed", "revision": cell.revision, "by": cell.by, "problem": problem,
                        "changes": None if changes is None else [change._asdict() for change in changes]})

    @property
    def told(self) -> str:
        """The message ``cell`` with all data, JSON."""
        if self._told is None:
            cell = self._cell
            self._told = json.dumps({"t": "cell", "revision": cell.revision, "saved": cell.saved, "by": cell.by,
                                     "problem": self._problem, "file": os.path.basename(self._file.path),
                                     "data": cell.data})
        return self._told

    def entries(self, section: str, arm: str) -> Dict[str, Dict[str, Any]]:
        """Return the entries of an arm by name."""
        return dict(self._cell.data.get(section, {}).get(arm, {}))

    def forget(self, page: str) -> None:
        """Drop what a page has uploaded and not imported."""
        self._uploads.pop(page, None)

    # ---- commands; each returns what the page is answered ----

    async def change(self, page: Session, args: Args) -> CallResult:
        """Set and remove entries."""
        changes = args.get("changes")
        if not isinstance(changes, list) or not 1 <= len(changes) <= MOST_CHANGES:
            return CallResult(False, "changes must be a list of 1 to %d" % MOST_CHANGES)
        checked = [check_change(change, number) for number, change in enumerate(changes, 1)]
        return await self._write(page, functools.partial(self._file.change, _revision(args), checked), checked)

    async def upload(self, page: Session, args: Args) -> CallResult:
        """Take one part of a file; with the last one, put what it holds in the place of all data."""
        parts = whole(args, "parts", 1, MOST_PARTS)
        part, text = whole(args, "part", 1, parts), args.get("text")
        if not isinstance(text, str):
            return CallResult(False, "text must be a text")
        there = self._uploads.pop(page.id, None) if part > 1 else _Upload(parts, [])
        if there is None or there.total != parts or len(there.parts) != part - 1:
            return CallResult(False, "the parts of the file do not follow each other: nothing was changed")
        there.parts.append(text)
        if sum(map(len, there.parts)) > LARGEST:
            return CallResult(False, "the file is longer than %d bytes: nothing was changed" % LARGEST)
        if part < parts:
            self._uploads[page.id] = there
            return CallResult(True, "")
        return await self._write(page, functools.partial(self._file.replace, _revision(args), "".join(there.parts)))

    async def restore(self, page: Session, args: Args) -> CallResult:
        """Make a kept version the present one."""
        version = whole(args, "version", 0, _LARGEST_REVISION)
        return await self._write(page, functools.partial(self._file.restore, _revision(args), version))

    async def versions(self, page: Session, args: Args) -> CallResult:
        """List the kept versions."""
        found = await self._calls.run(self._file.versions, _LIMIT_S)
        return CallResult(True, "", {"versions": found})

    async def export(self, page: Session, args: Args) -> CallResult:
        """Return the text of the present file, or of a kept version."""
        version = None if args.get("version") is None else whole(args, "version", 0, _LARGEST_REVISION)
        if version is None and self._problem:
            return CallResult(False, self._problem)
        text = await self._calls.run(lambda: self._file.text(version), _LIMIT_S)
        return CallResult(True, "", {"text": text})

    async def _write(self, page: Session, write: Callable[[Mapping[str, Any]], CellData],
                     changes: Sequence[Change] = ()) -> CallResult:
        if not page.may_command:
            return CallResult(False, "this panel is read-only" if page.has_token else "this needs the token")
        if not self._writes.spend(time.monotonic()):
            return CallResult(False, _TOO_OFTEN)
        who = {"page": page.id, "name": page.name, "host": page.address}
        try:
            cell = await self._calls.run(lambda: write(who), _LIMIT_S)
        except StaleRevision as error:
            present = self._file.cell
            return CallResult(False, str(error), {"stale": True, "revision": present.revision,
                                                  "present": _entries(present, changes)})
        except OSError as error:
            return CallResult(False, "nothing was changed: %s" % error)
        return CallResult(True, "", {"revision": cell.revision})


def _entries(cell: CellData, changes: Sequence[Change]) -> List[Dict[str, Any]]:
    """Return the entries that changes name, as they are, each once and in the form of a change."""
    places = dict.fromkeys((section, arm, name) for section, arm, name, _ in changes)
    return [{"section": section, "arm": arm, "name": name,
             "entry": cell.data.get(section, {}).get(arm, {}).get(name)} for section, arm, name in places]


def _revision(args: Args) -> int:
    return whole(args, "revision", 0, _LARGEST_REVISION)
