"""The walk over an MCAP's records: recovery of a damaged one, and the index of a whole one without a summary.

Functions that read raise ``BagFormatError`` where the bytes are damaged or cut off.
"""
import bisect
import itertools
import os
import struct
import zlib
from typing import Counter, Dict, Generator, Iterator, List, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import MessageBatch
from ...messages.connection import Connection
from ...paths import PathLike
from ...units import NS_PER_S
from ..index import AttachmentIndex, Buffer, LogIndex, MetadataIndex, read_at
from ..interface import chunk_of
from ..recovery import LogRecovery, Stretch
from . import records as fmt
from .reader import Channels, index_entries, offsets_in, parse_chunk, scan
from .resync import FIRST_PRIVATE, Damage, Resync, around_damage, check_content

_LOOSE = (fmt.SCHEMA, fmt.CHANNEL, fmt.MESSAGE)
_OF_DATA = (fmt.MESSAGE, fmt.CHUNK, fmt.MESSAGE_INDEX, fmt.ATTACHMENT, fmt.METADATA, fmt.DATA_END)
"""Kinds of records that no summary holds."""
_FIRST_LOOSE_WINDOW, _LOOSE_WINDOW = 1 << 16, 1 << 20
_WINDOW = 4 << 20
"""Bytes read at a time: memory stays bounded, and a disk is read in long pieces."""
_NEAR = 60 * NS_PER_S
"""Distance, ns, of the times of messages that lie beside each other, at most."""
_CODEC_AT = 37
"""Position of the length of the codec's name in a chunk record."""
_SMALLEST_CHUNK = 49
_LONGEST_CHUNK_HEAD = 64
"""Bytes read for the head of a chunk record: its fields have 49, and the codec's name some."""
_INDEX_HEAD = struct.Struct("<BQHI")
"""Record head, channel and size of the entries of a message index."""
_FRAMES = (("zstd", b"\x28\xb5\x2f\xfd"), ("lz4", b"\x04\x22\x4d\x18"))
"""Codecs and the first bytes of what they make."""


