"""Values that are no numbers hide nothing but themselves: each column is compared where it is a number."""
import numpy as np
import pytest
from cell_logs import joints, moments, smooth, steady, write_cell
from synthetic_session import Conditions, moves, simulate, write_log

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.tolerances import parse_tolerances

NAN, INF = float("nan"), float("inf")


def move(now):
    return 0.5 * smooth(now, 2, 4) - 0.5 * smooth(now, 6, 8), 0.1


def values(first, second, topic="/cell/values"):
    """Return messages of two numbers, each from the time."""
    return joints(10.0, move) + steady(topic, 50.0, 10.0, lambda now, n: [first(now), second(now)])


def compared(tmp_path, golden, candidate, tolerances=""):
    paths = [write_cell(tmp_path / name, some) for name, some in (("golden.mcap", golden), ("new.mcap", candidate))]
    return compare_logs(paths[0], paths[1], parse_tolerances(tolerances))


def wave(now):
    return float(np.sin(now))


def wrong(now):
    return wave(now) + (100.0 if 3.0 < now < 7.0 else 0.0)


def at_times(value):
    return lambda now: value if 3.0 < now < 7.0 else 0.0


@pytest.mark.parametrize("value", [NAN, INF, -INF])
@pytest.mark.parametrize("tolerances", ["", "fields: {/cell/values: {data: {absolute: 0.1}}}", "nan: ignore"])
def test_what_is_no_number_in_one_column_hides_no_other(value, tolerances, tmp_path):
    golden = values(wave, at_times(value))
    again = compared(tmp_path, golden, golden, tolerances)
    assert again.same, again.differences
    found = compared(tmp_path, golden, values(wrong, at_times(value)), tolerances).differences
    assert {check.field for check in found} == {"data[0]"}, found


@pytest.mark.parametrize("ours, theirs", [(NAN, INF), (INF, -INF), (-INF, NAN)])
def test_nan_and_both_infinities_are_not_the_same(ours, theirs, tmp_path):
    found = compared(tmp_path, values(wave, at_times(ours)), values(wave, at_times(theirs))).differences
    assert {check.field for check in found} == {"NaN"}, found


def test_another_column_that_is_no_number_is_found(tmp_path):
    found = compared(tmp_path, values(at_times(NAN), wave), values(wave, at_times(NAN))).differences
    assert "NaN" in {check.field for check in found}, found


@pytest.mark.parametrize("is_first_a_number", [True, False])
def test_a_column_that_is_never_a_number_is_the_same(is_first_a_number, tmp_path):
    def never(_now):
        return NAN
    golden = values(wave if is_first_a_number else never, never)
    comparison = compared(tmp_path, golden, golden)
    assert comparison.same, comparison.differences
    if is_first_a_number:
        assert compared(tmp_path, golden, values(wrong, never)).differences
    assert compared(tmp_path, golden, values(wave, wave)).differences


def test_a_column_that_is_never_a_number_is_the_same_in_a_run_that_begins_later(tmp_path):
    def log(late):
        return joints(10.0, lambda now: move(now - late)) + steady("/cell/values", 50.0, 10.0, lambda now, n: [
            wave(now - late), NAN])
    comparison = compared(tmp_path, log(0.0), log(0.8))
    assert comparison.same, comparison.differences


def test_an_order_of_an_infinite_number_is_not_one_of_none(tmp_path):
    def orders(value):
        return joints(10.0, move) + moments("/cell/force", [(2.0, 1.0), (4.0, value), (7.0, 2.0)])
    assert compared(tmp_path, orders(NAN), orders(NAN)).same
    assert compared(tmp_path, orders(NAN), orders(INF)).differences
    assert compared(tmp_path, orders(INF), orders(-INF)).differences


@pytest.mark.parametrize("part, column, other, amount", [
    ("position", 0, ("position", 1), 0.1), ("position", 0, ("rotation_vector", 2), 0.1),
    ("rotation_vector", 0, ("position", 1), 0.1), ("joints", 2, ("joints", 3), 0.1)])
def test_a_part_of_a_pose_that_is_no_number_hides_no_other(part, column, other, amount, tmp_path):
    def log(name, off):
        one = simulate(moves(3), Conditions(call_late_s=0.0, stamp_late_s=0.001, seed=4))
        getattr(one, part)[100:200, column] = np.nan
        getattr(one, other[0])[100:200, other[1]] += off
        return write_log(tmp_path / name, one)
    golden = log("golden.mcap", 0.0)
    again = compare_logs(golden, log("again.mcap", 0.0))
    assert again.same, again.differences
    assert compare_logs(golden, log("new.mcap", amount)).differences
