"""Reads a cut-off, unindexed or damaged .bag as far as that goes."""
import struct
from typing import Generator, Iterator, List, Optional, Tuple

import numpy as np

from ...errors import BagFormatError
from ...messages.batch import Array, Block, concatenate
from ..compression import Buffer, decompress, decompress_partly
from ..index import read_at
from ..recovery import Salvager, Stretch
from . import records as fmt
from .chunk import Parsed, parse_chunk, scan
from .index import ChunkHead, parse_chunk_head, read_file_header
from .reader import index_entries

_U32 = struct.Struct("<I")
_MAX_HEADER = 1 << 20
_WINDOW = 4 << 20
_CHUNK_MARK = b"\x04\x00\x00\x00op=" + bytes([fmt.OP_CHUNK])
_MESSAGE_MARK = b"\x04\x00\x00\x00op=" + bytes([fmt.OP_MESSAGE])
_LONGEST_CHUNK_HEADER = 64


def _record_at(raw: bytes, at: int) -> Optional[Tuple[fmt.Header, int, int]]:
    """Fields, start and size of the data of the record at a position; None where there is none."""
    if at + 8 > len(raw):
        return None
    header_end = at + 4 + _U32.unpack_from(raw, at)[0]
    if header_end + 4 > len(raw):
        return None
    try:
        fields = fmt.parse_header(raw[at + 4:header_end])
        fmt.opcode(fields)
    except BagFormatError:
        return None
    return fields, header_end + 4, int(_U32.unpack_from(raw, header_end)[0])


def _next_message(raw: bytes, begin: int) -> int:
    """Where the next whole message record of a damaged chunk starts; its end where there is none."""
    mark = raw.find(_MESSAGE_MARK, begin)
    while mark >= 0:
        for start in range(max(mark - 38, begin), mark - 3):
            if _U32.unpack_from(raw, start)[0] == 38:
                record = _record_at(raw, start)
                if record is not None and record[0].keys() == {"conn", "op", "time"} \
                        and record[1] + record[2] <= len(raw):
                    return start
        mark = raw.find(_MESSAGE_MARK, mark + 1)
    return len(raw)


