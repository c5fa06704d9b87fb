"""Least squares on simulated loops, which the kernel does."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import Frequency, Waveform
from deadtime.estimation.methods._method import Run
from deadtime.estimation.methods._waveform import simulated_model
from hypothesis import given, settings, strategies as st

TIME = np.arange(160) * 0.05
STEP = np.where(TIME < 0.5, 0.0, 1.0)


def loop_with(sample_time, limit, lag, path="command"):
    return dtm.ControlLoop(
        dtm.Integrator(0.9, lag),
        dtm.P(1.3),
        delay=0.31,
        sample_time=sample_time,
        limit=limit,
        delay_path=path,
    )


def recorded(loop, noise=0.0, seed=0):
    output = loop.simulate(TIME, STEP, reference_time=TIME).outputs
    output = output + noise * np.random.default_rng(seed).normal(size=TIME.size)
    return dtm.Recording(TIME, STEP, output)


@pytest.mark.parametrize(
    ("method", "free"),
    [
        (Waveform(noise="recording"), ("delay", "gain", "lag")),
        ("grid", ("delay", "gain")),
        ("cta", ("delay", "gain")),
        ("decay", ("delay",)),
        (Frequency(), ("delay", "gain")),
    ],
)
def test_no_search_runs_in_python(method, free, monkeypatch):
    def refused(*_, **__):
        raise AssertionError("a search of SciPy")

    for name in ("least_squares", "minimize"):
        monkeypatch.setattr(f"scipy.optimize.{name}", refused)
    sampled = method != "cta"
    truth = loop_with(0.05 if sampled else None, None, 0.0)
    if method == "decay":
        truth = truth.replace(Kp=0.8)
    known = truth.replace(delay=None)
    fit = dtm.estimate_delay(recorded(truth), known, method=method, free=free)
    assert fit.delay == pytest.approx(0.31, abs=2e-3)


@settings(max_examples=25)
@given(
    st.sampled_from([None, 0.05, 0.08]),
    st.sampled_from([None, 0.8]),
    st.floats(0.05, 0.8),
    st.floats(0.4, 1.5),
    st.floats(0.02, 0.3),
    st.floats(0.025, 0.045),  # a start of whole samples moves one to the other side of the step
)
def test_derivatives_of_a_simulated_loop_are_its_difference_quotients(
    sample_time, limit, delay, gain, lag, start
):
    truth = loop_with(sample_time, limit, 0.1)
    run = Run(recorded(truth), truth)
    model = simulated_model(run, ("delay", "gain", "lag", "start"))
    point = np.array([delay + 1.23e-3, gain, lag, start, 0.03])
    slopes, step = model.problem.jacobian(point), 1e-6
    for column, change in zip(slopes.T, step * np.eye(5), strict=True):
        upper, lower = model.misfit(point + change), model.misfit(point - change)
        quotient = (upper - lower) / (2.0 * step)
        # Rows within a step of a jump of the slope have no quotient.
        close = np.abs(column - quotient) <= 1e-4 * (1.0 + np.abs(column))
        assert np.mean(close) > 0.95


def test_a_loop_that_cannot_be_simulated_has_the_largest_misfit_and_no_slope():
    truth = loop_with(0.05, None, 0.0)
    long = np.arange(4000) * 0.05
    recording = dtm.Recording(long, np.where(long < 1.0, 0.0, 1.0), np.zeros(4000))
    model = simulated_model(Run(recorded(truth), truth), ("delay", "gain"))
    assert np.all(np.abs(model.misfit(np.array([5.0, 900.0, 0.0]))) <= 1e3 * model.size)
    diverging = simulated_model(
        Run(dtm.Recording(long, recording.reference, 0.01 * np.sin(long)), truth), ("delay", "gain")
    )
    point = np.array([0.5, 900.0, 0.0])
    misfit, slopes = diverging.misfit(point), diverging.problem.jacobian(point)
    assert np.max(np.abs(misfit)) == 1e3 * diverging.size
    assert np.all(slopes[np.abs(misfit) >= 1e3 * diverging.size] == 0.0)


def test_numbers_of_a_parametric_plant_are_fitted_by_its_function():
    def lagged(T):
        return [1.0], [T, 1.0]

    plant = dtm.ParametricPlant(lagged, {"T": 0.8})
    truth = dtm.ControlLoop(plant, dtm.PI(1.0, 0.6), delay=0.3, sample_time=0.05)
    known = truth.replace(delay=None)
    fit = dtm.estimate_delay(
        recorded(truth), known, method=Waveform(noise="recording"), free=("delay", "gain")
    )
    assert fit.delay == pytest.approx(0.3, abs=1e-6)
    assert fit.gain == pytest.approx(1.0, abs=1e-6)
