import dataclasses
import enum
import math
import re
import typing

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaka_ros_driver import commands as c
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.state import IoBank, RobotState

ZU7, ZU3, C7 = load_model("zu7"), load_model("zu3"), load_model("c7")
HOME = (0.0, 1.57, -1.57, 1.57, 1.57, 0.0)
POSE = c.Pose((0.4, 0.1, 0.3), (math.pi, 0.0, 0.0))
BASE, TOOL, JOINT = c.JogFrame.BASE, c.JogFrame.TOOL, c.JogFrame.JOINT
NAN, INF = math.nan, math.inf

GOOD = [
    c.JointMove(HOME, 1.0, 2.0), c.LinearMove(POSE, 0.25, 1.0), c.LinearMove(POSE, 2.5, 8.0, 0.0),
    c.LinearMove(POSE, 0.25, 1.0, 0.001, math.pi, 4.0 * math.pi),
    *(kind(*target, np.float32(limits.SLOWEST), np.float32(limits.WEAKEST)) for kind, target in (
        (c.JointMove, (HOME,)), (c.LinearMove, (POSE,)), (c.ArcMove, (POSE, POSE)))),
    c.Jog(JOINT, 0, -float(np.float32(limits.SLOWEST))),
    c.Jog(JOINT, 5, -3.0), c.Jog(BASE, 0, 0.1), c.Jog(TOOL, 3, -1.0), c.JogStop(BASE, 2), c.Stop(),
    c.JointMove(HOME, 1.0, 2.0, 0.05), c.ArcMove(POSE, POSE, 0.25, 1.0), c.ArcMove(POSE, POSE, 0.25, 1.0, 0.05),
    c.LoadProgram("weld 2.jks"), c.PlayProgram(), c.PauseMotion(), c.ResumeMotion(),
    c.SetServoMode(True), c.ServoJoint(HOME), c.ServoJoint((0.001,) * 6, relative=True, cycles=2),
    c.ServoPose(POSE), c.ServoPose(POSE, True, 4), c.SetPower(True), c.SetEnabled(False), c.ClearError(),
    c.SetToolFrame(1, POSE, "gripper"), c.SetToolFrame(11, POSE, ""), c.SelectTool(0), c.SelectTool(11),
    c.SetUserFrame(10, POSE, "table"), c.SelectUserFrame(0), c.SelectUserFrame(10), c.SetPayload(0.0, (0.0, 0.0, 0.0)),
    c.SetPayload(1.25, (0, 0, 0.04)), c.SetHandGuiding(False), c.SetCollisionLevel(0), c.SetCollisionLevel(5),
    c.SetDigitalOutput(IoBank.TOOL, 0, True), c.SetAnalogOutput(IoBank.CABINET, 7, -4.5), c.SetRapidRate(0.0),
    c.SetRapidRate(1.0), c.SetFeedPeriod(0.008), c.ForwardKinematics(HOME), c.InverseKinematics(POSE, HOME),
    c.SetLinkLoss(0.0), c.SetLinkLoss(0.3), c.Query.VERSION, c.Query.PAYLOAD, c.GetDigitalOutput(IoBank.EXTENSION, 63),
    c.GetAnalogOutput(IoBank.TOOL, 0), c.GetDigitalInput(IoBank.TOOL, 0), c.GetAnalogInput(IoBank.TOOL, 0),
    c.ZeroForceSensor(),
]

COMMAND_CLASSES = typing.get_args(c.Command)


def state(**changes):
    values = {"joint_position": HOME, "is_powered": True, "is_enabled": True, "is_in_position": True,
              "emergency_stop": False, "protective_stop": False}
    values.update(changes)
    return RobotState(**values)


@pytest.mark.parametrize("command", GOOD, ids=repr)
def test_a_sound_command_passes_with_and_without_a_state(command):
    limits.check(command, ZU7)
    limits.check(command, ZU7, state())


def test_every_command_class_is_audited_and_tried_here():
    assert set(limits._CHECKERS) == set(COMMAND_CLASSES)
    assert {type(command) for command in GOOD} == set(COMMAND_CLASSES)


