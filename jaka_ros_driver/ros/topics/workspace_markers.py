"""The topic ``~workspace_markers``: the zones that the motion guard keeps, and its capsules of arm and tool, for rviz.

Zones are in the base frame. A capsule is in the frame of its link, so that tf moves it; flange and tool are in the
flange's.
"""
from typing import Any, List, Sequence, Tuple

from geometry_msgs.msg import Point

from jaka_ros_driver.clearance.shape import FLANGE_FRAME, arm_shape
from jaka_ros_driver.clearance.solids import Solid, solids_between, solids_of
from jaka_ros_driver.clearance.workspace import Box, Workspace
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import Vector3, rotation_vector_from_rpy
from jaka_ros_driver.ros.convert import quaternion
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.other_messages import message_type
from jaka_ros_driver.ros.topics.state_publishers import FrameNames

_Colour = Tuple[float, float, float, float]
_KEPT_OUT: _Colour = (0.847, 0.227, 0.18, 0.4)
_KEPT_IN: _Colour = (0.184, 0.631, 0.31, 0.9)
"""Colours of zones, as the panel draws them (``tools/jaka_panel/web/js/view/zones.js``)."""
_ARM: _Colour = (0.2, 0.45, 0.8, 0.5)
_TOOL: _Colour = (0.9, 0.6, 0.1, 0.5)
_FLOOR_EDGE, _FLOOR_DEPTH, _LINE = 4.0, 0.002, 0.006
"""Edge and depth of the floor, which has none, as it is shown, and width of the lines of a keep-in box, m."""
_CORNERS = tuple((x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5))
_EDGES = tuple((a, b) for n, a in enumerate(_CORNERS) for b in _CORNERS[n:] if sum(p != q for p, q in zip(a, b)) == 1)
_UNTURNED = (0.0, 0.0, 0.0)


class WorkspaceMarkers:
    """The publisher of the markers, latched: at the start, and when other zones are kept."""

    def __init__(self, model: ArmModel, names: FrameNames) -> None:
        self._model, self._names = model, names
        self._publisher = direct_publisher(
            "~workspace_markers", message_type("visualization_msgs/MarkerArray"), 1, latch=True)

    def publish(self, workspace: Workspace) -> None:
        """Publish these zones, this tool and the arm in place of all that was published before."""
        self._publisher.publish(marker_array(self._model, workspace, self._names))


def marker_array(model: ArmModel, workspace: Workspace, names: FrameNames) -> Any:
    """Return a visualization_msgs/MarkerArray; its first marker deletes those that were shown before."""
    markers = _Markers(names.base)
    for box in workspace.keep_out:
        markers.add("keep-out box " + box.name, markers.type.CUBE, box.centre, box.rpy, box.size, _KEPT_OUT)
    for zone in workspace.cylinders:
        x, y, z = zone.foot
        markers.add("cylinder " + zone.name, markers.type.CYLINDER, (x, y, z + 0.5 * zone.height), _UNTURNED,
                    (2.0 * zone.radius, 2.0 * zone.radius, zone.height), _KEPT_OUT)
    if workspace.floor is not None:
        markers.add("floor", markers.type.CUBE, (0.0, 0.0, workspace.floor - 0.5 * _FLOOR_DEPTH), _UNTURNED,
                    (_FLOOR_EDGE, _FLOOR_EDGE, _FLOOR_DEPTH), _KEPT_OUT)
    for box in workspace.keep_in:
        marker = markers.add("keep-in box " + box.name, markers.type.LINE_LIST, box.centre, box.rpy,
                             (_LINE, 0.0, 0.0), _KEPT_IN)
        marker.points = _edges_of(box)
    bare = len(arm_shape(model).capsules)
    for n, capsule in enumerate(arm_shape(model, workspace.tool).capsules):
        if capsule.frame == FLANGE_FRAME:
            markers.frame, solids = names.flange, solids_between(capsule.start, capsule.end)
        else:
            markers.frame = "%slink_%d" % (names.prefix, capsule.frame) if capsule.frame else names.base
            solids = solids_of(model, capsule)
        markers.add_capsule("arm" if n < bare else "tool " + capsule.name, solids, capsule.radius,
                            _ARM if n < bare else _TOOL)
    return markers.array


class _Markers:
    """The markers that are put together.

    Attributes:
        array: The message.
        type: The class of one marker.
        frame: The tf frame of what is added.
    """

    def __init__(self, frame: str) -> None:
        self.array = message_type("visualization_msgs/MarkerArray")()
        self.type = message_type("visualization_msgs/Marker")
        self.frame = frame
        self.array.markers.append(self.type(action=self.type.DELETEALL))
        self.array.markers[0].pose.orientation.w = 1.0

    def add(self, namespace: str, kind: int, centre: Vector3, rpy: Vector3, size: Vector3, colour: _Colour) -> Any:
        """Add a marker of this type, in m and rad, and return it; rviz can hide what is in one namespace."""
        marker = self.type(ns=namespace, id=len(self.array.markers), type=kind, action=self.type.ADD)
        marker.header.frame_id = self.frame
        marker.frame_locked = True
        place, turn = marker.pose.position, marker.pose.orientation
        place.x, place.y, place.z = centre
        turn.x, turn.y, turn.z, turn.w = quaternion(rotation_vector_from_rpy(rpy))
        marker.scale.x, marker.scale.y, marker.scale.z = size
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour
        self.array.markers.append(marker)
        return marker

    def add_capsule(self, namespace: str, solids: Sequence[Solid], radius: float, colour: _Colour) -> None:
        """Add a capsule, as a cylinder with a ball at either end."""
        width = 2.0 * radius
        for solid in solids:
            self.add(namespace, self.type.CYLINDER if solid.length else self.type.SPHERE, solid.centre, solid.rpy,
                     (width, width, solid.length or width), colour)


def _edges_of(box: Box) -> List[Point]:
    return [Point(*(share * size for share, size in zip(corner, box.size))) for edge in _EDGES for corner in edge]
