"""A slow feed is filled up to the full rate; a feed at the full rate gets no message more, however it jitters."""
import random

import pytest

from jaka_ros_driver.ros.topics.state_repeater import StateRepeater

PERIOD = 0.008


def play(arrivals, until):
    """Times of (arrivals, repeats), the repeater driven as its thread drives it."""
    repeater, repeats = StateRepeater(PERIOD), []
    for arrival in list(arrivals) + [until]:
        due = repeater.next_repeat()
        while due is not None and due < arrival:
            repeater.repeated(due)
            repeats.append(due)
            due = repeater.next_repeat()
        if arrival < until:
            repeater.arrived(arrival)
    return repeats


@pytest.mark.parametrize("rate", [10.0, 20.0, 33.3, 62.5, 100.0, 115.0])
def test_a_slow_feed_is_filled_to_the_full_rate(rate):
    arrivals = [n / rate for n in range(int(20 * rate))]
    repeats = play(arrivals, 20.0)
    settled = [t for t in sorted(arrivals + repeats) if 4.0 <= t < 20.0]
    assert len(settled) / 16.0 == pytest.approx(125.0, abs=0.5)


@pytest.mark.parametrize("jitter", [0.0, 0.002, 0.0039])
def test_a_feed_at_the_full_rate_is_left_alone(jitter):
    noise = random.Random(4)
    arrivals = sorted(n * PERIOD + noise.uniform(-jitter, jitter) for n in range(5000))
    assert play(arrivals, 5000 * PERIOD) == []


@pytest.mark.parametrize("hole", [2, 6, 12, 50])
@pytest.mark.parametrize("is_caught_up", [True, False])
def test_a_stall_of_a_healthy_feed_is_not_filled(hole, is_caught_up):
    before = [n * PERIOD for n in range(500)]
    end = (500 + hole) * PERIOD
    burst = [end + n * 1e-6 for n in range(hole)] if is_caught_up else []
    after = [end + n * PERIOD for n in range(1, 500)]
    assert play(before + burst + after, after[-1]) == []


def test_alternating_early_and_late_frames_are_not_a_slow_feed():
    arrivals = [n * PERIOD + (0.003 if n % 2 else 0.0) for n in range(2000)]
    assert play(arrivals, 16.0) == []


def test_a_feed_that_becomes_fast_again_is_filled_no_more():
    slow = [n * 0.03 for n in range(100)]
    fast = [slow[-1] + n * PERIOD for n in range(1, 1000)]
    repeats = play(slow + fast, fast[-1])
    assert repeats and max(repeats) < slow[-1] + 20 * PERIOD


def test_after_forgetting_nothing_is_repeated_until_the_feed_is_known_again():
    repeater = StateRepeater(PERIOD)
    for n in range(10):
        repeater.arrived(n * 0.03)
    assert repeater.next_repeat() is not None
    repeater.forget()
    assert repeater.next_repeat() is None
    repeater.arrived(1.0)
    assert repeater.next_repeat() is None
