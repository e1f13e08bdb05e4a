"""The page on a running driver: a first run by clicks only, and every way of release, in the controller's log."""
import json
import math
import re
import sys
import time

import pytest

pytest.importorskip("aiohttp")

from browser import CHROMIUM, Browser
from import_graph import ROOT
from panel_operator import WAYS, Operator, times_to_rest
from ros_graph import Graph
from waiting import eventually

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium-headless-shell")
LONGEST_S = 1.0
"""Time limit, s: 0.3 s on a quiet host (test/benchmark/bench_panel_deadman.py), and what a busy one may take away."""
LEFT_TO_THE_BENCHMARK = ("tab frozen", "page crashed", "loaded again", "browser killed")
"""Ways that only the benchmark takes. A browser takes 8 s to freeze a tab: its JavaScript stands still then, as in
"JavaScript blocked". The others need another page or browser each; for the server they are closed connections, as "tab
closed" is."""
SUITE = [way for way in WAYS if way not in LEFT_TO_THE_BENCHMARK]
FIRST_MINUTES_S = 180.0
LAUNCH = "import sys, roslaunch; sys.argv[0] = 'roslaunch'; roslaunch.main()"
FIRST_JOINT = "parseFloat(document.querySelector('#joints td.number').textContent)"
JOG = '.jog-button[data-axis="0"][data-sign="1"]'
IS_ENABLED = "document.querySelector('[data-state=enabled] dd').textContent === 'yes'"
PUSHED_S = 20.0
HAS_CONTROL = "document.body.dataset.may === 'control'"


@pytest.fixture(scope="module")
def rests(ros_node, tmp_path_factory):
    with Operator(tmp_path_factory.mktemp("page"), guard=False) as operator:
        for way in SUITE:
            operator.let_go(way)
        return times_to_rest(operator.verdict(), operator.moments)


@pytest.mark.parametrize("way", SUITE)
def test_every_way_of_letting_go_of_a_button_stops_the_arm(rests, way):
    assert max(rests[way]) < LONGEST_S, "below zero: a busy host had ended the jog before"


def test_a_point_is_stored_where_an_arm_that_was_guided_by_hand_rests_and_not_on_the_way(ros_node, tmp_path):
    cell = tmp_path / "cell" / "cell.json"
    with Operator(tmp_path, panel=("--cell-data", str(cell)), guard=False) as operator:
        simulator = operator.live.simulator

        def joints():
            return [math.radians(value) for value in simulator.state()["joint_position"]]
        page, before = operator.open(), joints()
        switch_guiding(page, "on")
        page.until_text("#line-said", "Moves by hand only")
        assert simulator.operate("push", joint=1, velocity=3.0, duration=PUSHED_S)["pushed"]
        page.until("Math.abs(%s - %r) > 1" % (FIRST_JOINT, math.degrees(before[0])))
        page.click("#teach-frame [data-point=origin]")
        page.until_text("#toasts", "a point is taken where it rests")
        page.click("#tab-move")
        page.click("[data-t='points.save']")
        page.until_text("#toasts", "wait until it rests")
        assert simulator.is_moving(), "a busy host: the push is over"
        assert eventually(lambda: not simulator.is_moving(), 2 * PUSHED_S)
        assert eventually(lambda: is_stored(page)), "a busy host shows the rest late"
        (stored,) = json.loads(cell.read_text())["data"]["points"][operator.live.arm.name].values()
        assert stored["q"] == pytest.approx(joints(), abs=1e-3) and stored["q"][0] > before[0] + 0.1
        page.click("#tab-teach")
        page.click("#teach-frame [data-point=origin]")
        page.until_text("#teach-frame .points", " mm")
        taken = re.match(r"(\S+) / (\S+) / (\S+) mm", page.text("#teach-frame .points .second"))
        assert [float(value) for value in taken.groups()] == pytest.approx(simulator.state()["tcp_pose"][:3], abs=0.3)
        switch_guiding(page, "off")


def switch_guiding(page, wanted):
    """Press the button of the hand guiding until it is on, or off; a busy host shows it late, or refuses the press."""
    page.click("#tab-teach")

    def is_wanted():
        page.click("#panel-teach .card .needs-control")
        return eventually(lambda: page.text("[data-state=guiding] dd") == wanted, 6.0)
    page.until("document.querySelector('[data-state=guiding] dd').textContent !== 'unknown'")
    assert eventually(is_wanted), page.text("#toasts")


def is_stored(page):
    """Press the button that stores a point; return whether one is stored."""
    page.evaluate("document.querySelector('#toasts').replaceChildren()")
    page.click("[data-t='points.save']")
    there = "document.querySelector('#panel-move .points').textContent.includes('P1')"
    page.until(there + " || document.querySelector('#toasts').textContent !== ''")
    return page.evaluate(there)


