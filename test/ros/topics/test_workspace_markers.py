"""~workspace_markers: zones and capsules as rviz shows them, and the type on the wire."""
import io
import math
import re
from types import SimpleNamespace

import pytest

from jaka_ros_driver.clearance.shape import arm_shape
from jaka_ros_driver.clearance.workspace import NO_ZONES, workspace_of
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import link_transforms
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy
from jaka_ros_driver.ros import other_messages
from jaka_ros_driver.ros.topics import workspace_markers
from jaka_ros_driver.ros.topics.workspace_markers import WorkspaceMarkers, marker_array

NAMES = SimpleNamespace(prefix="left_", base="left_base_link", flange="left_tool0")
CUBE, SPHERE, CYLINDER, LINE_LIST, DELETEALL = 1, 2, 3, 5, 3
BOX = {"name": "press", "centre": [0.6, 0.1, 0.2], "size": [0.3, 0.4, 0.5], "rpy": [0.2, -0.3, 0.5]}
CELL = workspace_of({
    "keep_out": [BOX], "keep_in": [dict(BOX, name="cell")], "floor": -0.1,
    "cylinders": [{"name": "post", "foot": [0.0, -0.8, 0.1], "height": 1.5, "radius": 0.06}],
    "tool": [{"name": "gripper", "start": [0.0, 0.0, 0.0], "end": [0.03, 0.0, 0.15], "radius": 0.04}]})
MODELS = ["zu7", "a12", "minicobo"]


def markers_of(workspace, model="zu7"):
    """Return the markers as a listener reads them."""
    written = io.BytesIO()
    marker_array(load_model(model), workspace, NAMES).serialize(written)
    read = other_messages.made_type("visualization_msgs/MarkerArray")().deserialize(written.getvalue())
    return read.markers


def in_namespace(markers, name):
    return [marker for marker in markers if marker.ns == name]


def place_of(marker):
    return marker.pose.position.x, marker.pose.position.y, marker.pose.position.z


def size_of(marker):
    return marker.scale.x, marker.scale.y, marker.scale.z


def turned(marker, vector):
    """Return a vector of the marker's frame in the frame of its header."""
    q, (x, y, z) = marker.pose.orientation, vector
    tx, ty, tz = 2.0 * (q.y * z - q.z * y), 2.0 * (q.z * x - q.x * z), 2.0 * (q.x * y - q.y * x)
    return (x + q.w * tx + q.y * tz - q.z * ty, y + q.w * ty + q.z * tx - q.x * tz,
            z + q.w * tz + q.x * ty - q.y * tx)


def in_base(transform, point):
    r, (x, y, z) = transform, point
    return tuple(r[3 * n] * x + r[3 * n + 1] * y + r[3 * n + 2] * z + r[9 + n] for n in range(3))


def rotated(rpy, vector):
    return in_base((*matrix_from_rpy(rpy), 0.0, 0.0, 0.0), vector)


def test_the_type_of_our_own_is_the_published_one_on_the_wire():
    for name, md5sum in (("Marker", "4048c9de2a16f4ae8e0538085ebf1b97"),
                         ("MarkerArray", "d155b9ce5188fbaf89745847fd5882d7")):
        assert other_messages.made_type("visualization_msgs/" + name)._md5sum == md5sum


def test_zones_stand_in_the_base_frame_where_the_guard_keeps_them():
    markers = markers_of(CELL)
    box, = in_namespace(markers, "keep-out box press")
    assert box.type == CUBE and place_of(box) == (0.6, 0.1, 0.2) and size_of(box) == (0.3, 0.4, 0.5)
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        assert turned(box, axis) == pytest.approx(rotated(BOX["rpy"], axis), abs=1e-12)
    post, = in_namespace(markers, "cylinder post")
    assert post.type == CYLINDER and place_of(post) == pytest.approx((0.0, -0.8, 0.85))
    assert size_of(post) == (0.12, 0.12, 1.5) and post.pose.orientation.w == 1.0
    floor, = in_namespace(markers, "floor")
    assert floor.type == CUBE and floor.pose.position.z + 0.5 * floor.scale.z == pytest.approx(-0.1)
    assert (floor.pose.position.x, floor.pose.position.y) == (0.0, 0.0), "under the arm"
    assert {marker.header.frame_id for marker in (box, post, floor)} == {NAMES.base}


