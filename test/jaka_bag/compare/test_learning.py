"""Tolerances learned from good runs: tight where the cell repeats itself, wide where it does not."""
import dataclasses
import re

import numpy as np
import pytest
from synthetic_session import Conditions, moves, simulate, write_log

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.learning import FLOOR, learn
from jaka_bag.compare.report.html import as_html
from jaka_bag.compare.tolerances import ToleranceError, Tolerances, as_yaml, parse_tolerances
from jaka_bag.compare.verdict import limits_at
from jaka_bag.errors import BagError

PROGRAM = moves(4)
JOINTS = "/jaka_driver/joint_position"


def run(path, seed, change=lambda one: None):
    one = simulate(PROGRAM, Conditions(seed=seed))
    change(one)
    return write_log(path, one)


def off(amount, since, until):
    """Return a change that has the first joint elsewhere for some seconds."""
    def change(one):
        one.joints[(one.time >= since) & (one.time < until), 0] += amount
    return change


def wandering(seed):
    """Return a change that has the first joint elsewhere in each run, for three seconds."""
    return off(np.random.default_rng(seed).uniform(-0.02, 0.02), 0.0, 3.0)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Return a golden log, and six good runs in which the first joint wanders during the first three seconds."""
    folder = tmp_path_factory.mktemp("learning")
    return (run(folder / "golden.mcap", 0),
            [run(folder / ("good%d.mcap" % seed), seed, wandering(seed)) for seed in range(1, 7)])


@pytest.fixture(scope="module")
def learned(logs):
    golden, good = logs
    return learn(golden, good, Tolerances()).tolerances


def test_the_good_runs_are_the_same_by_what_they_taught_and_were_not_before(logs, learned):
    golden, good = logs
    assert all(compare_logs(golden, path, learned).same for path in good)
    assert not all(compare_logs(golden, path).same for path in good)


def test_it_is_wide_where_runs_wander_and_tight_where_they_do_not(learned):
    first, second = (learned.envelopes[JOINTS]["joint_%d" % number] for number in (1, 2))
    at = np.array([1.0, 8.0])
    assert limits_at(first, at)[0] > 0.01 and limits_at(first, at)[1] < Tolerances().joints.position_rad
    assert min(limit for _, limit in second) == pytest.approx(FLOOR * Tolerances().joints.position_rad)
    assert learned.timing.event_s < Tolerances().timing.event_s


def test_what_got_wider_is_told(logs):
    golden, good = logs
    assert [(name, before) for name, _, before in learn(golden, good, Tolerances()).wider] == [
        (JOINTS + " joint_1", Tolerances().joints.position_rad)]


def test_a_deviation_within_the_defaults_is_found_where_the_cell_repeats_itself(logs, learned, tmp_path):
    golden, _ = logs
    little = run(tmp_path / "off.mcap", 9, off(0.0015, 6.0, 9.0))
    assert compare_logs(golden, little).same
    found = compare_logs(golden, little, learned)
    assert [(check.topic, check.field) for check in found.differences] == [(JOINTS, "joint_1")]
    assert 6.0 <= found.differences[0].at < 9.0 and found.beginning is found.differences[0]


def test_the_page_draws_what_was_learned_as_a_stripe_that_is_wide_and_narrow(logs, learned, tmp_path):
    golden, _ = logs
    comparison = compare_logs(golden, run(tmp_path / "off.mcap", 9, off(0.0015, 6.0, 9.0)), learned)

    def heights(tolerances, found):
        """Return the different heights of the stripes in the pictures of a page, a set for each picture."""
        pictures = re.findall(r"<svg.*?</svg>", as_html(found, tolerances), re.DOTALL)
        return [set(re.findall(r'<rect class="band" [^>]*height="([\d.]+)"', picture)) for picture in pictures]

    limits = {limit for _, limit in learned.envelopes[JOINTS]["joint_1"]}
    assert max(map(len, heights(learned, comparison))) == len(limits) >= 2
    assert max(map(len, heights(Tolerances(), compare_logs(golden, comparison.candidate.path)))) == 1


def test_a_run_that_does_something_else_is_no_teacher(logs, tmp_path):
    golden, good = logs
    other = write_log(tmp_path / "other.mcap", simulate(PROGRAM[:-1], Conditions(seed=3)))
    with pytest.raises(BagError, match=r"other\.mcap is no good run: "):
        learn(golden, [*good[:2], other], Tolerances())
    with pytest.raises(BagError, match="2 good runs are too few to learn from; give 3 or more"):
        learn(golden, good[:2], Tolerances())


def test_a_run_that_the_others_do_not_cover_is_named(logs, tmp_path):
    golden, good = logs
    alone = run(tmp_path / "alone.mcap", 8, off(0.05, 10.0, 11.0))
    (path, name), = learn(golden, [*good, alone], Tolerances()).left_out[-1:]
    assert path == str(alone) and name == JOINTS + " joint_1"


def test_envelopes_are_written_and_read_back(learned):
    assert parse_tolerances(as_yaml(learned)) == learned
    assert learned.envelopes


@pytest.mark.parametrize("text, message", [
    ("[[0, 0.1], [0, 0.2]]", "time 0 comes after 0; times ascend"), ("[]", "expected pairs"), ("3", "expected pairs"),
    ("[[0]]", "expected pairs"), ("[[0, -1]]", "limit: expected a number, 0 or more"),
    ("[[.nan, 1]]", "time: expected")])
def test_an_envelope_that_is_none_is_refused(text, message):
    with pytest.raises(ToleranceError, match=r"envelopes\./a\.joint_1.*" + message):
        parse_tolerances("envelopes: {/a: {joint_1: %s}}" % text)


def test_an_envelope_holds_before_its_first_time_and_from_each_of_its_times_on():
    found = limits_at(((1.0, 2.0), (3.0, 4.0)), np.array([0.0, 1.0, 2.9, 3.0, 9.0]))
    assert found.tolist() == [2.0, 2.0, 2.0, 4.0, 4.0]


def test_one_step_is_the_same_as_one_limit(logs):
    golden, good = logs
    limit = Tolerances().joints.position_rad
    flat = dataclasses.replace(Tolerances(), envelopes={JOINTS: {"joint_1": ((0.0, limit),)}})
    ours, theirs = (compare_logs(golden, good[0], one).checks for one in (Tolerances(), flat))
    assert [(one.name, one.outcome, one.measured, one.limit) for one in ours] == [
        (one.name, one.outcome, one.measured, one.limit) for one in theirs]
