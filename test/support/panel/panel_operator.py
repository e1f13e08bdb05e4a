"""An operator at the panel's page, in a real browser: holds a jog button, and releases it in every possible way.

Moments are those of ``time.monotonic()``; the browser stamps what it sends with the same clock.
"""
import contextlib
import json
import os
import signal
import time

from browser import Browser, BrowserError
from driver_bench import LiveDriver
from jog_pad import last_frame_of_motion
from panel_page import PanelProcess
from waiting import eventually

WAIT = 60.0
BUTTON = ".jog-button[data-axis='%d'][data-sign='%d']"
TAKES_CONTROL = """(() => {
    if (document.body.dataset.may === 'take') document.querySelector('#control-button').click();
    return document.body.dataset.may === 'control';
})()"""
SETTLED_S = 0.25
"""Time for which the arm moves before the release, s."""
TAKEN_OVER = "second page takes over"
HELD_ON_S = 0.25
"""Time for which the button stays pressed once the arm rests, s: messages held back have come by then."""


class Operator:
    """A driver on a simulated controller with a log, the panel, and a page in a browser that has control.

    Attributes:
        moments: By way of release: (when the last heartbeat that could count was sent, when rest was seen).
    """

    def __init__(self, folder, panel=(), **parameters):
        self.stack = contextlib.ExitStack()
        self.live = self.stack.enter_context(LiveDriver(folder, name="jogging", **parameters))
        self.live.arm.wait_until_ready()
        self.panel = PanelProcess(*panel)
        self.browser = Browser()
        self.page = self.other = None
        self.moments = {}
        self.presses = 0

    def open(self, control=True):
        """Open a page that shows the present, and has control."""
        page = self.browser.open("%s#token=%s" % (self.panel.address, self.panel.token))
        page.until("!document.body.classList.contains('stale')", "the arm is seen", WAIT)
        if not control:
            return page
        page.click("#control-button")
        page.until("document.body.dataset.may === 'control'", "control", WAIT)
        return page

    def let_go(self, way):
        """Jog until the arm moves, release in this way, and see it rest."""
        if self.page is None:
            self.page = self.open()
        if way == TAKEN_OVER:
            self.other = self.open(control=False)
        held = self._hold()
        assert held, "it is not jogged: %s" % self.page.text(".said")
        time.sleep(SETTLED_S)
        fault = WAYS[way](self, held)
        assert eventually(self._rests, WAIT), "it goes on"
        assert not eventually(self.live.simulator.is_moving, HELD_ON_S), "it resumes"
        self.moments.setdefault(way, []).append((self._last_heartbeat(fault), time.monotonic()))
        self._tidy(held)

    def _hold(self):
        """Press a button until the arm moves; try again where a busy host ends the jog."""
        self.presses += 1
        button = BUTTON % (0, 1 if self.presses % 2 else -1)
        for _ in range(20):
            x, y = self.page.press(button)
            if eventually(self.live.simulator.is_moving, 2.0):
                return x, y, button
            self.page.mouse("Released", x, y)
        return None

    def _rests(self):
        return not self.live.simulator.is_moving() and not self.live.simulator.state()["is_servo_active"]

    def _last_heartbeat(self, fault):
        beats = [at for at, text in self.page.sent if json.loads(text)["t"] == "jog" and at <= fault]
        return beats[-1]

    def _tidy(self, held):
        """Restore page and panel for the next way of release."""
        with contextlib.suppress(BrowserError):
            self.page.mouse("Released", held[0], held[1])
        has_panel, has_browser = self.panel.process.poll() is None, self.browser.process.poll() is None
        if not has_panel:
            self.panel.end()
            self.panel = PanelProcess()
        if not (has_panel and has_browser):
            self.browser.close()
            self.browser = Browser()
        if not (has_panel and has_browser) or self.page.is_crashed or self.page.is_closed:
            self.page = None
        else:
            self.page.sent.clear()

    def network_process(self):
        """Return the process id of the browser's network service."""
        for name in os.listdir("/proc"):
            with contextlib.suppress(OSError, ValueError):
                if os.getpgid(int(name)) == self.browser.process.pid:
                    with open("/proc/%s/cmdline" % name, "rb") as file:
                        if b"network.mojom.NetworkService" in file.read():
                            return int(name)
        raise AssertionError("the browser has no network service of its own")

    def verdict(self):
        self.close()
        return self.live.verdict()

    def close(self):
        self.browser.close()
        self.panel.end()
        self.stack.pop_all()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(Exception):
            self.close()
        self.live.__exit__(*_)


# ---- ways of letting go; each returns the moment after which no heartbeat counts, ALL where all that were sent do ----

ALL = float("inf")


def release(operator, held):
    operator.page.mouse("Released", held[0], held[1])
    return ALL


def slip_off(operator, held):
    operator.page.mouse("Moved", held[0], held[1] + 200, 1)
    return ALL


