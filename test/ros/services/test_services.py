"""Each service on the running node: one good call through the real node, and a table of bad ones."""
import contextlib
import json
import math

import genpy
import pytest
import rospy
import rosservice as rosservice_library
import yaml
from driver_bench import HOME, SimulatorProcess, evidence_of, rosservice
from import_graph import ROOT
from reference_values import reference_values
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import eventually

from jaka_msgs.srv import Move, MoveRequest, MoveResponse
from jaka_ros_driver.ros.services.table import SERVICES

FAST = {"mvvelo": 3.0, "mvacc": 12.0}
LINE = [420.0, 100.0, 370.0, 2.2214, -2.2214, 0.0]
NAN = math.nan


def text(**fields):
    return "{%s}" % ", ".join("%s: %s" % item for item in fields.items())


def beside_the_present_pose(arm):
    x, y, z, *rpy = arm.simulator.state()["tcp_pose"]
    return text(pose=[x / 1000.0 + 0.005, y / 1000.0, z / 1000.0] + [math.radians(angle) for angle in rpy])


def with_a_trajectory_under_way(arm):
    publisher = rospy.Publisher("/jaka_zu7_controller/command", JointTrajectory, queue_size=1)
    assert eventually(lambda: publisher.get_num_connections())
    publisher.publish(joint_names=["joint_%d" % n for n in range(1, 7)], points=[JointTrajectoryPoint(
        positions=HOME, time_from_start=rospy.Duration(20.0))])
    assert eventually(arm.simulator.is_moving)
    return ""


@pytest.fixture(scope="module")
def simulator():
    """Start a simulated controller with a force sensor, for the service that zeroes it."""
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--force-sensor")) as process:
        yield process


@pytest.fixture
def rested(arm):
    yield arm
    arm.call("stop_move")
    arm.call("servo_move_enable", enable=False)
    assert eventually(lambda: not arm.simulator.is_moving())


@pytest.fixture
def idle(arm):
    """Wait until the driver moves nothing, and no more watches an arm that it was refused to move."""
    assert eventually(lambda: "this driver moves nothing" in arm.call("pause").message)
    return arm


