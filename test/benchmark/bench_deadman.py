"""The time to rest of a velocity jog after each way of release: from the last message that counted to the last frame of
motion on the wire, and to the arm's rest.

Moments on the wire and of the arm are those of the simulated controller's log. In the devel space, on a quiet host:

    build/venv/bin/python3 test/benchmark/bench_deadman.py [REPEATS [PRIORITY]]        30, the driver's priority 0
"""
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/jogging")]

from driver_bench import LiveDriver  # noqa: E402
from jog_pad import KILLED, WAYS, let_go, print_rests  # noqa: E402
from ros_graph import master  # noqa: E402

TOPICS = ("jog_joints", "jog_twist")


def main(repeats, priority):
    with tempfile.TemporaryDirectory() as folder, master(), LiveDriver(
            folder, name="jogging", guard=True, realtime_priority=priority) as live:
        live.arm.wait_until_ready()
        moments = {}
        for way in [*WAYS, KILLED]:
            for repeat in range(repeats):
                live.arm.go_home()
                moments.setdefault(way, []).append(let_go(live.arm, way, TOPICS[repeat % 2]))
        verdict = live.verdict()
    print_rests(moments, verdict)


if __name__ == "__main__":
    main(*map(int, (sys.argv[1:] + ["30", "0"][len(sys.argv) - 1:])[:2]))
