"""Estimates of plants with several lags and a zero."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import Waveform
from marks import NIGHTLY
from vehicles import answer, record_attitude

VEHICLE = {"delay": 0.047, "lags": (0.15, 0.05), "gain": 0.95}
KNOWN = dtm.ControlLoop(dtm.FactoredPlant([0.1, 0.1]), dtm.P(1.0), sample_time=0.02)
FREE = ("delay", "gain", "lag_1", "lag_2")


def test_the_independent_response_is_that_of_the_plant():
    time = 0.02 * np.arange(80)
    for integrator in (False, True):
        plant = dtm.FactoredPlant([0.15, 0.05], 0.95, 0.03, integrator)
        own = answer(time, time, np.ones(80), **VEHICLE | {"zero": 0.03, "integrator": integrator})
        of_plant = plant.transfer_function().step_response(np.r_[0.0, time[3:] - 0.047]).outputs
        np.testing.assert_allclose(own[3:], np.ravel(of_plant)[1:], atol=1e-9)


@pytest.mark.parametrize("integrator", [False, True])
def test_each_lag_is_recovered_without_noise(integrator):
    recording = record_attitude(0, noise=1e-6, **VEHICLE, integrator=integrator)
    known = KNOWN.replace(plant=dtm.FactoredPlant([0.1, 0.1], integrator=integrator))
    fit = dtm.estimate_delay(recording, known, free=FREE)
    found = fit.loop.parameters
    assert sorted([found["lag_1"], found["lag_2"]]) == pytest.approx([0.05, 0.15], rel=2e-3)
    assert fit.delay == pytest.approx(0.047, rel=2e-3)
    assert fit.lag == pytest.approx(0.2, rel=1e-3)


def test_the_zero_takes_from_the_total_lag():
    recording = record_attitude(1, noise=1e-4, **VEHICLE, zero=0.08)
    known = KNOWN.replace(plant=dtm.FactoredPlant([0.1, 0.1], zero=0.01))
    fit = dtm.estimate_delay(recording, known, free=(*FREE, "zero"))
    assert fit.loop.parameters["zero"] == pytest.approx(0.08, abs=3.0 * fit.stderr["zero"])
    low, high = fit.ci(0.95, "zero")
    assert low < 0.08 < high
    assert high - low < 0.01
    assert fit.delay_plus_lag == pytest.approx(0.167, abs=3e-4)
    low, high = fit.ci(0.95, "delay+lag")
    assert low < fit.delay_plus_lag < high
    # Var(delay + lags - zero) of the joint covariance.
    weights = np.array([{"gain": 0.0, "zero": -1.0}.get(name, 1.0) for name in fit.free])
    assert fit.stderr["delay+lag"] == pytest.approx(np.sqrt(weights @ fit.cov @ weights), rel=1e-6)


def test_intervals_of_each_number_are_as_wide_as_their_errors():
    recording = record_attitude(2, **VEHICLE, zero=0.3)
    known = KNOWN.replace(plant=dtm.FactoredPlant([0.1, 0.04], zero=0.1))
    fit = dtm.estimate_delay(recording, known, free=(*FREE, "zero"))
    for name, error in fit.stderr.items():
        low, high = fit.ci(0.95, name)
        assert 2.5 * error < high - low < 6.0 * error, name
    # The zero is longer than delay and lags, so that the output leads a ramp.
    low, high = fit.ci(0.95, "delay+lag")
    assert low < -0.053 < high < 0.0


@pytest.mark.parametrize(("flights", "misses"), [(6, 1), pytest.param(20, 3, marks=NIGHTLY)])
def test_the_sum_is_covered_where_the_split_is_open(flights, misses):
    held = 0
    for seed in range(flights):
        fit = dtm.estimate_delay(record_attitude(seed, **VEHICLE), KNOWN, free=FREE)
        low, high = fit.ci(0.95, "delay+lag")
        held += low <= 0.247 <= high
        assert high - low < 0.01
    assert held >= flights - misses


def test_two_recordings_are_fitted_together():
    flights = [record_attitude(seed, **VEHICLE) for seed in (1, 2)]
    one = dtm.estimate_delay(flights[0], KNOWN, free=FREE)
    both = dtm.estimate_delay(flights, KNOWN, free=FREE)
    assert [run.noise.white for run in both.runs] == pytest.approx([0.003, 0.003], rel=0.2)
    assert both.runs[0].noise is both.noise
    assert both.runs[1].noise != both.noise
    models = both.to_dict()["noise_models"]
    assert [one["white"] for one in models] == [run.noise.white for run in both.runs]
    assert str(both.runs[1].noise) in both.summary()
    assert both.stderr["delay+lag"] < 0.85 * one.stderr["delay+lag"]
    assert both.delay_plus_lag == pytest.approx(0.247, abs=4.0 * both.stderr["delay+lag"])


def test_the_command_of_the_loop_serves_where_none_was_logged():
    truth = KNOWN.replace(plant=dtm.FactoredPlant([0.2, 0.08], integrator=True), delay=0.1, Kp=1.2)
    random, output = np.random.default_rng(3), []
    time, jumps = 0.05 * np.arange(160), np.zeros(160)
    reference = np.where(time < 1.0, 0.0, 1.0)
    vehicle = {"delay": 0.1, "lags": (0.2, 0.08), "integrator": True}
    for k, now in enumerate(time):
        sent = np.cumsum(jumps[:k])
        path = answer(np.array([now]), time[:k], sent, **vehicle)[0] if k else 0.0
        output.append(path + 0.003 * random.standard_normal())
        jumps[k] = 1.2 * (reference[k] - output[k]) - (sent[-1] if k else 0.0)
    known = truth.replace(delay=None, lag_1=0.1, lag_2=0.1, sample_time=0.05)
    fit = dtm.estimate_delay(dtm.Recording(time, reference, output), known, free=FREE)
    assert fit.method == "waveform"
    assert fit.verdict == "reliable"
    low, high = fit.ci(0.95, "delay+lag")
    assert low <= 0.38 <= high
    with pytest.raises(ValueError, match="lag_1"):
        dtm.estimate_delay(fit.recording, known, free=FREE, method=Waveform(noise="recording"))


def test_a_name_that_the_plant_does_not_have_is_refused():
    with pytest.raises(ValueError, match=r"lag_3.*choose one or more from .*lag_2"):
        dtm.estimate_delay(record_attitude(0, **VEHICLE), KNOWN, free=("delay", "lag_3"))


def test_delay_and_zero_of_a_plant_that_jumps_are_refused_by_name():
    # Rows at 20 ms: a jump 5 ms later by a longer zero gives the same rows.
    time = 0.02 * np.arange(250)
    told = 0.2 * np.sign(np.sin(3.7 * (time - 0.3))) * (time > 0.3)
    output = answer(time, time, told, delay=0.05, lags=(0.1,), zero=0.03)
    other = 0.1 - (0.1 - 0.03) * np.exp(0.005 / 0.1)
    twin = answer(time, time, told, delay=0.045, lags=(0.1,), zero=other)
    np.testing.assert_allclose(twin, output, atol=1e-12)
    recording = dtm.Recording(time, told, output, command=told)
    known = KNOWN.replace(plant=dtm.FactoredPlant([0.1], zero=0.01))
    with pytest.raises(dtm.NotIdentifiableError, match="delay and zero cannot be distinguished"):
        dtm.estimate_delay(recording, known, free=("delay", "gain", "lag_1", "zero"))


def test_a_zero_that_starts_at_none_is_found():
    recording = record_attitude(1, noise=1e-3, **VEHICLE, zero=0.08)
    from_none, from_some = (
        dtm.estimate_delay(
            recording,
            KNOWN.replace(plant=dtm.FactoredPlant([0.1, 0.1], zero=zero)),
            free=(*FREE, "zero"),
        )
        for zero in (0.0, 0.01)
    )
    low, high = from_none.ci(0.99, "delay+lag")
    assert low < 0.167 < high
    assert from_none.delay_plus_lag == pytest.approx(from_some.delay_plus_lag, abs=1e-4)


@pytest.mark.parametrize("seed", [10, 15, 18, 20, 39])
def test_a_lag_that_rows_do_not_resolve_has_no_endless_error(seed):
    row, random = 0.065, np.random.default_rng(seed)
    loop = dtm.ControlLoop(
        dtm.Integrator(0.85, lag=0.002), dtm.P(1.2), delay=0.25, sample_time=row, limit=1.0
    )
    time = row * np.arange(120)
    noise = random.normal(0.0, 0.005, 120)
    target = np.where(time < 1.0 - 1e-9, 0.0, 1.0)
    run = loop.simulate(time, target - noise, reference_time=time, initial_output=0.0)
    recording = dtm.Recording(time, target, run.outputs + noise, run.inputs)
    known = loop.replace(plant=dtm.FactoredPlant([0.1, 0.02], integrator=True), delay=0.0)
    fit = dtm.estimate_delay(recording, known, free=FREE)
    assert all(fit.stderr[name] < row for name in ("delay", "lag_1", "lag_2", "delay+lag"))
    low, high = fit.ci()
    assert low <= 0.25 <= high < low + 3.0 * row
    low, high = fit.ci(0.95, "delay+lag")
    assert low <= 0.252 <= high < low + 0.02
