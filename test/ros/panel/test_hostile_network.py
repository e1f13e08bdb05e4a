"""A panel over slow, lossy and stalled links, among strangers that flood it, and after restarts: stop and dead-man."""
import contextlib
import signal
import time
from types import SimpleNamespace

import pytest
from driver_bench import DriverProcess, LiveDriver, SimulatorProcess, on
from flooding import strangers
from jog_pad import last_frame_of_motion
from panel_jog import JogBench
from panel_page import Loop, Page, PanelProcess
from ros_graph import Graph, changed_environment
from slow_link import LOST_S, SlowLink
from waiting import WAIT, eventually

STOP_S = 1.0
"""Time limit of a stop to the wire besides the way of the link, s: 0.25 s on a quiet host
(test/benchmark/bench_panel_flood.py), and what a busy one may take away. Without a loop of its own, a stop among three
strangers took 6 s."""
REST_S = 1.0
"""Time limit from the last heartbeat that counts to rest, s: 0.3 s on a quiet host."""
STOP = "stop_program"
LINKS = {"no delay": {}, "150 ms there and back": {"delay": 0.075}, "300 ms": {"delay": 0.15},
         "800 ms": {"delay": 0.4}, "losses": {"delay": 0.02, "loss": 0.05}}
FLOODS = {"1 stranger": (1, "ping"), "3 strangers": (3, "ping"), "10 strangers": (10, "ping"),
          "3 strangers with fragments": (3, "fragments"), "10 strangers that come and go": (10, "connections")}
STOPS = 3
STOPS_AT_ONCE = 12
GIVEN_UP_S = 4.0
"""Time limit, s, for the answer that a driver does not stop: 0.9 s on a quiet host; it took 5.3 s."""
JOGGED = {"no delay": 0.0, "100 ms there and back": 0.05}


@pytest.fixture(scope="module")
def told(ros_node, tmp_path_factory):
    told = SimpleNamespace(stops={}, ends={}, refused=[], connected=set(), is_cut=set())
    with LiveDriver(tmp_path_factory.mktemp("network"), name="far", guard=False) as live, contextlib.closing(
            Loop()) as loop, contextlib.closing(JogBench(live, loop)) as bench:
        live.arm.wait_until_ready()
        for name, link in LINKS.items():
            over_a_link(bench, loop, told, name, link)
        for name, (count, kind) in FLOODS.items():
            with strangers(bench.panel.port, count, kind):
                told.stops[name] = [stop(bench.page, bench.arm) for _ in range(STOPS)]
            if bench.page.closed is not None:
                told.is_cut.add(name)
                bench.renew_page()
        bench.page.close()
        for name, delay in JOGGED.items():
            stalled(bench, loop, told, name, delay)
        jog_over_a_slow_link(bench, loop, told)
        plant_defects(bench, loop, told)
        freeze_the_driver(bench, told)
        bench.close()
        told.verdict = live.verdict()
        yield told


def seen_over(bench, loop, link, control=False):
    """Open a page over a link, and see the arm."""
    page = Page(loop, bench.panel, port=link.port)
    page.watch(bench.arm)
    assert eventually(lambda: page.states.get(bench.arm, {}).get("fresh"))
    if control:
        assert eventually(page.take_control)
    return page


def stop(page, arm):
    """Stop; return when it was sent. The answer says that the driver has served it."""
    since = time.monotonic()
    assert page.ask("stop", arm=arm)["ok"]
    return since


def over_a_link(bench, loop, told, name, settings):
    with SlowLink(loop, bench.panel.port, **settings) as link, contextlib.closing(seen_over(bench, loop, link)) as page:
        told.connected.add(name)
        told.stops[name] = [stop(page, bench.arm) for _ in range(STOPS)]


def stalled(bench, loop, told, name, delay):
    """Jog over a link, stall it, and let all that waited come in a burst."""
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
        told.ends[name] = since, time.monotonic()
        page.release()


def plant_defects(bench, loop, told):
    """Take the measures where they must fail: over a link that cannot carry a stop, of a jog that goes on."""
    with SlowLink(loop, bench.panel.port, STOP_S + 0.2) as link, contextlib.closing(
            seen_over(bench, loop, link)) as page:
        told.late = stop(page, bench.arm)
    bench.renew_page()
    bench.begin()
    since = time.monotonic()
    assert eventually(lambda: time.monotonic() > since + REST_S + 0.2)
    bench.page.release()
    assert bench.rests()
    told.long = since, time.monotonic()


