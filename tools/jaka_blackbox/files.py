"""The files of a black box in their folder: names, how many are kept, what a killed one left behind."""
import time
from pathlib import Path
from typing import Callable, List, NamedTuple

from jaka_bag.live.rolling_files import WORKING_SUFFIX

PREFIX = "blackbox_"
SUFFIX = ".mcap"
SIGNATURE_SUFFIX = ".sig"


class Keep(NamedTuple):
    """How much is kept, the newest files; 0 for all: so many files, so many bytes in all."""

    files: int = 0
    size: int = 0


def new_stem(folder: Path, kind: str) -> Path:
    """Path, without suffix, of a file that is begun now by a trigger of this kind; nothing has that name."""
    base = "%s%s_%s" % (PREFIX, time.strftime("%Y-%m-%d-%H-%M-%S"), kind)
    number, name = 1, base
    while any(folder.joinpath(name + SUFFIX + end).exists() for end in ("", WORKING_SUFFIX)):
        number += 1
        name = "%s_%d" % (base, number)
    return folder / name


def finished_files(folder: Path) -> List[Path]:
    """The finished files in a folder, oldest first."""
    return sorted(folder.glob(PREFIX + "*" + SUFFIX), key=lambda path: (path.stat().st_mtime_ns, path.name))


def cut_off_files(folder: Path) -> List[Path]:
    """What black boxes that were killed left in a folder, oldest first."""
    return sorted(folder.glob(PREFIX + "*" + SUFFIX + WORKING_SUFFIX))


def remove_old(folder: Path, keep: Keep, notice: Callable[[str], None]) -> None:
    """Remove the oldest finished files, with their signatures, that are more than is to be kept; never the newest."""
    files = finished_files(folder)
    sizes = [path.stat().st_size for path in files]
    while len(files) > 1 and ((keep.files and len(files) > keep.files) or (keep.size and sum(sizes) > keep.size)):
        oldest = files.pop(0)
        sizes.pop(0)
        signature = oldest.with_name(oldest.name + SIGNATURE_SUFFIX)
        oldest.unlink()
        if signature.exists():
            signature.unlink()
        notice("removed %s" % oldest)
