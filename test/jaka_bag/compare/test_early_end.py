"""A candidate whose recording ends before all that happens in the golden log has happened is another run."""
import pytest
from cell_logs import joints, moments, smooth, steady, write_cell

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.verdict import Aspect


def move(now):
    return 0.5 * smooth(now, 2, 4) - 0.5 * smooth(now, 6, 8), 0.1


def rest(_now):
    return 0.0, 0.1


def until(end, said):
    return [one for one in said if one.time < end]


def ends_early(tmp_path, golden, end):
    paths = [write_cell(tmp_path / name, some) for name, some in (("golden.mcap", golden),
                                                                  ("new.mcap", until(end, golden)))]
    found = compare_logs(*paths).differences
    return any(check.aspect is Aspect.ALIGNMENT and "ends" in check.detail for check in found), found


LAST = {
    "an input": moments("/cell/io", [(0.5, False), (9.0, True), (9.4, False)]),
    "an order": moments("/cell/gripper", [(0.5, "open"), (9.0, "close")]),
    "the same order again": moments("/cell/gripper", [(0.5, "open"), (1.0, "open"), (9.0, "open")]),
    "an empty message": moments("/cell/fire", [(1.0, None), (9.0, None)]),
    "a mode": steady("/cell/beat", 50.0, 10.0, lambda now, n: int(now > 9.0)),
}


@pytest.mark.parametrize("name", LAST)
def test_a_change_after_the_last_motion_must_be_in_both_logs(name, tmp_path):
    golden = joints(10.0, move) + LAST[name]
    is_early, found = ends_early(tmp_path, golden, 8.2)
    assert is_early, found
    is_early, found = ends_early(tmp_path, golden, 9.7)
    assert not is_early and not found


@pytest.mark.parametrize("end, is_same", [(1.0, False), (28.5, False), (29.2, True)])
def test_of_a_log_without_any_event_the_whole_length_must_be_there(end, is_same, tmp_path):
    golden = joints(30.0, rest) + moments("/cell/gripper", [(0.2, "open")])
    golden += steady("/cell/force", 50.0, 30.0, lambda now, n: 1.0 + smooth(now, 3.0, 25.0))
    is_early, found = ends_early(tmp_path, golden, end)
    assert is_early is not is_same and bool(found) is not is_same, found


@pytest.mark.parametrize("beat", [lambda now, n: n % 2, lambda now, n: n])
@pytest.mark.parametrize("rate", [1.0, 50.0])
def test_what_changes_all_the_time_may_end_sooner(beat, rate, tmp_path):
    golden = joints(10.0, move) + steady("/cell/beat", rate, 10.0, lambda now, n: beat(now, n) % 256)
    is_early, found = ends_early(tmp_path, golden, 8.5)
    assert not is_early and not found
