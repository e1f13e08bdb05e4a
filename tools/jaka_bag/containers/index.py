"""The index at a log's end: connections, chunks, totals; read without numpy and without messages."""
import os
import sys
from array import array
from typing import Any, BinaryIO, Dict, Iterable, List, NamedTuple, Optional, Tuple, Union

from ..errors import BagError
from ..messages.connection import Connection
from ..paths import PathLike

METADATA = "metadata.yaml"
"""The file that makes a folder one of rosbag2."""
PACKED = ".zstd"
"""Suffix that rosbag2 puts behind that of a file which it has compressed as a whole."""
PACKED_SUFFIXES = (".mcap" + PACKED, ".db3" + PACKED)
ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a file, or of a message of CDR, that is compressed as a whole; one that is not begins with 0."""
STORAGE_SUFFIXES = (".mcap", ".db3", *PACKED_SUFFIXES)
"""Suffixes of its files of messages, and of those that are compressed as a whole."""
Buffer = Union[bytes, bytearray, memoryview]


class ChunkRef(NamedTuple):
    """One chunk of a file.

    Attributes:
        position: First byte in the file.
        end: First byte after the chunk and its indexes.
        start_time: Earliest log time in it, ns.
        end_time: Latest log time in it, ns.
        counts: Messages by number of the connection; empty where the index does not say.
        is_loose: The bytes are plain records rather than one chunk record (MCAP without chunks).
        rows: Numbers of the first and the last row of a database; of files no meaning.
        unpacked: Bytes that it unpacks to, as it claims; 0 where nothing says.
    """

    position: int
    end: int
    start_time: int
    end_time: int
    counts: Dict[int, int]
    is_loose: bool = False
    rows: Tuple[int, int] = (0, 0)
    unpacked: int = 0


class AttachmentIndex(NamedTuple):
    """The location of one attachment; times in ns, positions and sizes in byte."""

    position: int
    size: int
    log_time: int
    create_time: int
    data_size: int
    name: str
    media_type: str


class MetadataIndex(NamedTuple):
    """The location of one metadata record, byte."""

    position: int
    size: int
    name: str


class ChunkHead(NamedTuple):
    """A chunk record without its data: codec, uncompressed size, CRC (0: none), where the data starts, how long it is,
    and where the record ends; byte from its beginning.
    """

    codec: str
    size: int
    crc: int
    data_start: int
    data_size: int
    end: int


CodecTotals = Tuple[str, int, int, int]
"""A codec, and how many chunks, stored bytes and uncompressed bytes it has."""


def codec_totals(chunks: Iterable[Tuple[str, int, int]]) -> Tuple[CodecTotals, ...]:
    """Sum the totals of each codec from (codec, stored bytes, uncompressed bytes) of each chunk."""
    totals: Dict[str, Tuple[int, int, int]] = {}
    for codec, stored, full in chunks:
        count, all_stored, all_full = totals.get(codec, (0, 0, 0))
        totals[codec] = (count + 1, all_stored + stored, all_full + full)
    return tuple((name, *values) for name, values in totals.items())


class LogIndex(NamedTuple):
    """The index of one log.

    Attributes:
        format: ``bag``, ``mcap``, ``sqlite3`` or ``rosbag2``.
        version: Version of the format.
        path: The file.
        size: byte.
        connections: Connections by number; the numbers are this package's own.
        numbers: The file's id of a connection to its number.
        chunks: Chunks in the order of the file.
        counts: Messages by number of the connection.
        start_time: Earliest log time, ns; None without messages.
        end_time: Latest log time, ns; None without messages.
        profile: MCAP profile, else empty.
        library: The software that wrote the MCAP, else empty.
        attachments: Attachments of an MCAP.
        metadata: Metadata records of an MCAP.
        codecs: Codecs of the chunks; empty where the index does not name them (``read_codecs``).
        notes: Parts of the file that do not belong to the format and were skipped, and whether the index is believed,
            one line each.
        contradiction: The first place where the file's own declarations disagree; empty where they agree.
        left_out: Topics that are not read, one line each, which stand among ``notes``.
    """

    format: str
    version: str
    path: str
    size: int
    connections: List[Connection]
    numbers: Dict[int, int]
    chunks: List[ChunkRef]
    counts: List[int]
    start_time: Optional[int]
    end_time: Optional[int]
    profile: str = ""
    library: str = ""
    attachments: Tuple[AttachmentIndex, ...] = ()
    metadata: Tuple[MetadataIndex, ...] = ()
    codecs: Tuple[CodecTotals, ...] = ()
    notes: Tuple[str, ...] = ()
    contradiction: str = ""
    left_out: Tuple[str, ...] = ()


def extremes(times: "array[int]") -> Tuple[int, int]:
    """Return the least and the greatest of at least one time; by numpy where something else has imported it."""
    numpy = sys.modules.get("numpy")
    if numpy is None:
        return min(times), max(times)
    values = numpy.frombuffer(times, numpy.dtype(times.typecode))
    return int(values.min()), int(values.max())


class IndexTotals:
    """The messages that the indexes behind one chunk name: their times, ns, and how many each connection has.

    Attributes:
        counts: Messages by the file's id of the connection; without those that have none.
        start_time: Earliest log time; None without messages.
        end_time: Latest log time; None without messages.
    """

    def __init__(self) -> None:
        self.counts: Dict[int, int] = {}
        self.start_time: Optional[int] = None
        self.end_time: Optional[int] = None

    def add(self, file_id: int, count: int, first: int, last: int) -> None:
        """Add at least one message of a connection, with their earliest and latest time."""
        self.counts[file_id] = self.counts.get(file_id, 0) + count
        self.start_time = first if self.start_time is None else min(self.start_time, first)
        self.end_time = last if self.end_time is None else max(self.end_time, last)

    def contradicts(self, start_time: int, end_time: int) -> bool:
        """Return whether a chunk that is declared to span these times, ns, holds others."""
        return bool(self.counts) and (self.start_time, self.end_time) != (start_time, end_time)


def is_rosbag2(path: PathLike) -> bool:
    """Return whether a path is a rosbag2 folder."""
    return os.path.isfile(os.path.join(str(path), METADATA))


def leftovers(path: PathLike) -> List[str]:
    """Return the files beside a database with changes that its writer, which was killed, had not brought into it."""
    return [name for name in ("%s-wal" % path, "%s-journal" % path) if os.path.isfile(name) and os.path.getsize(name)]


def is_folder_of_messages(path: PathLike) -> bool:
    """Return whether a path is a rosbag2 folder, or one that lacks its ``metadata.yaml``."""
    if not os.path.isdir(str(path)):
        return False
    try:
        return any(name == METADATA or name.endswith(STORAGE_SUFFIXES) for name in os.listdir(str(path)))
    except OSError:
        return False


def _by_number(name: str) -> List[Any]:
    """Return a key that sorts ``run_10`` behind ``run_9``."""
    import re
    return [int(part) if n % 2 else part for n, part in enumerate(re.split("([0-9]+)", name))]


def storage_files(folder: PathLike) -> List[str]:
    """Return the names of the files of messages in a folder, in the order of their numbers."""
    return sorted((name for name in os.listdir(str(folder)) if name.endswith(STORAGE_SUFFIXES)),
                  key=_by_number)


def _what_is_there(path: str) -> str:
    """Return a word for a path that is no plain file."""
    if not os.path.isdir(path):
        return "no plain file"
    if is_rosbag2(path):
        return "a rosbag2 folder (jaka_bag convert makes a log of it)"
    return ("a rosbag2 folder without its metadata.yaml (jaka_bag recover makes one that has it)"
            if is_folder_of_messages(path) else "a folder")


def open_for_reading(path: PathLike) -> BinaryIO:
    """Open a file that must exist, unbuffered.

    Raises:
        BagError: It cannot be opened, or is a folder.
    """
    try:
        descriptor = os.open(str(path), os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError as error:
        raise BagError("cannot read %s: %s" % (path, error.strerror)) from error
    if not os.path.isfile("/dev/fd/%d" % descriptor):
        os.close(descriptor)
        raise BagError("cannot read %s: it is %s" % (path, _what_is_there(str(path))))
    return os.fdopen(descriptor, "rb", buffering=0)


def read_at(descriptor: int, position: int, size: int) -> bytes:
    """Read up to ``size`` bytes of a file, fewer only at its end.

    Raises:
        BagError: The system refused.
    """
    try:
        # a damaged record may claim more than the memory, or a position, holds
        size = max(min(size, os.fstat(descriptor).st_size - position), 0)
        data = os.pread(descriptor, size, position) if size else b""
        while len(data) < size:
            more = os.pread(descriptor, size - len(data), position + len(data))
            if not more:
                break
            data += more
    except OSError as error:
        raise BagError("cannot read: %s" % error.strerror) from error
    return data
