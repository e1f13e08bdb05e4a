"""The trace of a path's clock: asked for a moment, it says where the clock stood, and how fast it ran."""
import pytest

from jaka_ros_driver.trajectory.clock_trace import ClockTrace

CYCLE = 0.008


def traced(*rates, cycles=100):
    """Return a trace that begins at 10 s with the path's 0, and runs so many cycles at each rate."""
    trace, time, number = ClockTrace(10.0, 0.0), 0.0, 0
    for rate in rates:
        for _ in range(cycles):
            number, time = number + 1, time + rate * CYCLE
            trace.note(10.0 + number * CYCLE, time)
    return trace


def test_a_moment_of_the_past_has_the_time_and_the_rate_of_then():
    trace = traced(1.0, 0.0, 0.5)
    for at, moment in ((10.0, (0.0, 1.0)), (10.4, (0.4, 1.0)), (11.2, (0.8, 0.0)), (12.0, (1.0, 0.5))):
        assert trace.at(at, 9.0) == pytest.approx(moment, abs=1e-9), at


def test_a_moment_of_the_future_assumes_the_rate_that_it_is_told():
    assert traced(1.0).at(11.8, 0.5) == pytest.approx((1.3, 0.5))
    assert traced(1.0).at(11.8, 0.0) == pytest.approx((0.8, 0.0))
    assert ClockTrace(10.0, -2.0).at(11.0, 1.0) == pytest.approx((-1.0, 1.0))


def test_a_moment_before_the_first_is_not_known():
    trace = traced(1.0)
    assert trace.at(9.999, 1.0) is None and trace.since == 10.0


def test_one_rate_takes_no_memory_and_a_ramp_of_the_rate_is_kept_until_there_is_too_much():
    assert len(traced(1.0, cycles=20000)._moments) == 2
    trace = traced(*(0.5 + 0.001 * step for step in range(5000)), cycles=1)
    assert len(trace._moments) == 4096 and trace.since > 10.0
    assert trace.at(trace.since - CYCLE, 1.0) is None and trace.at(trace.since, 1.0) is not None
