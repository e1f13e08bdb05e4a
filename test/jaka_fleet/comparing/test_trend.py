"""Slopes with their uncertainty, and the run from which on an amount changes."""
import numpy as np
import pytest

from jaka_fleet.comparing.trend import find_change, noise_of, theil_sen, without_outliers

NOISE = 1e-5


def noise(seed, count=200):
    return np.random.RandomState(seed).normal(0.0, NOISE, count)


def ramp(count, first, step):
    return step * np.maximum(0, np.arange(count) - first + 1)


@pytest.mark.parametrize("count", [30, 200, 3000])
def test_the_slope_is_found_beside_wild_values_and_its_interval_holds_it(count):
    x = np.arange(count, dtype=float)
    inside = 0
    for seed in range(8):
        y = 3e-7 * x + noise(seed, count)
        random = np.random.RandomState(seed)
        y += np.where(random.uniform(size=count) < 0.1, 0.01, 0.0) * random.normal(size=count)
        slope = theil_sen(x, y)
        assert slope.low <= slope.value <= slope.high
        assert slope.value == pytest.approx(3e-7, abs=6e-5 / count)
        inside += slope.low <= 3e-7 <= slope.high
    assert inside >= 5


def test_the_interval_of_a_flat_line_holds_zero_mostly():
    x = np.arange(100, dtype=float)
    sure = sum(theil_sen(x, noise(seed, 100)).is_sure for seed in range(100))
    assert sure <= 12


def test_too_few_points_have_no_slope_and_no_change():
    assert theil_sen(np.arange(3.0), np.arange(3.0)) is None
    assert theil_sen(np.zeros(6), np.arange(6.0)) is None
    assert find_change(np.arange(7.0)) is None


@pytest.mark.parametrize("step", [2e-5, 5e-5, 2e-4])
@pytest.mark.parametrize("first", [20, 120, 180])
def test_a_ramp_is_found_within_five_runs(step, first):
    for seed in range(5):
        change = find_change(8e-5 + noise(seed) + ramp(200, first, step))
        assert change.is_gradual and abs(change.first - first) <= 5
        assert change.size == pytest.approx(step * (200 - first), rel=0.1, abs=5e-5)


@pytest.mark.parametrize("first", [5, 100, 190])
def test_a_jump_is_told_from_a_ramp(first):
    for seed in range(5):
        change = find_change(8e-5 + noise(seed) + 3e-4 * (np.arange(200) >= first))
        assert not change.is_gradual and abs(change.first - first) <= 1
        assert change.before == pytest.approx(8e-5, abs=2e-5)


def test_noise_single_wild_runs_and_small_changes_are_no_drift():
    for seed in range(20):
        values = 8e-5 + noise(seed)
        values[[7, 90, 91, 150]] += 0.02
        assert find_change(values, 1e-4) is None
        assert find_change(8e-5 + noise(seed) + ramp(200, 100, 5e-7), 1e-4) is None
    assert find_change(np.full(50, 3.2)) is None


def test_wild_values_are_replaced_and_ramps_are_not():
    values = ramp(60, 30, 1e-4) + noise(3, 60)
    wild = values.copy()
    wild[[10, 45]] = 1.0
    assert np.abs(without_outliers(wild) - values).max() < 5e-4
    assert np.abs(without_outliers(values) - values).max() < 1e-4
    assert noise_of(noise(4, 2000)) == pytest.approx(NOISE, rel=0.1)
