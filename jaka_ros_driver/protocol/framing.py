"""Cuts JSON objects out of the byte streams of the controller's ports, wherever TCP split or glued them.

Both streams return damage as values, in its place among the objects, so that nothing after it is lost.
How the bytes were split over ``feed`` calls changes neither the objects nor the number of errors.
Memory is bounded: bytes that cannot become an object are dropped.

Two other places cut objects, because they promise something else. ``simulation/server/request_parser.py`` reports a
byte that cannot belong to an object as soon as it comes, where ``ObjectStream`` waits for the closing brace.
``wire/script.py`` has the whole stream at hand and must keep every byte of it, those of damaged objects included.
"""
import json
import re
from typing import Any, Dict, List, NoReturn, Union

from jaka_ros_driver.errors import FramingError

JsonObject = Dict[str, Any]
Item = Union[JsonObject, FramingError]

MAX_OBJECT_BYTES = 1 << 20
"""Longest object accepted from the command port; the longest known reply is a status frame of about 9 kB."""
MAX_FRAME_BYTES = 1 << 16
"""Longest status frame accepted; the longest known is 8979 bytes (docs/controller-protocol.md section 3.3)."""

_STRUCTURAL = re.compile(rb'["{}]')
_STRING_END = re.compile(rb'["\\]')
_NOT_BLANK = re.compile(rb"[^\s\x00]")
_FRAME_HEAD = re.compile(rb'\{\s*"len"\s*:\s*(\d{1,9})\s*[,}]')
_HEAD_BYTES = 64


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError("%s is not JSON" % name)


STRICT_DECODER = json.JSONDecoder(parse_constant=_refuse_constant)
"""Refuses NaN and Infinity. One object for all texts: to make one takes as long as to parse a short reply."""


def parse_object(text: bytes) -> JsonObject:
    """Parse one JSON object; raises FramingError for all else, also for text that is not UTF-8, NaN and Infinity."""
    try:
        value = STRICT_DECODER.decode(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise FramingError("not a JSON object: %s" % error) from error
    if not isinstance(value, dict):
        raise FramingError("not a JSON object but %s" % type(value).__name__)
    return value


def encode_object(value: JsonObject) -> bytes:
    """The object as the controller writes it, with ``", "`` and ``": "`` (docs/controller-protocol.md section 3.2).

    Raises FramingError where a number in it is not finite.
    """
    try:
        return json.dumps(value, allow_nan=False).encode("utf-8")
    except ValueError as error:
        raise FramingError("cannot be written as JSON: %s" % error) from error


class ObjectStream:
    """Cuts objects that follow each other without delimiter, as on the command port in both directions.

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
        """Bytes of an object that has begun and not ended."""
        return len(self._buffer)

    def feed(self, data: bytes) -> List[Item]:
        """Take the next bytes of the stream, and return what they complete, in order."""
        self._buffer += data
        items: List[Item] = []
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

    def _find_start(self, items: List[Item]) -> bool:
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
        """Length of the object at the start of the buffer, 0 while it is not complete. No byte is scanned twice."""
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


class FrameStream:
    """Cuts status frames that follow each other, each of which begins with ``len``, its exact size in bytes
    (docs/controller-protocol.md section 3.3).

    ``len`` also serves as a check: a frame whose text has another length, or is not JSON, is damaged. Reading continues
    at the next whole frame; each run of damaged bytes gives one FramingError.
    """

    def __init__(self, max_bytes: int = MAX_FRAME_BYTES) -> None:
        self._max_bytes = max_bytes
        self._buffer = bytearray()
        self._in_damage = False
        self._unsearched = 0

    def feed(self, data: bytes) -> List[Item]:
        """Take the next bytes of the stream, and return what they complete, in order."""
        self._buffer += data
        items: List[Item] = []
        while self._take(items):
            pass
        return items

    def _take(self, items: List[Item]) -> bool:
        """Consume some of the buffer; False when more bytes are needed."""
        head = _FRAME_HEAD.search(self._buffer)
        if head is None:
            self._skip(max(0, len(self._buffer) - _HEAD_BYTES), "bytes outside any status frame", items)
            return False
        start, length, head_end = head.start(), int(head.group(1)), head.end() - head.start()
        self._skip(start, "bytes outside any status frame", items)
        if not head_end <= length <= self._max_bytes:
            self._skip(head_end, "a status frame cannot have len %d" % length, items)
            return True
        if len(self._buffer) >= length:
            try:
                items.append(parse_object(bytes(self._buffer[:length])))
            except FramingError as error:
                self._skip(head_end, "status frame of len %d: %s" % (length, error), items)
            else:
                self._drop(length)
                self._in_damage = False
            return True
        following = self._whole_frame_after(head_end)
        self._skip(following, "status frame cut off after %d bytes" % following, items)
        return following > 0

    def _whole_frame_after(self, position: int) -> int:
        """Where a whole frame begins after this position, which means that the frame before it is cut off; 0 for
        nowhere.

        Bytes that were searched are not searched again, except heads whose frames were not complete.
        """
        unfinished = len(self._buffer)
        for head in _FRAME_HEAD.finditer(self._buffer, max(position, self._unsearched)):
            end = head.start() + int(head.group(1))
            if end > len(self._buffer):
                unfinished = min(unfinished, head.start())
                continue
            try:
                parse_object(bytes(self._buffer[head.start():end]))
            except FramingError:
                continue
            return head.start()
        self._unsearched = max(self._unsearched, min(unfinished, len(self._buffer) - _HEAD_BYTES))
        return 0

    def _drop(self, count: int) -> None:
        del self._buffer[:count]
        if count:
            self._unsearched = 0

    def _skip(self, count: int, why: str, items: List[Item]) -> None:
        skipped = bytes(self._buffer[:count])
        self._drop(count)
        if not self._in_damage and _NOT_BLANK.search(skipped):
            self._in_damage = True
            items.append(FramingError("%s: %r" % (why, skipped.lstrip()[:40])))
