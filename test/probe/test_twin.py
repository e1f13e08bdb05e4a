"""The twin of an arm: acceleration and jerk are found from frames, and the stated error holds for arms of any kind."""
import math
import random

import pytest
from probe_bench import wrong
from twin_check import missed
from virtual_probe import probed as virtually_probed

from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.facts import Fact, ProbeStage
from jaka_ros_driver.probe.fit import SCurve
from jaka_ros_driver.probe.move import ASKED
from jaka_ros_driver.probe.twin import BACK, MOVE, OUT, STOP, place_at, progress, twin_facts, twin_motion
from jaka_ros_driver.simulation.arm.profiles import RUCKIG
from jaka_ros_driver.simulation.dialect.table import Dialect

pytestmark = pytest.mark.skipif(RUCKIG is None, reason="without ruckig the simulated arm has no jerk")
WAYS = {OUT: 2.5, BACK: 2.5, MOVE: 2.0}
PROBED = {"version": Fact("1.7.2_28", ""), "model": Fact(["zu7"], ""), "stop_ends_move": Fact(True, "")}


def dialect(share=1.0, jerk_time=0.05, start_delay=0.0):
    return Dialect.default("1.7.2").replaced(
        {"move_acceleration": share, "move_jerk_time": jerk_time, "start_delay": start_delay})


def frames_of(motion, chance, period, late, before=0.0):
    """Return what a feed shows of a motion: a frame every few cycles, some held up, none older than the one before."""
    end, at, newest, frames = motion[-1][0] + 0.4, chance.uniform(0.0, period) - before, 0.0, []
    while at < end:
        came = at + chance.expovariate(1.0 / late) + (chance.random() < 0.03) * chance.uniform(0.0, 20.0 * late)
        newest = max(newest, came) if frames else came
        frames.append((round(newest, 4), round(place_at(motion, at), 4)))
        at += period
    return frames


def probed(motions, chance, period=0.032, late=0.001):
    """Return the facts that a probe would find on an arm with these motions."""
    curves = {name: frames_of(motion, chance, period, late) for name, motion in motions.items()}
    return twin_facts(PROBED, curves, ASKED)


def true_motions(arm, delay=0.0):
    return {name: twin_motion(arm if name != MOVE else arm.replaced({"start_delay": 0.0}), "zu7", None, way,
                              ASKED[name], None) for name, way in WAYS.items()}


@pytest.mark.parametrize("share, jerk_time", [(0.2, 0.2), (0.7, 0.0), (1.0, 0.05), (4.0, 0.2), (1.3, 0.11)])
@pytest.mark.parametrize("name", WAYS)
def test_the_curve_that_is_fitted_is_the_motion_of_the_simulated_arm(share, jerk_time, name):
    made, asked = twin_motion(dialect(share, jerk_time), "zu7", None, WAYS[name], ASKED[name], None), ASKED[name]
    curve = SCurve.of(WAYS[name], asked.speed, share * asked.acceleration, jerk_time)
    assert max(abs(curve.at(at) - place) for at, place in made) < 0.004
    assert made[-1][1] == pytest.approx(WAYS[name]) and curve.at(curve.duration) == pytest.approx(WAYS[name])


@pytest.mark.parametrize("seed", range(12))
def test_acceleration_and_jerk_of_a_drawn_arm_are_right_or_open_and_the_stated_error_holds(seed):
    chance = random.Random(seed)
    arm = dialect(round(math.exp(chance.uniform(math.log(0.25), math.log(3.5))), 3),
                  round(chance.uniform(0.0, 0.19), 3), round(chance.uniform(0.0, 0.5), 3))
    motions = true_motions(arm)
    found = probed(motions, chance, chance.choice((0.008, 0.02, 0.03, 0.05, 0.1)), chance.choice((0.0003, 0.002)))
    share, jerk_time = found["move_acceleration"].value, found["move_jerk_time"].value
    assert share is None or share == pytest.approx(arm.move_acceleration, rel=0.15)
    assert jerk_time is None or jerk_time == pytest.approx(arm.move_jerk_time, abs=0.03)
    assert found["twin_angle"].value is not None or "otherwise" in found["twin_angle"].how
    assert found["twin_angle"].value is None or not missed(motions[BACK], found)


def test_with_a_quick_feed_that_comes_in_time_everything_is_settled():
    chance = random.Random(0)
    for share, jerk_time in ((0.5, 0.0), (1.0, 0.16), (0.3, 0.1)):
        found = probed(true_motions(dialect(share, jerk_time, 0.2)), chance, 0.008, 0.0001)
        assert found["move_acceleration"].value == pytest.approx(share, rel=0.03), found
        assert found["move_jerk_time"].value == pytest.approx(jerk_time, abs=0.02), found
        assert found["start_delay"].value == pytest.approx(0.2, abs=0.02)
        assert found["twin_angle"].value < 0.03 and found["twin_time"].value < 0.02


@pytest.mark.parametrize("share, jerk_time, others", [
    (1.0, 0.05, {}), (0.2, 0.2, {"start_delay": 5.0, "feed_period": 0.055}), (4.0, 0.0, {"feed_period": 0.05})])
