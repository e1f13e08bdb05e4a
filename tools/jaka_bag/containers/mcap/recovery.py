"""The walk over an MCAP's records: recovery of a damaged one, and the index of a whole one without a summary.

Functions that read raise ``BagFormatError`` where the bytes are damaged or cut off.
"""
import os
import zlib
from typing import Counter, Dict, Iterator, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...paths import PathLike
from ..compression import decompress
from ..contract import ParsedChunk, chunk_of
from ..index import AttachmentIndex, Buffer, LogIndex, MetadataIndex, read_at
from ..recovery import LogRecovery, Stretch
from . import records as fmt
from .reader import Channels, index_entries, offsets_in, parse_chunk, scan

_LOOSE = (fmt.SCHEMA, fmt.CHANNEL, fmt.MESSAGE)
_LOOSE_WINDOW = 1 << 20
_WINDOW = 4 << 20
_FIRST_PRIVATE = 0x80
"""The first kind of record that programs may give a meaning of their own."""
_CODEC_AT = 37
"""Position of the length of the codec's name in a chunk record."""
_SMALLEST_CHUNK = 49


class McapRecovery(LogRecovery):
    """The recovery of an MCAP; see ``LogRecovery``. The profile is ``ros1`` where the file's head is damaged."""

    def __init__(self, descriptor: int, size: int) -> None:
        super().__init__(descriptor, fmt.end_of_records(descriptor, size))
        self.notes += fmt.zeros_behind(self.size, size)
        self._channels = Channels()
        self._begin = len(fmt.MAGIC)
        self.library = ""
        try:
            self.profile, self.library, self._begin = fmt.read_file_head(descriptor)
        except BagFormatError as error:
            self.lose(0, self._begin, str(error))
        try:
            summary = fmt.read_summary(descriptor, self.size)
            if summary is not None:
                self._channels.schemas.update(summary.schemas)
                self.learn(summary.channels)
                self.expected = None if summary.statistics is None else summary.statistics.messages
        except BagFormatError:
            pass  # that there is none is why the file is recovered

    def stretches(self) -> Iterator[Stretch]:
        """Yield all readable messages, in the order of the file."""
        at = self._begin
        while at < self.size:
            opcode = read_at(self.descriptor, at, 1)[0]
            if opcode in (fmt.DATA_END, fmt.FOOTER):
                break
            try:
                if opcode == fmt.CHUNK:
                    parsed, end = self._chunk(at)
                elif opcode in _LOOSE:
                    parsed, end = self._loose(at)
                else:
                    at = self._other(at, opcode)
                    continue
            except BagFormatError as error:
                at = self._skip_damage(at, str(error).split(" (")[0])
                continue
            self.learn(parsed.connections)
            yield Stretch(at, end, parsed.batch, opcode != fmt.CHUNK)
            at = end

    def _loose(self, at: int) -> Tuple[ParsedChunk, int]:
        """Return loose records from a position on, and their end."""
        length = max(_LOOSE_WINDOW, self._record_end(at) - at)
        parsed = scan(read_at(self.descriptor, at, length), self._channels, is_loose=True)
        if not parsed.consumed:
            raise BagFormatError("a record is damaged")
        self._refuse_swallowing(at, at + parsed.consumed)
        return parsed, at + parsed.consumed

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
        while read_at(self.descriptor, end, 1) == bytes([fmt.MESSAGE_INDEX]):
            try:
                end = self._record_end(end)
            except BagFormatError:
                break
        return end

    def _refuse_swallowing(self, at: int, end: int) -> None:
        """Refuse records whose damaged length would swallow a chunk."""
        if self._next_chunk(at + 1, end) < end:
            raise BagFormatError("a record's length is damaged")

    def _other(self, at: int, opcode: int) -> int:
        """Read a record that holds no message; return its end."""
        end = self._record_end(at)
        if opcode == 0:
            raise BagFormatError("a record of unknown kind 0")
        if fmt.DATA_END < opcode < _FIRST_PRIVATE:
            self.notes.append("a record of the unknown kind %d at byte %d was skipped" % (opcode, at))
        if opcode != fmt.ATTACHMENT:
            self._refuse_swallowing(at, end)
        if opcode in (fmt.METADATA, fmt.ATTACHMENT):
            raw = read_at(self.descriptor, at, end - at)
            if opcode == fmt.METADATA:
                self.metadata.append(fmt.parse_metadata(raw, at))
                return end
            entry = fmt.parse_attachment(raw, at)
            fmt.read_attachment(self.descriptor, entry)
            self.attachments.append(entry)
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

    def _chunk(self, at: int) -> Tuple[ParsedChunk, int]:
        """Return the messages of the chunk at a position, or those left of it, and the start of the next record."""
        head = fmt.parse_chunk_head(read_at(self.descriptor, at, 256))
        end = at + head.end
        if end > self.size:
            if self._next_chunk(at + 1, self.size) < self.size:
                raise BagFormatError("a chunk's length is damaged")
            data = read_at(self.descriptor, at + head.data_start, head.data_size)
            raw = self._partly(head.codec, data, at, head.size)
            parsed = scan(raw, self._channels)
            self.lose(at, self.size, "the last chunk is cut off; %d messages of it were read" % len(parsed.batch))
            return parsed, self.size
        region_end = self._region_end(at)
        region = read_at(self.descriptor, at, region_end - at)
        data = memoryview(region)[head.data_start:head.data_start + head.data_size]
        try:
            self.allowance.take(at, head.size)
            full: Buffer = decompress(head.codec, data, head.size)
        except BagFormatError as error:
            part = self._partly(head.codec, data, at, head.size)
            parsed = scan(part, self._channels)
            self.lose(at, end, "%s; %d messages of it were read" % (error, len(parsed.batch)))
            return parsed, region_end
        try:
            offset = offsets_in(index_entries(region, end - at))
        except BagFormatError:  # the message indexes behind the chunk are not usable
            offset = None
        try:
            parsed = parse_chunk(full, offset, self._channels)
            self.misled += parsed.is_misled
        except BagFormatError as error:
            parsed = scan(full, self._channels)
            self.lose(at, end, "%s; %d messages before it were kept" % (error, len(parsed.batch)))
            return parsed, region_end
        if head.crc and zlib.crc32(full) != head.crc:
            self.lose(at, end, "the chunk's CRC is wrong: some of its %d messages, which were kept, are not as recorded"
                      % len(parsed.batch))
        return parsed, region_end

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """See ``LogRecovery``."""
        return fmt.read_attachment(self.descriptor, entry)

    def read_metadata(self, entry: MetadataIndex) -> Dict[str, str]:
        """See ``LogRecovery``."""
        return fmt.read_metadata(self.descriptor, entry)


class _Whole(McapRecovery):
    """The same walk over a file of which nothing may be lost."""

    def lose(self, begin: int, end: int, reason: str) -> None:
        place = "" if " at byte " in reason else " at byte %d" % begin
        raise BagFormatError("%s%s (jaka_bag recover keeps the rest)" % (reason, place))


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
