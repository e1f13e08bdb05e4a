"""The hostile network of a panel in figures: stop, dead-man and truth over slow links, among strangers, after restarts.

In each cell a page with the token and a second one in a real browser see an arm of a simulated controller. Figures, ms:

- stop: from the page to the first command on the controller's wire, less the way of the link, median and longest;
- dead-man: the longest from the last heartbeat that could count to the last frame of motion, where a jog is carried;
- truth: the longest until the browser shows that what it shows is old, after the driver was stopped or killed, the link
  stalled, the panel killed.

It exits with 1 where a mark is missed. In the devel space, on a quiet host:

    build/venv/bin/python3 test/benchmark/bench_panel_network.py [STOPS [PART ...]]        20 stops, all cells

PART is a part of the names of the cells that are measured.
"""
import contextlib
import signal
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/jogging", "test/support/panel")]

from browser import Browser  # noqa: E402
from driver_bench import LiveDriver  # noqa: E402
from figures import HostLoad, percentile  # noqa: E402
from flooding import strangers  # noqa: E402
from hostile_network import (  # noqa: E402
    JOGGED,
    LINKS,
    STOP,
    press_moves,
    restart_the_driver,
    restart_the_master,
    restart_the_panel,
    seen_over,
    stall_a_jog,
    stop,
)
from jog_pad import last_frame_of_motion  # noqa: E402
from panel_jog import JogBench, let_go  # noqa: E402
from panel_page import Loop  # noqa: E402
from ros_graph import Graph, changed_environment, master  # noqa: E402
from slow_link import SlowLink  # noqa: E402
from strangers import KINDS  # noqa: E402
from tls_proxy import certificate_in  # noqa: E402
from waiting import eventually, free_port  # noqa: E402

MARKS_MS = {"stop": 250.0, "dead-man": 300.0, "truth": 1000.0}
COUNTS = (1, 3, 10)
ROUNDS = 3
"""Jogs, and looks at the truth, in each cell."""
BETWEEN_S = 0.1
SEES = "/^(live|SLOW LINK)/.test(document.querySelector('#age')?.textContent)"
"""True where the page says that it sees the arm; over a link of 0.4 s each way nothing is new, and it says that."""
NOTES = """window.old_at = null;
window.watch = window.watch || new MutationObserver(() => { if (!%s) window.old_at ??= Date.now() / 1000; });
window.watch.observe(document.querySelector('#age'), {childList: true, characterData: true, subtree: true}); true"""


class Cell:
    """The moments of one cell.

    Attributes:
        name: Name of the cell.
        stops: When each stop was sent, and the time that its link took, s.
        jogs: For each jog the last heartbeat that could count, and when it was over.
        truths: Times until the browser showed that it was old, s.
        error: What ended the cell before its time.
    """

    def __init__(self, name):
        self.name, self.stops, self.jogs, self.truths, self.error = name, [], [], [], ""


class Watcher:
    """A page in a browser that sees the arm, and knows when it says that it is old."""

    def __init__(self, browser, panel, port=None):
        self._page = browser.open("%s://127.0.0.1:%d/#token=%s" % (panel.scheme, port or panel.port, panel.token))
        self.begin()

    def begin(self):
        """Wait until the page shows the present, and look from now on."""
        self._page.until(SEES)
        self._page.evaluate(NOTES % SEES)

    def old_after(self, since):
        """Return the time, s, from a moment until the page showed that it is old."""
        self._page.until("window.old_at")
        return self._page.evaluate("window.old_at") - (since + time.time() - time.monotonic())

    def close(self):
        self._page.close()


