"""Tool poses out of the columns of the driver's topic ``tool_position``; its type depends on the driver's interface."""
from typing import Iterable, NamedTuple, Optional

import numpy as np

from ..messages.batch import Array
from ..messages.columns import Columns
from ..units import mm_to_m

TWIST_TYPE = "geometry_msgs/TwistStamped"
POSE_TYPE = "geometry_msgs/PoseStamped"
"""Pose type of ``interface:=vendor_2025`` and of the maker's newest driver: mm and a quaternion."""
POSE_NAME = "tool_position"
POSE_FIELDS = {TWIST_TYPE: tuple("twist.%s.%s" % (part, axis) for part in ("linear", "angular") for axis in "xyz"),
               POSE_TYPE: (*["pose.position." + axis for axis in "xyz"],
                           *["pose.orientation." + axis for axis in "xyzw"])}
"""The fields that ``tool_poses`` needs, by type."""


class ToolPoses(NamedTuple):
    """Poses, one a row: position, m, and rotation vector, rad, both of shape (n, 3)."""

    position: Array
    rotation_vector: Array


def are_numbers(columns: Columns, names: Iterable[str]) -> bool:
    """Return whether a topic has fields of these names, and each is one number."""
    return all(name in columns.fields and columns.fields[name].ndim == 1 and columns.fields[name].dtype.kind in "iufb"
               for name in names)


def tool_poses(columns: Columns) -> Optional[ToolPoses]:
    """Return the poses of any TwistStamped, and of a PoseStamped called tool_position; None of other topics.

    A TwistStamped is taken as ``interface:=documented`` means it: m and rotation vectors.
    """
    datatype = columns.connection.datatype
    if not are_numbers(columns, POSE_FIELDS.get(datatype, ())):  # another definition under the same name
        return None
    if datatype == TWIST_TYPE:
        return ToolPoses(_stacked(columns, "twist.linear.", "xyz"), _stacked(columns, "twist.angular.", "xyz"))
    if datatype == POSE_TYPE and columns.connection.topic.rsplit("/", 1)[-1] == POSE_NAME:
        return ToolPoses(_stacked(columns, "pose.position.", "xyz") * mm_to_m(1.0),
                         rotation_vectors(_stacked(columns, "pose.orientation.", "xyzw")))
    return None


def rotation_vectors(quaternion: Array) -> Array:
    """Return rotation vectors, rad, of quaternions (x, y, z, w), shape (n, 4) to (n, 3); NaN where the norm is 0."""
    norm = np.sqrt((quaternion * quaternion).sum(axis=1))
    unit = quaternion / np.where(norm > 0.0, norm, np.nan)[:, None]
    unit = np.where(unit[:, 3:] < 0.0, -unit, unit)
    sine = np.sqrt((unit[:, :3] * unit[:, :3]).sum(axis=1))
    scale = np.where(sine > 0.0, 2.0 * np.arctan2(sine, unit[:, 3]) / np.where(sine > 0.0, sine, 1.0), 2.0)
    vectors: Array = unit[:, :3] * scale[:, None]
    return vectors


def _stacked(columns: Columns, prefix: str, axes: str) -> Array:
    return np.stack([columns.fields[prefix + axis] for axis in axes], axis=1)
