"""Inverse kinematics against solvers that share nothing with ours.

Where EAIK is installed (requirements-oracle.txt; not on Python 3.8) each of its solutions must be among ours and
ours among its. Everywhere, what iteration from random starts finds must be among ours: that covers the A12 too, which
EAIK does not know. JAKA_ORACLE_POSES sets the number of random poses a model, 100 by default.
"""
import math
import os
import random

import dh_oracle
import numpy as np
import pytest
import second_opinions

from jaka_ros_driver.kinematics import inverse
from jaka_ros_driver.kinematics.arm_models import TWO_PARALLEL, load_model, model_names
from jaka_ros_driver.kinematics.forward import forward, singularity_measures

POSES = int(os.environ.get("JAKA_ORACLE_POSES", "100"))
HAS_EAIK = second_opinions.are_there("eaik")
KNOWN_TO_EAIK = [name for name in model_names() if load_model(name).family != TWO_PARALLEL] if HAS_EAIK else []


def eaik_robot(model):
    from eaik.IK_DH import DhRobot
    return DhRobot(*(np.array([getattr(row, key) for row in model.dh]) for key in ("alpha", "a", "d")))


def nearest(joints, others):
    return min((dh_oracle.distance(joints, other) for other in others), default=math.inf)


@pytest.mark.parametrize("name", model_names())
def test_every_original_is_among_the_solutions(name):
    model, rng = load_model(name), random.Random(21)
    for _ in range(POSES):
        joints = dh_oracle.random_joints(model, rng)
        branches = inverse.inverse_all(model, forward(model, joints))
        assert nearest(joints, branches) < 1e-6 / max(1e-3, min(singularity_measures(model, joints)))
        target = dh_oracle.flange(model, joints)
        assert max(dh_oracle.error(dh_oracle.flange(model, branch), target) for branch in branches) < 1e-9


if KNOWN_TO_EAIK:
    @pytest.mark.parametrize("name", KNOWN_TO_EAIK)
    def test_the_solutions_are_those_of_eaik(name):
        model, robot, rng = load_model(name), eaik_robot(load_model(name)), random.Random(22)
        offsets = np.array([row.theta_offset for row in model.dh])
        poses = [dh_oracle.random_joints(model, rng) for _ in range(POSES)]
        targets = [dh_oracle.flange(model, joints) for joints in poses]
        for joints, target, solved in zip(poses, targets, robot.IK_batched(targets, 1)):
            assert dh_oracle.error(robot.fwdKin(np.array(joints) + offsets), target) < 1e-12
            ours = inverse.inverse_all(model, forward(model, joints))
            theirs = [angles - offsets for angles in solved.Q
                      if dh_oracle.error(dh_oracle.flange(model, angles - offsets), target) < 1e-9]
            for branch in theirs:
                assert nearest(branch, ours) < 1e-6 / max(1e-3, min(singularity_measures(model, branch)))
            if theirs and min(min(singularity_measures(model, branch)) for branch in ours) > 1e-3:
                assert all(nearest(branch, theirs) < 1e-6 for branch in ours)


@pytest.mark.parametrize("name", ["zu7", "minicobo", "a12"])
def test_iteration_from_random_starts_finds_nothing_else(name):
    model, rng = load_model(name), random.Random(23)
    for _ in range(2):
        joints = dh_oracle.random_joints(model, rng)
        found = dh_oracle.solutions(model, dh_oracle.flange(model, joints), rng, starts=40)
        assert len(found) >= 2
        branches = inverse.inverse_all(model, forward(model, joints))
        for solution in found:
            assert nearest(solution, branches) < 1e-6
