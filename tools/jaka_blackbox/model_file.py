"""The arm model file that the driver's parameter ``dh_file`` names.

Whoever may set a parameter chooses the path: only what is an arm model goes into a log that others get to see.
"""
import os
import stat
from typing import Any, Dict

from jaka_bag.errors import BagError

_LARGEST = 1 << 20
"""Largest model file, byte: far above that of any model."""
_DEEPEST = 20
"""Most levels of its YAML: far more than a model has."""
_ROWS = 6
_KEYS = {"family", "dh_standard", "joint_limits_deg", "joint_max_speed_deg_s"}
_MORE_KEYS = {"name", "tcp_max_speed_m_s", "joint_max_acceleration_deg_s2", "tcp_max_acceleration_m_s2",
              "dh_confidence", "note", "sources", "payload_kg_by_name", "joint_max_speed_urdf_rad_s", "dh_alternatives",
              "joint_limits_alternatives_deg", "joint_max_speed_alternatives_deg_s"}
"""Keys that a model file may have besides (``jaka_ros_driver.kinematics.arm_models``)."""


def read_model_file(path: str) -> bytes:
    """Return the content of a model file; a pipe or a device is not waited for.

    Raises:
        BagError: It cannot be read, or is no arm model file of at most 1 MB.
    """
    try:
        data = _read(path)
    except (OSError, ValueError) as error:  # ValueError: a path that is none
        raise BagError("cannot be read: %s" % (getattr(error, "strerror", None) or error)) from error
    if not _is_model(_parsed(data)):
        raise BagError("is no arm model file")
    return data


def _read(path: str) -> bytes:
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise BagError("is no regular file")
        data = file.read(_LARGEST + 1)
    if len(data) > _LARGEST:
        raise BagError("has more than 1 MB")
    return data


def _parsed(data: bytes) -> Any:
    """Return the file as YAML's nodes, of which no value is made: merged keys and long numbers take for ever."""
    import yaml  # where no parameter names a file, nothing is parsed
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    depth = 0
    try:
        for event in yaml.parse(data, loader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                return None
        return yaml.compose(data, loader)
    except (yaml.YAMLError, ValueError):
        return None


def _entries(node: Any) -> Dict[Any, Any]:
    """Return the nodes of a mapping by key; none where it is no mapping."""
    if node is None or node.id != "mapping":
        return {}
    return {str(key.value): value for key, value in node.value if key.id == "scalar"}


def _is_model(node: Any) -> bool:
    model = _entries(node)
    if not _KEYS <= set(model) <= _KEYS | _MORE_KEYS or len(model) != len(node.value):
        return False
    rows = model["dh_standard"]
    return rows.id == "sequence" and len(rows.value) == _ROWS and all(map(_is_row, rows.value))


def _is_row(node: Any) -> bool:
    """Return whether a node has a joint's parameters, or merges mappings, which are not looked into."""
    row = _entries(node)
    merged = row.get("<<")
    some = merged.value if merged is not None and merged.id == "sequence" else [merged]
    return {"a", "d", "alpha"} <= set(row) or any(some) and all(map(_entries, some))
