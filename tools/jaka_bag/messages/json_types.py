"""JSON messages as those of ROS 1, by their JSON Schema.

Objects become messages, arrays become arrays, ``integer`` and ``boolean`` that must be there int64 and bool, texts in
base64 arrays of uint8. A number, or an integer or boolean that may be missing, becomes float64, NaN where it is
missing. What has no fixed form (several types, arrays of arrays, schemas that contain themselves) is kept as JSON in a
text.
"""
import base64
import json
import math
import re
import struct
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

from ..errors import DefinitionError
from ..json_text import load_json

_BREAK = "=" * 80
_DEEPEST = 20
"""Most levels of a JSON Schema, and references one after the other: far more than real ones have."""
_MOST_FIELDS = 5000
"""Fields of a JSON Schema, beyond which it is taken for an attack: references multiply them."""
_U32 = struct.Struct("<I")
_Write = Callable[[Any], bytes]
"""A function from a value as ``json`` gives it, None where it is missing, to its bytes in a ROS 1 message."""


class _Kind(NamedTuple):
    """A type of ROS 1, and the function that writes values of it."""

    name: str
    write: _Write


def _text(value: Any) -> bytes:
    raw = (value if isinstance(value, str) else "" if value is None else json.dumps(value)).encode("utf-8", "replace")
    return _U32.pack(len(raw)) + raw


def _bytes(value: Any) -> bytes:
    raw = base64.b64decode(value or "", validate=True)
    return _U32.pack(len(raw)) + raw


def _number(value: Any) -> bytes:
    if isinstance(value, str):  # protobuf's JSON writes numbers that are none, and long ones, as texts
        value = int(value) if value.lstrip("-").isdecimal() else float(value)
    if isinstance(value, int) and int(float(value)) != value:
        raise ValueError("%d may be missing, and float64 does not hold it exactly" % value)
    return struct.pack("<d", math.nan if value is None else value)


def _integer(value: Any) -> bytes:
    return struct.pack("<q", int(value) if isinstance(value, str) or float(value).is_integer() else value)


def _flag(value: Any) -> bytes:
    if not isinstance(value, bool):
        raise ValueError("%r is not true or false" % (value,))
    return struct.pack("<?", value)


_TEXT, _NUMBER = _Kind("string", _text), _Kind("float64", _number)
_SIMPLE = {"string": _TEXT, "number": _NUMBER, "integer": _Kind("int64", _integer), "boolean": _Kind("bool", _flag)}


def _free(name: str, taken: Dict[str, int]) -> str:
    """Return a name, with ``_2``, ``_3`` where it is taken; it is taken from now on."""
    number = taken.get(name, 0) + 1
    made = name if number == 1 else "%s_%d" % (name, number)
    while number > 1 and made in taken:
        number += 1
        made = "%s_%d" % (name, number)
    taken[name] = number
    taken.setdefault(made, 1)
    return made


