"""The replacement of a golden log by a new one, once an unchanged run has been seen to be the same as the new one."""
import os
import shutil
from pathlib import Path
from typing import Callable

from jaka_bag.operations.convert import Job, convert_file

from .replay import Replay


def update_golden(golden: Path, candidate: Path, folder: Path, again: Callable[[Path, Path], Replay]) -> str:
    """Put what a replay recorded in the place of the golden log, in that log's format; return a line for the user.

    It is replayed once more first. Where that run differs from it, the golden log stays: a golden log that differs from
    an unchanged run finds nothing.

    Args:
        golden: The golden log, .bag or .mcap.
        candidate: What was recorded in its place.
        folder: For the new log and the report of its own replay; made where it is not there.
        again: Makes a log happen once more, with the scenario of the golden one; takes the log and the report's folder.

    Raises:
        BagError: A log cannot be read or written.
        ProgramFailed: A program of the replay failed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    new = folder / golden.name
    if golden.suffix == candidate.suffix:
        shutil.copyfile(str(candidate), str(new))
    else:
        convert_file(Job(str(candidate), str(new), overwrite=True))
    result = again(new, folder)
    if not result.same:
        return "%s stays as it was: an unchanged run differs from the new log\n%s" % (golden, result.summary)
    place = golden.resolve()  # a link stays one
    beside = place.with_name(place.name + ".new")
    shutil.copyfile(str(new), str(beside))
    with open(str(beside), "rb") as file:
        os.fsync(file.fileno())  # after a power failure there is the one log or the other, whole
    os.replace(str(beside), str(place))
    return "%s is the new log: an unchanged run is the same" % golden
