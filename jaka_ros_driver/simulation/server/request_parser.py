"""The parser of the command port's byte stream, which reports bytes that cannot become a request as soon as they come.

The maker's SDK sends bare ``nan`` for a bad argument and then waits 25 s for an answer (docs/sdk-client.md section 1,
point 6). So this parser follows JSON's grammar byte by byte: the first byte that cannot belong to a JSON object is an
error at once, while the rest of an object that may still come is waited for. After an error, bytes are skipped up to
the end of that document, so that one bad document gives one error. A ``{`` that cannot belong to the bad document
begins the next request, also within a string that was never closed. How the bytes were split over calls does not change
the outcome. The parser has no clock.

``protocol.framing.ObjectStream`` cannot be used here: it reports an error only when the object's last brace has come.
"""
import re
from typing import List, Optional, Tuple

from jaka_ros_driver.errors import FramingError
from jaka_ros_driver.protocol.framing import STRICT_DECODER, FramedItem, JsonObject, parse_object

MAX_REQUEST_BYTES = 1 << 16
"""Longest request accepted, bytes; the longest one known is below 400 bytes (docs/sdk-client.md section 8)."""
MAX_DEPTH = 32
"""Deepest nesting accepted; the deepest known request has two levels (docs/sdk-client.md section 8)."""
INCOMPLETE_REQUEST_LIMIT_S = 5.0
"""Time, s, for which the rest of a request is waited for after its last byte; then it is an error."""
_LONGEST_PLAIN = 512
"""Longest request that the decoder sees, bytes; too short for brackets that reach the end of Python's stack."""
SKIP_LIMIT_S = 0.1
"""Time, s, without a byte after which the rest of a bad document is no longer waited for."""

_BLANK = frozenset(b" \t\r\n")
_OPENERS, _CLOSERS = frozenset(b"{["), frozenset(b"}]")
_BEFORE_NESTED = frozenset(b":[,")
_AFTER_STRING = frozenset(b",:]} \t\r\n")
_MATTERS = re.compile(rb'["\\{}\[\]\n]')
_MATTERS_IN_STRING = re.compile(rb'["\\\x00-\x1f]')
_QUOTE, _BACKSLASH, _COMMA, _COLON = b'"\\,:'
_BRACE_OPEN, _BRACE_CLOSE, _BRACKET_OPEN, _BRACKET_CLOSE = b"{}[]"

# What may come next.
_FIRST_KEY, _KEY, _AFTER_KEY, _VALUE, _FIRST_ITEM, _AFTER_VALUE = "first key", "key", ":", "value", "item", ", or end"
_STRING, _ESCAPE = "string", "escape"
_HEX = tuple("hex digit %d" % n for n in (1, 2, 3, 4))
_MINUS, _ZERO, _INTEGER, _POINT, _FRACTION, _E, _E_SIGN, _EXPONENT = (
    "minus", "zero", "integer", "point", "fraction", "e", "e sign", "exponent")
_TOKEN_STATES = {
    _ESCAPE: {b'"\\/bfnrt': _STRING, b"u": _HEX[0]},
    **{state: {b"0123456789abcdefABCDEF": following} for state, following in zip(_HEX, _HEX[1:] + (_STRING,))},
    _MINUS: {b"0": _ZERO, b"123456789": _INTEGER},
    _ZERO: {b".": _POINT, b"eE": _E}, _INTEGER: {b"0123456789": _INTEGER, b".": _POINT, b"eE": _E},
    _POINT: {b"0123456789": _FRACTION}, _FRACTION: {b"0123456789": _FRACTION, b"eE": _E},
    _E: {b"+-": _E_SIGN, b"0123456789": _EXPONENT}, _E_SIGN: {b"0123456789": _EXPONENT},
    _EXPONENT: {b"0123456789": _EXPONENT},
    **{word[:n]: {word[n:n + 1].encode("ascii"): word[:n + 1] if n + 1 < len(word) else _AFTER_VALUE}
       for word in ("true", "false", "null") for n in range(1, len(word))}}
"""The bytes that may come within a token, by state, and the state after them.

A literal's state is what has come.
"""
_TOKEN_STEPS = {state: {byte: following for group, following in steps.items() for byte in group}
                for state, steps in _TOKEN_STATES.items()}
_TOKEN_STARTS = {**_TOKEN_STEPS[_MINUS], ord("-"): _MINUS, ord("t"): "t", ord("f"): "f", ord("n"): "n"}
_NUMBER_ENDS = frozenset((_ZERO, _INTEGER, _FRACTION, _EXPONENT))
_IN_STRING = frozenset((_STRING, _ESCAPE) + _HEX)