class JsonType:
    """The ROS 1 form of a JSON type.

    Args:
        name: Name of the schema.
        schema: JSON Schema, as text.
        package: Package of the ROS 1 type.

    Attributes:
        name: ``package/Type``.
        definition: ROS 1 definition text with those of all types in it.

    Raises:
        DefinitionError: The schema is not JSON, or does not describe an object.
    """

    def __init__(self, name: str, schema: str, package: str = "json") -> None:
        self.name = package + "/" + (re.sub(r"\W", "_", name) or "Message")
        try:
            self._root: Any = load_json(schema)
        except ValueError as error:
            raise DefinitionError("the JSON Schema of %s cannot be read (%s)" % (name, error)) from error
        self._parts: List[str] = []
        self._fields = 0
        self._type_names = {self.name: 1}
        fields = self._resolved(self._root)
        if not isinstance(fields.get("properties"), dict):
            raise DefinitionError("the JSON Schema of %s describes no object with properties" % name)
        self._write = self._message(self.name, fields, (id(fields),))
        self.definition = ("\n%s\n" % _BREAK).join([self._parts[-1].partition("\n")[2], *self._parts[:-1]])

    def to_ros1(self, message: bytes) -> bytes:
        """Convert a message.

        Raises:
            DefinitionError: It does not fit the schema.
        """
        try:
            return self.write(load_json(message))
        except ValueError as error:
            raise DefinitionError("a message does not fit its JSON Schema (%s)" % str(error)[:160]) from error

    def write(self, value: Any) -> bytes:
        """Return the ROS 1 message of a value as ``json`` gives it.

        Raises:
            DefinitionError: It does not fit the schema.
        """
        try:
            return self._write(value)
        except (ValueError, TypeError, OverflowError, RecursionError, AttributeError, struct.error) as error:
            raise DefinitionError("a message does not fit its JSON Schema (%s)" % str(error)[:160]) from error

    def _resolved(self, schema: Any) -> Dict[str, Any]:
        """Return a schema, or the one that it refers to."""
        for _ in range(_DEEPEST):
            path = schema.get("$ref") if isinstance(schema, dict) else None
            if not isinstance(path, str) or not path.startswith("#/"):
                break
            found: Any = self._root
            for part in path[2:].split("/"):
                found = found.get(part) if isinstance(found, dict) else None
            schema = found
        return schema if isinstance(schema, dict) else {}

    def _message(self, name: str, schema: Dict[str, Any], above: Tuple[int, ...], is_certain: bool = True) -> _Write:
        """Add the definition of an object; return what writes one.

        Args:
            name: Name of its type.
            schema: Its schema.
            above: Identities of the schemas in which it stands, and its own.
            is_certain: It is never missing itself.
        """
        required = schema.get("required")
        must = set(map(str, required)) if isinstance(required, list) and is_certain else set()
        lines: List[str] = []
        writers: List[Tuple[str, _Write]] = []
        taken: Dict[str, int] = {}
        for key, value in schema["properties"].items():
            self._fields += 1
            if self._fields > _MOST_FIELDS:
                raise DefinitionError("the JSON Schema of %s describes more than %d fields" % (self.name, _MOST_FIELDS))
            field = re.sub(r"\W", "_", key, flags=re.ASCII)
            field = field if re.match("[A-Za-z]", field) else "x" + field
            field = _free(field, taken)
            kind = self._kind("%s_%s" % (name, field), self._resolved(value), key in must, above)
            lines.append("%s %s" % (kind.name, field))
            writers.append((key, kind.write))
        self._parts.append("MSG: %s\n%s\n" % (name, "\n".join(lines)))

        def write(value: Any) -> bytes:
            there = {} if value is None else value
            return b"".join(one(there.get(key)) for key, one in writers)
        return write

    def _kind(self, name: str, schema: Dict[str, Any], is_required: bool, above: Tuple[int, ...]) -> _Kind:
        types = schema.get("type")
        given = [one for one in types if one != "null"] if isinstance(types, list) else [types]
        one = given[0] if len(given) == 1 else None
        is_certain = is_required and not isinstance(types, list)
        if one == "string" and schema.get("contentEncoding") == "base64":
            return _Kind("uint8[]", _bytes)
        if one in ("integer", "boolean") and not is_certain:
            return _NUMBER
        if one in _SIMPLE:
            return _SIMPLE[one]
        is_fixed = id(schema) not in above and len(above) < _DEEPEST
        if one == "object" and isinstance(schema.get("properties"), dict) and schema["properties"] and is_fixed:
            own = _free(name, self._type_names)  # tool: {force} and tool_force would be one type
            return _Kind(own, self._message(own, schema, (*above, id(schema)), is_certain))
        if one == "array" and isinstance(schema.get("items"), dict) and schema["items"].get("type") != "array":
            inner = self._kind(name, self._resolved(schema["items"]), True, above)
            if not inner.name.endswith("]"):
                return _Kind(inner.name + "[]", _array(inner.write))
        return _TEXT


def _array(write: _Write) -> _Write:
    """Return what writes an array, given what writes one of its values."""
    def write_all(value: Any) -> bytes:
        values = [] if value is None else value
        if not isinstance(values, list):
            raise ValueError("%r is no array" % (value,))
        return _U32.pack(len(values)) + b"".join(map(write, values))
    return write_all
