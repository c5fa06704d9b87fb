"""Rows of a rounded output, read as intervals."""

from __future__ import annotations

import pickle
from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from marks import NIGHTLY
from scipy import stats

STEP, DELAY, GAIN = 0.01, 0.3, 0.85


def flight(seed: int, step: float = 1.0) -> dtm.Recording:
    loop = dtm.ControlLoop(
        dtm.Integrator(GAIN), dtm.P(1.6), delay=DELAY, sample_time=0.065, limit=1.0
    )
    experiment = dtm.Experiment.step(6.5, step, sample_time=0.065, rest=0.65)
    run = experiment.run(loop, noise=0.001, seed=seed)
    offset = np.random.default_rng(seed).uniform(-0.5, 0.5) * STEP
    output = STEP * np.round((run.output + offset) / STEP)
    return replace(run, output=output)


def estimated(recordings: list[dtm.Recording]) -> dtm.DelayEstimate:
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.6), sample_time=0.065, limit=1.0)
    return dtm.estimate_delay(
        recordings, [loop] * len(recordings), method="output_error", free=("delay", "gain")
    )


@pytest.mark.parametrize(("flights", "least"), [(6, 4), pytest.param(12, 9, marks=NIGHTLY)])
def test_intervals_of_rounded_flights_cover_and_their_errors_are_those_of_the_bound(
    flights: int, least: int
) -> None:
    errors, held, bounds, read = [], [], [], 0
    for seed in range(flights):
        fit = estimated([flight(seed)])
        # In some flights rounding errors are taken for air, and their rows for values.
        read += "interval as wide as its rounding" in fit.message
        errors.append(fit.delay - DELAY)
        bounds.append(fit.crb.stderr["delay"])
        held.append(
            [
                low <= true <= high
                for (low, high), true in ((fit.ci(), DELAY), (fit.ci(name="gain"), GAIN))
            ]
        )
    assert read >= least
    # Their own bounds scatter, as the noise is known from the few rows next to a step.
    assert np.sqrt(np.mean(np.square(errors))) < 1.7 * np.median(bounds)
    # Of 12 intervals that hold in 95 %, fewer than 9 do once in 450, as of 6 fewer than 4.
    assert np.all(np.sum(held, axis=0) >= least)


def test_its_profile_is_zero_at_the_estimate_and_the_quantile_at_the_ends() -> None:
    fit = estimated([flight(3)])
    low, high = fit.ci(0.95)
    _, t = fit.profile("delay", [low, fit.delay, high])
    rows = fit.recording.time.size
    assert t == pytest.approx(
        [stats.t.ppf(0.975, rows - 4), 0.0, stats.t.ppf(0.975, rows - 4)], abs=0.05
    )
    again = pickle.loads(pickle.dumps(fit))
    assert again.ci(0.95) == fit.ci(0.95)


def test_rounded_recordings_are_fitted_jointly() -> None:
    alone = [estimated([flight(seed, size)]) for seed, size in ((5, 1.0), (6, -0.7))]
    both = estimated([flight(5, 1.0), flight(6, -0.7)])
    assert len(both.runs) == 2
    weights = np.array([one.stderr["delay"] ** -2.0 for one in alone])
    mean = float(weights @ [one.delay for one in alone] / weights.sum())
    assert both.delay == pytest.approx(mean, abs=1.5 * both.stderr["delay"])
    assert both.stderr["delay"] == pytest.approx(weights.sum() ** -0.5, rel=0.4)
