"""The plain numbers of the field, and the comparison of a fit with them."""

import numpy as np
import pytest
from deadtime.logs import Series
from deadtime.logs.latencies import differences, modelled, plain_times
from deadtime.logs.latencies._correlation import correlation_of, grid_of
from deadtime.loops import FactoredPlant
from marks import NIGHTLY
from scipy.ndimage import gaussian_filter1d

DELAY, LAG = 0.05, 0.04


def flown(seed, rate=50.0, seconds=60.0, noise=0.1, lag=LAG, delay=DELAY, uneven=0.4):
    """Sticks that wander, the response of one lag, both at uneven stamps of their own."""
    random = np.random.default_rng(seed)
    fine = np.arange(0.0, seconds, 2e-3)
    asked = gaussian_filter1d(random.standard_normal(fine.size), 0.08 / 2e-3)
    asked /= asked.std()
    stamps = []
    for _ in range(2):
        time = np.arange(0.5, seconds - 0.5, 1.0 / rate)
        stamps.append(time + uneven / rate * random.uniform(-0.5, 0.5, time.size))
    exact = Series(fine, asked, "rad", "asked")
    came = modelled(
        FactoredPlant([lag]), delay, exact,
        Series(stamps[1], stamps[1], "rad", "came"), [(0.0, seconds)], "straight",
    )  # fmt: skip
    # Air is slow against the rows.
    air = gaussian_filter1d(random.standard_normal(fine.size), 0.1 / 2e-3)
    air *= noise / air.std()
    values = came.values + np.interp(stamps[1], fine, air)
    told = Series(stamps[0], np.interp(stamps[0], fine, asked), "rad", "asked")
    return told, Series(stamps[1], values, "rad", "came"), [(1.0, 25.0), (27.0, seconds - 1.0)]


def plain(told, came, segments, **given):
    return plain_times(told, came, segments, longest=0.6, between="straight", **given)


def test_a_pure_delay_is_found_by_all_three():
    told, came, segments = flown(1, noise=0.01, lag=0.0005, delay=0.08)
    found = plain(told, came, segments)
    for one in found.all:
        assert one.value == pytest.approx(0.08, abs=0.004)
        low, high = one.interval
        assert low - 0.003 < 0.0805 < high + 0.003
    assert found.correlation.quality > 0.98


def test_the_step_is_half_way_after_delay_and_most_of_the_lag():
    told, came, segments = flown(2, noise=0.01, lag=0.08)
    found = plain(told, came, segments)
    # The setpoint has little power above 2 Hz, which smooths the step.
    assert found.step.value == pytest.approx(DELAY + 0.08 * np.log(2.0), abs=0.012)
    assert DELAY + 0.06 < found.correlation.value < DELAY + 0.08


def test_the_coefficient_is_that_of_the_rows_that_are_in_segments():
    told, came, segments = flown(3)
    grid = grid_of(told, came, segments, False)
    found = correlation_of(grid, 0.6)
    lag = 8
    k = int(np.argmin(np.abs(found.lags - lag * grid.step)))
    pairs = [(p.asked[: p.asked.size - lag], p.response[lag:]) for p in grid.pieces]
    wanted = np.corrcoef(*(np.concatenate(side) for side in zip(*pairs, strict=True)))[0, 1]
    assert found.coefficient[k] == pytest.approx(wanted, abs=1e-9)
    # Without a block: the first segment begins later.
    assert found.without.shape == (12, found.lags.size)


@pytest.mark.parametrize(("flights", "least"), [(8, 0.75), pytest.param(60, 0.87, marks=NIGHTLY)])
def test_intervals_hold_the_number_of_the_fit_as_often_as_they_say(flights, least):
    held = {"cross-correlation": [], "deconvolved step": [], "moves": []}
    for seed in range(flights):
        told, came, segments = flown(100 + seed, noise=0.3)
        found = plain(told, came, segments)
        right = modelled(FactoredPlant([LAG]), DELAY, told, came, segments, "straight")
        beside = plain(told, right, segments, moves=found.aligned.moves)
        for one in differences(found, beside):
            held[one.name].append(not one.disagrees)
    for name, some in held.items():
        assert len(some) > 0.8 * flights, name
        assert np.mean(some) >= least, name


def test_a_wrong_fit_disagrees():
    told, came, segments = flown(5, noise=0.1)
    found = plain(told, came, segments)
    late = modelled(FactoredPlant([LAG]), DELAY + 0.03, told, came, segments, "straight")
    beside = plain(told, late, segments, moves=found.aligned.moves)
    compared = {one.name: one for one in differences(found, beside)}
    assert compared["cross-correlation"].disagrees
    assert compared["deconvolved step"].disagrees
    assert compared["moves"].disagrees
    for one in compared.values():
        assert one.modelled - one.measured == pytest.approx(0.03, abs=0.015)


@pytest.mark.parametrize("flights", [4, pytest.param(20, marks=NIGHTLY)])
def test_signals_without_relation_have_no_number_but_a_reason(flights):
    none = 0
    for seed in range(flights):
        told, _, segments = flown(seed)
        _, other, _ = flown(1000 + seed)
        found = plain(told, other, segments)
        none += np.isnan(found.correlation.value)
        if np.isnan(found.correlation.value):
            assert found.correlation.reason
            assert "none" in found.correlation.line()
    assert none >= 0.9 * flights


def test_a_setpoint_at_rest_tells_nothing():
    time = np.arange(0.0, 30.0, 0.02)
    told = Series(time, np.zeros(time.size), "rad", "asked")
    came = Series(time, np.random.default_rng(1).standard_normal(time.size), "rad", "came")
    for one in plain(told, came, [(0.0, 29.0)]).all:
        assert np.isnan(one.value)
        assert one.reason


def test_one_sine_tells_no_step():
    time = np.arange(0.0, 60.0, 0.02)
    told = Series(time, np.sin(4.0 * time), "rad", "asked")
    came = Series(time, np.sin(4.0 * (time - 0.1)), "rad", "came")
    found = plain(told, came, [(0.0, 59.0)])
    assert "rises over" in found.step.reason
    assert found.moves.value == pytest.approx(0.1, abs=0.01)


def test_a_setpoint_that_holds_is_read_as_one():
    random = np.random.default_rng(4)
    time = np.arange(0.0, 60.0, 0.1)
    told = Series(time, np.repeat(random.standard_normal(60), 10), "m", "asked")
    rows = np.arange(0.0, 59.9, 0.01)
    late = told.values[np.maximum(np.searchsorted(time, rows - 0.25 + 1e-9, "right") - 1, 0)]
    came = Series(rows, late, "m", "came")
    found = plain_times(told, came, [(0.0, 59.0)], longest=1.0, between="held")
    for one in found.all:
        assert one.value == pytest.approx(0.25, abs=0.012)


def test_a_short_record_has_no_interval():
    told, came, _ = flown(7)
    found = plain(told, came, [(2.0, 5.0)])
    for one in found.all:
        assert np.isnan(one.interval).all()
        assert one.reason
