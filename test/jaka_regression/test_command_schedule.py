"""The times at which calls are made again: recorded times, causes, overlaps."""
import pytest

from jaka_bag.compare.runs.run import Call
from jaka_regression.command_schedule import as_text, due, plan


def call(start, duration, service="joint_move", success=True):
    return Call("/jaka_driver/service_calls", start, duration, "/jaka_driver/" + service, "jaka_msgs/Move", "0" * 32,
                b"", b"", success, "", "mvvelo: 0.5\n", "")


def test_a_call_comes_at_its_recorded_time():
    planned = plan([call(1.0, 0.5), call(4.0, 0.5)])
    assert due(planned[0], [None, None], [None, None], 100.0, False) == pytest.approx(101.0)
    assert due(planned[1], [101.0, None], [101.5, None], 100.0, False) == pytest.approx(104.0)


def test_a_call_waits_for_the_end_of_what_it_followed_and_keeps_a_pause_after_it():
    planned = plan([call(1.0, 0.5), call(1.53, 0.5), call(9.0, 0.1)])
    assert due(planned[1], [101.0, None, None], [None, None, None], 100.0, False) is None
    assert due(planned[1], [101.0, None, None], [103.0, None, None], 100.0, False) == pytest.approx(103.03)
    assert due(planned[2], [101.0, 103.0, None], [103.0, 108.99, None], 100.0, False) == pytest.approx(109.09)


def test_a_call_during_another_keeps_its_place_in_it():
    planned = plan([call(1.0, 2.0), call(1.7, 0.01, "stop_move"), call(5.0, 0.1)])
    assert [entry.is_overlapped for entry in planned] == [True, False, False]
    assert due(planned[1], [101.4, None, None], [None] * 3, 100.0, False) == pytest.approx(102.1)
    assert due(planned[1], [None] * 3, [None] * 3, 100.0, False) is None
    assert due(planned[2], [101.4, 102.1, None], [None, 102.2, None], 100.0, False) is None


def test_after_previous_leaves_out_pauses_but_not_the_place_in_a_call_under_way():
    planned = plan([call(10.0, 2.0), call(10.7, 0.01, "stop_move"), call(60.0, 0.1)])
    assert due(planned[0], [None] * 3, [None] * 3, 100.0, True) == 100.0
    assert due(planned[1], [100.0, None, None], [None] * 3, 100.0, True) == pytest.approx(100.7)
    assert due(planned[2], [100.0, 100.7, None], [100.8, 100.71, None], 100.0, True) == pytest.approx(100.8)


def test_a_stream_that_is_late_catches_up():
    planned = plan([call(1.0 + 0.032 * i, 0.002, "servo_j") for i in range(3)])
    assert due(planned[2], [101.0, 101.2, None], [101.1, 101.21, None], 100.0, False) == pytest.approx(101.21)


def test_times_are_stretched_and_begin_where_asked():
    planned = plan([call(2.0, 0.5), call(4.0, 0.5)], stretch=4.0, start=1.0)
    assert [entry.offset for entry in planned] == pytest.approx([4.0, 12.0])


def test_ten_thousand_calls_are_planned_at_once():
    assert len(plan([call(0.01 * i, 0.002) for i in range(10000)])) == 10000


def test_the_plan_as_text_tells_time_duration_outcome_and_request():
    text = as_text(plan([call(1.0, 0.5), call(2.0, 0.25, success=False)]))
    assert "1.000      0.500  succeeded /jaka_driver/joint_move(mvvelo: 0.5)" in text
    assert "2.000      0.250  failed" in text
