"""The position of a playback from 100 to 110 s of a log, at given times."""
import pytest

from jaka_foxglove.playback_clock import PlaybackClock

S = 10**9


@pytest.fixture
def clock():
    clock = PlaybackClock(100 * S, 110 * S)
    clock.seek(0.0, 100 * S)
    return clock


def test_it_moves_at_its_speed_and_stops_at_the_end(clock):
    assert clock.position(2.5) == 102.5 * S
    clock.set(2.5, True, 4.0)
    assert clock.position(3.5) == 106.5 * S and clock.position(99.0) == 110 * S


def test_a_pause_and_a_hold_cost_no_position(clock):
    clock.set(1.0, False, 1.0)
    assert clock.position(50.0) == 101 * S
    clock.set(50.0, True, 1.0)
    clock.hold(51.0, True)
    assert clock.position(60.0) == 102 * S
    clock.set(60.0, True, 2.0)  # a new speed while it is held
    assert clock.position(70.0) == 102 * S
    clock.hold(70.0, False)
    assert clock.position(71.0) == 104 * S


def test_a_seek_is_cut_to_the_log(clock):
    for time, there in ((105, 105), (0, 100), (1000, 110)):
        clock.seek(5.0, time * S)
        assert clock.position(5.0) == there * S


def test_speeds_are_cut(clock):
    clock.set(0.0, True, 1e9)
    assert clock.speed == 100.0
    clock.set(0.0, True, 1e-9)
    assert clock.speed == 0.01
