"""The recovery of a cut-off, unindexed or damaged .bag."""
import struct
from typing import Dict, Generator, Iterator, List, Optional, Set, Tuple

from ...errors import BagFormatError
from ...messages.batch import Array
from ...messages.connection import Connection
from ..index import ChunkHead, read_at
from ..interface import ParsedChunk
from ..recovery import LogRecovery, Stretch, soundness
from . import records as fmt
from .reader import index_entries, offsets_in, parse_chunk, scan

_U32 = struct.Struct("<I")
_MAX_HEADER = 1 << 20
"""Longest header, byte, that is believed; of a connection's it holds the whole definition of its type."""
_WINDOW = 4 << 20
"""Bytes read at a time: memory stays bounded, and a disk is read in long pieces."""
_CHUNK_MARK = b"\x04\x00\x00\x00op=" + bytes([fmt.OP_CHUNK])
_MESSAGE_MARK = b"\x04\x00\x00\x00op=" + bytes([fmt.OP_MESSAGE])
_LONGEST_CHUNK_HEADER = 64
"""Longest header, byte, of a chunk that is looked for: op, compression and size have 41 at most."""
_MESSAGE_HEAD = 46
"""Bytes of a message record before its payload, as every writer makes it."""


def _next_message(raw: bytes, begin: int) -> int:
    """Return the start of the next whole message record in a damaged chunk; the chunk's end where there is none."""
    mark = raw.find(_MESSAGE_MARK, begin)
    while mark >= 0:
        for start in range(max(mark - 38, begin), mark - 3):
            if _U32.unpack_from(raw, start)[0] == 38:
                record = fmt.try_record_at(raw, start)
                if record is not None and record.fields.keys() == {"conn", "op", "time"} and record.end <= len(raw):
                    return start
        mark = raw.find(_MESSAGE_MARK, mark + 1)
    return len(raw)


def _up_to_damage(raw: bytes, parsed: ParsedChunk) -> Tuple[ParsedChunk, int]:
    """Return the records of a chunk up to damage, without a last one that swallows others, and where to read on."""
    if parsed.consumed == len(raw):
        return parsed, len(raw)
    if len(parsed.batch):
        begin = int(parsed.batch.start[-1])
        inside = _next_message(raw, begin)
        if inside < parsed.consumed:
            return parsed._replace(batch=parsed.batch.take(slice(0, -1)), consumed=begin - _MESSAGE_HEAD), inside
    return parsed, _next_message(raw, parsed.consumed + 1)


