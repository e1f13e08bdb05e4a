"""The page over slow and silent links: it connects, watches and stops, and says no more than it has seen."""
import contextlib
import time

import pytest
from fake_panel import REFUSED, TOKEN
from panel_page import Loop
from slow_link import SlowLink
from waiting import eventually

JOG = '.jog-button[data-axis="0"][data-sign="1"]'
TRUTH_MS = 3000
"""Time limit for the truth about a stop, ms: 1 s on a quiet host, and what a busy one may take away."""
SAYS = """window.said = new Promise((resolve) => {
    const since = performance.now();
    const place = document.querySelector('#stop-said');
    new MutationObserver((_, observer) => {
        if (!place.textContent.includes('CONFIRMED')) return;
        observer.disconnect();
        resolve(performance.now() - since);
    }).observe(place, {childList: true, characterData: true, subtree: true});
}); true"""


@pytest.fixture(scope="module")
def loop():
    with contextlib.closing(Loop()) as loop:
        yield loop


def beats(panel):
    return panel.sent("jog")


@pytest.mark.parametrize("delay", [0.1, 0.4], ids=["200 ms there and back", "800 ms"])
def test_over_a_slow_link_it_watches_and_stops_and_refuses_to_jog(browser, panel, loop, delay):
    with SlowLink(loop, panel.port) as link:
        page = browser.open("http://127.0.0.1:%d/#token=%s" % (link.port, TOKEN))
        page.until("document.querySelector('#joints td.number')?.textContent", "it is drawn")
        link.delay = delay
        panel.cut()
        page.until("!document.querySelector('#link-loss').hidden")
        page.until("document.querySelector('#link-loss').hidden", "it connects again")
        page.click("#control-button")
        page.until("document.body.dataset.may === 'control'")
        page.until_text("#age", "SLOW LINK: 0.4" if delay > 0.3 else "live, 1")
        deadline = time.monotonic() + 60.0
        while "too slow to jog" not in page.text("#panel-jog .said"):  # it takes some pings to know
            assert time.monotonic() < deadline
            x, y = page.press(JOG)
            page.mouse("Released", x, y)
        page.key(" ")
        page.until_text("#stop-said", "confirmed at rest")
        stops, count = len(panel.stops), len(beats(panel))
        assert stops, "what was sent before it has come, too"
        x, y = page.press(JOG)
        page.key(" ")
        assert eventually(lambda: len(panel.stops) > stops) and len(beats(panel)) == count and not page.complaints
        page.mouse("Released", x, y)
        page.close()


def test_what_a_queue_on_the_link_holds_back_is_not_shown_as_new(browser, panel, loop):
    with SlowLink(loop, panel.port) as link:
        page = browser.open("http://127.0.0.1:%d/#token=%s" % (link.port, TOKEN))
        page.until_text("#age", "live")
        time.sleep(1.0)  # some round trips are quick, and count for 4 s
        page.until_text("#age", "live")
        for _ in range(40):
            link.delay += 0.02
            time.sleep(0.03)  # the pace at which the queue grows is the subject
        page.until("document.body.classList.contains('stale')", "0.8 s old, and known to be at once", timeout=1.5)
        link.delay = 0.0
        page.until("!document.body.classList.contains('stale')")
        assert not page.complaints
        page.close()


def test_a_stop_is_confirmed_by_the_arm_alone(panel, open_page):
    page = open_page()
    panel.state["dq"] = [0.0, 0.2, 0.0, 0.0, 0.0, 0.0]
    page.evaluate(SAYS)
    page.key(" ")
    assert page.evaluate("window.said") < TRUTH_MS
    page.until_text("#stop-said", "NOT CONFIRMED: use the emergency stop button")
    panel.state["dq"] = [0.0] * 6
    page.until_text("#stop-said", "confirmed at rest")


def test_the_measure_of_the_truth_can_fail(panel, open_page):
    page = open_page()
    panel.silent = True
    page.evaluate("window.begin = setTimeout; window.setTimeout = (call, ms) => window.begin(call, 4 * ms); true")
    page.evaluate(SAYS)
    page.key(" ")
    assert page.evaluate("window.said") > TRUTH_MS
    panel.silent = False


def test_over_a_link_that_fell_silent_the_truth_about_a_stop_comes_in_time(panel, open_page):
    page = open_page()
    panel.silent = True
    page.evaluate(SAYS)
    page.key(" ")
    assert page.evaluate("window.said") < TRUTH_MS
    page.until_text("#link-loss", "silent for")
    page.until("document.body.classList.contains('stale')")
    panel.silent = False
    page.until("document.querySelector('#link-loss').hidden")


def test_a_page_that_lost_its_link_has_no_control(panel, open_page):
    page = open_page(control=True)
    page.expected.append(REFUSED)
    panel.refusing = True
    panel.cut()
    page.until("document.body.dataset.may !== 'control'")
    panel.refusing = False
    page.until("document.querySelector('#link-loss').hidden")


def test_moving_is_what_the_arm_does(panel, open_page):
    page = open_page(control=True)
    deadline = time.monotonic() + 60.0
    said = "document.querySelector('#panel-jog .said').textContent"
    for dq, text in (([0.0] * 6, "no motion seen"), ([0.1] + [0.0] * 5, "Moving J1+")):
        panel.state["dq"] = dq
        seen = False
        while not seen:  # a busy host ends a jog
            assert time.monotonic() < deadline, page.evaluate(said)
            x, y = page.press(JOG)
            seen = page.until("%s.includes('%s') || !document.querySelector('%s').classList.contains('held')" % (
                said, text, JOG)) and page.evaluate("%s.includes('%s')" % (said, text))
            page.mouse("Released", x, y)
