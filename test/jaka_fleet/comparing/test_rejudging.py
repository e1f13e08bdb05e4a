"""Kept outcomes judged again: the same verdicts as of a fresh comparison with the new tolerances."""
import dataclasses

import numpy as np
import pytest
from seeded_defects import DEFECTS, defective
from synthetic_session import Conditions, simulate, write_log

from jaka_bag.compare.checks.motion_checks import RESOLUTION as COARSE
from jaka_bag.compare.comparison import compare_logs, compare_runs
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import Tolerances, parse_tolerances
from jaka_fleet.comparing.outcome import DIFFERENT, SAME, UNKNOWN, outcome_of
from jaka_fleet.comparing.rejudging import needs_logs, rejudged
from jaka_fleet.comparing.task import RESOLUTION

FIELDS = "fields: {/jaka_driver/tool_position: {twist.linear.y: {absolute: %s}}}"
KEPT_WITH = FIELDS % "0.0002"
TOLERANCES = [
    "", "joints: {position_rad: 0.0005}", "joints: {position_rad: 0.06}", "joints: {per_joint: {joint_4: 0.06}}",
    "joints: {outside_percent: 1}", "joints: {outside_percent: 0.001, position_rad: 0.004}",
    "joints: {position_rad: 0.02, outside_percent: 0.5}",
    "tcp: {position_mm: 0.2, orientation_rad: 0.001}", "tcp: {position_mm: 2}", "tcp: {outside_percent: 100}",
    "tcp: {orientation_rad: 3.2}", "timing: {pace_percent: 5}", "timing: {pace_percent: 0, pace_floor_ms: 0}",
    "timing: {pace_percent: 2.5, pace_floor_ms: 10}", "timing: {event_s: 0.001}", "timing: {event_s: 5}",
    "streams: {rate_percent: 0.01, jitter_ms: 0.01}", "streams: {rate_percent: 80, jitter_ms: 500, lost_percent: 60}",
    "streams: {latency_ms: 1000, repeated_percent: 90}", "streams: {latency_ms: 0, repeated_percent: 0}",
    "streams: {gap_length_s: 0.05}", "streams: {gap_length_s: 9}", "streams: {count_percent: 50}",
    "states: {timing_s: 0.45}", "states: {timing_s: 2}", "calls: {timing_s: 0.001}", "calls: {timing_s: 4}",
    "calls: {duration_s: 0.01, duration_percent: 0}", "calls: {duration_s: 0.2, duration_percent: 30}",
    "calls: {duration_s: 3}", "calls: {value_absolute: 1.5}", "optional_topics: ['.*/robot_states']",
    FIELDS % "0.00001", FIELDS % "0.01",
]


def bump(session):
    session.joints[500:560, 3] += 0.01 * np.hanning(60)


def gaps(session):
    for name, begin in (("robot_states", 2.0), ("tool_position", 4.0)):
        session.keep[name][(session.time > begin) & (session.time < begin + 0.9)] = False


def other_values(session):
    session.calls[1] = session.calls[1]._replace(response="ret: 1\nvalue: 2.5\nmessage: 'completed'")


def slow_reply(session):
    session.calls[1] = session.calls[1]._replace(duration=session.calls[1].duration + 1.0)


def without_states(session):
    session.keep["robot_states"][:] = False


def several(session):
    bump(session)
    slow_reply(session)
    for name in ("1 mm offset", "state topic at 60 Hz", "stale stamps"):
        DEFECTS[name].seed(session)


CHANGES = {"bump": bump, "gaps and other values": lambda session: (gaps(session), other_values(session)),
           "several": several, "without states": without_states}
SEEDED = ("2 % slower", "a missed state", "jog not stopped at 3 s")


@pytest.fixture(scope="module")
def logs(program, tmp_path_factory):
    """Write the golden log, and candidates with all kinds of differences."""
    folder = tmp_path_factory.mktemp("candidates")
    golden = simulate(program)
    other_values(golden)
    golden.calls[1] = golden.calls[1]._replace(response="ret: 1\nvalue: 1.5\nmessage: 'completed'")
    found = {"golden": write_log(folder / "golden.mcap", golden)}
    good = Conditions(seed=41, start_s=1.6)
    sessions = {name: simulate(program, good) for name in ("good", *CHANGES)}
    for name, change in CHANGES.items():
        change(sessions[name])
    sessions.update({name: defective(program, DEFECTS[name]) for name in SEEDED})
    for number, (name, session) in enumerate(sessions.items()):
        if "other values" not in name:
            session.calls[1] = session.calls[1]._replace(response=golden.calls[1].response)
        found[name] = write_log(folder / ("%d.mcap" % number), session)
    return found


