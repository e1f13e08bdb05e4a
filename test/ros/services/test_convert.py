"""Requests to commands and states to messages: units, shapes, enums, the rule for float32, both interfaces."""
import math
import re
import struct
from dataclasses import replace
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from jaka_msgs.srv import (
    GetFKRequest,
    GetIKRequest,
    GetIORequest,
    MoveRequest,
    ServoMoveEnableRequest,
    ServoMoveRequest,
    SetCollisionRequest,
    SetIORequest,
    SetPayloadRequest,
    SetTcpFrameRequest,
    SetUserFrameRequest,
)
from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.workspace import NO_ZONES, workspace_of
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.rotations import (
    matrix_from_rotation_vector,
    matrix_from_rpy,
    rotation_angle_between,
    rotation_vector_from_rpy,
)
from jaka_ros_driver.ros import convert
from jaka_ros_driver.ros.convert import RequestDecoder, Terminal, ToolPayload
from jaka_ros_driver.state import IoBank, RobotState

MODEL = load_model("zu7")
DOCUMENTED, VENDOR = RequestDecoder(MODEL), RequestDecoder(MODEL, is_vendor=True)
VENDOR_2025 = RequestDecoder(MODEL, is_vendor=True, is_vendor_2025=True)
NAN, INF = math.nan, math.inf
HOME = [0.0, 1.5, -1.5, 1.5, 1.5, 0.0]
STATE = RobotState(tuple(HOME), True, True, True, False, False, tcp_position=(0.4, -0.1, 0.3), tcp_rpy=(0.1, 0.2, 0.3))


