"""A slow feed is filled up to the full rate; a feed at the full rate gets no message more, however it jitters."""
import random

import pytest

from jaka_ros_driver.ros.topics.state_repeater import StateRepeater, StateThinner

PERIOD = 0.008


def play(arrivals, until):
    """Return times of (arrivals, repeats), the repeater driven as its thread drives it."""
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


@pytest.mark.parametrize("rate", [10.0, 20.0, 33.3, 62.5, 100.0, 115.0, 117.0])
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
@pytest.mark.parametrize("late", [0.0, 0.0003])
def test_a_stall_of_a_healthy_feed_is_not_filled(hole, is_caught_up, late):
    before = [n * PERIOD for n in range(500)]
    end = (500 + hole) * PERIOD
    burst = [end + n * 1e-6 for n in range(hole)] if is_caught_up else []
    after = [end + n * PERIOD + (n + 1) % 2 * late for n in range(1, 500)]
    assert play(before + burst + after, after[-1]) == []


@pytest.mark.parametrize("first", [0.012, 0.05])
def test_one_long_interval_at_the_beginning_is_not_a_slow_feed(first):
    arrivals = [0.0, first] + [first + 0.0095 + n * 0.0078 for n in range(500)]
    assert play(arrivals, arrivals[-1]) == []


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


def taken(thinner, arrivals):
    return [arrival for arrival in arrivals if thinner.takes(arrival)]


@pytest.mark.parametrize("feed_rate, rate", [(125.0, 125.0), (100.0, 125.0), (125.0, 500.0)])
def test_of_a_feed_that_is_no_faster_than_wanted_every_sample_is_published(feed_rate, rate):
    arrivals = [n / feed_rate for n in range(500)]
    assert taken(StateThinner(1.0 / rate, 1.0 / feed_rate), arrivals) == arrivals


@pytest.mark.parametrize("rate", [1.0, 10.0, 30.0, 60.0, 100.0])
@pytest.mark.parametrize("jitter", [0.0, 0.0015])
def test_a_faster_feed_is_thinned_to_the_wanted_rate(rate, jitter):
    noise = random.Random(4)
    arrivals = sorted(n * PERIOD + noise.uniform(0.0, jitter) for n in range(2500))
    published = taken(StateThinner(1.0 / rate, PERIOD), arrivals)
    assert len(published) == pytest.approx(20.0 * rate, rel=0.02, abs=1.0)
    if rate < 50.0:
        assert min(b - a for a, b in zip(published, published[1:])) > 0.5 / rate


def test_after_a_gap_a_thinned_feed_makes_up_for_nothing():
    thinner = StateThinner(0.1, PERIOD)
    assert len(taken(thinner, [n * PERIOD for n in range(250)])) in (20, 21)
    after = taken(thinner, [10.0 + n * PERIOD for n in range(250)])
    assert after[0] == 10.0 and min(b - a for a, b in zip(after, after[1:])) > 0.05
