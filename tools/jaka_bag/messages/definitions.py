"""ROS 1 message definitions: text to fields, and the md5 of a type.

``DefinitionError`` is raised where a text is not understood, or a type in it is missing or contains itself.
"""
import hashlib
import re
from typing import Dict, List, NamedTuple, Optional, Tuple

from ..errors import DefinitionError

PRIMITIVE_SIZES = {
    "bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "int64": 8, "uint64": 8, "float32": 4, "float64": 8, "time": 8, "duration": 8,
}
"""Size on the ROS 1 wire, byte; ``string`` is the one built-in type without a fixed size."""

_DEEPEST = 60
"""Most types inside each other: far more than real ones have, and Python's stack ends."""
_MOST_FIELDS = 5000
"""Fields of a type with those of all types in it, beyond which a definition is taken for an attack."""
_MOST_MESSAGES = 2000000
"""Messages in a message by fixed arrays alone: where they have no bytes, a short message would have them all."""
_ARRAY_LENGTH = re.compile(r"([0-9]{0,18})\]\Z")
_HEADER_NAMES = ("Header", "std_msgs/Header", "roslib/Header")


class Field(NamedTuple):
    """One field of a message.

    Attributes:
        type: A key of ``PRIMITIVE_SIZES``, ``string``, or the full name of a message type.
        name: Field name.
        array: None for a single value, the length of a fixed array, -1 for one whose length is in the message.
    """

    type: str
    name: str
    array: Optional[int]

    @property
    def is_builtin(self) -> bool:
        """True where the type is not another message."""
        return self.type == "string" or self.type in PRIMITIVE_SIZES


class Constant(NamedTuple):
    """One constant of a message; ``value`` is its text."""

    type: str
    name: str
    value: str


class MessageType(NamedTuple):
    """A parsed ``.msg``: full name, constants, fields, each in the order of the text."""

    name: str
    constants: Tuple[Constant, ...]
    fields: Tuple[Field, ...]


def _resolve(type_name: str, package: str) -> str:
    if type_name == "string" or type_name in PRIMITIVE_SIZES:
        return type_name
    if type_name in _HEADER_NAMES:
        return "std_msgs/Header"
    return type_name if "/" in type_name else "%s/%s" % (package, type_name)


def _parse_field(type_name: str, name: str, package: str) -> Field:
    base, bracket, rest = type_name.partition("[")
    array: Optional[int] = None
    if bracket:
        length = _ARRAY_LENGTH.match(rest)
        if length is None:
            raise DefinitionError("array type %r is not understood" % type_name[:60])
        array = int(length.group(1) or -1)
    return Field(_resolve(base, package), name, array)


def parse_type(datatype: str, text: str) -> MessageType:
    """Parse the fields and constants of one ``.msg`` text (without those of the types in it)."""
    package = datatype.split("/")[0]
    constants: List[Constant] = []
    fields: List[Field] = []
    for line in text.splitlines():
        clean = line.split("#")[0].strip()
        if not clean:
            continue
        parts = clean.split(None, 1)
        if len(parts) != 2:
            raise DefinitionError("definition of %s: line %r is not understood" % (datatype, line[:60]))
        type_name, rest = parts
        if "=" in rest:
            if type_name == "string":  # a string constant runs to the end of the line, '#' included
                rest = line.strip().split(None, 1)[1]
            name, value = rest.split("=", 1)
            constants.append(Constant(type_name, name.strip(), value.strip()))
        elif len(rest.split()) != 1:
            raise DefinitionError("definition of %s: line %r is not understood" % (datatype, line[:60]))
        else:
            fields.append(_parse_field(type_name, rest, package))
    if len({field.name for field in fields}) < len(fields):
        raise DefinitionError("definition of %s: two fields have one name" % datatype)
    return MessageType(datatype, tuple(constants), tuple(fields))


