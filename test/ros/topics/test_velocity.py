"""Joint velocity from positions: right on straight lines, blind to jitter, silent across gaps."""
import math
import random

import pytest

from jaka_ros_driver.ros.topics.velocity import VelocityEstimate
from jaka_ros_driver.state import RobotState


def estimates(path, arrivals):
    estimate, found = VelocityEstimate(), []
    for t, at in arrivals:
        estimate.add(RobotState(path(t), True, True, True, False, False, received_at=at))
        found.append(estimate.value())
    return found


def line(t):
    return tuple(0.1 * (joint + 1) * t for joint in range(6))


def test_a_straight_line_has_its_slope_also_when_arrivals_jitter():
    noise = random.Random(1)
    arrivals = [(n * 0.008, n * 0.008 + noise.uniform(0.0, 0.003)) for n in range(200)]
    found = estimates(line, arrivals)
    assert found[:7] == [None] * 7
    assert all(v == pytest.approx([0.1 * (j + 1) for j in range(6)], rel=0.05) for v in found[60:])


def test_rest_is_exactly_zero():
    found = estimates(lambda t: (math.pi / 2,) * 6, [(n * 0.008, n * 0.008) for n in range(20)])
    assert found[-1] == (0.0,) * 6


def test_frames_that_arrive_in_one_piece_do_not_look_like_speed():
    arrivals = [(n * 0.008, n * 0.008) for n in range(100)]
    arrivals += [(n * 0.008, 105 * 0.008 + n * 1e-6) for n in range(100, 106)]
    assert estimates(line, arrivals)[-1] == pytest.approx([0.1 * (j + 1) for j in range(6)], rel=0.05)


def test_a_slow_feed_is_understood():
    assert estimates(line, [(n * 0.03, n * 0.03) for n in range(40)])[-1] == pytest.approx(
        [0.1 * (j + 1) for j in range(6)])


def test_nothing_is_said_right_after_a_gap():
    arrivals = [(n * 0.008, n * 0.008) for n in range(50)] + [(5.0 + n * 0.008, 5.0 + n * 0.008) for n in range(10)]
    found = estimates(line, arrivals)
    assert found[50:57] == [None] * 7 and found[58] == pytest.approx([0.1 * (j + 1) for j in range(6)])