class McapRecovery(LogRecovery):
    """The recovery of an MCAP; see ``LogRecovery``. The profile is ``ros1`` where the file's head is damaged."""

    def __init__(self, descriptor: int, size: int) -> None:
        super().__init__(descriptor, fmt.end_of_records(descriptor, size))
        self.notes += fmt.zeros_behind(self.size, size)
        self._channels = Channels()
        self._places = Resync(lambda at, length: read_at(descriptor, at, length), self.size, self.connections)
        self._loose_window = _LOOSE_WINDOW
        self._summary_channels: Dict[int, Connection] = {}
        self._indexes: List[Tuple[int, int]] = []  # where there are message indexes by the summary
        self._extras: List[Tuple[int, int, str]] = []  # where attachments and metadata are by the summary
        self._data_end = self.size
        self._crcs: Dict[int, Optional[bool]] = {}
        self._sealed_end: Optional[int] = None  # where the footer tells that all data ends; 0 where it does not
        self._summary_start = 0
        self._sound_from = self.size  # whole records follow one another from here to the file's end
        self._broken_at = -1  # no whole record begins here
        self._goes_on_at = 0  # a record of data that lies behind the end of the data as records tell it
        self._has_unchecked = False  # messages that no checksum but that of all data covers
        self._begin = len(fmt.MAGIC)
        self.library = ""
        try:
            self.profile, self.library, self._begin = fmt.read_file_head(descriptor)
        except BagFormatError as error:
            self.lose(0, self._begin, str(error))
        try:
            summary = fmt.read_summary(descriptor, self.size)
            if summary is not None:
                self._summary_start = fmt.read_footer(descriptor, self.size)[0]
                self._channels.schemas.update(summary.schemas)
                self.learn(summary.channels)
                self._summary_channels = summary.channels
                self._indexes = sorted((chunk.position + chunk.size, chunk.position + chunk.size + chunk.index_size)
                                       for chunk in summary.chunks)
                self._extras = [(entry.position, entry.position + entry.size, "%s %s" % (what, entry.name))
                                for what, entries in (("the attachment", summary.attachments),
                                                      ("the metadata", summary.metadata)) for entry in entries]
                self.expected = None if summary.statistics is None else summary.statistics.messages
        except BagFormatError:
            pass  # that there is none is why the file is recovered

    def _stretches(self) -> Iterator[Stretch]:
        at, chunk_end = self._begin, 0
        while at < self.size:
            opcode = read_at(self.descriptor, at, 1)[0]
            if opcode in (fmt.DATA_END, fmt.FOOTER) and self._ends_data(at, opcode):
                self._data_end = at
                break
            try:
                if opcode == fmt.CHUNK:
                    at = chunk_end = yield from self._chunk(at)
                elif opcode == fmt.MESSAGE and at == chunk_end and self._is_like_index(at):
                    begin, at = at, self._record_end(at)
                    self.lose(begin, at, "a message index is damaged")
                elif opcode in _LOOSE:
                    at = yield from self._loose(at)
                else:
                    at = self._other(at, opcode)
            except BagFormatError as error:
                at = yield from self._behind_damage(at, str(error).split(" (")[0])
        self._check_data()

    def _check_data(self) -> None:
        """Note what is missing by the summary, and a wrong checksum of messages that have no other one.

        It is called behind the walk.
        """
        found = {entry.position for entry in self.attachments} | {entry.position for entry in self.metadata}
        lost = sorted((loss.begin, loss.end) for loss in self.losses)
        begins, ends = [begin for begin, _ in lost], list(itertools.accumulate((end for _, end in lost), max))
        for position, end, what in self._extras:
            before = bisect.bisect_right(begins, position)
            if position not in found and not (before and position < ends[before - 1]):
                self.lose(position, end, "%s, of which the summary tells, is not there" % what)
                found.add(position)
        if self._has_unchecked and self._has_right_crc(self._data_end) is False:
            self.lose(self._begin, self._data_end, "the data section's CRC is wrong: messages outside of chunks, and "
                      "of chunks without a CRC, which were kept, may not be as recorded")

    def _has_right_crc(self, data_end: int) -> Optional[bool]:
        """Return whether the data up to its last record has the CRC that this names; None where it names none."""
        if data_end not in self._crcs:
            self._crcs[data_end] = fmt.has_right_crc(self.descriptor, data_end)
        return self._crcs[data_end]

    def _ends_data(self, at: int, opcode: int) -> bool:
        """Return whether the data section ends with a record, rather than that its kind is damaged."""
        end = self._places.end_of(at)
        if not end:
            return self.size - at <= fmt.FOOTER_SIZE
        if opcode == fmt.FOOTER:
            return end + len(fmt.MAGIC) >= self.size and not self._is_like_chunk(at)
        return not self._is_like_index(at) and not self._goes_on(end)

    def _is_like_index(self, at: int) -> bool:
        """Return whether a record of another kind has the sizes of a message index."""
        raw = read_at(self.descriptor, at, _INDEX_HEAD.size)
        if len(raw) < _INDEX_HEAD.size:
            return False
        _, length, _, size = map(int, _INDEX_HEAD.unpack(raw))
        return 0 < size == length - 6 and size % 16 == 0

    def _goes_on(self, at: int) -> bool:
        """Return whether data comes behind the record that ends at a position, rather than a summary or nothing."""
        if at <= self._goes_on_at:
            return True
        while at != self._summary_start:
            opcode = read_at(self.descriptor, at, 1)
            if not opcode or opcode[0] == fmt.FOOTER:
                break
            if opcode[0] in _OF_DATA:
                self._goes_on_at = at
                return True
            at = self._places.end_of(at)
            if not at:
                break
        return False

    def _loose(self, at: int) -> Generator[Stretch, None, int]:
        """Yield messages of loose records from a position on; return where to read on."""
        length = max(self._loose_window, self._record_end(at) - at)
        raw = read_at(self.descriptor, at, min(length, self.size - at))
        parsed = scan(raw, self._channels, is_loose=True)
        if not parsed.consumed:
            raise BagFormatError("a record is damaged")
        self.learn(parsed.connections)
        end = at + parsed.consumed
        chunk = self._swallowed(at, end, parsed.batch)
        if chunk < end:
            parsed = scan(raw, self._channels, 0, chunk - at, True)
            damage: Optional[Damage] = Damage(at + parsed.consumed, chunk, "a record's length is damaged")
        else:
            parsed, damage = around_damage(raw, at, 0, parsed, self._places, self._next_record)
        self._has_unchecked |= len(parsed.batch) > 0
        self._loose_window = _FIRST_LOOSE_WINDOW if damage else min(2 * self._loose_window, _LOOSE_WINDOW)
        yield Stretch(at, at + parsed.consumed, parsed.batch, True)
        if damage is None:
            return at + parsed.consumed
        self.lose(*damage)
        return damage.end

    def _record_end(self, at: int) -> int:
        """Return the end of the record at a position."""
        head = read_at(self.descriptor, at, fmt.RECORD_HEAD.size)
        if len(head) == fmt.RECORD_HEAD.size:
            end = at + fmt.RECORD_HEAD.size + int(fmt.RECORD_HEAD.unpack(head)[1])
            if end <= self.size:
                return end
        raise BagFormatError("a record at byte %d is cut off" % at)

    def _region_end(self, at: int) -> int:
        """Return the end of a chunk and the message indexes after it."""
        end = self._record_end(at)
        while True:
            head = read_at(self.descriptor, end, _INDEX_HEAD.size)
            if head[:1] != bytes([fmt.MESSAGE_INDEX]) or len(head) < _INDEX_HEAD.size:
                return end
            _, length, _, size = _INDEX_HEAD.unpack(head)
            after = end + fmt.RECORD_HEAD.size + int(length)
            if after > self.size or length != 6 + size and not (
                    0 < length - 6 - size <= fmt.MAX_UNKNOWN and self._places.fits(after)
                    and self._swallowed(end, after) == after):
                return end
            end = after

    def _swallowed(self, begin: int, end: int, batch: Optional[MessageBatch] = None) -> int:
        """Return the start of a chunk that records would swallow by a damaged length; their end where there is none.

        A payload may be a file of this format: its chunks are no damage where the checksum of all data is right, or
        where whole records follow one another to the file's end and the summary has no chunk in between.

        Args:
            begin: First byte of the records.
            end: The byte behind them.
            batch: The messages that they are.
        """
        chunk = self._next_chunk(begin + 1, end)
        if chunk == end or self._is_sealed():
            return end
        if batch is None or self._has_named_chunk(begin, end):
            return chunk
        place = chunk - begin - batch.start
        is_in_payload = bool(((place >= 0) & (place < batch.length)).any())
        return end if is_in_payload and self._leads_on(end) else chunk

    def _is_sealed(self) -> bool:
        """Return whether the checksum of all data is right, which is calculated once and only where it matters."""
        if self._sealed_end is None:
            self._sealed_end = fmt.find_data_end(self.descriptor, self.size)
        return self._sealed_end > 0 and self._has_right_crc(self._sealed_end) is True

    def _has_named_chunk(self, begin: int, end: int) -> bool:
        """Return whether the summary has a chunk that ends between two positions, or at the latter."""
        first = bisect.bisect_right(self._indexes, (begin, self.size))
        return first < len(self._indexes) and self._indexes[first][0] <= end

    def _leads_on(self, at: int) -> bool:
        """Return whether whole records follow one another from a position to the file's end."""
        if at <= self._broken_at:
            return False
        begin = at
        while at < self._sound_from:
            end = self._places.end_of(at)
            if read_at(self.descriptor, at, 1) == bytes([fmt.FOOTER]) and end + len(fmt.MAGIC) == self.size:
                break
            if not end:
                self._broken_at = at
                return False
            at = end
        self._sound_from = min(begin, self._sound_from)
        return True

    def _other(self, at: int, opcode: int) -> int:
        """Read a record that holds no message; return its end."""
        end = self._record_end(at)
        is_end_sure = self._places.fits(end)
        if (not self._places.fits(at) or not is_end_sure and opcode not in (fmt.ATTACHMENT, fmt.METADATA)
                or self._is_like_chunk(at) and not self._is_sealed()):
            raise BagFormatError("a record of kind %d is damaged" % opcode)
        if opcode != fmt.ATTACHMENT and self._swallowed(at, end) < end:
            raise BagFormatError("a record's length is damaged")
        raw = read_at(self.descriptor, at, end - at)
        try:
            if opcode == fmt.ATTACHMENT:
                entry = fmt.parse_attachment(raw, at)
                fmt.read_attachment(self.descriptor, entry)
                self.attachments.append(entry)
            elif opcode == fmt.METADATA:
                self.metadata.append(fmt.parse_metadata(raw, at))
            elif opcode in (fmt.HEADER, fmt.DATA_END, fmt.FOOTER):
                raise BagFormatError("a record of kind %d is where none can be" % opcode)
            elif opcode > fmt.DATA_END and self._is_like_message(at) and not self._is_sealed():
                raise BagFormatError("a record of kind %d has the form of a message" % opcode)
            elif fmt.DATA_END < opcode < FIRST_PRIVATE:
                self.notes.append("a record of the unknown kind %d at byte %d was skipped" % (opcode, at))
            else:
                check_content(opcode, raw[fmt.RECORD_HEAD.size:])
        except BagFormatError as error:
            if not is_end_sure:
                raise
            self.lose(at, end, str(error))
        return end

    def _is_like_message(self, at: int) -> bool:
        """Return whether a record of another kind has the channel and the time of a message.

        The content of a private kind is its writer's own: it counts only where one bit makes a message of the kind.
        """
        raw = read_at(self.descriptor, at, fmt.MESSAGE_HEAD.size)
        if len(raw) < fmt.MESSAGE_HEAD.size or self._last_time is None:
            return False
        if raw[0] >= FIRST_PRIVATE and bin(raw[0] ^ fmt.MESSAGE).count("1") > 1:
            return False
        _, length, channel, _, time, _ = fmt.MESSAGE_HEAD.unpack(raw)
        return (length >= fmt.MESSAGE_HEAD.size - fmt.RECORD_HEAD.size and channel in self.connections
                and abs(int(time) - self._last_time) < _NEAR)

    def _is_like_chunk(self, at: int) -> bool:
        """Return whether a record of another kind has the head of a chunk."""
        try:
            fmt.parse_chunk_head(bytes([fmt.CHUNK]) + read_at(self.descriptor, at + 1, 255))
        except BagFormatError:
            return False
        return True

    def _next_record(self, begin: int, stop: int) -> int:
        """Return the start of the next chunk, or of the next row of loose records, at the latest ``stop``."""
        window = _FIRST_LOOSE_WINDOW
        while begin < stop:
            limit = min(begin + window, stop)
            chunk = self._next_chunk(begin, limit)
            found = self._places.next(begin, chunk)
            if found < limit:
                return found
            begin, window = limit, min(2 * window, _WINDOW)
        return stop

    def _behind_damage(self, at: int, reason: str) -> Generator[Stretch, None, int]:
        """Yield messages of a chunk whose head is damaged; return the start of the next record, or the file's end."""
        end = self._next_record(at + 1, self.size)
        raw = read_at(self.descriptor, at, min(_LONGEST_CHUNK_HEAD, end - at))
        for codec, magic in _FRAMES:
            begin = raw.find(magic)
            if begin >= 0:
                unpacked, limit = self._unpack(codec, read_at(self.descriptor, at + begin, end - at - begin),
                                               is_whole=False)
                yield from self._pieces(at, end, unpacked, limit or reason, True)
                return end
        self.lose(at, end, reason)
        return end

    def _next_chunk(self, begin: int, stop: int) -> int:
        """Return the start of the next chunk, at the latest ``stop``."""
        at = begin
        while at < stop and at + _SMALLEST_CHUNK <= self.size:
            raw = read_at(self.descriptor, at, min(_WINDOW, stop - at + _SMALLEST_CHUNK + 32))
            data = np.frombuffer(raw, np.uint8)
            last = len(data) - _CODEC_AT - 3
            likely = (data[:last] == fmt.CHUNK) & (data[_CODEC_AT:last + _CODEC_AT] <= 4)
            for i in (1, 2, 3):
                likely &= data[_CODEC_AT + i:last + _CODEC_AT + i] == 0
            for start in np.flatnonzero(likely).tolist():
                try:
                    fmt.parse_chunk_head(raw[start:start + 128])
                    return min(at + int(start), stop)
                except BagFormatError:
                    pass
            if len(raw) < _WINDOW:
                break
            at += _WINDOW - 128
        return stop

    def _chunk(self, at: int) -> Generator[Stretch, None, int]:
        """Yield the messages of the chunk at a position, or those left of it; return the start of the next record."""
        head = fmt.parse_chunk_head(read_at(self.descriptor, at, 256))
        end = at + head.end
        if end > self.size:
            if self._next_chunk(at + 1, self.size) < self.size:
                raise BagFormatError("a chunk's length is damaged")
            data = read_at(self.descriptor, at + head.data_start, head.data_size)
            raw, reason = self._unpack(head.codec, data, head.size, False)
            yield from self._pieces(at, self.size, raw, reason or "the last chunk is cut off", head.codec != "none")
            return self.size
        region_end = self._region_end(at)
        region = read_at(self.descriptor, at, region_end - at)
        data = memoryview(region)[head.data_start:head.data_start + head.data_size]
        full, reason = self._unpack(head.codec, data, head.size)
        if reason:
            yield from self._pieces(at, end, full, reason, True)
            return region_end
        try:
            offset = offsets_in(index_entries(region, end - at))
        except BagFormatError:  # the message indexes behind the chunk are not usable
            offset = None
        try:
            parsed = parse_chunk(full, offset, self._channels)
        except BagFormatError:
            yield from self._pieces(at, end, full, "", False)
            return region_end
        self.misled += parsed.is_misled
        self._has_unchecked |= not head.crc and len(parsed.batch) > 0
        self.learn(parsed.connections)
        yield Stretch(at, region_end, parsed.batch)
        if head.crc and zlib.crc32(full) != head.crc:
            self.lose(at, end, "the chunk's CRC is wrong: some of its %d messages, which were kept, are not as recorded"
                      % len(parsed.batch))
        return region_end

    def _pieces(self, at: int, end: int, raw: Buffer, reason: str, is_doubtful: bool) -> Iterator[Stretch]:
        """Yield the messages around the damage of an unpacked chunk, or of the decodable beginning of one.

        Args:
            at: First byte of the chunk in the file.
            end: The byte behind it.
            raw: Its records.
            reason: The reason why there are no more of them; empty where there are.
            is_doubtful: They end at the first that is damaged: what a decoder gives behind damage may be made up.
        """
        places = Resync(lambda begin, size: raw[begin:begin + size], len(raw), self._channels.known)
        begin = kept = 0
        while begin < len(raw):
            parsed, damage = around_damage(raw, 0, begin, scan(raw, self._channels, begin), places, places.next)
            if damage is None and parsed.consumed < len(raw):
                damage = Damage(parsed.consumed, places.next(parsed.consumed + 1, len(raw)), "a record is damaged")
            self.learn(parsed.connections)
            kept += len(parsed.batch)
            yield Stretch(at, end, parsed.batch)
            begin = len(raw) if damage is None or is_doubtful else damage.end
            if damage is not None and not (reason and begin == len(raw)):
                self.lose(at, end, "bytes %d to %d of the unpacked chunk: %s" % damage)
        if reason:
            self.lose(at, end, "%s; %d messages of it were read" % (reason, kept))

    def contradictions(self, counts: Dict[int, int]) -> List[str]:
        """See ``LogRecovery``: the channels that the summary describes in another way than the data."""
        return ["%s: the summary describes channel %d with another topic or type than the data has" % (
            channel.topic, number)
                for number, channel in self._summary_channels.items()
                if not fmt.is_same_channel(channel, self._channels.known.get(number, channel))]

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """See ``LogRecovery``."""
        return fmt.read_attachment(self.descriptor, entry)

    def read_metadata(self, entry: MetadataIndex) -> Dict[str, str]:
        """See ``LogRecovery``."""
        return fmt.read_metadata(self.descriptor, entry)


