"""Estimates where stamps, samples or commands are not at the times the log says, or are rounded."""

from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation.methods._method import Run
from deadtime.estimation.methods._output_error import on_regular_times
from marks import NIGHTLY

SAMPLE, DELAY, GAIN = 0.065, 0.3, 0.85


def recorded(times, late=0.0, noise=0.004, seed=0, trim=0.0):
    """A step at the fifth sample, sampled at these times; commands arrive up to `late` later."""
    random = np.random.default_rng(seed)
    reference = np.where(np.arange(times.size) < 5, 0.0, 1.0)
    arrivals = times + DELAY + late * random.random(times.size)
    output, command = np.zeros((2, times.size))
    jumps = np.zeros(times.size)
    for k, time in enumerate(times):
        age = np.maximum(time - arrivals[:k], 0.0)
        output[k] = GAIN * (jumps[:k] @ age) + trim * time + noise * random.standard_normal()
        command[k] = np.clip(1.6 * (reference[k] - output[k]), -1.0, 1.0)
        jumps[k] = command[k] - (command[k - 1] if k else 0.0)
    return dtm.Recording(times, reference, output, command)


LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.6), sample_time=SAMPLE, limit=1.0)
EVEN = SAMPLE * np.arange(120)


def jittered(seed, size=0.01):
    times = EVEN + size * np.random.default_rng(seed + 100).uniform(-1.0, 1.0, EVEN.size)
    return times - times[0]


@pytest.mark.parametrize(("flights", "misses"), [(4, 1), pytest.param(12, 2, marks=NIGHTLY)])
def test_rows_that_are_stamped_late_are_taken_as_even(flights, misses):
    fits = []
    for seed in range(flights):
        flight = recorded(EVEN, seed=seed)
        stamped = replace(flight, time=EVEN + 0.02 * np.random.default_rng(seed).random(EVEN.size))
        fits.append(dtm.estimate_delay(stamped, LOOP, free=("delay", "gain")))
    assert all(fit.details.get("times") == "even" for fit in fits)
    assert sum("evenly spaced" in fit.message for fit in fits) == len(fits)
    assert np.sqrt(np.mean([(fit.delay - DELAY) ** 2 for fit in fits])) < 0.003
    held = [low <= DELAY <= high for low, high in (fit.ci(0.95) for fit in fits)]
    assert sum(held) >= flights - misses


def test_rows_that_are_sampled_unevenly_keep_their_times():
    for seed in range(6):
        fit = dtm.estimate_delay(recorded(jittered(seed), seed=seed), LOOP, free=("delay", "gain"))
        assert "times" not in fit.details
        assert fit.delay == pytest.approx(DELAY, abs=0.008)


def test_regular_times_keep_missing_rows_and_the_clock_of_the_controller():
    kept = np.random.default_rng(1).random(EVEN.size) > 0.2
    kept[:8] = True
    flight = recorded(EVEN, seed=1)
    log = dtm.Recording(
        (EVEN + 0.015 * np.random.default_rng(2).random(EVEN.size))[kept],
        flight.reference[kept],
        flight.output[kept],
        flight.command[kept],
    )
    run = on_regular_times(Run(log, LOOP, (None, None), log.check(LOOP)))
    assert run is not None
    between = np.diff(run.recording.time) / SAMPLE
    assert between == pytest.approx(np.rint(between), abs=1e-9)
    assert np.sum(np.rint(between) - 1.0) == np.sum(~kept)


@pytest.mark.parametrize("slow", [1.0, 1.02])
def test_even_stamps_and_other_clocks_have_no_regular_times(slow):
    log = recorded(EVEN, seed=1)
    stamps = slow * EVEN + (0.015 * np.random.default_rng(2).random(EVEN.size) if slow > 1 else 0.0)
    log = replace(log, time=stamps)
    assert on_regular_times(Run(log, LOOP, (None, None), log.check(LOOP))) is None


@pytest.mark.parametrize(("flights", "misses"), [(6, 2), pytest.param(16, 3, marks=NIGHTLY)])
def test_uneven_samples_with_even_stamps_widen_the_interval(flights, misses):
    held, widths, found = [], [], 0
    for seed in range(flights):
        flight = recorded(jittered(seed, 0.02), seed=seed, noise=0.003)
        fit = dtm.estimate_delay(replace(flight, time=EVEN), LOOP, free=("delay", "gain"))
        found += "scatter_of_rows" in fit.details
        low, high = fit.ci(0.95)
        held.append(low <= DELAY <= high)
        widths.append(high - low)
    known = dtm.estimate_delay(recorded(EVEN, noise=0.003), LOOP, free=("delay", "gain"))
    low, high = known.ci(0.95)
    assert found >= 0.75 * flights
    assert sum(held) >= flights - misses
    assert np.median(widths) > 2.0 * (high - low)


def test_commands_that_arrive_at_scattered_times_are_reported():
    fit = dtm.estimate_delay(
        recorded(EVEN, late=0.06, noise=0.0005, seed=3), LOOP, free=("delay", "gain")
    )
    assert fit.details["scatter_of_commands"] == pytest.approx(0.06 / np.sqrt(12.0), rel=0.6)
    assert "time stamps of the commands have random errors" in fit.message
    low, high = fit.ci(0.95)
    assert low <= DELAY + 0.03 <= high


def test_a_rounded_output_is_on_the_bound_of_its_steps():
    errors, held, reliable = [], [], 0
    for seed in range(8):
        flight = recorded(EVEN, seed=seed, noise=0.001)
        offset = 0.01 * np.random.default_rng(seed).random()
        rounded = 0.01 * np.round((flight.output + offset) / 0.01)
        command = np.clip(1.6 * (flight.reference - flight.output), -1.0, 1.0)
        log = replace(flight, output=rounded, command=command)
        fit = dtm.estimate_delay(log, LOOP, free=("delay", "gain"))
        errors.append(fit.delay - DELAY)
        low, high = fit.ci(0.95)
        held.append(low <= DELAY <= high)
        reliable += fit.verdict == "reliable"
    # The rounding of a row in motion has a deviation of 0.01/sqrt(12), and 15 rows are in motion.
    assert np.sqrt(np.mean(np.square(errors))) < 3.0 * 0.01 / np.sqrt(12.0) / np.sqrt(15.0) / GAIN
    assert sum(held) >= 6
    assert reliable >= 5


def test_air_that_is_not_seen_is_in_the_interval_of_the_gain():
    """A quarter of flights in weak air show none; their gain is known less than without air."""
    fit = dtm.estimate_delay(recorded(EVEN, seed=5), LOOP, free=("delay", "gain"))
    assert fit.noise.air == 0.0
    assert fit.stderr["gain"] > 1.1 * fit.crb.stderr["gain"]
    assert fit.stderr["delay"] < 1.1 * fit.crb.stderr["delay"]
