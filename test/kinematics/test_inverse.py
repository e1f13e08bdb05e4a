import math
import random

import dh_oracle
import numpy as np
import pytest
from reference_values import reference_values

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import InvalidCommand, PoseOutsideLimits, UnreachablePose
from jaka_ros_driver.kinematics import closed_forms, inverse, numeric_inverse, rotations
from jaka_ros_driver.kinematics.arm_models import THREE_PARALLEL, ArmModel, DhRow, load_model, model_names
from jaka_ros_driver.kinematics.forward import forward, singularity_measures
from jaka_ros_driver.units import mm_to_m

ZU7, MINICOBO, A12 = load_model("zu7"), load_model("minicobo"), load_model("a12")
ONE_OF_EACH_FAMILY = (ZU7, MINICOBO, A12)
HOME = (0.0, math.pi / 2, -math.pi / 2, math.pi / 2, math.pi / 2, 0.0)


def beside(joints, offset, random):
    return tuple(angle + random.uniform(-offset, offset) for angle in joints)


def error(model, joints, target):
    reached = forward(model, joints)
    return max(rotations.distance_between(reached, target), rotations.rotation_angle_between(reached, target))


@pytest.mark.parametrize("name", model_names())
def test_every_original_is_found_and_every_branch_reaches_the_pose(name):
    model, rng = load_model(name), random.Random(5)
    for _ in range(100 if name == "a12" else 300):
        joints = dh_oracle.random_joints(model, rng)
        target = forward(model, joints)
        branches = inverse.inverse_all(model, target)
        assert len(branches) <= 8 or name == "a12"
        assert min(dh_oracle.distance(joints, branch) for branch in branches) < 1e-7
        for branch in branches:
            assert all(-math.pi < angle <= math.pi for angle in branch)
            assert error(model, branch, target) < 1e-9


@pytest.mark.parametrize("name", model_names())
def test_the_branch_next_to_the_reference_is_chosen(name):
    model, rng = load_model(name), random.Random(6)
    for _ in range(50):
        joints = dh_oracle.random_joints(model, rng)
        found = inverse.inverse(model, forward(model, joints), beside(joints, 0.01, rng))
        assert found == pytest.approx(joints, abs=1e-6)


@pytest.mark.parametrize("band", [0.05, 0.2, 0.5])
@pytest.mark.parametrize("name", [name for name in model_names() if load_model(name).family == THREE_PARALLEL])
def test_a_pose_that_leaves_q6_free_is_reached_though_not_with_that_of_the_reference(name, band):
    model, rng = load_model(name), random.Random(3)
    for _ in range(150):
        joints = [0.75 * rng.uniform(low, high) for low, high in model.joint_limits]
        joints[4] = 0.0
        reference = [min(max(angle + rng.uniform(-band, band), low), high)
                     for angle, (low, high) in zip(joints, model.joint_limits)]
        target = forward(model, joints)
        found = inverse.inverse(model, target, reference)
        assert error(model, found, target) < inverse.POSITION_TOLERANCE
        near = min(max(abs(rotations.wrap_angle(a - b)) for a, b in zip(branch, reference))
                   for branch in inverse.inverse_all(model, target, reference))
        assert near < 1.0 + 2.0 * band, "a branch that is near"
        assert all(low <= angle <= high for angle, (low, high) in zip(found, model.joint_limits))


def test_a_q6_with_which_the_arm_reaches_is_kept_where_q6_is_free():
    joints = (0.2, 1.2, -1.3, 0.8, 0.0, 0.4)
    for q6 in (0.3, 0.4, 0.6):
        reference = (*joints[:5], q6)
        assert inverse.inverse(ZU7, forward(ZU7, joints), reference)[5] == pytest.approx(q6, abs=1e-9)


