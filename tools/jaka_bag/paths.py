"""Names of files as callers may give them, and those that this process reads."""
import os
from typing import List, Set, Union

PathLike = Union[str, "os.PathLike[str]"]
_sources: Set[str] = set()
"""Absolute paths of what this process reads."""


def note_source(path: PathLike) -> None:
    """Note a file or folder that this process reads: no output is written in its place while it is unfinished.

    A working file that a killed process left is taken over; but it may just be what somebody recovers from.
    """
    _sources.add(os.path.abspath(str(path)))


def noted_sources() -> List[str]:
    """Return the absolute paths of all that this process reads, as noted up to now."""
    return list(_sources)
