"""Reads a cut-off or damaged MCAP as far as that goes."""
import zlib
from typing import Dict, Iterator, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import Array
from ..compression import Buffer, decompress, decompress_partly
from ..index import MetadataIndex, read_at
from ..recovery import Salvager, Stretch
from . import records as fmt
from .chunk import Parsed, parse_chunk, scan
from .index import read_file_head, read_summary
from .reader import index_entries, parse_chunk_head
from .walk import LOOSE, attachment_index_of, chunk_region_end, read_loose, record_end

_WINDOW = 4 << 20
_CODEC_AT = 37
"""Where the length of the codec's name stands in a chunk record."""
_SMALLEST_CHUNK = 49


class McapSalvager(Salvager):
    """See ``Salvager``; the profile is ``ros1`` where the file's head is damaged."""

    def __init__(self, descriptor: int, size: int) -> None:
        super().__init__(descriptor, size)
        self._schemas: Dict[int, fmt.Schema] = {}
        self._begin = len(fmt.MAGIC)
        try:
            self.profile, _, self._begin = read_file_head(descriptor)
        except BagFormatError as error:
            self.lose(0, self._begin, str(error))
        try:
            summary = read_summary(descriptor, size)
            if summary is not None:
                self._schemas.update(summary.schemas)
                self.connections.update(summary.channels)
                self.expected = None if summary.statistics is None else summary.statistics.messages
        except BagFormatError:
            pass  # that there is none is why the file is recovered

    def _learn(self, parsed: Parsed) -> None:
        self._schemas.update(parsed.schemas)
        self.connections.update(parsed.connections)

    def stretches(self) -> Iterator[Stretch]:
        """All messages that can be read, in the order of the file."""
        at = self._begin
        while at < self.size:
            opcode = read_at(self.descriptor, at, 1)[0]
            if opcode in (fmt.DATA_END, fmt.FOOTER):
                break
            try:
                if opcode == fmt.CHUNK:
                    parsed, end = self._chunk(at)
                elif opcode in LOOSE:
                    parsed, end = self._loose(at)
                else:
                    at = self._other(at, opcode)
                    continue
            except BagFormatError as error:
                at = self._skip_damage(at, str(error).split(" (")[0])
                continue
            self._learn(parsed)
            yield Stretch(parsed.block, self.connections, end)
            at = end

    def _loose(self, at: int) -> Tuple[Parsed, int]:
        """Loose records from a position on, and where they end."""
        parsed = read_loose(self.descriptor, at, self.size, self._schemas)
        if not parsed.consumed:
            raise BagFormatError("a record is damaged")
        self._refuse_swallowing(at, at + parsed.consumed)
        return parsed, at + parsed.consumed

    def _refuse_swallowing(self, at: int, end: int) -> None:
        """Refuse records whose damaged length would swallow a chunk."""
        if self._next_chunk(at + 1, end) < end:
            raise BagFormatError("a record's length is damaged")

    def _other(self, at: int, opcode: int) -> int:
        """Take up a record that holds no message; give where it ends."""
        end = record_end(self.descriptor, at, self.size)
        if opcode == 0 or opcode > 0x0F and opcode < 0x80:
            raise BagFormatError("a record of unknown kind %d" % opcode)
        raw = read_at(self.descriptor, at, end - at) if opcode in (fmt.METADATA, fmt.ATTACHMENT) else b""
        if opcode != fmt.ATTACHMENT:
            self._refuse_swallowing(at, end)
        if opcode == fmt.METADATA:
            self.metadata.append(MetadataIndex(at, end - at, fmt.parse_metadata(raw)[0]))
        elif opcode == fmt.ATTACHMENT:
            if zlib.crc32(raw[fmt.RECORD_HEAD.size:-4]) != int.from_bytes(raw[-4:], "little") != 0:
                raise BagFormatError("an attachment's CRC is wrong")
            self.attachments.append(attachment_index_of(raw, at))
        return end

    def _skip_damage(self, at: int, reason: str) -> int:
        """Where the next chunk starts behind damage; the end of the file where there is none."""
        end = self._next_chunk(at + 1)
        self.lose(at, end, reason)
        return end

    def _next_chunk(self, begin: int, stop: Optional[int] = None) -> int:
        """Where the next chunk starts, at the latest at ``stop`` (None: the end of the file)."""
        at = begin
        stop = self.size if stop is None else stop
        while at < stop and at + _SMALLEST_CHUNK <= self.size:
            raw = read_at(self.descriptor, at, min(_WINDOW, stop - at + _SMALLEST_CHUNK + 32))
            data = np.frombuffer(raw, np.uint8)
            last = len(data) - _CODEC_AT - 3
            likely = (data[:last] == fmt.CHUNK) & (data[_CODEC_AT:last + _CODEC_AT] <= 4)
            for i in (1, 2, 3):
                likely &= data[_CODEC_AT + i:last + _CODEC_AT + i] == 0
            for start in np.flatnonzero(likely).tolist():
                try:
                    parse_chunk_head(raw[start:start + 128])
                    return min(at + int(start), stop)
                except BagFormatError:
                    pass
            if len(raw) < _WINDOW:
                break
            at += _WINDOW - 128
        return stop

    def _chunk(self, at: int) -> Tuple[Parsed, int]:
        """The messages of the chunk at a position, whole or what is left of it, and where the next record starts."""
        head = parse_chunk_head(read_at(self.descriptor, at, 256))
        end = at + head.data_start + head.data_size
        if end > self.size:
            if self._next_chunk(at + 1) < self.size:
                raise BagFormatError("a chunk's length is damaged")
            raw = decompress_partly(head.codec, read_at(self.descriptor, at + head.data_start, head.data_size))
            parsed = scan(raw, self._schemas)
            self.lose(at, self.size, "the last chunk is cut off; %d messages of it were read" % len(parsed.block))
            return parsed, self.size
        region_end = chunk_region_end(self.descriptor, at, self.size)
        region = read_at(self.descriptor, at, region_end - at)
        data = memoryview(region)[head.data_start:head.data_start + head.data_size]
        try:
            full: Buffer = decompress(head.codec, data, head.size)
        except BagFormatError as error:
            part = decompress_partly(head.codec, data)[:head.size]
            parsed = scan(part, self._schemas)
            self.lose(at, end, "%s; %d messages of it were read" % (error, len(parsed.block)))
            return parsed, region_end
        return self._records(at, end, full, head.crc, self._offset(region, end - at)), region_end

    @staticmethod
    def _offset(region: bytes, begin: int) -> Optional[Array]:
        """Offsets of messages from the message indexes behind a chunk; None where they are not usable."""
        try:
            entries = [entry[:, 1] for _, entry in index_entries(region, begin)]
        except BagFormatError:
            return None
        return np.sort(np.concatenate(entries).view(np.int64)) if entries else None

    def _records(self, at: int, end: int, raw: Buffer, crc: int, offset: Optional[Array]) -> Parsed:
        """The records of a chunk's uncompressed bytes, as far as they are whole."""
        is_right = not crc or zlib.crc32(raw) == crc
        try:
            parsed = parse_chunk(raw, offset, self._schemas)
        except BagFormatError as error:
            parsed = scan(raw, self._schemas)
            self.lose(at, end, "%s; %d messages before it were kept" % (error, len(parsed.block)))
            return parsed
        if not is_right:
            self.lose(at, end, "the chunk's CRC is wrong: some of its %d messages, which were kept, are not as recorded"
                      % len(parsed.block))
        return parsed
