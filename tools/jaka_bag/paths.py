"""Names of files as callers may give them."""
import os
from typing import Union

PathLike = Union[str, "os.PathLike[str]"]


def is_same_file(one: PathLike, other: PathLike) -> bool:
    """Return whether two names, of which each may be missing, lead to the same file or folder."""
    try:
        return os.path.samefile(str(one), str(other))
    except OSError:
        return False