class BagRecovery(LogRecovery):
    """The recovery of a .bag; see ``LogRecovery``."""

    def __init__(self, descriptor: int, size: int) -> None:
        super().__init__(descriptor, size)
        self._begin = len(fmt.MAGIC)
        self._promised_chunks = self._chunks = 0
        self._inside: Dict[int, Connection] = {}  # by chunks
        self._indexed: Dict[int, Connection] = {}
        self._differing: Set[int] = set()
        index_position = 0
        try:
            fields, self._begin = fmt.read_file_header(descriptor)
            index_position = fmt.u64(fields, "index_pos")
            self._promised_chunks = fmt.u32(fields, "chunk_count")
            claimed = min(self._begin, size)
            first = self._next_chunk(len(fmt.MAGIC), claimed)
            if first < claimed:
                self.lose(len(fmt.MAGIC), first, "the length of the first record is damaged")
                self._begin = first
        except BagFormatError as error:
            if "encrypted" in str(error):
                raise
            self.lose(len(fmt.MAGIC), min(size, len(fmt.MAGIC) + 8 + fmt.FILE_HEADER_SIZE), str(error))
        self._is_finished = 0 < index_position <= size
        if self._begin <= index_position < size:
            self._read_index(read_at(descriptor, index_position, size - index_position))

    def _read_index(self, raw: bytes) -> None:
        """Take from the index section what is whole: connections, and how many messages there should be."""
        expected = 0
        try:
            for record in fmt.whole_records(raw):
                if record.kind == fmt.OP_CONNECTION:
                    number, connection = fmt.parse_connection(record, raw)
                    self._indexed[number] = connection
                    self.learn({number: connection})
                elif record.kind == fmt.OP_CHUNK_INFO:
                    expected += sum(fmt.parse_chunk_info(record, raw).counts.values())
                else:
                    return
        except BagFormatError:
            return
        self.expected = expected

    def _stretches(self) -> Iterator[Stretch]:
        at = self._begin
        while at < self.size:
            raw = read_at(self.descriptor, at, 4096)
            record = fmt.try_record_at(raw)
            if record is None and len(raw) >= 4 and 4096 - 8 < _U32.unpack_from(raw)[0] <= _MAX_HEADER:
                raw = read_at(self.descriptor, at, _U32.unpack_from(raw)[0] + 8)
                record = fmt.try_record_at(raw)
            if record is None:
                at = self._behind_zeros(at) or self._skip_damage(
                    at, "no record" if self.size - at > 8 else "a record is cut off")
                continue
            end = at + record.end
            if record.kind == fmt.OP_CHUNK:
                end = yield from self._chunk(at, raw)
            elif end > self.size:
                end = self._skip_damage(at, "a record is cut off or damaged")
            elif record.kind == fmt.OP_CONNECTION:
                try:
                    self._learn_from_index(at, end, *fmt.parse_connection(
                        record, read_at(self.descriptor, at, record.end)))
                except BagFormatError as error:
                    self.lose(at, end, str(error))
            elif not fmt.OP_MESSAGE <= record.kind <= fmt.OP_CONNECTION:
                end = self._skip_damage(at, "a record of unknown kind %d" % record.kind)
            at = end
        if self._chunks < self._promised_chunks:
            self.lose(self.size, self.size, "the file's first record tells of %d chunks, %d were found"
                      % (self._promised_chunks, self._chunks))

    def _behind_zeros(self, at: int) -> int:
        """Return the position of the next record, or the file's end, if only zeros precede it, else 0."""
        begin = at
        while begin < self.size:
            raw = read_at(self.descriptor, begin, _WINDOW)
            rest = raw.lstrip(b"\0")
            if rest:
                begin += len(raw) - len(rest)
                is_record = begin > at and fmt.try_record_at(read_at(self.descriptor, begin, 4096)) is not None
                return begin if is_record else 0
            begin += len(raw)
        return self.size if self._is_finished else 0

    def _next_chunk(self, begin: int, stop: int) -> int:
        at = begin
        while at < stop:
            raw = read_at(self.descriptor, at, _WINDOW)
            mark = raw.find(_CHUNK_MARK)
            while mark >= 0:
                for start in range(max(mark - _LONGEST_CHUNK_HEADER, 0), mark - 3):
                    if _U32.unpack_from(raw, start)[0] <= _LONGEST_CHUNK_HEADER:
                        try:
                            fmt.parse_chunk_head(raw[start:start + 2 * _LONGEST_CHUNK_HEADER])
                            return at + start
                        except BagFormatError:
                            pass
                mark = raw.find(_CHUNK_MARK, mark + 1)
            if len(raw) < _WINDOW:
                break
            at += _WINDOW - 2 * _LONGEST_CHUNK_HEADER
        return stop

    def _stretch(self, begin: int, parsed: ParsedChunk, end: int) -> Stretch:
        self.learn(parsed.connections)
        for number, connection in parsed.connections.items():
            self._inside.setdefault(number, connection)
            self._compare(begin, end, number)
        return Stretch(begin, end, parsed.batch)

    def _learn_from_index(self, begin: int, end: int, number: int, connection: Connection) -> None:
        """Take up a connection record between bytes outside of chunks; what a chunk says of it counts if as sound."""
        self._indexed[number] = connection
        inside = self._inside.get(number)
        if inside is None or soundness(connection) > soundness(inside):
            self.learn({number: connection})
        self._compare(begin, end, number)

    def _compare(self, begin: int, end: int, number: int) -> None:
        """Note once where a chunk and the index describe a connection differently: one of them cannot be trusted."""
        if number in self._inside and number in self._indexed and number not in self._differing:
            inside = self._inside[number]
            differs = fmt.difference(number, inside, self._indexed[number])
            if differs:
                self._differing.add(number)
                kept = "the chunk" if self.connections.get(number) == inside else "the index"
                self.lose(begin, end, "%s: that of %s was taken" % (differs, kept))

    def _chunk(self, at: int, raw_head: bytes) -> Generator[Stretch, None, int]:
        """Yield a chunk's messages; return the start of the record after it."""
        try:
            head = fmt.parse_chunk_head(raw_head)
        except BagFormatError as error:
            return self._skip_damage(at, str(error))
        self._chunks += 1
        start = at + head.data_start
        if head.size == 0 and head.data_size == 0:
            return (yield from self._open_chunk(start, head.codec, "a chunk was being written"))
        if start + head.data_size > self.size:
            if self._next_chunk(start, self.size) < self.size:  # its length is damaged: others follow
                return self._skip_damage(at, "a chunk's length is damaged")
            return (yield from self._open_chunk(start, head.codec, "the last chunk is cut off"))
        data = read_at(self.descriptor, start, head.data_size)
        offset, end = self._index_behind(start + head.data_size)
        yield from self._read_chunk(head, data, offset, at, end)
        return end

    def _index_behind(self, begin: int) -> Tuple[Optional[Array], int]:
        """Return offsets of messages from the index records after a chunk (None: not usable), and their end."""
        entries: List[Tuple[int, Array]] = []
        is_usable = True
        at = begin
        while at < self.size:
            record = fmt.try_record_at(read_at(self.descriptor, at, 128))
            if record is None or record.kind != fmt.OP_INDEX:
                break
            try:
                entries += index_entries(read_at(self.descriptor, at, record.end), 0)
            except BagFormatError:
                is_usable = False
            ends = [at + end for end in (record.end, fmt.record_end(record)) if at + end <= self.size]
            if not ends:
                break
            at = next((end for end in ends if self._is_record_or_end(end)), ends[0])
        return offsets_in(entries) if entries and is_usable else None, at

    def _is_record_or_end(self, at: int) -> bool:
        return at == self.size or fmt.try_record_at(read_at(self.descriptor, at, 4096)) is not None

    def _read_chunk(self, head: ChunkHead, data: bytes, offset: Optional[Array], at: int, next_at: int
                    ) -> Iterator[Stretch]:
        """Yield all messages of a whole chunk, or those that are left of it."""
        end = at + head.data_start + head.data_size
        raw, reason = self._unpack(head.codec, data, head.size)
        if not reason:
            try:
                parsed = parse_chunk(raw, offset)
                self.misled += parsed.is_misled
                yield self._stretch(at, parsed, next_at)
                return
            except BagFormatError:
                pass
        yield from self._pieces(at, end, bytes(raw), next_at, reason and "%s; %d of %d bytes of it were read" % (
            reason, len(raw), head.size), head.codec != "none")

    def _pieces(self, at: int, end: int, raw: bytes, next_at: int, reason: str, is_packed: bool
                ) -> Iterator[Stretch]:
        """Yield the messages around the damage of an unpacked chunk, or of the decodable beginning of one.

        Args:
            at: First byte of the chunk in the file.
            end: The byte behind it.
            raw: Its records.
            next_at: First byte of the next chunk.
            reason: The reason why there are no more of them; empty where there are.
            is_packed: They were unpacked: what a decoder gives behind damage may be made up, and is left out.
        """
        begin = kept = 0
        while begin < len(raw):
            parsed, begin = _up_to_damage(raw, scan(raw, begin))
            begin = len(raw) if reason and is_packed else begin
            kept += len(parsed.batch)
            yield self._stretch(at, parsed, next_at)
            if begin > parsed.consumed and not (reason and begin == len(raw)):
                self.lose(at, end, "bytes %d to %d of the unpacked chunk: a record is damaged" % (
                    parsed.consumed, begin))
        if reason:
            self.lose(at, end, "%s; %d messages were kept" % (reason, kept))

    def _open_chunk(self, start: int, codec: str, reason: str) -> Generator[Stretch, None, int]:
        """Yield the messages of a chunk without a known end; return the start of the next, or the end of the file."""
        if codec not in ("none", ""):
            end = self._next_chunk(start, self.size)
            raw, limit = self._unpack(codec, read_at(self.descriptor, start, end - start))
            yield from self._pieces(start, end, bytes(raw), end, limit or reason, True)
            return end
        at = start
        while at < self.size:
            raw = read_at(self.descriptor, at, _WINDOW)
            next_record = fmt.try_record_at(raw)
            if next_record is not None and next_record.kind == fmt.OP_CHUNK:
                return at
            parsed = scan(raw, is_open=True)
            if not parsed.consumed and len(raw) == _WINDOW:  # one message may be larger than the window
                if next_record is not None and at + next_record.end <= self.size:
                    parsed = scan(read_at(self.descriptor, at, next_record.end))
            if parsed.consumed:
                again = len(raw)
                if not self._is_record_or_end(at + parsed.consumed):
                    parsed, again = _up_to_damage(raw, parsed)
                yield self._stretch(at, parsed, at + parsed.consumed)
                if again < len(raw):
                    self.lose(at + parsed.consumed, at + again, "a record is damaged")
                at += again if again < len(raw) else parsed.consumed
                continue
            again = _next_message(raw, 1)
            if again == len(raw):
                self.lose(at, self.size, "a record is cut off")
                break
            self.lose(at, at + again, "a record is damaged")
            at += again
        return self.size