class Unheard:
    pass


@pytest.mark.parametrize("thing", [Unheard(), None, "stop", c.Stop, POSE])
def test_what_is_no_command_is_refused(thing):
    with pytest.raises(InvalidCommand, match="no command"):
        limits.check(thing, ZU7)


def spoiled():
    """Yield each field of each sound command in turn replaced by things that it can never hold."""
    for command in GOOD:
        if isinstance(command, enum.Enum):
            continue
        for field in dataclasses.fields(command):
            value = getattr(command, field.name)
            for bad in () if value is None else spoil(value):
                if bad is None and field.default is None:
                    continue
                yield dataclasses.replace(command, **{field.name: bad}), field.name


def spoil(value):
    if isinstance(value, c.Pose):
        for bad in spoil(value.position):
            yield c.Pose(bad, value.rpy)
            yield c.Pose(value.position, bad)
        yield None
        yield value.position
    elif isinstance(value, tuple):
        yield from ((), value[:-1], value + (0.0,), None, "012345"[:len(value)], set(range(len(value))), 7)
        for n in range(len(value)):
            for bad in (NAN, INF, -INF, None, "1", True, 10 ** 400):
                yield value[:n] + (bad,) + value[n + 1:]
    elif isinstance(value, bool):
        yield from (None, 1, 0, "true")
    elif isinstance(value, str):
        yield from (None, 5, b"name")
    elif isinstance(value, enum.Enum):
        yield from (None, 7, -1, "BASE", True)
    elif isinstance(value, int) and not isinstance(value, bool):
        yield from (NAN, None, "1", True, 1.0, -1)
    else:
        yield from (NAN, INF, -INF, None, "1", True, 10 ** 400)


SPOILED = list(spoiled())


def test_no_field_accepts_what_it_cannot_hold():
    assert len(SPOILED) > 500
    passed = []
    for command, field in SPOILED:
        try:
            limits.check(command, ZU7, state())
            passed.append(command)
        except InvalidCommand as error:
            assert re.match(re.escape(field.split(".")[0]), str(error)), (command, str(error))
    assert not passed


