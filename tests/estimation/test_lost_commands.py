"""Commands in missing rows follow from the plant that is fitted, and tell of it."""

import sys
from dataclasses import replace
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation._least_squares import whiteness_of
from deadtime.estimation._native import LEVEL_OF_TESTS

sys.path.append(str(Path(__file__).resolve().parents[2] / "benches"))

from reality import table
from reality.bound import bounds
from reality.conditions import CONDITIONS
from reality.generator import record

NAMED = {condition.name: condition for condition in CONDITIONS}


def estimate(name, number):
    condition = NAMED[name]
    run = record(condition, number)
    recording = table.recording_of(condition, run)
    loop = table.given_loop(condition, run, condition.free)
    return run, dtm.estimate_delay(recording, loop, free=condition.free)


@pytest.mark.parametrize("number", range(4))
def test_a_hole_in_the_rise_costs_no_more_than_the_bound_says(number):
    # With the mean command in the hole unknown, run 0 was 10 bounds away.
    run, fit = estimate("hole of 1 s", number)
    least, _ = bounds(NAMED["hole of 1 s"], run, ("delay", "gain"))
    assert abs(fit.delay - run.vehicle.delay) < 3.5 * least
    assert fit.stderr["delay"] < 3.0 * least
    low, high = fit.ci(0.95)
    assert low < fit.delay < high


# Of 522 and 203 the whole answer lies in the hole; 40 was predicted from two noisy rows before it;
# in 360 the nearest maximum of the likelihood was 60 ms away from the highest.
@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("hole of 1 s", 203),
        ("hole of 1 s", 522),
        pytest.param("hole of 1 s", 40, marks=pytest.mark.survey),
        pytest.param("rows lost 20 %", 360, marks=pytest.mark.survey),
    ],
)
def test_the_highest_of_several_maxima_is_found(name, number):
    run, fit = estimate(name, number)
    least, _ = bounds(NAMED[name], run, ("delay", "gain"))
    low, high = fit.ci(0.95)
    assert low < run.vehicle.delay < high
    assert abs(fit.delay - run.vehicle.delay) < 5.0 * least


@pytest.mark.survey
def test_a_lag_near_zero_beside_a_hole_is_estimated():
    # A step of the curvature leads below zero, where the likelihood has no finite value.
    condition = replace(NAMED["lag free white"], name="hole, lag free", hole=1.0)
    run = record(condition, 21)
    recording = table.recording_of(condition, run)
    loop = table.given_loop(condition, run, condition.free)
    fit = dtm.estimate_delay(recording, loop, free=condition.free)
    low, high = fit.ci(0.95, "delay+lag")
    assert low < run.vehicle.delay + sum(run.vehicle.lags) < high


@pytest.mark.survey
def test_the_reference_may_change_in_any_of_many_missing_rows():
    # Five rows are missing around the step, which begins in the fourth of them.
    run, fit = estimate("rows lost 20 %", 118)
    assert abs(fit.delay - run.vehicle.delay) < 0.01


# In 239 commands were predicted whose errors came out a thousand times too large, and the wrong
# sample was taken for that of the step: 346 ms for 296, reliable. In 3, 66 and 205 predictions
# depend on each other through a controller of high gain, and did not settle.
@pytest.mark.parametrize("number", [0, 3, 66, 205, 239])
def test_a_log_at_half_the_rate_of_the_controller(number):
    run, fit = estimate("half rate", number)
    least, _ = bounds(NAMED["half rate"], run, ("delay", "gain"))
    assert abs(fit.delay - run.vehicle.delay) < 3.5 * least
    assert 0.5 * least < fit.stderr["delay"] < 2.5 * least


@pytest.mark.parametrize("rows", [60, 120, 300])
def test_white_residuals_are_called_coloured_as_often_as_the_level_says(rows):
    random = np.random.default_rng(0)
    runs = 3000
    coloured = sum(not whiteness_of(random.standard_normal(rows)).white for _ in range(runs))
    assert 0.5 * LEVEL_OF_TESTS < coloured / runs < 1.8 * LEVEL_OF_TESTS
