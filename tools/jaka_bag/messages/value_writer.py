"""Python values as one serialised ROS 1 message: the inverse of ``values``."""
import struct
from typing import Any, Dict, List, Tuple

from ..errors import DefinitionError
from ..units import NS_PER_S
from .connection import Connection
from .encodings import ros1_form, types_of
from .values import CODES, STAMPS

_U32 = struct.Struct("<I")


def exact_time(seconds: int, nanoseconds: int) -> Tuple[int, int]:
    """Keep a time as seconds and nanoseconds; for ``ValueReader``, so that it can be written again."""
    return seconds, nanoseconds


def time_of(ns: int) -> Tuple[int, int]:
    """Convert a time, ns, to seconds and nanoseconds."""
    return ns // NS_PER_S, ns % NS_PER_S


def in_ns(time: Tuple[int, int]) -> int:
    """Convert seconds and nanoseconds to ns: the inverse of ``time_of``."""
    return time[0] * NS_PER_S + time[1]


class ValueWriter:
    """A writer of one connection's messages.

    Args:
        connection: Connection whose definition is followed.

    Raises:
        DefinitionError: The definition is not understood.
    """

    def __init__(self, connection: Connection) -> None:
        self._datatype = connection.datatype
        self._types = types_of(connection)
        if ros1_form(connection) is not None:
            raise DefinitionError("%s: messages encoded as %s are not written" % (
                connection.topic, connection.encoding))

    def write(self, value: Dict[str, Any]) -> bytes:
        """Return the bytes of a message; times are pairs as ``exact_time`` gives them.

        Raises:
            DefinitionError: A value does not fit its field.
        """
        parts: List[bytes] = []
        try:
            self._add(self._datatype, value, parts)
        except (struct.error, KeyError, TypeError, AttributeError) as error:
            raise DefinitionError("%s: a value does not fit its field (%s)" % (self._datatype, error)) from error
        return b"".join(parts)

    def _add(self, type_name: str, value: Any, parts: List[bytes]) -> None:
        if type_name == "string":
            raw = value.encode("utf-8", "surrogateescape")
            parts.append(_U32.pack(len(raw)) + raw)
        elif type_name in STAMPS:
            parts.append(STAMPS[type_name].pack(*value))
        elif type_name in CODES:
            parts.append(struct.pack("<" + CODES[type_name], value))
        else:
            for field in self._types[type_name].fields:
                self._add_field(field.type, field.array, value[field.name], parts)

    def _add_field(self, type_name: str, array: Any, value: Any, parts: List[bytes]) -> None:
        if array is None:
            self._add(type_name, value, parts)
            return
        if array < 0:
            parts.append(_U32.pack(len(value)))
        elif len(value) != array:
            raise TypeError("%d values for %d" % (len(value), array))
        if type_name in CODES:
            parts.append(bytes(value) if isinstance(value, bytes)
                         else struct.pack("<%d%s" % (len(value), CODES[type_name]), *value))
            return
        for one in value:
            self._add(type_name, one, parts)
