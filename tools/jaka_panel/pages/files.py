"""The page's own files: those of the folder ``web``, by their suffix, and none beside it."""
import os
from pathlib import Path
from typing import Dict, NamedTuple, Optional

WEB = Path(__file__).resolve().parent.parent / "web"
TYPES: Dict[str, str] = {
    ".html": "text/html", ".js": "text/javascript", ".mjs": "text/javascript", ".css": "text/css",
    ".json": "application/json", ".svg": "image/svg+xml", ".png": "image/png", ".woff2": "font/woff2",
    ".txt": "text/plain", ".webmanifest": "application/manifest+json", ".ico": "image/x-icon"}


class PageFile(NamedTuple):
    """A file of the page."""

    path: Path
    kind: str

    @property
    def is_text(self) -> bool:
        """True if the file has a character set."""
        return self.kind.startswith("text/") or self.kind == "application/json"


def page_file(name: str, root: Path = WEB) -> Optional[PageFile]:
    """Return a file below ``root`` by its name with ``/``; None for folders, hidden files, links out, other kinds."""
    parts = name.split("/")
    if not all(parts) or any(part.startswith(".") or "\\" in part or "\0" in part for part in parts):
        return None
    path = Path(os.path.realpath(str(root.joinpath(*parts))))
    inside = Path(os.path.realpath(str(root)))
    kind = TYPES.get(path.suffix)
    try:
        if kind is None or inside not in path.parents or not path.is_file():
            return None
    except OSError:  # a name that is too long for the file system
        return None
    return PageFile(path, kind)
