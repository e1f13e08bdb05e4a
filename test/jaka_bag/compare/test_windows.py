"""Long logs are compared in windows: with the outcome of logs that are kept whole, in memory that does not grow."""
import sys
import threading
import tracemalloc

import numpy as np
import pytest
from synthetic_session import Conditions, simulate, write_log, write_long_log

from jaka_bag.compare.comparison import compare_logs, compare_runs
from jaka_bag.compare.matching import alignment
from jaka_bag.compare.report.html import as_html
from jaka_bag.compare.report.pictures import Pictures
from jaka_bag.compare.report.text import as_data
from jaka_bag.compare.runs import windows
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import Tolerances, parse_tolerances
from jaka_bag.compare.verdict import Aspect
from jaka_bag.operations import columns, quantiles

FIELDS = "fields: {/jaka_driver/tool_position: {twist.linear.y: {absolute: 0.0001}}}"


@pytest.fixture
def small_windows(monkeypatch):
    """Make windows of some seconds, of which almost nothing is kept."""
    monkeypatch.setattr(windows, "_WINDOW_ROWS", 3000)
    monkeypatch.setattr(windows, "_CELL_S", 2.0)
    monkeypatch.setattr(windows, "_KEPT_BYTES", 400000)
    monkeypatch.setattr(columns, "_GROUP_BYTES", 1000)
    monkeypatch.setattr(alignment, "_BATCH_MOTIONS", 3)


def disturb(seed):
    """Return a change of a block: faults of many kinds at random moments."""
    def change(session, begin):
        random = np.random.RandomState(seed + int(begin))
        at = [int(i) for i in random.randint(100, len(session.time) - 400, 8)]
        session.joints[at[0]:at[0] + 3, 2] += 0.02
        session.position[at[1]:at[1] + 200, 1] += 0.0004
        session.joints[at[2]:at[2] + 20, 0] = np.nan
        session.states[at[3]:at[3] + 60, 3] = 1
        session.stamp[at[4]:at[4] + 40] = session.stamp[at[4] + 40]
        for keep in session.keep.values():
            keep[at[5]:at[5] + 80] = False
        session.keep["tool_position"][at[6]:at[6] + 120] = False
        session.stamp[at[7]:at[7] + 10] -= 0.03
    return change


def clock_that_steps_back(session, begin):
    if begin >= 60.0:
        session.stamp = session.stamp - 40.0


def data_of(golden, candidate, tolerances):
    runs = [load_run(path, tolerances) for path in (golden, candidate)]
    comparison = compare_runs(*runs, tolerances)
    as_html(comparison, tolerances)
    return as_data(comparison), comparison


def assert_same(one, other, where=""):
    if isinstance(one, dict):
        assert one.keys() == other.keys(), where
        for key in one:
            assert_same(one[key], other[key], where + "/" + key)
    elif isinstance(one, list):
        assert len(one) == len(other), where
        for number, (a, b) in enumerate(zip(one, other)):
            assert_same(a, b, "%s/%d" % (where, number))
    elif isinstance(one, float):
        assert other == pytest.approx(one, rel=1e-6, abs=1e-9), where
    else:
        assert one == other, where


@pytest.mark.parametrize("change", [disturb(1), disturb(2), clock_that_steps_back])
def test_windows_give_the_outcome_of_the_whole(change, tmp_path, request):
    tolerances = parse_tolerances(FIELDS)
    golden = write_long_log(tmp_path / "golden.mcap", 90.0, block_s=30.0)
    candidate = write_long_log(tmp_path / "candidate.bag", 90.0, Conditions(seed=5, start_s=1.7), change, 30.0)
    whole, kept = data_of(golden, candidate, tolerances)
    assert not whole["same"]
    request.getfixturevalue("small_windows")
    parts, read_again = data_of(golden, candidate, tolerances)
    assert len(read_again.golden.windows) > 5 > len(kept.golden.windows)
    assert_same(whole, parts)
    for key, residual in kept.residuals.items():
        other = read_again.residuals[key]
        for name in ("time", "off", "near_time", "near_off"):
            assert getattr(other, name) == pytest.approx(getattr(residual, name), rel=1e-6, abs=1e-9)


def full_disk(monkeypatch):
    monkeypatch.setattr(windows.tempfile, "TemporaryFile", lambda **_: open("/dev/full", "r+b"))


def no_place_for_files(monkeypatch):
    def refuse(**_):
        raise PermissionError("nowhere")
    monkeypatch.setattr(windows.tempfile, "TemporaryFile", refuse)


