"""Values are compared at their own time, too: what is stale, late or in a hurry is found though its path is right."""
import numpy as np
import pytest
from synthetic_session import Conditions, moves, simulate, write_log

from jaka_bag.compare.checks.state_checks import _nearest
from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.verdict import Aspect


@pytest.mark.parametrize("count", [0, 1, 2, 40])
def test_the_nearest_begin_is_found_without_a_look_at_all(count):
    starts = np.sort(np.random.RandomState(count).randint(0, 30, count) * 0.5).tolist()
    for at in np.arange(-1.0, 17.0, 0.25).tolist():
        expected = min(((abs(start - at), start - at) for start in starts), default=(np.inf, np.inf))
        assert _nearest(starts, at) == expected


def differences(tmp_path, change):
    golden, candidate = (simulate(moves(4), Conditions(seed=seed, call_late_s=0.0)) for seed in (0, 4))
    change(candidate)
    return compare_logs(write_log(tmp_path / "golden.mcap", golden),
                        write_log(tmp_path / "candidate.mcap", candidate)).differences


def stale(samples, every=1):
    def change(one):
        old = np.maximum(np.arange(len(one.time)) - samples * (np.arange(len(one.time)) % every == 0), 0)
        one.position, one.rotation_vector = one.position[old], one.rotation_vector[old]
    return change


@pytest.mark.parametrize("change", [stale(5), stale(12), stale(9, 2)], ids=["40 ms", "96 ms", "each second one 72 ms"])
def test_stale_tool_poses_under_fresh_stamps_are_found(change, tmp_path):
    assert Aspect.LATENESS in {check.aspect for check in differences(tmp_path, change)}


def test_what_is_little_stale_is_the_same(tmp_path):
    assert not differences(tmp_path, stale(1))


def test_states_that_come_late_beside_the_motions_are_found(tmp_path):
    def change(one):
        one.states[:, 0] = np.roll(one.states[:, 0], 6)
    found = differences(tmp_path, change)
    assert {(check.aspect, check.field) for check in found} == {(Aspect.LATENESS, "motion_state")}


def test_a_wait_that_was_dropped_is_found(tmp_path):
    golden = simulate(moves(4), Conditions(call_late_s=0.0))
    program = moves(4)
    program[2] = program[2]._replace(pause_s=0.1)
    hurried = simulate(program, Conditions(seed=4, call_late_s=0.0))
    found = compare_logs(write_log(tmp_path / "golden.mcap", golden),
                         write_log(tmp_path / "candidate.mcap", hurried)).differences
    assert {"waits", "waits of calls"} <= {check.field for check in found}


def silent(one):
    for keep in one.keep.values():
        keep[one.time % 3.0 < 0.4] = False


def thinned(one):
    for keep in one.keep.values():
        keep[::10] = False
    one.sequence_step = dict.fromkeys(one.sequence_step, 1)


def stamps_off(one):
    one.log_time = {name: time + 0.05 for name, time in one.log_time.items()}


@pytest.mark.parametrize("change, aspect", [
    (silent, Aspect.GAPS), (thinned, Aspect.RATES), (stamps_off, Aspect.STAMPS)])
def test_silences_dropped_messages_and_wrong_stamps_are_found(change, aspect, tmp_path):
    assert aspect in {check.aspect for check in differences(tmp_path, change)}
