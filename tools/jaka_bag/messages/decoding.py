"""Single messages as data for JSON: slow beside columns, but whole messages with all that is in them.

``DefinitionError`` is raised where a definition is not understood or does not describe a message.
"""
import base64
import math
import re
from typing import Any

from ..errors import DefinitionError
from ..json_text import load_json
from .connection import Connection
from .values import ValueReader


class Decoder:
    """A decoder of one connection's messages into data for JSON.

    Messages become objects, arrays lists, times ``{"secs": ..., "nsecs": ...}``, arrays of bytes base64 text, and
    numbers that are none the texts ``NaN``, ``Infinity`` and ``-Infinity``, as in protobuf's JSON. Messages that are
    JSON are taken as they are.

    Args:
        connection: Connection with type and definition.
    """

    def __init__(self, connection: Connection) -> None:
        self._name = "%s (%s)" % (connection.topic, connection.datatype)
        self._is_json = connection.encoding == "json"
        if not self._is_json:
            self._reader = ValueReader(connection, _as_object, "surrogateescape")

    def decode(self, raw: bytes) -> Any:
        """Decode one message."""
        try:
            return load_json(raw) if self._is_json else _for_json(self._reader.read(raw))
        except (ValueError, DefinitionError, RecursionError) as error:
            raise DefinitionError("%s: a message does not fit its definition (%s)" % (self._name, error)) from error


def _as_object(seconds: int, nanoseconds: int) -> Any:
    return {"secs": seconds, "nsecs": nanoseconds}


def _for_json(value: Any) -> Any:
    if isinstance(value, float):
        if math.isfinite(value):
            return value
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    if isinstance(value, bytes):
        return base64.b64encode(value).decode("ascii")
    if isinstance(value, list):
        return [_for_json(element) for element in value]
    return {name: _for_json(part) for name, part in value.items()} if isinstance(value, dict) else value


def pick(value: Any, path: str) -> Any:
    """Return the part of a decoded message that a path names.

    Args:
        value: A decoded message.
        path: As ``header.stamp``, ``position[0]``, ``transforms.transform.translation.x`` (a list, one for each).

    Raises:
        KeyError: There is no such field.
    """
    name, _, rest = path.partition(".")
    name, bracket, index = name.partition("[")
    if isinstance(value, list):
        return [pick(element, path) for element in value]
    if not isinstance(value, dict) or name not in value:
        raise KeyError(path)
    found = value[name]
    if bracket:
        number = index[:-1]
        if not (index.endswith("]") and re.fullmatch("[0-9]{1,9}", number) and isinstance(found, list)
                and int(number) < len(found)):
            raise KeyError(path)
        found = found[int(number)]
    return pick(found, rest) if rest else found
