"""The time to rest after an operator at the panel's page releases in a real browser, in each way: from the last
heartbeat that could count to the last frame of motion on the wire, by the simulated controller's log.

In the devel space, on a quiet host:

    build/venv/bin/python3 test/benchmark/bench_panel_deadman.py [REPEATS [WAY ...]]        30 repeats, all ways
"""
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/jogging", "test/support/panel")]

from figures import percentile  # noqa: E402
from panel_operator import WAYS, Operator, times_to_rest  # noqa: E402
from ros_graph import master  # noqa: E402


def main(repeats, ways):
    with tempfile.TemporaryDirectory() as folder, master(), Operator(folder, guard=True) as operator:
        for way in ways:
            for _ in range(repeats):
                operator.let_go(way)
        rests = times_to_rest(operator.verdict(), operator.moments)
    print("%-24s repeats   frames at rest: p50    max   (ms after the last heartbeat that could count)" % "way")
    for way, times in rests.items():
        print("%-24s %7d   %19.0f %6.0f" % (way, len(times), 1e3 * percentile(times, 0.5), 1e3 * max(times)))


if __name__ == "__main__":
    main(int((sys.argv[1:] + ["30"])[0]), sys.argv[2:] or list(WAYS))
