"""The loading time of the panel's page, and its cost for the browser while an arm moves, without 3D and with it.

No ROS: a server of the tests' own sends what the panel sends. 3D is drawn by software here, as on a computer without a
graphics card. On a quiet host:

    build/venv/bin/python3 test/benchmark/bench_panel_page.py
"""
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/panel")]

from browser import Browser  # noqa: E402
from fake_panel import FakePanel  # noqa: E402
from figures import summary  # noqa: E402

LOADS = 10
WATCHED_S = 10.0


def loads(browser, panel):
    """Return s from the request of the page to the first state of the arm on it."""
    took = []
    for _ in range(LOADS + 1):
        page = browser.open()
        since = time.monotonic()
        page.go_without_waiting(panel.url)
        page.until("document.querySelector('#joints td.number')?.textContent === '0.00'")
        took.append(time.monotonic() - since)
        page.close()
    return took[1:]  # the first one starts the browser's processes


def busy(browser, panel):
    """Return the share of a core that the page's thread takes, and pictures a second."""
    page = browser.open(panel.url)
    page.until("!document.body.classList.contains('stale')")
    page.call("Performance.enable")

    def task_seconds():
        metrics = page.call("Performance.getMetrics")["metrics"]
        return next(one["value"] for one in metrics if one["name"] == "TaskDuration")

    before = task_seconds()
    pictures = page.evaluate("""new Promise((resolve) => {
        let count = 0;
        const next = () => { count += 1; requestAnimationFrame(next); };
        next();
        setTimeout(() => resolve(count), %d);
    })""" % (1000 * WATCHED_S))
    share = (task_seconds() - before) / WATCHED_S
    page.close()
    return share, pictures / WATCHED_S


def main():
    for webgl in (False, True):
        with FakePanel() as panel, Browser(webgl=webgl) as browser:
            kind = "with" if webgl else "without"
            print("%s 3D: first state on the page: %s" % (kind, summary(loads(browser, panel))))
            panel.wave = 0.3
            share, rate = busy(browser, panel)
            print("   an arm that moves: %.0f %% of a core, %.0f pictures/s" % (100 * share, rate))


if __name__ == "__main__":
    main()
