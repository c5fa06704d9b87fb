"""Delay estimation: the paper's numbers, exact recovery, coverage, and refusals."""

import math

import deadtime as dtm
import mpmath
import numpy as np
import pytest
from deadtime.estimation import (
    CTA,
    GCC,
    ARXScan,
    Decay,
    Frequency,
    Graphical,
    Grid,
    OutputError,
    Overshoot,
    Relay,
    Waveform,
)
from deadtime.estimation._estimate import METHODS
from deadtime.estimation._least_squares import whiteness_of
from deadtime.estimation._native import LeastSquaresMinimum
from deadtime.estimation.methods._step_response import dominant_x, exact_x
from hypothesis import given, settings, strategies as st
from scipy.signal import lfilter

TS = 0.065


def record_step(
    delay=0.36,
    gain=1.0,
    lag=0.0,
    Kp=1.31,
    noise=0.0,
    seed=0,
    ts=TS,
    limit=None,
    size=1.0,
    duration=12.0,
    dt=None,
    noise_in_loop=True,
):
    """A simulated recording and the known part of its loop."""
    loop = dtm.ControlLoop(
        dtm.Integrator(gain, lag), dtm.P(Kp), delay=delay, sample_time=ts, limit=limit
    )
    time = np.arange(0.0, duration, dt or ts)
    reference = np.where(time < 1.0 - 1e-9, 0.0, size)
    error = np.random.default_rng(seed).normal(0.0, noise, time.size) if noise else 0.0 * time
    seen = reference - error if noise_in_loop else reference
    output = loop.simulate(time, seen, reference_time=time, initial_output=0.0).outputs + error
    known = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp), sample_time=ts, limit=limit)
    return dtm.Recording(time, reference, output), known


# --- the maps from overshoot to delay -------------------------------------------------------


def test_the_papers_damping_ratio_and_delay():
    # Armah & Yi, section 4.3: Mo = 2.30 % at Kp = 1.31
    assert dtm.damping_ratio(0.0230) == pytest.approx(0.7684, abs=5e-5)
    assert dominant_x(0.0230) / 1.31 == pytest.approx(0.3598, abs=5e-5)


@pytest.mark.parametrize(
    ("gain", "overshoot", "delay"),
    [
        (5, 0.017, 0.0918),
        (6, 0.07, 0.0909),
        (7, 0.22, 0.1036),
        (8, 0.315, 0.1037),
        (9, 0.46, 0.1095),
        (10, 0.75, 0.1297),
    ],
)
def test_the_papers_table_1(gain, overshoot, delay):
    assert dominant_x(overshoot) / gain == pytest.approx(delay, abs=5e-5)


@given(st.floats(1e-4, 0.98))
def test_the_dominant_map_is_the_lambert_w_root(overshoot):
    # Equations 3 and 6 of the paper: s = W0(-x)/Td has the damping ratio of equation 5.
    x = dominant_x(overshoot)
    root = mpmath.lambertw(-x, 0)
    zeta = float(abs(root.real) / abs(root))
    assert zeta == pytest.approx(dtm.damping_ratio(overshoot), rel=1e-11)


@pytest.mark.parametrize("x", [1.0, 1.2, 1.5, 2.5])
def test_the_exact_overshoot_is_x_minus_a_half_from_x_1_on(x):
    assert exact_x(x - 0.5) == pytest.approx(x, rel=1e-14)


def test_the_exact_overshoot_in_its_second_interval():
    for x in np.linspace(2 - math.sqrt(2), 1.0, 9):
        w = 1 - math.sqrt(2 * x - 1)
        piece = 2 * x - x**2 / 2 + (1 - x) * w - w**2 / 2 + w**3 / 6 - 1
        assert exact_x(piece) == pytest.approx(x, abs=1e-13)


@pytest.mark.parametrize(
    ("x", "percent"),
    [(0.6, 11.648091), (0.7, 20.599407), (0.8, 30.158600), (0.9, 40.018058), (1.0, 50.0)],
)
def test_published_values_of_the_exact_overshoot(x, percent):
    assert exact_x(percent / 100) == pytest.approx(x, abs=1e-8)