def _whole_object(data: bytes, text: str, start: int) -> Tuple[Optional[JsonObject], int]:
    """Return the object at ``start`` and where it ends; None where it is not all there or must be parsed byte by byte.

    Args:
        data: Bytes as received; an object with other than ASCII bytes is parsed byte by byte.
        text: The same, one character a byte.
        start: Where its brace stands.
    """
    try:
        value, length = STRICT_DECODER.raw_decode(text[start:start + _LONGEST_PLAIN])
    except ValueError:
        return None, start
    end = start + length
    is_plain = data[start:end].isascii()
    if not is_plain or data.count(b"{", start, end) + data.count(b"[", start, end) > MAX_DEPTH:
        return None, start
    return value, end


class _ObjectGrammar:
    """The grammar of a JSON object, which decides byte by byte whether the bytes so far can begin one.

    It is made at the opening brace.
    """

    def __init__(self) -> None:
        self._nesting = bytearray((_BRACE_OPEN,))
        self._state = _FIRST_KEY
        self._string_is_key = False

    @property
    def depth(self) -> int:
        """The number of braces and brackets that are open; 0 once the object is complete."""
        return len(self._nesting)

    @property
    def in_string(self) -> bool:
        return self._state in _IN_STRING

    def accepts(self, byte: int) -> bool:
        """Take the next byte; return False when it cannot belong to a JSON object within the depth limit."""
        state = self._state
        if state is _STRING:
            return self._in_string(byte)
        steps = _TOKEN_STEPS.get(state)
        if steps is not None:
            following = steps.get(byte)
            if following is not None:
                self._state = following
                return True
            if state not in _NUMBER_ENDS:
                return False
            self._state = state = _AFTER_VALUE
        return byte in _BLANK or self._structure(state, byte)

    def _in_string(self, byte: int) -> bool:
        if byte == _QUOTE:
            self._state = _AFTER_KEY if self._string_is_key else _AFTER_VALUE
        elif byte == _BACKSLASH:
            self._state = _ESCAPE
        return byte >= 0x20

    def _structure(self, state: str, byte: int) -> bool:
        if state is _AFTER_KEY:
            self._state = _VALUE
            return byte == _COLON
        if state is _AFTER_VALUE:
            if byte == _COMMA:
                self._state = _KEY if self._nesting[-1] == _BRACE_OPEN else _VALUE
                return True
            return self._close(byte)
        if state is _FIRST_KEY or state is _KEY:
            if byte == _QUOTE:
                self._state, self._string_is_key = _STRING, True
                return True
            return state is _FIRST_KEY and self._close(byte)
        if state is _FIRST_ITEM and byte == _BRACKET_CLOSE:
            return self._close(byte)
        return self._begin_value(byte)

    def _begin_value(self, byte: int) -> bool:
        if byte == _QUOTE:
            self._state, self._string_is_key = _STRING, False
        elif byte in _OPENERS:
            self._nesting.append(byte)
            self._state = _FIRST_KEY if byte == _BRACE_OPEN else _FIRST_ITEM
            return len(self._nesting) <= MAX_DEPTH
        elif byte in _TOKEN_STARTS:
            self._state = _TOKEN_STARTS[byte]
        else:
            return False
        return True

    def _close(self, byte: int) -> bool:
        if byte not in _CLOSERS or self._nesting[-1] != byte - 2:
            return False
        self._nesting.pop()
        self._state = _AFTER_VALUE
        return True


