"""Commands as the bytes of the controller's protocol, and its replies."""
import math
from typing import get_args

import pytest

from jaka_ros_driver import commands as c
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, ProtocolError
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.state import IoBank, ProgramState

DEG = math.radians(1.0)
POSE = c.Pose((0.4, -0.05, 0.35), (math.pi, 0.0, math.pi / 2))
WIRE_POSE = [400.0, -50.0, 350.0, 180.0, 0.0, 90.0]
JOINTS = tuple(q * DEG for q in (10.0, 90.0, -90.0, 90.0, 90.0, 0.0))
WIRE_JOINTS = [10.0, 90.0, -90.0, 90.0, 90.0, 0.0]

REQUESTS = [
    (c.JointMove(JOINTS, 20 * DEG, 60 * DEG),
     {"cmdName": "joint_move", "relFlag": 0, "jointPosition": WIRE_JOINTS, "speed": 20.0, "accel": 60.0}),
    (c.LinearMove(POSE, 0.05, 0.2),
     {"cmdName": "moveL", "relFlag": 0, "cartPosition": WIRE_POSE, "speed": 50.0, "accel": 200.0, "tol": 0.5,
      "ori_vel": 0.5 / DEG, "ori_acc": 2.0 / DEG}),
    (c.LinearMove(POSE, 0.5, 2.0),
     {"cmdName": "moveL", "relFlag": 0, "cartPosition": WIRE_POSE, "speed": 500.0, "accel": 2000.0, "tol": 0.5,
      "ori_vel": 180.0, "ori_acc": 720.0}),
    (c.LinearMove(POSE, 0.05, 0.1, 0.0005, 1.5, 3.0),  # requests-2.1.11.txt, linear_move_ori
     {"cmdName": "moveL", "relFlag": 0, "cartPosition": WIRE_POSE, "speed": 50.0, "accel": 100.0, "tol": 0.5,
      "ori_vel": 85.94366926962348, "ori_acc": 171.8873385392470}),
    (c.Jog(c.JogFrame.JOINT, 2, -5 * DEG),
     {"cmdName": "jog", "jog_mode": 1, "coord_map": 1, "jnum": 2, "jogvel": -5.0}),
    (c.Jog(c.JogFrame.BASE, 0, 0.03), {"cmdName": "jog", "jog_mode": 1, "coord_map": 0, "jnum": 0, "jogvel": 30.0}),
    (c.Jog(c.JogFrame.TOOL, 5, 5 * DEG), {"cmdName": "jog", "jog_mode": 1, "coord_map": 2, "jnum": 5, "jogvel": 5.0}),
    (c.JogStop(c.JogFrame.TOOL, 2), {"cmdName": "jog", "jog_mode": 0, "coord_map": 2, "jnum": 2}),
    (c.Stop(), {"cmdName": "stop_program"}),
    (c.JointMove(JOINTS, 20 * DEG, 60 * DEG, 0.02),
     {"cmdName": "joint_move", "relFlag": 0, "jointPosition": WIRE_JOINTS, "speed": 20.0, "accel": 60.0, "tol": 20.0}),
    (c.ArcMove(POSE, POSE, 0.05, 0.2, 0.003),
     {"cmdName": "movc", "relFlag": 0, "pos_mid": WIRE_POSE, "pos_end": WIRE_POSE, "speed": 50.0, "accel": 200.0,
      "tol": 3.0, "circle_cnt": 0, "circle_mode": 0}),
    (c.LoadProgram("weld.ngc"), {"cmdName": "load_program", "programName": "weld.ngc"}),
    (c.PlayProgram(), {"cmdName": "play_program"}),
    (c.Query.LOADED_PROGRAM, {"cmdName": "get_loaded_program"}),
    (c.PauseMotion(), {"cmdName": "pause_program"}), (c.ResumeMotion(), {"cmdName": "resume_program"}),
    (c.SetServoMode(True), {"cmdName": "servo_move", "relFlag": 1}),
    (c.SetServoMode(False), {"cmdName": "servo_move", "relFlag": 0}),
    (c.ServoJoint(JOINTS), {"cmdName": "servo_j", "relFlag": 0, "jointPosition": WIRE_JOINTS, "stepNum": 1}),
    (c.ServoJoint(JOINTS, True, 2), {"cmdName": "servo_j", "relFlag": 1, "jointPosition": WIRE_JOINTS, "stepNum": 2}),
    (c.ServoPose(POSE), {"cmdName": "servo_p", "relFlag": 0, "catPosition": WIRE_POSE, "stepNum": 1}),
    (c.ServoPose(POSE, True, 3), {"cmdName": "servo_p", "relFlag": 1, "catPosition": WIRE_POSE, "stepNum": 3}),
    (c.SetPower(True), {"cmdName": "power_on"}),
    (c.SetPower(False), {"cmdName": "power_off"}),
    (c.SetEnabled(True), {"cmdName": "enable_robot"}),
    (c.SetEnabled(False), {"cmdName": "disable_robot"}),
    (c.ClearError(), {"cmdName": "clear_error"}),
    (c.SetToolFrame(2, POSE, "gripper"),
     {"cmdName": "set_tool_offsets", "tooloffset": WIRE_POSE, "id": 2, "name": "gripper"}),
    (c.SelectTool(2), {"cmdName": "set_tool_id", "tool_id": 2}),
    (c.SetUserFrame(1, POSE, "table"),
     {"cmdName": "set_user_offsets", "userffset": WIRE_POSE, "useroffset": WIRE_POSE, "id": 1, "name": "table"}),
    (c.SelectUserFrame(1), {"cmdName": "set_user_id", "user_frame_id": 1}),
    (c.SetPayload(1.25, (0.0, 0.0, 0.04)), {"cmdName": "set_payload", "mass": 1.25, "centroid": [0.0, 0.0, 40.0]}),
    (c.SetHandGuiding(True), {"cmdName": "torque_control_enable", "enable_flag": 1}),
    (c.SetCollisionLevel(3), {"cmdName": "set_clsn_sensitivity", "sensitivityVal": 3}),
    (c.SetDigitalOutput(IoBank.CABINET, 3, True), {"cmdName": "set_digital_output", "type": 0, "index": 3, "value": 1}),
    (c.SetAnalogOutput(IoBank.TOOL, 0, 4.5), {"cmdName": "set_analog_output", "type": 1, "index": 0, "value": 4.5}),
    (c.SetRapidRate(0.5), {"cmdName": "rapid_rate", "rate_value": 0.5}),
    (c.SetFeedPeriod(0.008), {"cmdName": "set_port10000_delay_ms", "port10000_delay_ms": 8}),
    (c.SetFeedPeriod(1.0 / 60.0), {"cmdName": "set_port10000_delay_ms", "port10000_delay_ms": 17}),
    (c.SetLinkLoss(0.3), {"cmdName": "set_network_exception_handle", "motType": 2, "timeLimit": 300.0}),
    (c.SetLinkLoss(0), {"cmdName": "set_network_exception_handle", "motType": 0, "timeLimit": 0.0}),
    (c.ForwardKinematics(JOINTS), {"cmdName": "kine_forward", "jointPosition": WIRE_JOINTS}),
    (c.InverseKinematics(POSE, JOINTS),
     {"cmdName": "kine_inverse", "jointPosition": WIRE_JOINTS, "cartPosition": WIRE_POSE}),
    (c.GetDigitalOutput(IoBank.TOOL, 1), {"cmdName": "get_digital_output", "type": 1, "index": 1}),
    (c.GetAnalogOutput(IoBank.CABINET, 0), {"cmdName": "get_analog_output", "type": 0, "index": 0}),
    (c.GetDigitalInput(IoBank.TOOL, 2), {"cmdName": "get_digital_input", "type": 1, "index": 2}),
    (c.GetAnalogInput(IoBank.CABINET, 0), {"cmdName": "get_analog_input", "type": 0, "index": 0}),
    (c.ZeroForceSensor(), {"cmdName": "zero_end_sensor"}),
    (c.Query.VERSION, {"cmdName": "get_version"}),
    (c.Query.SERVO_MODE, {"cmdName": "is_in_servomove"}),
    (c.Query.FEED_PERIOD, {"cmdName": "get_port10000_delay_ms"}),
    (c.Query.JOINTS, {"cmdName": "get_joint_pos"}),
    (c.Query.DRIVES_READY, {"cmdName": "get_robot_state"}),
    (c.Query.TOOL_FRAMES, {"cmdName": "get_tool_offsets"}),
    (c.Query.USER_FRAMES, {"cmdName": "get_user_offsets"}),
    (c.Query.PAYLOAD, {"cmdName": "get_payload"}),
    (c.Query.COLLISION_LEVEL, {"cmdName": "get_clsn_sensitivity"}),
    (c.Query.SIMULATOR_IDENTITY, {"cmdName": "get_simulator_identity"}),
    (c.Query.PROGRAM_STATE, {"cmdName": "get_program_state"}),
    (c.Query.HAND_GUIDING, {"cmdName": "drag_status"}),
]