@pytest.mark.parametrize("x", [0.42, 0.5, 0.65, 0.85, 1.1])
def test_the_exact_overshoot_is_that_of_the_simulated_loop(x):
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(x), delay=1.0)
    peak = loop.simulate(np.linspace(0.0, 25.0, 50_001)).outputs.max() - 1.0
    # the peak is flat: a grid of 5e-4 misses less than |z''|/8 * h^2 < 1e-7 of it
    assert exact_x(peak) == pytest.approx(x, abs=2e-6)


def test_an_overshoot_near_that_of_one_over_e_is_refused():
    with pytest.raises(dtm.NotIdentifiableError, match="is too small"):
        exact_x(1e-9)


@pytest.mark.parametrize("value", [0.0, -0.1, 1.0, 1.7, math.nan])
def test_a_damping_ratio_without_a_solution_is_refused(value):
    with pytest.raises(dtm.NotIdentifiableError, match="valid only from 0 to 100"):
        dtm.damping_ratio(value)


# --- the overshoot method -------------------------------------------------------------------


def test_exact_overshoot_of_a_noise_free_continuous_loop_has_no_bias():
    recording, known = record_step(Kp=1.31, ts=None, dt=0.002, duration=8.0)
    fit = dtm.estimate_delay(recording, known, method=Overshoot(map="exact"))
    # The largest of samples 2 ms apart is below the peak by at most 1e-6 of the step.
    assert fit.delay == pytest.approx(0.36, abs=2e-5)
    dominant = dtm.estimate_delay(recording, known, method=Overshoot(map="dominant"))
    # The dominant pair of roots alone gives a delay that is 0.3 % too long at x = 0.47.
    assert dominant.delay / 0.36 - 1 == pytest.approx(0.0031, abs=2e-4)


def test_the_saturated_map_accounts_for_hold_and_limit():
    recording, known = record_step(Kp=2.4, limit=1.0, size=1.0)
    fit = dtm.estimate_delay(recording, known, method=Overshoot(map="saturated"))
    assert fit.delay == pytest.approx(0.36, abs=1e-6)
    # The maps without hold and limit give these errors.
    exact = dtm.estimate_delay(recording, known, method=Overshoot(map="exact"))
    assert abs(exact.delay - 0.36) > 0.02


def test_the_saturated_map_at_the_overshoot_of_the_paper():
    # The paper's "numerical method" without its coarse step: 0.36864 s from Mo = 2.30 %
    known = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), limit=1.0)
    time = np.arange(0.0, 9.0, 0.001)
    reference = np.where(time < 1.0, 0.0, 1.0)
    truth = known.replace(delay=0.36864)
    output = truth.simulate(time, reference, reference_time=time, initial_output=0.0).outputs
    assert output.max() - 1 == pytest.approx(0.0230, abs=2e-6)
    recording = dtm.Recording(time, reference, output)
    fit = dtm.estimate_delay(recording, known, method=Overshoot(map="saturated"))
    assert fit.delay == pytest.approx(0.36864, abs=1e-6)


def test_the_overshoot_method_gives_no_interval_and_says_why():
    recording, known = record_step(Kp=2.0, noise=0.002)
    fit = dtm.estimate_delay(recording, known, method="overshoot")
    assert not fit.calibrated
    with pytest.raises(ValueError, match="too high on average"):
        fit.ci(0.95)
    assert "no interval" in fit.summary()


def test_the_standard_error_by_the_exact_map_has_a_closed_form():
    # From x = 1 on, x is the overshoot plus a half: the delay is as uncertain as it, over K.
    recording, known = record_step(Kp=3.0, noise=0.002, ts=None, dt=0.01)
    fit = dtm.estimate_delay(recording, known, method=Overshoot(map="exact"))
    noise = fit.details["overshoot_noise"]
    assert noise == pytest.approx(0.002 * math.sqrt(1.0 + 1.0 / 100), rel=0.2)
    assert fit.stderr["delay"] == pytest.approx(noise / 3.0, rel=1e-6)


def test_a_step_without_overshoot_is_refused_by_name():
    recording, known = record_step(Kp=0.9)  # x = 0.324 < 1/e
    with pytest.raises(dtm.NotIdentifiableError, match=r"no overshoot.*1/e"):
        dtm.estimate_delay(recording, known, method="overshoot")


def test_an_overshoot_within_the_noise_is_refused():
    recording, known = record_step(Kp=1.2, noise=0.01, seed=3)
    with pytest.raises(dtm.NotIdentifiableError, match="noise"):
        dtm.estimate_delay(recording, known, method="overshoot")


