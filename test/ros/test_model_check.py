"""The configured model against the controller's pose: right ones agree, wrong ones are found and reported once."""
import dataclasses
import math
import random
from types import SimpleNamespace

import pytest

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.kinematics.arm_models import DhRow, load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import IDENTITY, compose, invert, pose_from_transform, transform_from_pose
from jaka_ros_driver.ros.model_check import ModelCheck
from jaka_ros_driver.state import RobotState

TOOL = transform_from_pose(Pose((0.01, -0.02, 0.12), (0.3, -0.2, 0.1)))
USER = transform_from_pose(Pose((0.2, 0.1, -0.05), (0.0, 0.4, 1.2)))


def check_of(model, tool=IDENTITY, user=IDENTITY):
    frames = SimpleNamespace(flange_t_tool=lambda state: tool, base_t_user=lambda state: user)
    return ModelCheck(SimpleNamespace(model=model), frames)


def state_of(model, joints, tool=IDENTITY, user=IDENTITY, is_in_position=True):
    pose = pose_from_transform(compose(invert(user), compose(forward(model, joints), tool)))
    return RobotState(joints, True, True, is_in_position, False, False, tcp_position=pose.position, tcp_rpy=pose.rpy)


def samples(count):
    numbers = random.Random(7)
    return [tuple(numbers.uniform(-1.4, 1.4) for _ in range(6)) for _ in range(count)]


@pytest.mark.parametrize("tool, user", [(IDENTITY, IDENTITY), (TOOL, USER)])
def test_the_right_model_agrees_everywhere(tool, user):
    model = load_model("zu7")
    check = check_of(model, tool, user)
    for joints in samples(500):
        found = check.check(state_of(model, joints, tool, user))
        assert found.distance < 1e-7 and found.angle < 1e-7 and not found.is_wrong


def test_another_model_half_a_millimetre_and_a_tenth_of_a_degree_are_found_when_seen_twice_and_logged_once(caplog):
    model = load_model("zu7")
    rows = list(model.dh)
    rows[1] = DhRow(rows[1].a + 0.0005, rows[1].d, rows[1].alpha, rows[1].theta_offset)
    last = dataclasses.replace(rows[5], theta_offset=rows[5].theta_offset + math.radians(0.1))
    for other in (load_model("zu5"), dataclasses.replace(model, dh=tuple(rows)),
                  dataclasses.replace(model, dh=(*model.dh[:5], last))):
        caplog.clear()
        check = check_of(model)
        found = [check.check(state_of(other, joints)) for joints in samples(4)]
        assert found[0] is None and all(deviation.is_wrong for deviation in found[1:])
        assert caplog.text.count("is ~model right?") == 1


def test_a_single_wrong_sample_between_right_ones_does_not_count_however_often_it_comes(caplog):
    model, other = load_model("zu7"), load_model("zu5")
    check = check_of(model)
    for joints in samples(10):
        assert check.check(state_of(other, joints)) is None
        assert not check.check(state_of(model, joints)).is_wrong
    assert "is ~model right?" not in caplog.text


def test_nothing_is_said_in_motion_or_without_pose_or_frames():
    model, joints = load_model("zu7"), samples(1)[0]
    assert check_of(model).check(state_of(model, joints, is_in_position=False)) is None
    assert check_of(model).check(RobotState(joints, True, True, True, False, False)) is None
    assert check_of(model, tool=None).check(state_of(model, joints)) is None
    assert check_of(model, user=None).check(state_of(model, joints)) is None
