"""The formats of logs: which one a file has, by content; which one an output gets, by name; who reads and writes it."""
import contextlib
import importlib
import os
from typing import TYPE_CHECKING, Any, BinaryIO, Dict, Iterator, NamedTuple, Optional, Set, Tuple

from ..errors import BagError, BagFormatError
from ..paths import PathLike, note_source
from .index import (
    ZSTD,
    CodecTotals,
    LogIndex,
    MetadataIndex,
    codec_totals,
    is_folder_of_messages,
    is_rosbag2,
    open_for_reading,
    read_at,
)

if TYPE_CHECKING:  # an index is read without numpy
    from .interface import LogReader, LogWriter
    from .recovery import LogRecovery


class Format(NamedTuple):
    """One container format; its parts are named and imported when they are first needed.

    Attributes:
        name: Value of ``LogIndex.format``; bags of version 1.2 are ``bag`` there.
        suffix: Suffix of its files; empty where it is never written.
        magic: First bytes of its files.
        records: Module with ``read_index(path, descriptor)``, which may give None for a whole file without an index,
            ``parse_chunk_head(raw)`` and, for formats with metadata, ``read_metadata(descriptor, entry)``; no numpy.
        reader: ``module:class`` of its ``LogReader``.
        writer: ``module:class`` of its ``LogWriter``.
        recovery: ``module:class`` of its ``LogRecovery``.
        walk: ``module:function`` of ``(path, descriptor)``, which makes the index of a whole file without one.
        active: The same for a file that is still being written, whose name ends in ``.active``.
    """

    name: str
    suffix: str
    magic: bytes
    records: str
    reader: str
    writer: str
    recovery: str
    walk: str = ""
    active: str = ""


FORMATS = (
    Format("bag", ".bag", b"#ROSBAG V2.0\n", "jaka_bag.containers.bag.records",
           "jaka_bag.containers.bag.reader:BagReader", "jaka_bag.containers.bag.writer:BagWriter",
           "jaka_bag.containers.bag.recovery:BagRecovery"),
    Format("rosrecord", "", b"#ROSRECORD V1.2\n", "jaka_bag.containers.bag.rosrecord",
           "jaka_bag.containers.bag.rosrecord:RosrecordReader", "",
           "jaka_bag.containers.bag.rosrecord:RosrecordRecovery"),
    Format("mcap", ".mcap", b"\x89MCAP", "jaka_bag.containers.mcap.records",
           "jaka_bag.containers.mcap.reader:McapReader", "jaka_bag.containers.mcap.writer:McapWriter",
           "jaka_bag.containers.mcap.recovery:McapRecovery", "jaka_bag.containers.mcap.recovery:walk_index",
           "jaka_bag.containers.mcap.active:active_index"),
    Format("sqlite3", "", b"SQLite format 3\0", "jaka_bag.containers.sqlite_records",
           "jaka_bag.containers.sqlite_reader:SqliteReader", "",
           "jaka_bag.containers.sqlite_recovery:SqliteRecovery"),
)
_PIECE = 1 << 20
"""Bytes of a piece that a signature covers; a change is located to so many bytes."""
_BEGINNING = 1 << 20
"""Bytes of each chunk in which a first message is looked for before whole chunks are unpacked."""
ROSBAG2_READER = "jaka_bag.containers.rosbag2_reader:Rosbag2Reader"
ROSBAG2_RECOVERY = "jaka_bag.containers.rosbag2_recovery:Rosbag2Recovery"
ROSBAG2_WRITER = "jaka_bag.containers.rosbag2:Rosbag2Writer"
"""Writes folders, which have no suffix."""


def load(name: str) -> Any:
    """Import a module by its name, or the object that ``module:object`` names."""
    module, _, attribute = name.partition(":")
    imported = importlib.import_module(module)
    return getattr(imported, attribute) if attribute else imported