OVER_SPEED = math.pi * (1.0 + 1e-6)
REFUSED = [
    # command, words of the message: field, value, range
    (c.JointMove(HOME, 0.0, 1.0), ("speed", "0 rad/s", "valid: 0.0005 to 3.14159265 rad/s")),
    (c.JointMove(HOME, -1.0, 1.0), ("speed", "-1 rad/s")),
    (c.JointMove(HOME, OVER_SPEED, 1.0), ("speed", "3.14159")),
    (c.JointMove(HOME, 1.0, 0.0), ("acceleration", "0 rad/s2")),
    (c.JointMove(HOME, 1.0, 12.57), ("acceleration", "12.57", "12.5663706")),
    (c.JointMove((0, 1.57, -1.57, 1.57, 1.57), 1.0, 1.0), ("joint_position", "6 numbers")),
    (c.JointMove((0, 4.63, -1.57, 1.57, 1.57, 0), 1.0, 1.0),
     ("joint_position[1]", "joint 2", "4.63", "-1.4835", "4.6251")),
    (c.JointMove((0, 1.57, -3.06, 1.57, 1.57, 0), 1.0, 1.0), ("joint_position[2]", "joint 3", "-3.06")),
    (c.LinearMove(POSE, 2.51, 1.0), ("speed", "2.51", "2.5 m/s")),
    (c.LinearMove(POSE, 0.0, 1.0), ("speed", "valid: 0.0005 to 2.5 m/s")),
    (c.JointMove(HOME, 1e-45, 1.0), ("speed", "0.0005 to")),
    (c.JointMove(HOME, 4.9e-4, 1.0), ("speed", "0.00049 rad/s")),
    (c.JointMove(HOME, 1.0, 1e-45), ("acceleration", "0.005 to 12.5663706 rad/s2")),
    (c.LinearMove(POSE, 1e-45, 1.0), ("speed",)), (c.LinearMove(POSE, 1.0, 4.9e-3), ("acceleration", "0.0049 m/s2")),
    (c.LinearMove(POSE, 1.0, 1.0, 0.0, 1e-45), ("angular_speed",)),
    (c.LinearMove(POSE, 1.0, 1.0, 0.0, 1.0, 1e-45), ("angular_acceleration", "0.005 to")),
    (c.ArcMove(POSE, POSE, 1e-45, 1.0), ("speed",)), (c.ArcMove(POSE, POSE, 1.0, 1e-45), ("acceleration",)),
    (c.Jog(JOINT, 0, 1e-45), ("velocity", "0.0005 to 3.14159265 rad/s")), (c.Jog(BASE, 0, -4.9e-4), ("velocity",)),
    (c.LinearMove(POSE, 1.0, 8.1), ("acceleration", "8.1", "8 m/s2")),
    (c.LinearMove(POSE, 1.0, -1.0), ("acceleration",)),
    (c.LinearMove(POSE, 1.0, 1.0, 0.0, 0.0), ("angular_speed", "0 rad/s", "valid: 0.0005 to 3.14159265 rad/s")),
    (c.LinearMove(POSE, 1.0, 1.0, 0.0, OVER_SPEED), ("angular_speed", "3.14159", "to 3.14159265 rad/s")),
    (c.LinearMove(POSE, 1.0, 1.0, 0.0, 1.0, 12.57), ("angular_acceleration", "12.57", "12.5663706 rad/s2")),
    (c.LinearMove(POSE, 1.0, 1.0, 0.0, 1.0, -1.0), ("angular_acceleration", "-1 rad/s2")),
    (c.LinearMove(POSE, 1.0, 1.0, -0.001), ("tolerance", "-0.001 m", "0 to 1 m")),
    (c.Jog(JOINT, 0, 3.2), ("velocity", "3.2", "3.14159265")),
    (c.Jog(JOINT, 0, 0.0), ("velocity", "0 rad/s", "direction")),
    (c.Jog(BASE, 0, -2.6), ("velocity", "-2.6", "2.5 m/s")),
    (c.Jog(TOOL, 4, 3.2), ("velocity", "rad/s")),
    (c.Jog(BASE, 6, 0.1), ("axis", "6", "0 to 5")),
    (c.JogStop(BASE, -1), ("axis", "-1", "0 to 5")),
    (c.ServoJoint((0, 4.7, -1.57, 1.57, 1.57, 0)), ("joint_position[1]", "joint 2")),
    (c.ServoJoint((0.03, 0, 0, 0, 0, 0), relative=True), ("joint_position[0]", "0.03", "0.0251327")),
    (c.ServoJoint(HOME, cycles=0), ("cycles", "0", "1 to 1000")),
    (c.ServoPose(POSE, cycles=0), ("cycles",)),
    (c.SetToolFrame(0, POSE, "x"), ("tool_id", "0", "1 to 11")),
    (c.SetToolFrame(12, POSE, "x"), ("tool_id", "12", "1 to 11")),
    (c.SelectTool(12), ("tool_id", "0 to 11")),
    (c.SelectTool(-1), ("tool_id", "0 to 11")),
    (c.SetUserFrame(11, POSE, "x"), ("user_frame_id", "11", "1 to 10")),
    (c.SetUserFrame(0, POSE, "x"), ("user_frame_id", "1 to 10")),
    (c.SelectUserFrame(11), ("user_frame_id", "0 to 10")),
    (c.SetPayload(-0.1, (0, 0, 0)), ("mass", "-0.1 kg", "0 to 100 kg")),
    (c.SetCollisionLevel(6), ("level", "6", "0 to 5")),
    (c.SetCollisionLevel(-1), ("level", "0 to 5")),
    (c.SetDigitalOutput(IoBank.CABINET, -1, True), ("index", "-1", "0 to 1023")),
    (c.GetAnalogOutput(IoBank.CABINET, -1), ("index", "-1")),
    (c.JointMove(HOME, 1.0, 2.0, -0.001), ("tolerance", "-0.001 m", "0 to 1 m")),
    (c.ArcMove(POSE, POSE, 0.0, 1.0), ("speed", "valid: 0.0005 to")),
    (c.ArcMove(POSE, c.Pose((11.0, 0.0, 0.0), (0.0,) * 3), 0.2, 1.0), ("target.position[0]", "11")),
    (c.ArcMove(POSE, POSE, 0.2, 1.0, 1.5), ("tolerance", "1.5 m")),
    (c.LoadProgram(""), ("name", "1 to 100")), (c.LoadProgram("../etc/passwd"), ("name", "without folder")),
    (c.LoadProgram("a\nb"), ("name", "printable")), (c.LoadProgram("x" * 101), ("name", "100")),
    (c.SetRapidRate(1.01), ("rate", "1.01", "0 to 1")),
    (c.SetRapidRate(-0.01), ("rate", "-0.01")),
    (c.SetFeedPeriod(0.0), ("period", "0 s", "0.001 to 10 s")),
    (c.SetFeedPeriod(11.0), ("period", "11 s")),
    (c.SetLinkLoss(-0.1), ("seconds", "-0.1 s", "0 to 10 s")),
    (c.SetLinkLoss(10.1), ("seconds", "10.1 s", "0 to 10 s")),
]