@pytest.fixture(scope="module")
def loaded(logs):
    return {name: load_run(path, parse_tolerances(KEPT_WITH)) for name, path in logs.items()}


def kept(runs, name, tolerances, resolution=RESOLUTION):
    comparison = compare_runs(runs["golden"], runs[name], tolerances, 1.0, resolution)
    return outcome_of(comparison, "hash", name, "", 0, 0)


def with_fields(text):
    """Return tolerances that compare the same fields as the kept outcomes."""
    limits = parse_tolerances(text)
    return limits if limits.fields else dataclasses.replace(limits, fields=parse_tolerances(KEPT_WITH).fields)


@pytest.mark.parametrize("name", ["good", "2 % slower", "gaps and other values", "several", "without states"])
def test_the_verdicts_are_those_of_a_fresh_comparison(name, loaded):
    before = kept(loaded, name, parse_tolerances(KEPT_WITH))
    told = 0
    for text in TOLERANCES:
        limits = with_fields(text)
        assert not needs_logs(parse_tolerances(KEPT_WITH), limits)
        again, fresh = rejudged(before, limits), kept(loaded, name, limits, COARSE)
        for one, other in zip(again.checks, fresh.checks):
            if one.outcome == UNKNOWN:
                continue
            told += 1
            assert one.outcome == other.outcome, (text, one, other)
            if one.outcome in (SAME, DIFFERENT):
                assert (one.margin > 1.0) == (one.outcome == DIFFERENT), (text, one)
        if again.verdict != UNKNOWN:
            assert again.verdict == fresh.verdict, text
    assert told > 0.9 * len(TOLERANCES) * len(before.checks)


def test_under_the_same_tolerances_nothing_changes(loaded):
    for name in ("good", "bump", "2 % slower"):
        before = kept(loaded, name, parse_tolerances(KEPT_WITH))
        again = rejudged(before, parse_tolerances(KEPT_WITH))
        assert [(c.outcome, c.margin, c.measured, c.limit) for c in again.checks] == [
            (c.outcome, c.margin, c.measured, c.limit) for c in before.checks]
        assert again.verdict == before.verdict and again.worst == before.worst


def test_what_was_not_measured_finely_enough_is_not_guessed(loaded):
    good = kept(loaded, "good", parse_tolerances(KEPT_WITH), COARSE)
    again = rejudged(good, with_fields("tcp: {position_mm: 0.0001}"))
    assert again.verdict == UNKNOWN and "read again" in again.reason
    bumped = kept(loaded, "bump", parse_tolerances(KEPT_WITH))
    shares = rejudged(bumped, with_fields("joints: {position_rad: 0.0035, outside_percent: 0.75}"))
    assert {check.outcome for check in shares.checks if check.field == "joint_4"} <= {UNKNOWN, SAME, DIFFERENT}


def test_tolerances_that_decide_about_the_course_are_not_guessed(loaded):
    missed = kept(loaded, "a missed state", parse_tolerances(KEPT_WITH))
    again = rejudged(missed, with_fields("states: {brief_s: 3}"))
    assert [check.outcome for check in again.checks if check.aspect == "states"].count(UNKNOWN)
    assert "states.brief_s" in " ".join(check.detail for check in again.checks)


@pytest.mark.parametrize("text, name", [
    ("streams: {gap_s: 0.6}", "streams.gap_s"), ("timing: {jitter_ms: 90}", "timing.jitter_ms"),
    ("timing: {cut_ms: 90}", "timing.cut_ms"), ("calls: {request: ignore}", "calls.request"),
    ("calls: {response: exact}", "calls.response"), ("nan: fail", "nan"), ("ignore_topics: []", "ignore_topics"),
    (FIELDS % "0.1, relative: 0.1", "fields"), (FIELDS % "1", "fields")])
def test_tolerances_that_need_the_logs_are_named(text, name):
    assert needs_logs(Tolerances(), parse_tolerances(text)) == [name]


def test_a_finer_resolution_changes_no_outcome(logs, loaded):
    for name in ("good", "bump", "several"):
        fine = kept(loaded, name, parse_tolerances(KEPT_WITH))
        coarse = compare_logs(logs["golden"], logs[name], parse_tolerances(KEPT_WITH))
        assert [check.outcome for check in fine.checks] == [check.outcome.value for check in coarse.checks]