def same(a, b):
    if isinstance(a, dict):
        return set(a) == set(b) and all(same(a[key], b[key]) for key in a)
    return list(a) == pytest.approx(b, abs=1e-9) if isinstance(a, (list, tuple)) else a == pytest.approx(b)


@pytest.mark.parametrize("command, request_object", REQUESTS, ids=lambda value: str(value)[:40])
def test_commands_are_written_as_the_protocol_document_has_them(command, request_object):
    encoded = codec.encode(command)
    assert {k: v for k, v in encoded.items() if isinstance(v, str)} == {
        k: v for k, v in request_object.items() if isinstance(v, str)}
    assert all(same(encoded[key], value) for key, value in request_object.items() if not isinstance(value, str))
    assert set(encoded) == set(request_object)


def test_every_command_is_in_the_table():
    tested = {type(command) for command, _ in REQUESTS}
    assert tested == set(get_args(c.Command))
    assert {command for command, _ in REQUESTS if isinstance(command, c.Query)} == set(c.Query)


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("make", [
    lambda x: c.JointMove((0, 0, 0, 0, 0, x), 1.0, 1.0), lambda x: c.LinearMove(POSE, x, 1.0),
    lambda x: c.ServoPose(c.Pose((0, 0, x), (0, 0, 0))), lambda x: c.SetPayload(1.0, (x, 0, 0)),
    lambda x: c.SetAnalogOutput(IoBank.TOOL, 0, x)])