def test_a_keep_in_box_is_its_twelve_edges():
    cell, = in_namespace(markers_of(CELL), "keep-in box cell")
    assert cell.type == LINE_LIST and cell.header.frame_id == NAMES.base and len(cell.points) == 24
    ends = [(p.x, p.y, p.z) for p in cell.points]
    edges = {frozenset(pair) for pair in zip(ends[::2], ends[1::2])}
    assert sorted(round(math.dist(*edge), 9) for edge in edges) == [0.3] * 4 + [0.4] * 4 + [0.5] * 4
    box = CELL.keep_in[0].signed_distance()
    for end in set(ends):
        corner = tuple(c + d for c, d in zip(place_of(cell), turned(cell, end)))
        assert box(*corner) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_a_capsule_stands_in_the_frame_of_its_link_where_the_guard_has_it(name):
    model, joints = load_model(name), (0.3, 1.1, -0.9, 0.7, 1.2, -0.4)
    frames = link_transforms(model, joints)
    markers = [m for m in markers_of(CELL, name) if m.ns == "arm" or m.ns.startswith("tool ")]

    def link_at(marker):
        """Return ``base_t_link`` of a marker's link: the DH frame before it, turned by the joint about its z."""
        frame = marker.header.frame_id
        if frame in (NAMES.base, NAMES.flange):
            return frames[6 if frame == NAMES.flange else 0]
        number = int(frame[len(NAMES.prefix + "link_"):])
        before, angle = frames[number - 1], joints[number - 1] + model.dh[number - 1].theta_offset
        c, s = math.cos(angle), math.sin(angle)
        turned_about_z = [entry for row in range(3) for entry in (
            c * before[3 * row] + s * before[3 * row + 1], c * before[3 * row + 1] - s * before[3 * row],
            before[3 * row + 2])]
        return (*turned_about_z, *before[9:])

    shown = []
    for marker in markers:
        link = link_at(marker)
        half = 0.5 * marker.scale.z if marker.type == CYLINDER else 0.0
        ends = [tuple(p + d for p, d in zip(place_of(marker), turned(marker, (0.0, 0.0, sign * half))))
                for sign in (-1.0, 1.0)]
        shown.append((marker, [in_base(link, end) for end in ends]))
    for capsule in arm_shape(model, CELL.tool).capsules:
        start, end = (in_base(frames[capsule.frame], point) for point in (capsule.start, capsule.end))
        for kind, wanted in ((SPHERE, [start, start]), (SPHERE, [end, end]), (CYLINDER, [start, end])):
            assert any(marker.type == kind and marker.scale.x == pytest.approx(2.0 * capsule.radius)
                       and all(math.dist(a, b) < 1e-9 for a, b in zip(ends, wanted)) for marker, ends in shown), (
                capsule.name, kind)
    assert {m.ns for m, _ in shown} == {"arm", "tool gripper"}


@pytest.mark.parametrize("workspace, most", [(NO_ZONES, {"arm", ""}), (CELL, None)])
def test_each_message_replaces_all_that_was_shown_and_moves_with_tf(workspace, most):
    first, *others = markers_of(workspace)
    assert first.action == DELETEALL and all(marker.action == 0 for marker in others)
    assert most is None or {marker.ns for marker in (first, *others)} == most
    assert len({marker.id for marker in others}) == len(others)
    for marker in others:
        q = marker.pose.orientation
        assert q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w == pytest.approx(1.0)
        assert marker.frame_locked and marker.header.stamp.to_nsec() == 0 and marker.color.a > 0.0
        assert marker.lifetime.to_nsec() == 0


def test_the_topic_is_latched(monkeypatch):
    made, published = [], []

    def publisher(name, kind, queue_size, latch=False):
        made.append((name, kind._type, latch))
        return SimpleNamespace(publish=published.append)
    monkeypatch.setattr(workspace_markers, "direct_publisher", publisher)
    markers = WorkspaceMarkers(load_model("zu7"), NAMES)
    assert made == [("~workspace_markers", "visualization_msgs/MarkerArray", True)] and not published
    markers.publish(CELL)
    assert len(published) == 1 and len(in_namespace(published[0].markers, "cylinder post")) == 1


def test_zones_have_the_colours_that_the_panel_gives_them(root):
    script = (root / "tools/jaka_panel/web/js/view/zones.js").read_text(encoding="utf-8")
    out, within = (re.search(r"const %s = 0x(..)(..)(..);" % name, script).groups() for name in ("OUT", "WITHIN"))
    shown = {marker.ns.partition(" ")[0]: marker.color for marker in markers_of(CELL)}
    for kind, colour in (("keep-out", out), ("cylinder", out), ("floor", out), ("keep-in", within)):
        assert [shown[kind].r, shown[kind].g, shown[kind].b] == pytest.approx(
            [int(part, 16) / 255.0 for part in colour], abs=0.002), kind
        assert 0.3 < shown[kind].a <= 1.0, "visible"