def lose_focus(operator, held):
    operator.page.call("Emulation.setFocusEmulationEnabled", enabled=False)
    operator.page.evaluate("window.dispatchEvent(new Event('blur'))")
    operator.page.call("Emulation.setFocusEmulationEnabled", enabled=True)
    return ALL


def stand_still(operator, held):
    """Keep the page's JavaScript busy for a second, with the button down."""
    operator.page.evaluate("(() => { const end = performance.now() + 1000; while (performance.now() < end); })()")
    return ALL


def be_frozen(operator, held):
    """Freeze the tab as a browser does in the background; a browser freezes none whose focus is emulated."""
    page = operator.page
    page.evaluate("window.is_frozen = document.addEventListener('freeze', () => { window.is_frozen = true; }); true")
    page.call("Emulation.setFocusEmulationEnabled", enabled=False)
    page.call("Page.setWebLifecycleState", state="frozen")
    assert eventually(operator._rests, WAIT), "it goes on"
    page.call("Page.setWebLifecycleState", state="active")
    page.call("Emulation.setFocusEmulationEnabled", enabled=True)
    page.until("window.is_frozen && document.visibilityState === 'visible'", "the tab was frozen")
    take_control(page)
    return ALL


def be_hidden(operator, held):
    """Set the window to minimized until the arm rests."""
    page = operator.page
    page.call("Emulation.setFocusEmulationEnabled", enabled=False)
    window = operator.browser.call("Browser.getWindowForTarget", targetId=page.target)["windowId"]
    operator.browser.call("Browser.setWindowBounds", windowId=window, bounds={"windowState": "minimized"})
    page.until("document.visibilityState === 'hidden'")
    assert eventually(operator._rests, WAIT)
    operator.browser.call("Browser.setWindowBounds", windowId=window, bounds={"windowState": "normal"})
    page.until("document.visibilityState === 'visible'")
    page.call("Emulation.setFocusEmulationEnabled", enabled=True)
    return ALL


def close_tab(operator, held):
    operator.page.close()
    return ALL


def crash(operator, held):
    operator.page.send("Page.crash")
    operator.browser.wait_for(lambda: operator.page.is_crashed, "the page crashes", WAIT)
    return ALL


def take_control(page):
    """Take control with a page whose link is made anew: what is pressed before it is open is lost."""
    assert eventually(lambda: page.evaluate(TAKES_CONTROL), WAIT), "control does not come back"


def load_again(operator, held):
    operator.page.load_again()
    assert eventually(operator._rests, WAIT), "it goes on"
    take_control(operator.page)
    return ALL


def kill_browser(operator, held):
    moment = time.monotonic()
    os.killpg(operator.browser.process.pid, signal.SIGKILL)
    operator.browser.process.wait(WAIT)
    return moment


def cut_network(operator, held):
    """Freeze the browser's network process: nothing gets through, and nothing is closed."""
    process = operator.network_process()
    moment = time.monotonic()
    os.kill(process, signal.SIGSTOP)
    try:
        assert eventually(operator._rests, WAIT)
        time.sleep(0.3)
    finally:
        os.kill(process, signal.SIGCONT)
    return moment


def kill_server(operator, held):
    moment = operator.panel.send(signal.SIGKILL)
    operator.panel.process.wait(WAIT)
    return moment


def stop_server(operator, held):
    moment = operator.panel.send(signal.SIGSTOP)
    try:
        assert eventually(operator._rests, WAIT)
    finally:
        operator.panel.send(signal.SIGCONT)
    return moment


def be_taken_over(operator, held):
    """Give control to another page while the button is down."""
    page, other = operator.page, operator.other
    other.click("#control-button")
    page.until("!document.querySelector('#take-over').hidden")
    moment = time.monotonic()
    page.evaluate("document.querySelector('#take-over button').click()")  # as with another finger
    other.until("document.body.dataset.may === 'control'")
    other.close()
    page.until("document.body.dataset.may === 'take'")
    page.click("#control-button")
    page.until("document.body.dataset.may === 'control'", "control comes back", WAIT)
    return moment


def press_stop(operator, held):
    operator.page.key(" ")
    return ALL


WAYS = {
    "released": release, "pointer slips off": slip_off, "focus lost": lose_focus, "JavaScript blocked": stand_still,
    "tab hidden": be_hidden, "tab frozen": be_frozen, "tab closed": close_tab, "page crashed": crash,
    "loaded again": load_again,
    "browser killed": kill_browser, "network cut": cut_network, "server killed": kill_server,
    "server stopped": stop_server, TAKEN_OVER: be_taken_over, "space bar": press_stop,
}


def times_to_rest(verdict, moments):
    """Return by way of release, for each time, s from the last heartbeat that counted to the last frame of motion on
    the wire."""
    return {way: [last_frame_of_motion(verdict, since, until) - since for since, until in each]
            for way, each in moments.items()}
