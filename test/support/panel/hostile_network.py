"""The cells of a panel's hostile network: links, strangers, restarts; in each a page stops the arm, or jogs it.

A cell returns moments of ``time.monotonic``; the simulated controller's log has what came of them. ``bench`` is a
JogBench, ``loop`` the loop of its pages.
"""
import contextlib
import signal
import time

from flooding import strangers
from panel_page import Page
from slow_link import SlowLink
from waiting import WAIT, eventually

LINKS = {"no delay": {}, "150 ms there and back": {"delay": 0.075}, "300 ms": {"delay": 0.15},
         "800 ms": {"delay": 0.4}, "losses": {"delay": 0.02, "loss": 0.05}}
JOGGED = {"no delay": 0.0, "100 ms there and back": 0.05}
"""Links that can carry a jog: the delay each way, s."""
STOP = "stop_program"
"""The first command of a stop on the controller's wire."""
RESUMES_S = 0.3
"""Time for which an arm is looked at that must not move, s: several messages of a held button come in it."""


def sees(page, arm):
    """Return whether a page is shown the present of an arm."""
    return page.states.get(arm, {}).get("fresh")


def seen_over(bench, loop, link, control=False):
    """Open a page over a link, and see the arm."""
    page = Page(loop, bench.panel, port=link.port)
    page.watch(bench.arm)
    assert eventually(lambda: sees(page, bench.arm))
    if control:
        assert eventually(page.take_control)
    return page


def stop(page, arm):
    """Stop; return when it was sent. The answer says that the driver has served it."""
    since = time.monotonic()
    answer = page.ask("stop", arm=arm)
    assert answer["ok"], answer
    return since


def stop_over_a_link(bench, loop, settings, count):
    """Stop over a link; return the moments, and the link, which knows how long each took on it."""
    with SlowLink(loop, bench.panel.port, **settings) as link, contextlib.closing(seen_over(bench, loop, link)) as page:
        return [stop(page, bench.arm) for _ in range(count)], link


def stop_among(bench, count, kind, stops):
    """Stop among strangers; return the moments, and whether the page was cut off."""
    with strangers(bench.panel, count, kind):
        moments = [stop(bench.page, bench.arm) for _ in range(stops)]
        is_cut = bench.page.closed is not None
    if is_cut:
        bench.renew_page()
    return moments, is_cut


def stall_a_jog(bench, loop, delay):
    """Jog over a link, stall it, and let all that waited come in a burst; return the last heartbeat and the end."""
    with SlowLink(loop, bench.panel.port, delay) as link, contextlib.closing(
            seen_over(bench, loop, link, control=True)) as page:
        sign = [1.0]

        def moves():
            page.release()
            sign[0] = -sign[0]
            page.press(bench.arm, [sign[0], 0.0, 0.0, 0.0, 0.0, 0.0])
            return eventually(bench.live.simulator.is_moving, 1.0)
        assert eventually(moves, WAIT), page.messages[-5:]
        link.is_stalled = True
        since = page.sent_at
        assert bench.rests()
        link.is_stalled = False
        before = page.counts.get("pong", 0)
        assert eventually(lambda: page.counts.get("pong", 0) > before + 1), "what waited has come"
        assert not bench.live.simulator.is_moving(), "it resumes"
        page.release()
        return since, time.monotonic()


def press_moves(bench, reasons):
    """Press a button for a moment; return whether the arm moved, and add why not to ``reasons``.

    "Moving" is said of no press that moves nothing.
    """
    page, simulator = bench.page, bench.live.simulator
    before = simulator.state()["joint_position"]
    hold = page.press(bench.arm, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    is_moving = eventually(simulator.is_moving, 1.0)
    page.release()
    assert eventually(lambda: page.jog_states(hold)), "nothing is said of the press"
    is_said = any(one["state"] == "moving" for one in page.jog_states(hold))
    assert not is_said or simulator.state()["joint_position"] != before
    reasons.extend(one["why"] for one in page.jog_states(hold) if one["state"] == "ended" and one.get("why"))
    return is_moving


def restart_the_driver(bench):
    """Kill the driver in mid-jog and start another, while the button is held; return when it was killed, and for how
    long the page was shown its arm as the present, s.

    A button that is held on moves nothing afterwards.
    """
    page, live = bench.page, bench.live
    bench.begin()
    hold = page.held
    since = live.send(signal.SIGKILL)
    assert eventually(lambda: not sees(page, bench.arm)), "a driver that is dead is shown as the present"
    shown_s = time.monotonic() - since
    live.kill_driver()
    live.start()
    assert eventually(lambda: sees(page, bench.arm)), "the new driver is not shown"
    before = live.simulator.state()["joint_position"]
    time.sleep(RESUMES_S)
    assert live.simulator.state()["joint_position"] == before, "it resumes"
    assert page.jog_states(hold)[-1]["state"] == "ended", "it is said to be jogged"
    page.release()
    return since, shown_s


def restart_the_panel(bench):
    """Kill the panel and start it again, in the same place; return when it was killed, and how long the page took to
    know, s.

    The place is the same where the bench has a port and a token file.
    """
    place, page = (bench.panel.address, bench.panel.token), bench.page
    since = bench.panel.send(signal.SIGKILL)
    assert eventually(lambda: page.closed is not None), "nobody knows that the panel is dead"
    known_s = time.monotonic() - since
    page.close()
    bench.restart()
    assert (bench.panel.address, bench.panel.token) == place
    return since, known_s


def restart_the_master(bench, graph):
    """End the ROS master, stop the arm without it, and start it again; return when that stop was sent."""
    page = bench.page
    graph.stop_master()
    moments = []

    def stops():
        moments.append(time.monotonic())
        return page.ask("stop", arm=bench.arm)["ok"]
    assert eventually(stops), "the panel knows where the driver is"
    graph.start_master()
    topic = bench.arm + "/jog_joints"
    assert eventually(lambda: any(name == topic and "/panel" in nodes
                                  for name, nodes in graph.master().getSystemState()[0])), "it registers again"
    return moments[-1]