# One good call each, through the program; what the answer must contain; what must be true of the arm afterwards.
GOOD = [
    ("joint_move", text(pose=HOME, **FAST), {"ret": 1},
     lambda s: abs(s["joint_position"][1] - math.degrees(1.5)) < 0.01),
    ("servo_move_enable", "enable: true", {"ret": 1}, lambda s: s["is_servo_active"]),
    ("servo_j", text(pose=[0.02] + HOME[1:]), {"ret": 1},
     lambda s: abs(s["joint_position"][0] - math.degrees(0.02)) < 0.01),
    ("servo_p", beside_the_present_pose, {"ret": 1}, lambda s: True),
    ("servo_move_enable", "enable: false", {"ret": 1}, lambda s: not s["is_servo_active"]),
    ("linear_move", text(pose=LINE, mvvelo=500.0, mvacc=4000.0), {"ret": 1},
     lambda s: abs(s["tcp_pose"][0] - 420.0) < 0.1 and abs(s["tcp_pose"][2] - 370.0) < 0.1),
    ("jog", text(mvvelo=0.2, index=1), {"ret": 1}, lambda s: s["joint_velocity"][0] < 0.0),
    ("stop_move", "", {}, lambda s: not s["is_moving"]),
    ("set_toolframe", text(pose=[0.0, 0.0, 120.0, 0.0, 0.0, 0.0], tool_num=2), {"ret": 1}, lambda s: s["tool_id"] == 2),
    ("set_userframe", text(pose=[10.0, 0.0, 0.0, 0.0, 0.0, 0.5], user_num=3), {"ret": 1},
     lambda s: s["user_frame_id"] == 3),
    ("set_payload", text(tool_num=0, mass=1.5, xc=0.0, yc=0.0, zc=40.0), {"ret": 1},
     lambda s: s["payload"]["mass"] == 1.5 and s["tool_id"] == 0),
    ("drag_mode", "true", {"success": True}, lambda s: s["is_hand_guided"]),
    ("drag_move", "false", {"success": True}, lambda s: not s["is_hand_guided"]),
    ("set_speed_slider", text(speed_slider_fraction=0.5), {"success": True, "message": "speed 50 %"}, lambda s: True),
    ("set_speed_slider", text(speed_slider_fraction=1.0), {"success": True}, lambda s: True),
    ("set_collisionlevel", text(is_enable="true", value=60), {"ret": 1}, lambda s: s["collision_level"] == 3),
    ("get_settings", "", {"success": True}, lambda s: True),
    ("set_io", text(signal="digital", type=0, index=2, value=1.0), {"ret": 1}, lambda s: s["digital_outputs"][2] == 1),
    ("get_io", text(signal="digital", path=1, type=0, index=2), {"value": 1.0}, lambda s: True),
    ("zero_ftsensor", "", {"success": True, "message": "the force sensor reads zero"}, lambda s: True),
    ("clear_err", "", {"ret": 1}, lambda s: s["errcode"] == "0x0"),
    ("get_fk", text(joint=HOME), {"message": "pose of the active tool in the active user frame"}, lambda s: True),
    ("get_ik", text(ref_joint=HOME, cartesian_pose=[400.0, 100.0, 350.0, 3.1, 0.0, -1.5]),
     {"message": "solution nearest to the reference"}, lambda s: True),
    ("enable", "false", {"success": True}, lambda s: not s["is_enabled"]),
    ("power", "false", {"success": True}, lambda s: not s["is_powered"]),
    ("power", "true", {"success": True}, lambda s: s["is_powered"]),
    ("enable", "true", {"success": True}, lambda s: s["is_enabled"]),
    ("enable", "false", {"success": True}, lambda s: not s["is_enabled"]),
    ("recover", "", {"success": True, "message": "the arm is ready: enable"}, lambda s: s["is_enabled"]),
    ("pause", with_a_trajectory_under_way, {"success": True}, lambda s: not s["is_moving"]),
    ("resume", "", {"success": True}, lambda s: s["is_moving"]),
    ("stop_move", "", {}, lambda s: not s["is_moving"]),
    ("program/load", text(name="weld.jks"), {"success": True, "message": "program weld.jks loaded"}, lambda s: True),
    ("program/play", "", {"success": True}, lambda s: True), ("program/pause", "", {"success": True}, lambda s: True),
    ("program/resume", "", {"success": True}, lambda s: True),
    ("program/stop", "", {"success": True, "message": "no program runs, the arm rests"}, lambda s: not s["is_moving"]),
    ("set_workspace", text(yaml="'floor: -1.5'"),
     {"ret": 1, "message": "1 zone and 0 parts of a tool are kept, before 0 zones and 0 parts of a tool"},
     lambda s: True),
    ("set_workspace", text(yaml="'{}'"), {"ret": 1}, lambda s: True),
    ("set_workspace", text(yaml="''"), {"ret": 1, "message": "nothing is changed: 0 zones and 0 parts of a tool"},
     lambda s: True),
]


NOT_YET = ("no fresh status of the arm", "can be changed over at rest only")
"""Words of refusals until the feed shows what the call before has led to: a busy host may keep it back."""


def answer_to(name, request):
    """Call a service as ``rosservice call`` does: by the type that the node reports, with a request as YAML.

    Each call has a connection of its own; a process of its own for each would take most of the test's time.
    """
    kind = rosservice_library.get_service_class_by_name(name)
    message = kind._request_class()
    genpy.message.fill_message_args(message, [yaml.safe_load(request)] if request else [])
    return yaml.safe_load(str(rospy.ServiceProxy(name, kind)(message))) or {}


def answer_of(arm, name, request):
    """Return the node's answer; ask again where it must wait for the feed: see ``NOT_YET``."""
    answers = []

    def is_seen():
        answers.append(answer_to("%s/%s" % (arm.name, name), request))
        return not any(words in str(answers[-1]) for words in NOT_YET)
    assert eventually(is_seen), answers[-1]
    return answers[-1]


def test_a_good_call_of_every_service_through_the_real_program(arm):
    assert {row[0] for row in GOOD} == {spec.name for spec in SERVICES}
    for name, request, expected, holds in GOOD:
        request = request(arm) if callable(request) else request
        answer = answer_of(arm, name, request)
        assert isinstance(answer, dict) and expected.items() <= answer.items(), (name, answer)
        assert eventually(lambda holds=holds: holds(arm.simulator.state())), (name, arm.simulator.state())
    assert arm.call("set_userframe", pose=[0.0] * 6, user_num=3).ret == 1


