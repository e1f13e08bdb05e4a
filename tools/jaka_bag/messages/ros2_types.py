"""The only door to rosbags, whose interface changes between versions: CDR, ROS 2 definitions and type hashes."""
from typing import Any

from ..errors import DefinitionError, MissingDependency
from .connection import Connection

_BREAK = "=" * 80
_ROS2_HEADER = ("builtin_interfaces/Time stamp\nstring frame_id\n" + _BREAK
                + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n" + _BREAK
                + "\nMSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n")
_RENAMED = {"tf/tfMessage": "tf2_msgs/TFMessage"}  # the one ROS 1 type that ROS 2 knows under another name


def ros2_name(datatype: str) -> str:
    """``package/Type`` as ROS 2 writes it, ``package/msg/Type``."""
    package, _, name = _RENAMED.get(datatype, datatype).partition("/")
    return "%s/msg/%s" % (package, name)


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
        try:
            types = get_types_from_msg(connection.definition, self.name)
            types.update(get_types_from_msg(_ROS2_HEADER, "std_msgs/msg/Header"))
            self._store: Any = get_typestore(Stores.EMPTY)
            self._store.register(types)
            self.definition: str = self._store.generate_msgdef(self.name, ros_version=2)[0]
            self.type_hash: str = self._store.hash_rihs01(self.name)
        except Exception as error:  # rosbags raises what its parser raises
            raise DefinitionError("%s: the definition of %s has no ROS 2 form (%s)" % (
                connection.topic, connection.datatype, str(error) or type(error).__name__)) from error

    def to_cdr(self, message: bytes) -> bytes:
        """A serialised ROS 1 message as CDR.

        Raises:
            DefinitionError: The definition does not describe these bytes.
        """
        try:
            return bytes(self._store.ros1_to_cdr(message, self.name))
        except Exception as error:  # IndexError, struct.error, AssertionError: whatever the generated code meets
            raise DefinitionError("a message of %s does not fit its definition" % self.name) from error
