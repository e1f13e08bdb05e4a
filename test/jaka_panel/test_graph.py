"""The panel's side of the ROS graph without a graph: bytes, rotations, descriptions, requests."""
import io
import math
import random
import threading
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from jaka_msgs.msg import RobotMsg
from jaka_msgs.srv import SetIORequest
from jaka_panel.graph import raw_messages, requests, rotations
from jaka_panel.graph.arm_feed import _whole
from jaka_panel.graph.description import Description
from jaka_panel.graph.motion_lists import StopWatch
from jaka_panel.graph.requests import WrongRequest, flag, number, numbers, output_of, text, whole
from jaka_panel.pages.files import page_file
from jaka_panel.pages.hub import behind_a_sample
from jaka_panel.plans.plan_store import PlanStore
from jaka_panel.plans.point_plan import WrongPlan, plan_of_points
from jaka_ros_driver.ros.other_messages import message_type

SIX = [0.1, -0.2, 0.3, -0.4, 0.5, -0.6]
URDF = """<robot name="a"><link name="l"><visual><geometry><mesh filename="%s"/></geometry></visual></link>%s</robot>"""
JOINT = '<joint name="left_joint_%d" type="revolute"><limit lower="-1" upper="2" velocity="3" effort="0"/></joint>'


def raw(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def stamped(message, frame_id="a frame"):
    message.header.stamp.secs, message.header.stamp.nsecs, message.header.frame_id = 12, 345, frame_id
    return message


def test_fields_out_of_the_bytes_are_those_that_were_put_in():
    names = ["joint_%d" % n for n in range(1, 7)]
    joints = stamped(JointState(name=names, position=SIX, velocity=SIX[::-1]))
    assert raw_messages.joint_state(raw(joints)) == (12000000345, tuple(SIX), tuple(SIX[::-1]))
    joints.velocity = []
    assert raw_messages.joint_state(raw(joints))[2] is None
    twist = stamped(TwistStamped(twist=Twist(Vector3(*SIX[:3]), Vector3(*SIX[3:]))))
    head, values = raw_messages.six_numbers(raw(twist))
    assert (head.stamp_ns, head.frame_id, values) == (12000000345, "a frame", tuple(SIX))
    assert raw_messages.robot_states(raw(RobotMsg(3, 1, 0, 1))) == (3, 1, 0, 1)
    array = Float64MultiArray(MultiArrayLayout([MultiArrayDimension("joint", 6, 6)], 0), SIX)
    assert raw_messages.number_array(raw(array)) == tuple(SIX)


def test_types_of_packages_that_are_not_installed_are_read():
    status = stamped(message_type("industrial_msgs/RobotStatus")())
    status.mode.val, status.e_stopped.val, status.in_error.val, status.error_code = 2, 1, -1, 77
    assert raw_messages.robot_status(raw(status)) == (12000000345, (2, 1, 0, 0, 0, -1, 77))
    state = stamped(message_type("control_msgs/JointTrajectoryControllerState")())
    state.joint_names = ["a", "bb"]
    for point, values in ((state.desired, SIX), (state.actual, SIX[::-1]), (state.error, [0.0] * 6)):
        point.positions, point.velocities = values, values
    assert raw_messages.controller_state(raw(state)) == (12000000345, tuple(SIX), (0.0,) * 6)


def test_the_output_that_a_call_sets_is_known_by_its_request():
    request = SetIORequest(signal="analog", type=2, index=7, value=1.5)
    assert output_of(str(request)) == ("extension", "analog", 7)


def test_pages_are_told_between_two_samples():
    for due in (100.0, 100.001, 100.0049, 100.0077, 100.25):
        told = behind_a_sample(due, 99.9996)
        assert due <= told < due + 0.008 and (told - 99.9996) % 0.008 == pytest.approx(0.0025, abs=1e-9)
    assert behind_a_sample(100.0, -1e9) == 100.0 and behind_a_sample(100.0, 99.0) == 100.0, "no sample to go by"


def test_rotations_there_and_back():
    rolls = random.Random(1)
    for _ in range(300):
        vector = [rolls.uniform(-1.7, 1.7) for _ in range(3)]
        assert rotations.vector_from_rpy(rotations.rpy_from_vector(vector)) == pytest.approx(vector, abs=1e-9)
        x, y, z, w = rotations.quaternion_from_vector(vector)
        assert rotations.vector_from_quaternion(-x, -y, -z, -w) == pytest.approx(vector, abs=1e-9)
    for pitch in (0.5 * math.pi, -0.5 * math.pi):
        vector = rotations.vector_from_rpy([0.3, pitch, 0.2])
        assert rotations.vector_from_rpy(rotations.rpy_from_vector(vector)) == pytest.approx(vector, abs=1e-6)
    assert rotations.vector_from_rpy([0.0, 0.0, 0.0]) == [0.0, 0.0, 0.0]


def test_only_meshes_that_the_description_names_are_served(tmp_path):
    for name in ("link.stl", "other.stl", "skin.png", "secret.txt"):
        (tmp_path / name).write_text("x")
    mesh = "file://%s/link.stl" % tmp_path
    about = Description(URDF % (mesh, ""))
    assert about.mesh_file(mesh) == str(tmp_path / "link.stl")
    assert about.mesh_file("file://%s/skin.png" % tmp_path) == str(tmp_path / "skin.png")
    for other in ("other.stl", "secret.txt", "../x.png", "absent.png", ""):
        assert about.mesh_file("file://%s/%s" % (tmp_path, other)) is None
    for named in ("file:///etc/passwd", "package://roslib/../../../../../etc/passwd", "http://evil.example/x.stl",
                  "package://no_such_package/x.stl", "file://[x.stl"):
        assert Description(URDF % (named, "")).mesh_file(named) is None


def test_limits_are_those_of_six_joints_in_their_order_and_no_entity_is_expanded():
    about = Description(URDF % ("", "".join(JOINT % n for n in (3, 1, 2, 6, 5, 4))))
    assert [joint["name"] for joint in about.joints] == ["left_joint_%d" % n for n in range(1, 7)]
    assert about.joints[0] == {"name": "left_joint_1", "lower": -1.0, "upper": 2.0, "velocity": 3.0}
    assert Description(URDF % ("", JOINT % 1)).joints is None and Description("no xml <").joints is None
    whole_text = URDF % ("", "".join(JOINT % n for n in range(1, 7)))
    assert Description(whole_text).joints and Description('<!DOCTYPE x [<!ENTITY a "b">]>' + whole_text).joints is None


@pytest.mark.parametrize("read, args", [
    (lambda a: number(a, "x"), {"x": "1"}), (lambda a: number(a, "x"), {"x": float("nan")}),
    (lambda a: number(a, "x"), {}), (lambda a: number(a, "x"), {"x": True}), (lambda a: whole(a, "x"), {"x": 1.0}),
    (lambda a: whole(a, "x"), {"x": -1}), (lambda a: flag(a, "x"), {"x": 1}),
    (lambda a: text(a, "x"), {"x": "y" * 101}), (lambda a: text(a, "x", ("a",)), {"x": "b"}),
    (lambda a: numbers(a, "x", 6), {"x": [1.0] * 5}), (lambda a: numbers(a, "x", 1), {"x": [None]})])
def test_fields_of_a_wrong_kind_are_named(read, args):
    with pytest.raises(WrongRequest, match="x must be"):
        read(args)


def test_a_plan_goes_through_its_points():
    rest = [0.0] * 6
    plan = plan_of_points([{"t": 0.0, "q": rest, "v": rest}, {"t": 2.0, "q": SIX, "v": rest}], None)
    shown = plan.shown("k1")
    assert shown["path"][0] == rest and shown["path"][-1] == SIX and shown["duration"] == 2.0
    half = shown["path"][len(shown["path"]) // 2]
    assert all(min(0.0, end) - 1e-6 <= value <= max(0.0, end) + 1e-6 for value, end in zip(half, SIX))
    later = plan_of_points([{"t": 3.0, "q": SIX}], None)
    assert not later.begins_here and later.shown("k2")["path"] == [SIX]


def test_a_line_is_sent_only_where_its_joints_still_are_its_target(monkeypatch):
    target, sent = {"p": [0.4, 0.1, 0.2], "r": [0.0, 0.0, 0.5], "speed": 0.1}, []
    shown = [400.0, 100.0, 200.0, 0.0, 0.0, 0.5]

    def call(driver, name, kind, **fields):
        if name == "get_fk":
            return SimpleNamespace(cartesian_pose=list(shown), message="fk")
        sent.append((name, fields["pose"]))
        return SimpleNamespace(success=True, message="")
    monkeypatch.setattr(requests, "_call", call)
    driver, line = SimpleNamespace(interface="documented"), requests.REQUESTS["linear_move"].perform
    assert line(driver, target).ok and line(driver, dict(target, q=SIX)).ok and len(sent) == 2
    for axis, by in ((0, 1.0), (5, 0.02)):  # the user frame is another one, or has other values; so for the tool
        shown[axis] += by
        with pytest.raises(WrongRequest, match="tool or user frame"):
            line(driver, dict(target, q=SIX))
        shown[axis] -= by
    shown[:] = [9999.0] * 6
    assert not line(driver, dict(target, q=SIX)).ok and line(driver, target).ok
    assert [name for name, _ in sent] == ["linear_move"] * 3


def test_a_plan_of_a_panel_that_was_started_again_is_not_taken_for_one_of_before():
    plan, before, after = plan_of_points([{"t": 1.0, "q": SIX}], None), PlanStore(), PlanStore()
    names = [store.put("/arm", plan) for store in (before, before, after, after)]
    assert len(set(names)) == 4 and before.get("/arm", names[1]) is plan
    for arm, name in (("/arm", names[1]), ("/other", names[2]), ("/arm", None)):
        with pytest.raises(WrongPlan, match="no such plan"):
            after.get(arm, name)


@pytest.mark.parametrize("points", [
    [], "x", [1], [{"t": 0.0, "q": SIX}], [{"t": -1.0, "q": SIX}], [{"t": 1.0, "q": SIX[:5]}], [{"t": "1", "q": SIX}],
    [{"t": 1.0, "q": SIX}, {"t": 1.0, "q": SIX}], [{"t": 1.0, "q": SIX, "v": SIX}, {"t": 2.0, "q": SIX}],
    [{"t": 1.0, "q": [5.0] * 6}], [{"t": 1.0, "q": [float("inf")] * 6}]])
def test_points_that_make_no_plan(points):
    with pytest.raises(WrongPlan):
        plan_of_points(points, [{"lower": -1.0, "upper": 1.0}] * 6)


def test_files_of_the_page_are_those_below_its_folder(tmp_path):
    (tmp_path / "web" / "js").mkdir(parents=True)
    for name in ("web/index.html", "web/js/a.js", "web/.secret.js", "web/x.py", "above.js"):
        (tmp_path / name).write_text("x")
    (tmp_path / "web" / "link.js").symlink_to(tmp_path / "above.js")
    web = tmp_path / "web"
    assert page_file("js/a.js", web).kind == "text/javascript" and page_file("index.html", web).is_text
    for name in ("", "js", "js/", "../above.js", "js/../../above.js", ".secret.js", "x.py", "link.js", "/above.js",
                 "no.js", "js\\a.js", "a\0.js"):
        assert page_file(name, web) is None


def test_a_stop_of_anybody_ends_a_list_also_while_its_path_is_sent():
    feed, cancelled = SimpleNamespace(stops=3), threading.Event()
    has_control = [True]
    watch = StopWatch(feed, cancelled, lambda: has_control[0])
    assert not watch.is_set()
    feed.stops = 4
    assert watch.is_set() and watch.is_stopped
    watch = StopWatch(feed, cancelled, lambda: has_control[0])
    has_control[0] = False
    assert watch.is_set() and not watch.is_stopped, "lost control ends it, too"
    cancelled.set()
    assert watch.is_set() and watch.is_stopped


@pytest.mark.parametrize("told,taken", [("2", 2), ("-1", -1), (None, None), ("", None), ("--1", None), ("²", None),
                                        ("9" * 5000, None), ("1.0", None)])
def test_numbers_of_a_report_are_taken_where_they_are_numbers(told, taken):
    assert _whole(told) == taken