def test_a_number_that_is_not_finite_is_never_encoded(make, bad):
    with pytest.raises(InvalidCommand, match="finite"):
        codec.encode(make(bad))


@pytest.mark.parametrize("command, reply, result", [
    (c.Query.VERSION, {"version": "1.5.14_13_X64"}, "1.5.14_13_X64"),
    (c.Query.SERVO_MODE, {"in_servomove": True}, True),
    (c.Query.SERVO_MODE, {"in_servomove": 0}, False),
    (c.Query.FEED_PERIOD, {"port10000_delay_ms": "8"}, 0.008),
    (c.Query.JOINTS, {"joint_pos": WIRE_JOINTS}, JOINTS),
    (c.Query.DRIVES_READY, {"power": "powered_on", "enable": "robot_enabled"}, True),
    (c.Query.DRIVES_READY, {"power": "powered_on", "enable": "robot_disabled"}, False),
    (c.Query.DRIVES_READY, {"power": "powered_off", "enable": "robot_disabled"}, False),
    (c.Query.DRIVES_READY, {"power": 1, "enable": True, "errcode": 0, "msg": ""}, True),
    (c.Query.DRIVES_READY, {"power": 0, "enable": False, "errcode": 0, "msg": ""}, False),
    (c.Query.PROGRAM_STATE, {"programState": "idle"}, ProgramState.IDLE),
    (c.Query.PROGRAM_STATE, {"programState": "Running"}, ProgramState.RUNNING),
    (c.Query.PROGRAM_STATE, {"programState": "paused"}, ProgramState.PAUSED),
    (c.Query.COLLISION_LEVEL, {"sensitivityLevel": 3}, 3),
    (c.Query.COLLISION_LEVEL, {"sensitivityVal": "4"}, 4),
    (c.Query.SIMULATOR_IDENTITY, {"identity": "k3"}, "k3"),
    (c.Query.LOADED_PROGRAM, {"programName": "weld.ngc"}, "weld.ngc"),
    (c.Query.HAND_GUIDING, {"drag_status": True}, True),
    (c.Query.HAND_GUIDING, {"drag_status": "0"}, False),
    (c.Query.HAND_GUIDING, {"status": 1}, True),
    (c.GetDigitalOutput(IoBank.CABINET, 0), {"value": 1}, True),
    (c.GetAnalogOutput(IoBank.CABINET, 0), {"value": 4.5}, 4.5),
    (c.GetDigitalInput(IoBank.CABINET, 0), {"value": 1}, True),
    (c.GetAnalogInput(IoBank.CABINET, 0), {"value": 4.5}, 4.5),
    (c.Stop(), {}, None)])
