"""The folder of a MoveIt configuration package: which files it has, and which lie beside it."""
import os
from typing import List

MOST_FILES = 500
"""Most files of a folder that are looked at."""


class Package:
    """A package's folder.

    Args:
        folder: Its path.

    Attributes:
        folder: The same, absolute.
        name: The folder's name.
    """

    def __init__(self, folder: str) -> None:
        self.folder = os.path.abspath(folder)
        self.name = os.path.basename(self.folder)

    def path(self, file: str) -> str:
        """Return the path of a file that is named relative to the package."""
        return os.path.join(self.folder, file)

    def has(self, file: str) -> bool:
        """Return whether there is something of this name, and be it unreadable."""
        return os.path.lexists(self.path(file))

    def files(self, folder: str, *endings: str) -> List[str]:
        """Return the files of a folder of the package with one of these endings, relative to the package, sorted."""
        try:
            names = sorted(os.listdir(self.path(folder)))
        except OSError:
            return []
        return [os.path.join(folder, name) for name in names if name.endswith(endings)][:MOST_FILES]

    def beside(self, *names: str) -> str:
        """Return the path of something in another package that lies beside this one."""
        return os.path.join(os.path.dirname(self.folder), *names)

    def shown(self, path: str) -> str:
        """Return a path as the report shows it: relative to the package where it lies in or beside it."""
        relative = os.path.relpath(path, self.folder)
        return path if relative.startswith(os.path.join("..", "..", "")) else relative
