"""The dead-man from a page to the arm: every way of release stops it, by the controller's log; nothing resumes."""
import contextlib
from types import SimpleNamespace

import pytest
from driver_bench import LiveDriver
from jog_pad import last_frame_of_motion
from panel_jog import WAYS, JogBench, let_go
from panel_page import Loop
from waiting import eventually

LONGEST_S = 1.0
"""Time limit, s: 0.3 s on a quiet host (test/benchmark/bench_panel.py), and what a busy one may take away."""
ALONG_A_LINE = ("silence", "reset", "second page")
BY_A_BROWSER = ("release", "tab closed", "SIGSTOP", "SIGKILL")
"""The ways that a real browser's page takes in test/ros/panel_page; test/benchmark/bench_panel.py takes them all."""
SUITE = [way for way in WAYS if way not in BY_A_BROWSER]


@pytest.fixture(scope="module")
def told(ros_node, tmp_path_factory):
    told = SimpleNamespace(ways={}, steps={})
    with LiveDriver(tmp_path_factory.mktemp("panel"), name="jogged", guard=False) as live, contextlib.closing(
            Loop()) as loop, contextlib.closing(JogBench(live, loop, "--max-jog-speed", "80")) as bench:
        live.arm.wait_until_ready()
        live.arm.go_home()
        for way in SUITE:
            told.ways[way] = let_go(bench, way, "base" if way in ALONG_A_LINE else "joint")
        stepped(bench, told)
        too_fast(bench, told)
        bench.close()
        told.verdict = live.verdict()
        yield told


def stepped(bench, told):
    """Make a step of 1 deg of a joint, and one of 5 mm along z, with the button held until they are done."""
    bench.go_home()
    for name, space, values, step in (("joint", "joint", [0, 0, 0, 0, 0, -1.0], 0.0174533),
                                      ("base", "base", [0, 0, 1.0, 0, 0, 0], 0.005)):
        def place(name=name):
            state = bench.live.simulator.state()
            return state["joint_position"][5] if name == "joint" else state["tcp_pose"][2]

        def done(name=name, space=space, values=values, step=step, place=place):
            """Return whether one press did the whole step: on a busy host a press can end before."""
            before = place()
            hold = bench.page.press(bench.arm, values, space, step)
            ended = bench.page.wait("jog", lambda m: m["hold"] == hold and m["state"] == "ended")
            bench.page.let_go_silently()
            assert bench.rests()
            told.steps[name] = place() - before
            return ended["why"] == "step done"
        assert eventually(done)


def too_fast(bench, told):
    told.fraction = bench.page.command("jog_speed", None, fraction=0.9)
    other = bench.new_page(control=False)
    told.without_control = other.command("jog_speed", None, fraction=0.2)
    other.close()
    bench.page.send(t="release_control")
    assert bench.page.take_control()
    told.anew = bench.page.wait("jog_speed", lambda m: m["fraction"] == 0.1)


@pytest.mark.parametrize("way", SUITE)
def test_every_way_of_letting_go_of_a_page_stops_the_arm(told, way):
    since, until = told.ways[way]
    assert last_frame_of_motion(told.verdict, since, until) - since <= LONGEST_S
    assert told.verdict.rest_after(since, until) - since <= LONGEST_S


def test_a_step_goes_so_far(told):
    assert told.steps["joint"] == pytest.approx(-1.0, abs=0.15), "deg"
    assert told.steps["base"] == pytest.approx(5.0, abs=0.5), "mm"


def test_the_speed_is_limited_to_a_setting_and_is_10_percent_for_whoever_takes_control(told):
    assert not told.fraction["ok"] and "0.8" in told.fraction["message"]
    assert not told.without_control["ok"] and "control" in told.without_control["message"]
    assert told.anew["fraction"] == 0.1
