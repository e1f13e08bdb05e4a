"""The cost of the operator's panel, and the time to rest of its jog after each way of release.

Processor time of the panel's server with no page, with one and with three, and how much a page receives; the driver's
rate, jitter and stop latency without pages and with three, five times in turn in one run. Then, for each way of
release, the time from the last heartbeat that counted to the last frame of motion on the wire, and to the arm's rest,
by the simulated controller's log. In the devel space, on a quiet host:

    build/venv/bin/python3 test/benchmark/bench_panel.py [REPEATS [SECONDS]]        30 repeats, 20 s for each row
"""
import contextlib
import multiprocessing
import statistics
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/jogging", "test/support/panel")]

from driver_bench import LiveDriver, collecting  # noqa: E402
from figures import percentile  # noqa: E402
from jog_pad import print_rests  # noqa: E402
from panel_jog import WAYS, JogBench, let_go  # noqa: E402
from panel_page import Loop, Page  # noqa: E402
from ros_graph import master  # noqa: E402

WATCHED_S = 20.0
SETTLE_S = 3.0
LET_GO_S = 15.0
"""Time after which a panel without pages has unsubscribed, s; its own limit is 10 s."""
STOPS = 300
ROUNDS = 5
"""Number of rounds: one row's 99th percentile of jitter differs from the next by a factor of two, without any page."""


def watch(pipe, port, token, arm, count):
    """Open pages, and report the messages that they received by kind, each time that the pipe asks."""
    with contextlib.closing(Loop()) as loop, contextlib.ExitStack() as stack:
        panel = SimpleNamespace(scheme="http", port=port, token=token)
        pages = [stack.enter_context(Page(loop, panel)) for _ in range(count)]
        for page in pages:
            page.watch(arm, plots=True)
        pipe.send([])
        while pipe.recv():
            pipe.send([dict(page.counts) for page in pages])


class Watchers:
    """Pages in a process of their own, as browsers are: in this one they would hold up the calls that are timed."""

    def __init__(self, bench, count):
        self._pipe, theirs = multiprocessing.Pipe()
        self._process = multiprocessing.get_context("spawn").Process(
            target=watch, args=(theirs, bench.panel.port, bench.panel.token, bench.arm, count), daemon=True)
        self._process.start()
        self._pipe.recv()

    def told(self):
        """Return how many messages each page has received so far, by kind."""
        self._pipe.send(True)
        return self._pipe.recv()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._pipe.send(False)
        self._process.join()


def of_driver(live, watched_s):
    """Measure rate, Hz; the 99th percentile of the intervals' differences from 8 ms, ms; p50 and p95 of a stop's call,
    ms."""
    with collecting(live.arm.name + "/joint_position") as received:
        time.sleep(watched_s)
    stamps = [message.header.stamp.to_sec() for _, message in received]
    steps = [b - a for a, b in zip(stamps, stamps[1:])]
    calls = []
    for _ in range(STOPS):
        begin = time.monotonic()
        live.arm.call("stop_move")
        calls.append(1e3 * (time.monotonic() - begin))
        time.sleep(0.01)
    return ((len(stamps) - 1) / (stamps[-1] - stamps[0]), 1e3 * percentile([abs(step - 0.008) for step in steps], 0.99),
            percentile(calls, 0.5), percentile(calls, 0.95))


def cost(bench, live, watched_s):
    """Return rows of the driver's figures by the number of pages: one page once, none and three in turn."""
    bench.page.close()
    print("pages   server: % of a core   a page   MB   states/s   messages/s   "
          "driver: Hz   jitter p99 ms   stop p50 ms   p95 ms")
    rows = {}
    for count in [1] + ROUNDS * [0, 3]:
        with Watchers(bench, count) as pages:
            time.sleep(SETTLE_S if count else LET_GO_S)
            begin, used = time.monotonic(), bench.panel.cpu()
            before = pages.told()
            measured = of_driver(live, watched_s)
            took = time.monotonic() - begin
            share = 100.0 * (bench.panel.cpu() - used) / took
            told = [{kind: (after[kind] - first.get(kind, 0)) / took for kind in after}
                    for first, after in zip(before, pages.told())]
            states = max([page["state"] for page in told], default=0.0)
            messages = max([sum(page.values()) for page in told], default=0.0)
            print("%5d   %18.1f %8.1f %4.0f %10.1f %12.1f   %10.2f %15.2f %13.2f %8.2f" % (
                count, share, share / max(1, count), bench.panel.resident(), states, messages, *measured), flush=True)
            rows.setdefault(count, []).append(measured)
    bench.renew_page()
    compare(rows)


def compare(rows):
    """Compare the medians of the driver with three pages and without."""
    without, watched = ([statistics.median(column) for column in zip(*rows[count])] for count in (0, 3))
    for name, a, b in zip(("rate", "jitter p99", "stop p50", "stop p95"), without, watched):
        print("%-10s with three pages %+6.1f %%" % (name, 100.0 * (b / a - 1.0)))


def main(repeats, watched_s=WATCHED_S):
    with tempfile.TemporaryDirectory() as folder, master(), contextlib.closing(Loop()) as loop, LiveDriver(
            folder, name="jogged", guard=True) as live, contextlib.closing(JogBench(live, loop)) as bench:
        live.arm.wait_until_ready()
        cost(bench, live, watched_s)
        moments = {}
        for way in WAYS:
            for repeat in range(repeats):
                bench.go_home()
                moments.setdefault(way, []).append(let_go(bench, way, ("joint", "base")[repeat % 2]))
        bench.close()
        verdict = live.verdict()
    print_rests(moments, verdict)


if __name__ == "__main__":
    main(int((sys.argv[1:] + ["30"])[0]), *map(float, sys.argv[2:3]))