class BagSalvager(Salvager):
    """See ``Salvager``."""

    def __init__(self, descriptor: int, size: int) -> None:
        super().__init__(descriptor, size)
        self._begin = len(fmt.MAGIC)
        index_position = 0
        try:
            fields, self._begin = read_file_header(descriptor)
            index_position = fmt.u64(fields, "index_pos")
        except BagFormatError as error:
            if "encrypted" in str(error):
                raise
            self.lose(len(fmt.MAGIC), min(size, len(fmt.MAGIC) + 8 + fmt.FILE_HEADER_SIZE), str(error))
        if self._begin <= index_position < size:
            self._read_index(read_at(descriptor, index_position, size - index_position))

    def _read_index(self, raw: bytes) -> None:
        """Take from the index section what is whole: connections, and how many messages there should be."""
        at = 0
        expected = 0
        while at < len(raw):
            record = _record_at(raw, at)
            if record is None or record[1] + record[2] > len(raw):
                return
            fields, start, size = record
            try:
                kind = fmt.opcode(fields)
                if kind == fmt.OP_CONNECTION:
                    number, connection = fmt.parse_connection(fields, raw[start:start + size])
                    self.connections[number] = connection
                elif kind == fmt.OP_CHUNK_INFO:
                    expected += sum(fmt.parse_chunk_info(fields, raw[start:start + size]).counts.values())
                else:
                    return
            except BagFormatError:
                return
            at = start + size
        self.expected = expected

    def stretches(self) -> Iterator[Stretch]:
        """All messages that can be read, in the order of the file."""
        at = self._begin
        while at < self.size:
            raw = read_at(self.descriptor, at, 4096)
            record = _record_at(raw, at=0)
            if record is None and len(raw) >= 4 and 4096 - 8 < _U32.unpack_from(raw)[0] <= _MAX_HEADER:
                raw = read_at(self.descriptor, at, _U32.unpack_from(raw)[0] + 8)
                record = _record_at(raw, 0)
            if record is None:
                at = self._skip_damage(at, "no record" if self.size - at > 8 else "a record is cut off")
                continue
            fields, start, size = record
            kind = fmt.opcode(fields)
            if kind == fmt.OP_CHUNK:
                end = yield from self._chunk(at, raw)
            elif at + start + size > self.size:
                end = self._skip_damage(at, "a record is cut off or damaged")
            else:
                end = at + start + size
                if kind == fmt.OP_CONNECTION:
                    self._declare(fields, read_at(self.descriptor, at + start, size), at, end)
                elif not fmt.OP_MESSAGE <= kind <= fmt.OP_CONNECTION:
                    end = self._skip_damage(at, "a record of unknown kind %d" % kind)
            at = end

    def _declare(self, fields: fmt.Header, data: bytes, begin: int, end: int) -> None:
        try:
            number, connection = fmt.parse_connection(fields, data)
            self.connections[number] = connection
        except BagFormatError as error:
            self.lose(begin, end, str(error))

    def _skip_damage(self, at: int, reason: str) -> int:
        """Where the next chunk starts behind damage; the end of the file where there is none."""
        end = self._next_chunk(at + 1)
        self.lose(at, end, reason)
        return end

    def _next_chunk(self, begin: int) -> int:
        at = begin
        while at < self.size:
            raw = read_at(self.descriptor, at, _WINDOW)
            mark = raw.find(_CHUNK_MARK)
            while mark >= 0:
                for start in range(max(mark - _LONGEST_CHUNK_HEADER, 0), mark - 3):
                    if _U32.unpack_from(raw, start)[0] <= _LONGEST_CHUNK_HEADER:
                        try:
                            parse_chunk_head(raw[start:start + 2 * _LONGEST_CHUNK_HEADER])
                            return at + start
                        except BagFormatError:
                            pass
                mark = raw.find(_CHUNK_MARK, mark + 1)
            if len(raw) < _WINDOW:
                break
            at += _WINDOW - 2 * _LONGEST_CHUNK_HEADER
        return self.size

    def _stretch(self, parsed: Parsed, end: int) -> Stretch:
        self.connections.update(parsed.connections)
        return Stretch(parsed.block, self.connections, end)

    def _chunk(self, at: int, raw_head: bytes) -> Generator[Stretch, None, int]:
        """Yield a chunk's messages; return where the record behind it starts."""
        try:
            head = parse_chunk_head(raw_head)
        except BagFormatError as error:
            return self._skip_damage(at, str(error))
        start = at + head.data_start
        if head.size == 0 and head.data_size == 0:
            return (yield from self._open_chunk(start, head.codec, "the last chunk was being written"))
        if start + head.data_size > self.size:
            if self._next_chunk(start) < self.size:  # its length is damaged: others follow
                return self._skip_damage(at, "a chunk's length is damaged")
            return (yield from self._open_chunk(start, head.codec, "the last chunk is cut off"))
        data = read_at(self.descriptor, start, head.data_size)
        offset, end = self._index_behind(start + head.data_size)
        yield self._stretch(self._salvage(head, data, offset, at), end)
        return end

    def _index_behind(self, begin: int) -> Tuple[Optional[Array], int]:
        """Offsets of messages from the index records behind a chunk (None: not usable), and where they end."""
        parts: List[Array] = []
        at = begin
        while at < self.size:
            head = read_at(self.descriptor, at, 128)
            record = _record_at(head, 0)
            if record is None or fmt.opcode(record[0]) != fmt.OP_INDEX or at + record[1] + record[2] > self.size:
                break
            end = at + record[1] + record[2]
            try:
                parts += [entry["offset"] for _, entry in index_entries(read_at(self.descriptor, at, end - at), 0)]
            except BagFormatError:
                return None, end
            at = end
        return (np.sort(np.concatenate(parts).astype(np.int64)) if parts else None), at

    def _salvage(self, head: ChunkHead, data: bytes, offset: Optional[Array], at: int) -> Parsed:
        """All messages of a whole chunk, or of what is left of it."""
        end = at + head.data_start + head.data_size
        try:
            raw: Buffer = decompress(head.codec, data, head.size)
        except BagFormatError as error:
            raw = decompress_partly(head.codec, data)[:head.size]
            self.lose(at, end, "%s; %d of %d bytes of it were read" % (error, len(raw), head.size))
            return scan(raw)
        try:
            return parse_chunk(raw, offset)
        except BagFormatError as error:
            parsed, skipped = _around_damage(bytes(raw))
            self.lose(at, end, "%s; %d bytes were skipped, %d messages kept" % (error, skipped, len(parsed.block)))
            return parsed

    def _open_chunk(self, start: int, codec: str, reason: str) -> Generator[Stretch, None, int]:
        """Yield the messages of a chunk without a known end; return the end of the file."""
        if codec not in ("none", ""):
            raw = decompress_partly(codec, read_at(self.descriptor, start, self.size - start))
            parsed = scan(raw)
            self.lose(start, self.size, "%s; %d messages of it were read" % (reason, len(parsed.block)))
            yield self._stretch(parsed, self.size)
            return self.size
        at = start
        while at < self.size:
            raw = read_at(self.descriptor, at, _WINDOW)
            parsed = scan(raw)
            if not parsed.consumed and len(raw) == _WINDOW:  # one message may be larger than the window
                needed = _record_at(raw, 0)
                if needed is not None and at + needed[1] + needed[2] <= self.size:
                    parsed = scan(read_at(self.descriptor, at, needed[1] + needed[2]))
            if not parsed.consumed:
                break
            yield self._stretch(parsed, at + parsed.consumed)
            at += parsed.consumed
        if at < self.size:
            rest = read_at(self.descriptor, at, _WINDOW)
            again = _next_message(rest, 1)
            if again < len(rest):
                self.lose(at, at + again, "a record is damaged")
                return (yield from self._open_chunk(at + again, codec, reason))
            self.lose(at, self.size, "a record is cut off")
        return self.size


def _around_damage(raw: bytes) -> Tuple[Parsed, int]:
    """The whole records of a damaged chunk, and how many bytes were skipped."""
    parts: List[Block] = []
    connections = {}
    at = skipped = 0
    while at < len(raw):
        parsed = scan(raw, at)
        parts.append(parsed.block)
        connections.update(parsed.connections)
        again = _next_message(raw, parsed.consumed + 1) if parsed.consumed < len(raw) else len(raw)
        skipped += again - parsed.consumed
        at = again
    return Parsed(concatenate(parts), connections, len(raw)), skipped
