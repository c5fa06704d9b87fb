"""The cost over a grid of delays, and the Chebyshev approximation of the delay."""

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import CTA, Grid
from deadtime.estimation.methods._method import paired_runs
from step_recordings import (
    TS,
    delay_errors,
    noise_for_output,
    record_step,
    replace_signals,
    root_mean_square,
)

METHODS = ("grid", "cta")


# --- grid -----------------------------------------------------------------------------------


@pytest.mark.parametrize("ts", [None, TS])
def test_the_grid_method_is_exact_for_an_exact_model(ts):
    recording, known = record_step(gain=0.8, lag=0.15, ts=ts, dt=TS, duration=6.0)
    fit = dtm.estimate_delay(
        recording, known.replace(gain=1.0), method="grid", free=("delay", "gain", "lag")
    )
    assert fit.delay == pytest.approx(0.36, abs=1e-7)
    assert fit.gain == pytest.approx(0.8, abs=1e-7)
    assert fit.lag == pytest.approx(0.15, abs=1e-7)
    assert fit.verdict == "reliable"


def test_the_cost_curve_is_kept_and_its_local_minima_are_named():
    # In a limit cycle a delay that is off by a period fits almost as well.
    recording, known = record_step(Kp=4.6, limit=0.5, noise=0.01, duration=9.0, noise_in_loop=False)
    fit = dtm.estimate_delay(recording, known, method="grid", free=("delay",))
    delays, costs = np.array(fit.details["delays"]), np.array(fit.details["costs"])
    assert delays.shape == costs.shape
    assert fit.delay == pytest.approx(0.36, abs=0.01)
    lowest = delays[np.argmin(costs)]
    assert abs(lowest - fit.delay) < 0.15 * fit.delay
    assert lowest in fit.details["local_minima"]


def test_a_grid_may_be_given():
    recording, known = record_step()
    grid = np.linspace(0.2, 0.6, 9)
    fit = dtm.estimate_delay(recording, known, method=Grid(delays=grid), free=("delay",))
    assert fit.details["delays"] == pytest.approx(grid.tolist())
    assert fit.delay == pytest.approx(0.36, abs=1e-9)
    with pytest.raises(dtm.NotIdentifiableError, match="other `delays`"):
        dtm.estimate_delay(recording, known, method=Grid(delays=[0.1, 0.15, 0.2]), free=("delay",))
    with pytest.raises(ValueError, match="three"):
        dtm.estimate_delay(recording, known, method=Grid(delays=[0.1, 0.2]))


@pytest.mark.parametrize(
    ("case", "published"),
    [
        ("continuous, Kp 1.31", 0.90),
        ("continuous, Kp 3", 0.14),
        ("0.3 %", 0.84),
        ("1 %", 2.80),
        ("3 %", 8.39),
        ("1 %, Kp 3", 2.74),
        ("1 %, Kp 3, no limit", 1.04),
    ],
)
def test_the_errors_of_the_grid_are_those_of_the_benchmark(case, published):
    # 24 recordings: the root mean square is known to 14 %.
    errors, _ = delay_errors(case, 24, Grid(initial_output=0.0))
    assert root_mean_square(errors) < 1.2 * published * 1.14


def test_the_curvature_gives_the_spread_for_noise_outside_the_loop():
    errors, stderrs = [], []
    for seed in range(24):
        recording, known = record_step(noise=0.01, seed=seed, noise_in_loop=False)
        fit = dtm.estimate_delay(recording, known, method="grid", free=("delay",))
        errors.append(fit.delay - 0.36)
        stderrs.append(fit.stderr["delay"])
        low, high = fit.details["curvature_interval_95"]
        assert low < fit.delay < high
    assert root_mean_square(errors) / np.mean(stderrs) == pytest.approx(1.0, abs=0.4)
    with pytest.raises(ValueError, match="ignores that"):
        fit.ci()


# --- cta ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("Kp", "published"),
    [(1.31, (-4.2, -0.21, 0.004, 0.000)), (3.0, (-15.7, -1.6, 0.05, 0.000))],
)
def test_few_intervals_have_the_published_bias(Kp, published):
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp), delay=0.36, delay_path="measurement")
    time = np.arange(0.0, 5.0, 0.01)
    recording = dtm.Recording(time, np.ones(time.size), loop.simulate(time, 1.0).outputs)
    for intervals, bias in zip((2, 3, 4, 6), published, strict=True):
        fit = dtm.estimate_delay(
            recording,
            loop.replace(delay=None),
            method=CTA(intervals=intervals, initial_output=0.0),
            free=("delay",),
        )
        assert 1e3 * (fit.delay - 0.36) == pytest.approx(bias, rel=0.05, abs=5e-3)


def test_chebyshev_with_a_lag_and_two_steps():
    loop = dtm.ControlLoop(dtm.Integrator(0.8, 0.1), dtm.P(2.0), delay=0.36)
    time = np.arange(0.0, 8.0, 0.04)
    reference = np.where(time < 1.0, 0.0, np.where(time < 4.0, 1.0, 0.5))
    output = loop.simulate(time, reference, reference_time=time).outputs
    fit = dtm.estimate_delay(
        dtm.Recording(time, reference, output),
        loop.replace(delay=None, lag=0.0, gain=1.0),
        method="cta",
        free=("delay", "gain", "lag"),
    )
    assert fit.delay == pytest.approx(0.36, abs=1e-5)
    assert fit.gain == pytest.approx(0.8, abs=1e-5)
    assert fit.lag == pytest.approx(0.1, abs=1e-5)


def test_chebyshev_with_noise_equals_the_fit_of_the_waveform():
    for case, published in (("continuous, Kp 1.31", 0.90), ("continuous, Kp 3", 0.14)):
        errors, _ = delay_errors(case, 5, CTA(initial_output=0.0))
        assert root_mean_square(errors) < 1.2 * published * 1.4


@pytest.mark.parametrize(
    ("change", "words"),
    [({"sample_time": TS}, "a hold"), ({"limit": 1.0}, "a limit")],
)
def test_chebyshev_is_for_linear_continuous_loops(change, words):
    recording, known = record_step(ts=None, dt=0.02, limit=None)
    with pytest.raises(ValueError, match=words):
        CTA().estimate(paired_runs(recording, known.replace(**change)), ("delay",))


def test_the_delay_line_has_1_to_24_intervals():
    for intervals in (1, 24):
        assert CTA(intervals=intervals).intervals == intervals
    for intervals in (0, 25):
        with pytest.raises(ValueError, match="intervals"):
            CTA(intervals=intervals)


# --- refusals of both -----------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_recordings_without_information_are_refused(method):
    recording, known = record_step(
        ts=None, dt=0.04, limit=None, rest=1.0, noise=0.003, noise_in_loop=False
    )

    def estimate(recording, **options):
        return dtm.estimate_delay(recording, known, method=method, **options)

    with pytest.raises(dtm.NotIdentifiableError, match="does not excite"):
        estimate(recording, window=(4.8, 6.0))
    with pytest.raises(dtm.NotIdentifiableError, match="did not move"):
        estimate(replace_signals(recording, output=np.zeros(len(recording))))
    with pytest.raises(dtm.NotIdentifiableError, match="too few"):
        estimate(recording, window=(0.5, 1.1))
    with pytest.raises(ValueError, match="unknown"):
        estimate(recording, free=("gain",))
    for seed in range(4):
        with pytest.raises(dtm.NotIdentifiableError):
            estimate(noise_for_output(recording, seed), free=("delay", "gain"))