FAR = "-10 to 10 m"
TWO_TURNS = "-12.5663706 to 12.5663706 rad"


def at(x):
    return c.Pose((0.4, x, 0.3), (math.pi, 0.0, 0.0))


def turned(angle):
    return c.Pose((0.4, 0.1, 0.3), (0.0, 0.0, angle))


def joints(angle):
    return HOME[:5] + (angle,)


BOUNDED = [
    # one field at a time: the command made with a value, the bounds that pass, words of a refusal
    (lambda x: c.LinearMove(at(x), 0.1, 1.0), (-10.0, 10.0), ("target.position[1]", FAR)),
    (lambda x: c.ServoPose(at(x)), (-10.0, 10.0), ("target.position[1]", FAR)),
    (lambda x: c.ServoPose(at(x), True), (-10.0, 10.0), ("target.position[1]", FAR)),
    (lambda x: c.SetToolFrame(1, at(x), ""), (-10.0, 10.0), ("pose.position[1]", FAR)),
    (lambda x: c.SetUserFrame(1, at(x), ""), (-10.0, 10.0), ("pose.position[1]", FAR)),
    (lambda x: c.InverseKinematics(at(x), HOME), (-10.0, 10.0), ("target.position[1]", FAR)),
    (lambda x: c.LinearMove(turned(x), 0.1, 1.0), (-4 * math.pi, 4 * math.pi), ("target.rpy[2]", TWO_TURNS)),
    (lambda x: c.ServoPose(turned(x)), (-4 * math.pi, 4 * math.pi), ("target.rpy[2]", TWO_TURNS)),
    (lambda x: c.SetToolFrame(1, turned(x), ""), (-4 * math.pi, 4 * math.pi), ("pose.rpy[2]", TWO_TURNS)),
    (lambda x: c.SetUserFrame(1, turned(x), ""), (-4 * math.pi, 4 * math.pi), ("pose.rpy[2]", TWO_TURNS)),
    (lambda x: c.InverseKinematics(turned(x), HOME), (-4 * math.pi, 4 * math.pi), ("target.rpy[2]", TWO_TURNS)),
    (lambda x: c.InverseKinematics(POSE, joints(x)), (-4 * math.pi, 4 * math.pi), ("reference[5]", TWO_TURNS)),
    (lambda x: c.ForwardKinematics(joints(x)), (-4 * math.pi, 4 * math.pi), ("joint_position[5]", TWO_TURNS)),
    (lambda x: c.LinearMove(POSE, 0.1, 1.0, x), (0.0, 1.0), ("tolerance", "0 to 1 m")),
    (lambda x: c.SetPayload(x, (0.0, 0.0, 0.0)), (0.0, 100.0), ("mass", "0 to 100 kg")),
    (lambda x: c.SetPayload(1.0, (0.0, 0.0, x)), (-2.0, 2.0), ("centroid[2]", "-2 to 2 m")),
    (lambda x: c.SetAnalogOutput(IoBank.TOOL, 0, x), (-1000.0, 1000.0), ("value", "-1000 to 1000 V or mA")),
]


