"""Attachments and metadata of a log: added, taken out."""
import json
import mimetypes
import os
import re
import time
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

from ..containers.interface import LogReader
from ..containers.registry import create_log, open_log
from ..errors import BagError, UsageError
from ..messages.selection import MessageFilter, Selection
from ..output_file import OutputFile, check_output
from ..paths import PathLike, note_source
from ..pipeline import WORKERS
from .convert import OnProgress, WriteResult, copy_log, refuse_same_file, size_of


class NewAttachment(NamedTuple):
    """A file to be added: its path, its name in the log, its media type."""

    path: str
    name: str
    media_type: str


def attachment_of(path: str, name: Optional[str] = None, media_type: Optional[str] = None) -> NewAttachment:
    """Return a file as an attachment; name and media type come from the file's name where they are not given."""
    guessed = mimetypes.guess_type(path)[0] or "application/octet-stream"
    return NewAttachment(path, name or os.path.basename(path), media_type or guessed)


def _content(path: str) -> Tuple[bytes, int]:
    """Return the bytes of a file, and the time of its last change, ns since the epoch."""
    try:
        with open(path, "rb") as file:
            return file.read(), os.fstat(file.fileno()).st_mtime_ns
    except OSError as error:
        raise BagError("cannot read %s: %s" % (path, error.strerror)) from error


def attach(source: PathLike, target: PathLike, files: Sequence[NewAttachment],
           metadata: Sequence[Tuple[str, Dict[str, str]]] = (), overwrite: bool = False,
           on_progress: Optional[OnProgress] = None) -> WriteResult:
    """Write a log again, with attachments and metadata more than it had; its compression stays.

    Args:
        source: The log.
        target: .mcap: other formats have no place for them.
        files: Files to attach.
        metadata: (name, values) of metadata records.
        overwrite: Replace an existing target.
        on_progress: Receives the progress.

    Raises:
        BagError: The source or a file cannot be read, or the target cannot be written or hold them.
        UsageError: The log has an attachment of that name already.
    """
    begin = time.monotonic()
    refuse_same_file(source, target)
    for file in files:
        note_source(file.path)
    with open_log(source) as reader:
        index = reader.index
        taken = {entry.name for entry in index.attachments}
        for file in files:
            if file.name in taken:
                raise UsageError("%s has an attachment %s already: give another name with --name"
                                 % (source, file.name))
            taken.add(file.name)
        codec = index.codecs[0][0] if index.format == "mcap" and index.codecs else None
        with create_log(target, codec, None, overwrite, index.profile or "ros1") as writer:
            for file in files:
                content, changed_at = _content(file.path)
                writer.add_attachment(file.name, content, file.media_type, time.time_ns(), changed_at)
            for name, values in metadata:
                writer.add_metadata(name, values)
            messages, notes = copy_log(reader, writer, MessageFilter(Selection(), reader.connections), on_progress,
                                       WORKERS, None)
    return WriteResult(str(source), str(target), messages, index.size, size_of(target), time.monotonic() - begin,
                       notes)


def safe_name(name: str) -> str:
    """Return a safe file name for a name from a log: it leads into no other folder, and is not hidden."""
    plain = re.sub(r"[^\w.+=@ -]", "_", os.path.basename(name.replace("\\", "/")), flags=re.ASCII).lstrip(".")
    return plain[:200] or "unnamed"


def contents_of(reader: LogReader, names: Sequence[str] = ()) -> Iterator[Tuple[str, bytes]]:
    """Yield (name of a file, content) of each attachment, and of each metadata record as JSON.

    Args:
        reader: The log.
        names: Names that are wanted; none for all.
    """
    for attachment in reader.index.attachments:
        if not names or attachment.name in names:
            yield safe_name(attachment.name), reader.read_attachment(attachment)
    for entry in reader.index.metadata:
        if not names or entry.name in names:
            text = json.dumps(reader.read_metadata(entry), indent=1, sort_keys=True) + "\n"
            yield safe_name(entry.name) + ".json", text.encode("utf-8", "replace")


def extract(reader: LogReader, folder: PathLike, names: Sequence[str] = (), overwrite: bool = False
            ) -> List[Tuple[str, int]]:
    """Write attachments, and metadata as JSON, into a folder, which is made where it is missing.

    Args:
        reader: The log.
        folder: Folder to write into.
        names: Those that are wanted; none for all.
        overwrite: Replace existing files.

    Returns:
        (path, bytes) of each file; one of two that have the same name gets a number.

    Raises:
        BagError: One cannot be written.
        BagFormatError: One is damaged.
        OutputExists: A file is there already and ``overwrite`` is False.
    """
    base = Path(folder)
    try:
        base.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BagError("cannot make the folder %s: %s" % (base, error.strerror)) from error
    written: List[Tuple[str, int]] = []
    taken: Set[str] = set()
    for plain, content in contents_of(reader, names):
        name, number = plain, 2
        while name in taken:
            name, number = "%d_%s" % (number, plain), number + 1
        taken.add(name)
        path = base / name
        check_output(path, overwrite)
        refuse_same_file(reader.path, path)
        with OutputFile(path, overwrite) as output:
            output.write(content)
        written.append((str(path), len(content)))
    return written
