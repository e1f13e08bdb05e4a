"""The door to rosbags' types, whose interface changes between versions: CDR, ROS 2 definitions and type hashes."""
import re
from typing import Any, Dict, List, Set

from ..errors import DefinitionError, MissingDependency
from .connection import Connection
from .definitions import definition_md5

_BREAK = "=" * 80
_BIG_ENDIAN = b"\0\0"
"""First bytes of a CDR message whose numbers have the high byte first."""
_ROS2_HEADER = ("builtin_interfaces/Time stamp\nstring frame_id\n" + _BREAK
                + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n" + _BREAK
                + "\nMSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n")
_BETWEEN_IDL = re.compile(r"^=+\r?\nIDL: .*$|^[ \t]*#include\b.*$", re.MULTILINE)
"""Head of each file in the IDL of several, as MCAP holds it, and what it includes: rosbags reads neither."""
_OCTET = re.compile(r"\boctet\b")
"""IDL's byte, which has no sign: ROS 1's has one, and rosbags for Python 3.8 knows none."""
_HEADER = "std_msgs/msg/Header"
_CONSTANT = re.compile(r"\s*(\w+)\s+(\w+)\s*=(.*)$")
_ROS2_CONSTANT = re.compile(r"[A-Z][A-Z0-9]*(_[A-Z0-9]+)*$")
_RENAMED = {"tf/tfMessage": "tf2_msgs/TFMessage"}  # the one ROS 1 type that ROS 2 knows under another name


def _short(error: Exception) -> str:
    """Return the text of an exception of rosbags, without the definition that it may quote."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 160 else text[:160] + "..."


def ros2_name(datatype: str) -> str:
    """Convert ``package/Type`` to ROS 2's form, ``package/msg/Type``."""
    package, _, name = _RENAMED.get(datatype, datatype).partition("/")
    return "%s/msg/%s" % (package, name)


def with_ros2_constants(definition: str) -> str:
    """Return a ROS 1 definition with constants in capitals, and without those that ROS 2 cannot have."""
    lines = []
    for line in definition.splitlines():
        constant = _CONSTANT.match(line)
        if constant is not None:
            type_name, name, rest = constant.groups()
            name = name.upper().strip("_")
            if type_name in ("time", "duration") or not _ROS2_CONSTANT.match(name):
                continue
            line = "%s %s=%s" % (type_name, name, rest)
        lines.append(line)
    return "\n".join(lines) + "\n"


class Ros2Type:
    """The ROS 2 side of a ROS 1 message type.

    Args:
        connection: Gives type and definition.

    Attributes:
        name: ``package/msg/Type``.
        definition: ROS 2 definition text with those of all types in it.
        type_hash: ``RIHS01_...``.

    Raises:
        MissingDependency: rosbags is not installed.
        DefinitionError: rosbags does not understand the definition.
    """

    def __init__(self, connection: Connection) -> None:
        try:
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore
        except ImportError:
            raise MissingDependency("ROS 2 output needs the Python package rosbags") from None
        self.name = ros2_name(connection.datatype)
        def store_of(definition: str) -> Any:
            types = get_types_from_msg(definition, self.name)
            types.update(get_types_from_msg(_ROS2_HEADER, "std_msgs/msg/Header"))
            store = get_typestore(Stores.EMPTY)
            store.register(types)
            return store

        try:
            try:
                self._store = store_of(connection.definition)
            except Exception:  # rosbags raises what its parser raises: constants are not named as in ROS 2
                self._store = store_of(with_ros2_constants(connection.definition))
            self.definition: str = self._store.generate_msgdef(self.name, ros_version=2)[0]
            self.type_hash: str = self._store.hash_rihs01(self.name)
        except Exception as error:  # rosbags raises what its parser raises
            raise DefinitionError("%s: the definition of %s has no ROS 2 form (%s)" % (
                connection.topic, connection.datatype, _short(error))) from error

    def to_cdr(self, message: bytes) -> bytes:
        """Convert a serialised ROS 1 message to CDR.

        Raises:
            DefinitionError: The definition does not describe these bytes.
        """
        try:
            return bytes(self._store.ros1_to_cdr(message, self.name))
        except Exception as error:  # IndexError, struct.error, AssertionError: whatever the generated code meets
            raise DefinitionError("a message of %s does not fit its definition" % self.name) from error


