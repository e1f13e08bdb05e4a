"""The URDF generated from an arm's DH table, so that robot_state_publisher's frames equal ours.

Joint n's frame in the URDF is DH frame n-1 with z along axis n, turned by the DH row's angle offset; link_n therefore
carries what DH frame n carries, before the row's shift along d, a and twist alpha, which stand in the origin of the
next joint (and of the fixed joint to the tool link). Visuals are cylinders and boxes: no meshes. Collision geometry is
the caller's (``clearance/collision_urdf.py`` makes it).
"""
import math
from types import MappingProxyType
from typing import List, Mapping, Sequence, Tuple
from xml.sax.saxutils import quoteattr

from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel, DhRow
from jaka_ros_driver.kinematics.limits import stream_limits, top_joint_speeds
from jaka_ros_driver.kinematics.rotations import rpy_from_matrix

_EFFORT_UNKNOWN = 0.0
"""Effort limit, N m; URDF requires the attribute, and no source gives a value."""
_RADIUS = 0.12
"""Radius of a link's cylinder as a share of the arm's longest link."""


def urdf_from_model(model: ArmModel, prefix: str = "", base_link: str = "base_link", tool_link: str = "tool0",
                    collisions: Mapping[int, Sequence[str]] = MappingProxyType({})) -> str:
    """Return the URDF text of the arm: ``base_link``, ``link_1`` .. ``link_6``, ``tool0``; ``joint_1`` .. ``joint_6``.

    Its joints have the range in which streams stay (``stream_limits``), and their highest speeds
    (``top_joint_speeds``): what plans with it is neither led elsewhere nor refused.

    Args:
        model: The arm.
        prefix: Put in front of every link and joint name, for several arms in one tree.
        base_link: Name of the base link; its frame is the base frame.
        tool_link: Name of the last link; its frame is the flange (DH frame 6).
        collisions: The ``<collision>`` elements of each link, by its number: 0 the base, 1 to 6.
    """
    radius = _RADIUS * max(max(abs(row.a), abs(row.d)) for row in model.dh)
    links = ["link_%d" % n for n in range(1, JOINT_COUNT + 1)]
    lines = ['<?xml version="1.0"?>',
             "<!-- Generated from the DH table of the model; visuals are schematic. -->",
             "<robot name=%s>" % quoteattr(prefix + model.name),
             '  <material name="arm"><color rgba="0.85 0.87 0.9 1"/></material>',
             '  <material name="joint"><color rgba="0.2 0.35 0.6 1"/></material>']
    lines += _link(prefix + base_link, _cylinder(radius * 1.2, radius * 0.6, (0.0, 0.0, radius * 0.3), "joint")
                   + list(collisions.get(0, ())))
    for n, (link, row) in enumerate(zip(links, model.dh), 1):
        lines += _link(prefix + link, _body(row, radius) + list(collisions.get(n, ())))
    lines += _link(prefix + tool_link, _cylinder(radius * 0.6, radius * 0.1, (0.0, 0.0, -radius * 0.05), "joint"))
    parent, shift = base_link, DhRow(0.0, 0.0, 0.0)
    for joint, link, row, (low, high), speed in zip(
            JOINTS, links, model.dh, stream_limits(model), top_joint_speeds(model)):
        lines += [
            "  <joint name=%s type=\"revolute\">" % quoteattr(prefix + joint),
            "    <parent link=%s/>" % quoteattr(prefix + parent),
            "    <child link=%s/>" % quoteattr(prefix + link),
            "    " + _origin(shift, row.theta_offset),
            '    <axis xyz="0 0 1"/>',
            '    <limit lower="%r" upper="%r" effort="%r" velocity="%r"/>'
            % (low, high, _EFFORT_UNKNOWN, speed),
            "  </joint>"]
        parent, shift = link, row
    lines += ["  <joint name=%s type=\"fixed\">" % quoteattr(prefix + tool_link + "_joint"),
              "    <parent link=%s/>" % quoteattr(prefix + parent),
              "    <child link=%s/>" % quoteattr(prefix + tool_link),
              "    " + _origin(shift, 0.0),
              "  </joint>", "</robot>"]
    return "\n".join(lines) + "\n"


def _origin(row: DhRow, next_offset: float) -> str:
    """Return Tz(d) Tx(a) Rx(alpha) Rz(next_offset) as URDF writes it (rpy: R = Rz Ry Rx)."""
    ca, sa = math.cos(row.alpha), math.sin(row.alpha)
    c, s = math.cos(next_offset), math.sin(next_offset)
    rpy = rpy_from_matrix((c, -s, 0.0, ca * s, ca * c, -sa, sa * s, sa * c, ca))
    return '<origin xyz="%r 0 %r" rpy="%r %r %r"/>' % ((row.a, row.d) + rpy)


def _link(name: str, elements: List[str]) -> List[str]:
    return ["  <link name=%s>" % quoteattr(name)] + ["    " + element for element in elements] + ["  </link>"]


def _body(row: DhRow, radius: float) -> List[str]:
    """Return the visuals of a link: a cylinder at the joint, one along d, and a box along a."""
    visuals = _cylinder(radius, radius * 1.6, (0.0, 0.0, 0.0), "joint")
    if row.d:
        visuals += _cylinder(radius * 0.8, abs(row.d), (0.0, 0.0, 0.5 * row.d), "arm")
    if row.a:
        box = '<box size="%r %r %r"/>' % (abs(row.a), radius, radius)
        visuals.append(_visual((0.5 * row.a, 0.0, row.d), box, "arm"))
    return visuals


def _cylinder(radius: float, length: float, centre: Tuple[float, float, float], material: str) -> List[str]:
    return [_visual(centre, '<cylinder radius="%r" length="%r"/>' % (radius, length), material)]


def _visual(centre: Tuple[float, float, float], shape: str, material: str) -> str:
    return ('<visual><origin xyz="%r %r %r"/><geometry>%s</geometry><material name="%s"/></visual>'
            % (centre + (shape, material)))