def test_all_motions_of_the_stage_settle_acceleration_jerk_and_delay_also_at_the_ends(share, jerk_time, others):
    arm = dialect(share, jerk_time).replaced(others)
    _, found = virtually_probed(arm, "1.7.2", ProbeStage.MOVE, fits=True)
    assert {found[name].value is None for name in ("move_acceleration", "move_jerk_time", "start_delay")} == {False}
    assert not wrong(found, arm)
    assert wrong({**found, "move_jerk_time": Fact(0.1, "")}, arm) and found["twin_angle"].value is not None


def lagging(motion, seconds):
    """Return the same motion behind a first-order lag, as of drives that are not ideal."""
    place, points = motion[0][1], []
    for at, goal in [*motion, *((motion[-1][0] + 0.008 * n, motion[-1][1]) for n in range(1, 400))]:
        place += (goal - place) * 0.008 / seconds
        points.append((at, place))
    return points


def lopsided(way, asked, slower):
    """Return a motion that slows down at a share of the acceleration with which it began."""
    whole = SCurve.of(way, asked.speed, asked.acceleration, 0.0)
    half = [(0.008 * n, whole.at(0.008 * n)) for n in range(int(whole.duration / 0.008) + 2)]
    middle = 0.5 * whole.duration
    return [(at if at < middle else middle + (at - middle) / slower, place) for at, place in half]


@pytest.mark.parametrize("kind", ["lag 0.05", "lag 0.2", "lopsided 0.6", "lopsided 0.25", "slow", "steps"])
def test_of_an_arm_that_moves_otherwise_nothing_wrong_is_said(kind):
    plain = true_motions(dialect())
    word, _, number = kind.partition(" ")
    motions = {
        "lag": lambda: {name: lagging(motion, float(number)) for name, motion in plain.items()},
        "lopsided": lambda: {name: lopsided(way, ASKED[name], float(number)) for name, way in WAYS.items()},
        "slow": lambda: {name: [(2.5 * at, place) for at, place in motion] for name, motion in plain.items()},
        "steps": lambda: {name: [(0.0, 0.0), (0.5, 0.0), (0.51, 0.8 * way), (1.5, 0.8 * way), (1.51, way), (1.6, way)]
                          for name, way in WAYS.items()}}[word]()
    found = probed(motions, random.Random(3))
    if found["twin_angle"].value is None:
        assert "otherwise" in found["twin_angle"].how and found["twin_time"].value is None
    else:
        assert not missed(motions[BACK], found)
    if word in ("slow", "steps"):
        assert found["move_acceleration"].value is None and found["twin_angle"].value is None


def test_what_was_not_seen_is_not_settled():
    chance, motions = random.Random(1), true_motions(dialect())
    whole = {name: frames_of(motion, chance, 0.03, 0.001) for name, motion in motions.items()}
    for curves in ({}, {OUT: whole[OUT]}, {**whole, OUT: whole[OUT][:2]}, {**whole, BACK: []},
                   {name: frames[::40] for name, frames in whole.items()}, {**whole, OUT: [(0.0, 1.0)] * 50}):
        found = twin_facts(PROBED, curves, ASKED)
        assert found["twin_angle"].value is None and found["twin_angle"].how, sorted(curves)
    assert twin_facts({}, whole, ASKED)["twin_angle"].value is None, "no firmware, no twin"


@pytest.mark.parametrize("late, told", [({}, 0.2), ({BACK: 0.6}, None), ({OUT: 0.6}, None), ({OUT: 0.05}, 0.2)])
def test_a_delay_that_a_busy_host_made_is_none(late, told):
    chance, motions = random.Random(4), true_motions(dialect(start_delay=0.2))
    curves = {name: [(at + late.get(name, 0.0), place) for at, place in frames_of(motion, chance, 0.03, 0.0005)]
              for name, motion in motions.items()}
    facts = twin_facts({**PROBED, "start_delay": Fact(0.21, "a frame first showed it")}, curves, ASKED)
    found, apart = facts["start_delay"], facts["twin_time"].value
    assert apart is None if told is None else apart > max(late.values(), default=0.0), "the twin may be off by as much"
    assert found.value == (told if told is None else pytest.approx(told, abs=0.02)), found
    assert told is not None or "busy" in found.how


def test_the_stop_counts_too():
    chance, motions = random.Random(2), true_motions(dialect())
    curves = {name: frames_of(motion, chance, 0.016, 0.0005) for name, motion in motions.items()}
    stop = [(-0.2, 0.0)] + [(0.008 * n, 0.6) for n in range(60)]
    stops = {"at once": stop, "late": [(at, min(0.6 + 3.0 * max(0.0, at), 2.1)) for at, _ in stop]}
    found = {name: twin_facts(PROBED, {**curves, STOP: [(-0.01, 0.599), *frames]}, ASKED)["twin_angle"]
             for name, frames in stops.items()}
    assert found["late"].value > found["at once"].value + 0.3, "an arm that stops 0.5 s late is not its twin"
    assert "and of a stop" in found["late"].how


def test_the_report_says_how_near_the_twin_is():
    found = probed(true_motions(dialect(0.5)), random.Random(5))
    lines = " ".join(" ".join(report.text({**PROBED, **found})).split())
    assert "This twin is within %.3f deg and %.0f ms of your arm, in 95 of 100 frames" % (
        found["twin_angle"].value, 1000.0 * found["twin_time"].value) in lines
    assert "This twin" not in " ".join(report.text(PROBED))
    assert progress([(0.0, 5.0), (1.0, 3.0)]) == [(0.0, 0.0), (1.0, 2.0)]