def test_settings_are_told_as_the_controller_holds_them(arm):
    assert arm.call("set_userframe", pose=[10.0, 0.0, 0.0, 0.0, 0.0, 0.5], user_num=4).ret == 1
    assert arm.call("set_payload", tool_num=0, mass=1.25, xc=0.0, yc=-20.0, zc=40.0).ret == 1
    assert arm.call("set_collisionlevel", is_enable=True, value=60).ret == 1
    told = arm.call("get_settings")
    held = json.loads(told.message)
    assert told.success and (held["tool"], held["user_frame"], held["collision_level"]) == (0, 4, 3)
    assert held["payload"] == {"mass": 1.25, "centre": [0.0, -0.02, 0.04]}
    assert held["user_frames"][4] == {"p": [0.01, 0.0, 0.0], "r": [0.0, 0.0, 0.5]} and len(held["tools"]) > 4
    assert arm.call("set_userframe", pose=[0.0] * 6, user_num=4).ret == 1


def test_every_service_has_the_documented_type(arm):
    for spec in SERVICES:
        assert rosservice_library.get_service_type("%s/%s" % (arm.name, spec.name)) == spec.srv_type._type


BAD = [
    ("joint_move", dict(pose=HOME[:5], **FAST), "pose has 5 values"),
    ("joint_move", dict(pose=[NAN] * 6, **FAST), "finite"),
    ("joint_move", dict(pose=[7.0] + HOME[1:], **FAST), "joint 1 of zu7"),
    ("joint_move", {"pose": HOME, "mvvelo": 0.0, "mvacc": 1.0}, "mvvelo is 0"),
    ("joint_move", {"pose": HOME, "mvvelo": 4.0, "mvacc": 1.0}, "speed is 4 rad/s"),
    ("joint_move", {"pose": HOME, "mvvelo": 1.0, "mvacc": 100.0}, "acceleration is 100 rad/s2"),
    ("linear_move", dict(pose=[1.0] * 3, **FAST), "pose has 3 values"),
    ("linear_move", {"pose": LINE, "mvvelo": 1e5, "mvacc": 100.0}, "speed is 100 m/s"),
    ("linear_move", {"pose": [5000.0, 0.0, 0.0, 0.0, 0.0, 0.0], "mvvelo": 100.0, "mvacc": 100.0},
     "its target cannot be reached: out of reach"),
    ("jog", {"mvvelo": 0.1, "index": 12}, "index is 12"),
    ("jog", {"mvvelo": 0.1, "coord_mode": 5}, "coord_mode is 5"),
    ("jog", {"mvvelo": 0.0}, "mvvelo is 0"),
    ("jog", {"mvvelo": 9.0}, "velocity is 9 rad/s"),
    ("servo_j", {"pose": HOME}, "not in servo mode"),
    ("servo_p", {"pose": [0.4, 0.1, 0.3, 0.0, 0.0, 0.0]}, "not in servo mode"),
    ("servo_p", {"pose": [0.4]}, "pose has 1 values"),
    ("set_toolframe", {"pose": [0.0] * 6, "tool_num": 0}, "tool_num is 0"),
    ("set_userframe", {"pose": [0.0] * 6, "user_num": 11}, "user_num is 11"),
    ("set_payload", {"tool_num": 1, "mass": -1.0}, "mass is -1"),
    ("set_collisionlevel", {"is_enable": True, "value": 5}, "value is 5"),
    ("set_speed_slider", {"speed_slider_fraction": 0.0}, "valid: 0.01 to 1"),
    ("set_speed_slider", {"speed_slider_fraction": NAN}, "finite"),
    ("pause", {}, "moves nothing"), ("resume", {}, "moves nothing"),
    ("program/load", {"name": ""}, "the name of a program file"), ("program/load", {"name": "a/b"}, "without folder"),
    ("program/pause", {}, "the program is idle"), ("program/resume", {}, "the program is idle"),
    ("set_workspace", {"yaml": "floor: 11"}, "from -10 to 10"), ("set_workspace", {"yaml": "#"}, "holds nothing"),
    ("set_io", {"signal": "x", "type": 0, "index": 0, "value": 1.0}, "signal is 'x'"),
    ("set_io", {"signal": "digital", "type": 0, "index": 500, "value": 1.0}, ""),
]


@pytest.mark.parametrize("name, fields, reason", BAD, ids=["%s-%d" % (row[0], n) for n, row in enumerate(BAD)])
def test_a_bad_request_is_answered_with_ret_0_and_the_reason_and_moves_nothing(idle, name, fields, reason):
    before = idle.simulator.state()["joint_position"]
    answer = idle.call(name, **fields)
    assert not (answer.ret if hasattr(answer, "ret") else answer.success)
    assert answer.message and reason in answer.message, answer.message
    assert idle.simulator.state()["joint_position"] == before


