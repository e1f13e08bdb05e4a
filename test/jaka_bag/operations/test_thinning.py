"""Curves, paths and quantiles of samples that come piece by piece: the same whatever the pieces, and never more."""
import numpy as np
import pytest

from jaka_bag.operations import quantiles
from jaka_bag.operations.quantiles import Quantiles
from jaka_bag.operations.thinning import Changes, EveryNth, MinMax

COUNTS = [0, 1, 5, 100, 101, 5000, 60001]


def fed(thinner, pieces, *columns):
    for part in np.array_split(np.arange(len(columns[0])), pieces):
        thinner.add(*[column[part] for column in columns])
    return thinner


@pytest.mark.parametrize("count", COUNTS)
def test_no_spike_is_lost_and_the_pieces_do_not_matter(count):
    random = np.random.RandomState(count)
    time, values = np.arange(count) * 0.1, random.normal(size=count)
    if count > 1000:
        values[count // 3], values[count // 2], values[17] = 50.0, -50.0, np.nan
    curves = [fed(MinMax(100), pieces, time, values).points() for pieces in (1, 3, 40)]
    for curve in curves[1:]:
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(curve, curves[0]))
    assert len(curves[0][0]) <= 104
    if count <= 100:
        assert np.array_equal(curves[0][1], values)
    else:
        assert np.nanmax(curves[0][1]) == np.nanmax(values) and np.nanmin(curves[0][1]) == np.nanmin(values)
        assert (curves[0][0][0], curves[0][0][-1]) == (time[0], time[-1]) and (np.diff(curves[0][0]) > 0).all()


@pytest.mark.parametrize("count", COUNTS[1:])
def test_rows_are_kept_evenly_and_the_last_one_always(count):
    rows = np.arange(2.0 * count).reshape(count, 2)
    kept = [fed(EveryNth(50), pieces, rows).rows() for pieces in (1, 3, 40)]
    assert np.array_equal(kept[0], kept[1]) and np.array_equal(kept[0], kept[2])
    assert len(kept[0]) <= 51 and kept[0][-1].tolist() == rows[-1].tolist()
    steps = np.diff(kept[0][:-1, 0])
    assert len(steps) < 2 or len(set(steps.tolist())) == 1


@pytest.mark.parametrize("count", COUNTS[1:])
def test_changes_are_the_first_and_last_sample_of_each_run(count):
    time, values = np.arange(count) * 1.0, np.random.RandomState(count).randint(0, 2, count) * (np.arange(count) > 30)
    differs = np.flatnonzero(np.diff(values))
    expected = np.unique(np.concatenate([[0], differs, differs + 1, [count - 1]]))
    for pieces in (1, 3, 40):
        found, levels = fed(Changes(1 << 20), pieces, time, values).points()
        assert found.tolist() == expected.tolist() and levels.tolist() == values[expected].tolist()


@pytest.mark.parametrize("spread", [0.01, 1.0, 20.0])
def test_classes_are_counted_as_by_sorting_all(spread):
    random = np.random.RandomState(3)
    values = 0.008 * np.exp(spread * random.normal(size=60000))
    values[random.randint(0, len(values), 900)] = 0.0
    values[random.randint(0, len(values), 900)] *= -1.0
    many = fed(Quantiles(1000), 40, values)
    many.median()
    classes, counts = np.unique(quantiles._classes_of(values), return_counts=True)
    assert many._classes.tolist() == classes.tolist() and many._counts.tolist() == counts.tolist()


@pytest.mark.parametrize("scale", [1e-6, 1.0, -3.0])
def test_quantiles_of_many_values_are_near_those_of_all(scale):
    values = scale * np.abs(np.random.RandomState(1).normal(8.0, 0.5, 50000))
    values[:100] *= -1.0
    few, many = fed(Quantiles(), 1, values), fed(Quantiles(1000), 30, values)
    assert few.count == many.count == len(values)
    assert few.median() == np.median(values) and few.percentiles([10, 99]) == np.percentile(values, [10, 99]).tolist()
    assert many.median() == pytest.approx(few.median(), rel=2e-4)
    assert many.percentiles([10, 50, 90, 99]) == pytest.approx(few.percentiles([10, 50, 90, 99]), rel=2e-4)
    centre = few.median()
    assert many.distance(centre, 0.99) == pytest.approx(few.distance(centre, 0.99), rel=2e-3)
    assert many.distances(centre).percentiles([99]) == pytest.approx(few.distances(centre).percentiles([99]), rel=2e-3)
    assert many.above(centre)[1].sum() == pytest.approx(few.above(centre)[1].sum(), rel=0.01)
    assert many.total == pytest.approx(few.total)