def test_the_solution_printed_by_a_controller_is_reproduced():
    reference = next(values for values in reference_values() if "ref_joint" in values)
    x, y, z, rx, ry, rz = reference["pose"]
    target = rotations.transform_from_pose(Pose((mm_to_m(x), mm_to_m(y), mm_to_m(z)), (rx, ry, rz)))
    found = inverse.inverse(load_model(reference["model"]), target, reference["ref_joint"])
    assert found == pytest.approx(reference["joint_rad"], abs=1e-6)


def test_whole_turns_follow_the_reference_within_the_limits():
    target = forward(ZU7, HOME)
    for turns in ((1, 0, 0, 0, 0, 0), (-1, 0, 0, 0, -1, 1), (0, 0, 0, 0, -1, -1)):
        turned = tuple(angle + math.tau * turn for angle, turn in zip(HOME, turns))
        reference = tuple(angle * 0.98 for angle in turned)
        assert inverse.inverse(ZU7, target, reference) == pytest.approx(turned, abs=1e-9)
    beyond = (HOME[0], HOME[1], HOME[2], HOME[3], HOME[4] + math.tau, HOME[5])
    assert inverse.inverse(narrowed(ZU7, 0, -1.0, 1.0), target, beyond)[4] <= ZU7.joint_limits[4][1]


def test_a_joint_beyond_half_a_turn_is_given_in_its_own_range():
    joints = (0.3, math.radians(250.0), -1.2, math.radians(200.0), 1.0, 0.5)
    assert inverse.inverse(ZU7, forward(ZU7, joints), joints) == pytest.approx(joints, abs=1e-9)


def test_a_joint_on_its_limit_is_reached():
    for n in range(6):
        for bound in (0, 1):
            joints = [0.3, 1.2, -1.1, 0.8, 1.3, 0.2]
            joints[n] = ZU7.joint_limits[n][bound]
            found = inverse.inverse(ZU7, forward(ZU7, joints), joints)
            assert found == pytest.approx(joints, abs=1e-7)
            assert all(low <= angle <= high for angle, (low, high) in zip(found, ZU7.joint_limits))


@pytest.mark.parametrize("bound", [0, 1], ids=["lower", "upper"])
def test_rounding_of_a_pose_does_not_turn_a_joint_on_its_limit_away(bound):
    rng = random.Random(10)
    for number in range(600):
        joints = list(dh_oracle.random_joints(ZU7, rng))
        joints[number % 6] = ZU7.joint_limits[number % 6][bound]
        if min(singularity_measures(ZU7, joints)) > 0.05:
            found = inverse.inverse(ZU7, forward(ZU7, joints), joints)
            assert found == pytest.approx(joints, abs=1e-6), (number, joints)


def test_the_nearest_of_all_branches_and_turns_is_chosen():
    rng = random.Random(7)
    for _ in range(50):
        target = forward(ZU7, dh_oracle.random_joints(ZU7, rng))
        reference = [rng.uniform(low, high) for low, high in ZU7.joint_limits]
        costs = []
        for branch in inverse.inverse_all(ZU7, target, reference):
            nearest = []
            for angle, near, (low, high) in zip(branch, reference, ZU7.joint_limits):
                nearest.append(min((abs(angle + math.tau * turn - near) for turn in range(-2, 3)
                                    if low <= angle + math.tau * turn <= high), default=math.inf))
            costs.append(sum(difference ** 2 for difference in nearest))
        found = inverse.inverse(ZU7, target, reference)
        assert sum((a - b) ** 2 for a, b in zip(found, reference)) == pytest.approx(min(costs))


def stretched_elbow(model, joints):
    """Return joint 3, rad, at which the elbow is stretched."""
    return min((singularity_measures(model, (*joints[:2], q3, *joints[3:])).elbow, q3)
               for q3 in (-math.pi / 2, 0.0, math.pi / 2))[1]


@pytest.mark.parametrize("model", [model for model in map(load_model, model_names()) if model.has_closed_form],
                         ids=lambda model: model.name)