class Matrix:
    """The cells of one panel, with TLS or without.

    Args:
        bench: A JogBench.
        loop: The loop of its pages.
        browser: A Browser.
        count: Stops of each cell.
        is_wanted: Whether a cell of this name is measured.
    """

    def __init__(self, bench, loop, browser, count, is_wanted):
        self._bench, self._loop, self._browser, self._count = bench, loop, browser, count
        self._is_wanted = is_wanted
        self._more = ", TLS" if bench.panel.scheme == "https" else ""
        self.cells = []

    def measure_all(self):
        """Measure the cells that are wanted."""
        for name, settings in LINKS.items():
            self._measure(name, self._over_a_link, settings)
        for name, delay in JOGGED.items():
            self._measure("stall and burst, " + name, self._stalled, delay)
        for kind in KINDS:
            for number in COUNTS:
                self._measure("strangers: %d, %s" % (number, kind), self._among_strangers, number, kind)
        self._measure("driver restarted", self._restarted, restart_the_driver)
        self._measure("panel restarted", self._restarted, restart_the_panel)

    def _measure(self, name, work, *args):
        cell = Cell(name + self._more)
        if not self._is_wanted(cell.name):
            return
        self.cells.append(cell)
        print("%s  %s" % (time.strftime("%H:%M:%S"), cell.name), file=sys.stderr)
        try:
            self._bench.page.close()
            self._bench.renew_page()
            assert eventually(lambda: self._bench.page.ask("stop", arm=self._bench.arm)["ok"]), "no stop is served"
            work(cell, *args)
        except (AssertionError, ConnectionError) as error:
            cell.error = str(error).split("\n")[0] or type(error).__name__

    def _stop(self, cell, page, way=lambda since: 0.0):
        for _ in range(self._count):
            since = time.monotonic()
            answer = page.ask("stop", arm=self._bench.arm)
            cell.stops.append((since, way(since)))
            if not answer["ok"]:
                cell.error = "a stop is not confirmed: %s" % answer["message"]
            time.sleep(BETWEEN_S)

    def _freeze(self, cell, watcher):
        """Stop the driver so often, and let it go on; see how long the browser takes to know."""
        for _ in range(ROUNDS):
            watcher.begin()
            since = self._bench.live.send(signal.SIGSTOP)
            try:
                cell.truths.append(watcher.old_after(since))
            finally:
                self._bench.live.send(signal.SIGCONT)

    def _over_a_link(self, cell, settings):
        with SlowLink(self._loop, self._bench.panel.port, **settings) as link, contextlib.closing(
                seen_over(self._bench, self._loop, link)) as page, contextlib.closing(
                    Watcher(self._browser, self._bench.panel, link.port)) as watcher:
            self._stop(cell, page, lambda since: next(went - came for came, went in link.passages[0] if came >= since))
            self._freeze(cell, watcher)

    def _stalled(self, cell, delay):
        self._bench.page.send(t="release_control")
        for _ in range(ROUNDS):
            cell.jogs.append(stall_a_jog(self._bench, self._loop, delay))
        with SlowLink(self._loop, self._bench.panel.port, delay) as link, contextlib.closing(
                seen_over(self._bench, self._loop, link)) as page, contextlib.closing(
                    Watcher(self._browser, self._bench.panel, link.port)) as watcher:
            for _ in range(ROUNDS):
                watcher.begin()
                link.is_stalled, since = True, time.monotonic()
                cell.truths.append(watcher.old_after(since))
                link.is_stalled = False
            self._stop(cell, page, lambda since: next(went - came for came, went in link.passages[0] if came >= since))

    def _among_strangers(self, cell, number, kind):
        bench = self._bench
        with contextlib.closing(Watcher(self._browser, bench.panel)) as watcher, strangers(bench.panel, number, kind):
            self._stop(cell, bench.page)
            cell.jogs += [let_go(bench, "silence") for _ in range(ROUNDS)]
            self._freeze(cell, watcher)
            assert bench.page.closed is None, "the page was cut off"

    def _restarted(self, cell, restart):
        bench = self._bench
        with contextlib.closing(Watcher(self._browser, bench.panel)) as watcher:
            since, _ = restart(bench)
            cell.truths.append(watcher.old_after(since))
            self._stop(cell, bench.page)
        assert eventually(lambda: press_moves(bench, [])), "it is not jogged"


def master_restarted(folder, loop, count):
    """Measure the stop without a master, and those after its restart; return the cell and the controller's log."""
    cell = Cell("master restarted")
    with Graph(Path(folder), is_mortal=True) as graph, changed_environment(graph.environment), \
            LiveDriver(folder, guard=False) as live, contextlib.closing(JogBench(live, loop)) as bench:
        cell.stops.append((restart_the_master(bench, graph), 0.0))
        for _ in range(count - 1):
            cell.stops.append((stop(bench.page, bench.arm), 0.0))
            time.sleep(BETWEEN_S)
        assert eventually(lambda: press_moves(bench, [])), "it is not jogged"
        bench.close()
        return cell, live.verdict()


def figures(cell, verdict):
    """Return the figures of a cell by name, ms: median and longest stop, dead-man, truth; of those that it has."""
    wire = [min(verdict.times_of(STOP, since), default=float("inf")) - since - way for since, way in cell.stops]
    ends = [last_frame_of_motion(verdict, since, until) - since for since, until in cell.jogs]
    found = {"stop": wire, "dead-man": ends, "truth": cell.truths}
    return {name: (1e3 * percentile(times, 0.5), 1e3 * max(times)) for name, times in found.items() if times}


def show(cell, verdict):
    """Print the row of a cell; return whether it meets the marks."""
    found = figures(cell, verdict)
    is_met = not cell.error and all(found[name][1] <= mark for name, mark in MARKS_MS.items() if name in found)
    print("%-40s %7s %7s %9s %7s   %s" % (
        cell.name, *("%.1f" % number for number in found.get("stop", (float("nan"),) * 2)),
        *("%.0f" % found[name][1] if name in found else "-" for name in ("dead-man", "truth")),
        "ok" if is_met else "MISSED " + cell.error))
    return is_met


def main():
    count, parts = int((sys.argv[1:] + ["20"])[0]), sys.argv[2:]

    def is_wanted(name):
        return not parts or any(part in name for part in parts)
    load = HostLoad()
    results = []
    with tempfile.TemporaryDirectory() as folder, master(), contextlib.closing(Loop()) as loop:
        with LiveDriver(folder, name="hostile", guard=False) as live, Browser("--ignore-certificate-errors") as browser:
            live.arm.wait_until_ready()
            cert, key = certificate_in(folder)
            cells = []
            for more in ((), ("--tls-cert", cert, "--tls-key", key)):
                with contextlib.closing(JogBench(live, loop, "--port", str(free_port()), "--token-file",
                                                 folder + "/token", *more)) as bench:
                    matrix = Matrix(bench, loop, browser, count, is_wanted)
                    matrix.measure_all()
                    cells += matrix.cells
            verdict = live.verdict()
            results += [(cell, verdict) for cell in cells]
        if is_wanted("master restarted"):
            results.append(master_restarted(folder, loop, count))
        print("%-40s %7s %7s %9s %7s   (ms; marks %s; %s)" % (
            "cell", "stop", "longest", "dead-man", "truth",
            ", ".join("%s %.0f" % item for item in MARKS_MS.items()), load))
        met = [show(cell, log) for cell, log in results]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
