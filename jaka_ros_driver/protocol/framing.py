"""Parsers that cut JSON objects out of the byte streams of the controller's ports, wherever TCP split or joined them.

Both streams return damage as values, in its place among the objects, so that nothing after it is lost.
How the bytes were split over ``feed`` calls changes neither the objects nor the number of errors.
Memory is bounded: bytes that cannot become an object are dropped.

Two other modules cut objects, because they promise something else. ``simulation/server/request_parser.py`` reports a
byte that cannot belong to an object as soon as it comes, where ``ObjectStream`` waits for the closing brace.
``wire/recorded_session.py`` has the whole stream at hand and must keep every byte of it, also those of damaged objects.
"""
import heapq
import json
import re
from collections import deque
from itertools import accumulate
from typing import Any, Callable, Deque, Dict, List, NamedTuple, NoReturn, Tuple, Union

from jaka_ros_driver.errors import FramingError

JsonObject = Dict[str, Any]
FramedItem = Union[JsonObject, FramingError]

MAX_OBJECT_BYTES = 1 << 20
"""Longest object, bytes, accepted from the command port; the longest known reply is a status frame of about 9 kB."""
MAX_FRAME_BYTES = 1 << 16
"""Longest status frame, bytes, accepted; the longest known is 8979 bytes (docs/controller-protocol.md section 3.3)."""
DEEPEST = 500
"""Most levels of an object. At the end of Python's stack, where the parser would be stopped, Python 3.8 may abort
(https://bugs.python.org/issue42500).
"""

_STRUCTURAL = re.compile(rb'["{}]')
_STRING_END = re.compile(rb'["\\]')
_NOT_BLANK = re.compile(rb"[^\s\x00]")
_FRAME_HEAD = re.compile(rb'\{\s*"len"\s*:\s*(\d{1,9})\s*[,}]')
_HEAD_BYTES = 64
"""Bytes at the end that may be the beginning of a frame's head: more than one has, blanks included."""
_CLOSING = ord("}")
_WHOLE_STRING = re.compile(rb'"[^"\\]*(?:\\.[^"\\]*)*"?', re.DOTALL)
_BRACKET = re.compile(rb"[][{}]")
_STEPS = {b"[": 1, b"{": 1, b"]": -1, b"}": -1}
_PARSED_IN_VAIN = 4
"""Bytes that may be parsed in vain for each byte that came: damage that looks like frames costs bounded time."""
MAX_DAMAGE_BYTES = 1 << 18
"""Longest run of damage, bytes, after which a feed is given up: 28 of the longest frames known."""


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError("%s is not JSON" % name)


STRICT_DECODER = json.JSONDecoder(parse_constant=_refuse_constant)
"""The decoder that refuses NaN and Infinity.

It is shared by all texts: making one takes as long as parsing a short reply.
"""


def parse_object(text: bytes) -> JsonObject:
    """Parse one JSON object; raise FramingError for anything else, also text that is not UTF-8, NaN, Infinity."""
    if text.count(b"{") + text.count(b"[") > DEEPEST and _depth(text) > DEEPEST:
        raise FramingError("an object deeper than %d levels" % DEEPEST)
    try:
        value = STRICT_DECODER.decode(text.decode("utf-8"))
    except ValueError as error:
        raise FramingError("not a JSON object: %s" % error) from error
    if not isinstance(value, dict):
        raise FramingError("not a JSON object but %s" % type(value).__name__)
    return value


def _depth(text: bytes) -> int:
    brackets = _BRACKET.findall(_WHOLE_STRING.sub(b"", text))
    return max(accumulate(map(_STEPS.__getitem__, brackets)), default=0)


def encode_object(value: JsonObject) -> bytes:
    """Return the object as the controller writes it, with ``", "`` and ``": "`` (docs/controller-protocol.md section
    3.2).

    Raises:
        FramingError: A number in it is not finite.
    """
    try:
        return json.dumps(value, allow_nan=False).encode("utf-8")
    except ValueError as error:
        raise FramingError("cannot be written as JSON: %s" % error) from error


