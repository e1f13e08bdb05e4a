"""What the golden log has and the candidate lacks is found, and what only the candidate has."""
import pytest
from cell_logs import Said, joints, smooth, steady, transforms, write_cell

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.tolerances import Tolerances
from jaka_bag.compare.verdict import Aspect


def move(now):
    return 1.5 * smooth(now, 1, 2.5) - 1.5 * smooth(now, 3, 4.5) + 0.3 * smooth(now, 6, 8), 0.1


def wrong_move(now):
    return 1.5 * smooth(now, 1, 2.5) - 1.5 * smooth(now, 3, 4.5) - 0.9 * smooth(now, 6, 7), 0.1


def rest(_now):
    return 0.0, 0.1


def compared(tmp_path, golden, candidate, time_scale=1.0, tolerances=None):
    paths = [write_cell(tmp_path / name, some) for name, some in (("golden.mcap", golden), ("new.mcap", candidate))]
    return compare_logs(paths[0], paths[1], tolerances or Tolerances(), time_scale)


def faster(said, factor):
    """Return what a candidate that runs so many times faster says at the same rates as before."""
    return [one._replace(time=one.time / factor) for one in said]


@pytest.mark.parametrize("jump_s", [20.0, 3600.0])
def test_joints_whose_stamps_jump_ahead_are_missed(jump_s, tmp_path):
    golden = joints(10.0, move)
    jumping = joints(10.0, wrong_move, stamp=lambda now: now + (jump_s if now > 5.5 else 0.0))
    found = compared(tmp_path, golden, jumping).differences
    assert Aspect.GAPS in {check.aspect for check in found}, found
    assert 5.0 < min(check.at for check in found if check.aspect is Aspect.GAPS) < 6.5


def test_the_joints_of_a_faster_run_that_fall_silent_are_missed(tmp_path):
    level = steady("/cell/force", 50.0, 10.0, lambda now, n: 1.0)
    golden = joints(10.0, move) + level

    def fast(until):
        return joints(until / 2.0, lambda now: move(2.0 * now)) + faster(level, 2.0)
    assert compared(tmp_path, golden, fast(10.0), 2.0).same
    found = compared(tmp_path, golden, fast(5.0), 2.0).differences
    assert {check.topic for check in found} == {"/arm/joint_position"}


@pytest.mark.parametrize("scale", [2.0, 5.0])
def test_a_faster_run_at_the_rates_of_the_clock_is_the_same(scale, tmp_path):
    golden = joints(10.0, move) + steady("/cell/force", 50.0, 10.0, lambda now, n: 1.0)
    fast = joints(10.0 / scale, lambda now: move(scale * now)) + steady("/cell/force", 50.0, 10.0 / scale,
                                                                         lambda now, n: 1.0)
    comparison = compared(tmp_path, golden, fast, scale)
    assert comparison.same, comparison.differences


@pytest.mark.parametrize("there", [lambda now: now < 1.0, lambda now: abs(now - 5.0) < 0.009,
                                   lambda now: now > 9.0])
def test_a_transform_that_is_there_for_a_part_of_the_time_only_is_found_in_either_log(there, tmp_path):
    both = joints(10.0, move) + transforms(10.0, lambda now: ("tool", "camera"))
    part = joints(10.0, move) + transforms(10.0, lambda now: ("tool", "camera")[:1 + there(now)])
    assert compared(tmp_path, both, both).same and compared(tmp_path, part, part).same
    for golden, candidate in ((both, part), (part, both)):
        found = compared(tmp_path, golden, candidate).differences
        assert found and all("camera" in check.field for check in found), found


def test_a_slow_transform_beside_fast_ones_is_the_same_whenever_it_comes(tmp_path):
    def both(late):
        slow = [Said("/tf", one.time + late, one.value) for one in transforms(10.0, lambda now: ("map",), 1.0)]
        return joints(10.0, move) + transforms(10.0, lambda now: ("tool",)) + slow
    comparison = compared(tmp_path, both(0.05), both(0.55))
    assert not [check for check in comparison.differences if check.aspect is Aspect.GAPS], comparison.differences


def test_stamps_that_jump_ahead_are_found_where_nothing_but_states_would_tell(tmp_path):
    def states(jump_s, value):
        return [one._replace(topic="/cell/stamped", value={
            "header": one.value["header"], "data": int(one.time > 7.0) * value}) for one in joints(
                10.0, rest, stamp=lambda now: now + (jump_s if now > 5.5 else 0.0))]
    golden = joints(10.0, move) + states(0.0, 0)
    found = compared(tmp_path, golden, joints(10.0, move) + states(20.0, 1)).differences
    assert {check.aspect for check in found} >= {Aspect.STAMPS}
    assert {check.topic for check in found} == {"/cell/stamped"}