def parse_definition(datatype: str, text: str) -> Dict[str, MessageType]:
    """Parse all types of a full definition (``====`` between them), by full name; the first is ``datatype`` itself."""
    types: Dict[str, MessageType] = {}
    name = datatype
    lines: List[str] = []
    for line in text.splitlines() + ["=" * 80]:
        if len(line) >= 40 and not line.strip("="):
            parsed = parse_type(name, "\n".join(lines))
            if types.setdefault(name, parsed) != parsed:
                raise DefinitionError("the definition of %s has two of %s" % (datatype, name))
            name, lines = "", []
        elif not name:
            if line.strip():
                if not line.startswith("MSG:"):
                    raise DefinitionError("definition of %s: %r is not understood" % (datatype, line[:60]))
                name = _resolve(line[4:].strip(), datatype.split("/")[0])
        else:
            lines.append(line)
    _check_closed(datatype, types, (), {})
    return types


def _check_closed(name: str, types: Dict[str, MessageType], above: Tuple[str, ...],
                  known: Dict[str, Tuple[int, int, int]]) -> Tuple[int, int, int]:
    """Return what is limited of a type: fields, nested ones included, depth, and messages in it by fixed arrays."""
    if name in known:
        return known[name]
    if name not in types:
        raise DefinitionError("the definition of %s lacks %s" % (above[0] if above else name, name))
    if name in above:
        raise DefinitionError("%s contains itself" % name)
    count, depth, messages = 0, 1, 1
    for inner in types[name].fields if len(above) < _DEEPEST else ():
        below = (1, 0, 0) if inner.is_builtin else _check_closed(inner.type, types, above + (name,), known)
        count += 1 if inner.is_builtin else 1 + below[0]
        depth = max(depth, 1 + below[1])
        messages += below[2] * (1 if inner.array is None else max(inner.array, 1))
    if depth > _DEEPEST or len(above) >= _DEEPEST:
        raise DefinitionError("the definition of %s is more than %d types deep" % ((above + (name,))[0], _DEEPEST))
    if count > _MOST_FIELDS:
        raise DefinitionError("the definition of %s describes more than %d fields"
                              % ((above + (name,))[0], _MOST_FIELDS))
    if messages > _MOST_MESSAGES:
        raise DefinitionError("the definition of %s describes more than %d messages in one"
                              % ((above + (name,))[0], _MOST_MESSAGES))
    known[name] = (count, depth, messages)
    return known[name]


def least_size(type_name: str, types: Dict[str, MessageType], known: Dict[str, int]) -> int:
    """Return the least number of bytes of a type's value; zero only where no value has any.

    Args:
        type_name: A type.
        types: All types by full name.
        known: The sizes of messages that are done; it grows.
    """
    if type_name == "string":
        return 4
    if type_name in PRIMITIVE_SIZES:
        return PRIMITIVE_SIZES[type_name]
    if type_name not in known:
        known[type_name] = sum(
            4 if field.array is not None and field.array < 0
            else least_size(field.type, types, known) * (1 if field.array is None else field.array)
            for field in types[type_name].fields)
    return known[type_name]


def md5_of(datatype: str, types: Dict[str, MessageType], known: Optional[Dict[str, str]] = None) -> str:
    """Compute a type's md5 as ROS 1 does (genmsg ``gentools``): constants, then fields, nested types by md5.

    Args:
        datatype: Full name.
        types: All types by full name.
        known: The md5 of types that are done; it grows.
    """
    known = {} if known is None else known
    if datatype in known:
        return known[datatype]
    lines = ["%s %s=%s" % constant for constant in types[datatype].constants]
    for item in types[datatype].fields:
        if item.is_builtin:
            suffix = "" if item.array is None else "[]" if item.array < 0 else "[%d]" % item.array
            lines.append("%s%s %s" % (item.type, suffix, item.name))
        else:
            lines.append("%s %s" % (md5_of(item.type, types, known), item.name))
    known[datatype] = hashlib.md5("\n".join(lines).strip().encode("utf-8", "surrogateescape")).hexdigest()
    return known[datatype]


def definition_md5(datatype: str, text: str) -> str:
    """Compute the md5 of the type that a full definition text describes."""
    return md5_of(datatype, parse_definition(datatype, text))
