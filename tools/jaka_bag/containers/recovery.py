"""The interface for the recovery of damaged logs of any format."""
import functools
from typing import Dict, Iterator, List, NamedTuple, Optional, Tuple

from ..errors import BagFormatError, DefinitionError, LimitReached
from ..messages.batch import MessageBatch
from ..messages.connection import Connection
from ..messages.definitions import definition_md5
from .compression import MESSAGE_HEAD, Allowance, decompress, decompress_partly
from .index import AttachmentIndex, Buffer, MetadataIndex


class Loss(NamedTuple):
    """A stretch of the file that could not be read, or not be trusted.

    Attributes:
        begin: Its first byte.
        end: The byte behind it.
        reason: The reason, for users.
        after: Log time, ns, of the last message that was read before it; None where there is none.
        until: Log time, ns, of the first message that was read behind it; None where there is none.
        file: Name of the file of a folder; empty where the log is one file.
    """

    begin: int
    end: int
    reason: str
    after: Optional[int] = None
    until: Optional[int] = None
    file: str = ""

    @property
    def is_limit(self) -> bool:
        """True where nothing is known to be damaged: a limit of the reader ended it."""
        return LimitReached.WORDS in self.reason

    def describe(self) -> str:
        """Return the loss as one line; times are in s."""
        place = "bytes %d to %d" % (self.begin, self.end)
        if self.after is not None and self.until is not None:
            place += ", %s s between the messages of %s and %s" % (
                _seconds(self.until - self.after), _seconds(self.after), _seconds(self.until))
        elif self.after is not None:
            place += ", behind the message of %s" % _seconds(self.after)
        elif self.until is not None:
            place += ", before the message of %s" % _seconds(self.until)
        return "%s%s: %s" % (self.file and self.file + ": ", place, self.reason)