def float32(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def move(**changed):
    return MoveRequest(**{"pose": HOME, "mvvelo": 0.5, "mvacc": 1.0, **changed})


def jog(**changed):
    return MoveRequest(**{"mvvelo": 0.5, "index": 0, "coord_mode": 0, **changed})


# ---- units and shapes ----

def test_joint_move_is_rad():
    assert DOCUMENTED.joint_move(move()) == c.JointMove(tuple(HOME), 0.5, 1.0)


def test_linear_move_is_mm_and_a_rotation_vector():
    command = DOCUMENTED.linear_move(move(pose=[400.0, -100.0, 300.0, 0.0, 0.0, math.pi / 2], mvvelo=100, mvacc=500))
    assert command.target.position == pytest.approx((0.4, -0.1, 0.3))
    assert command.target.rpy == pytest.approx((0.0, 0.0, math.pi / 2))
    assert (command.speed, command.acceleration) == pytest.approx((0.1, 0.5))


@pytest.mark.parametrize("name, mm_s, mm_s2, rad_s, rad_s2", [
    ("zu7", 1.0, 5.0, 0.01, 0.05), ("zu7", 50.0, 500.0, 0.5, 5.0), ("zu7", 1500.0, 8000.0, math.pi, 4.0 * math.pi),
    ("minicobo", 1000.0, 8000.0, math.pi / 2.0, 4.0 * math.pi)])
def test_a_linear_move_turns_as_fast_as_its_speed_moves_a_point_100_mm_off(name, mm_s, mm_s2, rad_s, rad_s2):
    model = load_model(name)
    command = RequestDecoder(model).linear_move(move(pose=[400.0, 0.0, 300.0, 0.0, 0.0, 1.5], mvvelo=mm_s, mvacc=mm_s2))
    assert (command.angular_speed, command.angular_acceleration) == pytest.approx((rad_s, rad_s2))
    assert (command.turn_speed, command.turn_acceleration) == (command.angular_speed, command.angular_acceleration)
    limits.check(command, model)


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_the_vendors_linear_move_ends_at_the_inverse_rotation(vector):
    request = move(pose=[400.0, 0.0, 300.0, *vector], mvvelo=100, mvacc=500)
    ours = matrix_from_rpy(DOCUMENTED.linear_move(request).target.rpy)
    theirs = matrix_from_rpy(VENDOR.linear_move(request).target.rpy)
    inverse = matrix_from_rotation_vector([-v for v in vector])
    assert rotation_angle_between(ours, matrix_from_rotation_vector(vector)) < 1e-6
    assert rotation_angle_between(theirs, inverse) < 1e-6


def test_the_vendors_linear_move_of_2025_takes_rpy_and_all_else_is_as_in_2024():
    turned = move(pose=[400.0, -100.0, 300.0, 0.1, -0.2, 6.5], mvvelo=100, mvacc=500)
    target = VENDOR_2025.linear_move(turned).target
    assert target.position == pytest.approx((0.4, -0.1, 0.3)) and target.rpy == pytest.approx((0.1, -0.2, 6.5))
    with pytest.raises(InvalidCommand, match="x y z, mm, and roll pitch yaw, rad"):
        VENDOR_2025.linear_move(move(pose=[1.0] * 5))
    limits.check(VENDOR_2025.linear_move(turned), MODEL)
    with pytest.raises(InvalidCommand, match="rpy"):
        limits.check(VENDOR_2025.linear_move(move(pose=[400.0, 0.0, 300.0, 90.0, 0.0, 0.0], mvvelo=100)), MODEL)
    increment = ServoMoveRequest(pose=[1.0, 2.0, 3.0, 0.01, 0.02, 0.03])
    assert VENDOR_2025.servo_pose(increment) == VENDOR.servo_pose(increment)
    frame = SetTcpFrameRequest([0.0, 0.0, 120.0, 0.0, 1.5, 0.0], 2)
    assert VENDOR_2025.tool_frame(frame) == VENDOR.tool_frame(frame)


@pytest.mark.parametrize("changes, frame, axis, velocity", [
    ({"index": 0}, c.JogFrame.JOINT, 0, 0.5), ({"index": 11}, c.JogFrame.JOINT, 5, -0.5),
    ({"coord_mode": 1, "index": 2, "mvvelo": 50.0}, c.JogFrame.BASE, 1, 0.05),
    ({"coord_mode": 2, "index": 5, "mvvelo": 50.0}, c.JogFrame.TOOL, 2, -0.05),
    ({"coord_mode": 1, "index": 7, "mvvelo": 0.25}, c.JogFrame.BASE, 3, -0.25),
    ({"mvvelo": 0.0, "mvacc": 0.25}, c.JogFrame.JOINT, 0, 0.25),
    ({"mvvelo": 0.5, "mvacc": 0.25}, c.JogFrame.JOINT, 0, 0.5),
    ({"coord_mode": 2, "index": 0, "mvvelo": 0.0, "mvacc": 20.0}, c.JogFrame.TOOL, 0, 0.02),
])
@pytest.mark.parametrize("requests", [DOCUMENTED, VENDOR])
def test_jog_reads_frame_axis_and_speed(requests, changes, frame, axis, velocity):
    command = requests.jog(jog(**changes))
    assert (command.frame, command.axis) == (frame, axis) and command.velocity == pytest.approx(velocity)


def test_servo_targets_are_absolute_m_and_the_vendors_increments_mm():
    pose = [0.4, 0.1, 0.3, 0.01, 0.02, 0.03]
    assert DOCUMENTED.servo_joint(ServoMoveRequest(pose=HOME)) == c.ServoJoint(tuple(HOME))
    assert VENDOR.servo_joint(ServoMoveRequest(pose=[0.001] * 6)) == c.ServoJoint((0.001,) * 6, relative=True)
    target = c.ServoPose(c.Pose((0.4, 0.1, 0.3), (0.01, 0.02, 0.03)))
    assert DOCUMENTED.servo_pose(ServoMoveRequest(pose=pose)) == target
    theirs = VENDOR.servo_pose(ServoMoveRequest(pose=[1.0, 2.0, 3.0, 0.01, 0.02, 0.03]))
    assert theirs.relative and theirs.target.position == pytest.approx((0.001, 0.002, 0.003))
    assert theirs.target.rpy == (0.01, 0.02, 0.03)


def test_frames_are_mm_and_rotation_vectors():
    pose = [0.0, 0.0, 120.0, 0.0, math.pi / 2, 0.0]
    tool = DOCUMENTED.tool_frame(SetTcpFrameRequest(pose, 2))
    assert tool.tool_id == 2 and tool.pose.position == pytest.approx((0.0, 0.0, 0.12))
    assert tool.pose.rpy == pytest.approx((0.0, math.pi / 2, 0.0))
    user = DOCUMENTED.user_frame(SetUserFrameRequest(pose, 10))
    assert user.user_frame_id == 10 and user.pose == tool.pose


def test_payload_is_kg_and_mm():
    assert DOCUMENTED.payload(SetPayloadRequest(3, 1.5, 10.0, 20.0, 40.0)) == ToolPayload(
        3, c.SetPayload(1.5, pytest.approx((0.01, 0.02, 0.04))))


@pytest.mark.parametrize("value, level", [(10, 1), (25, 1), (26, 2), (50, 2), (51, 3), (75, 3), (76, 4), (100, 4)])
def test_collision_values_map_to_levels(value, level):
    assert DOCUMENTED.collision_level(SetCollisionRequest(True, value)) == level
    assert DOCUMENTED.collision_level(SetCollisionRequest(False, value)) == 0


def test_switches_and_terminals():
    assert DOCUMENTED.servo_mode(ServoMoveEnableRequest(True)) is True
    assert DOCUMENTED.output(SetIORequest("digital", 1, 3, -0.5)) == c.SetDigitalOutput(IoBank.TOOL, 3, True)
    assert DOCUMENTED.output(SetIORequest("digital", 0, 0, 0.0)) == c.SetDigitalOutput(IoBank.CABINET, 0, False)
    assert DOCUMENTED.output(SetIORequest("analog", 2, 1, 4.5)) == c.SetAnalogOutput(IoBank.EXTENSION, 1, 4.5)
    assert DOCUMENTED.terminal(GetIORequest("analog", 1, 0, 5)) == Terminal(False, True, IoBank.CABINET, 5)
    assert str(Terminal(True, False, IoBank.TOOL, 1)) == "digital input 1 of tool"


def test_kinematics_are_rad_mm_and_rpy():
    assert DOCUMENTED.forward(GetFKRequest(HOME)) == c.ForwardKinematics(tuple(HOME))
    inverse = DOCUMENTED.inverse(GetIKRequest(HOME, [400.0, 0.0, 300.0, 0.1, 0.2, 0.3]))
    assert inverse.reference == tuple(HOME) and inverse.target == c.Pose(
        pytest.approx((0.4, 0.0, 0.3)), (0.1, 0.2, 0.3))
    assert convert.wire_pose(inverse.target) == pytest.approx((400.0, 0.0, 300.0, 0.1, 0.2, 0.3))


# ---- what is refused ----

REFUSED = [
    (RequestDecoder.joint_move, move(pose=HOME[:5]), r"pose has 5 values; it must have 6"),
    (RequestDecoder.joint_move, move(pose=[]), r"pose has 0 values"),
    (RequestDecoder.joint_move, move(pose=HOME + [0.0]), r"pose has 7 values"),
    (RequestDecoder.joint_move, move(pose=HOME[:5] + [NAN]), r"pose\[5\] is nan; it must be a finite number"),
    (RequestDecoder.joint_move, move(pose=[INF] + HOME[1:]), r"pose\[0\] is inf"),
    (RequestDecoder.joint_move, move(mvvelo=0.0), r"mvvelo is 0; it must be above 0"),
    (RequestDecoder.joint_move, move(mvvelo=-0.1), r"mvvelo is -0.1"),
    (RequestDecoder.joint_move, move(mvacc=0.0), r"mvacc is 0"),
    (RequestDecoder.joint_move, move(mvacc=NAN), r"mvacc is nan"),
    (RequestDecoder.linear_move, move(pose=HOME[:3]), r"pose has 3 values"),
    (RequestDecoder.linear_move, move(mvvelo=INF), r"mvvelo is inf"),
    (RequestDecoder.linear_move, move(mvacc=-1.0), r"mvacc is -1"),
    (RequestDecoder.jog, jog(coord_mode=3), r"coord_mode is 3; valid: 0 joint, 1 active user frame, 2 tool"),
    (RequestDecoder.jog, jog(coord_mode=-1), r"coord_mode is -1"),
    (RequestDecoder.jog, jog(index=12), r"index is 12; valid: 0 to 11"),
    (RequestDecoder.jog, jog(index=-1), r"index is -1"),
    (RequestDecoder.jog, jog(mvvelo=0.0), r"mvvelo is 0"),
    (RequestDecoder.jog, jog(mvvelo=-0.5), r"mvvelo is -0.5"),
    (RequestDecoder.jog, jog(mvvelo=0.0, mvacc=-0.5), r"mvacc is -0.5"),
    (RequestDecoder.jog, jog(mvvelo=NAN), r"mvvelo is nan"),
    (RequestDecoder.servo_joint, ServoMoveRequest(pose=HOME[:5]), r"pose has 5 values"),
    (RequestDecoder.servo_joint, ServoMoveRequest(pose=[NAN] * 6), r"pose\[0\] is nan"),
    (RequestDecoder.servo_pose, ServoMoveRequest(pose=[0.1] * 7), r"pose has 7 values"),
    (RequestDecoder.servo_pose, ServoMoveRequest(pose=[INF] * 6), r"pose\[0\] is inf"),
    (RequestDecoder.tool_frame, SetTcpFrameRequest([0.0] * 6, 0), r"tool_num is 0; valid: 1 to 11"),
    (RequestDecoder.tool_frame, SetTcpFrameRequest([0.0] * 6, 12), r"tool_num is 12"),
    (RequestDecoder.tool_frame, SetTcpFrameRequest([0.0] * 5, 1), r"pose has 5 values"),
    (RequestDecoder.linear_move, move(pose=[400.0, 0.0, 300.0, 0.0, -1e38, 0.0]),
     r"pose\[3\], \[4\] and \[5\] are \(0, -1e\+38, 0\), .* 1e\+38 rad; valid: at most 6.28318531 rad"),
    (RequestDecoder.linear_move, move(pose=[400.0, 0.0, 300.0, 3.7, 3.7, 3.7]), r"rotation vector of 6.40858799 rad"),
    (RequestDecoder.linear_move, move(pose=[400.0, 0.0, 300.0, 1.7e308, 1.7e308, 0.0]), r"rotation vector of inf rad"),
    (RequestDecoder.tool_frame, SetTcpFrameRequest([0.0] * 5 + [180.0], 1), r"rotation vector of 180 rad; valid"),
    (RequestDecoder.user_frame, SetUserFrameRequest([0.0] * 3 + [1e30] * 3, 1),
     r"rotation vector of 1.73205081e\+30 rad"),
    (RequestDecoder.tool_frame, SetTcpFrameRequest([NAN] * 6, 1), r"pose\[0\] is nan"),
    (RequestDecoder.user_frame, SetUserFrameRequest([0.0] * 6, 0), r"user_num is 0; valid: 1 to 10"),
    (RequestDecoder.user_frame, SetUserFrameRequest([0.0] * 6, 11), r"user_num is 11"),
    (RequestDecoder.user_frame, SetUserFrameRequest([], 1), r"pose has 0 values"),
    (RequestDecoder.payload, SetPayloadRequest(-1, 1.0, 0.0, 0.0, 0.0), r"tool_num is -1; valid: 0 to 11"),
    (RequestDecoder.payload, SetPayloadRequest(12, 1.0, 0.0, 0.0, 0.0), r"tool_num is 12"),
    (RequestDecoder.payload, SetPayloadRequest(1, -0.1, 0.0, 0.0, 0.0), r"mass is -0.1 kg; valid: 0 to 100 kg"),
    (RequestDecoder.payload, SetPayloadRequest(1, 1e30, 0.0, 0.0, 0.0), r"mass is 1e\+30 kg; valid: 0 to 100 kg"),
    (RequestDecoder.payload, SetPayloadRequest(1, 1.0, 0.0, 0.0, 2001.0),
     r"centroid\[2\] is 2.001 m; valid: -2 to 2 m"),
    (RequestDecoder.payload, SetPayloadRequest(1, NAN, 0.0, 0.0, 0.0), r"mass is nan"),
    (RequestDecoder.payload, SetPayloadRequest(1, 1.0, INF, 0.0, 0.0), r"xc is inf"),
    (RequestDecoder.collision_level, SetCollisionRequest(True, 9), r"value is 9; valid: 10 to 100"),
    (RequestDecoder.collision_level, SetCollisionRequest(True, 101), r"value is 101"),
    (RequestDecoder.output, SetIORequest("Digital", 0, 0, 1.0), r"signal is 'Digital'; valid: digital, analog"),
    (RequestDecoder.output, SetIORequest("digital", 3, 0, 1.0), r"type is 3; valid: 0 cabinet, 1 tool, 2 extension"),
    (RequestDecoder.output, SetIORequest("digital", 0, -1, 1.0), r"index is -1; valid: 0 to 1023"),
    (RequestDecoder.output, SetIORequest("analog", 0, 0, NAN), r"value is nan"),
    (RequestDecoder.terminal, GetIORequest("", 0, 0, 0), r"signal is ''"),
    (RequestDecoder.terminal, GetIORequest("digital", 2, 0, 0), r"path is 2; valid: 0 to 1"),
    (RequestDecoder.terminal, GetIORequest("digital", 0, -1, 0), r"type is -1"),
    (RequestDecoder.terminal, GetIORequest("digital", 0, 0, -1), r"index is -1"),
    (RequestDecoder.terminal, GetIORequest("digital", 0, 0, 1024), r"index is 1024; valid: 0 to 1023"),
    (RequestDecoder.output, SetIORequest("digital", 0, 2 ** 31 - 1, 1.0), r"index is 2147483647; valid: 0 to 1023"),
    (RequestDecoder.forward, GetFKRequest(HOME[:5]), r"joint has 5 values"),
    (RequestDecoder.forward, GetFKRequest([NAN] * 6), r"joint\[0\] is nan"),
    (RequestDecoder.inverse, GetIKRequest(HOME[:1], [0.0] * 6), r"ref_joint has 1 values"),
    (RequestDecoder.inverse, GetIKRequest(HOME, [0.0] * 5), r"cartesian_pose has 5 values"),
    (RequestDecoder.inverse, GetIKRequest(HOME, [INF] * 6), r"cartesian_pose\[0\] is inf"),
    (RequestDecoder.servo_joint_topic, JointState(position=HOME[:5]), r"position has 5 values"),
    (RequestDecoder.servo_joint_topic, JointState(name=["joint_1"] * 6, position=HOME), r"name is .*valid: joint_1"),
    (RequestDecoder.servo_joint_topic, JointState(name=list(c.JOINTS), position=HOME[:5]), r"valid: joint_1"),
]


@pytest.mark.parametrize("read, request_, message", REFUSED, ids=[
    "%s-%d" % (row[0].__name__, n) for n, row in enumerate(REFUSED)])
@pytest.mark.parametrize("requests", [DOCUMENTED, VENDOR], ids=["documented", "vendor"])
def test_refused(requests, read, request_, message):
    with pytest.raises(InvalidCommand, match=message):
        read(requests, request_)


AUDITED = [
    # read in full, refused by the audit that follows
    (RequestDecoder.linear_move, move(pose=[1e38, 0.0, 300.0, 0.0, 0.0, 0.0], mvvelo=100, mvacc=100),
     "target.position"),
    (RequestDecoder.servo_pose, ServoMoveRequest(pose=[0.4, -3e38, 0.3, 0.0, 0.0, 0.0]), "target.position"),
    (RequestDecoder.servo_pose, ServoMoveRequest(pose=[0.4, 0.0, 0.3, 0.0, 1e38, 0.0]), "target.rpy"),
    (RequestDecoder.tool_frame, SetTcpFrameRequest([1e38, 0.0, 0.0, 0.0, 0.0, 0.0], 1), "pose.position"),
    (RequestDecoder.user_frame, SetUserFrameRequest([10001.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1), "pose.position"),
    (RequestDecoder.output, SetIORequest("analog", 0, 0, 1e38), "value"),
    (RequestDecoder.forward, GetFKRequest([0.0] * 5 + [1e38]), "joint_position"),
    (RequestDecoder.inverse, GetIKRequest([0.0] * 5 + [13.0], [400.0, 0.0, 300.0, 0.0, 0.0, 0.0]), "reference"),
    (RequestDecoder.inverse, GetIKRequest([0.0] * 6, [400.0, 0.0, 1e38, 0.0, 0.0, 0.0]), "target.position"),
]


@pytest.mark.parametrize("read, request_, field", AUDITED)
@pytest.mark.parametrize("requests", [DOCUMENTED, VENDOR], ids=["documented", "vendor"])
def test_numbers_that_no_arm_can_need_end_in_the_audit(requests, read, request_, field):
    with pytest.raises(InvalidCommand, match="%s.* is .*valid: " % re.escape(field)):
        limits.check(read(requests, request_), MODEL)


def test_a_whole_turn_as_float32_is_read():
    whole = float32(2.0 * math.pi)
    assert whole > 2.0 * math.pi, "the example must be one that float32 rounds up"
    for requests in (DOCUMENTED, VENDOR):
        rpy = requests.linear_move(move(pose=[400.0, 0.0, 300.0, 0.0, 0.0, whole], mvvelo=100)).target.rpy
        assert rpy == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


# ---- float32 ----

@pytest.mark.parametrize("name", ["zu3", "zu7", "pro16", "minicobo", "s12"])
def test_a_limit_given_as_float32_is_the_limit(name):
    model = load_model(name)
    requests = RequestDecoder(model)
    for side in (0, 1):
        target = [float32(pair[side]) for pair in model.joint_limits]
        command = requests.joint_move(move(pose=target))
        limits.check(command, model)
        assert all(low <= value <= high and abs(value - asked) < 1e-6 for value, asked, (low, high)
                   in zip(command.joint_position, target, model.joint_limits))


def test_one_step_of_float32_beyond_the_rounded_limit_is_refused():
    high = MODEL.joint_limits[0][1]
    beyond = float32(high * (1.0 + 4e-7))
    command = DOCUMENTED.joint_move(move(pose=[beyond] + HOME[1:]))
    assert command.joint_position[0] == beyond
    with pytest.raises(InvalidCommand, match="joint 1"):
        limits.check(command, MODEL)


def test_a_highest_speed_given_as_float32_is_the_highest_speed():
    fastest = limits.joint_speed_limit(MODEL)
    assert float32(fastest) > fastest, "the example must be one that float32 rounds up"
    assert DOCUMENTED.joint_move(move(mvvelo=float32(fastest))).speed == fastest
    assert DOCUMENTED.jog(jog(mvvelo=float32(fastest))).velocity <= fastest
    assert DOCUMENTED.joint_move(move(mvacc=float32(limits.JOINT_ACCELERATION_CEILING))).acceleration <= (
        limits.JOINT_ACCELERATION_CEILING)


# ---- servo targets by topic ----

def test_joint_targets_by_topic_come_in_any_order_and_absolute_in_both_interfaces():
    shuffled = JointState(name=["joint_6", "joint_1", "joint_2", "joint_3", "joint_4", "joint_5"],
                          position=[0.6, 0.1, 0.2, 0.3, 0.4, 0.5])
    for requests in (DOCUMENTED, VENDOR):
        assert requests.servo_joint_topic(shuffled) == c.ServoJoint((0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
        assert requests.servo_joint_topic(JointState(position=HOME)) == c.ServoJoint(tuple(HOME))


def stamped(frame="", quaternion=(0.0, 0.0, 0.0, 1.0), position=(0.4, 0.0, 0.3)):
    return PoseStamped(Header(frame_id=frame), Pose(Point(*position), Quaternion(*quaternion)))


@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3))
def test_pose_targets_by_topic_are_quaternions(rpy):
    vector = rotation_vector_from_rpy(rpy)
    angle = math.sqrt(sum(v * v for v in vector))
    axis = [v / angle if angle else 0.0 for v in vector]
    quaternion = [a * math.sin(angle / 2) for a in axis] + [math.cos(angle / 2)]
    target = DOCUMENTED.servo_pose_topic(stamped(quaternion=quaternion), "base_link").target
    assert rotation_angle_between(matrix_from_rpy(target.rpy), matrix_from_rpy(rpy)) < 1e-6
    assert target.position == (0.4, 0.0, 0.3)


@pytest.mark.parametrize("message, refusal", [
    (stamped(frame="world"), "frame_id is 'world'"), (stamped(quaternion=(0, 0, 0, 0)), "unit quaternion"),
    (stamped(quaternion=(0, 0, 1, 1)), "unit quaternion"), (stamped(position=(NAN, 0, 0)), "position.x is nan"),
    (stamped(quaternion=(0, 0, NAN, 1)), "orientation.z is nan")])
def test_pose_targets_by_topic_that_are_refused(message, refusal):
    with pytest.raises(InvalidCommand, match=refusal):
        DOCUMENTED.servo_pose_topic(message, "base_link")


# ---- state ----

def test_tool_position_is_m_and_a_rotation_vector_and_the_vendors_mm_and_degrees():
    ours = convert.tool_position(convert.tool_twist(STATE, False), None, "base_link")
    assert ours.header.frame_id == "base_link"
    assert (ours.twist.linear.x, ours.twist.linear.y, ours.twist.linear.z) == (0.4, -0.1, 0.3)
    angular = ours.twist.angular
    assert rotation_angle_between(matrix_from_rotation_vector((angular.x, angular.y, angular.z)),
                                  matrix_from_rpy((0.1, 0.2, 0.3))) < 1e-9
    theirs = convert.tool_position(convert.tool_twist(STATE, True), None, "base_link").twist
    assert (theirs.linear.x, theirs.linear.y, theirs.linear.z) == pytest.approx((400.0, -100.0, 300.0))
    assert (theirs.angular.x, theirs.angular.z) == pytest.approx((math.degrees(0.1), math.degrees(0.3)))
    assert convert.tool_twist(RobotState(tuple(HOME), True, True, True, False, False), False) is None


def test_the_vendors_tool_position_of_2025_is_mm_and_a_quaternion():
    message = convert.tool_position_2025(convert.tool_pose(STATE), None, "user_frame_3")
    assert message.header.frame_id == "user_frame_3"
    p, q = message.pose.position, message.pose.orientation
    assert (p.x, p.y, p.z) == pytest.approx((400.0, -100.0, 300.0))
    turn = matrix_from_rpy((0.1, 0.2, 0.3))
    assert q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w == pytest.approx(1.0, abs=1e-12)
    assert 2.0 * (q.x * q.y + q.z * q.w) == pytest.approx(turn[3], abs=1e-9)
    assert 2.0 * (q.y * q.z - q.x * q.w) == pytest.approx(turn[5], abs=1e-9)
    assert convert.tool_pose(RobotState(tuple(HOME), True, True, True, False, False)) is None


def test_robot_states():
    def states(*conditions):
        return convert.robot_states(convert.robot_conditions(*conditions))
    collided = RobotState(tuple(HOME), True, False, True, False, True)
    message = states(collided, True, False)
    assert (message.motion_state, message.power_state, message.servo_state, message.collision_state) == (4, 1, 1, 1)
    assert states(collided, True, True).servo_state == 0
    assert states(STATE, False, True).servo_state == 1
    assert states(STATE, False, False).servo_state == 0
    assert states(collided, True, False, True).motion_state == 4, "an alarm is shown whatever streams"
    for is_in_position in (True, False):
        shown = replace(STATE, is_in_position=is_in_position)
        assert [states(shown, True, False, moves).motion_state for moves in (True, False, None)] == [
            3, 0, 0 if is_in_position else 3]


@given(st.tuples(*[st.floats(-3.1, 3.1)] * 3))
def test_transforms_are_unit_quaternions_of_the_same_rotation(vector):
    matrix = matrix_from_rotation_vector(vector)
    q = convert.transform_message(matrix + (0.1, 0.2, 0.3), "a", "b", None).transform.rotation
    assert q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w == pytest.approx(1.0, abs=1e-12)
    assert 1.0 - 2.0 * (q.y * q.y + q.z * q.z) == pytest.approx(matrix[0], abs=1e-9)
    assert 2.0 * (q.x * q.y + q.z * q.w) == pytest.approx(matrix[3], abs=1e-9)
    assert 2.0 * (q.y * q.z - q.x * q.w) == pytest.approx(matrix[5], abs=1e-9)


@pytest.mark.parametrize("fraction, is_taken", [
    (convert.SLOWEST, True), (0.5, True), (1.0, True), (0.0, False), (0.5 * convert.SLOWEST, False), (1.01, False),
    (-0.5, False), (NAN, False)])
def test_a_speed_is_a_share_of_the_programmed_one(fraction, is_taken):
    request = SimpleNamespace(speed_slider_fraction=fraction)
    if is_taken:
        assert DOCUMENTED.speed(request) == fraction
    else:
        with pytest.raises(InvalidCommand, match="speed_slider_fraction"):
            DOCUMENTED.speed(request)


@pytest.mark.parametrize("text, workspace", [
    ("", None), (" \n", None), ("{}", NO_ZONES), ("floor: -0.1", workspace_of({"floor": -0.1}))])
def test_a_workspace_without_a_text_only_asks(text, workspace):
    assert DOCUMENTED.workspace(SimpleNamespace(yaml=text)) == workspace


def test_a_wrong_workspace_is_refused_with_its_key():
    with pytest.raises(InvalidCommand, match="unknown key 'flor'; nearest known is floor"):
        DOCUMENTED.workspace(SimpleNamespace(yaml="flor: 0"))


def test_a_negative_blend_radius_is_refused_and_another_taken():
    def decoded(radius):
        return RequestDecoder(MODEL, False, False, True).joint_move(
            MoveRequest(pose=HOME, mvvelo=0.5, mvacc=0.5, mvradii=radius))
    with pytest.raises(InvalidCommand, match="mvradii"):
        decoded(-1.0)
    assert decoded(0.0).tolerance == 0.0 and decoded(10.0).tolerance == pytest.approx(0.01)
