"""The times of messages on change are compared: of the first one, and of those that repeat the one before."""
import numpy as np
import pytest
from cell_logs import Said, joints, moments, smooth, write_cell

from jaka_bag.compare.comparison import compare_logs


def move(now):
    return 0.5 * smooth(now, 2, 4) - 0.5 * smooth(now, 6, 8), 0.1


def compared(tmp_path, topic, ours, theirs, late=0.0, without_s=0.0):
    """Compare logs with messages at some times, the candidate's moves later, its recording begun later."""
    golden = joints(10.0, move) + moments(topic, ours)
    candidate = joints(10.0, lambda now: move(now - late)) + [
        Said(one.topic, one.time + late, one.value) for one in moments(topic, theirs)]
    candidate = [one for one in candidate if one.time >= without_s]
    paths = [write_cell(tmp_path / name, some) for name, some in (("golden.mcap", golden), ("new.mcap", candidate))]
    return compare_logs(*paths).differences


CLOSE = "/cell/gripper"


@pytest.mark.parametrize("ours, theirs", [
    ([(5.0, "close")], [(1.0, "close")]), ([(1.0, "close")], [(5.0, "close")]), ([(5.0, "close")], [(0.1, "close")]),
    ([(0.1, "close")], [(5.0, "close")]), ([(5.0, "open"), (9.0, "close")], [(3.0, "open"), (9.0, "close")]),
    ([(5.0, "close"), (5.4, "close"), (9.0, "close")], [(5.0, "close"), (7.4, "close"), (9.0, "close")])])
def test_another_time_of_the_first_or_of_a_repeated_message_is_found(ours, theirs, tmp_path):
    assert {check.topic for check in compared(tmp_path, CLOSE, ours, theirs)} == {CLOSE}
    numbers = ([(time, 1.0 if word == "close" else 2.0) for time, word in some] for some in (ours, theirs))
    assert {check.topic for check in compared(tmp_path, "/cell/force", *numbers)} == {"/cell/force"}


def test_other_times_of_messages_that_say_nothing_are_found(tmp_path):
    ours = [(5.0, None), (9.0, None)]
    for theirs in ([(1.0, None), (1.5, None)], [(5.0, None), (8.0, None)], [(4.5, None), (9.0, None)]):
        assert {check.topic for check in compared(tmp_path, "/cell/fire", ours, theirs)} == {"/cell/fire"}
    assert not compared(tmp_path, "/cell/fire", ours, [(5.1, None), (8.9, None)])


@pytest.mark.parametrize("late", [0.0, 0.9])
@pytest.mark.parametrize("ours, theirs", [
    ([(0.05, "model")], [(0.7, "model")]), ([(0.7, "model")], [(0.02, "model")]),
    ([(1.1, "open"), (7.0, "close")], [(0.95, "open"), (7.1, "close")]),
    ([(5.0, "open"), (9.0, "open")], [(5.1, "open"), (8.9, "open")])])
def test_messages_latched_at_the_begin_and_those_in_time_are_the_same(ours, theirs, late, tmp_path):
    latched = [(time - late if time < 0.9 else time, word) for time, word in theirs]  # at the recording's begin
    found = compared(tmp_path, CLOSE, ours, latched, late)
    assert not found


@pytest.mark.parametrize("ours", [[(0.5, "open"), (6.5, "close")], [(0.5, "open"), (5.0, "open"), (6.5, "close")]])
def test_a_message_before_a_later_begin_of_the_recording_is_not_missed(ours, tmp_path):
    assert not [check for check in compared(tmp_path, CLOSE, ours, ours, 0.0, 1.0) if "repeated" not in check.field]


def test_many_messages_at_times_of_chance_that_say_the_same_are_the_same(tmp_path):
    random = np.random.RandomState(3)
    for _ in range(4):
        ours, theirs = ([(float(time), "ok") for time in np.sort(random.uniform(0.0, 9.9, 150))] for _ in range(2))
        assert not compared(tmp_path, CLOSE, ours, theirs)
