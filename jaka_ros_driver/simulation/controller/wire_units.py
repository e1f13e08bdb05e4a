"""Conversion of poses and joints between the wire (mm, deg) and the simulated arm (m, rad)."""
from typing import List, Sequence

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.state import Vector
from jaka_ros_driver.units import all_deg_to_rad, all_m_to_mm, all_mm_to_m, all_rad_to_deg

FEED_DECIMALS = 5
QUERY_DECIMALS = 6
"""Decimals of the feed and of the replies to queries (docs/controller-protocol.md section 4.2)."""


def rounded(values: Sequence[float], decimals: int = QUERY_DECIMALS) -> List[float]:
    """Return each value rounded; never -0.0."""
    return [round(value, decimals) + 0.0 for value in values]


def pose_from_wire(values: Vector) -> Pose:
    """Return [x, y, z, rx, ry, rz] in mm and deg as a Pose."""
    return Pose(all_mm_to_m(values[:3]), all_deg_to_rad(values[3:]))


def pose_to_wire(pose: Pose, decimals: int = QUERY_DECIMALS) -> List[float]:
    """Return a Pose as [x, y, z, rx, ry, rz] in mm and deg."""
    return rounded(all_m_to_mm(pose.position) + all_rad_to_deg(pose.rpy), decimals)


def joints_to_wire(joint_position: Vector, decimals: int = QUERY_DECIMALS) -> List[float]:
    """Return joint angles in deg."""
    return rounded(all_rad_to_deg(joint_position), decimals)
