"""The files below a folder, read and replaced without ever following a link out of it."""
import contextlib
import errno
import os
import re
import stat
from typing import Callable, Iterator, NamedTuple, Optional, Tuple

LAUNCH, SOURCE = "launch", "program"
LARGEST = 4 * 1024 * 1024
"""Size of the largest file that is read, bytes; a launch or source file that people write is smaller."""

_LAUNCH_NAMES = (".launch", ".test", ".launch.xml")
_KINDS = {".py": ".py", ".sh": ".sh", ".bash": ".sh", ".yaml": ".yaml", ".yml": ".yaml", ".service": ".sh",
          ".c": ".cpp", ".cc": ".cpp", ".cpp": ".cpp", ".cxx": ".cpp", ".h": ".cpp", ".hh": ".cpp", ".hpp": ".cpp"}
_MANIFESTS = {"package.xml": "", "CMakeLists.txt": ".sh"}
_MADE = {"build", "devel", "install", "logs"}
"""Folders beside ``src`` that the build of a workspace makes."""
_PACKAGES = re.compile(rb"<name>\s*(jaka_(?:driver|msgs|planner|jog_panel|description|ros_driver))\s*</name>")
_BEFORE_THE_ROOT = ((b"<!--", b"-->"), (b"<?", b"?>"), (b"<!", b">"))
_NAME = re.compile(rb"[\w:.-]+")
_NOT_FOLLOWED = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
_OF_LINKS = (errno.ELOOP, errno.EMLINK, errno.ENOTDIR)
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | _NOT_FOLLOWED


class CellFile(NamedTuple):
    """A file that is looked at: its path relative to the folder, what it is, and the ending that tells its comments."""

    path: str
    what: str
    kind: str


class NotDone(Exception):
    """The error that a file was not read or not written; the text is the reason."""


class IsLink(NotDone):
    """The error that a path, or a folder on its way, is a link."""


def walk(root: str, note: Callable[[str, str], None]) -> Iterator[CellFile]:
    """Yield the launch files and source files below a folder; what is passed over is noted with its reason."""
    waiting = ["."]
    while waiting:
        where = waiting.pop()
        folder = os.path.join(root, where)
        try:
            names = sorted(os.listdir(folder))
        except OSError as error:
            note(where, _reason(error))
            continue
        package = _package(folder) if "package.xml" in names else ""
        if package and where != ".":
            note(where, "the package %s itself: stays as it is" % package)
            continue
        below = []
        for name in names:
            place, path = os.path.join(folder, name), _joined(where, name)
            if not os.path.isdir(place):
                one = _file(place, path)
                if one is not None:
                    yield one
            elif os.path.islink(place):
                note(path, "a link to a folder: not followed")
            elif not (name.startswith(".") or name == "__pycache__" or ("src" in names and name in _MADE)):
                below.append(path)
        waiting += reversed(below)


def single(name: str) -> CellFile:
    """Return one file of its own folder, whatever its name: a launch file unless its ending tells otherwise."""
    kind = _KINDS.get(os.path.splitext(name)[1])
    return CellFile(name, LAUNCH if kind is None and name not in _MANIFESTS else SOURCE, kind or "")


