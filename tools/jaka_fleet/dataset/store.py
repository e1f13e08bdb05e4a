"""The place of a data set: a folder, or what fsspec reaches by a URL, as ``s3://``.

Files appear whole: they are made in a folder of their own beside the data set (``Staging``), then given their names. In
a folder, who publishes, tidies up or compacts holds a lock alone for these few renames, and who reads the table of runs
shares it, so none of them sees the other's work half done. An object store has no such lock: one process at a time may
compact there, and two that add the same log at the same time may both do it.
"""
import contextlib
import errno
import fcntl
import importlib
import json
import os
import shutil
import tempfile
import uuid
from pathlib import Path
from typing import Any, BinaryIO, Callable, Iterator, List, Sequence, Tuple

from jaka_bag.errors import BagError, MissingDependency
from jaka_bag.output_file import is_being_written

_STAGING = ".staging"
_LOCK = ".lock"
_PLAN = "plan.json"
_ALIVE = "alive"


class Staging:
    """A folder for files that are to be published together.

    Attributes:
        folder: Folder to make them in.
        is_unfinished: Some may have their names, and the last has not: the folder is kept, so that it tells which.
    """

    def __init__(self, store: "Store", folder: Path) -> None:
        self._store = store
        self.folder = folder
        self.is_unfinished = False

    def publish(self, files: Sequence[Tuple[Path, str]], is_wanted: Callable[[], bool] = lambda: True) -> bool:
        """Give files their names in the data set, in this order: what the last one tells of is there when it appears.

        Args:
            files: Path here, and name in the data set.
            is_wanted: Is asked while nobody else can publish; where it says no, nothing is done.

        Returns:
            Whether it was wanted.

        Raises:
            OSError: The system refused; nothing, or all but the last, may have its name. ``tidy_up`` takes back those.
        """
        for path, _ in files:
            _flush(path)
        (self.folder / _PLAN).write_text(json.dumps([name for _, name in files]), encoding="utf-8")
        with self._store.alone():
            if not is_wanted():
                return False
            self._store.take_back([name for _, name in files])
            self.is_unfinished = True
            for path, name in files:
                self._store.place(path, name)
            self.is_unfinished = False
        return True

    def place(self, path: Path, name: str) -> None:
        """Give one file its name, for whoever is alone."""
        _flush(path)
        self._store.place(path, name)