@pytest.mark.parametrize("hinder", [full_disk, no_place_for_files])
def test_what_finds_no_place_on_disk_is_decoded_again(hinder, tmp_path, small_windows, monkeypatch):
    golden = write_long_log(tmp_path / "golden.mcap", 60.0, block_s=30.0)
    candidate = write_long_log(tmp_path / "candidate.mcap", 60.0, Conditions(seed=5), disturb(1), 30.0)
    stored, _ = data_of(golden, candidate, Tolerances())
    hinder(monkeypatch)
    decoded_again, _ = data_of(golden, candidate, Tolerances())
    assert not stored["same"]
    assert_same(stored, decoded_again)


def peak_of(golden, candidate):
    tracemalloc.start()
    try:
        comparison = compare_runs(load_run(golden), load_run(candidate))
        return tracemalloc.get_traced_memory()[1], comparison
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_logs(tmp_path, small_windows, monkeypatch):
    monkeypatch.setattr(alignment, "COMMON_MOTIONS", 4)
    monkeypatch.setattr(quantiles, "_EXACT", 2000)
    peaks = []
    for seconds in (60.0, 180.0):
        paths = [write_long_log(tmp_path / ("%s%g.mcap" % (name, seconds)), seconds, conditions, None, 30.0)
                 for name, conditions in (("golden", Conditions()), ("candidate", Conditions(seed=5, start_s=1.4)))]
        peak, comparison = peak_of(*paths)
        assert comparison.same, comparison.differences
        peaks.append(peak)
    assert peaks[1] < 1.3 * peaks[0] + 2e6, peaks


def calls_of(golden, candidate):
    """Return how many functions a comparison calls, those in C included."""
    count = 0

    def note(_frame, event, _function):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        assert compare_logs(golden, candidate).same
    finally:
        sys.setprofile(None)
    return count


def test_work_grows_with_the_length_of_the_logs(tmp_path, small_windows, monkeypatch):
    monkeypatch.setattr(alignment, "COMMON_MOTIONS", 4)
    calls = []
    for seconds in (30.0, 60.0, 120.0):
        golden = write_long_log(tmp_path / ("golden%g.mcap" % seconds), seconds, block_s=30.0)
        candidate = write_long_log(tmp_path / ("candidate%g.mcap" % seconds), seconds, Conditions(seed=5), None, 30.0)
        calls.append(calls_of(golden, candidate))
    assert 1.6 < (calls[2] - calls[1]) / (calls[1] - calls[0]) < 2.2, calls


def test_two_logs_are_read_without_threads(tmp_path, monkeypatch):
    # two that decode small arrays wait for each other most of the time
    path = write_log(tmp_path / "log.mcap", simulate([], Conditions()))

    def refuse(_thread):
        raise AssertionError("a thread is started")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    assert compare_logs(path, path).same


def test_a_spike_of_one_sample_in_a_long_log_is_found_and_drawn(tmp_path, small_windows):
    def spike(session, begin):
        if begin == 60.0:
            session.joints[1234, 4] += 0.3

    golden = write_long_log(tmp_path / "golden.mcap", 90.0, block_s=30.0)
    candidate = write_long_log(tmp_path / "candidate.mcap", 90.0, Conditions(seed=5), spike, 30.0)
    comparison = compare_runs(load_run(golden), load_run(candidate))
    found = [check for check in comparison.differences if check.aspect is Aspect.JOINTS]
    assert [check.field for check in found] == ["joint_5"]
    assert found[0].at == pytest.approx(60.0 + 1234 * 0.008, abs=0.05)
    topic = "/jaka_driver/joint_position"
    drawn = Pictures(comparison, Tolerances())._whole("candidate", comparison.candidate.joints[topic]).lines[4]
    plain = Pictures(comparison, Tolerances())._whole("golden", comparison.golden.joints[topic]).lines[4]
    assert np.abs(np.interp(drawn.x, plain.x, plain.y) - drawn.y).max() > 0.2
    residual = comparison.residuals[Aspect.JOINTS, topic, "joint_5"]
    assert residual.off.max() == pytest.approx(found[0].measured)


def test_the_file_is_not_needed_once_a_log_is_kept_whole(tmp_path):
    path = write_log(tmp_path / "log.mcap", simulate([], Conditions()))
    run = load_run(path)
    path.unlink()
    assert compare_runs(run, run).same
