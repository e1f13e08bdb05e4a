"""The causes of a scenario, as they are seen: changes of terminals, begins of motion, answers."""
import numpy as np
import pytest

from jaka_regression.cell.sightings import Polls, Sightings, terminals_in
from jaka_regression.scenario import CauseKind, EventCause

STEP_S = 0.008


def levels(outputs=(), inputs=(), bank="cabinet"):
    return terminals_in({bank: {"digital_outputs": outputs, "digital_inputs": inputs}})


def test_a_change_of_a_terminal_is_seen_with_its_number():
    seen = Sightings("/left")
    assert seen.terminals(levels([False, True], [True]), 0.0) == []  # so it was before
    found = [seen.terminals(levels([level, True], [True]), at) for at, level in enumerate((1, 0, 1, 1), 1)]
    assert [[(one.cause, one.at) for one in some] for some in found] == [
        [(EventCause(CauseKind.OUTPUT, "/left", ("cabinet", 0, 1), 0), 1)],
        [(EventCause(CauseKind.OUTPUT, "/left", ("cabinet", 0, 0), 0), 2)],
        [(EventCause(CauseKind.OUTPUT, "/left", ("cabinet", 0, 1), 1), 3)], []]


def test_banks_and_directions_are_kept_apart():
    seen = Sightings("", levels([0], [0], "tool"))
    assert [one.cause for one in seen.terminals(levels([1], [1], "tool"), 1.0)] == [
        EventCause(CauseKind.OUTPUT, "", ("tool", 0, 1), 0), EventCause(CauseKind.INPUT, "", ("tool", 0, 1), 0)]


def test_a_terminal_that_was_not_reported_before_has_not_changed():
    seen = Sightings("", levels([0], []))
    assert seen.terminals(levels([0, 1], [1]), 1.0) == []


def smooth(before, after, lasts_s):
    part = np.arange(0.0, 1.0, STEP_S / lasts_s)
    return before + (after - before) * (10 * part ** 3 - 15 * part ** 4 + 6 * part ** 5)


@pytest.mark.parametrize("noise_rad", [0.0, 3e-5])
@pytest.mark.parametrize("rest_s", [0.1, 2.0])
def test_each_motion_from_rest_to_rest_is_one(noise_rad, rest_s):
    still = np.zeros(int(rest_s / STEP_S))
    track = np.concatenate([still, smooth(0.0, 0.5, 1.0), still + 0.5, smooth(0.5, 0.497, 0.3), still + 0.497,
                            smooth(0.497, 0.0, 8.0), still])
    track += np.random.default_rng(1).uniform(-noise_rad, noise_rad, len(track))
    seen = Sightings("")
    found = [one for number, value in enumerate(track.tolist())
             for one in seen.joints((0.0, value), number * STEP_S)]
    assert [one.cause for one in found] == [EventCause(CauseKind.MOTION, "", (), nth) for nth in range(3)]
    begins = [rest_s, 2 * rest_s + 1.0, 3 * rest_s + 1.3]
    assert [one.at for one in found] == pytest.approx(begins, abs=0.3)  # slow ones are seen late
    assert not seen.is_moving


def test_answers_are_counted_by_service():
    seen = Sightings("")
    found = [seen.answered(name, 0.0)[0].cause for name in ("joint_move", "set_io", "joint_move")]
    assert [(cause.what, cause.nth) for cause in found] == [(("joint_move",), 0), (("set_io",), 0),
                                                            (("joint_move",), 1)]


def test_reads_that_repeat_their_answer_are_one():
    polls = Polls()
    calls = [("get_io", b"2", b"0"), ("get_io", b"2", b"0"), ("get_io", b"3", b"0"), ("get_io", b"2", b"0"),
             ("get_io", b"2", b"1"), ("set_io", b"1", b""), ("set_io", b"1", b""), ("get_io", b"2", b"1")]
    assert [polls.is_repeated("/jaka_driver/" + name, request, response) for name, request, response in calls] == [
        False, True, False, True, False, False, False, False]


def test_another_arms_calls_do_not_end_a_series_of_reads():
    polls = Polls()
    assert not polls.is_repeated("/left/jaka_driver/get_io", b"2", b"0")
    assert not polls.is_repeated("/right/jaka_driver/joint_move", b"", b"")
    assert polls.is_repeated("/left/jaka_driver/get_io", b"2", b"0")
