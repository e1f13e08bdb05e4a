"""The cost of the simulated arm's motion: a cycle in each kind of motion, and taking a move.

Marks: a cycle in motion at most 150 us, at rest far less.

    build/venv/bin/python3 test/benchmark/bench_plant.py
"""
import statistics
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "support")]

from plant_watch import shift  # noqa: E402

from jaka_ros_driver.commands import JogFrame  # noqa: E402
from jaka_ros_driver.kinematics.arm_models import load_model  # noqa: E402
from jaka_ros_driver.simulation.arm.plant import JogMode, Plant, ServoFilter  # noqa: E402

ROUNDS = 10
FILTERS = {
    ServoFilter.NONE: {}, ServoFilter.JOINT_LOW_PASS: {"lpf_cf": 2.0},
    ServoFilter.JOINT_LIMITS: {"nlf_max_vr": 1.0, "nlf_max_ar": 4.0, "nlf_max_jr": 80.0},
    ServoFilter.JOINT_MEAN: {"mmf_max_buf": 20, "mmf_kp": 0.2, "mmf_kv": 0.4, "mmf_ka": 0.2},
    ServoFilter.CARTESIAN_LIMITS: {"nlf_max_vp": 0.2, "nlf_max_ap": 1.0, "nlf_max_jp": 20.0,
                                   "nlf_max_vr": 1.0, "nlf_max_ar": 4.0, "nlf_max_jr": 80.0},
    ServoFilter.FORESIGHT: {"mmf_max_buf": 15, "mmf_kp": 0.03},
}


def at_rest(plant):
    pass


def joint_move(plant):
    plant.add_joint_move((1.0, 0.2, -0.2, 0.3, 0.1, 0.5), 0.5, 2.0, relative=True)


def line(plant):
    plant.add_linear_move(shift(y=0.3, rpy=(0.0, 0.0, 0.3)), 0.1, 1.0, relative=True)


def blended_lines(plant):
    for n in range(10):
        plant.add_linear_move(shift(x=-0.04 * (n % 2), y=0.04 * (1 - n % 2)), 0.1, 1.0, relative=True, tolerance=0.01)


def line_to_the_stretched_arm(plant):
    plant.add_linear_move(plant.forward((0.0, 0.6, -0.01, 0.9808, 1.5708, 0.0)), 0.1, 1.0)


def arc(plant):
    plant.add_arc_move(shift(-0.05, 0.05), shift(-0.1, 0.0), 0.1, 1.0, relative=True)


def cartesian_jog(plant):
    plant.jog(JogMode.CONTINUOUS, JogFrame.BASE, 2, 0.05)


def cycle_costs(model, begin, cycles=200):
    """Return median and highest cost of a cycle over the rounds, and of the command before, us."""
    costs, takes = [], []
    for _ in range(ROUNDS):
        plant = Plant(model)
        started = time.perf_counter()
        begin(plant)
        takes.append(time.perf_counter() - started)
        for _ in range(cycles):
            started = time.perf_counter()
            plant.step()
            costs.append(time.perf_counter() - started)
    costs.sort()
    return statistics.median(costs) * 1e6, costs[int(0.99 * len(costs))] * 1e6, min(takes) * 1e6


def servo_costs(model, kind, parameters, cycles=500):
    """Return median and 99th percentile of a cycle with one new point, us."""
    plant = Plant(model)
    plant.set_servo_filter(kind, **parameters)
    plant.enter_servo()
    costs = []
    for n in range(cycles):
        started = time.perf_counter()
        plant.servo_joint((0.004 if n % 200 < 100 else -0.004, 0.0, 0.0, 0.0, 0.0, 0.0), relative=True)
        plant.step()
        costs.append(time.perf_counter() - started)
    costs.sort()
    return statistics.median(costs) * 1e6, costs[int(0.99 * len(costs))] * 1e6


def main():
    model = load_model("zu7")
    for begin in (at_rest, joint_move, line, blended_lines, line_to_the_stretched_arm, arc, cartesian_jog):
        print("%-28s cycle %6.1f us, p99 %6.1f us; taking it %8.1f us" % (
            begin.__name__.replace("_", " "), *cycle_costs(model, begin)))
    for kind, parameters in FILTERS.items():
        print("servo, %-21s cycle %6.1f us, p99 %6.1f us" % (
            kind.name.lower().replace("_", " "), *servo_costs(model, kind, parameters)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