def _seconds(time: int) -> str:
    """Return a time, ns, in s with the digits that a float lacks."""
    return "%s%d.%06d" % (("-" if time < 0 else ""), *divmod(abs(time) // 1000, 1000000))


class Stretch(NamedTuple):
    """Messages that were read.

    Attributes:
        begin: First byte of the file that they come from.
        end: First byte after them.
        batch: The messages; ``connection`` holds the file's own ids.
        is_loose: They come from plain records rather than from a chunk.
    """

    begin: int
    end: int
    batch: MessageBatch
    is_loose: bool = False


@functools.lru_cache(maxsize=1024)
def soundness(connection: Connection) -> int:
    """Rank how credible a description is: 2 where the md5 fits, 1 where its text is valid, else 0."""
    try:
        "".join(map(str, connection)).encode("utf-8")
        return 2 if definition_md5(connection.datatype, connection.definition) == connection.md5sum else 1
    except (DefinitionError, UnicodeEncodeError) as error:
        return int(isinstance(error, DefinitionError))


class LogRecovery:
    """A reader that recovers as much of a damaged log as possible.

    Attributes:
        size: Bytes of the file.
        losses: Stretches that could not be read, so far.
        expected: Messages by the file's index; None where there is no index.
        connections: Connections declared so far, by the file's own ids.
        profile: MCAP profile of the messages.
        attachments: Whole attachments found so far.
        metadata: Whole metadata records found so far.
        allowance: Limits what the chunks unpack to beyond their messages.
        notes: Bytes that are no part of the format and were skipped, one line each, so far.
        most_unpacked: Bytes that are unpacked of one chunk, at most; None for all.
        misled: Chunks so far whose own index leads to other places than their messages.
    """

    def __init__(self, descriptor: int, size: int) -> None:
        self.descriptor = descriptor
        self.size = size
        self.losses: List[Loss] = []
        self.expected: Optional[int] = None
        self.connections: Dict[int, Connection] = {}
        self.profile = "ros1"
        self.attachments: List[AttachmentIndex] = []
        self.metadata: List[MetadataIndex] = []
        self.allowance = Allowance(size)
        self.misled = 0
        self.most_unpacked: Optional[int] = None
        self.notes: List[str] = []
        self._open = 0  # losses behind which messages were read
        self._last_time: Optional[int] = None
        self._barren = 0  # bytes that chunks unpacked to without giving messages
        self._limit = ""  # how the limit of the whole file was reached

    def learn(self, connections: Dict[int, Connection]) -> None:
        """Take up descriptions of connections; of several of one connection an intact one is kept."""
        for file_id, connection in connections.items():
            known = self.connections.get(file_id)
            if known is None or (known != connection and soundness(connection) >= soundness(known)):
                self.connections[file_id] = connection

    def lose(self, begin: int, end: int, reason: str) -> None:
        """Note a loss between the messages yielded before and those after; it may continue the one before."""
        if self._open < len(self.losses) and self.losses[-1][1:3] == (begin, reason):
            self.losses[-1] = self.losses[-1]._replace(end=end)
            return
        self.losses.append(Loss(begin, end, reason, self._last_time))

    def stretches(self) -> Iterator[Stretch]:
        """Yield all readable messages, in the order of the file."""
        for stretch in self._stretches():
            batch = stretch.batch
            if len(batch):
                first = int(batch.log_time[0])
                self.losses[self._open:] = [loss._replace(until=first) for loss in self.losses[self._open:]]
                self._open, self._last_time = len(self.losses), int(batch.log_time[-1])
                self._barren = max(self._barren - int(batch.length.sum()) - MESSAGE_HEAD * len(batch), 0)
            yield stretch

    def _stretches(self) -> Iterator[Stretch]:
        """Yield all readable messages and note the losses, both in the order of the file."""
        raise NotImplementedError

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """Return the content of one of ``attachments``."""
        raise NotImplementedError

    def read_metadata(self, entry: MetadataIndex) -> Dict[str, str]:
        """Return the content of one of ``metadata``."""
        raise NotImplementedError

    def contradictions(self, counts: Dict[int, int]) -> List[str]:
        """Return where the declarations of a rosbag2 folder or an MCAP disagree with the content, one line each.

        Args:
            counts: Messages that were read, by number of the connection.
        """
        return []

    def _unpack(self, codec: str, data: Buffer, size: Optional[int] = None, is_whole: bool = True
                ) -> Tuple[Buffer, str]:
        """Return what a chunk unpacks to, or the decodable beginning of it, and the reason where it is not all.

        Args:
            codec: Its codec.
            data: Its bytes that there are.
            size: Bytes that it claims to unpack to; None for no claim.
            is_whole: All its bytes are there.
        """
        is_packed = codec not in ("none", "")
        try:
            if is_packed and not self._limit:
                self.allowance.check_barren(self._barren)
        except LimitReached as error:
            self._limit = str(error)
        if is_packed and self._limit:
            return b"", self._limit
        raw: Optional[Buffer] = None
        reason = ""
        if is_packed and self.most_unpacked is not None:
            is_whole = False
            size = self.most_unpacked if size is None else min(size, self.most_unpacked)
            reason = "only the beginning was unpacked"
        if is_whole and size is not None:
            try:
                raw = decompress(codec, data, size)
            except BagFormatError as error:
                reason = str(error)
        if raw is None:
            raw = decompress_partly(codec, data, size)
            if reason and len(raw):
                reason += ", and the last of what it gives may not be as recorded"
        if is_packed:
            self._barren += len(raw)
        return raw, reason

    def _skip_damage(self, at: int, reason: str) -> int:
        """Record the damage at a position as lost; return the start of the next chunk, or the file's end."""
        end = self._next_chunk(at + 1, self.size)
        self.lose(at, end, reason)
        return end

    def _next_chunk(self, begin: int, stop: int) -> int:
        """Return the start of the next chunk, at the latest ``stop``."""
        raise NotImplementedError
