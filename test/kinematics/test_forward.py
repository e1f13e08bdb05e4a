import dataclasses
import math
import random

import dh_oracle
import numpy as np
import pytest
from reference_values import reference_values

from jaka_ros_driver.kinematics import rotations
from jaka_ros_driver.kinematics.arm_models import ArmModel, load_model, model_names
from jaka_ros_driver.kinematics.forward import forward, jacobian, link_transforms, singularity_measures

MODELS = model_names()
TOOL = rotations.transform(rotations.matrix_from_rpy((0.2, -0.4, 1.0)), (0.05, -0.1, 0.3))
REFERENCES = {values["id"]: values for values in reference_values()}


def random_pairs(count, names=MODELS):
    rng = random.Random(11)
    return [(load_model(name), dh_oracle.random_joints(load_model(name), rng)) for name in names for _ in range(count)]


@pytest.mark.parametrize("name", ["ros2_fig4-6_get_fk", "ros2_fig4-7_get_ik"])
def test_poses_printed_by_a_controller_are_reproduced(name):
    reference = REFERENCES[name]
    pose = rotations.pose_from_transform(forward(load_model(reference["model"]), reference["joint_rad"]))
    assert np.array(pose.position) * 1e3 == pytest.approx(reference["pose"][:3], abs=1e-4)
    assert pose.rpy == pytest.approx(reference["pose"][3:], abs=1e-6)


def test_the_orientation_printed_in_the_sdk_manual_is_reproduced_to_its_digits():
    reference = REFERENCES["sdk_manual_4.8"]
    rpy = rotations.rpy_from_matrix(forward(load_model(reference["model"]), reference["joint_rad"]))
    assert rpy == pytest.approx(reference["pose"][3:], abs=5e-6)


def test_forward_is_the_product_of_the_dh_table():
    for model, joints in random_pairs(30):
        assert dh_oracle.error(dh_oracle.as_matrix(forward(model, joints)), dh_oracle.flange(model, joints)) < 1e-14


def test_link_transforms_run_from_the_base_to_the_flange():
    for model, joints in random_pairs(3):
        frames = link_transforms(model, joints)
        assert len(frames) == 7 and frames[0] == rotations.IDENTITY and frames[6] == forward(model, joints)
        for frame, expected in zip(frames, dh_oracle.matrices(model, joints)):
            assert dh_oracle.error(dh_oracle.as_matrix(frame), expected) < 1e-14


@pytest.mark.parametrize("tool", [None, TOOL])
def test_jacobian_is_the_rate_of_the_tool_pose(tool):
    step = 1e-6
    for model, joints in random_pairs(4):
        columns = jacobian(model, joints, tool)
        assert columns.shape == (6, 6)
        at = rotations.compose(forward(model, joints), tool or rotations.IDENTITY)
        for n in range(6):
            moved = list(joints)
            moved[n] += step
            then = rotations.compose(forward(model, moved), tool or rotations.IDENTITY)
            linear = (np.array(then[9:]) - at[9:]) / step
            turn = rotations.compose(then[:9] + (0.0, 0.0, 0.0), rotations.invert(at[:9] + (0.0, 0.0, 0.0)))
            angular = np.array(rotations.rotation_vector_from_matrix(turn)) / step
            assert np.concatenate([linear, angular]) == pytest.approx(columns[:, n], abs=1e-5)


@pytest.mark.parametrize("name", [name for name in MODELS if name != "a12"])
def test_the_determinant_is_the_product_of_the_measures(name):
    for model, joints in random_pairs(10, [name]):
        measures = singularity_measures(model, joints)
        fore = model.dh[2].a or model.dh[3].d
        assert abs(np.linalg.det(jacobian(model, joints))) == pytest.approx(
            model.dh[1].a * fore * measures.wrist * measures.elbow * measures.shoulder, abs=1e-12)


def test_measures_are_zero_at_the_singularities():
    zu7 = load_model("zu7")
    assert singularity_measures(zu7, (0.1, 1.0, -1.2, 0.4, 0.0, 0.3)).wrist == 0.0
    assert singularity_measures(zu7, (0.1, 1.0, 0.0, 0.4, 1.0, 0.3)).elbow == 0.0
    upper, fore, wrist = zu7.dh[1].a, zu7.dh[2].a, zu7.dh[4].d
    q2, q3 = math.pi / 2 - 0.1, 0.3
    q4 = math.asin(-(upper * math.cos(q2) + fore * math.cos(q2 + q3)) / wrist) - q2 - q3
    above_axis = singularity_measures(zu7, (0.1, q2, q3, q4, 1.0, 0.3))
    assert above_axis.shoulder == pytest.approx(0.0, abs=1e-15)
    upright = singularity_measures(load_model("minicobo"), (0.0,) * 6)
    assert upright == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)


def test_the_a12_has_one_measure_from_its_determinant():
    for model, joints in random_pairs(10, ["a12"]):
        measures = singularity_measures(model, joints)
        assert measures.wrist == pytest.approx(abs(np.linalg.det(jacobian(model, joints))) / (0.77 * 0.5515 * 1.3215))
        assert measures.elbow == measures.shoulder == math.inf


@pytest.mark.parametrize("name, joint, measure", [
    ("zu7", 2, "elbow"), ("minicobo", 2, "elbow"), ("zu7", 4, "wrist"), ("minicobo", 4, "wrist")])
def test_joint_offsets_count_for_singularities(name, joint, measure):
    # An arm whose joint reads 0.3 rad less than its DH angle is singular where it would be without, less 0.3 rad.
    nominal = load_model(name)
    rows = list(nominal.dh)
    rows[joint] = dataclasses.replace(rows[joint], theta_offset=rows[joint].theta_offset + 0.3)
    model = ArmModel(name="offset", family=nominal.family, dh=tuple(rows), joint_limits=nominal.joint_limits,
                     joint_max_speed=nominal.joint_max_speed)
    joints = [0.3, 1.2, -1.1, 0.8, 1.3, 0.2]
    shifted = list(joints)
    shifted[joint] -= 0.3
    assert getattr(singularity_measures(model, shifted), measure) == pytest.approx(
        getattr(singularity_measures(nominal, joints), measure), abs=1e-12)
