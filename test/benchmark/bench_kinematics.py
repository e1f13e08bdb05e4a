"""The cost of kinematics a call, on the same poses as EAIK (compiled) where that is installed.

Mark: closed-form inverse kinematics at most 30 us a call.

    build/venv/bin/python3 test/benchmark/bench_kinematics.py
"""
import importlib.util
import random
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "support")]

import dh_oracle  # noqa: E402
from figures import best_s  # noqa: E402

from jaka_ros_driver.commands import JointMove  # noqa: E402
from jaka_ros_driver.kinematics import arm_models, inverse, limits, urdf  # noqa: E402
from jaka_ros_driver.kinematics.forward import forward, jacobian, singularity_measures  # noqa: E402

POSES = 2000


def microseconds(function, arguments):
    """Return the best round's mean cost of one call, us."""
    return 1e6 * best_s(function, arguments)


def print_model(name):
    model, rng = arm_models.load_model(name), random.Random(1)
    poses = [dh_oracle.random_joints(model, rng) for _ in range(POSES if name != "a12" else POSES // 20)]
    targets = [forward(model, joints) for joints in poses]
    near = [tuple(angle + rng.uniform(-0.01, 0.01) for angle in joints) for joints in poses]
    rows = [
        ("forward", microseconds(forward, [(model, joints) for joints in poses])),
        ("jacobian", microseconds(jacobian, [(model, joints) for joints in poses])),
        ("singularity_measures", microseconds(singularity_measures, [(model, joints) for joints in poses])),
        ("inverse_all", microseconds(inverse.inverse_all, [(model, target) for target in targets])),
        ("inverse, near reference", microseconds(
            inverse.inverse, [(model, target, joints) for target, joints in zip(targets, near)])),
        ("limits.check of a joint move", microseconds(
            limits.check, [(JointMove(joints, 1.0, 1.0), model) for joints in poses])),
    ]
    if importlib.util.find_spec("eaik") and name != "a12":
        from eaik.IK_DH import DhRobot
        robot = DhRobot(*(np.array([getattr(row, key) for row in model.dh]) for key in ("alpha", "a", "d")))
        rows.append(("EAIK, every branch", microseconds(robot.IK, [(dh_oracle.as_matrix(t),) for t in targets])))
    for what, cost in rows:
        print("%-9s %-30s %8.1f us" % (name, what, cost))


def main():
    started = time.perf_counter()
    arm_models.load_model("zu7")
    print("%-9s %-30s %8.1f ms" % ("zu7", "load_model, first", (time.perf_counter() - started) * 1e3))
    print("%-9s %-30s %8.1f us" % ("zu7", "urdf_from_model", microseconds(
        urdf.urdf_from_model, [(arm_models.load_model("zu7"),)] * 50)))
    for name in ("zu7", "minicobo", "a12"):
        print_model(name)


if __name__ == "__main__":
    main()
