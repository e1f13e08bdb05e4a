"""Distances between segments against a search that knows nothing of them."""
import random

import pytest

from jaka_ros_driver.clearance.distances import lowest_on_segment, segment_distance


def searched(p1, q1, p2, q2):
    """Return the distance of two segments by minimising over one parameter after the other, 4,000 times."""
    s = t = 0.5
    u, v, w = ([b - a for a, b in zip(p, q)] for p, q in ((p1, q1), (p2, q2), (p2, p1)))

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b))
    for _ in range(4000):
        s = min(1.0, max(0.0, (t * dot(u, v) - dot(u, w)) / dot(u, u))) if dot(u, u) else 0.0
        t = min(1.0, max(0.0, (s * dot(u, v) + dot(v, w)) / dot(v, v))) if dot(v, v) else 0.0
    return sum((c + s * a - t * b) ** 2 for a, b, c in zip(u, v, w)) ** 0.5


def random_point(rng):
    return tuple(rng.uniform(-1.0, 1.0) for _ in range(3))


def test_random_segments():
    rng = random.Random(1)
    for _ in range(100):
        points = [random_point(rng) for _ in range(4)]
        assert segment_distance(*points) == pytest.approx(searched(*points), abs=1e-7)


@pytest.mark.parametrize("points, expected", [
    (((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)), 1.0),          # parallel
    (((0, 0, 0), (1, 0, 0), (3, 0, 0), (2, 0, 0)), 1.0),          # in one line
    (((0, 0, 0), (1, 0, 0), (0.5, -1, 0), (0.5, 1, 0)), 0.0),     # crossing
    (((0, 0, 0), (0, 0, 0), (1, -1, 0), (1, 1, 0)), 1.0),         # a point and a segment
    (((1, -1, 0), (1, 1, 0), (0, 5, 0), (0, 5, 0)), 17 ** 0.5),   # a segment and a point
    (((0, 0, 0), (0, 0, 0), (0, 0, 2), (0, 0, 2)), 2.0),          # two points
    (((0, 0, 0), (1, 0, 0), (2, 1, 0), (2, 2, 0)), 2 ** 0.5),     # end to end
])
def test_segments_in_special_places(points, expected):
    p1, q1, p2, q2 = points
    for first in ((p1, q1), (q1, p1)):
        for second in ((p2, q2), (q2, p2)):
            assert segment_distance(*first, *second) == pytest.approx(expected, abs=1e-12)
            assert segment_distance(*second, *first) == pytest.approx(expected, abs=1e-12)


def test_the_lowest_value_on_a_segment_is_found_inside_and_at_its_ends():
    def ball(x, y, z):
        return (x * x + y * y + z * z) ** 0.5 - 0.5
    assert lowest_on_segment(ball, (-1.0, 1.0, 0.0), (2.0, 1.0, 0.0)) == pytest.approx(0.5, abs=1e-12)
    assert lowest_on_segment(ball, (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)) == pytest.approx(0.5, abs=1e-12)
    assert lowest_on_segment(ball, (2.0, 0.0, 0.0), (1.0, 0.0, 0.0)) == pytest.approx(0.5, abs=1e-12)
    assert lowest_on_segment(ball, (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)) == pytest.approx(0.5, abs=1e-12)
