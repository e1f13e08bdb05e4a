"""STOP of the page: what it says of the arm is what the arm's states show, for as long as they show it."""
import asyncio
import json
import time

import pytest
from aiohttp import web
from fake_panel import ARM, FakePanel, arm_info
from waiting import eventually

MANY_ARMS = "this arm: confirmed at rest"


class HeldPanel(FakePanel):
    """A panel whose messages wait on their way while ``held`` is a list.

    Attributes:
        withheld: A file whose name ends so is not served before it is empty.
        broken: A file whose name ends so is not there.
    """

    held = None
    withheld = broken = ""

    async def _file(self, request):
        while self.withheld and request.path.endswith(self.withheld):
            await asyncio.sleep(0.01)  # another thread sets it
        if self.broken and request.path.endswith(self.broken):
            raise web.HTTPNotFound
        return await super()._file(request)

    async def _send(self, socket, message):
        message = dict({"now": time.monotonic()}, **message)
        if self.held is None:
            await super()._send(socket, message)
        else:
            self.held.append((socket, message))

    async def _let_go(self):
        waiting, self.held = self.held, None
        for socket, message in waiting:
            await super()._send(socket, message)

    def let_go(self):
        """Deliver what waits, in its order."""
        asyncio.run_coroutine_threadsafe(self._let_go(), self._loop).result(30.0)


@pytest.fixture
def panel():
    with HeldPanel() as server:
        yield server


def test_samples_of_before_a_stop_by_post_confirm_nothing(panel, open_page):
    page = open_page()
    page.evaluate("""(() => {
        const place = document.querySelector('#stop-said');
        window.everSaid = [];
        new MutationObserver(() => window.everSaid.push(place.textContent)).observe(
            place, {childList: true, characterData: true, subtree: true});
    })()""")
    panel.held = []
    assert eventually(lambda: len(panel.held or ()) > 5), "states of an arm at rest wait on their way"
    panel.wave = 0.5
    page.click("#stop")
    assert eventually(lambda: "http" in panel.stops)
    time.sleep(0.3)  # its answer is there, which the page does not show before the messages that wait
    panel.let_go()
    page.until_text("#line-said", "Moving")
    page.until_text("#stop-said", "NOT CONFIRMED")
    said = page.evaluate("window.everSaid")
    assert not [text for text in said if "confirmed at rest" in text], said
    panel.wave = 0.0
    page.until_text("#stop-said", "confirmed at rest")


def test_the_words_of_rest_go_when_the_arm_moves(panel, open_page):
    page = open_page()
    page.click("#stop")
    page.until_text("#stop-said", "confirmed at rest")
    panel.wave = 0.5
    page.until("!document.querySelector('#stop-said').textContent.includes('confirmed')", timeout=5.0)
    panel.wave = 0.0
    page.click("#stop")
    page.until_text("#stop-said", "confirmed at rest")
    panel.silent = True
    page.until("!document.querySelector('#stop-said').textContent.includes('confirmed')", timeout=5.0)
    panel.silent = False


def test_the_words_of_rest_are_not_said_over_another_arm(panel, open_page):
    panel.arms = [arm_info(), arm_info("/other")]
    page = open_page()
    page.click("#stop")
    page.until_text("#stop-said", MANY_ARMS)
    page.evaluate("""(() => {
        const choice = document.querySelector('#arm');
        choice.value = %s;
        choice.dispatchEvent(new Event('change', {bubbles: true}));
    })()""" % json.dumps("/other" if page.evaluate("document.querySelector('#arm').value") == ARM else ARM))
    page.until("!document.querySelector('#stop-said').textContent.includes('confirmed')", timeout=5.0)


def test_where_the_browser_can_keep_nothing_the_page_works_and_stops(browser, panel):
    page = browser.open()
    page.call("Page.addScriptToEvaluateOnNewDocument", source="""
        Storage.prototype.setItem = () => { throw new DOMException('full', 'QuotaExceededError'); };""")
    page.go(panel.url)
    page.until("document.querySelector('#stop') !== null")
    page.until("document.querySelector('#joints td.number')?.textContent", "it is drawn", timeout=10.0)
    assert "token" not in page.evaluate("location.href")
    page.click("#language")
    page.until("document.documentElement.lang === 'zh-CN'", timeout=5.0)
    page.click("#language")
    page.click("#theme")
    page.click("#stop")
    page.until_text("#stop-said", "confirmed at rest")
    assert panel.stops and not page.complaints
    page.close()


def test_stop_stops_before_the_rest_of_the_page_is_there(browser, panel):
    panel.withheld = "STLLoader.js"
    page = browser.open()
    page.go_without_waiting(panel.url)
    page.until("document.querySelector('#stop:not(.unable)') !== null", "it looks like what it is")
    for count, press in enumerate((lambda: page.click("#stop"), lambda: page.key(" ")), 1):
        press()
        assert eventually(lambda count=count: panel.stops == ["http"] * count)
        page.until_text("#stop-said", "NOT CONFIRMED: use the emergency stop button", timeout=5.0)
    panel.withheld = ""
    page.until_text("#stop-said", "confirmed at rest")
    page.click("#stop")
    assert eventually(lambda: panel.stops == ["http", "http", "socket"]), "one stop for one press, by the socket now"
    assert not page.complaints
    page.close()


def test_stop_does_not_look_able_before_it_is(browser, panel):
    panel.withheld = "first_stop.js"
    page = browser.open()
    page.go_without_waiting(panel.url)
    page.until("document.querySelector('#stop.unable[aria-disabled=true]') !== null")
    panel.withheld = ""
    page.until("document.querySelector('#stop:not(.unable):not([aria-disabled])') !== null")
    page.close()


def test_stop_stops_where_a_file_of_the_page_is_missing(browser, panel):
    panel.broken = "/uPlot.esm.js"
    page = browser.open(panel.url, language="zh-CN")
    page.click("#stop")
    assert eventually(lambda: panel.stops == ["http"])
    page.until_text("#stop-said", "停止未确认：请按急停按钮", timeout=5.0)
    page.close()
