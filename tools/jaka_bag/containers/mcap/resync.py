"""The search for the next whole record behind damage, in a file or in an unpacked chunk.

A record stands by itself: nothing marks where one begins. A place counts as the beginning of one where its kind, its
length and its content are possible, and those of the records that follow it, too.
"""
from typing import Callable, Container, NamedTuple, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ..index import Buffer
from ..interface import ParsedChunk
from . import records as fmt

_FIRST_WINDOW, _WINDOW = 1 << 14, 1 << 22
_MOST_AT_ONCE = 1 << 16
"""Bytes of a record other than a message that are looked at; one with more counts by its kind and length."""
_MOST_CUT_OFF = 1 << 32
"""Longest record, byte, that a file may end within; a longer one is damage: no chunk is 4 GB."""
_ROW = 2
"""Records in a row that make a place credible."""
_IN_MESSAGE = fmt.MESSAGE_HEAD.size - fmt.RECORD_HEAD.size
_MAY_BEGIN = np.isin(np.arange(256), (fmt.SCHEMA, fmt.CHANNEL, fmt.MESSAGE, fmt.ATTACHMENT, fmt.METADATA))
"""The kinds of records, by number, at which reading can go on."""
FIRST_PRIVATE = 0x80
"""The first kind of record that writers may give a meaning of their own."""


def check_content(opcode: int, body: Buffer) -> None:
    """Check that a record's body is one of its kind, as far as kinds have a content that can be wrong.

    Raises:
        BagFormatError: It is not.
    """
    cursor = fmt.Cursor(body)
    if opcode == fmt.SCHEMA:
        fmt.parse_schema(body)
    elif opcode == fmt.CHANNEL:
        fmt.parse_channel(body, {})
    elif opcode == fmt.MESSAGE_INDEX:
        cursor.number("H")
        entries = cursor.raw(cursor.number("I"))
        if len(entries) % 16 or not entries and len(body) >= _IN_MESSAGE:
            raise BagFormatError("a message index is damaged")
    elif opcode == fmt.CHUNK_INDEX:
        fmt.parse_chunk_index(body)
    elif opcode == fmt.ATTACHMENT_INDEX:
        fmt.parse_attachment_index(body)
    elif opcode == fmt.STATISTICS:
        fmt.parse_statistics(body)
    elif opcode == fmt.ATTACHMENT:
        fmt.parse_attachment(bytes(fmt.RECORD_HEAD.size) + bytes(body), 0)
    elif opcode == fmt.METADATA:
        cursor.text(), cursor.text_map()
    elif opcode == fmt.METADATA_INDEX:
        fmt.parse_metadata_index(body)
    elif opcode == fmt.SUMMARY_OFFSET:
        cursor.unpack("BQQ")


