"""Moves of a setpoint, aligned, and the time from half to half."""

import numpy as np
import pytest
from deadtime.logs import Series
from deadtime.logs.latencies import aligned, modelled, moves_of
from deadtime.logs.latencies._moves import median_of
from deadtime.logs.latencies._setpoint_moves import below_half
from deadtime.loops import FactoredPlant, open_response

DELAY, LAG = 0.04, 0.06

#: Half to half after a jump: delay + lag ln 2.
JUMP = DELAY + LAG * np.log(2.0)


def made(rate, seconds=60.0, noise=0.01, ramp=0.0, seed=1, jitter=0.0):
    """A setpoint that jumps, or ramps, between random levels, and the response of one lag."""
    random = np.random.default_rng(seed)
    fine = np.arange(0.0, seconds, 5e-4)
    changes = np.cumsum(random.uniform(0.8, 1.6, round(seconds)))
    changes = changes[changes < seconds - 1.0]
    levels = np.cumsum(random.choice([-1.0, 1.0], changes.size) * random.uniform(0.5, 2.0))
    corners = [0.0, *np.ravel([changes, changes + max(ramp, 1e-9)], "F"), seconds]
    values = [0.0, *np.ravel([np.r_[0.0, levels[:-1]], levels], "F"), levels[-1]]
    asked = np.interp(fine, corners, values)
    plant = FactoredPlant([LAG])
    late = round(DELAY / 5e-4)
    came = open_response(plant, plant.parameters, fine, fine, asked)
    came = np.concatenate([np.zeros(late), came[:-late]])
    time = np.arange(0.0, seconds - 0.01, 1.0 / rate)
    time = np.sort(time + jitter / rate * random.uniform(-0.5, 0.5, time.size)).clip(0.0)
    told = np.interp(time, fine, asked)
    seen = np.interp(time, fine, came) + noise * random.standard_normal(time.size)
    return (
        Series(time, told, "rad", "asked"),
        Series(time, seen, "rad", "came"),
        [(float(time[0]), float(time[-1]))],
        changes,
    )


@pytest.mark.parametrize(
    ("rate", "jitter"), [(10.0, 0.0), (25.0, 0.6), (100.0, 0.3), (1000.0, 0.0)]
)
def test_the_median_over_jumps_is_that_of_delay_and_lag_at_any_rate(rate, jitter):
    asked, came, segments, changes = made(rate, jitter=jitter)
    found = moves_of(asked, came, segments, longest=0.8, between="straight")
    assert found.count > 0.6 * changes.size
    low, high = found.interval
    # A jump is somewhere between two rows, in the middle on average.
    assert low - 0.003 < JUMP < high + 0.003
    assert high - low < 0.6 / rate + 0.01
    assert found.coverage >= 0.95
    assert np.all(np.isfinite(found.times))


def test_after_a_slow_ramp_the_time_is_delay_and_lag_together():
    asked, came, segments, _ = made(100.0, ramp=0.3, noise=0.003)
    found = moves_of(asked, came, segments, longest=0.8, between="straight")
    assert found.median == pytest.approx(DELAY + LAG, abs=0.005)


def test_each_change_of_a_staircase_is_a_move_of_its_own():
    time = np.arange(0.0, 30.0, 0.02)
    steps = np.floor(time / 1.5)
    asked = Series(time, steps, "m", "asked")
    came = Series(time, np.floor(np.maximum(time - 0.1, 0.0) / 1.5), "m", "came")
    found = moves_of(asked, came, [(0.0, 29.9)], longest=1.0, between="held")
    assert found.count >= 17
    assert found.sizes == pytest.approx(1.0)
    assert found.starts % 1.5 == pytest.approx(0.0, abs=0.021) or np.all(
        np.abs((found.starts + 0.75) % 1.5 - 0.75) < 0.021
    )
    assert found.median == pytest.approx(0.1, abs=0.011)


def test_gain_and_offset_of_the_response_do_not_move_the_time():
    asked, came, segments, _ = made(100.0, noise=0.0)
    found = moves_of(asked, came, segments, longest=0.8, between="straight")
    other = Series(came.time, 0.6 * came.values + 3.0, "rad", "other")
    beside = aligned(found.moves, asked, other)
    assert beside.times == pytest.approx(found.times, abs=1e-9)
    assert np.nanmax(beside.response) == pytest.approx(0.6, abs=0.01)
    assert np.nanmax(found.setpoint) == pytest.approx(1.0, abs=1e-6)