def _flush(path: Path) -> None:
    """Flush a file to the disk before it is renamed: else a power cut may leave the new name with an empty file."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


class Store:
    """A data set's files; their names are relative, with ``/``.

    Attributes:
        location: Folder or URL as the user gave it.
    """

    def __init__(self, location: str) -> None:
        self.location = location

    def address(self, name: str) -> str:
        """Return path or URL of a file, for other software."""
        return "%s/%s" % (self.location.rstrip("/"), name)

    def exists(self, name: str) -> bool:
        """Return whether there is a file or folder of that name."""
        raise NotImplementedError

    def names(self, folder: str) -> List[str]:
        """Return the sorted names in a folder, without the folder's; none if it is not there."""
        raise NotImplementedError

    def stamp(self, name: str) -> Tuple[int, ...]:
        """Return what is another whenever a file is replaced; nothing where it is not there, or nobody can tell."""
        return ()

    def open(self, name: str) -> BinaryIO:
        """Open a file for reading, seekable.

        Raises:
            OSError: It is not there.
        """
        raise NotImplementedError

    def place(self, path: Path, name: str) -> None:
        """Give a local file that is whole a name here, in place of what has it; the local one may be gone then."""
        raise NotImplementedError

    def remove(self, name: str) -> None:
        """Remove a file, where it is there."""
        raise NotImplementedError

    @contextlib.contextmanager
    def staging(self) -> Iterator[Staging]:
        """Provide a folder of one's own; remove it at the end."""
        raise NotImplementedError
        yield

    @contextlib.contextmanager
    def shared(self) -> Iterator[None]:
        """Let others read at the same time, but nobody publish, tidy up or compact."""
        yield

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the data set alone: nobody else publishes."""
        yield

    def tidy_up(self, is_in: Callable[[str], bool]) -> List[str]:
        """Remove what killed processes left: half work, and published files without their last one; return their names.

        Args:
            is_in: Whether what a last file of that name tells is in the data set, from whomever.
        """
        return []

    def take_back(self, names: Sequence[str]) -> None:
        """Remove what killed processes published of this last name, for whoever is alone and publishes these."""

    def registered(self, connection: Any) -> None:
        """Make ``address`` readable for a DuckDB connection."""


class FolderStore(Store):
    """A folder of this computer, or of a network file system with ``flock``."""

    def __init__(self, location: str) -> None:
        super().__init__(location)
        self._root = Path(location)

    def exists(self, name: str) -> bool:
        return (self._root / name).exists()

    def names(self, folder: str) -> List[str]:
        try:
            return sorted(os.listdir(str(self._root / folder)))
        except (FileNotFoundError, NotADirectoryError):
            return []

    def stamp(self, name: str) -> Tuple[int, ...]:
        try:
            state = (self._root / name).stat()
        except FileNotFoundError:
            return ()
        return state.st_ino, state.st_size, state.st_mtime_ns

    def open(self, name: str) -> BinaryIO:
        return (self._root / name).open("rb")

    def place(self, path: Path, name: str) -> None:
        target = self._root / name
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(str(path), str(target))

    def remove(self, name: str) -> None:
        with contextlib.suppress(FileNotFoundError):
            (self._root / name).unlink()

    @contextlib.contextmanager
    def staging(self) -> Iterator[Staging]:
        staging = Staging(self, self._root / _STAGING / uuid.uuid4().hex)
        try:
            staging.folder.mkdir(parents=True)
            # who tidies up takes the folder for a living process's until the file is there, and while it is locked
            unlocked = staging.folder / (_ALIVE + ".new")
            with unlocked.open("wb") as alive:
                fcntl.flock(alive, fcntl.LOCK_EX)
                unlocked.rename(staging.folder / _ALIVE)
                yield staging
        finally:
            if not staging.is_unfinished:
                shutil.rmtree(str(staging.folder), ignore_errors=True)

    @contextlib.contextmanager
    def _locked(self, kind: int) -> Iterator[None]:
        self._root.mkdir(parents=True, exist_ok=True)
        with (self._root / _LOCK).open("ab") as file:
            fcntl.flock(file, kind)
            yield

    @contextlib.contextmanager
    def shared(self) -> Iterator[None]:
        with self._locked(fcntl.LOCK_SH):
            yield

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        with self._locked(fcntl.LOCK_EX):
            yield

    def tidy_up(self, is_in: Callable[[str], bool]) -> List[str]:
        removed: List[str] = []
        dead = self._dead()
        if not dead:
            return []
        with self.alone():
            for folder in dead:
                names = self._published_by(folder)
                removed += self._remove(folder, names if names and not is_in(names[-1]) else [])
        return removed

    def take_back(self, names: Sequence[str]) -> None:
        for folder in self._dead():
            theirs = self._published_by(folder)
            if theirs[-1:] == names[-1:]:
                self._remove(folder, [name for name in theirs if name not in names])

    def _dead(self) -> List[Path]:
        """Return the folders of processes that live no more."""
        folders = [self._root / _STAGING / name for name in self.names(_STAGING)]
        return [folder for folder in folders if not is_being_written(folder / _ALIVE)]

    def _remove(self, folder: Path, names: Sequence[str]) -> List[str]:
        """Remove these files, and the folder that tells of them, where all could be removed; return those that were."""
        removed: List[str] = []
        is_left = False
        for name in names:
            try:
                if self.exists(name):
                    self.remove(name)
                    removed.append(name)
            except OSError as error:  # no file has a name that is too long
                is_left |= error.errno != errno.ENAMETOOLONG
        if not is_left:
            shutil.rmtree(str(folder), ignore_errors=True)
        return removed

    @staticmethod
    def _published_by(folder: Path) -> List[str]:
        """Return the names that a killed process had begun to give, the last at the end."""
        try:
            names: List[str] = json.loads((folder / _PLAN).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return []
        return names


class ObjectStore(Store):
    """A data set by a URL that fsspec reaches: ``s3://``, ``gs://``, ``file://``, ``memory://`` and others."""

    def __init__(self, location: str) -> None:
        super().__init__(location)
        try:
            fsspec = importlib.import_module("fsspec")
        except ImportError:
            raise MissingDependency("%s needs the Python package fsspec" % location) from None
        try:
            self._fs, self._root = fsspec.core.url_to_fs(location)
        except (ImportError, ValueError) as error:
            raise MissingDependency("%s: %s" % (location, error)) from error
        self._root = self._root.rstrip("/")

    def _path(self, name: str) -> str:
        return "%s/%s" % (self._root, name)

    def exists(self, name: str) -> bool:
        return bool(self._fs.exists(self._path(name)))

    def names(self, folder: str) -> List[str]:
        try:
            found = self._fs.ls(self._path(folder), detail=False, refresh=True)
        except FileNotFoundError:
            return []
        return sorted(path.rstrip("/").rsplit("/", 1)[-1] for path in found)

    def open(self, name: str) -> BinaryIO:
        file: BinaryIO = self._fs.open(self._path(name), "rb")
        return file

    def place(self, path: Path, name: str) -> None:
        target = self._path(name)
        self._fs.makedirs(target.rsplit("/", 1)[0], exist_ok=True)
        self._fs.put_file(str(path), target)

    def remove(self, name: str) -> None:
        with contextlib.suppress(FileNotFoundError):
            self._fs.rm_file(self._path(name))

    @contextlib.contextmanager
    def staging(self) -> Iterator[Staging]:
        with tempfile.TemporaryDirectory(prefix="jaka_bag_") as folder:
            yield Staging(self, Path(folder))

    def registered(self, connection: Any) -> None:
        connection.register_filesystem(self._fs)


def open_store(location: str) -> Store:
    """Open the store of a location: a folder, which need not be there yet, or a URL.

    Raises:
        BagError: It is a file.
        MissingDependency: fsspec, or what it needs for this URL, is not installed.
    """
    if "://" in location:
        return ObjectStore(location)
    if os.path.exists(location) and not os.path.isdir(location):
        raise BagError("%s is a file, no data set" % location)
    return FolderStore(location)