def test_no_branch_is_nearer_beside_the_stretched_elbow(model):
    rng = random.Random(17)
    for _ in range(200):
        joints = list(dh_oracle.random_joints(model, rng))
        joints[2] = stretched_elbow(model, joints) + rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-9.0, -1.0)
        apart = 10.0 ** rng.uniform(-2.0, -1.2)  # most cases are where the nearest solution is 0.05 rad away
        reference = tuple(min(max(angle + rng.gauss(0.0, apart), low), high)
                          for angle, (low, high) in zip(joints, model.joint_limits))
        found = inverse.inverse(model, forward(model, joints), reference)
        assert math.dist(found, reference) <= math.dist(joints, reference) + 1e-6


@pytest.mark.parametrize("name", ["zu7", "zu18", "c12", "a12", "minicobo"])
def test_a_calibrated_arm_beside_its_stretched_elbow_finds_what_it_reaches_near_the_reference_or_nearest(name):
    nominal, rng, farther = load_model(name), random.Random(18), 0
    for _ in range(150):
        model = calibrated(nominal, rng)
        joints = list(dh_oracle.random_joints(model, rng))
        joints[2] = rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-6.0, -1.0) - nominal.dh[2].theta_offset
        apart = 10.0 ** rng.uniform(-2.0, -1.2)
        reference = tuple(min(max(angle + rng.gauss(0.0, apart), low), high)
                          for angle, (low, high) in zip(joints, model.joint_limits))
        target = forward(model, joints)
        found = inverse.inverse(model, target, reference)
        assert rotations.distance_between(forward(model, found), target) <= inverse.POSITION_TOLERANCE
        farther += (max(abs(a - b) for a, b in zip(found, reference)) > 0.05
                    and math.dist(found, reference) > 1.05 * math.dist(joints, reference))
    assert farther <= 1, "the wrist is beside a singularity, too"


def rounded_to_float32(target):
    """Return what is left of a pose that was sent as float32 mm and a float32 rotation vector."""
    vector = [float(np.float32(angle)) for angle in rotations.rotation_vector_from_matrix(target)]
    position = [mm_to_m(float(np.float32(length * 1000.0))) for length in target[9:]]
    return rotations.transform(rotations.matrix_from_rotation_vector(vector), position)


def singular(model, kind, rng):
    joints = list(dh_oracle.random_joints(model, rng))
    little = rng.choice([0.0, 10.0 ** rng.uniform(-14, -3)]) * rng.choice([-1, 1])
    if kind == "wrist":
        joints[4] = little
    elif kind == "straight":
        joints[2] = little
    elif kind == "upright":
        joints[1:5] = [little if model is MINICOBO else math.pi / 2 + little, little, little, little]
    else:
        upper, fore, d5 = model.dh[1].a, model.dh[2].a, model.dh[4].d
        joints[2] = rng.choice([-1, 1]) * rng.uniform(0.2, 2.5)
        joints[1] = math.pi / 2 - math.atan2(fore * math.sin(joints[2]), upper + fore * math.cos(joints[2]))
        along = upper * math.cos(joints[1]) + fore * math.cos(joints[1] + joints[2])
        joints[3] = math.remainder(math.asin(-along / d5) - joints[1] - joints[2] + little, math.tau)
        if joints[3] < model.joint_limits[3][0]:
            joints[3] += math.tau
    return tuple(joints)


@pytest.mark.parametrize("distort", [lambda target: target, rounded_to_float32], ids=["exact", "float32"])
@pytest.mark.parametrize("model, kind", [
    (ZU7, "wrist"), (ZU7, "straight"), (ZU7, "shoulder"), (ZU7, "upright"),
    (MINICOBO, "wrist"), (MINICOBO, "straight"), (MINICOBO, "upright")],
    ids=lambda value: value if isinstance(value, str) else value.name)
def test_poses_at_and_next_to_a_singularity_are_reached_next_to_the_reference(model, kind, distort):
    rng = random.Random(8)
    for _ in range(150):
        joints = singular(model, kind, rng)
        target = distort(forward(model, joints))
        found = inverse.inverse(model, target, joints)
        assert error(model, found, target) <= inverse.POSITION_TOLERANCE
        assert max(abs(a - b) for a, b in zip(found, joints)) < 0.2


