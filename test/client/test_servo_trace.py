"""The distance of the arm from everything it was sent within the last second."""
import pytest

from jaka_ros_driver.client.core.servo_trace import ServoTrace


def ramp(duration, speed=1.0, period=0.008):
    trace = ServoTrace()
    for cycle in range(int(duration / period)):
        trace.sent((cycle * period * speed, 5.0), cycle * period)
    return trace


def test_before_anything_was_sent_nothing_is_too_far():
    assert ServoTrace().excess((1.0, 2.0)) == 0.0


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.9])
def test_an_arm_that_lags_is_where_it_was_sent(lag):
    assert ramp(3.0).excess((2.992 - lag, 5.0)) == 0.0


@pytest.mark.parametrize("point, excess", [((3.092, 5.0), 0.1), ((2.992, 5.2), 0.2), ((2.992, 4.7), 0.3)])
def test_an_arm_that_runs_ahead_or_aside_is_not(point, excess):
    assert ramp(3.0).excess(point) == pytest.approx(excess, abs=1e-9)


def test_what_was_sent_long_ago_does_not_count():
    assert ramp(3.0).excess((1.0, 5.0)) > 0.7


def test_a_stream_that_goes_both_ways_has_the_extent_of_both():
    trace = ServoTrace()
    for cycle, value in enumerate((0.0, 0.3, -0.2, 0.1)):
        trace.sent((value,), 0.008 * cycle)
    assert trace.excess((0.3,)) == trace.excess((-0.2,)) == 0.0
    assert trace.excess((-0.25,)) == pytest.approx(0.05)
