"""The growth of the panel's page, which must be none: heap and elements over half an hour of motion, alarms and calls.

No ROS: a server of the tests' own sends what the panel sends. It ends with code 1 where the heap after the first tenth
of the time has grown by more than a fifth.

    build/venv/bin/python3 test/soak/soak_panel_page.py [MINUTES]        30
"""
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/panel")]

from browser import Browser  # noqa: E402
from fake_panel import FakePanel  # noqa: E402

GROWTH = 1.2
LOOKS = 30
TABS = ("jog", "move", "run", "io", "setup", "alarms", "calls", "diagnostics")


def heap(page):
    """Return (MB of the heap after a collection, elements of the page)."""
    page.call("HeapProfiler.collectGarbage")
    metrics = {one["name"]: one["value"] for one in page.call("Performance.getMetrics")["metrics"]}
    return metrics["JSHeapUsedSize"] / 1e6, int(metrics["Nodes"])


def main(minutes):
    with FakePanel() as panel, Browser() as browser:
        panel.wave = 0.3
        page = browser.open(panel.url)
        page.until("!document.body.classList.contains('stale')")
        page.call("Performance.enable")
        seen, number = [], 0
        begun = time.monotonic()
        for look in range(1, LOOKS + 1):
            while time.monotonic() < begun + 60.0 * minutes * look / LOOKS:
                number += 1
                panel.say(t="alarm", alarm={
                    "n": number, "wall": time.time(), "until": None, "level": "warning", "code": None,
                    "text": "warning %d" % number, "source": "driver"})
                panel.say(t="call", call={
                    "n": number, "wall": time.time(), "service": "/a", "name": "get_fk", "type": "", "caller": "/b",
                    "request": "x" * 200, "answer": "y" * 200, "took": 0.01, "ok": True, "error": ""})
                page.click("#tab-" + TABS[number % len(TABS)])
                time.sleep(0.5)
            seen.append(heap(page))
            print("%5.1f min: %6.2f MB, %d elements" % ((time.monotonic() - begun) / 60.0, *seen[-1]), flush=True)
        assert not page.complaints, page.complaints
    first, last = max(one[0] for one in seen[:LOOKS // 10]), seen[-1][0]
    print("from %.2f to %.2f MB" % (first, last))
    return 0 if last < GROWTH * first else 1


if __name__ == "__main__":
    sys.exit(main(float((sys.argv[1:] + ["30"])[0])))
