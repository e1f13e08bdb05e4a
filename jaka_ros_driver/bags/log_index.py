"""What a log says about itself at its end: connections, chunks, totals; read without numpy and without messages."""
import os
from typing import TYPE_CHECKING, Dict, List, NamedTuple, Optional, Tuple

from .connection import Connection
from .errors import BagError, BagFormatError
from .paths import PathLike

if TYPE_CHECKING:  # a .bag is read without it
    from .mcap_format import AttachmentIndex, MetadataIndex

BAG_MAGIC = b"#ROSBAG V"
MCAP_MAGIC = b"\x89MCAP"


class ChunkRef(NamedTuple):
    """One chunk of a file.

    Attributes:
        position: First byte in the file.
        end: First byte behind the chunk and its indexes.
        start_time: Earliest log time in it, ns.
        end_time: Latest log time in it, ns.
        counts: Messages by number of the connection; empty where the index does not say.
        is_loose: The bytes are plain records rather than one chunk record (MCAP without chunks).
    """

    position: int
    end: int
    start_time: int
    end_time: int
    counts: Dict[int, int]
    is_loose: bool = False


class LogIndex(NamedTuple):
    """The index of one log.

    Attributes:
        format: ``bag`` or ``mcap``.
        version: Version of the format.
        path: The file.
        size: byte.
        connections: By number; the numbers are this package's own.
        numbers: The file's id of a connection to its number.
        chunks: In the order of the file.
        counts: Messages by number of the connection.
        start_time: Earliest log time, ns; None without messages.
        end_time: Latest log time, ns; None without messages.
        profile: MCAP profile, else empty.
        library: The program that wrote the MCAP, else empty.
        attachments: Of an MCAP.
        metadata: Of an MCAP.
        codecs: Per codec: chunks, stored bytes, uncompressed bytes (known from the index for MCAP only).
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
    attachments: Tuple["AttachmentIndex", ...] = ()
    metadata: Tuple["MetadataIndex", ...] = ()
    codecs: Tuple[Tuple[str, int, int, int], ...] = ()


def open_for_reading(path: PathLike) -> int:
    """A descriptor of a file that must exist.

    Raises:
        BagError: It cannot be opened, or is a folder.
    """
    try:
        descriptor = os.open(str(path), os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError as error:
        raise BagError("cannot read %s: %s" % (path, error.strerror)) from error
    if not os.path.isfile("/dev/fd/%d" % descriptor):
        os.close(descriptor)
        raise BagError("cannot read %s: it is %s" % (path, "a folder" if os.path.isdir(str(path)) else "no plain file"))
    return descriptor


def read_at(descriptor: int, position: int, size: int) -> bytes:
    """Up to ``size`` bytes of a file, fewer only at its end.

    Raises:
        BagError: The system refused.
    """
    try:
        data = os.pread(descriptor, size, position)
        while len(data) < size:
            more = os.pread(descriptor, size - len(data), position + len(data))
            if not more:
                break
            data += more
    except OSError as error:
        raise BagError("cannot read: %s" % error.strerror) from error
    return data


def detect_format(path: PathLike, descriptor: int) -> str:
    """``bag`` or ``mcap``, by the first bytes.

    Raises:
        BagFormatError: Neither, empty, or a version that is not supported.
    """
    head = read_at(descriptor, 0, 16)
    if head.startswith(b"#ROSBAG V2.0\n"):
        return "bag"
    if head.startswith(BAG_MAGIC):
        raise BagFormatError("%s is a bag of version %s; only 2.0 can be read ('rosbag fix' converts older ones)"
                             % (path, head[9:].split(b"\n")[0].decode("ascii", "replace")))
    if head.startswith(MCAP_MAGIC):
        return "mcap"
    if not head:
        raise BagFormatError("%s is empty" % path)
    raise BagFormatError("%s is neither a .bag nor an .mcap file" % path)


def read_index(path: PathLike) -> LogIndex:
    """The index of a log of either format.

    Raises:
        BagError: It cannot be read.
        BagFormatError: It is damaged, or has no index because the recording was cut off.
    """
    descriptor = open_for_reading(path)
    try:
        return index_of(path, descriptor)
    finally:
        os.close(descriptor)


def index_of(path: PathLike, descriptor: int) -> LogIndex:
    """As ``read_index``, of an open file.

    Raises:
        BagFormatError: See ``read_index``.
    """
    if detect_format(path, descriptor) == "bag":
        from .bag_index import read_bag_index as read
    else:
        from .mcap_index import read_mcap_index as read
    try:
        return read(path, descriptor)
    except BagFormatError as error:
        raise BagFormatError("%s: %s" % (path, error)) from error