def jog_over_a_slow_link(bench, loop, told):
    with SlowLink(loop, bench.panel.port, 0.2) as link, contextlib.closing(
            seen_over(bench, loop, link, control=True)) as page:
        hold = page.press(bench.arm, [1.0] + [0.0] * 5)
        told.refused = page.wait("jog", lambda m: m["hold"] == hold)
        told.jogged = bench.live.simulator.is_moving()
        page.release()


def freeze_the_driver(bench, told):
    """Stop a driver that stands still, more often than there are threads for it; then let it go on."""
    bench.live.send(signal.SIGSTOP)
    since, page = time.monotonic(), bench.page
    for number in range(STOPS_AT_ONCE):
        page.send(t="stop", id="frozen %d" % number, arm=bench.arm)
    told.frozen = [page.wait("answer", lambda m, n=number: m["id"] == "frozen %d" % n)
                   for number in range(STOPS_AT_ONCE)]
    told.gave_up = time.monotonic() - since
    told.one_more = page.ask("stop", arm=bench.arm)
    bench.live.send(signal.SIGCONT)
    told.thawed = eventually(lambda: page.ask("stop", arm=bench.arm)["ok"])


def way_of(name):
    link = LINKS.get(name, {})
    return link.get("delay", 0.0) + (5 * LOST_S if "loss" in link else 0.0)


@pytest.mark.parametrize("name", [*LINKS, *FLOODS])
def test_a_stop_is_on_the_wire_as_soon_as_its_link_carries_it(told, name):
    for since in told.stops[name]:
        assert min(told.verdict.times_of(STOP, since)) - since <= way_of(name) + STOP_S


def test_the_measures_of_stop_and_rest_can_fail(told):
    assert min(told.verdict.times_of(STOP, told.late)) - told.late > STOP_S
    assert last_frame_of_motion(told.verdict, *told.long) - told.long[0] > REST_S


@pytest.mark.parametrize("name", FLOODS)
def test_no_stranger_pushes_off_the_page_that_has_control(told, name):
    assert name not in told.is_cut


@pytest.mark.parametrize("name", JOGGED)
def test_a_stall_ends_a_jog_and_the_burst_behind_it_begins_none(told, name):
    since, until = told.ends[name]
    assert last_frame_of_motion(told.verdict, since, until) - since <= REST_S


def test_a_driver_that_stands_still_is_given_up_in_time_and_stopped_when_it_goes_on(told):
    assert not any(answer["ok"] for answer in told.frozen) and told.gave_up < GIVEN_UP_S
    assert not told.one_more["ok"] and "no answer" in told.one_more["message"], "the threads are free again"
    assert told.thawed


def test_a_jog_over_a_link_that_is_too_slow_is_refused_with_the_reason(told):
    assert told.refused["state"] == "ended" and "too slow" in told.refused["why"] and not told.jogged


def test_a_page_stops_the_arm_without_a_master_and_moves_it_after_its_restart(ros_master, tmp_path, loop):
    with Graph(tmp_path, is_mortal=True) as graph, contextlib.closing(
            SimulatorProcess("--start", "enabled")) as simulator, contextlib.ExitStack() as stack:
        stack.enter_context(DriverProcess("jaka_driver", graph.environment, **on(simulator, guard=False)))
        with changed_environment(graph.environment):
            panel = stack.enter_context(PanelProcess())
        page = stack.enter_context(Page(loop, panel))
        assert eventually(lambda: page.watch("/jaka_driver") or eventually(
            lambda: page.states.get("/jaka_driver", {}).get("fresh"), 1.0))
        assert page.take_control()

        reasons = []

        def moves():
            """Return whether a press moves the arm; "moving" is said of no press that does not."""
            before = simulator.state()["joint_position"]
            hold = page.press("/jaka_driver", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
            is_moving = eventually(simulator.is_moving, 1.0)
            page.release()
            assert eventually(lambda: page.jog_states(hold)), "nothing is said of the press"
            is_said = any(one["state"] == "moving" for one in page.jog_states(hold))
            assert not is_said or simulator.state()["joint_position"] != before
            reasons.extend(one["why"] for one in page.jog_states(hold) if one["state"] == "ended" and one.get("why"))
            return is_moving
        assert eventually(moves)
        graph.stop_master()
        assert eventually(lambda: page.ask("stop", arm="/jaka_driver")["ok"]), "the panel knows where the driver is"
        graph.start_master()
        assert eventually(lambda: any(topic == "/jaka_driver/jog_joints" and "/panel" in nodes
                                      for topic, nodes in graph.master().getSystemState()[0])), "it registers again"
        reasons.clear()
        assert eventually(moves), reasons
