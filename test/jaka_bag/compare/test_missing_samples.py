"""Samples, pulses and beats that only one of the logs has are found, whichever it is."""
import numpy as np
import pytest
from cell_logs import joints, smooth, steady, transforms, write_cell

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.runs import windows
from jaka_bag.compare.tolerances import Tolerances, parse_tolerances
from jaka_bag.compare.verdict import Aspect
from jaka_bag.operations import columns


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


def test_a_transform_that_some_parts_of_a_log_do_not_have_is_compared(tmp_path, monkeypatch):
    monkeypatch.setattr(columns, "_GROUP_BYTES", 1000)
    said = joints(10.0, move) + transforms(10.0, lambda now: ("tool", "camera")[:1 + (now > 6.0)])
    paths = [write_cell(tmp_path / name, said, 8000) for name in ("golden.mcap", "new.mcap")]
    assert compare_logs(*paths).same


def test_a_slow_transform_beside_fast_ones_is_the_same_whenever_it_comes(tmp_path):
    def both(late):
        slow = transforms(10.0, lambda now: ("map",), 1.0, late, 0.0)
        return joints(10.0, move) + transforms(10.0, lambda now: ("tool",)) + slow
    comparison = compared(tmp_path, both(0.05), both(0.55))
    assert comparison.same, comparison.differences


def test_stamps_that_jump_ahead_are_found_where_nothing_but_states_would_tell(tmp_path):
    def states(jump_s, value):
        return [one._replace(topic="/cell/stamped", value={
            "header": one.value["header"], "data": int(one.time > 7.0) * value}) for one in joints(
                10.0, rest, stamp=lambda now: now + (jump_s if now > 5.5 else 0.0))]
    golden = joints(10.0, move) + states(0.0, 0)
    found = compared(tmp_path, golden, joints(10.0, move) + states(20.0, 1)).differences
    assert {check.aspect for check in found} >= {Aspect.STAMPS}
    assert {check.topic for check in found} == {"/cell/stamped"}


@pytest.mark.parametrize("golden_s, candidate_s, is_same", [
    (-3.6, -1.2, True), (-1.2, -3.6, True), (-0.1, 4.0, False), (4.0, -0.1, False)])
def test_how_old_a_latched_state_is_tells_when_its_publisher_was_started(golden_s, candidate_s, is_same, tmp_path):
    def both(stamp_s):
        one = joints(10.0, rest, stamp=lambda now: now + stamp_s)[0]
        return joints(10.0, move) + [one._replace(topic="/cell/stamped", time=0.01, value={
            "header": one.value["header"], "data": 1})]
    comparison = compared(tmp_path, both(golden_s), both(candidate_s))
    assert comparison.same is is_same, comparison.differences


def beat(of):
    return joints(10.0, move) + steady("/cell/beat", 50.0, 10.0, lambda now, n: of(n))


@pytest.mark.parametrize("of", [lambda n: 0, lambda n: 1, lambda n: n // 2 % 2, lambda n: n % 2 if n < 250 else 1])
def test_a_heartbeat_that_is_stuck_or_slow_is_found(of, tmp_path):
    golden = beat(lambda n: n % 2)
    found = compared(tmp_path, golden, beat(of)).differences
    assert {check.topic for check in found} == {"/cell/beat"}, found
    assert compared(tmp_path, beat(of), golden).differences


@pytest.mark.parametrize("of", [lambda n: n % 2, lambda n: n % 3, lambda n: n // 2 % 2, lambda n: n % 256])
def test_a_heartbeat_of_another_phase_is_the_same(of, tmp_path):
    moved = [one._replace(time=one.time + 0.013) for one in steady("/cell/beat", 50.0, 10.0, lambda now, n: of(n + 1))]
    comparison = compared(tmp_path, beat(of), joints(10.0, move) + moved)
    assert comparison.same, comparison.differences


def test_a_pulse_that_either_log_lacks_is_found(tmp_path):
    def force(amount):
        return joints(10.0, move) + steady("/cell/force", 50.0, 10.0, lambda now, n: amount if 5.0 <= now < 5.15
                                           else 0.5 * smooth(now, 2.0, 9.0))
    with_pulse, without = force(100.0), force(0.0)
    assert compared(tmp_path, with_pulse, without).differences
    assert compared(tmp_path, without, with_pulse).differences
    assert compared(tmp_path, with_pulse, with_pulse).same


@pytest.mark.parametrize("amount", [0.006, 0.3])
def test_a_joint_that_goes_away_and_back_is_found_in_either_log(amount, tmp_path):
    def twitching(now):
        return move(now)[0], 0.1 + (amount if 5.0 <= now < 5.15 else 0.0)
    twitch, none = joints(10.0, twitching), joints(10.0, move)
    for golden, candidate in ((twitch, none), (none, twitch)):
        found = compared(tmp_path, golden, candidate).differences
        assert {check.field for check in found} == {"joint_2"}, found


def test_angles_that_wrap_are_the_same_and_a_turn_that_is_missing_is_found(tmp_path):
    def angle(dip):
        return joints(10.0, move) + steady("/cell/force", 50.0, 10.0, lambda now, n: float(
            np.mod(3.0 + 0.4 * np.sin(now) + (dip if 5.0 <= now < 5.15 else 0.0) + np.pi, 2.0 * np.pi) - np.pi))
    limits = parse_tolerances("fields: {/cell/force: {data: {absolute: 0.05, wraps: true}}}")
    assert compared(tmp_path, angle(0.0), angle(0.0), tolerances=limits).same
    assert compared(tmp_path, angle(1.0), angle(1.0 - 2.0 * np.pi), tolerances=limits).same
    assert compared(tmp_path, angle(1.0), angle(0.0), tolerances=limits).differences


def test_a_pulse_at_the_border_of_two_windows_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(windows, "_WINDOW_ROWS", 100)
    monkeypatch.setattr(windows, "_CELL_S", 1.0)
    for begin in (4.95, 5.0, 5.9):
        def twitching(now, begin=begin):
            return move(now)[0], 0.1 + (0.1 if begin <= now < begin + 0.12 else 0.0)
        assert compared(tmp_path, joints(10.0, twitching), joints(10.0, move)).differences
    assert compared(tmp_path, joints(10.0, move), joints(10.0, move)).same
