"""The cost of the guard of motions: a joint position, a path, and a plan of 2,000 points, with and without zones.

Marks: at most 0.15 ms a joint position, at most 150 ms a plan.

    build/venv/bin/python3 test/benchmark/bench_clearance.py
"""
import math
import random
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "support")]

import dh_oracle  # noqa: E402
from figures import best_s  # noqa: E402

from jaka_ros_driver.clearance.guard import MotionGuard  # noqa: E402
from jaka_ros_driver.clearance.workspace import NO_ZONES, workspace_of  # noqa: E402
from jaka_ros_driver.kinematics.arm_models import load_model, model_names  # noqa: E402

POSES = 2000
PLAN_POINTS = 2000
CELL = workspace_of({
    "keep_out": [{"name": "press", "centre": [0.7, 0.3, 0.2], "size": [0.4, 0.4, 0.6]},
                 {"name": "rack", "centre": [-0.6, 0.0, 0.4], "size": [0.3, 1.0, 0.8], "rpy": [0.0, 0.0, 0.3]}],
    "keep_in": [{"name": "cell", "centre": [0.0, 0.0, 0.9], "size": [3.0, 3.0, 2.2]}],
    "cylinders": [{"name": "post", "foot": [0.0, -0.8, 0.0], "height": 1.5, "radius": 0.06}],
    "floor": -0.1,
    "tool": [{"name": "gripper", "start": [0.0, 0.0, 0.0], "end": [0.0, 0.0, 0.15], "radius": 0.04}]})
"""A cell with two boxes, a wall around it, a post, a floor and a gripper."""


def plan_from(guard, model, rng, reach):
    """Return a plan of smooth joint motions whose points the guard accepts, and that ends in no trouble."""
    while True:
        middle = dh_oracle.random_joints(model, rng)
        rates = [rng.uniform(0.5, 2.0) for _ in middle]
        plan = [tuple(angle + reach * math.sin(2.0 * math.pi * rate * k / PLAN_POINTS + n)
                      for n, (angle, rate) in enumerate(zip(middle, rates))) for k in range(PLAN_POINTS)]
        if not any(guard.trouble(point) for point in plan[::20]) and guard.first_trouble(plan) is None:
            return plan


def print_guard(name, what, workspace):
    model, rng = load_model(name), random.Random(1)
    guard = MotionGuard(model, workspace)
    poses = [dh_oracle.random_joints(model, rng) for _ in range(POSES)]
    near = [tuple(angle + rng.uniform(-0.01, 0.01) for angle in joints) for joints in poses]
    steps = [([joints, other],) for joints, other in zip(poses, near)]
    plans = [plan_from(guard, model, rng, reach) for reach in (0.2, 0.5, 1.0) for _ in range(3)]
    rows = [
        ("nearest", 1e6 * best_s(guard.nearest, [(joints,) for joints in poses]), "us"),
        ("trouble", 1e6 * best_s(guard.trouble, [(joints,) for joints in poses]), "us"),
        ("first_trouble of one step", 1e6 * best_s(guard.first_trouble, steps), "us"),
        ("first_trouble of a plan, mean", 1e3 * best_s(guard.first_trouble, [(plan,) for plan in plans]), "ms"),
        ("first_trouble of a plan, slowest", 1e3 * max(best_s(guard.first_trouble, [(plan,)]) for plan in plans), "ms"),
    ]
    for row, cost, unit in rows:
        print("%-9s %-12s %-34s %8.1f %s" % (name, what, row, cost, unit))


def main():
    for name in model_names():
        model, rng = load_model(name), random.Random(2)
        guard = MotionGuard(model)
        poses = [dh_oracle.random_joints(model, rng) for _ in range(POSES)]
        print("%-9s %4.1f %% of %d random poses are refused" % (
            name, 100.0 * sum(bool(guard.trouble(joints)) for joints in poses) / POSES, POSES))
    for name in ("zu7", "minicobo", "a12"):
        print_guard(name, "alone", NO_ZONES)
        print_guard(name, "in a cell", CELL)


if __name__ == "__main__":
    main()
