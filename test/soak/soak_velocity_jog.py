"""Velocity jogs of every model from random poses, along and about axes of base, tool and user frame: out, and back.

It prints, by model, how many could go the way by the service ``jog`` and did, the largest deviations from the line, and
every jog that breaks a promise of docs/velocity_jog.md. No ROS is needed; 500 a model take about ten minutes:

    build/venv/bin/python3 test/soak/soak_velocity_jog.py [JOGS [MODELS ...]]        500, all models
"""
import random
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "test/support/jogging")]

from line_jogs import drawn_case, jogged  # noqa: E402

from jaka_ros_driver.kinematics.arm_models import load_model, model_names  # noqa: E402
from jaka_ros_driver.kinematics.limits import stream_limits  # noqa: E402

SIDEWAYS, TURN, BACK, BACK_TURN = 5e-4, 2e-3, 1e-3, 5e-3


def broken_promises(case, verdict):
    """Return what a jog has broken, in words; it comes back to where streams may be, not nearer to a joint's limit."""
    could_return = all(low <= q <= high for q, (low, high) in zip(case.start, stream_limits(case.model)))
    return [text for text, is_broken in (
        ("left its line", verdict.sideways > SIDEWAYS or verdict.turn > TURN),
        ("crossed a singularity", verdict.is_crossed),
        ("passed a limit", not verdict.is_within),
        ("stood without a reason", verdict.way < case.wanted and not verdict.obstacle),
        ("is not back", could_return and (
            verdict.back is None or verdict.back[0] > BACK or verdict.back[1] > BACK_TURN))) if is_broken]


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    totals = [0, 0, 0, 0]
    print("model       jogs  service could   went  broken   sideways (m)  turn (rad)", flush=True)
    for name in sys.argv[2:] or model_names():
        rng, could, went, broken, sideways, turn = random.Random(name), 0, 0, 0, 0.0, 0.0
        for number in range(count):
            case = drawn_case(load_model(name), rng)
            verdict = jogged(case)
            if case.service_way() >= case.wanted:
                could, went = could + 1, went + (verdict.way >= case.wanted)
            sideways, turn = max(sideways, verdict.sideways), max(turn, verdict.turn)
            promises = broken_promises(case, verdict)
            broken += bool(promises)
            if promises:
                print("%s, jog %d (%s %d): %s; %s" % (
                    name, number, case.space, case.axis, ", ".join(promises), verdict))
        print("%-10s %5d %14d %6d %7d   %12.1e %11.1e" % (name, count, could, went, broken, sideways, turn), flush=True)
        totals = [a + b for a, b in zip(totals, (count, could, went, broken))]
    print("%-10s %5d %14d %6d %7d   %.2f %% of those that could" % (
        "all", *totals, 100.0 * totals[2] / max(1, totals[1])))
    return 1 if totals[3] or totals[2] < 0.95 * totals[1] else 0


if __name__ == "__main__":
    sys.exit(main())