def detect_format(path: PathLike, descriptor: int) -> Format:
    """Detect the format of an open file by its first bytes.

    Raises:
        BagFormatError: The file is empty, or of no known format or supported version.
    """
    head = read_at(descriptor, 0, 16)
    for entry in FORMATS:
        if head.startswith(entry.magic):
            return entry
    if head.startswith((b"#ROSBAG V", b"#ROSRECORD V")):
        raise BagFormatError("%s is a bag of version %s; only 1.2 and 2.0 can be read ('rosbag fix' converts others)"
                             % (path, head.partition(b" V")[2].split(b"\n")[0].decode("ascii", "replace")))
    if head.startswith(ZSTD):
        raise BagFormatError("%s is compressed as a whole: unpack it (zstd -d), or give the rosbag2 folder that it is "
                             "a part of" % path)
    if not head:
        raise BagFormatError("%s is empty" % path)
    raise BagFormatError("%s is no .bag, .mcap or .db3 file" % path)


def _index_of(entry: Format, path: PathLike, descriptor: int) -> LogIndex:
    try:
        index: LogIndex = load(entry.records).read_index(path, descriptor) or load(entry.walk)(path, descriptor)
    except BagFormatError as error:
        if not (entry.active and str(path).endswith(".active")):
            raise BagFormatError("%s: %s" % (path, _text_of(entry, path, error))) from error
        try:
            index = load(entry.active)(path, descriptor)
        except BagFormatError as damage:
            raise BagFormatError("%s: %s" % (path, _text_of(entry, path, damage))) from damage
    return index


def _keeps_any(entry: Format, path: PathLike) -> bool:
    """Return whether the recovery of a log finds a message: in the beginnings of chunks, else in all of them."""
    with open_for_reading(path) as file:
        for most in (_BEGINNING, None):
            ids: Set[int] = set()
            try:
                recovery: LogRecovery = load(entry.recovery)(file.fileno(), os.fstat(file.fileno()).st_size)
                recovery.most_unpacked = most
                for stretch in recovery.stretches():
                    ids.update(stretch.batch.connection.tolist())
                    if ids & recovery.connections.keys():
                        return True
            except BagError:
                pass
            if ids & recovery.connections.keys():
                return True
    return False


def _text_of(entry: Format, path: PathLike, error: BagFormatError) -> str:
    import traceback  # 2 ms of the start of a command, which whole files do not need
    traceback.clear_frames(error.__traceback__)  # they hold the chunk, which the search for a message unpacks once more
    return _with_true_hint(entry, path, str(error))


def _with_true_hint(entry: Format, path: PathLike, text: str) -> str:
    """Return the text of an error without the advice to recover the log where that finds no message."""
    advice = text.find(" (jaka_bag recover")
    if advice < 0 or _keeps_any(entry, path):
        return text
    return text[:advice] + " (no message of it can be read)"


def _believable(entry: Format, path: PathLike, file: BinaryIO, index: LogIndex) -> LogIndex:
    """Return the index as declared where the file does not contradict it, else the index of its records.

    Raises:
        BagFormatError: A record is damaged.
    """
    if not index.contradiction:
        return index
    truth: LogIndex = load(entry.walk)(path, file.fileno()) if entry.walk else load(entry.reader)(
        file, index).index_of_records()
    return truth._replace(contradiction=index.contradiction, notes=(
        *truth.notes, "the index is not believed (%s): the records were read in its place" % index.contradiction))


def read_index(path: PathLike) -> LogIndex:
    """Read the index of a log in any format; needs no numpy where the file does not contradict it.

    Where it does, and records are damaged, too, a note says so and the index is the declared one.

    Raises:
        BagError: The log cannot be read.
        BagFormatError: The log is damaged, or has no index because the recording was cut off.
    """
    with open_for_reading(path) as file:
        entry = detect_format(path, file.fileno())
        index = _index_of(entry, path, file.fileno())
        try:
            return _believable(entry, path, file, index)
        except BagFormatError as error:
            return index._replace(notes=(*index.notes, "the index is wrong (%s), and so are records: %s" % (
                index.contradiction, str(error).replace("%s: " % path, "", 1))))


def _records_module(index: LogIndex) -> Any:
    return load(next(entry.records for entry in FORMATS if entry.name == index.format))