class ObjectStream:
    """A parser of objects that follow each other without delimiter, as on the command port in both directions.

    White space and NUL between objects are skipped; each run of other bytes gives one FramingError.
    """

    def __init__(self, max_bytes: int = MAX_OBJECT_BYTES) -> None:
        self._max_bytes = max_bytes
        self._buffer = bytearray()
        self._scanned = 0
        self._depth = 0
        self._in_string = False
        self._in_garbage = False

    @property
    def pending(self) -> int:
        """The number of bytes of an object that has begun and not ended."""
        return len(self._buffer)

    def feed(self, data: bytes) -> List[FramedItem]:
        """Take the next bytes of the stream, and return the items that they complete, in order."""
        self._buffer += data
        items: List[FramedItem] = []
        while self._buffer:
            if self._depth == 0 and not self._find_start(items):
                break
            end = self._find_end()
            if end:
                text = bytes(self._buffer[:end])
                self._restart(end)
                try:
                    items.append(parse_object(text))
                except FramingError as error:
                    items.append(error)
            elif len(self._buffer) > self._max_bytes:
                items.append(FramingError("an object of more than %d bytes" % self._max_bytes))
                self._restart(len(self._buffer))
            else:
                break
        return items

    def _restart(self, consumed: int) -> None:
        del self._buffer[:consumed]
        self._scanned = self._depth = 0
        self._in_string = False

    def _find_start(self, items: List[FramedItem]) -> bool:
        start = self._buffer.find(b"{")
        garbage = bytes(self._buffer if start < 0 else self._buffer[:start])
        if _NOT_BLANK.search(garbage) and not self._in_garbage:
            items.append(FramingError("bytes outside any object: %r" % garbage.lstrip()[:40]))
            self._in_garbage = True
        del self._buffer[:len(garbage)]
        if start >= 0:
            self._in_garbage = False
        return start >= 0

    def _find_end(self) -> int:
        """Return the length of the object at the start of the buffer, 0 while it is not complete. No byte is scanned
        twice.
        """
        position = self._scanned
        while True:
            pattern = _STRING_END if self._in_string else _STRUCTURAL
            match = pattern.search(self._buffer, position)
            if match is None:
                self._scanned = max(position, len(self._buffer))
                return 0
            position = match.end()
            token = match.group()
            if token == b'"':
                self._in_string = not self._in_string
            elif token == b"\\":
                if position >= len(self._buffer):
                    self._scanned = match.start()
                    return 0
                position += 1
            elif token == b"{":
                self._depth += 1
            else:
                self._depth -= 1
                if self._depth == 0:
                    return position


class _Head(NamedTuple):
    """Offsets of a possible frame: its start, its end, and the end of its ``len``; counted from the begin of the
    stream.
    """

    start: int
    end: int
    text: int