def _needed(name: str, known: Dict[str, Any]) -> Set[str]:
    """Return a type and those that it is made of, by their names in rosbags' nested tuples of fields."""
    found: Set[str] = set()
    waiting: List[Any] = [name]
    while waiting:
        part = waiting.pop()
        if isinstance(part, (tuple, list)):
            waiting += part
        elif isinstance(part, str) and part in known and part not in found:
            found.add(part)
            waiting.append(known[part][1])
    return found


def _definitions_in(store: Any) -> Dict[str, Any]:
    """Return the types that a store of rosbags knows; the last version for Python 3.8 has another name for them."""
    found: Dict[str, Any] = store.fielddefs if hasattr(store, "fielddefs") else store.FIELDDEFS
    return found


def ros1_name(type_name: str) -> str:
    """Convert ``package/msg/Type`` to ROS 1's form, ``package/Type``."""
    return type_name.replace("/msg/", "/", 1)


def ros2_definition(name: str) -> str:
    """Return the definition text of ``package/msg/Type`` that rosbags knows of ROS 2; empty where it knows none."""
    try:
        from rosbags.typesys import Stores, get_typestore
        return str(get_typestore(Stores.ROS2_HUMBLE).generate_msgdef(name, ros_version=2)[0])
    except Exception:  # KeyError, TypesysError, or rosbags is not installed
        return ""


class Ros1Type:
    """The ROS 1 side of a ROS 2 message type.

    Args:
        name: ``package/msg/Type``.
        definition: Text with the definitions of all types in it; empty for the ones that rosbags knows of ROS 2.
        is_idl: The text is OMG IDL instead of ``.msg``.

    Attributes:
        name: ``package/Type``.
        definition: ROS 1 definition text with those of all types in it.
        md5sum: MD5 sum of the type.

    Raises:
        MissingDependency: rosbags is not installed.
        DefinitionError: The type is not known, or ROS 1 has nothing like it.
    """

    def __init__(self, name: str, definition: str = "", is_idl: bool = False) -> None:
        try:
            from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
        except ImportError:
            raise MissingDependency("rosbag2 folders need the Python package rosbags") from None
        self.name = ros1_name(name)
        self._ros2_name = name
        try:
            known = dict(_definitions_in(get_typestore(Stores.ROS2_HUMBLE)))
            if definition:
                known.update(get_types_from_idl(_OCTET.sub("uint8", _BETWEEN_IDL.sub("", definition))) if is_idl
                             else get_types_from_msg(definition, name))
            known = {each: known[each] for each in _needed(name, known)}
            self._store: Any = get_typestore(Stores.EMPTY)
            self._store.register(known)
            ros1_store: Any = get_typestore(Stores.EMPTY)
            if _HEADER in known:
                known[_HEADER] = _definitions_in(get_typestore(Stores.ROS1_NOETIC))[_HEADER]
            ros1_store.register(known)
            self.definition: str = ros1_store.generate_msgdef(name, ros_version=1)[0]
            self.md5sum = definition_md5(self.name, self.definition)
        except Exception as error:  # rosbags raises what its parser raises
            raise DefinitionError("%s has no ROS 1 form (%s)" % (name, _short(error))) from error
        if "<=" in self.definition or "wstring" in self.definition:
            raise DefinitionError("%s has no ROS 1 form: ROS 1 has no bounded types and no wide strings" % name)

    def to_ros1(self, message: bytes) -> bytes:
        """Convert a CDR message to ROS 1's form; ``header.seq``, which ROS 2 does not have, is 0.

        Raises:
            DefinitionError: The definition does not describe these bytes.
        """
        try:
            if message[:2] == _BIG_ENDIAN:  # rosbags converts none of these directly
                message = bytes(self._store.serialize_cdr(
                    self._store.deserialize_cdr(message, self._ros2_name), self._ros2_name, little_endian=True))
            return bytes(self._store.cdr_to_ros1(message, self._ros2_name))
        except Exception as error:
            raise DefinitionError("a message of %s does not fit its definition" % self._ros2_name) from error
