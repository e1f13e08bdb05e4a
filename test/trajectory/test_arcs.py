"""The circle through three places, wherever it lies: its way, its length, and when there is none."""
import math
import random

import pytest

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy
from jaka_ros_driver.trajectory.segments import circle_through


def on_circle(rng, radius, *angles):
    """Return points at these angles of a circle that lies anywhere."""
    m = matrix_from_rpy([rng.uniform(-math.pi, math.pi) for _ in range(3)])
    centre = [rng.uniform(-0.5, 0.5) for _ in range(3)]
    return [tuple(c + radius * (math.cos(angle) * m[3 * k] + math.sin(angle) * m[3 * k + 1])
                  for k, c in enumerate(centre)) for angle in angles]


@pytest.mark.parametrize("via, end", [(0.5, 1.0), (1.0, 3.0), (0.3, 5.5), (2.0, 2.2)])
def test_an_arc_leads_from_start_to_end_by_the_place_between_them(via, end):
    rng = random.Random(4)
    for _ in range(20):
        start, between, last, half = on_circle(rng, 0.2, 0.0, via, end, 0.5 * end)
        circle = circle_through(start, between, last)
        assert circle.radius == pytest.approx(0.2) and circle.sweep == pytest.approx(end)
        for share, place in ((0.0, start), (via / end, between), (0.5, half), (1.0, last)):
            assert circle.at(share) == pytest.approx(place, abs=1e-9)


def test_there_is_no_circle_through_places_on_a_line():
    with pytest.raises(InvalidCommand):
        circle_through((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (0.2, 0.2, 0.2))