class RequestParser:
    """The requests of one client, in order, with an error in place of each piece that is not a request."""

    def __init__(self) -> None:
        self._grammar = _ObjectGrammar()
        self._text = bytearray()
        self._open = False
        self._is_silent = False
        self._skip_depth = 0
        self._skipping = False
        self._skip_in_string = False
        self._skip_escaped = False
        self._may_begin = False
        self._previous = 0
        self._last_byte_at = 0.0

    @property
    def pending(self) -> int:
        """The number of bytes of a request that has begun and not ended."""
        return len(self._text)

    def next_deadline(self) -> Optional[float]:
        """Return when ``expire`` has something to do, s on the caller's clock; None while no object has begun."""
        if self._skipping:
            return self._last_byte_at + SKIP_LIMIT_S
        return self._last_byte_at + INCOMPLETE_REQUEST_LIMIT_S if self._open else None

    def expire(self, now: float) -> List[FramedItem]:
        """Give up a request that was not finished in time; return an error for it."""
        deadline = self.next_deadline()
        if deadline is None or now < deadline:
            return []
        items: List[FramedItem] = []
        if self._open and not self._is_silent:
            items.append(FramingError("request not finished within %g s" % INCOMPLETE_REQUEST_LIMIT_S))
        self._drop()
        return items

    def feed(self, data: bytes, now: float) -> List[FramedItem]:
        """Take the next bytes, arrived at ``now``, s; return the requests they complete and the errors they make."""
        items = self.expire(now)
        self._last_byte_at = now
        text = data.decode("latin-1")
        position = 0
        while position < len(data):
            if self._skipping:
                position = self._pass_over(data, position)
                if position == len(data):
                    break
            byte = data[position]
            position += 1
            if self._skipping:
                self._skip(byte)
            elif self._open:
                self._in_object(byte, items)
            elif byte == _BRACE_OPEN:
                whole, end = _whole_object(data, text, position - 1)
                if whole is None:
                    self._begin()
                else:
                    items.append(whole)
                    position = end
            elif byte not in _BLANK and byte != 0:
                self._fail("bytes outside any object", items)
                self._skip(byte)
            self._previous = byte if byte not in _BLANK else self._previous
        return items

    def _begin(self) -> None:
        self._text[:] = b"{"
        self._open = True
        self._skipping = False
        self._grammar = _ObjectGrammar()

    def _in_object(self, byte: int, items: List[FramedItem]) -> None:
        depth, in_string = self._grammar.depth, self._grammar.in_string
        if not self._grammar.accepts(byte):
            begins_next = not in_string and self._text.endswith(b'{"') and byte not in _AFTER_STRING
            self._fail("not JSON: byte %r after %r" % (chr(byte), bytes(self._text[-24:])), items)
            self._skip_depth, self._skip_in_string, self._may_begin = depth, in_string, begins_next
            if byte == _BRACE_OPEN and not in_string and depth < MAX_DEPTH:
                self._begin()
            else:
                self._skip(byte)
            return
        self._text.append(byte)
        if not self._grammar.depth:
            text = bytes(self._text)
            self._drop()
            try:
                items.append(parse_object(text))
            except FramingError as error:
                items.append(error)
        elif len(self._text) > MAX_REQUEST_BYTES:
            self._fail("a request of more than %d bytes" % MAX_REQUEST_BYTES, items)
            self._skip_depth, self._skip_in_string = self._grammar.depth, self._grammar.in_string

    def _fail(self, why: str, items: List[FramedItem]) -> None:
        if not self._is_silent:
            items.append(FramingError(why))
        self._drop()
        self._skipping = self._is_silent = True
        self._skip_depth = 0
        self._skip_in_string = self._skip_escaped = self._may_begin = False

    def _drop(self) -> None:
        self._text.clear()
        self._open = self._skipping = self._is_silent = False

    def _pass_over(self, data: bytes, position: int) -> int:
        """Return the index of the next byte that matters while a bad document is skipped."""
        if self._skip_escaped or self._may_begin:
            return position
        match = (_MATTERS_IN_STRING if self._skip_in_string else _MATTERS).search(data, position)
        end = match.start() if match else len(data)
        passed = data[position:end].rstrip(b" \t\r\n")
        self._previous = passed[-1] if passed else self._previous
        return end

    def _skip(self, byte: int) -> None:
        """Skip one byte of a bad document; notice where that document ends or the next request begins."""
        may_begin, self._may_begin = self._may_begin, False
        if may_begin and byte not in _AFTER_STRING:
            self._begin()
            for known in (_QUOTE, byte):
                self._in_object(known, [])
        elif self._skip_in_string:
            if self._skip_escaped:
                self._skip_escaped = False
            elif byte == _BACKSLASH:
                self._skip_escaped = True
            elif byte == _QUOTE or byte < 0x20:
                self._skip_in_string = False
                self._may_begin = self._previous == _BRACE_OPEN
        elif byte == _QUOTE and self._skip_depth:
            self._skip_in_string = True
        elif byte == _BRACE_OPEN and (not self._skip_depth or self._previous not in _BEFORE_NESTED):
            self._begin()
        elif byte in _OPENERS:
            self._skip_depth += 1
        elif byte in _CLOSERS and self._skip_depth:
            self._skip_depth -= 1
            if not self._skip_depth:
                self._drop()
        elif byte == 0x0A and not self._skip_depth:
            self._drop()