@pytest.mark.parametrize("make, bounds, words", BOUNDED)
def test_no_finite_number_is_too_big_to_be_refused(make, bounds, words):
    low, high = bounds
    for value in (low, high, float(np.float32(low)), float(np.float32(high)), int(high)):
        limits.check(make(value), ZU7)
    for value in (high * (1.0 + 1e-6), low - 1e-6 * (high - low), 1e30, -1e30, 1e38, -1e38, 1.7e308, 10 ** 300):
        with pytest.raises(InvalidCommand) as caught:
            limits.check(make(value), ZU7)
        assert all(word in str(caught.value) for word in (*words, "%.9g" % value))


@pytest.mark.parametrize("make, highest", [
    (lambda n: c.SetDigitalOutput(IoBank.EXTENSION, n, True), 1023),
    (lambda n: c.GetAnalogOutput(IoBank.TOOL, n), 1023),
    (lambda n: c.ServoJoint(HOME, cycles=n), 1000), (lambda n: c.ServoJoint((0.0,) * 6, True, n), 1000),
    (lambda n: c.ServoPose(POSE, cycles=n), 1000)])
def test_no_whole_number_is_too_big_to_be_refused(make, highest):
    limits.check(make(highest), ZU7)
    for value in (highest + 1, 2 ** 31, 2 ** 63, 10 ** 400):
        with pytest.raises(InvalidCommand, match=" to %d" % highest):
            limits.check(make(value), ZU7)


def inflated(value, big):
    """Yield the same thing once for each number in it, with that number replaced."""
    if isinstance(value, (bool, enum.Enum)) or value is None or isinstance(value, str):
        return
    if isinstance(value, tuple):
        for n, item in enumerate(value):
            for other in inflated(item, big):
                yield value[:n] + (other,) + value[n + 1:]
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            for other in inflated(getattr(value, field.name), big):
                yield dataclasses.replace(value, **{field.name: other})
    else:
        yield type(value)(big)


@pytest.mark.parametrize("big", [1e4, 1e9, 1e30, -1e4, -1e38])
def test_no_number_of_any_command_may_be_huge(big):
    tried = [other for command in GOOD for other in inflated(command, big)]
    assert len(tried) > 100
    for command in tried:
        with pytest.raises(InvalidCommand, match="valid: "):
            limits.check(command, ZU7)


@pytest.mark.parametrize("command, words", REFUSED, ids=lambda value: "" if isinstance(value, tuple) else repr(value))
def test_a_value_outside_its_range_is_named_with_the_range(command, words):
    with pytest.raises(InvalidCommand) as caught:
        limits.check(command, ZU7)
    for word in words:
        assert word in str(caught.value)


def test_the_bounds_themselves_pass():
    for n in range(6):
        for bound in ZU7.joint_limits[n]:
            joints = HOME[:n] + (bound,) + HOME[n + 1:]
            limits.check(c.JointMove(joints, math.pi, 4.0 * math.pi), ZU7)
            limits.check(c.ServoJoint(joints), ZU7)
    limits.check(c.LinearMove(POSE, 2.5, 8.0), ZU7)
    limits.check(c.ServoJoint((0.008 * math.pi,) * 6, relative=True), ZU7)


def test_the_bounds_pass_after_a_trip_through_float32():
    as_float32 = lambda value: float(np.float32(value))  # noqa: E731
    for model in (ZU7, ZU3, load_model("minicobo")):
        for n in range(6):
            for bound in model.joint_limits[n]:
                joints = [0.0] * 6
                joints[n] = as_float32(bound)
                limits.check(c.JointMove(tuple(joints), as_float32(limits.joint_speed_limit(model)),
                                         as_float32(limits.JOINT_ACCELERATION_CEILING)), model)
    limits.check(c.SetRapidRate(as_float32(1.0)), ZU7)


def test_numpy_numbers_are_numbers():
    limits.check(c.JointMove(tuple(np.array(HOME)), np.float32(1.0), np.int64(1)), ZU7)