class Resync:
    """The places of a file, or of an unpacked chunk, at which a record may begin.

    Args:
        read: Returns the bytes from a position on, as many as a number, fewer at the end.
        end: Position behind the last byte.
        channels: Numbers of the channels that are known so far; it may grow.
    """

    def __init__(self, read: Callable[[int, int], Buffer], end: int, channels: Container[int]) -> None:
        self._read = read
        self.end = end
        self._channels = channels

    def end_of(self, at: int) -> int:
        """Return the end of the record at a position; 0 where there is none that can be one, or it is cut off."""
        head = self._read(at, fmt.MESSAGE_HEAD.size)
        if len(head) < fmt.RECORD_HEAD.size or head[0] == 0:
            return 0
        opcode, length = fmt.RECORD_HEAD.unpack_from(head)
        end = at + fmt.RECORD_HEAD.size + int(length)
        if end > self.end or opcode == fmt.MESSAGE and length < _IN_MESSAGE:
            return 0
        if opcode == fmt.DATA_END and length > _MOST_AT_ONCE:
            return 0
        return end

    def fits(self, at: int) -> bool:
        """Return whether a whole record may begin at a position, or the bytes end there.

        One of a kind that is not defined counts only where one that is defined, or the end, follows it.
        """
        while at < self.end:
            end = self.end_of(at)
            if not end or self._read(at, 1)[0] <= fmt.DATA_END:
                return end > 0
            at = end
        return True

    def _is_credible(self, at: int) -> bool:
        """Return whether a row of records begins at a position."""
        for number in range(_ROW):
            end = self.end_of(at)
            if not end:
                return number > 0 and self._is_cut_off(at)
            opcode = self._read(at, 1)[0]
            if opcode > fmt.DATA_END:
                return False
            if opcode == fmt.MESSAGE:
                if number == 0 and self._channels and self._channel_at(at) not in self._channels:
                    return False
            elif end - at <= _MOST_AT_ONCE:
                try:
                    check_content(opcode, self._read(at, end - at)[fmt.RECORD_HEAD.size:])
                except BagFormatError:
                    return False
            if end == self.end or opcode in (fmt.DATA_END, fmt.FOOTER):
                return True
            at = end
        return True

    def _is_cut_off(self, at: int) -> bool:
        """Return whether the bytes end within a record that begins at a position."""
        head = self._read(at, fmt.RECORD_HEAD.size)
        if len(head) < fmt.RECORD_HEAD.size:
            return True
        opcode, length = fmt.RECORD_HEAD.unpack_from(head)
        claimed = fmt.RECORD_HEAD.size + int(length)
        return bool(0 < opcode <= fmt.DATA_END and self.end - at < claimed < _MOST_CUT_OFF)

    def _channel_at(self, at: int) -> int:
        return int(fmt.MESSAGE_HEAD.unpack(self._read(at, fmt.MESSAGE_HEAD.size))[2])

    def next(self, begin: int, stop: int) -> int:
        """Return the first position from ``begin`` on at which a row of records begins, at the latest ``stop``."""
        size = _FIRST_WINDOW
        while begin < stop:
            data = np.frombuffer(self._read(begin, min(size, stop - begin) + fmt.RECORD_HEAD.size), np.uint8)
            last = len(data) - fmt.RECORD_HEAD.size
            if last <= 0:
                break
            likely = np.flatnonzero(_MAY_BEGIN[data[:last]])
            for i in range(5, fmt.RECORD_HEAD.size):  # no record of these kinds has 4 GiB
                likely = likely[data[likely + i] == 0]
            for start in likely.tolist():
                place: int = begin + start
                if place < stop and self._is_credible(place):
                    return place
            begin += last
            size = min(2 * size, _WINDOW)
        return stop


class Damage(NamedTuple):
    """Bytes that are no whole records, from ``begin`` to before ``end``."""

    begin: int
    end: int
    reason: str


def around_damage(raw: Buffer, at: int, begin: int, parsed: ParsedChunk, places: Resync,
                  search: Callable[[int, int], int]) -> Tuple[ParsedChunk, Optional[Damage]]:
    """Return the records of a buffer without a last one whose length is damaged, and the damage that ends them.

    Args:
        raw: The buffer.
        at: Position of its first byte among ``places``.
        begin: First byte of the buffer that was read.
        parsed: Records from there on, up to one that is damaged or of another kind.
        places: The places of records.
        search: Returns the next place of a record, as ``Resync.next``.
    """
    end = at + parsed.consumed
    if places.fits(end):
        return parsed, None
    last = _last_record(raw, begin, parsed)
    if last >= 0:
        again = search(at + last + 1, end)
        if again < end:  # there are records inside the one that was read last
            batch = parsed.batch
            is_message = len(batch) and int(batch.start[-1] + batch.length[-1]) == parsed.consumed
            kept = batch.take(slice(0, -1)) if is_message else batch
            return parsed._replace(batch=kept, consumed=last), Damage(at + last, again, "a record's length is damaged")
    return parsed, Damage(end, search(end + 1, places.end), "a record is damaged or cut off")


def _last_record(raw: Buffer, begin: int, parsed: ParsedChunk) -> int:
    """Return the begin of the last record that was read; -1 where there is none."""
    last: int = -1
    if len(parsed.batch):  # records of other kinds may follow the last message
        begin = int(parsed.batch.start[-1]) - fmt.MESSAGE_HEAD.size
    for _, body, _ in fmt.records_in(raw, begin, parsed.consumed):
        last = int(body) - fmt.RECORD_HEAD.size
    return last
