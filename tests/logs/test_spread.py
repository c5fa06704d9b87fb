"""Times of windows together: closed forms, published numbers, and coverage."""

import numpy as np
import pytest
from deadtime.logs.latencies import spread_of
from scipy import stats


def test_with_equal_errors_mean_and_interval_are_those_of_the_t_test():
    times = np.array([0.10, 0.12, 0.11, 0.13, 0.095])
    found = spread_of(times, np.full(5, 0.004))
    assert found.mean == pytest.approx(times.mean())
    variance = times.var(ddof=1)
    assert found.between**2 == pytest.approx(variance - 0.004**2)
    half = stats.t.ppf(0.975, 4) * np.sqrt(variance / 5)
    assert found.interval == pytest.approx((times.mean() - half, times.mean() + half))


def test_windows_that_agree_by_chance_get_no_narrower_interval():
    found = spread_of([0.1, 0.1, 0.1], [0.01, 0.01, 0.01])
    assert found.between == 0.0
    assert found.heterogeneity == 0.0
    assert found.p_value == pytest.approx(1.0)
    half = stats.t.ppf(0.975, 2) * 0.01 / np.sqrt(3.0)
    assert found.interval[1] - found.mean == pytest.approx(half)


def test_the_variance_between_windows_is_that_of_dersimonian_and_laird():
    times = np.array([0.095, 0.277, 0.367, 0.664, 0.462, 0.185])
    errors = np.sqrt([0.033, 0.031, 0.050, 0.011, 0.043, 0.023])
    found = spread_of(times, errors)
    weights = errors**-2.0
    fixed = weights @ times / weights.sum()
    left = weights @ (times - fixed) ** 2
    between = (left - 5.0) / (weights.sum() - weights @ weights / weights.sum())
    assert found.between**2 == pytest.approx(between)
    assert found.heterogeneity == pytest.approx(1.0 - 5.0 / left)
    assert found.p_value == pytest.approx(stats.chi2.sf(left, 5))
    random = 1.0 / (errors**2 + between)
    assert found.mean == pytest.approx(random @ times / random.sum())
    # The published example of these six, whose variances are rounded here: 0.3582, 0.0373.
    assert found.mean == pytest.approx(0.358, abs=0.003)
    assert between == pytest.approx(0.037, abs=0.002)


@pytest.mark.parametrize("count", [3, 5, 12])
@pytest.mark.parametrize("between", [0.0, 0.01, 0.04])
def test_the_intervals_hold_as_often_as_they_say(count, between):
    random = np.random.default_rng(count)
    held = []
    for _ in range(600):
        errors = random.uniform(0.005, 0.02, count)
        truth = 0.2 + between * random.standard_normal(count)
        found = spread_of(truth + errors * random.standard_normal(count), errors)
        held.append(found.interval[0] < 0.2 < found.interval[1])
    assert np.mean(held) > 0.92


def test_a_vehicle_that_takes_longer_when_it_moves_less_shows_as_a_slope():
    random = np.random.default_rng(2)
    held, signs, widths = [], [], []
    for _ in range(400):
        sizes = random.uniform(0.1, 1.0, 8)
        errors = random.uniform(0.003, 0.01, 8)
        times = 0.1 - 0.03 * np.log(sizes) + 0.004 * random.standard_normal(8)
        found = spread_of(times + errors * random.standard_normal(8), errors, sizes)
        low, high = found.slope_interval
        held.append(low < -0.03 < high)
        signs.append(high < 0.0)
        widths.append("longer if the command moves half as much" in found.line())
    assert np.mean(held) > 0.92
    assert np.mean(signs) > 0.9
    assert widths == signs


def test_no_slope_is_seen_where_there_is_none():
    random = np.random.default_rng(7)
    seen = []
    for _ in range(400):
        sizes = random.uniform(0.1, 1.0, 6)
        times = 0.1 + 0.01 * random.standard_normal(6)
        low, high = spread_of(times, np.full(6, 0.008), sizes).slope_interval
        seen.append(low > 0.0 or high < 0.0)
    assert np.mean(seen) < 0.08


@pytest.mark.parametrize("sizes", [None, [0.3] * 5, [0.3, 0.6, np.nan, np.nan, np.nan]])
def test_a_slope_needs_sizes_that_differ(sizes):
    found = spread_of([0.1, 0.12, 0.11, 0.1, 0.13], [0.01] * 5, sizes)
    assert np.isnan(found.slope)
    assert np.isfinite(found.interval).all()


def test_one_window_tells_no_spread_and_none_nothing():
    found = spread_of([0.1], [0.01])
    assert (found.count, found.mean, found.stderr) == (1, 0.1, 0.01)
    assert np.isnan(found.interval).all()
    assert "too few" in found.line()
    assert spread_of([], []).count == 0
    assert spread_of([0.1, np.nan, 0.2], [0.01, 0.01, np.inf]).count == 1


def test_shapes_have_to_agree():
    with pytest.raises(ValueError, match=r"shapes \(2,\), \(3,\)"):
        spread_of([0.1, 0.2], [0.1] * 3)
