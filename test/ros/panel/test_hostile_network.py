"""A panel over slow, lossy and stalled links, among strangers that flood it, and after restarts: stop and dead-man."""
import contextlib
import signal
import time
from types import SimpleNamespace

import pytest
from driver_bench import LiveDriver
from hostile_network import (
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
    stop_among,
    stop_over_a_link,
)
from jog_pad import last_frame_of_motion
from panel_jog import JogBench
from panel_page import Loop
from ros_graph import Graph, changed_environment
from slow_link import LOST_S, SlowLink
from waiting import eventually, free_port

STOP_S = 1.0
"""Time limit of a stop to the wire besides the way of the link, s: 0.25 s on a quiet host
(test/benchmark/bench_panel_network.py), and what a busy one may take away. Without a loop of its own, a stop among
three strangers took 6 s."""
REST_S = 1.0
"""Time limit from the last heartbeat that counts to rest, s: 0.3 s on a quiet host."""
FLOODS = {"1 stranger": (1, "ping"), "3 strangers": (3, "ping"), "10 strangers": (10, "ping"),
          "3 strangers with fragments": (3, "fragments"), "10 strangers that come and go": (10, "connections")}
BY_TLS = {name + ", TLS": FLOODS[name] for name in FLOODS if name != "1 stranger"}
BY_TLS.update({"%d strangers that begin by half, TLS" % count: (count, "half begun") for count in (3, 10)})
LINK_BY_TLS = "300 ms, TLS"
RESTARTED = ("driver restarted", "panel restarted")
STOPS = 3
STOPS_AT_ONCE = 12
GIVEN_UP_S = 4.0
"""Time limit, s, for the answer that a driver does not stop: 0.9 s on a quiet host; it took 5.3 s."""
TRUTH_S = 3.0
"""Time limit, s, within which a page is shown that the driver, or the panel, is dead: 1 s on a quiet host."""


@pytest.fixture(scope="module")
def told(ros_node, certificate, tmp_path_factory):
    folder = tmp_path_factory.mktemp("network")
    told = SimpleNamespace(stops={}, ends={}, truths={}, refused=[], is_cut=set())
    cert, key = certificate
    with LiveDriver(folder, name="far", guard=False) as live, contextlib.closing(Loop()) as loop:
        live.arm.wait_until_ready()
        with contextlib.closing(JogBench(live, loop, "--port", str(free_port()), "--token-file",
                                         str(folder / "token"))) as bench:
            for name, link in LINKS.items():
                told.stops[name], _ = stop_over_a_link(bench, loop, link, STOPS)
            among_strangers(bench, told, FLOODS)
            bench.page.close()
            for name, delay in JOGGED.items():
                told.ends[name] = stall_a_jog(bench, loop, delay)
            jog_over_a_slow_link(bench, loop, told)
            plant_defects(bench, loop, told)
            freeze_the_driver(bench, told)
            restart(bench, told, "driver", restart_the_driver)
            restart(bench, told, "panel", restart_the_panel)
        with contextlib.closing(JogBench(live, loop, "--tls-cert", cert, "--tls-key", key)) as bench:
            among_strangers(bench, told, BY_TLS)
            told.stops[LINK_BY_TLS], _ = stop_over_a_link(bench, loop, LINKS["300 ms"], STOPS)
        told.verdict = live.verdict()
        yield told


def among_strangers(bench, told, floods):
    for name, (count, kind) in floods.items():
        told.stops[name], is_cut = stop_among(bench, count, kind, STOPS)
        if is_cut:
            told.is_cut.add(name)


def restart(bench, told, name, work):
    """Restart a part under a page; then stop, and jog."""
    _, told.truths[name] = work(bench)
    told.stops["%s restarted" % name] = [stop(bench.page, bench.arm)]
    reasons = []
    assert eventually(lambda: press_moves(bench, reasons)), reasons


def plant_defects(bench, loop, told):
    """Take the measures where they must fail: over a link that cannot carry a stop, of a jog that goes on."""
    with SlowLink(loop, bench.panel.port, STOP_S + 0.2) as link, contextlib.closing(
            seen_over(bench, loop, link)) as page:
        told.late = stop(page, bench.arm)
    bench.renew_page()

    def goes_on():
        """Return whether a jog goes on for longer than the limit; a busy host ends one."""
        bench.begin()
        since = time.monotonic()
        is_ended = eventually(lambda: any(one["state"] == "ended" for one in bench.page.jog_states(bench.page.held)),
                              REST_S + 0.2)
        bench.page.release()
        assert bench.rests()
        told.long = since, time.monotonic()
        return not is_ended
    assert eventually(goes_on)


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
    link = LINKS.get(name.partition(", TLS")[0], {})
    return link.get("delay", 0.0) + (5 * LOST_S if "loss" in link else 0.0)


@pytest.mark.parametrize("name", [*LINKS, *FLOODS, *BY_TLS, LINK_BY_TLS, *RESTARTED])
def test_a_stop_is_on_the_wire_as_soon_as_its_link_carries_it(told, name):
    for since in told.stops[name]:
        assert min(told.verdict.times_of(STOP, since)) - since <= way_of(name) + STOP_S


def test_the_measures_of_stop_and_rest_can_fail(told):
    assert min(told.verdict.times_of(STOP, told.late)) - told.late > STOP_S
    assert last_frame_of_motion(told.verdict, *told.long) - told.long[0] > REST_S


@pytest.mark.parametrize("name", [*FLOODS, *BY_TLS])
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


@pytest.mark.parametrize("name", ["driver", "panel"])
def test_a_page_knows_in_time_that_its_driver_or_its_panel_has_died(told, name):
    assert told.truths[name] < TRUTH_S


def test_a_page_stops_the_arm_without_a_master_and_moves_it_after_its_restart(ros_master, tmp_path, loop):
    with Graph(tmp_path, is_mortal=True) as graph, changed_environment(graph.environment), \
            LiveDriver(tmp_path, guard=False) as live, contextlib.closing(JogBench(live, loop)) as bench:
        reasons = []
        assert eventually(lambda: press_moves(bench, reasons)), reasons
        stopped_at = restart_the_master(bench, graph)
        reasons.clear()
        assert eventually(lambda: press_moves(bench, reasons)), reasons
        bench.close()
        assert live.verdict().times_of(STOP, stopped_at)