class FrameStream:
    """A parser of status frames that follow each other, each of which begins with ``len``, its exact size in bytes.

    The format is that of docs/controller-protocol.md section 3.3. ``len`` also serves as a check: a frame whose text
    has another length, or is not JSON, is damaged. Reading continues at the next whole frame; each run of damaged bytes
    gives one FramingError.

    The work for damage is bounded: each byte is searched once, a head is looked at once when its frame could be whole,
    and what is parsed in vain is a few times what has come. A stream that is nothing but damage is not read any more.

    Attributes:
        is_flooded: ``MAX_DAMAGE_BYTES`` have come since the last frame; nothing is read any more.
    """

    def __init__(self, max_bytes: int = MAX_FRAME_BYTES,
                 parse: Callable[[bytes], JsonObject] = parse_object) -> None:
        """Begin a stream.

        Args:
            max_bytes: Of the longest frame that is accepted.
            parse: Parses a frame as ``parse_object`` does.
        """
        self._max_bytes = max_bytes
        self._parse = parse
        self._buffer = bytearray()
        self._begin = 0  # of the buffer, counted from the begin of the stream
        self._searched = 0
        self._heads: Deque[_Head] = deque()
        self._by_end: List[Tuple[int, int]] = []  # end and start of the heads that were not looked at
        self._whole: Dict[int, JsonObject] = {}  # by start: frames that were found whole behind one that is not
        self._in_damage = False
        self._damage = 0
        self._credit = _PARSED_IN_VAIN * max_bytes
        self.is_flooded = False

    def feed(self, data: bytes) -> List[FramedItem]:
        """Take the next bytes of the stream, and return the items that they complete, in order."""
        items: List[FramedItem] = []
        if not self._buffer and self._is_one_frame(data, items):
            return items
        for start in range(0, len(data), self._max_bytes):
            if self.is_flooded:
                break
            piece = data[start:start + self._max_bytes] if len(data) > self._max_bytes else data
            self._buffer += piece
            self._credit = min(self._credit + _PARSED_IN_VAIN * len(piece), _PARSED_IN_VAIN * self._max_bytes)
            self._find_heads()
            while self._take(items):
                pass
            self.is_flooded = self._damage > MAX_DAMAGE_BYTES
        if self.is_flooded:
            self._skip(len(self._buffer), "nothing but damage", items)
        return items

    def _is_one_frame(self, data: bytes, items: List[FramedItem]) -> bool:
        """Take a piece that is one whole frame, as nearly all are, at once; return False where it is anything else."""
        head = _FRAME_HEAD.match(data)
        if head is None or not int(head.group(1)) == len(data) <= self._max_bytes or self.is_flooded:
            return False
        try:
            items.append(self._parse(data))
        except FramingError:
            return False
        self._in_damage, self._damage = False, 0
        return True

    def _find_heads(self) -> None:
        begin = self._begin
        last = self._searched - begin
        for match in _FRAME_HEAD.finditer(self._buffer, last):
            start, length, last = begin + match.start(), int(match.group(1)), match.end()
            head = _Head(start, start + length, begin + last)
            self._heads.append(head)
            if head.text <= head.end <= start + self._max_bytes:
                heapq.heappush(self._by_end, (head.end, start))
        self._searched = begin + max(last, len(self._buffer) - _HEAD_BYTES)

    def _take(self, items: List[FramedItem]) -> bool:
        """Consume some of the buffer; return False when more bytes are needed."""
        if not self._heads:
            self._skip(max(0, len(self._buffer) - _HEAD_BYTES), "bytes outside any status frame", items)
            return False
        head = self._heads[0]
        self._skip(head.start - self._begin, "bytes outside any status frame", items)
        length = head.end - head.start
        if not head.text - head.start <= length <= self._max_bytes:
            self._leave(head, "a status frame cannot have len %d", length, items)
            return True
        self._look_at_whole_frames()
        if head.end <= self._begin + len(self._buffer):
            frame = self._whole.get(head.start)
            if frame is None:
                self._leave(head, "a status frame of len %d is damaged", length, items)
            else:
                items.append(frame)
                self._drop(length)
                self._in_damage, self._damage = False, 0
            return True
        following = min(self._whole, default=None)
        if following is None:
            return False
        count = following - self._begin
        self._skip(count, "status frame cut off after %d bytes" % count, items)
        return True

    def _look_at_whole_frames(self) -> None:
        """Parse each possible frame whose last byte has come, once."""
        available = self._begin + len(self._buffer)
        while self._by_end and self._by_end[0][0] <= available:
            end, start = heapq.heappop(self._by_end)
            place = start - self._begin
            if place < 0 or self._buffer[end - self._begin - 1] != _CLOSING or self._credit < end - start:
                continue
            try:
                self._whole[start] = parse_object(bytes(self._buffer[place:end - self._begin]))
            except FramingError:
                self._credit -= end - start

    def _leave(self, head: _Head, why: str, length: int, items: List[FramedItem]) -> None:
        self._skip(head.text - head.start, why % length, items)

    def _drop(self, count: int) -> None:
        if not count:
            return
        del self._buffer[:count]
        self._begin += count
        while self._heads and self._heads[0].start < self._begin:
            self._whole.pop(self._heads.popleft().start, None)

    def _skip(self, count: int, why: str, items: List[FramedItem]) -> None:
        if not self._in_damage and _NOT_BLANK.search(self._buffer, 0, count):
            self._in_damage = True
            items.append(FramingError("%s: %r" % (why, bytes(self._buffer[:count]).lstrip()[:40])))
        self._damage += count
        self._drop(count)
