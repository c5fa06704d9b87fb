"""Estimates over a link whose delays scatter, and that loses commands."""

import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime.flights._arrivals import Effects, as_they_took_effect, error_of_mean
from deadtime.flights._plants import fit_by_evidence
from marks import NIGHTLY
from uneven_link import LAG, SAMPLE, STEP, flight

#: Of the link in each direction: mean and standard deviation of its delays, s, and what it loses.
MEAN, DEVIATION, LOSS = 0.13, 0.02, 0.05


def loop_of(flown):
    plant = dtm.Integrator(lag=0.1)
    return dtm.ControlLoop(plant, flown.controller, sample_time=SAMPLE, limit=1.0)


def from_the_mean(fit, age):
    """Error of delay and lag against the mean, and whether the interval holds the mean."""
    # A lost command waits for the next; commands act at steps of the simulation.
    mean = MEAN + LOSS / (1.0 - LOSS) * SAMPLE + 0.5 * STEP + LAG + age
    low, high = fit.ci(0.95, "delay+lag")
    return fit.delay_plus_lag - mean, low < mean < high


def by_evidence(folder, seed):
    flown, age = flight(folder, seed, MEAN, DEVIATION, LOSS)
    fit, _ = fit_by_evidence([flown], 1.0, None)
    return from_the_mean(fit, age)


def by_known_plant(folder, seed):
    flown, age = flight(folder, seed, MEAN, DEVIATION, LOSS)
    fit = dtm.estimate_delay(
        flown.measured,
        loop_of(flown),
        method="output_error",
        free=("delay", "gain", "lag"),
        window=(0.5 * flown.settle, None),
    )
    return from_the_mean(fit.with_error_beside(error_of_mean([flown.effects])), age)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=NIGHTLY) for k in (1, 2))])
def test_the_estimate_is_the_mean_of_the_delays(tmp_path, seed):
    error, is_held = by_evidence(tmp_path, seed)
    assert is_held
    # The first commands of two steps alone have 17 ms.
    assert abs(error) < 0.012


@pytest.mark.long
@pytest.mark.survey
def test_intervals_hold_the_mean_in_80_flights(tmp_path):
    # The first of 200 flights, of which the pages give the figures.
    errors, held = zip(*[by_known_plant(tmp_path, seed) for seed in range(1000, 1080)], strict=True)
    assert np.mean(held) >= 0.93
    assert np.std(errors) < 0.005
    assert abs(np.mean(errors)) < 0.003


def sent(count=60):
    return Effects(SAMPLE * np.arange(count), np.random.default_rng(1).standard_normal(count))


def reported(time, values, effect, spacing):
    """Reports of what is followed, where commands take effect at `effect`, if ever."""
    report = np.arange(0.0, time[-1] + 1.0, spacing)
    order = np.argsort(effect, kind="stable")
    rows = np.searchsorted(effect[order], report, side="right") - 1
    return report, np.where(rows >= 0, values[order][np.maximum(rows, 0)], 0.0)


def test_commands_are_moved_by_their_deviations_from_the_mean():
    commands = sent()
    late = 0.2 + 0.01 * np.random.default_rng(2).standard_normal(commands.time.size)
    told = reported(*commands[:2], commands.time + late, 0.001)
    # The vehicle's clock has another zero.
    found = as_they_took_effect(commands, told[0] - 0.15, told[1])
    np.testing.assert_array_equal(found.values, commands.values)
    np.testing.assert_allclose(found.time - commands.time, late - late.mean(), atol=1e-3)
    assert found.error == pytest.approx(0.001 / math.sqrt(12.0), rel=0.01)


def test_a_lost_command_has_the_value_before_and_counts_until_the_next():
    commands = sent()
    effect = commands.time + 0.2
    effect[30] = np.inf
    found = as_they_took_effect(commands, *reported(*commands[:2], effect, 0.001))
    commands.values[30] = commands.values[29]
    np.testing.assert_array_equal(found.values, commands.values)
    moved = found.time - commands.time
    np.testing.assert_allclose(moved, -SAMPLE / commands.time.size, atol=6e-4)