class _Whole(McapRecovery):
    """The same walk over a file of which nothing may be lost."""

    def lose(self, begin: int, end: int, reason: str) -> None:
        if any(first <= begin and end <= last for first, last in self._indexes):
            self.notes.append("%d bytes at byte %d, a message index by the summary, are damaged and were skipped" % (
                end - begin, begin))
            return
        place = "" if " at byte " in reason else " at byte %d" % begin
        raise BagFormatError("%s%s (jaka_bag recover keeps the rest)" % (reason, place))

    def _check_data(self) -> None:
        """Note a wrong checksum of all data behind the walk.

        Raises:
            BagFormatError: It is wrong, and messages or channels have no other one that tells whether they are right.
        """
        if self._has_right_crc(self._data_end) is not False:
            return
        if self._has_unchecked or any(self.connections.get(number) != channel
                                      for number, channel in self._summary_channels.items()):
            raise BagFormatError("the data section's CRC is wrong (jaka_bag recover keeps the rest)")
        self.notes.append("the data section's CRC is wrong, and that of each chunk with messages is right")


def walk_index(path: PathLike, descriptor: int, end: Optional[int] = None) -> LogIndex:
    """Return the index of an MCAP without a usable summary, read up to byte ``end`` (None: to the last byte)."""
    size = os.fstat(descriptor).st_size if end is None else end
    walk = _Whole(descriptor, size)
    found = []
    totals: Counter[int] = Counter()
    for stretch in walk.stretches():
        if len(stretch.batch):
            found.append(chunk_of(stretch.begin, stretch.end, stretch.batch, stretch.is_loose))
            totals.update(found[-1].counts)
    again = [channel % (fmt.MAX_CHANNELS + 1) for channel in walk.connections if channel > fmt.MAX_CHANNELS]
    if again:
        raise BagFormatError(fmt.DEFINED_AGAIN % again[0] + " (jaka_bag recover keeps both)")
    numbers = {channel: number for number, channel in enumerate(walk.connections)}
    for channel in totals.keys() - numbers.keys():
        raise BagFormatError("messages of channel %d, which is not described" % channel)
    chunks = [chunk._replace(counts={numbers[channel]: count for channel, count in chunk.counts.items()})
              for chunk in found]
    return LogIndex("mcap", "0", str(path), size, list(walk.connections.values()), numbers, chunks,
                    [totals[channel] for channel in numbers],
                    min((c.start_time for c in chunks), default=None), max((c.end_time for c in chunks), default=None),
                    walk.profile, walk.library, tuple(walk.attachments), tuple(walk.metadata), notes=tuple(walk.notes))
