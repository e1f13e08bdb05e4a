"""The judge of the package's output: rosbags, over the differences of its generations."""
from pathlib import Path
from typing import Any, Dict, List, Tuple

from rosbags.typesys import Stores, get_types_from_msg, get_typestore


def typestore_of(connections) -> Any:
    """Return a store with the ROS 1 types of some connections."""
    store = get_typestore(Stores.EMPTY)
    types: Dict[str, Any] = {}
    for connection in connections:
        types.update(get_types_from_msg(connection.definition, connection.datatype.replace("/", "/msg/")))
    for name in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"):
        types.update(get_types_from_msg("int32 sec\nuint32 nanosec", name))
    store.register(types)
    return store


def decoded(store: Any, connection, data: bytes) -> Any:
    """Return one ROS 1 message as an object with its fields."""
    return store.deserialize_ros1(data, connection.datatype.replace("/", "/msg/"))


def read_rosbag2(folder: Path) -> List[Tuple[str, str, int, bytes]]:
    """Return (topic, type, time, CDR) of a rosbag2 folder."""
    from rosbags.rosbag2 import Reader
    with Reader(folder) as reader:
        return [(c.topic, c.msgtype, time, bytes(data)) for c, time, data in reader.messages()]
