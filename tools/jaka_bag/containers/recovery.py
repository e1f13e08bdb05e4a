"""What recovering a log of either format yields."""
from typing import Dict, Iterator, List, NamedTuple, Optional

from ..messages.batch import Block
from ..messages.connection import Connection
from .index import AttachmentIndex, MetadataIndex


class Loss(NamedTuple):
    """A stretch of the file that could not be read, or not be trusted.

    Attributes:
        begin: First byte.
        end: First byte behind it.
        reason: What is wrong there.
    """

    begin: int
    end: int
    reason: str

    def describe(self) -> str:
        """One line."""
        return "bytes %d to %d: %s" % (self.begin, self.end, self.reason)


class Stretch(NamedTuple):
    """Messages that were read.

    Attributes:
        block: The messages; ``connection`` holds the file's own ids.
        connections: Connections that the file has declared up to here, by its own ids.
        end: First byte of the file behind them.
    """

    block: Block
    connections: Dict[int, Connection]
    end: int


class Salvager:
    """Reads a damaged log as far as that goes.

    Attributes:
        size: Bytes of the file.
        losses: What could not be read, so far.
        expected: Messages that the file's index tells of; None where there is no index.
        connections: Connections declared so far, by the file's own ids.
        profile: MCAP profile of the messages.
        attachments: Whole attachments found so far.
        metadata: Whole metadata records found so far.
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

    def lose(self, begin: int, end: int, reason: str) -> None:
        """Note a loss."""
        self.losses.append(Loss(begin, end, reason))

    def stretches(self) -> Iterator[Stretch]:
        """All messages that can be read, in the order of the file."""
        raise NotImplementedError
