"""The replacement of a golden log by a new one, once an unchanged run has been seen to be the same as the new one."""
import os
import shutil
from pathlib import Path
from typing import Callable

from jaka_bag.operations.convert import Job, convert_file
from jaka_bag.output_file import OutputFile

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
        ProcessFailed: A process of the replay failed.
    """
    new = folder / "golden" / golden.name  # the replay records a file of its own in the folder, whatever name this has
    new.parent.mkdir(parents=True, exist_ok=True)
    if golden.suffix == candidate.suffix:
        shutil.copyfile(str(candidate), str(new))
    else:
        convert_file(Job(str(candidate), str(new), overwrite=True))
    result = again(new, folder)
    if not result.same:
        return "%s stays as it was: an unchanged run differs from the new log\n%s" % (golden, result.summary)
    place = golden.resolve()  # a link stays one
    with OutputFile(place, overwrite=True) as output, open(str(new), "rb") as source:
        shutil.copyfileobj(source, output)
        os.fsync(output.file.fileno())  # after a power failure there is the one log or the other, whole
    return "%s is the new log: an unchanged run is the same" % golden