def test_the_overshoot_method_is_for_an_integrator_under_p_control():
    recording, known = record_step(Kp=2.0)
    with pytest.raises(ValueError, match="Integrator under P control"):
        dtm.estimate_delay(
            recording, known.replace(controller=dtm.PV(2.0, 0.1)), method="overshoot"
        )


def test_two_steps_in_the_window_are_refused():
    recording, known = record_step(Kp=2.0)
    twice = dtm.Recording(
        recording.time, np.where(recording.time > 6, 2.0, recording.reference), recording.output
    )
    with pytest.raises(dtm.NotIdentifiableError, match="2 steps"):
        dtm.estimate_delay(twice, known, method="overshoot")


# --- the waveform method --------------------------------------------------------------------


@pytest.mark.parametrize("ts", [TS, None])
@pytest.mark.parametrize(
    ("delay", "gain", "lag"), [(0.36, 1.0, 0.0), (0.05, 1.0, 0.0), (0.26, 0.85, 0.17)]
)
def test_a_noise_free_recording_is_recovered_exactly(delay, gain, lag, ts):
    recording, known = record_step(
        delay, gain, lag, Kp=2.0, ts=ts, dt=TS, limit=None if ts is None else 1.0
    )
    free = ("delay", "gain", "lag") if lag else ("delay", "gain")
    fit = dtm.estimate_delay(recording, known, free=free)
    # The tolerance is far below the 0.01 ms of a jump between two grid points.
    assert fit.delay == pytest.approx(delay, abs=1e-7)
    assert fit.gain == pytest.approx(gain, abs=1e-6)
    assert fit.lag == pytest.approx(lag, abs=1e-6)
    assert fit.verdict == "reliable"


def test_the_whole_step_may_begin_at_the_limit():
    recording, known = record_step(0.4, 0.9, Kp=2.4, limit=0.5, size=2.0, duration=15.0)
    fit = dtm.estimate_delay(recording, known)
    assert (fit.delay, fit.gain) == pytest.approx((0.4, 0.9), abs=1e-7)


@pytest.mark.survey
def test_intervals_cover_as_often_as_stated():
    # Noise outside the loop: residuals are white, and 95 % intervals should contain the true value
    # in 95 of 100. With correct intervals fewer than 86 of 100 occurs once in 2000 times.
    held = 0
    for seed in range(100):
        recording, known = record_step(
            0.36, noise=0.01, seed=seed, noise_in_loop=False, duration=8.0
        )
        fit = dtm.estimate_delay(recording, known, free=("delay",))
        low, high = fit.ci(0.95)
        held += low <= 0.36 <= high
    assert held >= 86


def test_the_standard_error_is_the_cramer_rao_bound_when_residuals_are_white():
    recording, known = record_step(0.36, noise=0.01, seed=3, noise_in_loop=False)
    fit = dtm.estimate_delay(recording, known)
    assert fit.whiteness.white
    assert fit.crb.free == ("delay", "gain", "initial output")
    assert fit.stderr["delay"] == fit.crb.stderr["delay"]
    # sigma / sqrt(sum of squared sensitivities), by difference quotients of the simulator
    step = 1e-5

    def output(**change):
        loop = fit.loop.replace(**change)
        return loop.simulate(
            recording.time,
            recording.reference,
            reference_time=recording.time,
            initial_output=fit.details["initial_output"],
        ).outputs

    columns = [
        (output(**{name: value + step}) - output(**{name: value - step})) / (2 * step)
        for name, value in (("delay", fit.delay), ("gain", fit.gain))
    ]
    shifted = fit.loop.simulate(
        recording.time,
        recording.reference,
        reference_time=recording.time,
        initial_output=fit.details["initial_output"] + step,
    ).outputs
    columns.append((shifted - output()) / step)
    information = np.array(columns) @ np.array(columns).T / fit.crb.noise.white**2
    bound = np.sqrt(np.linalg.inv(information)[0, 0])
    assert fit.crb.stderr["delay"] == pytest.approx(bound, rel=1e-3)


