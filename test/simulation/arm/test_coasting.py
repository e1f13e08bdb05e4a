import pytest
from hypothesis import given
from hypothesis import strategies as st
from plant_watch import ZU7

from jaka_ros_driver.simulation.arm.coasting import Coast
from jaka_ros_driver.simulation.arm.plant import HOME

DT = 0.008


@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_comes_to_rest_where_it_said_within_the_acceleration_limits(velocity):
    coast = Coast(ZU7, HOME, velocity)
    positions = [HOME]
    while not coast.is_done:
        positions.append(coast.step(DT))
    assert positions[-1] == coast.end_joints or not any(velocity)
    speeds = [tuple(velocity)] + [tuple((b - a) / DT for a, b in zip(p, q)) for p, q in zip(positions, positions[1:])]
    for before, after in zip(speeds, speeds[1:]):
        assert all(abs(v) <= abs(u) + 1e-9 for u, v in zip(before, after))
        assert all(abs(v - u) / DT <= limit * 1.001 for u, v, limit in zip(before, after, ZU7.joint_max_acceleration))


def test_brakes_harder_before_a_soft_limit():
    high = ZU7.joint_limits[1][1]
    coast = Coast(ZU7, (0.0, high - 0.01, 0.0, 0.0, 0.0, 0.0), (0.0, 3.0, 0.0, 0.0, 0.0, 0.0))
    assert coast.end_joints[1] == pytest.approx(high, abs=1e-12)
    while not coast.is_done:
        assert coast.step(DT)[1] <= high + 1e-12


def test_without_speed_it_is_done_at_once():
    coast = Coast(ZU7, HOME, (0.0,) * 6)
    assert coast.is_done
    assert coast.end_joints == HOME