def test_an_even_link_moves_nothing():
    commands = sent()
    # Middles between reports scatter by 6 ms, which is no scatter of the link.
    found = as_they_took_effect(commands, *reported(*commands[:2], commands.time + 0.2, 0.02))
    np.testing.assert_allclose(found.time, commands.time, atol=2e-3)


def test_a_vehicle_without_echoes_keeps_the_times_of_sending():
    commands = sent()
    assert as_they_took_effect(commands, np.empty(0), np.empty(0)) is commands
    report = np.arange(0.0, 4.0, 0.02)
    assert as_they_took_effect(commands, report, np.sin(report)) is commands


def test_without_echoes_the_way_there_is_taken_to_scatter_as_the_way_back(tmp_path):
    flown, _ = flight(tmp_path, 5, MEAN, DEVIATION, 0.0, echoes=False)
    np.testing.assert_array_equal(flown.effects.time, flown.recording.time)
    # Messages that a newer one has overtaken are not among them.
    assert 0.7 * DEVIATION < flown.effects.error < DEVIATION


def test_the_error_of_the_mean_counts_the_commands_that_decide():
    steps = np.array([0.0, 1.0, 0.0, 1.0, 0.0])
    one = Effects(np.arange(5.0), steps, 0.01)
    assert error_of_mean([one]) == pytest.approx(0.005)
    assert error_of_mean([one, one]) == pytest.approx(0.01 / math.sqrt(8.0))
    assert error_of_mean([]) == 0.0


def test_intervals_are_widened_in_quadrature(tmp_path):
    flown, _ = flight(tmp_path, 3, deviation=0.0, loss=0.0)
    free = ("delay", "gain", "lag")
    fit = dtm.estimate_delay(flown.measured, loop_of(flown), method="output_error", free=free)
    wider = fit.with_error_beside(0.01)
    assert fit.with_error_beside(0.0) is fit
    assert wider.ci(0.95, "gain") == fit.ci(0.95, "gain")
    for name in ("delay", "delay+lag"):
        assert wider.stderr[name] == pytest.approx(math.hypot(fit.stderr[name], 0.01))
        value = fit._value(name)
        for end, before in zip(wider.ci(0.95, name), fit.ci(0.95, name), strict=True):
            assert abs(end - value) == pytest.approx(math.hypot(before - value, 0.0196), rel=1e-3)
        _, t = wider.profile(name, wider.ci(0.95, name))
        assert t == pytest.approx([1.96, 1.96], abs=0.06)
    place = fit.free.index("delay")
    assert wider.cov[place, place] == pytest.approx(fit.cov[place, place] + 1e-4)
    again = wider.with_error_beside(0.01)
    assert again.stderr["delay"] == pytest.approx(math.hypot(fit.stderr["delay"], 0.01 * 2**0.5))


def test_reports_of_equal_commands_are_told_apart():
    # Of a height in steps of 1 mm: at rest a few values come again and again.
    random = np.random.default_rng(5)
    time = SAMPLE * np.arange(200)
    motion = 0.7 * np.exp(-np.maximum(time - 6.5, 0.0)) * (time > 6.5)
    values = 1e-3 * np.round(1e3 * (motion + 0.002 * random.standard_normal(time.size)))
    report = 0.005 * np.arange(2700)
    setpoint = values[np.clip(np.searchsorted(time + 0.26, report) - 1, 0, None)]
    found = as_they_took_effect(Effects(time, values), report, setpoint)
    changed = np.append(True, np.diff(values) != 0.0)
    sent = time[changed]
    # Those that repeat the one before are there, too.
    assert np.max(np.diff(found.time)) < 1.2 * SAMPLE
    moves = np.append(True, np.diff(found.values) != 0.0)
    found = Effects(found.time[moves], found.values[moves])
    # Within the time between two reports.
    assert found.time.size > 0.9 * sent.size
    nearest = np.min(np.abs(found.time[:, None] - sent), axis=1)
    assert np.all(nearest < 0.006)
    places = np.argmin(np.abs(found.time[:, None] - sent), axis=1)
    assert np.array_equal(found.values, values[changed][places])
