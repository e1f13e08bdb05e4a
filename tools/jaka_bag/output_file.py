"""Output that appears only when whole: written beside its name, renamed on success, removed on failure."""
import contextlib
import fcntl
import itertools
import os
import shutil
from pathlib import Path
from typing import BinaryIO, Callable, Iterator, List, Optional, Sequence, Set, Tuple, Type, Union

from .errors import BagError, OutputExists
from .interrupts import put_off
from .paths import PathLike, noted_sources

_unfinished: "Set[Union[OutputFile, OutputFolder]]" = set()
os.register_at_fork(after_in_child=_unfinished.clear)  # what the parent writes is the parent's


def is_same_file(one: PathLike, other: PathLike) -> bool:
    """Return whether two names, of which each may be missing, lead to the same file or folder."""
    try:
        return os.path.samefile(str(one), str(other))
    except OSError:
        return False


def _is_read(path: Path) -> bool:
    """Return whether this process reads it, by any name, or something in it."""
    return path.exists() and any(is_same_file(place, path) for source in noted_sources()
                                 for place in (Path(source), *Path(os.path.realpath(source)).parents))


def _names_beside(path: Path, suffix: str) -> Iterator[Path]:
    """Yield ``NAME.part``, ``NAME.2.part`` and so on, for the suffix ``.part``."""
    for number in itertools.count(1):
        yield path.with_name("%s%s%s" % (path.name, "" if number == 1 else ".%d" % number, suffix))


def _working_names(path: Path, suffix: str) -> Iterator[Path]:
    """Return the names beside it but those of sources, and of links, which no process leaves behind."""
    return (name for name in _names_beside(path, suffix) if not name.is_symlink() and not _is_read(name))


