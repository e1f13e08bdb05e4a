"""The files of a black box in their folder: names, limits, unfinished files of a killed one."""
import contextlib
import time
from pathlib import Path
from typing import Callable, List, NamedTuple, Tuple

from jaka_bag.live.rolling_files import WORKING_SUFFIX

PREFIX = "blackbox_"
SUFFIX = ".mcap"
SIGNATURE_SUFFIX = ".sig"


class Keep(NamedTuple):
    """The limits of the files that are kept, the newest first: number of files and total bytes; 0 for no limit."""

    files: int = 0
    size: int = 0


def new_stem(folder: Path, kind: str) -> Path:
    """Return an unused path, without suffix, for a file that a trigger of this kind begins now."""
    base = "%s%s_%s" % (PREFIX, time.strftime("%Y-%m-%d-%H-%M-%S"), kind)
    number, name = 1, base
    while any(folder.joinpath(name + SUFFIX + end).exists() for end in ("", WORKING_SUFFIX)):
        number += 1
        name = "%s_%d" % (base, number)
    return folder / name


def finished_files(folder: Path) -> List[Tuple[Path, int]]:
    """Return the finished files in a folder, oldest first, with their bytes; one may be moved away at any moment."""
    found = []
    for path in folder.glob(PREFIX + "*" + SUFFIX):
        with contextlib.suppress(FileNotFoundError):
            status = path.stat()
            found.append((status.st_mtime_ns, path.name, path, status.st_size))
    return [(path, size) for _, _, path, size in sorted(found)]


def cut_off_files(folder: Path) -> List[Path]:
    """Return the unfinished files that killed black boxes left in a folder, oldest first."""
    return sorted(folder.glob(PREFIX + "*" + SUFFIX + WORKING_SUFFIX))


def set_aside(path: Path) -> Path:
    """Rename an unfinished file so that no black box takes it for a cut-off one again; return its new name.

    Commands read it as before: it still ends in ``.mcap.active``.
    """
    number, aside = 1, path.with_name("damaged_" + path.name)
    while aside.exists():
        number += 1
        aside = path.with_name("damaged_%d_%s" % (number, path.name))
    path.rename(aside)
    return aside


def remove_old(folder: Path, keep: Keep, notice: Callable[[str], None]) -> None:
    """Remove the oldest finished files, with their signatures, that are more than is to be kept; never the newest."""
    files = finished_files(folder)
    while len(files) > 1 and ((keep.files and len(files) > keep.files)
                              or (keep.size and sum(size for _, size in files) > keep.size)):
        oldest, _ = files.pop(0)
        with contextlib.suppress(FileNotFoundError):
            oldest.unlink()
            notice("removed %s" % oldest)
            oldest.with_name(oldest.name + SIGNATURE_SUFFIX).unlink()