@pytest.mark.parametrize("fields, reason", [
    ({"signal": "digital", "path": 0, "type": 0, "index": 500}, "index is 500; valid: 0 to"),
    ({"signal": "analog", "path": 3, "type": 0, "index": 0}, "path is 3"),
    ({"signal": "digital", "path": 0, "type": 2, "index": 0}, "does not report digital input 0 of extension"),
    ({"signal": "", "path": 0, "type": 0, "index": 0}, "signal is ''")])
def test_get_io_fails_with_nan_and_error(arm, fields, reason):
    answer = arm.call("get_io", **fields)
    assert math.isnan(answer.value) and answer.message.startswith("error: ") and reason in answer.message


def test_kinematics_fail_with_an_empty_array_and_the_reason(arm):
    forward = arm.call("get_fk", joint=[0.0])
    assert list(forward.cartesian_pose) == [] and "joint has 1 values" in forward.message
    inverse = arm.call("get_ik", ref_joint=HOME, cartesian_pose=[5000.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert list(inverse.joint) == [] and "kine_inverse" in inverse.message


def test_bad_requests_through_the_real_program(arm):
    assert "finite" in rosservice(arm.name + "/joint_move", text(pose=[".nan"] * 6, **FAST).replace("'", ""))["message"]
    assert "ERROR" in rosservice(arm.name + "/joint_move", text(speed=1.0))


def test_inputs_and_analog_outputs_are_read_and_written(arm):
    arm.simulator.operate("set_input", index=3, value=1)
    read = {"signal": "digital", "path": 0, "type": 0, "index": 3}
    assert eventually(lambda: arm.call("get_io", **read).value == 1.0)
    assert arm.call("set_io", signal="analog", type=0, index=1, value=4.5).ret == 1
    assert arm.call("get_io", signal="analog", path=1, type=0, index=1).value == pytest.approx(4.5)


def test_servo_targets_are_followed_and_far_ones_refused(rested):
    rested.go_home()
    assert rested.call("servo_move_enable", enable=True).ret == 1
    near = [0.02] + HOME[1:]
    assert rested.call("servo_j", pose=near).ret == 1
    assert eventually(lambda: abs(rested.simulator.state()["joint_position"][0] - math.degrees(0.02)) < 0.01)
    far = rested.call("servo_j", pose=[1.0] + HOME[1:])
    assert far.ret == 0 and "0.9800 rad away" in far.message
    refused = rested.call("joint_move", pose=HOME, **FAST)
    assert refused.ret == 0 and "servo mode owns the arm's motion" in refused.message


@pytest.mark.parametrize("row", [
    row for row in reference_values() if row["model"] == "zu7" and not row.get("orientation_only")],
    ids=lambda row: row["id"])
def test_the_reference_values_of_real_controllers(arm, row):
    # Printed as float32 by a real one: the wire's float32 costs half a step, 3e-5 mm and 1.2e-7 rad here.
    if "ref_joint" in row:
        found = arm.call("get_ik", ref_joint=row["ref_joint"], cartesian_pose=row["pose"]).joint
        assert found == pytest.approx(row["joint_rad"], abs=1e-6)
    else:
        found = arm.call("get_fk", joint=row["joint_rad"]).cartesian_pose
        assert found[:3] == pytest.approx(row["pose"][:3], abs=1e-4)
        assert found[3:] == pytest.approx(row["pose"][3:], abs=1e-6)


def test_every_call_leaves_its_evidence(arm):
    with evidence_of(arm) as call_publisher:
        arm.call("joint_move", pose=HOME, **FAST)
        arm.call("joint_move", pose=HOME[:5], **FAST)
        assert eventually(lambda: len(call_publisher()) == 2)
    good, bad = call_publisher()
    assert good.success and good.error == "" and not bad.success and "5 values" in bad.error
    for message in (good, bad):
        assert message.service == arm.name + "/joint_move" and message.service_type == "jaka_msgs/Move"
        assert message.md5sum == Move._md5sum and message.caller.startswith("/jaka_tests")
        assert message.duration > 0.0 and message.header.stamp.to_sec() > 0.0
        assert "pose:" in message.request_text and "ret:" in message.response_text
    request = MoveRequest().deserialize(bytes(good.request))
    assert list(request.pose) == HOME and MoveResponse().deserialize(bytes(good.response)).ret == 1


def test_every_service_is_documented_with_its_type():
    lines = (ROOT / "docs" / "ros-interface.md").read_text(encoding="utf-8").splitlines()
    for spec in SERVICES:
        assert [line for line in lines if "`~%s`" % spec.name in line and spec.srv_type._type in line], spec.name