def read(root: str, path: str) -> bytes:
    """Return the bytes of a file; raise NotDone where it is a link, no plain file, too large, or cannot be read."""
    try:
        with _parent(root, path) as (folder, name):
            handle = os.open(name, os.O_RDONLY | os.O_NONBLOCK | _NOT_FOLLOWED, dir_fd=folder)
            with open(handle, "rb") as stream:
                status = os.fstat(handle)
                if not stat.S_ISREG(status.st_mode):
                    raise NotDone("no plain file: not read")
                data = stream.read(LARGEST + 1)
    except OSError as error:
        raise (IsLink if error.errno in _OF_LINKS else NotDone)(_reason(error)) from None
    if len(data) > LARGEST:
        raise NotDone("larger than %d MB: not read" % (LARGEST // 1024 // 1024))
    if b"\0" in data:
        raise NotDone("binary: not read")
    return data


def replace(root: str, path: str, before: bytes, after: bytes) -> None:
    """Keep a file's bytes as ``path.before`` and put others into it, each at once or not at all; its mode stays.

    Raises:
        NotDone: It has changed meanwhile, ``path.before`` is there already, or the system refuses.
    """
    if read(root, path) != before:
        raise NotDone("changed while it was looked at: not written")
    try:
        with _parent(root, path) as (folder, name):
            status = os.stat(name, dir_fd=folder, follow_symlinks=False)
            if os.access(name + ".before", os.F_OK, dir_fd=folder, follow_symlinks=False):
                raise NotDone("%s.before is there already: move it away first; not written" % name)
            _put(folder, name + ".before", before, status)
            _put(folder, name, after, status)
    except OSError as error:
        raise NotDone(_reason(error) + ": not written") from None


def _put(folder: int, name: str, data: bytes, like: os.stat_result) -> None:
    made = ".%s.%d.new" % (name[:200], os.getpid())
    handle = os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NOT_FOLLOWED, 0o600, dir_fd=folder)
    try:
        with open(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            own = os.fstat(handle)
            if (own.st_uid, own.st_gid) != (like.st_uid, like.st_gid):
                os.fchown(handle, like.st_uid, like.st_gid)
            os.fchmod(handle, stat.S_IMODE(like.st_mode))
            os.fsync(handle)
        os.replace(made, name, src_dir_fd=folder, dst_dir_fd=folder)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(made, dir_fd=folder)
        raise


@contextlib.contextmanager
def _parent(root: str, path: str) -> Iterator[Tuple[int, str]]:
    """Open the folder of a file, step by step from the root, no step of which may be a link."""
    *steps, name = path.split(os.sep)
    folder = os.open(root, _FOLDER)
    try:
        for step in steps:
            below = os.open(step, _FOLDER, dir_fd=folder)
            os.close(folder)
            folder = below
        yield folder, name
    finally:
        os.close(folder)


def _file(place: str, path: str) -> Optional[CellFile]:
    name = os.path.basename(place)
    if name.endswith(_LAUNCH_NAMES):
        return CellFile(path, LAUNCH, "")
    if name.endswith(".xml") and name not in _MANIFESTS and (
            os.path.islink(place) or _root(_head(place, LARGEST)) == b"launch"):
        return CellFile(path, LAUNCH, "")
    kind = _MANIFESTS.get(name, _KINDS.get(os.path.splitext(name)[1]))
    if kind is None and "." not in name:
        kind = _kind_by_first_line(place)
    return None if kind is None else CellFile(path, SOURCE, kind)


def _root(data: bytes) -> bytes:
    """Return the name of an XML file's first element, behind what may stand before it; empty where there is none."""
    place = data.find(b"<")
    while place >= 0:
        end = next((end for begin, end in _BEFORE_THE_ROOT if data.startswith(begin, place)), None)
        if end is None:
            name = _NAME.match(data, place + 1)
            return name.group() if name else b""
        place = data.find(end, place + 2)
        place = data.find(b"<", place) if place >= 0 else -1
    return b""


def _kind_by_first_line(place: str) -> Optional[str]:
    """Return what a file without an ending is by its first line; None where that names no interpreter."""
    first = _head(place, 100).partition(b"\n")[0]
    if not first.startswith(b"#!"):
        return None
    return ".py" if b"python" in first else ".sh" if first.rstrip().endswith(b"sh") else None


def _package(folder: str) -> str:
    found = _PACKAGES.search(_head(os.path.join(folder, "package.xml"), 10000))
    return found.group(1).decode() if found else ""


def _head(place: str, count: int) -> bytes:
    try:
        handle = os.open(place, os.O_RDONLY | os.O_NONBLOCK | _NOT_FOLLOWED)
    except OSError:
        return b""
    with open(handle, "rb") as stream:
        return stream.read(count) if stat.S_ISREG(os.fstat(handle).st_mode) else b""


def _joined(where: str, name: str) -> str:
    return name if where == "." else os.path.join(where, name)


def _reason(error: OSError) -> str:
    if error.errno in _OF_LINKS:
        return "a link: not followed"
    return (error.strerror or str(error)).lower()
