"""The ways in which a hand, a page, a network or the panel itself ends a jog; measured in the controller's log."""
import signal
import time

from panel_page import PERIOD_S, WAIT, Page, PanelProcess
from waiting import eventually

SPEED = 0.8
"""The limit of the driver's jog speed."""
SPACES = {"joint": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], "base": [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]}


class JogBench:
    """A driver, a panel and its pages.

    Args:
        live: A LiveDriver.
        loop: The event loop of the pages.
        arguments: Arguments of the panel.
    """

    def __init__(self, live, loop, *arguments):
        self.live, self.arm, self._loop, self._arguments = live, live.arm.name, loop, arguments
        self._sign = -1.0
        self.panel = PanelProcess(*arguments)
        self.page = self.new_page()

    def new_page(self, control=True):
        """Open a page that sees the arm, with control."""
        page = Page(self._loop, self.panel, name="operator")
        seen = eventually(lambda: self._sees(page), WAIT)
        assert seen, "the panel does not show the arm: %s" % page.messages
        if control:
            assert page.take_control()
            assert page.command("jog_speed", None, fraction=SPEED)["ok"]
        return page

    def _sees(self, page):
        page.watch(self.arm)
        return eventually(lambda: page.states.get(self.arm, {}).get("fresh"), 1.0)

    def restart(self):
        """Start another panel."""
        self.panel.end(signal.SIGKILL)
        self.panel = PanelProcess(*self._arguments)
        self.page = self.new_page()

    def renew_page(self):
        """Open another page in place of one that has gone."""
        self.page = self.new_page()

    def begin(self, space="joint"):
        """Press, and see the arm move, to and fro in turn; press again where a busy host ends the jog."""
        self._sign = -self._sign

        def moves():
            self.page.release()
            self.page.press(self.arm, [self._sign * value for value in SPACES[space]], space)
            return eventually(self.live.simulator.is_moving, 1.0)
        assert eventually(moves, WAIT), "it is not jogged: %s" % self.page.messages[-5:]

    def rests(self):
        """Return whether the arm rests and nothing is streamed: in the gaps of a busy host's stream the arm rests,
        too."""
        def done():
            state = self.live.simulator.state()
            return not state["is_moving"] and not state["is_servo_active"]
        return eventually(done, WAIT)

    def go_home(self):
        """Move the arm to where it began, once the driver has left servo mode."""
        assert self.rests()
        self.live.arm.go_home()

    def close(self):
        if self.page.closed is None:
            self.page.__exit__()
        self.panel.end()


# ---- each returns when the last heartbeat that counted was sent, or when what ended it happened ----

def release(bench):
    since = time.monotonic()
    bench.page.release()
    return since


def fall_silent(bench):
    """Block the page's JavaScript, or freeze its tab: the connection stays open."""
    bench.page.let_go_silently()
    return bench.page.sent_at


def close_the_tab(bench):
    since = time.monotonic()
    bench.page.let_go_silently()
    bench.page.close()
    return since


def be_cut_off(bench):
    """Reset the connection."""
    since = time.monotonic()
    bench.page.cut()
    return since


def be_stalled(bench):
    """Hold everything back for 0.5 s in the network, and then deliver it at once."""
    page = bench.page
    page.is_stalled = True
    since = page.sent_at
    time.sleep(0.5)
    page.is_stalled = False
    return since


def see_the_past(bench):
    """Show no new states any more, but go on with heartbeats: a state of 0.25 s ago permits no jog."""
    bench.page.is_shown = False
    return time.monotonic() + 0.25


def lose_control(bench):
    """Let another page ask for control and be given it."""
    other = bench.new_page(control=False)
    try:
        assert not other.take_control()
        bench.page.wait("control", lambda m: m["asked"] is not None)
        since = time.monotonic()
        bench.page.send(t="answer_control", give=True)
        other.wait("control", lambda m: m["you"])
        assert bench.rests(), "it goes on"
    finally:
        other.close()
    return since


def be_joined(bench):
    """Hold a button on a second page, too, without control: the first page goes on, until it releases."""
    other = bench.new_page(control=False)
    try:
        other.press(bench.arm, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
        other.wait("error", lambda m: m["code"] == "no_control")
        since = bench.page.sent_at
        bench.page.let_go_silently()
        since = max(since, bench.page.sent_at)
        assert bench.rests(), "a page without control moves the arm"
    finally:
        other.close()
    return since


def be_stopped(bench):
    """Stop the arm from another page without control."""
    other = bench.new_page(control=False)
    try:
        since = time.monotonic()
        answer = other.ask("stop", arm=bench.arm)
        assert answer["ok"], answer
    finally:
        other.close()
    return since


def freeze_the_panel(bench):
    """Freeze the panel with SIGSTOP."""
    since = bench.panel.send(signal.SIGSTOP)
    assert bench.rests(), "it goes on"
    time.sleep(3 * PERIOD_S)
    bench.panel.send(signal.SIGCONT)
    return since


def kill_the_panel(bench):
    return bench.panel.send(signal.SIGKILL)


WAYS = {"release": release, "silence": fall_silent, "tab closed": close_the_tab, "reset": be_cut_off,
        "stalled network": be_stalled, "old picture": see_the_past, "control lost": lose_control,
        "second page": be_joined, "stop": be_stopped, "SIGSTOP": freeze_the_panel, "SIGKILL": kill_the_panel}
END_THE_PAGE = ("tab closed", "reset", "control lost", "SIGSTOP")


def let_go(bench, way, space="joint"):
    """Jog, release in this way, see the arm rest and stay at rest; return (last that counted, rest was seen)."""
    bench.begin(space)
    since = WAYS[way](bench)
    assert bench.rests(), "%s: it goes on" % way
    rested = time.monotonic()
    if way != "SIGKILL":
        time.sleep(4 * PERIOD_S)
        assert not bench.live.simulator.is_moving(), "%s: it resumes" % way
    bench.page.let_go_silently()
    bench.page.is_shown = True
    if way == "SIGKILL":
        bench.page.__exit__()
        bench.restart()
    elif way in END_THE_PAGE:
        bench.page.__exit__()
        bench.renew_page()
    return since, rested
