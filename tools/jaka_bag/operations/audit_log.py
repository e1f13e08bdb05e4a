"""The chain of the driver's audit log, followed to the first line that was changed, is missing or is foreign.

A line is a JSON object with its number ``n``, the SHA-256 of the line before it (``prev``, of its bytes without the
line end) and, last, the CRC-32 of all that stands before that (``crc``). Lines are read one by one, in bounded memory.
docs/audit.md has the format, and lists changes that a whole chain does not show.
"""
import hashlib
import os
import re
import time
import zlib
from typing import Any, BinaryIO, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from ..errors import BagError
from ..json_text import load_json

SUFFIX = ".jsonl"
LONGEST_LINE = 16384
"""Length, byte, of the longest line that the driver writes."""
_BEFORE_THE_FIRST = "0" * 64
_CHECKSUM = re.compile(rb',"crc":"([0-9a-f]{8})"}\Z')
_NAME = re.compile(r"audit-([0-9]{12})\.jsonl\Z")
_LOCK = "lock"
"""The file by which a writer holds its folder, and which it leaves there: a log is or was in that folder."""
_LAST = 10 ** 15
_TOO_LONG = "foreign: longer than any line of this log"
_GROWING_S = 0.3
"""Time, s, within which a driver that writes a line has written it whole."""


class Defect(NamedTuple):
    """The first thing that is wrong.

    Attributes:
        path: The file.
        line: The line in that file, from 1 on; of lines that are missing the one that follows them.
        what: Description, beginning with changed, missing, out of order, cut or foreign.
    """

    path: str
    line: int
    what: str


class Account(NamedTuple):
    """The account of one log that was read.

    Attributes:
        place: The folder, or the only file.
        lines: Number of whole lines, up to a defect.
        files: Number of files, up to a defect.
        first_time, last_time: Times of the first and the last line, as written there; "" without a line.
        last_hash: SHA-256 of the last line's bytes, to be kept elsewhere.
        notes: The log's own records for the reader: lines that were cut, lost or pruned, a clock set.
        defect: The first one; None where the log is whole.
    """

    place: str
    lines: int
    files: int
    first_time: str
    last_time: str
    last_hash: str
    notes: Tuple[str, ...]
    defect: Optional[Defect]


def is_audit_log(path: str) -> bool:
    """Return whether a path is that of a folder, or of a file of an audit log by its name."""
    return path.endswith(SUFFIX) or os.path.isdir(path)


def verify_audit(paths: Sequence[str]) -> List[Account]:
    """Follow the chain in each log that these paths hold: files of one folder are one log, as are those of each folder.

    A log that is given as its folder must begin with its first line, or say that older lines were pruned.

    Raises:
        BagError: There is no audit log.
        OSError: A file or a folder cannot be read.
    """
    logs: Dict[str, List[str]] = {}
    whole = set()
    for path in paths:
        if os.path.isdir(path):
            found = False
            for folder, folders, names in os.walk(path, onerror=_refuse):
                folders.sort()
                files = [os.path.join(folder, name) for name in names if name.endswith(SUFFIX)]
                if files or _LOCK in names:
                    found = True
                    logs[folder] = files
                    whole.add(folder)
            if not found:
                raise BagError("%s: no audit log is in this folder" % path)
        else:
            folder = os.path.dirname(path) or "."
            if folder not in whole:
                files = logs.setdefault(folder, [])
                files += [] if path in files else [path]
    return [_read(folder if folder in whole or len(files) > 1 else files[0], folder in whole, files)
            for folder, files in logs.items()]


def _refuse(error: OSError) -> None:
    raise error


def _read(place: str, is_whole: bool, files: List[str]) -> Account:
    if not files:
        return Account(place, 0, 0, "", "", "", (), Defect(place, 1, "missing: no file of this log is left"))
    account = _Reader(place, is_whole).read(_in_order(files))
    if account.defect is not None and account.defect.what.startswith("cut"):
        time.sleep(_GROWING_S)
        return _Reader(place, is_whole).read(_in_order(files))
    return account


def _in_order(paths: List[str]) -> List[str]:
    """Sort files by the number of their first line, which their name has; a renamed file is asked itself."""
    def first_number(path: str) -> int:
        named = _NAME.match(os.path.basename(path))
        if named:
            return int(named.group(1))
        with _open(path) as file:
            fields, _ = _decode(file.readline(LONGEST_LINE + 2).rstrip(b"\n"))
        return _LAST if fields is None else int(fields["n"])
    return sorted(paths, key=lambda path: (first_number(path), path))


