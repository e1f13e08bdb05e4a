"""The interface for the recovery of damaged logs of any format."""
import functools
from typing import Dict, Iterator, List, NamedTuple, Optional

from ..errors import BagFormatError, DefinitionError
from ..messages.batch import MessageBatch
from ..messages.connection import Connection
from ..messages.definitions import definition_md5
from .compression import Allowance, decompress_partly
from .index import AttachmentIndex, Buffer, MetadataIndex


class Loss(NamedTuple):
    """A stretch of the file, from byte ``begin`` to before ``end``, that could not be read, or not be trusted."""

    begin: int
    end: int
    reason: str

    def describe(self) -> str:
        """Return the loss as one line."""
        return "bytes %d to %d: %s" % (self.begin, self.end, self.reason)


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
def _soundness(connection: Connection) -> int:
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
        allowance: Limits what the chunks unpack to.
        notes: Bytes that are no part of the format and were skipped, one line each, so far.
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
        self.notes: List[str] = []

    def learn(self, connections: Dict[int, Connection]) -> None:
        """Take up descriptions of connections; of several of one connection an intact one is kept."""
        for file_id, connection in connections.items():
            known = self.connections.get(file_id)
            if known is None or (known != connection and _soundness(connection) >= _soundness(known)):
                self.connections[file_id] = connection

    def lose(self, begin: int, end: int, reason: str) -> None:
        """Note a loss."""
        self.losses.append(Loss(begin, end, reason))

    def stretches(self) -> Iterator[Stretch]:
        """Yield all readable messages, in the order of the file."""
        raise NotImplementedError

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """Return the content of one of ``attachments``."""
        raise NotImplementedError

    def read_metadata(self, entry: MetadataIndex) -> Dict[str, str]:
        """Return the content of one of ``metadata``."""
        raise NotImplementedError

    def _partly(self, codec: str, data: Buffer, at: int, size: Optional[int] = None) -> bytes:
        """Decompress as much as possible of a damaged chunk, which claims ``size`` bytes (None: no claim)."""
        raw = decompress_partly(codec, data, size)
        try:
            self.allowance.take(at, len(raw))
        except BagFormatError:
            return b""
        return raw

    def _skip_damage(self, at: int, reason: str) -> int:
        """Record the damage at a position as lost; return the start of the next chunk, or the file's end."""
        end = self._next_chunk(at + 1, self.size)
        self.lose(at, end, reason)
        return end

    def _next_chunk(self, begin: int, stop: int) -> int:
        """Return the start of the next chunk, at the latest ``stop``."""
        raise NotImplementedError
