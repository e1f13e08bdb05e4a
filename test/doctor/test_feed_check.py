"""The doctor's check of a status feed, on samples of feeds that died, stood still or hardly began."""
from types import SimpleNamespace

import pytest

from jaka_ros_driver.doctor.controller import feed
from jaka_ros_driver.doctor.findings import Level
from jaka_ros_driver.doctor.questions import FeedSample

PERIOD_S = 0.008


def look(count, seconds=1.5, was_closed=False):
    """Return what the check says of so many states, from the begin of listening on."""
    states = [SimpleNamespace(received_at=100.0 + PERIOD_S * number) for number in range(count)]
    sample = FeedSample(None, states, 0, {}, seconds, was_closed, 100.0 + seconds)
    config = SimpleNamespace(ip="10.0.0.1", status_port=10000, publish_rate=125.0)
    return feed(SimpleNamespace(has_controller=True, feed=sample, config=config))


def test_a_feed_that_comes_to_the_end_is_good():
    assert look(188).level is Level.OK


def test_a_feed_whose_port_was_closed_is_a_fault():
    found = look(60, seconds=0.5, was_closed=True)
    assert found.level is Level.FAULT and "closed" in found.found


@pytest.mark.parametrize("count", [2, 60])
def test_a_feed_that_stands_still_at_the_end_is_a_warning(count):
    found = look(count)
    assert found.level is Level.WARNING and "longest pause 1." in found.found


def test_a_single_state_is_a_fault():
    found = look(1)
    assert found.level is Level.FAULT and "1 states" in found.found