def test_joint_speed_is_bounded_by_the_fastest_joint_and_the_controllers_ceiling():
    assert limits.joint_speed_limit(ZU3) == math.pi  # its wrist does 220 deg/s, the controller no more than 180
    assert limits.joint_speed_limit(load_model("minicobo")) == pytest.approx(math.pi / 2)
    assert limits.joint_speed_limit(load_model("c12")) == pytest.approx(math.radians(150.0))
    zu12 = load_model("zu12")
    limits.check(c.Jog(JOINT, 5, math.pi), zu12)
    with pytest.raises(InvalidCommand, match="velocity"):
        limits.check(c.Jog(JOINT, 0, math.pi), zu12)


def test_an_unknown_tcp_speed_is_bounded_with_care():
    assert C7.tcp_max_speed is None
    limits.check(c.LinearMove(POSE, 1.5, 1.0), C7)
    with pytest.raises(InvalidCommand, match="1.5 m/s"):
        limits.check(c.LinearMove(POSE, 1.6, 1.0), C7)


MOVING = [command for command in GOOD
          if isinstance(command, (c.JointMove, c.LinearMove, c.ArcMove, c.Jog, c.ServoJoint, c.ServoPose))]


@pytest.mark.parametrize("command", GOOD, ids=repr)
def test_only_what_moves_needs_the_drives_enabled(command):
    disabled = state(is_enabled=False)
    if command in MOVING:
        with pytest.raises(InvalidCommand, match="not enabled"):
            limits.check(command, ZU7, disabled)
    else:
        limits.check(command, ZU7, disabled)


def test_a_relative_servo_target_may_not_leave_the_limits():
    on_the_limit = state(joint_position=HOME[:1] + (ZU7.joint_limits[1][1],) + HOME[2:])
    inward, outward = (0.0, -0.01, 0.0, 0.0, 0.0, 0.0), (0.0, 0.01, 0.0, 0.0, 0.0, 0.0)
    limits.check(c.ServoJoint(inward, relative=True), ZU7, on_the_limit)
    with pytest.raises(InvalidCommand, match="joint 2"):
        limits.check(c.ServoJoint(outward, relative=True), ZU7, on_the_limit)


def braked_way(speed, acceleration, period):
    """Return the way of a brake in whole cycles, the cycle at the full speed included."""
    way = 0.0
    while speed > 0.0:
        way += speed * period
        speed -= acceleration * period
    return way


@pytest.mark.parametrize("acceleration, period", [(4.0 * math.pi, 0.008), (3.6 * math.pi, 0.008), (1.0, 0.004)])
@given(distance=st.floats(0.0, 3.0))
def test_the_stoppable_speed_is_the_highest_whose_stop_in_whole_cycles_fits(distance, acceleration, period):
    speed = limits.stoppable_speed(distance, acceleration, period)
    assert braked_way(speed, acceleration, period) <= distance + 1e-12
    assert braked_way(speed + 1e-6, acceleration, period) > distance
    behind = braked_way(speed, acceleration, period) - speed * period
    assert limits.braked_steps(speed / (acceleration * period)) * speed * period == pytest.approx(behind, abs=1e-12)


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=0, max_size=8),
       st.floats(allow_nan=True, allow_infinity=True), st.floats(allow_nan=True, allow_infinity=True))
def test_a_joint_move_passes_only_inside_every_bound(joints, speed, acceleration):
    inside = (len(joints) == 6
              and all(low <= angle <= high for angle, (low, high) in zip(joints, ZU7.joint_limits))
              and 0.0 < speed <= math.pi and 0.0 < acceleration <= 4.0 * math.pi)
    try:
        limits.check(c.JointMove(tuple(joints), speed, acceleration), ZU7)
    except InvalidCommand:
        assert not inside
    else:
        slack = 1.0 + 2.0 * limits.FLOAT32_SLACK
        assert len(joints) == 6 and 0.0 < speed <= math.pi * slack and 0.0 < acceleration <= 4.0 * math.pi * slack