def read_codecs(index: LogIndex) -> Tuple[CodecTotals, ...]:
    """Return the totals of each codec of a log; read from the chunks' heads where the index does not say.

    Raises:
        BagFormatError: A chunk's head is damaged.
    """
    if index.codecs:
        return index.codecs
    parse_chunk_head = _records_module(index).parse_chunk_head
    with open_for_reading(index.path) as file:
        try:
            heads = [parse_chunk_head(read_at(file.fileno(), chunk.position, 256))
                     for chunk in index.chunks if not chunk.is_loose]
        except BagFormatError as error:
            raise BagFormatError("%s: %s" % (index.path, error)) from error
    return codec_totals((head.codec, head.data_size, head.size) for head in heads)


def read_metadata(index: LogIndex, entry: MetadataIndex) -> Dict[str, str]:
    """Read the content of one of ``index.metadata``; needs no numpy.

    Raises:
        BagFormatError: The record is damaged.
    """
    with open_for_reading(index.path) as file:
        values: Dict[str, str] = _records_module(index).read_metadata(file.fileno(), entry)
    return values


def file_pieces(file: BinaryIO) -> Iterator[Tuple[int, int, str]]:
    """Yield the pieces of a file of any format, without a gap: first byte, size, kind; its position is changed."""
    size = os.fstat(file.fileno()).st_size
    at = 0
    if read_at(file.fileno(), 0, 16).startswith(b"\x89MCAP"):
        for piece in load("jaka_bag.containers.mcap.pieces:pieces")(file):
            yield piece
            at = piece[0] + piece[1]
    while at < size:
        yield at, min(_PIECE, size - at), "bytes"
        at += _PIECE


def open_log(path: PathLike) -> "LogReader":
    """Open a log by content, whatever its name, or a rosbag2 folder; close it after use.

    Raises:
        BagError: It cannot be read.
        BagFormatError: It is damaged, or has no index because the recording was cut off.
    """
    note_source(path)
    if is_rosbag2(path):
        folder: LogReader = load(ROSBAG2_READER)(path)
        return folder
    file = open_for_reading(path)
    try:
        entry = detect_format(path, file.fileno())
        index = _believable(entry, path, file, _index_of(entry, path, file.fileno()))
        reader: LogReader = load(entry.reader)(file, index)
        reader.advice = lambda text: _with_true_hint(entry, path, text)
    except BaseException:
        file.close()
        raise
    return reader


@contextlib.contextmanager
def open_damaged(path: PathLike) -> Iterator["LogRecovery"]:
    """Open a log or a rosbag2 folder, damaged or not, for recovery; it is closed at the end of the ``with`` block.

    Raises:
        BagFormatError: It is of no known format, or encrypted.
        BagError: It cannot be opened.
    """
    note_source(path)
    if is_folder_of_messages(path):
        yield load(ROSBAG2_RECOVERY)(path)
        return
    with open_for_reading(path) as file:
        recovery: LogRecovery = load(detect_format(path, file.fileno()).recovery)(
            file.fileno(), os.fstat(file.fileno()).st_size)
        yield recovery


def create_log(path: PathLike, compression: Optional[str] = None, level: Optional[int] = None,
               overwrite: bool = False, profile: str = "ros1", as_rosbag2: bool = False,
               **options: Any) -> "LogWriter":
    """Begin an output.

    Args:
        path: Its suffix decides about the format.
        compression: None for the format's default: zstd for MCAP, none for .bag.
        level: The codec's level; None for the codec's default.
        overwrite: Replace an existing output.
        profile: Profile of an MCAP.
        as_rosbag2: Make a rosbag2 folder: ROS 1 messages are converted to CDR.
        options: Options of ``LogWriter``: ``chunk_size``, ``suffix``, ``keep_leftover``.

    Raises:
        BagError: The suffix is neither, the compression is not the format's, or it cannot be created.
        OutputExists: The output exists and ``overwrite`` is False.
    """
    suffix = os.path.splitext(str(path))[1]
    writer: LogWriter
    if as_rosbag2:
        if suffix:
            raise BagError("the output of the profile ros2 is a folder: %s has a suffix" % path)
        writer = load(ROSBAG2_WRITER)(path, compression, level, overwrite)
        return writer
    for entry in FORMATS:
        if suffix and suffix == entry.suffix:
            writer = load(entry.writer)(path, compression, level, overwrite=overwrite, profile=profile, **options)
            return writer
    raise BagError("%s: the name of an output ends in .bag or .mcap" % path)