def test_where_the_wrist_is_singular_joint_6_is_taken_from_the_reference():
    joints = (0.3, 1.2, -1.1, 0.8, 0.0, 0.2)
    target = forward(ZU7, joints)
    for q6 in (-1.0, -0.3, 0.2, 1.0):
        found = inverse.inverse(ZU7, target, joints[:5] + (q6,))
        assert found[5] == pytest.approx(q6, abs=1e-12)
        assert error(ZU7, found, target) < 1e-9
    assert all(branch[5] == 0.0 for branch in inverse.inverse_all(ZU7, target) if branch[4] == 0.0)


@pytest.mark.parametrize("wrist", [0.0, 1e-5, 0.7])
def test_joints_beside_a_pose_settle_on_it_at_a_singularity_too(wrist):
    joints, rng = (0.3, 1.2, -1.1, 0.8, wrist, 0.2), random.Random(17)
    target = forward(ZU7, joints)
    for _ in range(10):
        start = beside(joints, 0.02, rng)
        found = numeric_inverse.settle(ZU7, target, start)
        assert error(ZU7, found, target) <= inverse.POSITION_TOLERANCE
        assert max(abs(a - b) for a, b in zip(found, start)) < 0.1


@pytest.mark.parametrize("model", ONE_OF_EACH_FAMILY, ids=lambda model: model.name)
def test_the_zero_pose_is_reached_at_zero(model):
    found = inverse.inverse(model, forward(model, (0.0,) * 6), (0.0,) * 6)
    assert found == pytest.approx((0.0,) * 6, abs=1e-6)


def at(position, rpy=(math.pi, 0.0, 0.0)):
    return rotations.transform_from_pose(Pose(position, rpy))


@pytest.mark.parametrize("model, target, reason", [
    (ZU7, at((2.0, 0.0, 0.3)), "the stretched arm has 0.6635 m"),
    (ZU7, at((0.0, 0.05, 0.3)), "cannot come nearer than 0.11501 m"),
    (MINICOBO, at((1.0, 0.0, 0.3)), "the stretched arm has 0.4205 m"),
    (MINICOBO, at((0.0060001, 0.0, 0.187 - 0.1593)), "the folded arm has 0.0005 m"),
    (MINICOBO, at((0.001, 0.0, 0.3)), "cannot come nearer than 0.006 m"),
    (A12, at((3.0, 0.0, 0.3)), "out of reach"),
    (ZU7, at((math.nan, 0.0, 0.3)), "out of reach"),
    (MINICOBO, at((0.3, math.nan, 0.3)), "out of reach"),
    (A12, at((0.3, math.nan, 0.3)), "out of reach"),
    (ZU7, at((math.inf, 0.0, 0.3)), "out of reach"),
])
def test_a_pose_out_of_reach_is_refused_with_the_reason(model, target, reason):
    assert inverse.inverse_all(model, target) == []
    with pytest.raises(UnreachablePose, match=reason) as caught:
        inverse.inverse(model, target, HOME)
    assert not isinstance(caught.value, PoseOutsideLimits)


def narrowed(model, index, low, high):
    limits = list(model.joint_limits)
    limits[index] = (low, high)
    return ArmModel(name=model.name, family=model.family, dh=model.dh, joint_limits=tuple(limits),
                    joint_max_speed=model.joint_max_speed)


@pytest.mark.parametrize("model", ONE_OF_EACH_FAMILY, ids=lambda model: model.name)
def test_a_pose_outside_the_limits_is_refused_with_the_joint(model):
    target = forward(model, HOME)
    narrow = narrowed(model, 0, 4.0, 4.001)
    assert len(inverse.inverse_all(narrow, target)) == len(inverse.inverse_all(model, target)) > 0
    with pytest.raises(PoseOutsideLimits, match="outside the joint limits: it would need joint 1 at ") as caught:
        inverse.inverse(narrow, target, HOME)
    assert isinstance(caught.value, UnreachablePose) and isinstance(caught.value, InvalidCommand)