@pytest.fixture
def demo(tmp_path, free_ports):
    """Start the README's first command, on ports of its own; return the address that it prints, and since when."""
    command, status, simulator = free_ports(3)
    with Graph(tmp_path) as graph:
        since = time.monotonic()
        process = graph.start(sys.executable, "-c", LAUNCH, str(ROOT / "launch" / "demo.launch"), "panel_port:=0",
                              "command_port:=%d" % command, "status_port:=%d" % status,
                              "sim_panel_port:=%d" % simulator)
        try:
            yield re.search(r"open (\S+)", process.wait_for_line("jaka_panel: open ")).group(1), since
        finally:
            process.stop()


def test_from_the_first_command_to_an_arm_that_moved_by_clicks_only(demo):
    address, since = demo
    done = {}

    def note(what):
        done[what] = time.monotonic() - since
    note("the link is printed")
    with Browser() as browser:
        page = browser.open(address)
        page.until(IS_ENABLED, "the arm is enabled")
        note("the page shows the arm")
        take_control(page)
        page.until_text("#simulated", "SIMULATED")
        note("control is taken")
        jog(page)
        note("the arm was jogged")
        come_back(page)
        note("it came back to a typed target")
        store_a_point_take_a_pose_and_run_a_list(page)
        note("a point was stored, a pose taken, a list run")
        press_the_emergency_stop_and_recover(page)
        note("it was stopped in an emergency, and recovered")
        assert not page.complaints, page.complaints
    print("\n".join("%6.1f s: %s" % (at, what) for what, at in done.items()))
    assert max(done.values()) < FIRST_MINUTES_S


def jog(page):
    """Press until the arm has moved; again where a busy host ends the jog."""
    moved = "%s > %r" % (FIRST_JOINT, page.evaluate(FIRST_JOINT) + 0.5)
    for _ in range(20):
        x, y = page.press(JOG)
        page.until("%s || !document.querySelector(%r).classList.contains('held')" % (moved, JOG))
        page.mouse("Released", x, y)
        if page.evaluate(moved):
            break
    assert page.evaluate(moved), "it is not jogged: %s" % page.text("#panel-jog .said")
    page.until("document.querySelector('[data-state=owner] dd').textContent === 'nobody'")


def come_back(page):
    before = page.evaluate(FIRST_JOINT) - 0.5
    page.click("#tab-move")
    page.click("#panel-move > .buttons > button")
    page.type("#panel-move input", "%.2f" % before)
    page.until("document.querySelector('#panel-move .go').dataset.ready === 'true'")
    page.click("#panel-move .go")
    page.until_text("#panel-move .said", "Arrived")
    page.until("Math.abs(%s - %r) < 0.1" % (FIRST_JOINT, before))


def store_a_point_take_a_pose_and_run_a_list(page):
    page.click("#point-name")
    page.call("Input.insertText", text="here")
    page.until_text("#line-said", "Can move")
    page.click("#panel-move .card .buttons button")
    page.until_text("#panel-move .points", "here")
    page.click("#tab-teach")
    page.click("#teach-frame [data-point=origin]")
    page.until_text("#teach-frame .points", " mm")
    page.click("#tab-jog")
    jog(page)
    page.click("#tab-run")
    page.click("#list-run .buttons > button[data-t='list.add']")
    page.click("#list-run .needs-control")
    page.until_text("#panel-run .said", "Planned")
    page.click("#panel-run .go")
    page.until_text("#panel-run .said", "Done")


def take_control(page):
    page.click("#control-button")
    page.until(HAS_CONTROL)


def recover(page):
    """Recover; take control again where a busy host has ended it, and fail where the call does."""
    for _ in range(5):
        page.evaluate("document.querySelector('#toasts').replaceChildren()")
        page.click("#arm-bar button:nth-child(3)")
        page.until("%s || !(%s) || document.querySelector('.toast.bad')" % (IS_ENABLED, HAS_CONTROL), "it is recovered")
        if page.evaluate(IS_ENABLED):
            return
        assert not page.evaluate(HAS_CONTROL), "it is not recovered: %s" % page.text("#toasts")
        take_control(page)
    raise AssertionError("the control ends again and again")


def press_the_emergency_stop_and_recover(page):
    page.click("#tab-simulator")
    page.click("#panel-simulator .danger")
    page.until_text("[data-state=emergency]", "PRESSED")
    page.click("#panel-simulator .danger + button")
    page.until_text("[data-state=emergency]", "released")
    recover(page)
    page.click("#tab-calls")
    page.until_text("#panel-calls", "recover")