def test_replies_become_results(command, reply, result):
    assert codec.decode(command, dict(reply, errorCode="0", errorMsg="")) == result


def test_kinematics_replies_become_si_units():
    pose = codec.decode(c.ForwardKinematics(JOINTS), {"errorCode": "0", "cartPosition": WIRE_POSE})
    assert pose.position == pytest.approx(POSE.position) and pose.rpy == pytest.approx(POSE.rpy)
    assert codec.decode(c.InverseKinematics(POSE, JOINTS), {"errorCode": 0, "jointPosition": WIRE_JOINTS}) == (
        pytest.approx(JOINTS))
    frames = codec.decode(c.Query.TOOL_FRAMES, {"errorCode": "0", "tool_offsets": [[0] * 6, WIRE_POSE]})
    assert frames[1].position == pytest.approx(POSE.position)
    payload = codec.decode(c.Query.PAYLOAD, {"errorCode": "0", "mass": 1.5, "centroid": [10, 20, 30]})
    assert payload == c.SetPayload(1.5, pytest.approx((0.01, 0.02, 0.03)))


@pytest.mark.parametrize("raw, code", [("2", 2), (2, 2), ("-1", -1), ("0x10", 16), ("odd", "odd")])
def test_a_refusal_keeps_its_number_and_its_words(raw, code):
    with pytest.raises(CommandRejected) as caught:
        codec.decode(c.Stop(), {"errorCode": raw, "errorMsg": "call stop failed"})
    assert (caught.value.command, caught.value.code, caught.value.reason) == ("stop_program", code, "call stop failed")


def test_a_refusal_without_words_gets_the_meaning_of_its_code():
    for code, meaning in codec.ERROR_MEANINGS.items():
        with pytest.raises(CommandRejected, match=meaning):
            codec.decode(c.Stop(), {"errorCode": str(code), "errorMsg": ""})
    with pytest.raises(CommandRejected, match="code 4660, no reason given"):
        codec.decode(c.Stop(), {"errorCode": "0x1234"})


@pytest.mark.parametrize("command, reply", [
    (c.Stop(), {}), (c.Query.VERSION, {"errorCode": "0"}), (c.Query.PAYLOAD, {"errorCode": "0", "mass": 1}),
    (c.Query.COLLISION_LEVEL, {"errorCode": "0", "sensitivityLevel": "high"}),
    (c.ForwardKinematics(JOINTS), {"errorCode": "0", "cartPosition": [1, 2]}),
    (c.ForwardKinematics(JOINTS), {"errorCode": "0", "cartPosition": WIRE_POSE[:5]}),
    (c.ForwardKinematics(JOINTS), {"errorCode": "0", "cartPosition": None}),
    (c.InverseKinematics(POSE, JOINTS), {"errorCode": "0", "jointPosition": WIRE_JOINTS[:5]}),
    (c.InverseKinematics(POSE, JOINTS), {"errorCode": "0", "jointPosition": ["a"] * 6}),
    (c.InverseKinematics(POSE, JOINTS), {"errorCode": "0", "jointPosition": [float("nan")] * 6})])
def test_a_reply_without_its_content_is_a_protocol_error(command, reply):
    with pytest.raises(ProtocolError):
        codec.decode(command, reply)