def _open(path: str) -> BinaryIO:
    if not os.path.isfile(path):
        raise BagError("%s: %s" % (path, "no regular file" if os.path.exists(path) else "no such file"))
    return open(path, "rb")


class _Gap:
    """Bytes that are no lines, until a line follows that explains them."""

    def __init__(self, line: int, why: str) -> None:
        self.line = line
        self.why = why
        self.size = 0
        self.ends_line = False
        self._digest = hashlib.sha256()
        self._held = b""

    def add(self, piece: bytes) -> None:
        """Add bytes to the gap; the last line end does not belong to it, but to the driver that continued."""
        self._digest.update(self._held + piece[:-1])
        self._held = piece[-1:]
        self.size += len(piece)
        self.ends_line = piece.endswith(b"\n")

    def is_that_of(self, fields: Dict[str, Any]) -> bool:
        """Return whether a line records these bytes, and no others, as the rest of a cut line."""
        return (fields.get("kind") == "cut" and fields.get("bytes") == self.size - 1
                and fields.get("sha256") == self._digest.hexdigest())


class _Reader:
    """The reader of one log."""

    def __init__(self, place: str, is_whole: bool) -> None:
        self._place = place
        self._is_whole = is_whole
        self._number = 0
        self._hash = ""
        self._begins_after: Optional[Tuple[int, str]] = None
        self._is_declared = False
        self._lines = self._files = 0
        self._first_time = self._last_time = ""
        self._last_kind = ""
        self._counts: Dict[str, int] = {}
        self._before: Tuple[str, int] = ("", 0)
        self._missing = 0

    def read(self, paths: List[str]) -> Account:
        """Read the files, which are in their order, up to the first defect."""
        defect: Optional[Defect] = None
        for index, path in enumerate(paths):
            self._files += 1
            defect = self._file(path, paths[index + 1:])
            if defect is not None:
                break
        if defect is None and self._is_whole and self._begins_after is not None and not self._is_declared:
            defect = Defect(paths[0], 1, "missing: lines 1 to %d, which no later line says were pruned"
                            % self._begins_after[0])
        return Account(self._place, self._lines, self._files, self._first_time, self._last_time, self._hash,
                       tuple(self._notes()), defect)

    def _file(self, path: str, later: List[str]) -> Optional[Defect]:
        gap: Optional[_Gap] = None
        line, ends_line = 0, True
        with _open(path) as file:
            for number, data, ends_line, is_rest in _lines(file):
                line = number
                fields, why = (None, _TOO_LONG) if is_rest else _decode(data)
                if fields is None:
                    gap = gap or _Gap(number, why)
                    gap.add(data + (b"\n" if ends_line else b""))
                    continue
                defect = self._line(path, number, data, fields, gap)
                if defect is not None:
                    return self._look_ahead(defect, file, later)
                gap = None
        if gap is not None:
            if gap.ends_line or later:
                return Defect(path, gap.line, gap.why)
            return Defect(path, gap.line, "cut: the last line is not whole; a driver that starts will say so in the "
                                          "log and go on behind it")
        if later and not ends_line:
            return Defect(path, line, "changed: its line end is missing")
        return None if line else Defect(path, 1, "cut: the file is empty")

    def _line(self, path: str, line: int, data: bytes, fields: Dict[str, Any], gap: Optional[_Gap]) -> Optional[Defect]:
        """Take a line whose checksum is right; return what is wrong with its place."""
        number, before = fields["n"], fields["prev"]
        is_cut = fields.get("kind") == "cut"
        if gap is not None and not (gap.is_that_of(fields) and self._follows(number, before)):
            return Defect(path, gap.line, gap.why)
        if is_cut and gap is None:
            return Defect(path, line, "missing: what this line says was left of a cut line")
        if not self._lines:
            if (number == 1) != (before == _BEFORE_THE_FIRST) or number < 1:
                return Defect(path, line, "changed: it has number %d, and %s" % (
                    number, "names a line before it" if number == 1 else "no line before it"))
            if number > 1:
                self._begins_after = (number - 1, before)
        elif number > self._number + 1:
            self._missing = self._number + 1
            return Defect(path, line, "missing: lines %d to %d" % (self._missing, number - 1))
        elif number <= self._number:
            return Defect(path, line, "foreign or out of order: number %d comes again behind number %d"
                          % (number, self._number))
        elif before != self._hash:
            return Defect(self._before[0], self._before[1], "changed: line %d of %s has the hash of another line here, "
                          "unless it is itself foreign" % (line, os.path.basename(path)))
        self._take(path, line, data, fields)
        return None

    def _follows(self, number: int, before: str) -> bool:
        if not self._lines:
            return (number == 1) == (before == _BEFORE_THE_FIRST)
        return number == self._number + 1 and before == self._hash

    def _take(self, path: str, line: int, data: bytes, fields: Dict[str, Any]) -> None:
        self._number, self._hash = fields["n"], hashlib.sha256(data).hexdigest()
        self._lines += 1
        self._before = (path, line)
        stamp, kind = str(fields.get("time", ""))[:40], str(fields.get("kind", ""))[:40]
        self._first_time = self._first_time or stamp
        self._last_time, self._last_kind = stamp, kind
        if kind == "lost":
            count = fields.get("count")
            what = "removed" if "sha256" in fields else "lost"
            self._count(what, count if type(count) is int and count > 0 else 1)
        elif kind in ("cut", "clock"):
            self._count(kind)
        elif kind == "pruned":
            self._count(kind)
            self._is_declared = self._is_declared or self._begins_after in _pruned(fields)

    def _look_ahead(self, defect: Defect, file: BinaryIO, later: List[str]) -> Defect:
        """Read ahead to distinguish missing lines from lines that come later."""
        if not self._missing:
            return defect
        for rest in [file, *map(_open, later)]:
            with rest:
                for _, data, _, _ in _lines(rest):
                    fields, _ = _decode(data)
                    if fields is not None and fields["n"] == self._missing:
                        return defect._replace(what="out of order: line %d comes later" % self._missing)
        return defect

    def _count(self, what: str, by: int = 1) -> None:
        self._counts[what] = self._counts.get(what, 0) + by

    def _notes(self) -> Iterator[str]:
        texts = {"cut": "%d times the end of a line was cut off; the line behind says so",
                 "lost": "%d lines were lost before they could be written",
                 "clock": "%d times the clock was found set",
                 "pruned": "%d times old files were pruned",
                 "removed": "%d lines were in files that were removed while the driver ran; a line says so"}
        for what, count in sorted(self._counts.items()):
            yield texts[what] % count
        if self._begins_after is not None:
            yield "it begins with line %d" % (self._begins_after[0] + 1)
        if self._lines and self._last_kind != "end":
            yield "the driver's end is not in it: it runs, or was cut off"


