"""Messages of other encodings in the form of ROS 1: CDR with definitions of ROS 2, JSON with a schema, Protobuf.

What reads fields follows ROS 1 definitions and bytes alone; a message of another encoding is brought into that form
first. ``DefinitionError`` is raised where a definition is not understood or does not describe a message.
"""
import functools
from typing import Callable, Dict, NamedTuple, Optional

from ..errors import DefinitionError, MissingDependency
from .connection import Connection
from .definitions import MessageType, definition_md5, parse_definition


class Ros1Form(NamedTuple):
    """The ROS 1 form of a connection's messages.

    Attributes:
        datatype: ``package/Type``.
        definition: Definition text with those of all types in it.
        md5sum: MD5 sum of the type.
        convert: Converts one message; raises ``DefinitionError``.
    """

    datatype: str
    definition: str
    md5sum: str
    convert: Callable[[bytes], bytes]


@functools.lru_cache(maxsize=512)
def ros1_form(connection: Connection) -> Optional[Ros1Form]:
    """Return the ROS 1 form of a connection's messages; None where they are those of ROS 1.

    Raises:
        DefinitionError: They have none, the definition is not understood, or its library is not installed.
    """
    kind = connection.encoding, connection.schema_encoding
    where = "%s (%s)" % (connection.topic, connection.datatype)
    if kind == ("ros1", "ros1msg"):
        return None
    try:
        if kind in (("cdr", "ros2msg"), ("cdr", "ros2idl")):
            from .ros2_types import Ros1Type
            name = connection.datatype
            cdr = Ros1Type(name if "/msg/" in name else name.replace("/", "/msg/", 1), connection.definition,
                           kind[1] == "ros2idl")
            return Ros1Form(cdr.name, cdr.definition, cdr.md5sum, cdr.to_ros1)
        if kind == ("json", "jsonschema"):
            from .json_types import JsonType
            made = JsonType(connection.datatype, connection.definition)
            return Ros1Form(made.name, made.definition, definition_md5(made.name, made.definition), made.to_ros1)
        if kind == ("protobuf", "protobuf"):
            from .protobuf_types import ProtobufType
            read = ProtobufType(connection.datatype, connection.definition.encode("utf-8", "surrogateescape"))
            return Ros1Form(read.name, read.definition, definition_md5(read.name, read.definition), read.to_ros1)
    except (DefinitionError, MissingDependency) as error:
        raise DefinitionError("%s: %s" % (where, error)) from error
    raise DefinitionError("%s: messages encoded as %s, described by %s, cannot be decoded" % (
        where, kind[0] or "nothing known", kind[1] or "nothing"))


def as_ros1(connection: Connection) -> Connection:
    """Return the connection that ROS 1 would have for messages of these fields; itself for those of ROS 1.

    Raises:
        DefinitionError: As ``ros1_form``.
    """
    form = ros1_form(connection)
    if form is None:
        return connection
    is_latched = is_transient_local(dict(connection.extra).get("offered_qos_profiles", ""))
    return Connection(connection.topic, form.datatype, form.md5sum, form.definition, connection.callerid,
                      is_latched or connection.latching)


def is_transient_local(profiles: str) -> bool:
    """Return whether qualities of service of ROS 2, as YAML, keep messages for late subscribers."""
    return "durability: 1\n" in profiles + "\n" or "durability: transient_local" in profiles


def described(connection: Connection) -> Connection:
    """Return the connection that ROS 1 would have, or itself where its messages cannot be decoded."""
    try:
        return as_ros1(connection)
    except DefinitionError:
        return connection


def types_of(connection: Connection) -> Dict[str, MessageType]:
    """Return the types of a connection's messages, as ``parse_definition`` does, by their names in ROS 1.

    Raises:
        DefinitionError: The messages are of an encoding that is not read, or the definition is not understood.
    """
    plain = as_ros1(connection)
    try:
        types = parse_definition(plain.datatype, plain.definition)
        return types if connection.encoding != "cdr" else {name: kind._replace(fields=tuple(
            field._replace(type="uint8") if field.type == "byte" else field for field in kind.fields))
            for name, kind in types.items()}  # a byte of ROS 2 has no sign
    except DefinitionError as error:
        raise DefinitionError("%s (%s): %s" % (connection.topic, connection.datatype, error)) from error