def test_a_lag_missing_from_the_model_is_detected():
    recording, known = record_step(0.26, 0.9, 0.2, Kp=2.0, noise=0.001, seed=2)
    without = dtm.estimate_delay(recording, known, free=("delay", "gain"))
    assert without.verdict != "reliable"
    assert "a further lag of 0." in without.message
    with_lag = dtm.estimate_delay(recording, known, free=("delay", "gain", "lag"))
    assert with_lag.delay == pytest.approx(0.26, abs=0.02)
    assert with_lag.rms < 0.5 * without.rms
    # The sum is known far better than its parts.
    assert with_lag.stderr["delay+lag"] < 0.5 * with_lag.stderr["delay"]


def test_an_absent_lag_is_estimated_at_its_bound():
    recording, known = record_step(0.36, 1.0, 0.0, Kp=2.0, noise=0.002, seed=5)
    fit = dtm.estimate_delay(recording, known, free=("delay", "gain", "lag"))
    assert fit.lag >= 0.0
    assert fit.delay_plus_lag == pytest.approx(0.36, abs=0.01)
    assert fit.ci(0.95, "lag")[0] == 0.0


@settings(max_examples=8)
@given(st.floats(0.02, 0.8), st.floats(0.4, 2.0), st.floats(0.3, 1.3))
def test_any_stable_loop_is_recovered(delay, gain, x):
    recording, known = record_step(delay, gain, Kp=x / (gain * (delay + TS)), duration=20.0)
    fit = dtm.estimate_delay(recording, known)
    assert fit.delay == pytest.approx(delay, abs=1e-6)
    assert fit.gain == pytest.approx(gain, rel=1e-6)


def test_a_window_that_begins_in_motion_uses_the_commands_before_it():
    recording, known = record_step(0.36, 0.9, Kp=2.4, duration=20.0)
    moving = dtm.Recording(
        recording.time, np.where(recording.time > 10, 1.5, recording.reference), recording.output
    )
    loop = known.replace(delay=0.36, gain=0.9)
    moving = dtm.Recording(
        moving.time,
        moving.reference,
        loop.simulate(
            moving.time, moving.reference, reference_time=moving.time, initial_output=0.0
        ).outputs,
    )
    # 3 s after the first step, commands of 1e-2 are still in transit.
    fit = dtm.estimate_delay(moving, known, window=(4.0, 20.0))
    assert fit.delay == pytest.approx(0.36, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"window": (6.0, 11.0)}, "does not excite"),
        ({"window": (0.0, 1.05)}, "too few"),
        ({"free": ()}, "one or more"),
        ({"free": ("delay", "mass")}, "choose one or more from"),
        ({"free": ("gain",)}, "unknown"),
        ({"method": "magic"}, "not one of"),
    ],
)
def test_what_cannot_be_estimated_is_refused_with_the_reason(change, words):
    recording, known = record_step(Kp=2.0)
    with pytest.raises((dtm.DeadtimeError, ValueError), match=words):
        dtm.estimate_delay(recording, known, **change)


def test_a_method_name_means_the_method_with_default_options():
    recording, known = record_step(Kp=2.0, noise=0.01)
    for name, kind in METHODS.items():
        assert kind().name == name
    by_name = dtm.estimate_delay(recording, known, method="waveform")
    by_object = dtm.estimate_delay(recording, known, method=Waveform())
    assert by_name == by_object
    with pytest.raises(TypeError, match=r"such as Waveform\(\), not ABCMeta"):
        dtm.estimate_delay(recording, known, method=Waveform)


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        (Waveform, {"noise": "white"}, "'auto', 'recording', 'loop'"),
        (Waveform, {"initial_output": math.inf}, "initial_output=inf"),
        (OutputError, {"initial_output": math.nan}, "initial_output=nan"),
        (Overshoot, {"map": "second"}, "'dominant', 'exact', 'saturated'"),
        (Frequency, {"period": 0.0}, "period=0.0"),
        (Frequency, {"left_out": -1}, "left_out=-1"),
        (Frequency, {"highest": -2.0}, "highest=-2.0"),
        (Grid, {"delays": [0.2, 0.1, 0.3]}, "delays"),
        (CTA, {"intervals": 25}, "intervals=25"),
        (Decay, {"tail": 1.0}, "below 1"),
        (Graphical, {"shares": (0.3, 0.1)}, "increasing"),
        (Relay, {"amplitude": 0.0}, "amplitude=0.0"),
        (GCC, {"weighting": "roth"}, "'prewhitened'"),
        (ARXScan, {"na": -1}, "na=-1"),
    ],
)
def test_options_are_checked_when_the_method_is_made(kind, options, words):
    with pytest.raises(ValueError, match=words):
        kind(**options)


