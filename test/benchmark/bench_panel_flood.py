"""The delay of a stop from the panel's page to the controller's wire, while visitors without a token flood the panel.

For each number of strangers and what they send: the time from a page's stop to the first command of it on the simulated
controller's command port, median and longest, ms. In the devel space, on a quiet host:

    build/venv/bin/python3 test/benchmark/bench_panel_flood.py [REPEATS [KIND ...]]        40 stops, all kinds
"""
import contextlib
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/jogging", "test/support/panel")]

from driver_bench import LiveDriver  # noqa: E402
from figures import percentile  # noqa: E402
from flooding import strangers  # noqa: E402
from panel_jog import JogBench  # noqa: E402
from panel_page import Loop, Page  # noqa: E402
from ros_graph import master  # noqa: E402
from strangers import KINDS  # noqa: E402

COUNTS = (0, 1, 3, 10)
BETWEEN_S = 0.1
PATIENCE_S = 20.0
STOP = "stop_program"
"""The first command of a stop on the wire."""


def stops(bench, loop, count):
    """Make so many stops; return the moments, the times until they were answered, s, and how often the page was cut."""
    moments, answered, cuts = [], [], 0
    for _ in range(count):
        since = time.monotonic()
        moments.append(since)
        try:
            assert bench.page.ask("stop", arm=bench.arm, timeout=PATIENCE_S)["ok"]
            answered.append(time.monotonic() - since)
        except (AssertionError, ConnectionError):
            answered.append(float("inf"))
        if bench.page.closed is not None or answered[-1] > PATIENCE_S:
            cuts += 1
            bench.page.__exit__()
            bench.page = Page(loop, bench.panel, name="operator")
        time.sleep(BETWEEN_S)
    return moments, answered, cuts


def main(count, kinds):
    rows = []
    with tempfile.TemporaryDirectory() as folder, master(), contextlib.closing(Loop()) as loop, LiveDriver(
            folder, name="flooded", guard=True) as live, contextlib.closing(JogBench(live, loop)) as bench:
        live.arm.wait_until_ready()
        for kind in kinds:
            for number in COUNTS:
                with strangers(bench.panel, number, kind):
                    rows.append((kind, number, *stops(bench, loop, count)))
        bench.close()
        verdict = live.verdict()
    print("%-12s strangers   on the wire: p50     max   answered: p50     max   (ms)" % "flood")
    for kind, number, moments, answered, cuts in rows:
        wire = [min((at for at in verdict.times_of(STOP, since)), default=float("inf")) - since for since in moments]
        print("%-12s %9d   %16.1f %7.1f %15.1f %7.1f%s" % (
            kind, number, 1e3 * percentile(wire, 0.5), 1e3 * max(wire), 1e3 * percentile(answered, 0.5),
            1e3 * max(answered), "   the page was cut off %d times" % cuts if cuts else ""))


if __name__ == "__main__":
    main(int((sys.argv[1:] + ["40"])[0]), sys.argv[2:] or list(KINDS))
