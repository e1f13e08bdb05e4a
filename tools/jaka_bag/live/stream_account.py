"""The account of a recording: how many messages of each publisher were received, written and lost."""
import json
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from ..errors import DefinitionError
from ..messages.connection import Connection
from ..messages.definitions import parse_definition

_SEQUENCE_WRAP = 1 << 32


def starts_with_header(connection: Connection) -> bool:
    """Return whether the type's first field is a ``std_msgs/Header``, so that number and stamp lie at known bytes."""
    try:
        fields = parse_definition(connection.datatype, connection.definition)[connection.datatype].fields
    except DefinitionError:
        return False
    return bool(fields) and fields[0].type == "std_msgs/Header" and fields[0].array is None


class PublisherStream:
    """One publisher's messages on one topic.

    Attributes:
        connection: The publisher's description of its stream.
        publisher: XMLRPC URI of the publishing node.
        has_header: Messages start with a ``std_msgs/Header``.
        is_wanted: False for a stream that is only listened to (the clock).
        received: Messages taken from the network.
        link_start: ``received`` when the present link was opened.
        written: Messages handed to a file.
        overflowed: Messages thrown away because the recorder's buffer was full.
        unwritten: Messages lost because the system refused to write.
        next_sequence: The ``header.seq`` that would follow the newest message on the present link; None before the
            first.
        missing: Messages that ``header.seq`` skipped.
        undelivered: Messages that the publisher counts as sent on this link beyond those received; None where it
            was never asked or gives no number.
        channel: Number of the stream in the file whose number in this process is ``channel_file``.
    """

    __slots__ = ("connection", "publisher", "has_header", "is_wanted", "received", "link_start", "written",
                 "overflowed", "unwritten", "next_sequence", "missing", "undelivered", "_undelivered_before",
                 "_shortfall", "channel", "channel_file")

    def __init__(self, connection: Connection, publisher: str, is_wanted: bool = True) -> None:
        self.connection = connection
        self.publisher = publisher
        self.has_header = starts_with_header(connection)
        self.is_wanted = is_wanted
        self.received = self.link_start = self.written = self.overflowed = self.unwritten = self.missing = 0
        self.next_sequence: Optional[int] = None
        self.undelivered: Optional[int] = None
        self._undelivered_before = 0
        self._shortfall: Optional[int] = None
        self.channel = 0
        self.channel_file = 0

    @property
    def position(self) -> int:
        """Number of the newest message to be written, from 1; dropped messages count, so that a log shows gaps."""
        return self.written + self.overflowed + self.unwritten

    def reopen(self) -> None:
        """Start the account of a new link of the same publisher, whose numbers start anew."""
        self._undelivered_before = self.undelivered or 0
        self.link_start = self.received
        self.next_sequence = None
        self._shortfall = None

    def note_sequence(self, sequence: int) -> None:
        """Count what ``header.seq`` skipped; a number that stays or goes back is a publisher's own choice."""
        if self.next_sequence is not None:
            skipped = (sequence - self.next_sequence) % _SEQUENCE_WRAP
            if skipped < _SEQUENCE_WRAP // 2:
                self.missing += skipped
        self.next_sequence = (sequence + 1) % _SEQUENCE_WRAP

    def note_sent(self, sent: int, is_final: bool = False) -> None:
        """Take the publisher's count of messages sent on the present link.

        Messages in flight look like lost ones, so that of two counts the smaller loss is believed.

        Args:
            sent: Its count, asked for before now.
            is_final: All messages in flight have been waited for.
        """
        shortfall = max(0, sent - (self.received - self.link_start))
        believed = shortfall if is_final or self._shortfall is None else min(shortfall, self._shortfall)
        if is_final or self._shortfall is not None:
            self.undelivered = self._undelivered_before + believed
        self._shortfall = shortfall


class TopicDrops(NamedTuple):
    """The account of one topic, over all its publishers; counts are messages.

    Attributes:
        received: Taken from the network.
        written: Written to the log.
        missing: Skipped by ``header.seq``; None where the type has no header.
        undelivered: Sent, by the publishers' own bus statistics, but never received; None where none has statistics.
        overflowed: Thrown away because the recorder's buffer was full.
        unwritten: Lost because the system refused to write.
        types: Distinct (type, md5sum) of its publishers; more than one is a conflict.
    """

    received: int
    written: int
    missing: Optional[int]
    undelivered: Optional[int]
    overflowed: int
    unwritten: int
    publishers: Tuple[str, ...]
    types: Tuple[Tuple[str, str], ...]

    @property
    def is_lossy(self) -> bool:
        """True where anything is known to be missing."""
        return bool(self.missing or self.undelivered or self.overflowed or self.unwritten)

    def describe(self) -> str:
        """Return one line: the losses and the evidence for each."""
        losses = ((self.missing, "%d missing by header.seq"),
                  (self.undelivered, "%d sent but not received (publisher's bus statistics)"),
                  (self.overflowed, "%d thrown away, the recorder's buffer was full"),
                  (self.unwritten, "%d received but not written"))
        return "; ".join(text % count for count, text in losses if count) or "nothing lost"


def _sum_known(values: Sequence[Optional[int]]) -> Optional[int]:
    known = [value for value in values if value is not None]
    return sum(known) if known else None


def drops_by_topic(streams: Sequence[PublisherStream]) -> Dict[str, TopicDrops]:
    """Return the account of each recorded topic, by topic name."""
    groups: Dict[str, List[PublisherStream]] = {}
    for stream in streams:
        if stream.is_wanted:
            groups.setdefault(stream.connection.topic, []).append(stream)
    return {topic: TopicDrops(
        sum(s.received for s in group), sum(s.written for s in group),
        _sum_known([s.missing if s.has_header else None for s in group]),
        _sum_known([s.undelivered for s in group]),
        sum(s.overflowed for s in group), sum(s.unwritten for s in group),
        tuple(sorted({s.connection.callerid or s.publisher for s in group})),
        tuple(sorted({(s.connection.datatype, s.connection.md5sum) for s in group})),
    ) for topic, group in sorted(groups.items())}


def drops_as_metadata(drops: Dict[str, TopicDrops]) -> Dict[str, str]:
    """Return the account as a MCAP metadata record holds it: topic to a JSON object."""
    return {topic: json.dumps(account._asdict(), sort_keys=True) for topic, account in drops.items()}
