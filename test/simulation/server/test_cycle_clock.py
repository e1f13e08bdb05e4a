import pytest

from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.server.cycle_clock import MIN_FEED_PERIOD_S, MIN_TICK_S, CycleClock


def simulated_after(scale, duration, lateness=lambda tick: 0.0):
    """Return cycles done in a stretch of wall time when each wake-up comes so late."""
    clock, now, cycles, tick = CycleClock(scale, 0.0), 0.0, 0, 0
    while now < duration:
        now = max(now, clock.next_tick) + lateness(tick)
        cycles += clock.due_cycles(now)
        tick += 1
    return cycles


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0, 3.7, 10.0, 20.0, 100.0])
def test_simulated_time_keeps_up_with_wall_time(scale):
    assert simulated_after(scale, 5.0) == pytest.approx(5.0 * scale / CYCLE_TIME_S, abs=scale * 2.0 + 2)


def test_lateness_does_not_add_up():
    assert simulated_after(1.0, 5.0, lambda tick: 0.003) == pytest.approx(625, abs=2)
    assert simulated_after(1.0, 5.0, lambda tick: 0.05 if tick % 20 == 0 else 0.0) == pytest.approx(625, abs=8)


def test_wake_ups_are_bounded_when_time_runs_fast():
    clock = CycleClock(50.0, 0.0)
    assert clock.next_tick == MIN_TICK_S
    assert clock.due_cycles(MIN_TICK_S) == 12 and clock.next_tick == pytest.approx(2 * MIN_TICK_S)


def test_nothing_is_due_before_its_time():
    clock = CycleClock(1.0, 10.0)
    assert clock.due_cycles(10.007) == 0 and clock.lateness()["cycles"] == 0


def test_standstill_of_the_host_is_not_made_up_for():
    clock = CycleClock(1.0, 0.0)
    assert clock.due_cycles(30.0) == 1
    assert clock.next_tick == pytest.approx(30.008) and clock.lateness()["lags"] == 1


@pytest.mark.parametrize("scale, period, wall", [
    (1.0, 0.008, 0.008), (1.0, 0.03, 0.03), (1.0, 0.001, MIN_FEED_PERIOD_S), (20.0, 0.03, MIN_FEED_PERIOD_S),
    (20.0, 1.0, 0.05)])
def test_frames_keep_their_period(scale, period, wall):
    clock, frames, steps = CycleClock(scale, 0.0), 0, 0
    while steps < 20000:
        steps += 1
        frames += clock.due_frames(steps * 0.0005, period)
    assert frames == pytest.approx(10.0 / wall, rel=0.01, abs=1)


def test_frames_of_8_ms_go_out_with_the_cycle():
    clock, now = CycleClock(1.0, 0.0), 0.0
    clock.due_frames(0.0, 0.03)
    for _ in range(50):
        now = clock.next_tick + 0.0002
        clock.due_cycles(now)
        clock.due_frames(now, 0.008)
    for _ in range(50):
        now = clock.next_tick + 0.0002
        assert clock.due_cycles(now) == 1
        assert clock.due_frames(now, 0.008) == 1
        assert clock.next_frame == pytest.approx(clock.next_tick, abs=1e-9)


def test_frames_that_are_late_are_not_left_out_but_for_a_standstill():
    clock = CycleClock(1.0, 0.0)
    assert clock.due_frames(0.008, 0.008) == 1 and clock.due_frames(0.015, 0.008) == 0
    assert clock.due_frames(0.1085, 0.008) == 12 and clock.next_frame == pytest.approx(0.112)
    assert clock.due_frames(30.0, 0.008) == 1 and clock.next_frame == pytest.approx(30.008)


def test_lateness_is_measured():
    clock = CycleClock(1.0, 0.0)
    for tick in range(100):
        clock.due_cycles(clock.next_tick + (0.005 if tick == 50 else 0.0001))
    lateness = clock.lateness()
    assert lateness["cycles"] == 100 and lateness["max_s"] == pytest.approx(0.005)
    assert lateness["median_s"] == pytest.approx(0.0001) and lateness["p99_s"] <= 0.005