def test_the_response_of_the_right_plant_has_the_same_times():
    asked, came, segments, _ = made(100.0, noise=0.002)
    found = moves_of(asked, came, segments, longest=0.8, between="straight")
    fit = modelled(FactoredPlant([LAG]), DELAY, asked, came, segments, "straight")
    beside = aligned(found.moves, asked, fit)
    assert beside.median == pytest.approx(found.median, abs=0.002)
    wrong = modelled(FactoredPlant([LAG]), DELAY + 0.03, asked, came, segments, "straight")
    late = aligned(found.moves, asked, wrong)
    assert late.median - beside.median == pytest.approx(0.03, abs=0.002)


def test_the_quartiles_enclose_the_median():
    asked, came, segments, _ = made(100.0, noise=0.1)
    found = moves_of(asked, came, segments, longest=0.8, between="straight")
    known = np.isfinite(found.response)
    assert known.mean() > 0.5
    assert np.all(found.lower[known] <= found.response[known])
    assert np.all(found.upper[known] >= found.response[known])
    assert found.responses.shape == (found.count, found.time.size)


def test_a_response_that_does_not_answer_has_no_time_but_a_reason():
    asked, came, segments, _ = made(100.0)
    deaf = Series(came.time, 0.01 * np.sin(came.time), "rad", "deaf")
    found = moves_of(asked, deaf, segments, longest=0.8, between="straight")
    assert np.isnan(found.median)
    assert "follows 0" in found.reason
    assert "none" in found.headline()


def test_noise_of_the_setpoint_below_that_of_the_response_is_no_move():
    random = np.random.default_rng(3)
    time = np.arange(0.0, 20.0, 0.01)
    asked = Series(time, 0.01 * np.repeat(random.standard_normal(20), 100), "rad", "asked")
    came = Series(time, 0.05 * random.standard_normal(time.size), "rad", "came")
    found = moves_of(asked, came, [(0.0, 19.9)], longest=0.8, between="held")
    assert found.count == 0
    assert found.reason
    assert np.isnan(found.median)


def test_moves_lie_inside_of_the_segments():
    asked, came, _, _ = made(100.0)
    segments = [(5.0, 20.0), (30.0, 50.0)]
    found = moves_of(asked, came, segments, longest=0.8, between="straight")
    assert found.count > 15
    assert all(any(low <= at <= high for low, high in segments) for at in found.starts)


@pytest.mark.parametrize(
    ("n", "k", "coverage"), [(6, 1, 0.96875), (10, 2, 0.9785156), (20, 6, 0.9586105)]
)
def test_the_interval_of_the_median_is_that_of_the_sign_test(n, k, coverage):
    # Tables of the sign test: Conover 1999, section 3.4.
    times = np.random.default_rng(n).permutation(np.arange(1.0, n + 1.0))
    median, interval, covered = median_of(times)
    assert median == pytest.approx(0.5 * (n + 1))
    assert interval == (k, n + 1 - k)
    assert covered == pytest.approx(coverage, abs=1e-6)


def test_the_interval_of_the_median_holds_it_as_often_as_it_says():
    random = np.random.default_rng(11)
    found = [median_of(random.exponential(1.0, 15)) for _ in range(2000)]
    held = np.mean([low < np.log(2.0) < high for _, (low, high), _ in found])
    assert held == pytest.approx(found[0][2], abs=0.015)


def test_few_moves_have_no_interval():
    median, interval, coverage = median_of(np.arange(5.0))
    assert median == 2.0
    assert np.isnan(interval).all()
    assert np.isnan(coverage)


def test_the_time_below_half_is_the_crossing_where_there_is_one():
    time = np.array([0.0, 0.1, 0.3, 0.4])
    assert below_half(time, np.array([0.0, 0.25, 0.75, 1.0])) == pytest.approx(0.2)
    assert below_half(time, np.array([0.0, 0.25, 0.75, 1.0]), held=True) == pytest.approx(0.3)
    # Back below half for as long as it was above: each counts.
    noisy = np.array([0.0, 1.0, 0.0, 1.0])
    assert below_half(time, noisy) == pytest.approx(0.05 + 0.1 + 0.05)
