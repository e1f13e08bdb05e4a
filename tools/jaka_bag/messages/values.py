"""One serialised ROS 1 message as Python values, for use one by one.

``DefinitionError`` is raised where the definition is not understood or does not describe the bytes.
"""
import struct
from typing import Any, Callable, Dict, List, Tuple

from ..errors import DefinitionError
from .connection import Connection
from .definitions import PRIMITIVE_SIZES, MessageType, least_size
from .encodings import as_ros1, ros1_form, types_of

CODES = {"bool": "?", "byte": "b", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
         "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d"}
"""Codes of ``struct`` by primitive type."""
_U32 = struct.Struct("<I")
STAMPS = {"time": struct.Struct("<II"), "duration": struct.Struct("<ii")}
"""Layouts of the two types of times: seconds and nanoseconds."""
_NS = 1e-9
_MOST_VALUES, _MOST_PER_BYTE = 100000, 16
"""Messages in a message, with their fields, beyond which it is refused: arrays without bytes nest for nothing."""
_SHORT = "a message is shorter than its definition says"
MakeTime = Callable[[int, int], Any]
"""Seconds and nanoseconds to the value of a time or a duration."""


def in_seconds(seconds: int, nanoseconds: int) -> float:
    """Convert a time or a duration to s."""
    return seconds + nanoseconds * _NS


class ValueReader:
    """A reader of one connection's messages.

    Values are bool, int, float, str, bytes for arrays of ``uint8`` and ``char``, lists for other arrays, and
    dictionaries for messages in messages.

    Args:
        connection: Connection whose definition is followed, whatever its md5.
        make_time: Converts times and durations.
        errors: Handling of bytes in a text that are not UTF-8, as in ``bytes.decode``.
    """

    def __init__(self, connection: Connection, make_time: MakeTime = in_seconds, errors: str = "replace") -> None:
        self._form = ros1_form(connection)
        self._datatype = as_ros1(connection).datatype
        self._types = types_of(connection)
        self._make_time = make_time
        self._errors = errors
        self._least: Dict[str, int] = {}
        self._left = 0

    def has(self, path: Tuple[str, ...]) -> bool:
        """Return whether messages have a field of this path, such as ``("header", "stamp")``."""
        datatype = self._datatype
        for name in path:
            known = self._types.get(datatype)
            field = next((field for field in known.fields if field.name == name), None) if known else None
            if field is None:
                return False
            datatype = field.type
        return True

    def field_names(self) -> List[str]:
        """Return the names of the top-level fields."""
        return [field.name for field in self._types[self._datatype].fields]

    def read(self, raw: bytes) -> Dict[str, Any]:
        """Return the values of one message, by the names of its fields."""
        raw = raw if self._form is None else self._form.convert(raw)
        self._left = _MOST_VALUES + _MOST_PER_BYTE * len(raw)
        try:
            values, end = self._message(self._types[self._datatype], raw, 0)
        except struct.error:
            raise DefinitionError(_SHORT) from None
        if end != len(raw):
            raise DefinitionError("a message has %d bytes, its definition describes %d" % (len(raw), end))
        return values

    def _message(self, kind: MessageType, raw: bytes, at: int) -> Tuple[Dict[str, Any], int]:
        values: Dict[str, Any] = {}
        self._left -= 1 + len(kind.fields)
        if self._left < 0:
            raise DefinitionError("a message of %d bytes has too many values" % len(raw))
        for field in kind.fields:
            if field.array is None:
                values[field.name], at = self._one(field.type, raw, at)
                continue
            count = field.array
            if count < 0:
                count, at = _U32.unpack_from(raw, at)[0], at + 4
            values[field.name], at = self._array(field.type, count, raw, at)
        return values, at

    def _array(self, type_name: str, count: int, raw: bytes, at: int) -> Tuple[Any, int]:
        size = least_size(type_name, self._types, self._least)
        if count * size > len(raw) - at:
            raise DefinitionError(_SHORT)
        if type_name in ("uint8", "char"):
            return raw[at:at + count], at + count
        if type_name in CODES:
            return list(struct.unpack_from("<%d%s" % (count, CODES[type_name]), raw, at)), at + count * size
        result = []
        for _ in range(count):
            value, at = self._one(type_name, raw, at)
            result.append(value)
        return result, at

    def _one(self, type_name: str, raw: bytes, at: int) -> Tuple[Any, int]:
        code = CODES.get(type_name)
        if code is not None:
            return struct.unpack_from("<" + code, raw, at)[0], at + PRIMITIVE_SIZES[type_name]
        if type_name == "string":
            end = at + 4 + int(_U32.unpack_from(raw, at)[0])
            if end > len(raw):
                raise DefinitionError(_SHORT)
            return raw[at + 4:end].decode("utf-8", self._errors), end
        if type_name in STAMPS:
            return self._make_time(*STAMPS[type_name].unpack_from(raw, at)), at + 8
        return self._message(self._types[type_name], raw, at)


class ValueReaders(Dict[Connection, ValueReader]):
    """The readers of values for the messages of a log: one for each connection, made when it is first asked for."""

    def __missing__(self, connection: Connection) -> ValueReader:
        reader = self[connection] = ValueReader(connection)
        return reader