def test_a_constant_output_is_refused():
    recording, known = record_step(Kp=2.0)
    still = dtm.Recording(recording.time, recording.reference, 0.0 * recording.time)
    with pytest.raises(dtm.NotIdentifiableError, match="did not move"):
        dtm.estimate_delay(still, known)


def test_a_reference_that_copies_the_output_is_refused():
    # As autopilots log it while a mode is inactive; cross-correlation would say 0.000 s.
    recording, known = record_step(Kp=2.0, noise=0.01)
    copy = dtm.Recording(recording.time, recording.output, recording.output)
    with pytest.raises(dtm.NotIdentifiableError, match="setpoint is inactive"):
        dtm.estimate_delay(copy, known)


def test_wrong_types_are_named():
    recording, known = record_step(Kp=2.0)
    with pytest.raises(TypeError, match="must be a Recording"):
        dtm.estimate_delay([1, 2], known)
    with pytest.raises(TypeError, match="must be a ControlLoop"):
        dtm.estimate_delay(recording, 2.0)


# --- residuals ------------------------------------------------------------------------------


def test_white_residuals_pass_and_coloured_ones_do_not():
    rng = np.random.default_rng(0)
    white = rng.normal(size=400)
    assert whiteness_of(white).white
    coloured = np.convolve(white, [1, 0.6, 0.3], mode="valid")
    assert not whiteness_of(coloured).white
    assert whiteness_of(np.zeros(50)).white


def test_white_residuals_are_rejected_at_the_stated_rate():
    rng = np.random.default_rng(1)
    rejected = sum(not whiteness_of(rng.normal(size=200)).white for _ in range(600))
    # 1 % of 600 is 6; more than 18 has probability below 1e-4
    assert rejected <= 18


def errors_of_a_mean(residuals):
    """The standard errors of a mean with these residuals, as white ones and as coloured ones."""
    n = residuals.size
    found = LeastSquaresMinimum(np.zeros(1), residuals, np.ones((n, 1)))
    return [math.sqrt(cov[0, 0]) for cov in found.spreads([0], [n])]


def test_robust_standard_errors_are_right_for_coloured_noise_and_white_ones_are_not():
    # Mean of an AR(1) process: its standard deviation is known, sigma sqrt((1+rho)/(1-rho)/n).
    rng = np.random.default_rng(2)
    n, rho = 2000, 0.7
    noise = rng.normal(size=n + 200)
    process = np.zeros(n + 200)
    for k in range(1, n + 200):
        process[k] = rho * process[k - 1] + noise[k]
    residuals = process[200:] - process[200:].mean()
    truth = math.sqrt(1 / (1 - rho) ** 2 / n)
    white, robust = errors_of_a_mean(residuals)
    assert robust == pytest.approx(truth, rel=0.25)
    assert white < 0.6 * truth


def test_the_bandwidth_grows_with_the_correlation():
    # With Andrews' bandwidth of 41 lags Bartlett's kernel loses a quarter of the variance.
    rng = np.random.default_rng(3)
    n, rho = 500, 0.9
    processes = lfilter([1.0], [1.0, -rho], rng.normal(size=(60, n + 200)))[:, 200:]
    found = [errors_of_a_mean(one - one.mean())[1] ** 2 for one in processes]
    assert np.mean(found) * n * (1 - rho) ** 2 == pytest.approx(0.7, abs=0.12)


@pytest.mark.parametrize("free", [("delay",), ("delay", "gain"), ("delay", "gain", "lag")])
def test_a_search_for_an_absent_delay_terminates(free):
    """A continuous fit must not approach zero delay and lag by ever more costly simulations."""
    time = np.arange(0.0, 12.0, 0.065)
    reference = np.where(time >= 3.0, 1.0, 0.0)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.4))
    noise = 0.002 * np.random.default_rng(0).normal(size=len(time))
    output = loop.replace(delay=0.0).simulate(time, reference).outputs + noise
    fit = dtm.estimate_delay(dtm.Recording(time, reference, output), loop, free=free)
    assert fit.delay == 0.0
    assert fit.lag == 0.0
