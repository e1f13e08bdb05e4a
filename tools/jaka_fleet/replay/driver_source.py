"""A driver other than this package's: from a checkout, an installation or a version in git, packed as one archive.

The archive travels with the tasks, so that workers need neither the folder nor git.
"""
import io
import subprocess
import tarfile
from pathlib import Path
from typing import Iterator, List, NamedTuple, Optional, Tuple

from jaka_bag.errors import BagError, UsageError

PACKAGE, MESSAGES = "jaka_ros_driver", "jaka_msgs"
_NODE = Path("ros") / "node.py"
_INSTALLED = Path("lib") / "python3" / "dist-packages"
_WANTED = (".py", ".yaml")
_GIT_S = 60.0
"""Longest wait, s, for git, which may ask a server."""


class DriverSource(NamedTuple):
    """A driver to be judged.

    Attributes:
        name: For people: the folder, or version and commit.
        archive: The packages, a compressed tar; None for this package's own driver.
        has_messages: Its messages are in it; else the worker's are used.
    """

    name: str
    archive: Optional[bytes] = None
    has_messages: bool = False


THIS_DRIVER = DriverSource("the driver of this package")


def driver_source(wanted: Optional[str]) -> DriverSource:
    """Bundle the driver in a folder, or of a version: a tag, branch or commit of this package's checkout.

    Args:
        wanted: A checkout, an install space, or a version; None for this package's own driver.

    Raises:
        UsageError: There is no driver of that name.
    """
    if wanted is None:
        return THIS_DRIVER
    folder = Path(wanted)
    if folder.is_dir():
        return _of_folder(folder.resolve())
    return _of_version(wanted)


def _of_folder(folder: Path) -> DriverSource:
    place = next((place for place in (folder, folder / _INSTALLED, folder / "src" / PACKAGE)
                  if (place / PACKAGE / _NODE).is_file()), None)
    if place is None:
        raise UsageError("%s holds no driver: no %s" % (folder, Path(PACKAGE) / _NODE))
    messages = next((spot for spot in (place, folder / "devel" / _INSTALLED, folder / "install" / _INSTALLED)
                     if (spot / MESSAGES / "msg").is_dir() and (spot / MESSAGES / "__init__.py").is_file()), None)
    files = list(_files(place, PACKAGE)) + (list(_files(messages, MESSAGES)) if messages else [])
    return DriverSource(str(folder), _packed(files), messages is not None)


def _files(base: Path, package: str) -> Iterator[Tuple[str, bytes]]:
    for path in sorted((base / package).rglob("*")):
        if path.is_file() and path.suffix in _WANTED:
            yield path.relative_to(base).as_posix(), path.read_bytes()


def _packed(files: List[Tuple[str, bytes]]) -> bytes:
    """Write files to an archive reproducibly: the same bytes for the same files."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:bz2") as archive:
        for name, content in files:
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    return buffer.getvalue()


def _git(root: Path, *words: str) -> "subprocess.CompletedProcess[bytes]":
    try:
        return subprocess.run(["git", "-C", str(root), *words], capture_output=True, timeout=_GIT_S, check=False)
    except OSError as error:
        raise BagError("a version of the driver needs git: %s" % error.strerror) from error


def _of_version(version: str) -> DriverSource:
    root = Path(__file__).resolve().parents[3]
    if version.startswith("-"):
        raise UsageError("%s is no folder and no version" % version)
    if not (root / "package.xml").is_file():  # installed, perhaps below a git checkout of something else
        raise UsageError("%s is no folder; versions are those of a git checkout of the driver, and this is installed "
                         "in %s" % (version, root))
    for name in (version, "v" + version):
        found = _git(root, "rev-parse", "--verify", "--quiet", name + "^{commit}")
        if not found.returncode:
            break
    else:
        raise UsageError("%s is no folder, and no version in the git checkout %s" % (version, root))
    commit = found.stdout.decode().strip()
    packed = _git(root, "archive", "--format=tar", commit, PACKAGE)
    if packed.returncode:
        raise UsageError("version %s has no driver: %s" % (version, packed.stderr.decode("utf-8", "replace").strip()))
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        files = [(entry.name, _content(archive, entry)) for entry in archive
                 if entry.isfile() and Path(entry.name).suffix in _WANTED]
    return DriverSource("version %s (%s)" % (version, commit[:12]), _packed(files))


def _content(archive: tarfile.TarFile, entry: tarfile.TarInfo) -> bytes:
    file = archive.extractfile(entry)
    assert file is not None  # it is a plain file
    return file.read()


def unpack(source: DriverSource, folder: Path) -> Optional[Path]:
    """Unpack the driver into a folder, which is made; None where it is this package's own.

    Raises:
        BagError: The archive holds a path that leads elsewhere.
    """
    if source.archive is None:
        return None
    folder.mkdir()
    with tarfile.open(fileobj=io.BytesIO(source.archive)) as archive:
        for entry in archive:
            path = folder / entry.name
            if not entry.isfile() or ".." in Path(entry.name).parts or Path(entry.name).is_absolute():
                raise BagError("the driver's archive holds %s" % entry.name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(_content(archive, entry))
    return folder
