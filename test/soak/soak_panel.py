"""The memory of the panel's server while three pages watch an arm that moves and one of them comes and goes.

    build/venv/bin/python3 test/soak/soak_panel.py [MINUTES]        30, in the devel space

It ends with code 1 where the memory has grown by more than a twentieth after the first 40 % of the time: the curves of
10 minutes, which are kept, fill it until then.
"""
import contextlib
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/jogging", "test/support/panel")]

from driver_bench import HOME, LiveDriver  # noqa: E402
from panel_jog import JogBench  # noqa: E402
from panel_page import Loop  # noqa: E402
from ros_graph import master  # noqa: E402

GROWTH = 1.05
FILLED = 0.4


def main(minutes):
    with tempfile.TemporaryDirectory() as folder, master(), contextlib.closing(Loop()) as loop, LiveDriver(
            folder, name="watched", guard=True) as live, contextlib.closing(JogBench(live, loop)) as bench:
        live.arm.wait_until_ready()
        with bench.new_page(control=False) as second:
            for page in (bench.page, second):
                page.watch(bench.arm, plots=True)
            print("minute   server MB   % of a core   pages that came and went")
            seen = []
            came, used, end = 0, bench.panel.cpu(), time.monotonic()
            for minute in range(1, minutes + 1):
                end += 60.0
                while time.monotonic() < end:
                    bench.page.command("joint_move", bench.arm, q=[0.3 * (came % 2)] + HOME[1:], speed=0.5)
                    with bench.new_page(control=False) as third:
                        third.ask("history", arm=bench.arm, what="q", to=0, buckets=600, **{"from": -600})
                        time.sleep(1.0)
                    came += 1
                    bench.page.messages.clear()
                    bench.page.plots.clear()
                    second.messages.clear()
                    second.plots.clear()
                now = bench.panel.cpu()
                seen.append(bench.panel.resident())
                print("%6d   %9.1f   %11.1f   %d" % (minute, seen[-1], (now - used) / 0.6, came), flush=True)
                used = now
    first, last = max(seen[:max(1, int(FILLED * minutes))]), seen[-1]
    print("from %.1f to %.1f MB" % (first, last))
    return 0 if last < GROWTH * first else 1


if __name__ == "__main__":
    sys.exit(main(*map(int, (sys.argv[1:] + ["30"])[:1])))