def test_limits_also_bind_the_solution_followed_from_the_reference():
    narrow = narrowed(A12, 5, 1.0, 1.001)
    with pytest.raises(PoseOutsideLimits):
        inverse.inverse(narrow, forward(A12, HOME), HOME)


def calibrated(model, rng):
    """Return the model with every DH value a little off its structure, as a calibrated arm's are."""
    rows = tuple(DhRow(row.a + rng.uniform(-1e-3, 1e-3), row.d + rng.uniform(-1e-3, 1e-3),
                       row.alpha + rng.uniform(-3e-3, 3e-3), row.theta_offset + rng.uniform(-5e-3, 5e-3))
                 for row in model.dh)
    return ArmModel(name="calibrated", family=model.family, dh=rows, joint_limits=model.joint_limits,
                    joint_max_speed=model.joint_max_speed)


@pytest.mark.parametrize("nominal", ONE_OF_EACH_FAMILY, ids=lambda model: model.name)
def test_a_calibrated_arm_is_solved_on_its_own_table(nominal):
    rng = random.Random(9)
    model = calibrated(nominal, rng)
    missed = 0
    for _ in range(25):
        joints = dh_oracle.random_joints(model, rng)
        target = forward(model, joints)
        branches = inverse.inverse_all(model, target)
        assert all(error(model, branch, target) < 1e-9 for branch in branches)
        missed += min((dh_oracle.distance(joints, branch) for branch in branches), default=math.inf) > 1e-6
        assert inverse.inverse(model, target, beside(joints, 0.01, rng)) == pytest.approx(joints, abs=1e-5)
    assert missed <= 1  # a branch at the edge of the structure's reach has no start to refine from


def test_a_model_of_the_structure_with_other_lengths_stays_closed_form():
    rows = tuple(DhRow(row.a * 1.001, row.d * 0.999, row.alpha, 0.1) for row in ZU7.dh)
    model = ArmModel(name="scaled", family=ZU7.family, dh=rows, joint_limits=ZU7.joint_limits,
                     joint_max_speed=ZU7.joint_max_speed)
    assert model.has_closed_form
    joints = (0.3, 1.2, -1.1, 0.8, 1.3, 0.2)
    assert inverse.inverse(model, forward(model, joints), joints) == pytest.approx(joints, abs=1e-12)


def test_the_a12_finds_two_solutions_that_almost_meet_at_the_edge_of_joint_1():
    joints = (-2.4121955298292352, 1.271857182711785, 3.0175454302602738,
              0.3023782138542517, 3.0169855650432966, 0.6439515161137614)
    branches = inverse.inverse_all(A12, forward(A12, joints))
    assert min(dh_oracle.distance(joints, branch) for branch in branches) < 1e-7
    assert min(dh_oracle.distance((-2.433496, 1.262323, 3.015309, 0.283607, 3.030812, 0.638835), branch)
               for branch in branches) < 1e-5


def test_where_the_wrist_is_singular_the_offset_of_joint_6_counts_once():
    rows = tuple(DhRow(row.a, row.d, row.alpha, row.theta_offset + 0.1 * (row is ZU7.dh[5])) for row in ZU7.dh)
    model = ArmModel(name="offset", family=ZU7.family, dh=rows, joint_limits=ZU7.joint_limits,
                     joint_max_speed=ZU7.joint_max_speed)
    joints = (0.3, 1.2, -1.1, 0.8, 0.0, 0.2)
    for q6 in (-1.0, -0.3, 0.2, 1.0):
        found = inverse.inverse(model, forward(model, joints), joints[:5] + (q6,))
        assert found[5] == pytest.approx(q6, abs=1e-9)