def _pruned(fields: Dict[str, Any]) -> List[Tuple[object, object]]:
    """Return number and hash of the last line of each file that a line records as pruned."""
    files = fields.get("files")
    return [(file.get("last"), file.get("sha256")) for file in files if isinstance(file, dict)] if isinstance(
        files, list) else []


def _lines(file: BinaryIO) -> Iterator[Tuple[int, bytes, bool, bool]]:
    """Yield number, bytes, whether there is a line end, of each line; one that is too long comes in pieces.

    The last value is True for every piece but the first one.
    """
    number, is_rest = 1, False
    for data in iter(lambda: file.readline(LONGEST_LINE + 2), b""):
        ends_line = data.endswith(b"\n")
        yield number, data[:-1] if ends_line else data, ends_line, is_rest
        is_rest = not ends_line
        number += ends_line


def _not_json(word: str) -> None:
    raise ValueError("%s is no word of JSON" % word)


def _decode(data: bytes) -> Tuple[Optional[Dict[str, Any]], str]:
    """Return the fields of a line, or None and what is wrong with it."""
    found = _CHECKSUM.search(data)
    if len(data) > LONGEST_LINE:
        return None, _TOO_LONG
    if found is None:
        return None, "changed or foreign: no checksum stands at its end"
    if int(found.group(1), 16) != zlib.crc32(data[:found.start()]):
        return None, "changed: its checksum is not that of its content"
    try:
        fields = load_json(data.decode("utf-8"), parse_constant=_not_json)
    except ValueError as error:
        return None, "foreign: not JSON: %s" % str(error)[:100]
    if not isinstance(fields, dict) or type(fields.get("n")) is not int or not isinstance(fields.get("prev"), str):
        return None, "foreign: it has no number, or names no line before it"
    return fields, ""
