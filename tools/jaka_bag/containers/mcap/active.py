"""The index of an MCAP that is still being written, or whose recorder was killed: of what is whole in it by now."""
import os

from ...paths import PathLike
from ..index import LogIndex, read_at
from . import records as fmt
from .recovery import walk_index


def _whole_end(descriptor: int) -> int:
    """Return the end of the last record that is written in full."""
    size = os.fstat(descriptor).st_size
    at = fmt.read_file_head(descriptor)[2]
    while True:
        head = read_at(descriptor, at, fmt.RECORD_HEAD.size)
        if len(head) < fmt.RECORD_HEAD.size or not head[0]:
            return at
        end = at + fmt.RECORD_HEAD.size + int(fmt.RECORD_HEAD.unpack(head)[1])
        if end > size:
            return at
        at = end


def active_index(path: PathLike, descriptor: int) -> LogIndex:
    """Return the index of the part of an unfinished MCAP that is whole by now.

    Raises:
        BagFormatError: The file is damaged before its end.
    """
    index = walk_index(path, descriptor, _whole_end(descriptor))
    if not index.chunks or index.chunks[-1].is_loose:
        return index
    last = index.chunks[-1]  # some of its message indexes may be missing: it is read without them
    head = fmt.parse_chunk_head(read_at(descriptor, last.position, 256))
    return index._replace(chunks=index.chunks[:-1] + [
        last._replace(end=last.position + head.data_start + head.data_size)])