def _lock(descriptor: int, name: Path) -> bool:
    """Lock what was opened by this name; False where it has another name by now, or none, and was closed.

    Between the opening and the lock another process may finish it, or give up.

    Raises:
        OutputExists: Another process is writing it.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise OutputExists("%s is being written by another process" % name) from None
    with contextlib.suppress(OSError):
        if os.path.samestat(os.fstat(descriptor), os.stat(str(name))):
            return True
    os.close(descriptor)
    return False


def check_output(path: PathLike, overwrite: bool = False) -> None:
    """Refuse an output that could not be put in place, before any work is done for it.

    Raises:
        OutputExists: There is something of that name already and ``overwrite`` is False.
        BagError: The name is a folder, or its folder does not exist.
    """
    target = Path(path)
    if target.is_dir():
        raise BagError("%s is a folder" % target)
    if not overwrite and os.path.lexists(str(target)):
        raise OutputExists("%s exists (--force overwrites it)" % target)
    if not target.parent.is_dir():
        raise BagError("there is no folder %s" % target.parent)


class OutputFile:
    """A binary file written as ``NAME + suffix`` and renamed to ``NAME`` by ``commit``.

    The working file is locked while it is written: one left behind by a killed process is taken over, one
    that another process is writing is refused. One that this process reads is left alone, the name gets a number then.

    Args:
        path: The final name.
        overwrite: Replace a file of the final name.
        suffix: Suffix of the working name.
        keep_leftover: Refuse to take over a working file that a killed process left (it may be evidence).

    Attributes:
        path: The final name.
        working_path: The name while it is written.
        file: The open file, unbuffered.

    Raises:
        OutputExists: The final name is taken, or the working name is in use.
        BagError: The file cannot be created there.
    """

    def __init__(self, path: PathLike, overwrite: bool = False, suffix: str = ".part",
                 keep_leftover: bool = False) -> None:
        self.path = Path(path)
        self.overwrite = overwrite
        check_output(self.path, overwrite)
        self.working_path = next(_working_names(self.path, suffix))
        with put_off():  # an interruption between creation and note would leave the file behind
            self._create(keep_leftover)
            if not keep_leftover:
                _unfinished.add(self)

    def _create(self, keep_leftover: bool) -> None:
        descriptor = self._open(keep_leftover)
        while not _lock(descriptor, self.working_path):
            descriptor = self._open(keep_leftover)
        self.file: BinaryIO = os.fdopen(descriptor, "r+b", buffering=0)
        self.file.truncate(0)
        self._is_finished = False

    def _open(self, keep_leftover: bool) -> int:
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | (os.O_EXCL if keep_leftover else 0)
        try:
            return os.open(str(self.working_path), flags, 0o666)
        except FileExistsError:
            raise OutputExists("%s exists: a recording that was cut off; recover or remove it"
                               % self.working_path) from None
        except OSError as error:
            raise BagError("cannot write %s: %s" % (self.working_path, error.strerror)) from error

    def write(self, data: Union[bytes, bytearray, memoryview]) -> None:
        """Write all of ``data`` at the end.

        Raises:
            OSError: The system refused, as with a full disk; a part may have been written.
        """
        view = memoryview(data)
        while view:
            view = view[self.file.write(view):]

    def commit(self) -> None:
        """Close the file and give it its final name.

        Raises:
            OutputExists: The final name was taken meanwhile; the working file stays.
            OSError: The system refused; the working file stays.
        """
        with put_off():
            self._finish()
            if not self.overwrite and os.path.lexists(str(self.path)):
                self.file.close()
                raise OutputExists("%s appeared meanwhile; the result is %s" % (self.path, self.working_path))
            os.replace(str(self.working_path), str(self.path))
            self.file.close()

    def abort(self) -> None:
        """Remove and close the working file; nothing of the final name is touched."""
        if self._is_finished:
            return
        try:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(str(self.working_path))
        finally:
            self._finish()
            self.file.close()

    def _finish(self) -> None:
        self._is_finished = True
        _unfinished.discard(self)

    def __enter__(self) -> "OutputFile":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], *error: object) -> None:
        if kind is not None:
            self.abort()
        elif not self._is_finished:
            self.commit()


class OutputFolder:
    """A folder of outputs written as ``NAME.part`` and renamed to ``NAME`` by ``commit``; locked as ``OutputFile`` is.

    A folder of the working name is emptied and taken over where all that is in it can be what a killed process left.

    Args:
        path: The final name.
        is_leftover: Returns whether a killed process may have left a file of this name in it.

    Attributes:
        path: The final name.
        working_path: The name while it is written.

    Raises:
        OutputExists: The working name is in use.
        BagError: The folder cannot be created there.
    """

    def __init__(self, path: Path, is_leftover: Callable[[str], bool]) -> None:
        self.path = path
        self._is_leftover = is_leftover
        with put_off():  # as in OutputFile
            self.working_path = next(filter(self._take, _working_names(path, ".part")))
            _unfinished.add(self)

    def _take(self, name: Path) -> bool:
        """Make a folder and lock it, and empty one that a killed process left; False where it is somebody else's."""
        self._descriptor = self._open(name)
        while not _lock(self._descriptor, name):
            self._descriptor = self._open(name)
        found = list(name.iterdir())
        if not all(file.is_file() and self._is_leftover(file.name) for file in found):
            os.close(self._descriptor)
            return False
        for file in found:
            file.unlink()
        return True

    def _open(self, name: Path) -> int:
        while True:
            try:
                name.mkdir(exist_ok=True)
                with contextlib.suppress(FileNotFoundError):  # renamed or removed since
                    return os.open(str(name), os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | os.O_NOFOLLOW)
            except OSError as error:
                raise BagError("cannot write %s: %s" % (name, error.strerror)) from error

    def commit(self) -> None:
        """Give the folder its final name; a folder that has it is replaced.

        Raises:
            OSError: The system refused; the working folder stays, and the one that has its name.
        """
        aside = next(name for name in _names_beside(self.path, ".old") if not os.path.lexists(str(name)))
        with put_off():
            try:
                is_replaced = os.path.lexists(str(self.path))
                if is_replaced:
                    os.rename(str(self.path), str(aside))
                try:
                    os.rename(str(self.working_path), str(self.path))
                except OSError:
                    if is_replaced:
                        os.rename(str(aside), str(self.path))
                    raise
            finally:
                self._finish()
            if is_replaced and aside.is_symlink():
                aside.unlink()
            elif is_replaced:
                shutil.rmtree(str(aside))

    def commit_files(self, names: Sequence[str], obsolete: Sequence[str] = (), overwrite: bool = False) -> None:
        """Move files out of the working folder to beside it, all or none, and remove it.

        Args:
            names: Names of the files.
            obsolete: Files beside it that the new ones replace, too.
            overwrite: Replace files of these names.

        Raises:
            OutputExists: A name is taken and ``overwrite`` is False; the working folder stays.
            BagError: A name is that of a folder; the working folder stays.
            OSError: The system refused; the working folder stays, and all old files are where they were.
        """
        new = [(self.working_path / name, self.path.with_name(name)) for name in names]
        old = [(self.path.with_name(name), self.working_path / ("old." + name)) for name in (*names, *obsolete)]
        moved: List[Tuple[Path, Path]] = []
        with put_off():
            for _, target in new:
                check_output(target, overwrite)
            try:
                for source, target in [*((path, aside) for path, aside in old if os.path.lexists(str(path))), *new]:
                    os.rename(str(source), str(target))
                    moved.append((source, target))
            except OSError:
                try:
                    for source, target in reversed(moved):
                        os.rename(str(target), str(source))
                except OSError:
                    self._finish()  # what could not be moved back is not removed
                raise
            self.abort()

    def abort(self) -> None:
        """Remove the working folder with all that is in it, unless it is finished."""
        if self in _unfinished:
            shutil.rmtree(str(self.working_path), ignore_errors=True)
            self._finish()

    def _finish(self) -> None:
        _unfinished.discard(self)
        os.close(self._descriptor)


def abort_all() -> None:
    """Remove what this process has not finished: the last thing before an interrupted process ends.

    An interruption may come between the creation of a file and the block that would remove it, or in a destructor,
    which swallows it.
    """
    for output in list(_unfinished):
        output.abort()


def write_text(path: PathLike, text: str, overwrite: bool = False) -> None:
    """Write a text file in UTF-8, whole or not at all; what UTF-8 cannot say becomes a question mark.

    Raises:
        OutputExists: There is something of that name already and ``overwrite`` is False.
        BagError: The file cannot be created there.
        OSError: The system refused.
    """
    with OutputFile(path, overwrite) as output:
        output.write(text.encode("utf-8", "replace"))


def is_being_written(path: Path) -> bool:
    """Return whether a running process writes this working file: it holds a lock then (``OutputFile``)."""
    try:
        with open(str(path), "rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    return False
