"""The moment in the candidate that corresponds to a moment of the golden log."""
import numpy as np
import pytest
from synthetic_session import Conditions, Step, moves, simulate, write_log

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.matching.alignment import Alignment, Episode, align, arms_of, event_lag, motions_by_calls
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.verdict import Aspect


def runs(tmp_path, golden, candidate):
    return [load_run(write_log(tmp_path / ("%d.mcap" % i), session)) for i, session in enumerate((golden, candidate))]


def quiet(**changes):
    return Conditions(call_late_s=0.0, stamp_late_s=0.0, noise_rad=0.0)._replace(**changes)


@pytest.mark.parametrize("late", [0.0, 0.037, -0.6, 4.3])
def test_the_common_lag_is_found_to_the_millisecond(tmp_path, late):
    golden, candidate = runs(tmp_path, simulate(moves(4), quiet(start_s=2.0)),
                             simulate(moves(4), quiet(start_s=2.0 + late)))
    # the logs' clocks begin with their first messages
    shift = (golden.start_ns - candidate.start_ns) * 1e-9
    found = align(golden, candidate, arms_of(golden, candidate))
    assert found.lag == pytest.approx(late + shift, abs=0.002)
    assert found.method == "events, then all joints"


def test_without_events_the_speeds_of_the_joints_tell(tmp_path):
    sessions = [simulate(moves(4), quiet(start_s=start)) for start in (1.0, 3.5)]
    for session in sessions:
        session.calls = []
        session.states[:, 0] = 0
    golden, candidate = runs(tmp_path, *sessions)
    found = align(golden, candidate, arms_of(golden, candidate))
    assert found.lag == pytest.approx(2.5, abs=0.005)
    assert found.method == "speed of the joints, then all joints"


def test_pace_and_lag_of_each_motion(tmp_path):
    golden, candidate = runs(tmp_path, simulate(moves(4), quiet()), simulate(moves(4), quiet(pace=1.03)))
    found = align(golden, candidate, arms_of(golden, candidate))
    episodes = found.episodes[""]
    assert len(episodes) == 4
    assert [episode.pace for episode in episodes] == pytest.approx([1.03] * 4, abs=0.003)


def test_a_call_that_repeats_votes_for_the_right_lag(tmp_path):
    program = [Step(0.5, (0.2,) * 6), Step(0.5, (0.0,) * 6)] * 5
    golden, candidate = runs(tmp_path, simulate(program, quiet()), simulate(program, quiet(start_s=3.0)))
    assert event_lag(golden, candidate) == pytest.approx(2.0, abs=0.05)


def test_logs_without_anything_in_common_begin_together(tmp_path):
    sessions = [simulate([Step(1.0)], quiet()) for _ in range(2)]
    golden, candidate = runs(tmp_path, *sessions)
    assert align(golden, candidate, arms_of(golden, candidate)) == Alignment(0.0, "first messages")
    assert compare_logs(golden.path, candidate.path).same


def test_golden_time_never_steps_back_and_runs_at_the_golden_pace_in_a_motion():
    episodes = (Episode("", 1.0, 3.0, 0.5, None, 2.0, 0.0, True), Episode("", 3.4, 5.0, -0.2, None, 1.6, 0.0, True))
    time = np.linspace(0.0, 8.0, 1000)
    golden = Alignment(0.3, "", {"": episodes}).golden_time("", time)
    assert (np.diff(golden) >= 0).all()
    assert np.interp([0.5, 1.5, 2.0, 7.0], time, golden) == pytest.approx([0.0, 1.0, 1.5, 7.2], abs=1e-6)


def test_motions_that_are_added_later_count_in_golden_times():
    first, second = Episode("", 1.0, 3.0, 0.5, None, 2.0, 0.0, True), Episode("", 3.4, 5.0, -0.2, None, 1.6, 0.0, True)
    time = np.linspace(0.0, 8.0, 100)
    grown = Alignment(0.3, "", {"": (first,)})
    before = grown.golden_time("", time)
    grown.episodes[""] += (second,)
    whole = Alignment(0.3, "", {"": (first, second)})
    assert (grown.golden_time("", time) == whole.golden_time("", time)).all()
    assert (before != whole.golden_time("", time)).any()
    assert grown.motion_numbers("", np.array([0.5, 1.0, 3.2, 3.4])).tolist() == [0, 1, 1, 2]


def test_two_arms_that_drift_apart_are_found(tmp_path):
    left, right = (simulate(moves(3, seed=seed), quiet()) for seed in (1, 2))
    late_left = simulate(moves(3, seed=1), quiet(start_s=1.0))
    late_right = simulate(moves(3, seed=2), quiet(start_s=1.9))
    for session in (left, late_left):
        session.node = "/left/jaka_driver"
    for session in (right, late_right):
        session.node = "/right/jaka_driver"
    golden = write_log(tmp_path / "golden.mcap", left, right)
    candidate = write_log(tmp_path / "candidate.mcap", late_left, late_right)
    stages = {check.aspect for check in compare_logs(golden, candidate).differences}
    assert stages & {Aspect.TIMING, Aspect.CALLS, Aspect.STATES}


def test_a_candidate_that_ends_too_early_does_not_cover_the_golden_log(tmp_path):
    whole = simulate(moves(4), quiet())
    short = simulate(moves(4), quiet())
    for keep in short.keep.values():
        keep[short.time > 6.0] = False
    short.calls = [call for call in short.calls if call.start + call.duration < 6.0]
    golden, candidate = write_log(tmp_path / "a.mcap", whole), write_log(tmp_path / "b.mcap", short)
    assert any(check.aspect is Aspect.ALIGNMENT and "ends" in check.detail
               for check in compare_logs(golden, candidate).differences)


def test_only_a_motion_of_ten_minutes_or_more_is_cut_into_equal_parts():
    assert motions_by_calls([(1.0, 600.9), (700.0, 1300.0), (2000.0, 4000.0)], []) == [
        (1.0, 600.9), (700.0, 1000.0), (1000.0, 1300.0), (2000.0, 2500.0), (2500.0, 3000.0), (3000.0, 3500.0),
        (3500.0, 4000.0)]
    assert motions_by_calls([], []) == []