def test_the_a12_finds_every_original_where_roots_lie_close_too():
    # Of 400 poses some have two roots within one step of the grid, or one at the edge of what joint 1 reaches.
    rng = random.Random(12)
    for number in range(400):
        joints = dh_oracle.random_joints(A12, rng)
        branches = inverse.inverse_all(A12, forward(A12, joints))
        assert min((dh_oracle.distance(joints, branch) for branch in branches), default=math.inf) < 1e-7, number


def test_the_a12_finds_every_branch_where_joint_1_ceases_to_reach_just_before_half_a_turn_of_joint_6():
    for q6 in np.linspace(1.0, 1.02, 6):
        joints = (-3.06, 2.12, -1.51, -1.67, 3.11, float(q6))
        branches = inverse.inverse_all(A12, forward(A12, joints))
        assert len(branches) == 8 and min(dh_oracle.distance(joints, branch) for branch in branches) < 1e-7


@pytest.mark.parametrize("nominal, ways", [(ZU7, (0.02, 0.11, -0.03, 0.1, 0.09, 0.08)),
                                           (MINICOBO, (0.1, 0.04, 0.03, 0.2, 0.0, 0.07))], ids=["zu7", "minicobo"])
def test_offsets_of_the_shoulder_add_up_wherever_along_it_they_are(nominal, ways):
    # A file of the user's may have them in other rows than the models that are known.
    free = [row.d != 0.0 or n in (1, 2) for n, row in enumerate(nominal.dh)]
    rows = tuple(DhRow(row.a, way if is_free else 0.0, row.alpha, row.theta_offset)
                 for row, way, is_free in zip(nominal.dh, ways, free))
    model = ArmModel(name="other", family=nominal.family, dh=rows, joint_limits=nominal.joint_limits,
                     joint_max_speed=nominal.joint_max_speed)
    assert model.has_closed_form
    rng = random.Random(15)
    for _ in range(20):
        joints = dh_oracle.random_joints(model, rng)
        branches = inverse.inverse_all(model, forward(model, joints))
        assert min((dh_oracle.distance(joints, branch) for branch in branches), default=math.inf) < 1e-7
    target = rotations.transform(rotations.matrix_from_rpy((0.0, 0.0, 0.0)), (0.0, 0.0, 0.6))
    with pytest.raises(UnreachablePose, match="axis"):
        inverse.inverse(model, target, HOME)


@pytest.mark.parametrize("turn", [600.0, 200.0, -200.0, -600.0])
def test_a_joint_of_more_turns_than_one_stays_beside_the_reference(turn):
    limit = math.radians(720.0)
    model = narrowed(ZU7, 5, -limit, limit)
    joints = HOME[:5] + (math.radians(turn),)
    reference = joints[:5] + (joints[5] + 0.1,)
    assert inverse.inverse(model, forward(model, joints), reference) == pytest.approx(joints, abs=1e-9)


class _Dip:
    """A residual that falls to a lowest value at a place, and rises beside it."""

    def __init__(self, place, lowest):
        self._place, self._value = place, lowest

    def residual(self, q6, _):
        return self._value + (q6 - self._place) ** 2


@pytest.mark.parametrize("place", [0.05, 0.3, 0.5, 0.9])
def test_the_lowest_point_of_a_dip_that_does_not_reach_zero_is_found(place):
    assert numeric_inverse._lowest(_Dip(place, 0.01), 0, 0.0, 1.0) == pytest.approx(place, abs=1e-6)


@pytest.mark.parametrize("place", [0.05, 0.3, 0.5, 0.9])
def test_of_a_dip_below_zero_a_place_below_zero_is_found(place):
    dip = _Dip(place, -0.002)
    assert dip.residual(numeric_inverse._lowest(dip, 0, 0.0, 1.0), 0) < 0.0


def test_where_no_turn_of_joint_6_brings_the_tip_nearer_it_stays():
    # the wrist on the axis of the shoulder: the tip goes round it, as far away as before
    assert closed_forms._reached_q6(0.3, (1.0, 0.0), (0.0, 1.0), (0.0, 0.0), 0.1, (0.2, 0.9)) == 0.3
